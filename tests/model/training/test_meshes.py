"""Reading and preparing the files of a data set, and counting those that cannot be used."""

import logging
from pathlib import Path

import numpy as np
import pytest

from meshconv3d.model.datasets import find_samples
from meshconv3d.model.training.meshes import load_samples, read_samples
from tests.meshes import cube, icosphere, torus, write_off
from tests.networks import topology_of


@pytest.fixture
def folders(tmp_path: Path) -> Path:
    """Three classes of two meshes to train on, one with a file that is no mesh."""
    for label, mesh in (("ball", icosphere(1)), ("box", cube()), ("ring", torus(8, 6))):
        for name in ("one.off", "two.OFF"):
            write_off(tmp_path / label / "train" / name, mesh)
    (tmp_path / "box" / "train" / "broken.off").write_text("OFF\n1 1 0\nnothing\n")
    return tmp_path


def test_samples_are_prepared_and_bad_files_counted(folders, config, caplog):
    samples = [s for s in find_samples(folders) if s.split == "train"]
    with caplog.at_level(logging.WARNING):
        loaded = load_samples(samples, config)
    assert (loaded.refused, loaded.total) == (1, 7)
    assert "broken.off" in caplog.text
    assert [mesh.label for mesh in loaded.meshes] == [0, 0, 1, 1, 2, 2]
    for mesh in loaded.meshes:
        assert len(mesh.mesh.faces) in (499, 500)
        assert len(mesh.inputs.surface.twin) == 3 * len(mesh.mesh.faces)
        assert topology_of(mesh.inputs).face_counts[0] == len(mesh.mesh.faces)
        assert np.isfinite(mesh.inputs.terms).all()


def test_a_file_that_cannot_be_read_is_left_out(folders, config, caplog):
    (folders / "box" / "train" / "lost.off").symlink_to("nowhere")
    samples = [s for s in find_samples(folders) if s.split == "train"]
    assert load_samples(samples, config).refused == 2
    assert "lost.off" in caplog.text


def test_progress_sees_every_sample(folders, config):
    samples = find_samples(folders)[:3]
    seen = []

    def progress(items):
        for item in items:
            seen.append(item)
            yield item

    read_samples(samples, config, progress)
    assert seen == samples
