"""The card: what goes in comes out, and what is wrong with one is said."""

import json

import pytest

from meshconv3d.export.metadata import (
    FORMAT_VERSION,
    PREFIX,
    ModelCard,
    ModelFileError,
    Probe,
    read_card,
)
from meshconv3d.model.calibration import Calibration
from meshconv3d.model.config import NetworkConfig

CARD = ModelCard(
    name='quoted "name", 名',
    config=NetworkConfig(
        classes=("a b", "č", "{}"), patch_size=3, targets=(90, 20), channels=(4, 8)
    ),
    opset=20,
    training={"data": {"name": "SHREC11", "train": 480}, "seed": 3, "lr": 1e-3},
    accuracy={"test": 0.98, "protocol": "16 of 20"},
    parity={"scores": 2.5e-7, "meshes": 10},
    calibration=Calibration(temperature=1.5, novelty_limit=-3.25, novelty_scale=1.0, meshes=360),
    space="any",
    probe=Probe("ants", (1.5, -2.25, 0.0)),
    about="# Things\n",
)


def test_a_card_survives_its_properties() -> None:
    assert read_card(CARD.to_properties()) == CARD


def test_properties_are_json_under_one_prefix() -> None:
    properties = CARD.to_properties()
    assert all(name.startswith(PREFIX) for name in properties)
    assert json.loads(properties[PREFIX + "config"])["classes"] == list(CARD.config.classes)
    assert json.loads(properties[PREFIX + "preparation"])["face_budget"] == 500


def test_properties_of_others_are_left_alone() -> None:
    assert read_card(CARD.to_properties() | {"author": "not json {"}) == CARD


def test_a_foreign_model_is_told_from_a_damaged_one() -> None:
    with pytest.raises(ModelFileError, match=r"not one of meshconv3d.*meshconv3d export"):
        read_card({"author": "someone"})


def test_a_newer_version_is_told_whatever_else_it_holds() -> None:
    properties = {
        PREFIX + "format_version": json.dumps(FORMAT_VERSION + 1),
        PREFIX + "novelty": json.dumps([1, 2]),
    }
    with pytest.raises(ModelFileError, match=f"format {FORMAT_VERSION + 1}.*upgrade meshconv3d"):
        read_card(properties)


def test_an_older_version_is_refused() -> None:
    properties = CARD.to_properties() | {PREFIX + "format_version": "5"}
    with pytest.raises(ModelFileError, match=r"format 5, .* format 6: train and export"):
        read_card(properties)


@pytest.mark.parametrize("missing", [name for name in CARD.to_dict() if name != "format_version"])
def test_every_entry_is_needed(missing: str) -> None:
    properties = CARD.to_properties()
    del properties[PREFIX + missing]
    with pytest.raises(ModelFileError, match=missing):
        read_card(properties)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("format_version", '"one"'),
        ("config", "{}"),
        ("config", "[]"),
        ("config", '{"classes": ["a", "a"]}'),
        ("config", '{"classes": ["a"], "patch_size": 0}'),
        ("config", '{"classes": ["a"], "unknown": 1}'),
        ("opset", "null"),
        ("training", "[1"),
        ("accuracy", "7"),
        ("accuracy", "[" * 200_000),
        ("accuracy", '{"a":' * 500 + "1" + "}" * 500),
        ("name", '"\\ud800"'),
        (
            "calibration",
            '{"temperature": 1e-320, "novelty_limit": 1.0, "novelty_scale": 1.0, "meshes": 9}',
        ),
        (
            "calibration",
            '{"temperature": 1.0, "novelty_limit": 1e999, "novelty_scale": 1.0, "meshes": 9}',
        ),
        ("config", '{"classes": ["a"], "face_budget": 1000000000}'),
        ("probe", '"text"'),
        ("probe", '{"sample": "ants"}'),
        ("probe", '{"sample": "ants", "scores": "many"}'),
        ("probe", '{"sample": "ants", "scores": [1.0]}'),
    ],
)
def test_damage_is_refused(name: str, value: str) -> None:
    with pytest.raises(ModelFileError, match="damaged"):
        read_card(CARD.to_properties() | {PREFIX + name: value})


@pytest.mark.parametrize(
    "change", [{"face_budget": 499}, {"normalisation": "unit cube"}, {"smoothing": 2}]
)
def test_another_preparation_is_refused(change: dict) -> None:
    """A model would run on meshes prepared otherwise, and answer wrongly."""
    changed = json.dumps(CARD.preparation | change)
    with pytest.raises(ModelFileError, match="prepares them as"):
        read_card(CARD.to_properties() | {PREFIX + "preparation": changed})
