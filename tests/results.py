"""Results and model cards for tests of what carries them."""

import numpy as np

from meshconv3d.export.metadata import ModelCard, Probe
from meshconv3d.model.config import NetworkConfig
from meshconv3d.model.preparation import MeshReport
from meshconv3d.service.models import ModelInfo
from meshconv3d.service.prediction import ModelId, Prediction

REPORT = MeshReport(
    faces_in=1200,
    faces_used=500,
    vertices_in=602,
    vertices_merged=0,
    degenerate_dropped=0,
    duplicates_dropped=0,
    walls_dropped=0,
    nonmanifold_edges=0,
    vertices_split=0,
    flipped=0,
    components=1,
    border_edges=0,
    watertight=True,
    resampled="decimated",
    within_budget=True,
    components_lost=0,
    area_kept=1.0,
)


def model_info(name: str = "any") -> ModelInfo:
    """A model of two classes that nobody trained."""
    card = ModelCard(
        name=name,
        config=NetworkConfig(classes=("this", "that")),
        opset=20,
        training={},
        accuracy={},
        parity={},
        calibration=None,
        space="any",
        probe=Probe("ants", (0.0, 0.0)),
        about="",
    )
    return ModelInfo(card, "0" * 64)


def prediction(*scores: float, classes: tuple[str, ...] = ("this", "that")) -> Prediction:
    """A result with these scores."""
    logits = np.array(scores or (1.0, 0.0), np.float32)
    probabilities = np.exp(logits.astype(np.float64))
    return Prediction(
        ModelId("any", "0" * 64),
        classes,
        logits,
        probabilities / probabilities.sum(),
        novelty=0.0,
        unknown=None,
        embedding=np.array([1, 0], np.float32),
        space="any",
        radius=1.0,
        chirality=np.zeros(1),
        report=REPORT,
        timings_ms={"read": 1.5},
    )
