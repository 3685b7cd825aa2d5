"""Checkpoints come back as they were, and other files are refused."""

import json
import os
from dataclasses import asdict

import pytest
import torch
from safetensors.torch import save_file

from meshconv3d.model.calibration import Calibration
from meshconv3d.model.nn.checkpoint import (
    FORMAT_VERSION,
    Checkpoint,
    CheckpointError,
    load_checkpoint,
    load_tensors,
    save_checkpoint,
    save_tensors,
)
from tests.networks import untrained

CALIBRATION = Calibration(temperature=0.7, novelty_limit=12.5, novelty_scale=1.0, meshes=90)


@pytest.fixture
def saved(config, tmp_path):
    path = tmp_path / "model.safetensors"
    save_checkpoint(Checkpoint(untrained(config), CALIBRATION, {"data": {"name": "shapes"}}), path)
    return path


def resaved(path, **changes):
    """The file with other metadata; None takes an entry away."""
    tensors, metadata = load_tensors(path)
    metadata = {k: v for k, v in (metadata | changes).items() if v is not None}
    save_tensors(tensors, metadata, path)
    return path


def test_a_checkpoint_comes_back_as_it_was(config, saved):
    before, loaded = untrained(config), load_checkpoint(saved)
    assert loaded.network.config == config
    assert loaded.training == {"data": {"name": "shapes"}}
    assert not loaded.network.training
    state = loaded.network.state_dict()
    assert state.keys() == before.state_dict().keys()
    for name, tensor in before.state_dict().items():
        assert torch.equal(state[name], tensor)
        assert state[name].dtype == tensor.dtype


def test_the_file_holds_no_pickle_and_nothing_partial_stays(saved):
    data = saved.read_bytes()
    header = json.loads(data[8 : 8 + int.from_bytes(data[:8], "little")])
    assert header["__metadata__"]["format_version"] == str(FORMAT_VERSION)
    assert [path.name for path in saved.parent.iterdir()] == [saved.name]


def test_a_failed_write_leaves_the_old_file(config, saved, monkeypatch):
    before = saved.read_bytes()

    def full_disk(_):
        raise OSError(28, "no space left")

    monkeypatch.setattr(os, "fsync", full_disk)
    with pytest.raises(OSError, match="no space"):
        save_checkpoint(Checkpoint(untrained(config, seed=1)), saved)
    assert saved.read_bytes() == before
    assert [path.name for path in saved.parent.iterdir()] == [saved.name]


def test_others_may_read_it_where_they_may_read_files(saved):
    (saved.parent / "file").touch()
    assert saved.stat().st_mode == (saved.parent / "file").stat().st_mode


def test_weights_that_are_no_numbers_are_refused(saved):
    tensors, metadata = load_tensors(saved)
    next(iter(tensors.values())).fill_(float("nan"))
    save_tensors(tensors, metadata, saved)
    with pytest.raises(CheckpointError, match="not all finite"):
        load_checkpoint(saved)


@pytest.mark.parametrize(
    "damage",
    [
        lambda data: b"",
        lambda data: data[:100],
        lambda data: data[:-1],
        lambda data: b"\xff" * 8 + data[8:],
        lambda data: b"\x80\x04" + data,
    ],
    ids=["empty", "header cut", "a byte short", "header length", "shifted"],
)
def test_a_damaged_file_is_refused(saved, damage):
    saved.write_bytes(damage(saved.read_bytes()))
    with pytest.raises(CheckpointError, match="is not a safetensors file"):
        load_checkpoint(saved)


def test_a_pickled_file_is_not_opened(tmp_path):
    path = tmp_path / "model.pt"
    torch.save({"weights": torch.zeros(3)}, path)
    with pytest.raises(CheckpointError, match="is not a safetensors file"):
        load_checkpoint(path)


def test_a_safetensors_file_of_others_is_refused(tmp_path):
    path = tmp_path / "other.safetensors"
    save_file({"weight": torch.zeros(3)}, path)
    with pytest.raises(CheckpointError, match="is not a meshconv3d checkpoint"):
        load_checkpoint(path)


@pytest.mark.parametrize(
    "changes",
    [
        {"config": None},
        {"config": "{}"},
        {"config": "nonsense"},
        {"training": None},
        {"training": "{"},
        {"training": "[1]"},
        {"training": "[" * 100_000},
        {"config": '{"classes": ["a"], "face_budget": 1000000000000000000000000000000}'},
        {"format_version": None},
        {"format_version": "one"},
    ],
)
def test_damaged_metadata_is_refused(saved, changes):
    with pytest.raises(CheckpointError, match="is not a meshconv3d checkpoint"):
        load_checkpoint(resaved(saved, **changes))


def test_weights_that_do_not_fit_their_configuration_are_refused(config, saved):
    other = asdict(config) | {"channels": [8, 12, 20]}
    with pytest.raises(CheckpointError, match="is not a meshconv3d checkpoint"):
        load_checkpoint(resaved(saved, config=json.dumps(other)))


def test_a_newer_format_is_refused_with_the_way_out(saved):
    with pytest.raises(CheckpointError, match=rf"format {FORMAT_VERSION + 1}.*upgrade meshconv3d"):
        load_checkpoint(resaved(saved, format_version=str(FORMAT_VERSION + 1)))


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(FileNotFoundError, match=r"absent\.safetensors"):
        load_checkpoint(tmp_path / "absent.safetensors")


def test_an_older_format_is_refused_with_the_way_out(saved):
    with pytest.raises(CheckpointError, match=r"format 1.*train it again"):
        load_checkpoint(resaved(saved, format_version="1"))


def test_the_calibration_comes_back(saved):
    assert load_checkpoint(saved).calibration == CALIBRATION
