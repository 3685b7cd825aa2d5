"""Accuracy of a network on labelled meshes."""

import numpy as np
import torch

from model.datasets import LabelledMesh, LoadedSamples
from model.inputs import collate
from model.network import Network, as_tensors


def predict(network: Network, meshes: list[LabelledMesh], batch_size: int = 16) -> np.ndarray:
    """Scores of every mesh, len(meshes) x N_c float32; leaves the network in evaluation mode."""
    network.eval()
    device = next(network.parameters()).device
    scores = []
    with torch.inference_mode():
        for start in range(0, len(meshes), batch_size):
            arrays = collate([mesh.inputs for mesh in meshes[start : start + batch_size]])
            scores.append(network(*as_tensors(arrays, device))[0].cpu())
    return torch.cat(scores).numpy()


def accuracy(network: Network, samples: LoadedSamples) -> float:
    """Share of files whose highest score is their class; refused files count as wrong."""
    if not samples.meshes:
        return 0.0
    labels = [mesh.label for mesh in samples.meshes]
    right = predict(network, samples.meshes).argmax(axis=1) == labels
    return float(right.sum()) / samples.total
