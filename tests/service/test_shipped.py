"""The model inside the package knows what it says it knows."""

from pathlib import Path

import pytest

from model.datasets import find_samples
from model.samples import sample_paths
from service.classifier import Classifier
from service.models import DEFAULT_MODEL, shipped_models


@pytest.fixture(scope="module")
def classifier() -> Classifier:
    return Classifier.load(DEFAULT_MODEL)


def test_every_shipped_model_passes_its_self_test_and_is_small():
    models = shipped_models()
    assert DEFAULT_MODEL in models
    for name, path in models.items():
        assert path.stat().st_size <= 3_000_000
        Classifier.load(name).self_test()


@pytest.mark.parametrize("label", sample_paths())
def test_the_samples_are_classified_right(classifier: Classifier, label: str):
    assert classifier.classify(sample_paths()[label]).label == label


def test_accuracy_on_real_test_files_is_what_the_card_says(classifier: Classifier, shrec: Path):
    samples = [sample for sample in find_samples(shrec) if sample.split == "test"]
    card = classifier.model.card
    assert len(samples) == card.accuracy["test_meshes"]
    right = sum(classifier.classify(sample.path).label == sample.label for sample in samples)
    assert right / len(samples) == pytest.approx(card.accuracy["test"], abs=1e-4)
