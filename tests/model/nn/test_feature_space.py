"""Distance in feature space: the formula, and what it is for."""

import numpy as np
import pytest
import torch

from meshconv3d.model.nn.feature_space import SHRINKAGE, Novelty

MEANS = torch.tensor([[4.0, 0, 0, 0], [0, 4.0, 0, 0], [0, 0, 4.0, 0]])


def clusters(of_each: int, seed: int = 0) -> tuple[torch.Tensor, torch.Tensor]:
    """Three elongated clouds in four dimensions."""
    generator = torch.Generator().manual_seed(seed)
    labels = torch.arange(3).repeat(of_each)
    noise = torch.randn(3 * of_each, 4, generator=generator) * torch.tensor([1, 1, 1, 0.1])
    return MEANS[labels] + 0.5 * noise, labels


@pytest.fixture
def fitted() -> Novelty:
    novelty = Novelty(4, 3)
    novelty.fit(*clusters(200))
    return novelty


def shrunk(offset: np.ndarray) -> np.ndarray:
    covariance = offset.T @ offset / len(offset)
    return covariance + SHRINKAGE * np.trace(covariance) / len(covariance) * np.eye(len(covariance))


def test_it_is_the_relative_mahalanobis_distance(fitted: Novelty) -> None:
    features, labels = (t.numpy() for t in clusters(200))
    means = np.array([features[labels == c].mean(axis=0) for c in range(3)])
    within = np.linalg.inv(shrunk(features - means[labels]))
    overall = np.linalg.inv(shrunk(features - features.mean(axis=0)))
    points = np.random.default_rng(1).normal(0, 5, (50, 4))
    to_classes = [[(p - m) @ within @ (p - m) for m in means] for p in points]
    centred = points - features.mean(axis=0)
    to_all = [c @ overall @ c for c in centred]
    expected = np.min(to_classes, axis=1) - to_all
    found = fitted(torch.from_numpy(points).float()).numpy()
    assert found == pytest.approx(expected, rel=1e-3, abs=1e-2)


def test_the_background_is_half_the_nearest_mesh_of_no_class(fitted: Novelty) -> None:
    others = torch.tensor([[0, 0, 0, 3.0], [-4.0, -4, 0, 0]])
    points = torch.randn(20, 4) * 3
    novelty = Novelty(4, 3)
    novelty.fit(*clusters(200), others)
    centred = points - novelty.centre
    overall = (centred @ novelty.overall).square().sum(dim=1)
    nearest = torch.cdist(points @ novelty.within, others @ novelty.within).square().amin(dim=1)
    expected = fitted(points) + overall - (overall + nearest) / 2
    assert novelty(points).numpy() == pytest.approx(expected.numpy(), rel=1e-3, abs=1e-2)


def test_what_is_like_a_class_is_less_novel_than_what_is_not(fitted: Novelty) -> None:
    known, _ = clusters(50, seed=1)
    between = torch.tensor([[2.0, 2.0, 0, 0], [0, 0, 0, 3.0], [4.0, 0, 0, 2.0], [-4.0, -4, 0, 0]])
    assert fitted(known).max() < fitted(between).min()


def test_each_mesh_of_a_batch_is_measured_alone(fitted: Novelty) -> None:
    points, _ = clusters(3)
    alone = torch.cat([fitted(point[None]) for point in points])
    assert fitted(points).numpy() == pytest.approx(alone.numpy(), abs=1e-4)


def test_before_it_is_fitted_nothing_is_novel() -> None:
    assert Novelty(4, 3)(torch.randn(5, 4)).tolist() == [0] * 5


def test_features_that_never_vary_are_no_trouble() -> None:
    novelty = Novelty(4, 3)
    features, labels = clusters(5)
    features[:, 3] = 0
    novelty.fit(features, labels)
    assert torch.isfinite(novelty(features)).all()
