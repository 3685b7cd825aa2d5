"""Classifier: preparation, topology and the graph at run time, from a mesh to its prediction."""

import os
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, Protocol, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from meshconv3d.export.runtime import graph_inputs, run
from meshconv3d.model.attribution import contributions
from meshconv3d.model.calibration import softmax
from meshconv3d.model.chirality import chirality
from meshconv3d.model.config import NetworkConfig
from meshconv3d.model.errors import Error, MeshError, UnusableMesh
from meshconv3d.model.loading import Limits, load_mesh
from meshconv3d.model.mesh import Mesh
from meshconv3d.model.preparation import AREA_KEPT, MeshReport, Placement, prepare_placed
from meshconv3d.model.samples import sample_paths
from meshconv3d.model.topology import Surface
from meshconv3d.model.topology.geometry import face_geometry
from meshconv3d.model.topology.inputs import topology_of
from meshconv3d.service.models import DEFAULT_MODEL, Model, open_model
from meshconv3d.service.prediction import Prediction

# Tolerance of the self test, relative to the largest score. Rounding changes scores by 1e-6,
# another triangulation of the sample by more than this.
SELF_TEST_TOLERANCE = 1e-2

# Opening a model takes a second or two, and much longer only where kernels are compiled.
PATIENCE_SECONDS = 6.0
COMPILING = (
    "still starting; where the mesh kernels are not compiled yet, they are now, once, which takes "
    "a minute or two"
)

# Stages that are timed, in order; the last one only for explanations.
STAGES = ("read", "prepare", "topology", "infer", "explain")


class TriangleMesh(Protocol):
    """Mesh object of a library, such as `trimesh.Trimesh`."""

    @property
    def vertices(self) -> Any: ...

    @property
    def faces(self) -> Any: ...


class Scene(Protocol):
    """Scene object of a library, such as `trimesh.Scene`."""

    def to_mesh(self) -> TriangleMesh: ...


FileSource: TypeAlias = str | os.PathLike[str] | bytes | bytearray | memoryview
# A path or the bytes of a file; (vertices, faces); or an object of a library.
MeshSource: TypeAlias = FileSource | tuple[ArrayLike, ArrayLike] | Mesh | TriangleMesh | Scene


@contextmanager
def slow_start_told(tell: Callable[[str], object]) -> Iterator[None]:
    """Tell a person why it takes so long, where what is within it does: it opens a model."""
    notice = threading.Timer(PATIENCE_SECONDS, tell, (COMPILING,))
    notice.daemon = True
    notice.start()
    try:
        yield
    finally:
        notice.cancel()


class SelfTestError(Error):
    """Error of a model that gives other scores on this machine than when it was exported."""


@dataclass(frozen=True, eq=False)
class Pass:
    """Intermediate values of one classification, for explanations and pictures.

    prepared: as the graph reads it; placement: its position in the file; config: of the network.
    evidence: N_L x N_c float32, the share of each face of the last level in the scores.
    """

    prepared: Mesh
    placement: Placement
    config: NetworkConfig
    evidence: NDArray[np.float32]
    prediction: Prediction

    def contributions(self, class_index: int) -> NDArray[np.float64]:
        """Contribution of each face of the prepared mesh to the score of a class, F_0 float64."""
        if self.config.pooling == "learned":
            raise ValueError("learned pooling does not tell which faces it gathered")
        surface = Surface.of(self.prepared)
        geometry = face_geometry(self.prepared.vertices, self.prepared.faces)
        topology = topology_of(surface, geometry, self.config)
        return contributions(self.evidence[:, class_index], topology, surface)


class Classifier:
    """Model that is loaded once and classifies any number of meshes, from any number of threads.

    Made by `load`. `model.card` describes the model: its classes, its training and its accuracy.
    """

    def __init__(self, model: Model, limits: Limits | None = None) -> None:
        """limits: of one file; with None, the defaults."""
        self.model = model
        self.limits = limits

    @classmethod
    def load(
        cls, model: str | os.PathLike[str] = DEFAULT_MODEL, limits: Limits | None = None
    ) -> "Classifier":
        """A shipped model by name or a model file by path, after its self test.

        limits: of one file; with None, the defaults. Raises ModelFileError or SelfTestError.
        """
        classifier = cls(open_model(os.fspath(model)), limits)
        classifier.self_test()
        return classifier

    def classify(self, mesh: MeshSource, format: str | None = None) -> Prediction:
        """Classify one mesh.

        - `mesh`: a path, the bytes of a file, a pair of arrays (vertices, V x 3 numbers; triangles,
          F x 3 vertex numbers from 0), a `trimesh.Trimesh`, or a `trimesh.Scene`.
        - `format`: extension that tells the format of bytes, such as `"stl"`. Without it, the
          extension of a path tells it, and the content of bytes.

        Raises MeshError if the mesh cannot be read or classified.
        """
        if isinstance(mesh, str | os.PathLike | bytes | bytearray | memoryview):
            try:
                return self.run(*self.read(mesh, format)).prediction
            except OSError as error:
                raise MeshError(
                    "unreadable",
                    f"{mesh!r} cannot be opened: {error.strerror}; give the path of a mesh file",
                ) from error
        return self.run(_in_memory(mesh), {}).prediction

    def read(
        self,
        source: FileSource,
        name: str | None = None,
        pieces: Mapping[str, bytes] | None = None,
    ) -> tuple[Mesh, dict[str, float]]:
        """The mesh of a file, and the time that reading it took, for `run`.

        name, pieces: see `load_mesh`. Raises what `load_mesh` raises.
        """
        timings: dict[str, float] = {}
        with timed(timings, "read"):
            mesh = load_mesh(source, name, self.limits, pieces)
        return mesh, timings

    def run(self, mesh: Mesh, timings: dict[str, float]) -> Pass:
        """Classify a mesh. timings: milliseconds of the stages before these.

        Raises UnusableMesh, also where memory runs out.
        """
        try:
            return self._run(mesh, timings)
        except MemoryError as error:
            raise UnusableMesh(
                "too-much-memory",
                "classifying this mesh takes more memory than there is; simplify the mesh or "
                "split it up",
            ) from error

    def _run(self, mesh: Mesh, timings: dict[str, float]) -> Pass:
        config = self.model.card.config
        timings = dict(timings)
        with timed(timings, "prepare"):
            prepared, report, placement = prepare_placed(mesh, config.face_budget)
        with timed(timings, "topology"):
            read, arrays = graph_inputs(self.model.session, prepared, config)
        with timed(timings, "infer"):
            scores, novelty, embedding, evidence = run(
                self.model.session, ["scores", "novelty", "embedding", "evidence"], arrays
            )
        probabilities, unknown = self._calibrated(scores[0], float(novelty[0]), report)
        prediction = Prediction(
            self.model.id,
            config.classes,
            scores[0],
            probabilities,
            float(novelty[0]),
            unknown,
            embedding[0],
            self.model.card.space,
            placement.radius,
            chirality(prepared),
            report,
            timings,
        )
        return Pass(read, placement, config, evidence, prediction)

    def _calibrated(
        self, scores: NDArray[np.float32], novelty: float, report: MeshReport
    ) -> tuple[NDArray[np.float64], bool | None]:
        """Probabilities of the classes, N_c float64, and whether the mesh is unknown."""
        calibration = self.model.card.calibration
        if calibration is None:
            return softmax(scores), None
        known = calibration.known_probability(novelty)
        if report.area_kept < AREA_KEPT[0]:  # of a heap of scraps, too little is left to know it by
            known *= report.area_kept / AREA_KEPT[0] / 2
        return known * softmax(scores / calibration.temperature), known < 0.5

    def classify_many(self, meshes: Iterable[MeshSource]) -> Iterator[Prediction | MeshError]:
        """Classify meshes, each as `classify` takes it; yields for each its prediction or error."""
        for mesh in meshes:
            try:
                yield self.classify(mesh)
            except MeshError as error:
                # Their tracebacks would keep the mesh in memory.
                error.__traceback__ = error.__cause__ = error.__context__ = None
                yield error

    def self_test(self) -> None:
        """Compare the scores of a sample with those that the export stored; this warms up, too.

        Raises SelfTestError if they differ.
        """
        card = self.model.card
        path = sample_paths().get(card.probe.sample)
        if path is None:
            raise SelfTestError(
                f"model {card.name} is tested on the sample {card.probe.sample!r}, which this "
                "version of meshconv3d does not have: upgrade meshconv3d"
            )
        expected = np.array(card.probe.scores)
        try:
            scores = self.classify(load_mesh(path)).scores  # within no limits but the defaults
        except Exception as error:  # onnxruntime's have no common type
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


def _in_memory(mesh: Any) -> Mesh:
    """The mesh in arrays, or in an object of a library. Raises UnusableMesh."""
    if isinstance(mesh, Mesh):
        return mesh
    try:
        mesh = mesh.to_mesh() if hasattr(mesh, "to_mesh") else mesh
        if hasattr(mesh, "vertices"):
            vertices, faces = mesh.vertices, getattr(mesh, "faces", ())
        else:
            vertices, faces = mesh
        return Mesh(vertices, faces)
    except MeshError:
        raise
    except (TypeError, ValueError) as error:
        raise UnusableMesh(
            "no-mesh",
            f"{type(mesh).__name__} is no mesh ({error}); give a path, bytes, arrays as (vertices, "
            "faces), or a trimesh object; several meshes are for classify_many",
        ) from error


@contextmanager
def timed(timings: dict[str, float], stage: str) -> Iterator[None]:
    """Record the milliseconds that the body takes."""
    started = time.perf_counter()
    yield
    timings[stage] = round((time.perf_counter() - started) * 1000, 3)
