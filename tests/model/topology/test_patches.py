"""Patches against a breadth-first walk over lists."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshconv3d.model.topology.halfedges import sort_adjacency
from meshconv3d.model.topology.patches import grow_patches
from meshconv3d.model.topology.surface import Surface
from tests.meshes import cube, torus
from tests.surfaces import triangles


def walk(adjacency, face, size) -> list[int]:
    patch = [face + 1]
    for visited in patch:  # grows while it is walked
        patch += [n for n in adjacency[visited - 1] if n and n not in patch]
    patch = patch[:size]
    return patch + [0] * (size - len(patch))


def adjacency_of(surface: Surface) -> np.ndarray:
    return sort_adjacency(surface.twin, surface.lengths)


@given(triangles(), st.integers(1, 40))
def test_patches_are_breadth_first_walks(surface, size):
    adjacency = adjacency_of(Surface.of(surface.mesh()))
    expected = [walk(adjacency.tolist(), f, size) for f in range(len(adjacency))]
    assert grow_patches(adjacency, size).tolist() == expected


def test_a_patch_of_one_is_the_face():
    assert Surface.of(torus()).patches(1).tolist() == [[f + 1] for f in range(500)]


def test_a_patch_of_four_is_the_face_and_its_neighbours():
    surface = Surface.of(torus())
    assert (surface.patches(4)[:, 1:] == adjacency_of(surface)).all()


@pytest.mark.parametrize("size", [1, 5, 12, 30])
def test_a_small_component_pads_with_the_null_face(size):
    patches = Surface.of(cube()).patches(size)
    for f, patch in enumerate(patches):
        faces = patch[patch > 0]
        assert patch[0] == f + 1
        assert len({*faces.tolist()}) == len(faces) == min(size, 12)
        assert (patch[len(faces) :] == 0).all()
