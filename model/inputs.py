"""From prepared meshes to the arrays that the network, in torch or ONNX, takes by name."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from model.config import NetworkConfig
from model.descriptors import descriptor_terms, pooling_features
from model.mesh import Mesh
from model.topology import Surface, Topology, build_topology


@dataclass(frozen=True, eq=False)
class MeshInputs:
    """One mesh as the network sees it: terms, F_0 x D x 3 float32, and its topology."""

    terms: NDArray[np.float32]
    topology: Topology


def mesh_inputs(mesh: Mesh, config: NetworkConfig) -> MeshInputs:
    """Descriptor terms and topology of a prepared mesh."""
    surface = Surface.of(mesh)
    terms = descriptor_terms(mesh.vertices, mesh.faces, surface.twin, config.absolute_offsets)
    topology = build_topology(surface, pooling_features(terms), config.patch_size, config.targets)
    return MeshInputs(terms, topology)


def input_names(levels: int) -> list[str]:
    """Names of the graph's inputs, in order."""
    return [
        "terms",
        *(f"patches_{level}" for level in range(levels)),
        *(f"pools_{level}" for level in range(levels)),
        "readout",
    ]


def collate(batch: Sequence[MeshInputs]) -> dict[str, NDArray]:
    """Concatenate meshes of any face counts into one ragged batch, by input name.

    terms: N_0 x 3 D float32. patches_l: N_l x K int32. pools_l: N_(l+1) x W_l int32, W_l the
    widest of the batch. readout: B x R int32, the faces of each mesh at the last level. Indices
    are row + 1 in the batch's own tables and 0 for the null face.
    """
    levels = len(batch[0].topology.patches)
    counts = np.array([inputs.topology.face_counts for inputs in batch])
    # Where each mesh's faces begin in the table of each level: B x (L + 1).
    starts = np.cumsum(counts, axis=0) - counts
    arrays: dict[str, NDArray] = {
        "terms": np.concatenate([inputs.terms.reshape(len(inputs.terms), -1) for inputs in batch])
    }
    for level in range(levels):
        arrays[f"patches_{level}"] = _stack(
            [inputs.topology.patches[level] for inputs in batch], starts[:, level]
        )
        arrays[f"pools_{level}"] = _stack(
            [inputs.topology.pools[level] for inputs in batch], starts[:, level]
        )
    rows = [np.arange(1, count + 1, dtype=np.int32)[None] for count in counts[:, levels]]
    arrays["readout"] = _stack(rows, starts[:, levels])
    return {name: arrays[name] for name in input_names(levels)}


def _stack(indices: list[NDArray[np.int32]], starts: NDArray[np.int64]) -> NDArray[np.int32]:
    """Concatenate null-padded indices over tables that begin at `starts` of the joint one."""
    if len(indices) == 1:
        return indices[0]
    width = max(index.shape[1] for index in indices)
    stacked = np.zeros((sum(map(len, indices)), width), np.int32)
    row = 0
    for index, start in zip(indices, starts, strict=True):
        block = stacked[row : row + len(index), : index.shape[1]]
        np.add(index, np.int32(start), out=block, where=index > 0)
        row += len(index)
    return stacked
