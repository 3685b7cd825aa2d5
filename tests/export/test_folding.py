"""BatchNorm folded into the layer before it computes what it computed on its own."""

import pytest
import torch
from torch import nn

from meshconv3d.export.onnx_file import fold_batch_norm
from meshconv3d.model.config import NetworkConfig
from meshconv3d.model.nn.network import Outputs, as_tensors
from meshconv3d.model.topology.inputs import collate, mesh_inputs
from tests.meshes import sheet, torus
from tests.networks import untrained


@pytest.mark.parametrize("convolutions", [1, 2])
def test_folding_changes_nothing_but_the_layers(convolutions: int) -> None:
    config = NetworkConfig(
        classes=("a", "b"), channels=(8, 12, 16), convolutions=convolutions, descriptor_hidden=8
    )
    network = untrained(config)
    before = {name: value.clone() for name, value in network.state_dict().items()}
    batch = collate([mesh_inputs(mesh, config) for mesh in (torus(), sheet())])
    inputs = as_tensors(batch)

    folded = fold_batch_norm(network)

    assert not any(isinstance(module, nn.BatchNorm1d) for module in folded.modules())
    with torch.inference_mode():
        expected, ours = network(*inputs), folded(*inputs)
    for name, a, b in zip(Outputs._fields, expected, ours, strict=True):
        assert torch.allclose(a, b, rtol=1e-4, atol=1e-5 * max(1.0, float(a.abs().max()))), name
    assert all(torch.equal(before[name], value) for name, value in network.state_dict().items())
