"""Both stages at run time: mesh bytes in, class scores out."""

import os
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from meshconv3d.model.attribution import contributions
from meshconv3d.model.calibration import softmax
from meshconv3d.model.errors import MeshError
from meshconv3d.model.loading import Limits, load_mesh
from meshconv3d.model.mesh import Mesh
from meshconv3d.model.preparation import Placement, prepare_placed
from meshconv3d.model.samples import sample_paths
from meshconv3d.model.topology.inputs import MeshInputs, collate, mesh_inputs
from meshconv3d.service.models import DEFAULT_MODEL, Model, open_model
from meshconv3d.service.prediction import Prediction

# How far the self-test's scores may lie from those that the export stored, relative to the
# largest: rounding moves them by 1e-6, another triangulation of the sample by more than this.
SELF_TEST_TOLERANCE = 1e-2

# Of which the times are taken, in order; of the last where it is asked for.
STAGES = ("read", "prepare", "topology", "infer", "explain")

Source = str | os.PathLike[str] | tuple[bytes, str | None]
T = TypeVar("T")


class SelfTestError(RuntimeError):
    """A model does not give, on this machine, the scores it gave when it was exported."""


@dataclass(frozen=True, eq=False)
class Pass:
    """One mesh on its way through both stages.

    prepared: what the network saw, with its inputs; placement: where it lies in the file.
    evidence: N_L x N_c float32, what each face of the last level says.
    """

    prepared: Mesh
    placement: Placement
    inputs: MeshInputs
    evidence: NDArray[np.float32]
    prediction: Prediction

    def contributions(self, class_index: int) -> NDArray[np.float64]:
        """What each face of the prepared mesh adds to the score of a class: F_0."""
        topology = self.inputs.topology
        if topology is None:
            raise ValueError("under learned pooling the faces that were gathered are not known")
        return contributions(self.evidence[:, class_index], topology, self.inputs.surface)


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
        self._novelty_limit = calibration.novelty_limit if calibration else None

    @classmethod
    def load(cls, name_or_path: str = DEFAULT_MODEL) -> "Classifier":
        """A shipped model by name or a model file by path; see `open_model` for the errors."""
        return cls(open_model(name_or_path))

    def classify(
        self, source: str | os.PathLike[str] | bytes, name: str | None = None
    ) -> Prediction:
        """Classify one file, or the bytes of one; `name` declares the format of bytes.

        Raises MeshError for what cannot be read or is no mesh, OSError for a path that cannot
        be opened.
        """
        return self.run(*self.read(source, name)).prediction

    def classify_mesh(self, mesh: Mesh) -> Prediction:
        """Classify a mesh that is in memory already. Raises UnusableMesh."""
        return self.run(mesh, {}).prediction

    def read(
        self,
        source: str | os.PathLike[str] | bytes,
        name: str | None = None,
        pieces: Mapping[str, bytes] | None = None,
    ) -> tuple[Mesh, dict[str, float]]:
        """The mesh of a file, and the time that it took. Raises what `classify` raises.

        pieces: see `load_mesh`.
        """
        timings: dict[str, float] = {}
        with timed(timings, "read"):
            mesh = load_mesh(source, name, self.limits, pieces)
        return mesh, timings

    def run(self, mesh: Mesh, timings: dict[str, float]) -> Pass:
        """Send a mesh through both stages. timings: milliseconds of the stages before these.

        Raises UnusableMesh.
        """
        config = self.model.card.config
        timings = dict(timings)
        with timed(timings, "prepare"):
            prepared, report, placement = prepare_placed(mesh, config.face_budget)
        with timed(timings, "topology"):
            inputs = mesh_inputs(prepared, config)
            arrays = collate([inputs])
        with timed(timings, "infer"):
            outputs = self.model.session.run(["scores", "novelty", "evidence"], arrays)
        scores, novelty, evidence = map(np.asarray, outputs)
        prediction = Prediction(
            self.model.id,
            config.classes,
            scores[0],
            softmax(scores[0] / self._temperature),
            float(novelty[0]),
            None if self._novelty_limit is None else float(novelty[0]) > self._novelty_limit,
            report,
            timings,
        )
        return Pass(prepared, placement, inputs, evidence, prediction)

    def classify_many(
        self, sources: Iterable[Source]
    ) -> Iterator[Prediction | MeshError | OSError]:
        """Classify files one after the other, in order: for each its result, or why it has none."""
        return each_of(sources, self.classify)

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
        try:
            scores = self.classify_mesh(load_mesh(path)).scores  # within no limits but the defaults
        except Exception as error:  # those of onnxruntime are of no kind of their own
            reason = str(error).partition("\n")[0]
            raise SelfTestError(
                f"model {card.name} cannot classify the sample {path.stem}: its graph is not what "
                f"its card describes ({reason})"
            ) from None
        difference = np.abs(scores - expected).max() / np.abs(expected).max()
        if not difference <= SELF_TEST_TOLERANCE:
            raise SelfTestError(
                f"model {card.name} scores the sample {path.stem} differently here than when it "
                "was exported: its file is damaged, or made for another version of meshconv3d"
            )


def each_of(sources: Iterable[Source], work: Callable[..., T]) -> Iterator[T | MeshError | OSError]:
    """Work on files one after the other, in order: for each its result, or why it has none.

    A source is a path, or the bytes of a file with their declared name or None.
    """
    for source in sources:
        try:
            yield work(*source) if isinstance(source, tuple) else work(source)
        except (MeshError, OSError) as error:
            yield error


@contextmanager
def timed(timings: dict[str, float], stage: str) -> Iterator[None]:
    """Note how long what follows takes, in milliseconds."""
    started = time.perf_counter()
    yield
    timings[stage] = round((time.perf_counter() - started) * 1000, 3)
