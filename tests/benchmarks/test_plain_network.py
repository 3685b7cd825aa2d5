"""The network that trains against the paper's equations in plain torch."""

import pytest
import torch
from torch import nn

from benchmarks import plain_network
from benchmarks.training_step import VARIANTS
from meshconv3d.model.nn.network import as_tensors
from meshconv3d.model.topology.inputs import collate, input_names, mesh_inputs
from tests.conftest import SMALL
from tests.meshes import cube, icosphere, sheet, torus
from tests.networks import untrained


@pytest.mark.parametrize(
    ("dtype", "tolerance"), [(torch.float32, 1e-5), (torch.float64, 1e-12)], ids=str
)
def test_scores_and_gradients_are_those_of_plain_torch(dtype, tolerance):
    tensors = as_tensors(collate([mesh_inputs(m, SMALL) for m in (torus(), sheet(), cube())]))
    arrays = dict(zip(input_names(SMALL), tensors, strict=True))
    arrays["terms"] = arrays["terms"].to(dtype)
    found = []
    for forward in VARIANTS.values():
        network = untrained(SMALL).to(dtype).train()
        scores = forward(network, arrays)
        nn.functional.cross_entropy(scores, torch.tensor([0, 1, 2])).backward()
        found.append([scores, *(weight.grad for weight in network.parameters())])
    assert len(found) == 2
    for ours, theirs in zip(*found, strict=True):
        assert (ours - theirs).abs().max() <= tolerance * theirs.abs().max().clamp(min=1e-3)


def test_in_evaluation_the_scores_agree_too():
    tensors = as_tensors(collate([mesh_inputs(icosphere(2), SMALL)]))
    network = untrained(SMALL)
    with torch.inference_mode():
        expected = network(*tensors).scores
        found = plain_network.scores(network, dict(zip(input_names(SMALL), tensors, strict=True)))
    assert torch.allclose(found, expected, atol=1e-5)
