"""The exported file computes what torch does, on every kind of mesh, alone and in a batch."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
import onnx
import pytest
import torch

from meshconv3d.export.comparison import OUTPUTS, TOLERANCE
from meshconv3d.export.onnx_file import export_model
from meshconv3d.export.runtime import open_session
from meshconv3d.model.config import NetworkConfig
from meshconv3d.model.mesh import Mesh
from meshconv3d.model.nn.checkpoint import Checkpoint
from meshconv3d.model.nn.network import Network, as_tensors
from meshconv3d.model.topology.inputs import MeshInputs, collate, mesh_inputs
from tests.meshes import cube, icosphere, moebius, sheet, together, torus
from tests.networks import untrained

# Not prepared: the graph must bear any number of faces, down to one.
MESHES: Mapping[str, Mesh] = {
    "closed": torus(),
    "bordered": sheet(),
    "one face": Mesh(np.eye(3), [[0, 1, 2]]),
    "two loose faces": together(Mesh(np.eye(3), [[0, 1, 2]]), Mesh(np.eye(3) + 3, [[0, 1, 2]])),
    "components": together(torus(12, 6), cube(), sheet(3, 2)),
    "one-sided": moebius(),
    "large": icosphere(3),
}
CONFIGS = {
    "reference": {},
    "wide patch, two convolutions": {"patch_size": 24, "convolutions": 2},
    "face only, four levels, one class": {
        "patch_size": 1,
        "channels": (8, 8, 12, 12),
        "targets": (400, 300, 200, 50),
        "classes": ("thing",),
    },
    "all that can be read of a face": {
        "absolute_offsets": True,
        "integral_invariants": True,
        "readout": "mean-peak",
        "dropout": 0.3,
    },
}

# What a graph may consist of: gathers, arithmetic, matrix products, and matters of shape.
ALLOWED = {
    "Gather",
    *("Add", "Sub", "Mul", "Div", "Abs", "Clip", "Max", "Reciprocal"),
    *("Relu", "ReduceSum", "MatMul", "Gemm", "Transpose"),
    *("Pow", "ReduceMin", "ReduceL2"),
    *("Cast", "Concat", "Constant", "ConstantOfShape", "Expand", "Greater", "Equal"),
    *("Identity", "Reshape", "Shape", "Slice", "Split", "Squeeze", "Unsqueeze"),
}
# What tells each face of a batch which mesh it is of.
ALLOWED_PEAKS = {"Range", "ScatterElements"}


class Exported:
    """One network, its file, and the meshes as it takes them."""

    def __init__(self, network: Network, path: Path) -> None:
        self.network = network
        self.path = path
        self.config = network.config
        self.inputs = {name: mesh_inputs(mesh, self.config) for name, mesh in MESHES.items()}
        # Traced on ordinary meshes only: the others must not need to be known beforehand.
        known = {name: MESHES[name] for name in ("closed", "bordered")}
        self.card = export_model(Checkpoint(network), path, "tiny", known)
        self.session = open_session(path.read_bytes())

    def run(self, batch: list[MeshInputs]) -> dict[str, np.ndarray]:
        outputs = self.session.run(OUTPUTS, collate(batch))
        return dict(zip(OUTPUTS, map(np.asarray, outputs), strict=True))

    def torch(self, batch: list[MeshInputs]) -> dict[str, np.ndarray]:
        with torch.inference_mode():
            outputs = self.network(*as_tensors(collate(batch)))
        return {name: value.numpy() for name, value in outputs._asdict().items()}


@pytest.fixture(scope="module", params=list(CONFIGS.values()), ids=list(CONFIGS))
def exported(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Exported:
    small = {
        "classes": ("ball", "box", "ring"),
        "channels": (8, 12, 16),
        "descriptor_hidden": 8,
        "descriptor_channels": 6,
    }
    network = untrained(NetworkConfig(**small | request.param))
    return Exported(network, tmp_path_factory.mktemp("export") / "tiny.onnx")


def test_each_mesh_alone(exported: Exported) -> None:
    for name, inputs in exported.inputs.items():
        assert_close(exported.run([inputs]), exported.torch([inputs]), name)


def test_all_meshes_in_one_ragged_batch(exported: Exported) -> None:
    batch = list(exported.inputs.values())
    assert_close(exported.run(batch), exported.torch(batch), "batch")


def test_a_batch_scores_each_mesh_as_alone(exported: Exported) -> None:
    together = exported.run(list(exported.inputs.values()))["scores"]
    alone = [exported.run([inputs])["scores"][0] for inputs in exported.inputs.values()]
    np.testing.assert_allclose(together, alone, rtol=1e-4, atol=1e-4 * np.abs(together).max())


def test_scores_are_the_bias_plus_the_mean_of_the_evidence(exported: Exported) -> None:
    """So that evidence adds up to the score, and can be shown as its reason."""
    batch = list(exported.inputs.values())
    outputs = exported.run(batch)
    bias = exported.network.classify.bias.detach().numpy()
    # Each mesh alone keeps as many faces as in the batch, whichever way they are chosen.
    counts = [len(exported.run([inputs])["evidence"]) for inputs in batch]
    assert len(outputs["evidence"]) == sum(counts)
    shares = np.split(outputs["evidence"], np.cumsum(counts)[:-1])
    for name, score, share in zip(MESHES, outputs["scores"], shares, strict=True):
        np.testing.assert_allclose(
            score, bias + share.mean(axis=0), rtol=1e-4, atol=1e-4, err_msg=name
        )


def test_the_graph_gathers_and_multiplies_and_nothing_else(exported: Exported) -> None:
    operations = {node.op_type for node in onnx.load(exported.path).graph.node}
    assert operations - ALLOWED == (
        ALLOWED_PEAKS if exported.config.readout == "mean-peak" else set()
    )
    assert operations >= {"Gather", "ReduceSum"}


def test_the_cards_parity_is_within_the_tolerance(exported: Exported) -> None:
    parity = exported.card.parity
    assert parity["tolerance"] == TOLERANCE
    assert parity["meshes"] == 2
    assert all(0 <= parity[name] <= TOLERANCE for name in OUTPUTS)


def assert_close(ours: dict[str, np.ndarray], theirs: dict[str, np.ndarray], title: str) -> None:
    for name, value in theirs.items():
        # Novelty is a difference, of numbers of about the size of a covariance's inverse: one.
        scale = max(float(np.abs(value).max()), 1.0 if name == "novelty" else 0.0)
        np.testing.assert_allclose(
            ours[name], value, rtol=0, atol=TOLERANCE * scale, err_msg=f"{title}: {name}"
        )
