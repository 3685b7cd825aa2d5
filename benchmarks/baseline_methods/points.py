"""A small point network, trained like ours: a baseline without triangles."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor, nn

from benchmarks.baseline_methods.data import Part
from benchmarks.baseline_methods.point_network import PointNetwork
from benchmarks.baseline_methods.surface_samples import sample_surface
from meshconv3d.model.mesh import Mesh
from meshconv3d.model.training.augmentation import Augmentation, random_rotation


@dataclass(frozen=True)
class Points:
    """AdamW under a one-cycle schedule on one thread; the last epoch's weights answer.

    Every epoch samples every mesh anew, turned and stretched as for our network. Neither the
    epochs nor anything else is chosen on test meshes.
    """

    points: int = 512
    epochs: int = 75
    """About the time that our network takes on objects69."""
    batch_size: int = 32
    learning_rate: float = 3e-3
    weight_decay: float = 0.05
    label_smoothing: float = 0.1
    draws: int = 5
    """Samples of a test mesh over which its answer is averaged."""

    def scores(self, train: Part, test: Part, seed: int) -> NDArray[np.float64]:
        """Mean probabilities, N x N_c."""
        torch.set_num_threads(1)
        torch.manual_seed(seed)
        network = PointNetwork(train.classes)
        self._train(network, train, seed)
        network.eval()
        with torch.inference_mode():
            return np.concatenate([self._answer(network, mesh) for mesh in test.meshes])

    def _train(self, network: PointNetwork, train: Part, seed: int) -> None:
        batches = max(len(train.meshes) // self.batch_size, 1)
        optimiser = torch.optim.AdamW(
            network.parameters(), self.learning_rate, weight_decay=self.weight_decay
        )
        schedule = torch.optim.lr_scheduler.OneCycleLR(
            optimiser, self.learning_rate, total_steps=self.epochs * batches
        )
        criterion = nn.CrossEntropyLoss(label_smoothing=self.label_smoothing)
        network.train()
        for epoch in range(self.epochs):
            rng = np.random.default_rng([seed, epoch])
            # As for our network, the few meshes that fill no batch sit an epoch out.
            order = rng.permutation(len(train.meshes))[: batches * self.batch_size]
            for batch in np.array_split(order, batches):
                scores = network(*self._draw([moved(train.meshes[i], rng) for i in batch], rng))
                loss = criterion(scores, torch.from_numpy(train.labels[batch]))
                optimiser.zero_grad()
                loss.backward()
                optimiser.step()
                schedule.step()

    def _draw(self, meshes: Sequence[Mesh], rng: np.random.Generator) -> tuple[Tensor, Tensor]:
        """Points and normals, B x N x 3 float32 each."""
        samples = [sample_surface(m.vertices, m.faces, self.points, rng) for m in meshes]
        points, normals = np.stack(samples, axis=1).astype(np.float32)
        return torch.from_numpy(points), torch.from_numpy(normals)

    def _answer(self, network: PointNetwork, mesh: Mesh) -> NDArray[np.float64]:
        """Mean probabilities of one mesh, 1 x N_c; always from the same samples."""
        samples = self._draw([mesh] * self.draws, np.random.default_rng(0))
        return network(*samples).softmax(dim=1).mean(dim=0, keepdim=True).double().numpy()


def moved(mesh: Mesh, rng: np.random.Generator) -> Mesh:
    """A turned copy, stretched along the axes after that, by as much as our network's copies."""
    turned = mesh.vertices @ random_rotation(rng).T
    stretch = rng.uniform(1 - Augmentation.scale, 1 + Augmentation.scale, 3)
    return mesh.moved(turned * stretch)
