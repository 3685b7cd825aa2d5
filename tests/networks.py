"""Networks that were never trained, but whose every layer matters to the scores."""

import torch
from torch import nn

from meshconv3d.model.config import NetworkConfig
from meshconv3d.model.nn.network import Network, as_tensors
from meshconv3d.model.topology import Topology
from meshconv3d.model.topology.inputs import MeshInputs, collate, mesh_inputs
from tests.meshes import cube, icosphere, sheet, torus


def topology_of(inputs: MeshInputs) -> Topology:
    """The topology of a mesh whose levels are all known beforehand."""
    assert inputs.topology is not None
    return inputs.topology


def untrained(config: NetworkConfig, seed: int = 0) -> Network:
    """A network with random weights, and BatchNorm statistics of a few meshes.

    The statistics, scale and shift of every BatchNorm are far from the identity's, so that
    whoever forgets one gets other scores; and meshes score apart, as a trained network's do.
    """
    torch.manual_seed(seed)
    network = Network(config)
    norms = [module for module in network.modules() if isinstance(module, nn.BatchNorm1d)]
    for norm in norms:
        nn.init.uniform_(norm.weight, 0.5, 1.5)
        nn.init.normal_(norm.bias, std=0.5)
        norm.momentum = 1.0
    network.classify.weight.data *= 10
    classes = len(config.classes)
    features = torch.randn(20 * classes, network.classify.in_features)
    others = 3 * torch.randn(4, network.classify.in_features)
    network.novelty.fit(features, torch.arange(20 * classes) % classes, others)
    network.embedding.fit(features, torch.arange(20 * classes) // 2)
    meshes = [torus(), sheet(), cube(), icosphere(2)]
    batch = collate([mesh_inputs(mesh, config) for mesh in meshes])
    with torch.no_grad():
        network.train()(*as_tensors(batch))
    for norm in norms:
        norm.momentum = 0.1
    return network.eval()
