"""Configurations that no network can have are refused; the others survive JSON."""

import pytest

from model.config import PRESETS, NetworkConfig, preset


@pytest.mark.parametrize(
    "changes",
    [
        {"classes": ()},
        {"classes": ("ball", "ball")},
        {"patch_size": 0},
        {"face_budget": 0},
        {"channels": (8, 16), "targets": (400, 300, 200)},
        {"channels": (), "targets": ()},
        {"targets": (400, 300, 0)},
        {"convolutions": 0},
        {"pooling": "learnt"},
        {"patchsize": 10},
    ],
)
def test_impossible_settings_are_refused(changes):
    with pytest.raises(ValueError, match=r".+"):
        NetworkConfig(**({"classes": ("ball", "box")} | changes))


def test_json_round_trip(config):
    assert NetworkConfig.from_json(config.to_json()) == config


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"classes": ["a"], "surprise": 1}'])
def test_other_json_is_refused(text):
    with pytest.raises(ValueError, match=r".+"):
        NetworkConfig.from_json(text)


def test_presets_are_networks_and_others_are_unknown():
    for name in PRESETS:
        assert preset(name, ("ball", "box")).levels == 3
    with pytest.raises(ValueError, match="paper"):
        preset("huge", ("ball", "box"))
