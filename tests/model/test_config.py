"""Configurations that no network can have are refused; the others survive JSON."""

import pytest
from click.testing import CliRunner
from pydantic import TypeAdapter

from meshconv3d.model.config import PRESETS, NetworkConfig, preset
from meshconv3d.service.cli.main import commands


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
        {"literal_pooling": True},
    ],
)
def test_impossible_settings_are_refused(changes):
    with pytest.raises(ValueError, match=r".+"):
        NetworkConfig(**({"classes": ("ball", "box")} | changes))


def test_json_round_trip(config):
    stored = TypeAdapter(NetworkConfig)
    assert stored.validate_json(stored.dump_json(config)) == config


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"classes": ["a"], "surprise": 1}'])
def test_other_json_is_refused(text):
    with pytest.raises(ValueError, match=r".+"):
        TypeAdapter(NetworkConfig).validate_json(text)


def test_settings_go_over_a_preset():
    config = preset("objects", ("ball", "box"), {"patch_size": 16, "dropout": 0.1})
    assert (config.patch_size, config.dropout, config.integral_invariants) == (16, 0.1, True)
    with pytest.raises(ValueError, match=r"patch_size: Input should be greater.*dropout: Input"):
        preset("default", ("ball", "box"), {"patch_size": 0, "dropout": 2})


def test_the_preset_paper_is_the_letter():
    config = preset("paper", ("ball", "box"))
    assert config.axes == "file"
    assert (config.patch_size, config.patch_reduction) == (10 + 1, "sum")
    assert (config.pooling, config.pooling_norm, config.literal_pooling) == (
        "learned",
        "squared",
        True,
    )
    assert (config.convolutions, config.targets, config.readout) == (1, (400, 300, 200), "mean")


@pytest.mark.parametrize(
    ("setting", "message"),
    [
        ("patch_size", "'patch_size' is not NAME=VALUE"),
        ("patch_size=none", "--set: patch_size: Input should be a valid integer"),
        ("patchsize=4", "there is no setting 'patchsize'; did you mean 'patch_size'?"),
        ("zzz=1", "There are face_budget, patch_size,"),
        ("pooling=best", "--set: pooling: Input should be 'geometric' or 'learned'"),
    ],
)
def test_a_bad_setting_is_a_usage_error(tmp_path, setting, message):
    for label in ("a", "b"):
        (tmp_path / label / "train").mkdir(parents=True)
        (tmp_path / label / "train" / "x.obj").touch()
    arguments = ["train", str(tmp_path), "--out", str(tmp_path / "run"), "--set", setting]
    result = CliRunner().invoke(commands, arguments)
    assert result.exit_code == 2
    assert message in " ".join(result.output.replace("\u2502", "").split())


def test_presets_are_networks_and_others_are_unknown():
    for name in PRESETS:
        assert preset(name, ("ball", "box")).levels == 3
    with pytest.raises(ValueError, match="paper"):
        preset("huge", ("ball", "box"))
