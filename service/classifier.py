"""Both stages at run time: mesh bytes in, class scores out."""

import os
import time
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from model.calibration import softmax
from model.errors import MeshError
from model.inputs import collate, mesh_inputs
from model.loading import Limits, load_mesh
from model.mesh import Mesh
from model.preparation import MeshReport, prepare
from model.samples import sample_paths
from service.models import DEFAULT_MODEL, Model, open_model

# How far the self-test's scores may lie from those that the export stored, relative to the
# largest: rounding moves them by 1e-6, another triangulation of the sample by more than this.
SELF_TEST_TOLERANCE = 1e-2

Source = str | os.PathLike[str] | tuple[bytes, str | None]


class SelfTestError(RuntimeError):
    """A model does not give, on this machine, the scores it gave when it was exported."""


@dataclass(frozen=True, eq=False)
class Classification:
    """What a mesh is, by which model. scores: N_c float32 logits; probabilities: their calibrated
    softmax. novelty: how unlike every class it is, see `model.novelty`.

    timings_ms: wall-clock milliseconds of each stage: read, prepare, topology, infer.
    """

    model: Model
    scores: NDArray[np.float32]
    probabilities: NDArray[np.float64]
    novelty: float
    report: MeshReport
    timings_ms: dict[str, float]

    @property
    def ranking(self) -> list[int]:
        """Class indices, likeliest first."""
        return np.argsort(-self.scores, kind="stable").tolist()

    @property
    def classes(self) -> tuple[str, ...]:
        """Names of the classes, in the order of the scores."""
        return self.model.card.config.classes

    @property
    def label(self) -> str:
        """The likeliest class."""
        return self.classes[self.ranking[0]]

    @property
    def unknown(self) -> bool | None:
        """Whether it is unlike everything the model was trained on; None if that has no limit."""
        calibration = self.model.card.calibration
        return None if calibration is None else self.novelty > calibration.novelty_limit


class Classifier:
    """A model, loaded once, that classifies any number of meshes from any number of threads.

    >>> Classifier.load("shrec11").classify("snake.obj").label
    'snake'
    """

    def __init__(self, model: Model, limits: Limits | None = None) -> None:
        """limits: the most that one file may hold; with None, the defaults."""
        self.model = model
        self.limits = limits
        calibration = model.card.calibration
        self._temperature = calibration.temperature if calibration else 1.0

    @classmethod
    def load(cls, name_or_path: str = DEFAULT_MODEL) -> "Classifier":
        """A shipped model by name or a model file by path; see `open_model` for the errors."""
        return cls(open_model(name_or_path))

    def classify(
        self, source: str | os.PathLike[str] | bytes, name: str | None = None
    ) -> Classification:
        """Classify one file, or the bytes of one; `name` declares the format of bytes.

        Raises MeshError for what cannot be read or is no mesh, OSError for a path that cannot
        be opened.
        """
        timings: dict[str, float] = {}
        with _timed(timings, "read"):
            mesh = load_mesh(source, name, self.limits)
        return self._classify(mesh, timings)

    def classify_mesh(self, mesh: Mesh) -> Classification:
        """Classify a mesh that is in memory already. Raises UnusableMesh."""
        return self._classify(mesh, {})

    def _classify(self, loaded: Mesh, timings: dict[str, float]) -> Classification:
        config = self.model.card.config
        with _timed(timings, "prepare"):
            mesh, report = prepare(loaded, config.face_budget)
        with _timed(timings, "topology"):
            arrays = collate([mesh_inputs(mesh, config)])
        with _timed(timings, "infer"):
            scores, novelty = self.model.session.run(["scores", "novelty"], arrays)
        scores, novelty = np.asarray(scores)[0], float(np.asarray(novelty)[0])
        probabilities = softmax(scores / self._temperature)
        return Classification(self.model, scores, probabilities, novelty, report, timings)

    def classify_many(
        self, sources: Iterable[Source]
    ) -> Iterator[Classification | MeshError | OSError]:
        """Classify files one after the other, in order: for each its result, or why it has none.

        A source is a path, or the bytes of a file with their declared name or None.
        """
        for source in sources:
            try:
                yield self.classify(*source) if isinstance(source, tuple) else self.classify(source)
            except (MeshError, OSError) as error:
                yield error

    def self_test(self) -> None:
        """Classify the sample whose scores the export stored; it also warms every stage up.

        Raises SelfTestError when the scores are not those.
        """
        card = self.model.card
        path = sample_paths().get(card.probe.sample)
        if path is None:
            raise SelfTestError(
                f"model {card.name} wants to be tested on the sample {card.probe.sample!r}, "
                "which this version of meshconv3d does not have"
            )
        expected = np.array(card.probe.scores)
        scores = self.classify_mesh(load_mesh(path)).scores  # within no limits but the defaults
        difference = np.abs(scores - expected).max() / np.abs(expected).max()
        if not difference <= SELF_TEST_TOLERANCE:
            raise SelfTestError(
                f"model {card.name} scores the sample {path.stem} differently here than when it "
                "was exported: its file is damaged, or made for another version of meshconv3d"
            )


@contextmanager
def _timed(timings: dict[str, float], stage: str) -> Iterator[None]:
    started = time.perf_counter()
    yield
    timings[stage] = round((time.perf_counter() - started) * 1000, 3)
