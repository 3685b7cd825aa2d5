"""Evaluation of a network on labelled meshes, and its calibration."""

from collections.abc import Iterable, Iterator, Sequence
from itertools import chain, islice

import numpy as np
import torch
from torch import Tensor

from meshconv3d.model.calibration import Calibration, calibrate, fit_same_shape
from meshconv3d.model.nn.network import Network, Outputs, as_tensors
from meshconv3d.model.topology.inputs import collate
from meshconv3d.model.training.meshes import LabelledMesh, LoadedSamples

BATCH_SIZE = 16


def accuracy(network: Network, samples: LoadedSamples) -> float:
    """Share of files whose highest score is their class; refused files count as wrong."""
    if not samples.meshes:
        return 0.0
    right = predict(network, samples.meshes).scores.argmax(dim=1) == _labels(samples.meshes)
    return float(right.sum()) / samples.total


@torch.inference_mode()
def predict(network: Network, meshes: Sequence[LabelledMesh]) -> Outputs:
    """The outputs for all meshes, on the CPU; leaves the network in evaluation mode."""
    parts = [network(*batch) for batch in _batches(network, meshes)]
    return Outputs(*(torch.cat(part).cpu() for part in zip(*parts, strict=True)))


def fit_feature_space(network: Network, samples: LoadedSamples) -> None:
    """Fit out-of-distribution score and embedding to the training meshes and their copies."""
    fit_novelty(network, samples)
    fit_embedding(network, samples)


def fit_novelty(network: Network, samples: LoadedSamples) -> None:
    """Fit the out-of-distribution score to the training meshes and their copies."""
    meshes = list(chain.from_iterable(samples.versions))
    network.novelty.cpu().fit(_pooled_features(network, meshes), _labels(meshes))


def fit_embedding(network: Network, samples: LoadedSamples) -> None:
    """Fit the embedding to the training meshes and their copies."""
    meshes = list(chain.from_iterable(samples.versions))
    counts = torch.tensor([len(versions) for versions in samples.versions])
    numbers = torch.arange(len(counts)).repeat_interleave(counts)
    network.embedding.cpu().fit(_pooled_features(network, meshes), numbers)


@torch.inference_mode()
def _pooled_features(network: Network, meshes: Sequence[LabelledMesh]) -> Tensor:
    return torch.cat([network.features(*batch)[1].cpu() for batch in _batches(network, meshes)])


def calibrate_network(network: Network, samples: LoadedSamples) -> Calibration:
    """The calibration on validation meshes, varied copies included."""
    meshes = list(chain.from_iterable(samples.versions))
    outputs = predict(network, meshes)
    numbers = np.repeat(np.arange(len(samples.versions)), [len(v) for v in samples.versions])
    return calibrate(
        outputs.scores.numpy(),
        outputs.novelty.numpy(),
        _labels(meshes).numpy(),
        fit_same_shape(outputs.embedding.numpy(), numbers),
    )


def _labels(meshes: Iterable[LabelledMesh]) -> Tensor:
    return torch.tensor([mesh.label for mesh in meshes])


def _batches(network: Network, meshes: Sequence[LabelledMesh]) -> Iterator[tuple[Tensor, ...]]:
    """Inputs of a few meshes at a time, which bounds memory."""
    network.eval()
    device = next(network.parameters()).device
    rest = iter(meshes)
    while batch := list(islice(rest, BATCH_SIZE)):
        yield as_tensors(collate([mesh.inputs for mesh in batch]), device)
