"""From prepared meshes to the arrays that the network, in torch or ONNX, takes by name."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.config import NetworkConfig
from meshconv3d.model.mesh import Mesh
from meshconv3d.model.topology.batch import SurfaceBatch, join_indices
from meshconv3d.model.topology.descriptors import descriptor_terms, pooling_features
from meshconv3d.model.topology.geometry import FaceGeometry, face_geometry
from meshconv3d.model.topology.integral_invariants import integral_invariants
from meshconv3d.model.topology.surface import Surface, Topology, build_topology


@dataclass(frozen=True, eq=False)
class MeshInputs:
    """One mesh as the network reads it: terms, F_0 x E float32, and the connectivity of its faces.

    topology: of all levels; None where pooling is learned, which finds them as the network runs.
    """

    terms: NDArray[np.float32]
    surface: Surface
    topology: Topology | None


def mesh_inputs(mesh: Mesh, config: NetworkConfig) -> MeshInputs:
    """Descriptor terms and topology of a prepared mesh."""
    surface = Surface.of(mesh)
    geometry = face_geometry(mesh.vertices, mesh.faces)
    terms = terms_of(mesh.vertices, mesh.faces, geometry, surface, config)
    if config.pooling == "learned":
        return MeshInputs(terms, surface, None)
    return MeshInputs(terms, surface, topology_of(surface, geometry, config))


def topology_of(surface: Surface, geometry: FaceGeometry, config: NetworkConfig) -> Topology:
    """All levels of a prepared mesh under geometric pooling."""
    features = pooling_features(geometry)
    return build_topology(
        surface, features, config.patch_size, config.targets, config.topology_options
    )


def terms_of(
    vertices: NDArray[np.float64],
    faces: NDArray[np.int32],
    geometry: FaceGeometry,
    surface: Surface,
    config: NetworkConfig,
) -> NDArray[np.float32]:
    """The descriptors' input for each face, F x E: the 3 D numbers of `descriptor_terms` and,
    where the network has them, the M of `integral_invariants`."""
    own_axes = config.axes == "face"
    terms = descriptor_terms(
        vertices, faces, surface.twin, geometry, config.absolute_offsets, own_axes
    ).reshape(len(faces), -1)
    if not config.integral_invariants:
        return terms
    return np.concatenate((terms, integral_invariants(vertices, faces, geometry)), axis=1)


def input_names(config: NetworkConfig) -> list[str]:
    """Names of the network's inputs, in order; `collate` says what they are."""
    if config.pooling == "learned":
        return ["terms", "faces", "lengths", "starts"]
    return [
        "terms",
        *(f"patches_{level}" for level in range(config.levels)),
        *(f"pools_{level}" for level in range(config.levels)),
        "readout",
    ]


def whole_inputs(mesh: Mesh) -> dict[str, NDArray]:
    """The inputs of a whole-pipeline file: vertices, V x 3 float32; faces, F x 3 int64."""
    return {
        "vertices": mesh.vertices.astype(np.float32),
        "faces": mesh.faces.astype(np.int64),
    }


def as_given(inputs: Mapping[str, NDArray]) -> Mesh:
    """The mesh that a whole-pipeline file is given: its vertices are rounded to float32."""
    return Mesh(inputs["vertices"], inputs["faces"])


def collate(batch: Sequence[MeshInputs]) -> dict[str, NDArray]:
    """Concatenate meshes of any face counts into one ragged batch, by input name.

    terms: N_0 x E float32. Under geometric pooling, patches_l: N_l x K int32. pools_l:
    N_(l+1) x W_l int32, W_l the widest of the batch. readout: B x R int32, the faces of each mesh
    at the last level. Indices are row + 1 in the batch's own tables and 0 for the null face.

    Under learned pooling the surface itself, as `SurfaceBatch` has it: faces, N_0 x 3
    int32; lengths, 3 N_0 float64; starts, B + 1 int32.
    """
    terms = np.concatenate([inputs.terms for inputs in batch])
    topologies = [inputs.topology for inputs in batch if inputs.topology is not None]
    if topologies:
        return {"terms": terms, **_join_topologies(topologies)}
    surfaces = SurfaceBatch.of([inputs.surface for inputs in batch])
    joint = surfaces.joint
    return {
        "terms": terms,
        "faces": joint.faces,
        "lengths": joint.lengths,
        "starts": surfaces.starts,
    }


def _join_topologies(batch: Sequence[Topology]) -> dict[str, NDArray[np.int32]]:
    levels = len(batch[0].patches)
    # Of each of the L + 1 levels: the faces of every mesh, and where they begin in its table.
    counts = list(zip(*(topology.face_counts for topology in batch), strict=True))
    starts = [list(accumulate(level[:-1], initial=0)) for level in counts]
    rows = [np.arange(1, count + 1, dtype=np.int32)[None] for count in counts[levels]]
    return {
        **{
            f"patches_{level}": join_indices([t.patches[level] for t in batch], starts[level])
            for level in range(levels)
        },
        **{
            f"pools_{level}": join_indices([t.pools[level] for t in batch], starts[level])
            for level in range(levels)
        },
        "readout": join_indices(rows, starts[levels]),
    }
