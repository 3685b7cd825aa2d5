"""The articulated meshes: small, sound, of many kinds, and what their own generator builds."""

import numpy as np
import pytest

from benchmarks.samples.__main__ import RECIPES, build, encode
from meshconv3d.model.loading import load_mesh
from meshconv3d.model.preparation import prepare, surface_area
from tests.articulated import sample_paths

EACH = pytest.mark.parametrize("name", sample_paths())


def volume(mesh):
    a, b, c = mesh.vertices[mesh.faces].transpose(1, 0, 2)
    return float(np.einsum("ij,ij->", a, np.cross(b, c)) / 6)


def test_every_recipe_has_its_file_and_every_file_its_recipe():
    assert list(sample_paths()) == sorted(RECIPES)
    for name, path in sample_paths().items():
        assert path.suffix[1:] == RECIPES[name].extension
        assert path.stat().st_size < 60_000


def test_formats_and_preparations_differ():
    paths = sample_paths().values()
    reports = [prepare(load_mesh(path), 500)[1] for path in paths]
    assert {path.suffix for path in paths} == {".obj", ".off", ".stl", ".ply", ".glb", ".3mf"}
    assert {report.resampled for report in reports} == {"none", "decimated", "subdivided"}


@EACH
def test_a_sample_is_one_closed_surface_that_keeps_its_area(name):
    mesh = load_mesh(sample_paths()[name])
    assert len(mesh.faces) == RECIPES[name].faces
    prepared, report = prepare(mesh, 500)
    assert report.watertight
    assert report.components == 1
    assert report.nonmanifold_edges == report.vertices_split == report.flipped == 0
    assert report.degenerate_dropped == report.duplicates_dropped == 0
    assert 499 <= len(prepared.faces) <= 500
    assert 0.95 < report.area_kept < 1.02
    assert volume(prepared) > 0


@pytest.mark.parametrize("name", ["glasses", "hand", "two_balls"])
def test_the_generator_gives_the_committed_shape(name):
    # Not the same bytes: the last bits of a sum may differ between processors, and with them the
    # order in which simplification takes the edges.
    built, stored = build(name), load_mesh(sample_paths()[name])
    assert len(built.faces) == len(stored.faces)
    assert volume(built) == pytest.approx(volume(stored), rel=0.01)
    assert surface_area(built.vertices, built.faces) == pytest.approx(
        surface_area(stored.vertices, stored.faces), rel=0.01
    )
    for end in (np.min, np.max):
        assert end(built.vertices, axis=0) == pytest.approx(end(stored.vertices, axis=0), abs=0.02)


@pytest.mark.parametrize("name", ["laptop"])
def test_the_generator_repeats_itself(name):
    extension = RECIPES[name].extension
    assert encode(build(name), extension) == encode(build(name), extension)
