"""Model files: the shipped ones by name, any other by path."""

import hashlib
from dataclasses import dataclass
from pathlib import Path

from export.metadata import ModelCard, ModelFileError, read_card
from export.runtime import onnxruntime as ort
from model.inputs import input_names

SHIPPED = Path(__file__).parent / "shipped"
DEFAULT_MODEL = "shrec11"


@dataclass(frozen=True, eq=False)
class Model:
    """An opened model file. sha256 is that of the file; `session.run` is thread-safe."""

    card: ModelCard
    sha256: str
    session: ort.InferenceSession


def shipped_models() -> dict[str, Path]:
    """The models inside the package, by name."""
    return {path.stem: path for path in sorted(SHIPPED.glob("*.onnx"))}


def model_path(name_or_path: str) -> Path:
    """The file of a shipped model's name, or the path itself. Raises ModelFileError."""
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


def open_model(name_or_path: str) -> Model:
    """Open a model and check that it can run here.

    It runs each mesh on one thread: they are too small to share. Raises ModelFileError for a file
    that is missing, damaged, not one of this project, or made by a newer version.
    """
    path = model_path(name_or_path)
    try:
        content = path.read_bytes()
    except OSError as error:
        raise ModelFileError(f"{path} cannot be read: {error.strerror}") from None
    options = ort.SessionOptions()
    options.intra_op_num_threads = 1
    options.log_severity_level = 3  # errors reach the caller as exceptions; no warnings on stderr
    try:
        # Without fallback: it would print to stdout and then fail in the same way.
        session = ort.InferenceSession(
            content, options, providers=["CPUExecutionProvider"], enable_fallback=0
        )
        properties = session.get_modelmeta().custom_metadata_map
    except Exception as error:
        # Damaged bytes make onnxruntime raise nearly anything, UnicodeDecodeError included.
        reason = str(error).partition("\n")[0]
        raise ModelFileError(f"{path} is damaged or is no ONNX model: {reason}") from None
    try:
        card = read_card(properties)
    except ModelFileError as error:
        raise ModelFileError(f"{path}: {error}") from None
    _check_graph(path, session, card)
    return Model(card, hashlib.sha256(content).hexdigest(), session)


def _check_graph(path: Path, session: ort.InferenceSession, card: ModelCard) -> None:
    """The graph must take and give what its card promises."""
    expected = input_names(card.config.levels)
    found = [value.name for value in session.get_inputs()]
    outputs = {value.name: value.shape for value in session.get_outputs()}
    classes = outputs.get("scores", [None])[-1]
    if found != expected or set(outputs) != {"scores", "evidence"}:
        raise ModelFileError(f"{path}: the graph takes {found} and gives {sorted(outputs)}")
    if classes != len(card.config.classes):
        raise ModelFileError(
            f"{path}: the graph scores {classes} classes, its card names {len(card.config.classes)}"
        )
