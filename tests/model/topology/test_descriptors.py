"""Descriptor terms against the paper's equations, written as they stand."""

from collections.abc import Sequence

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from meshconv3d.model.mesh import Mesh
from meshconv3d.model.topology import Surface
from meshconv3d.model.topology.descriptors import (
    GEODESIC_TERMS,
    GEOMETRIC_TERMS,
    SHORTEST_TANGENT,
    descriptor_terms,
    pooling_features,
)
from meshconv3d.model.topology.geometry import face_geometry
from meshconv3d.model.training.augmentation import random_rotation
from tests.meshes import cube, sheet, torus
from tests.surfaces import triangles


def terms_of(mesh: Mesh, absolute_offsets: bool = False, face_axes: bool = False) -> np.ndarray:
    twin = Surface.of(mesh).twin
    geometry = face_geometry(mesh.vertices, mesh.faces)
    return descriptor_terms(mesh.vertices, mesh.faces, twin, geometry, absolute_offsets, face_axes)


def own_axes(mesh: Mesh) -> list[np.ndarray]:
    """The axes of each face as rows: normal, away from the origin, across both."""
    found = []
    for face in mesh.vertices[mesh.faces]:
        centroid, normal = face.mean(axis=0), np.cross(face[1] - face[0], face[2] - face[0])
        normal /= np.linalg.norm(normal)
        outward = centroid - centroid @ normal * normal
        if np.linalg.norm(outward) < SHORTEST_TANGENT:
            outward = max(face - centroid, key=np.linalg.norm)
        outward /= np.linalg.norm(outward)
        found.append(np.array([normal, outward, np.cross(normal, outward)]))
    return found


def by_the_equations(
    mesh: Mesh, absolute_offsets: bool, axes: Sequence[np.ndarray] | None = None
) -> np.ndarray:
    """Equations 1 and 2 face by face, in float64, along axes of each face."""
    twin = Surface.of(mesh).twin
    corners = mesh.vertices[mesh.faces]
    centroid = [face.mean(axis=0) for face in corners]
    normal = [np.cross(face[1] - face[0], face[2] - face[0]) for face in corners]
    normal = [n / np.linalg.norm(n) for n in normal]

    def vertex_normal(v):
        return np.mean([normal[f] for f, face in enumerate(mesh.faces) if v in face], axis=0)

    terms = []
    for f, face in enumerate(mesh.faces.tolist()):
        along = np.eye(3) if axes is None else axes[f]
        offsets = [along @ (mesh.vertices[v] - centroid[f]) for v in face]
        across = {s: twin[3 * f + s] // 3 for s in range(3) if twin[3 * f + s] >= 0}
        # The apex of a neighbour is its corner that is not on the shared side.
        apex = {}
        for s, g in across.items():
            side = {face[s], face[(s + 1) % 3]}
            apex[s] = next(v for v in mesh.faces[g].tolist() if v not in side)
        differences = np.zeros(3)
        for corner in range(3):
            at_corner = [s for s in apex if face[corner] in (face[s], face[(s + 1) % 3])]
            if len(at_corner) == 2:
                e1, e2 = (mesh.vertices[apex[s]] - mesh.vertices[face[corner]] for s in at_corner)
                differences += np.abs(along @ (e1 - e2))
        near = across.values()
        terms.append(
            [
                np.sum(np.abs(offsets) if absolute_offsets else offsets, axis=0),
                along @ np.sum([vertex_normal(v) for v in face], axis=0),
                differences,
                along @ centroid[f],
                along @ normal[f],
                sum((np.abs(along @ (centroid[f] - centroid[g])) for g in near), np.zeros(3)),
                sum((np.abs(along @ np.cross(normal[f], normal[g])) for g in near), np.zeros(3)),
            ]
        )
    return np.array(terms)


@given(triangles(most=40), st.booleans())
def test_terms_are_those_of_the_equations_on_any_surface(surface, absolute_offsets):
    mesh = surface.mesh()
    terms = terms_of(mesh, absolute_offsets)
    assert terms.shape == (len(mesh.faces), len(GEODESIC_TERMS + GEOMETRIC_TERMS), 3)
    assert terms.dtype == np.float32
    assert terms == pytest.approx(by_the_equations(mesh, absolute_offsets), abs=2e-5)


# Its normal points away from the centre: the second axis is that of its farthest corner.
FACING = Mesh([[1, 0, 1], [0, 0.5, 1], [-1, -0.5, 1]], [[0, 1, 2]])


@pytest.mark.parametrize("mesh", [torus(), sheet(), FACING], ids=["closed", "open", "facing"])
@pytest.mark.parametrize("absolute_offsets", [False, True])
def test_terms_along_the_axes_of_each_face(mesh, absolute_offsets):
    terms = terms_of(mesh, absolute_offsets, face_axes=True)
    expected = by_the_equations(mesh, absolute_offsets, own_axes(mesh))
    assert terms == pytest.approx(expected, abs=2e-5)


@pytest.mark.parametrize("mesh", [torus(), sheet()], ids=["closed", "open"])
@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=20)
def test_no_rotation_changes_terms_along_the_axes_of_each_face(mesh, seed):
    rotation = random_rotation(np.random.default_rng(seed))
    turned = mesh.moved(mesh.vertices @ rotation.T)
    before, after = (terms_of(m, True, face_axes=True) for m in (mesh, turned))
    assert after == pytest.approx(before, abs=1e-5)


def test_the_first_term_is_zero_as_written_and_not_in_absolute_values():
    assert np.abs(terms_of(torus())[:, 0]).max() < 1e-15
    assert (terms_of(torus(), absolute_offsets=True)[:, 0].sum(axis=1) > 0.01).all()


def test_a_lone_face_has_only_its_own_terms():
    terms = terms_of(Mesh(np.eye(3), [[0, 1, 2]]))[0]
    normal = np.full(3, 3**-0.5)
    expected = [np.zeros(3), 3 * normal, np.zeros(3), np.full(3, 1 / 3), normal]
    assert terms == pytest.approx(np.array([*expected, np.zeros(3), np.zeros(3)]), abs=1e-7)


def test_a_face_without_area_has_no_normal():
    flat = Mesh([[0, 0, 0], [1, 0, 0], [2, 0, 0]], [[0, 1, 2]])
    terms = terms_of(flat, face_axes=True)
    assert np.isfinite(terms).all()
    assert (terms[0, 4] == 0).all()


def test_a_cube_by_hand():
    mesh = cube()
    terms = terms_of(mesh)
    assert np.abs(terms[:, 4]).sum(axis=1) == pytest.approx(1)
    # Each face's partner in the square is parallel; the other two neighbours stand upright.
    assert terms[:, 6].sum(axis=1) == pytest.approx(2)
    outward = terms[:, 3] - 0.5
    assert np.sum(outward * terms[:, 4], axis=1) == pytest.approx(0.5)


@pytest.mark.parametrize("mesh", [torus(), sheet()])
@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=20)
def test_rotation_turns_the_linear_terms_and_moves_none_across_faces(mesh, seed):
    rotation = random_rotation(np.random.default_rng(seed))
    assert rotation @ rotation.T == pytest.approx(np.eye(3))
    assert np.linalg.det(rotation) == pytest.approx(1)
    before, after = terms_of(mesh), terms_of(mesh.moved(mesh.vertices @ rotation.T))
    for linear in (1, 3, 4):
        assert after[:, linear] == pytest.approx(before[:, linear] @ rotation.T, abs=1e-5)


def test_moving_the_mesh_moves_only_the_centroid():
    mesh, step = torus(), np.array([3.0, -2, 1])
    before, after = terms_of(mesh), terms_of(mesh.moved(mesh.vertices + step))
    assert after[:, 3] == pytest.approx(before[:, 3] + step, abs=1e-5)
    others = [0, 1, 2, 4, 5, 6]
    assert after[:, others] == pytest.approx(before[:, others], abs=1e-5)


def test_pooling_compares_centroid_and_normal():
    mesh = torus()
    terms = terms_of(mesh)
    features = pooling_features(face_geometry(mesh.vertices, mesh.faces))
    assert features.dtype == np.float32
    assert (features[:, :3] == terms[:, 3]).all()
    assert (features[:, 3:] == terms[:, 4]).all()
    assert features.flags.c_contiguous
