"""Model files and whole-pipeline files: shipped ones by name, others by path."""

import hashlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from meshconv3d.export.metadata import ModelCard, ModelFileError, read_card
from meshconv3d.export.runtime import is_whole, open_session
from meshconv3d.export.runtime import onnxruntime as ort
from meshconv3d.model.topology.inputs import input_names
from meshconv3d.service.prediction import ModelId

SHIPPED = Path(__file__).parent / "shipped"
DEFAULT_MODEL = "objects"


@dataclass(frozen=True, eq=False)
class ModelInfo:
    """Card of a model file, and the SHA-256 of the file. It can be sent to other processes."""

    card: ModelCard
    sha256: str

    @property
    def id(self) -> ModelId:
        """Name and hash, for results."""
        return ModelId(self.card.name, self.sha256)

    def to_dict(self) -> dict[str, Any]:
        """Card and hash as JSON values."""
        return self.card.to_dict() | {"sha256": self.sha256}


@dataclass(frozen=True, eq=False)
class Model(ModelInfo):
    """Opened model file; `session.run` is thread-safe."""

    session: ort.InferenceSession

    @property
    def info(self) -> ModelInfo:
        """The model without its session."""
        return ModelInfo(self.card, self.sha256)


def shipped_models() -> dict[str, Path]:
    """Model files of the package by name, the default first."""
    paths = sorted(SHIPPED.glob("*.onnx"), key=lambda path: (path.stem != DEFAULT_MODEL, path.stem))
    return {path.stem: path for path in paths}


def model_path(name_or_path: str) -> Path:
    """Path of a shipped model, or the path itself. Raises ModelFileError if there is no file."""
    shipped = shipped_models()
    if name_or_path in shipped:
        return shipped[name_or_path]
    path = Path(name_or_path)
    if not path.is_file():
        raise ModelFileError(
            f"no model {name_or_path!r}: it is neither a shipped model "
            f"({', '.join(shipped)}) nor the path of an .onnx file"
        )
    return path


@dataclass(frozen=True)
class ModelFile:
    """Content of a model file. It is read once, so that all workers open the same model."""

    path: Path
    content: bytes

    @classmethod
    def read(cls, name_or_path: str) -> "ModelFile":
        """Read a shipped model by name, or the file at a path. Raises ModelFileError."""
        path = model_path(name_or_path)
        try:
            return cls(path, path.read_bytes())
        except OSError as error:
            raise ModelFileError(f"{path} cannot be read: {error.strerror}") from None

    def open(self) -> Model:
        """Open the model and compare its graph with its card; errors: see `open_model`."""
        try:
            session = open_session(self.content)
            card = read_card(session.get_modelmeta().custom_metadata_map)
        except ModelFileError as error:
            raise ModelFileError(f"{self.path}: {error}") from None
        _check_graph(self.path, session, card)
        return Model(card, hashlib.sha256(self.content).hexdigest(), session)


def open_model(name_or_path: str) -> Model:
    """Open a model by name or path.

    Raises ModelFileError for a file that is missing, damaged, not of this project, or made by a
    newer version.
    """
    return ModelFile.read(name_or_path).open()


def _check_graph(path: Path, session: ort.InferenceSession, card: ModelCard) -> None:
    """Raises ModelFileError unless the graph has the inputs, outputs and classes of the card."""
    expected = input_names(card.config)
    found = [value.name for value in session.get_inputs()]
    outputs = {value.name: value.shape for value in session.get_outputs()}
    classes = outputs.get("scores", [None])[-1]
    known = found == expected or is_whole(session)
    if not known or set(outputs) != {"scores", "evidence", "novelty", "embedding"}:
        raise ModelFileError(f"{path}: the graph takes {found} and gives {sorted(outputs)}")
    if classes != len(card.config.classes):
        raise ModelFileError(
            f"{path}: the graph scores {classes} classes, its card names {len(card.config.classes)}"
        )
