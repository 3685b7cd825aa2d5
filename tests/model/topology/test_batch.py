"""A batch of surfaces is its surfaces: joined, taken apart, and pooled."""

import numpy as np
import pytest

from meshconv3d.model.topology.batch import (
    SurfaceBatch,
    grow_patches,
    join_indices,
    pool_faces,
)
from meshconv3d.model.topology.surface import DEFAULT_OPTIONS, Surface, TopologyOptions
from tests.meshes import cube, icosphere, sheet, torus

SURFACES = [Surface.of(mesh) for mesh in (torus(12, 6), sheet(), cube(), icosphere(2))]
STARTS = np.cumsum([0, *(s.face_count for s in SURFACES)])


def features_of(seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).normal(size=(STARTS[-1], 5)).astype(np.float32)


def test_what_was_joined_comes_apart_again() -> None:
    for before, after in zip(SURFACES, SurfaceBatch.of(SURFACES).surfaces(), strict=True):
        assert (before.faces == after.faces).all()
        assert (before.twin == after.twin).all()
        assert (before.lengths == after.lengths).all()


def test_no_twin_crosses_from_mesh_to_mesh() -> None:
    joint = SurfaceBatch.of(SURFACES).joint
    paired = np.flatnonzero(joint.twin >= 0)
    assert (joint.twin[joint.twin[paired]] == paired).all()
    owner = np.searchsorted(3 * STARTS, paired, side="right")
    assert (owner == np.searchsorted(3 * STARTS, joint.twin[paired], side="right")).all()


@pytest.mark.parametrize("target", [3, 40, 10_000])
@pytest.mark.parametrize(
    "options", [DEFAULT_OPTIONS, TopologyOptions(squared_norm=False, literal=True)]
)
def test_a_batch_pools_each_mesh_as_alone(target: int, options: TopologyOptions) -> None:
    features = features_of()
    index, shares, faces, lengths, starts = pool_faces(
        features,
        SurfaceBatch.of(SURFACES).joint.faces,
        SurfaceBatch.of(SURFACES).joint.lengths,
        STARTS.astype(np.int32),
        target=target,
        squared_norm=int(options.squared_norm),
        literal=int(options.literal),
    )
    alone = [
        surface.pool(features[start:end], target, options)
        for surface, start, end in zip(SURFACES, STARTS[:-1], STARTS[1:], strict=True)
    ]
    assert starts.tolist() == np.cumsum([0, *(s.face_count for s, _, _ in alone)]).tolist()
    assert (index == join_indices([i for _, i, _ in alone], STARTS[:-1])).all()
    assert shares.sum(axis=1) == pytest.approx(1)
    for row, (_, _, expected) in zip(np.split(shares, starts[1:-1]), alone, strict=True):
        assert row[:, : expected.shape[1]] == pytest.approx(expected)
    pooled = SurfaceBatch(Surface.over(faces, lengths), starts).surfaces()
    for (expected, _, _), found in zip(alone, pooled, strict=True):
        assert (expected.twin == found.twin).all()
        assert (expected.lengths == found.lengths).all()


def test_a_batch_grows_the_patches_of_each_mesh() -> None:
    joint = SurfaceBatch.of(SURFACES).joint
    patches = grow_patches(joint.faces, joint.lengths, patch_size=14)
    alone = [surface.patches(14) for surface in SURFACES]
    assert (patches == join_indices(alone, STARTS[:-1])).all()
    # The cube has twelve faces, so that two are missing.
    assert (patches[STARTS[2] : STARTS[3], 12:] == 0).all()
