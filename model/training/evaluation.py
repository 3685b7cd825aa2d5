"""Evaluation of a network on labelled meshes, and its calibration."""

from collections.abc import Iterable, Iterator, Sequence
from itertools import chain, islice

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
    pooled = pooled_features(network, samples)
    network.novelty.cpu().fit(pooled, labels_of(samples))
    network.embedding.cpu().fit(pooled, mesh_numbers(samples))


@torch.inference_mode()
def pooled_features(network: Network, samples: LoadedSamples) -> Tensor:
    """Pooled features of all meshes and their copies, M x C, on the CPU."""
    meshes = list(chain.from_iterable(samples.versions))
    return torch.cat([network.features(*batch)[1].cpu() for batch in _batches(network, meshes)])


def labels_of(samples: LoadedSamples) -> Tensor:
    """Class index of all meshes and their copies, M."""
    return _labels(chain.from_iterable(samples.versions))


def mesh_numbers(samples: LoadedSamples) -> Tensor:
    """For all meshes and their copies, M, the number of the mesh."""
    counts = torch.tensor([len(versions) for versions in samples.versions])
    return torch.arange(len(counts)).repeat_interleave(counts)


def calibrate_network(
    network: Network, samples: LoadedSamples, others: Sequence[LabelledMesh] = ()
) -> Calibration:
    """The calibration on validation meshes, varied copies included, and on meshes of no class."""
    meshes = list(chain.from_iterable(samples.versions))
    outputs = predict(network, meshes)
    return calibrate(
        outputs.scores.numpy(),
        outputs.novelty.numpy(),
        labels_of(samples).numpy(),
        fit_same_shape(outputs.embedding.numpy(), mesh_numbers(samples).numpy()),
        predict(network, others).novelty.numpy() if others else None,
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
