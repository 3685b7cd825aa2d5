"""An export that does not compute what the network does leaves nothing behind."""

from pathlib import Path

import numpy as np
import onnx
import pytest
from click.testing import CliRunner

from meshconv3d.export.comparison import TOLERANCE, ParityError
from meshconv3d.export.onnx_file import export_model
from meshconv3d.export.parity import check_parity
from meshconv3d.model.nn.checkpoint import load_checkpoint
from meshconv3d.service.cli.main import commands
from tests.meshes import sheet, torus


def nudge(graph: onnx.ModelProto, share: float) -> onnx.ModelProto:
    """The graph with its last layer's weights scaled by 1 + share."""
    shapes = {(3, 16), (16, 3)}
    weights = [t for t in graph.graph.initializer if tuple(t.dims) in shapes]
    weights = [t for t in weights if "novelty" not in t.name]
    assert weights
    for weight in weights:
        values = onnx.numpy_helper.to_array(weight) * np.float32(1 + share)
        weight.CopyFrom(onnx.numpy_helper.from_array(values, weight.name))
    return graph


@pytest.fixture
def wrong_graph(model_file: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Exports come out 1 % off."""
    wrong = nudge(onnx.load(model_file), 0.01)
    monkeypatch.setattr("meshconv3d.export.onnx_file.trace_graph", lambda *_: wrong)


MESHES = {"torus": torus(), "sheet": sheet()}


@pytest.mark.usefixtures("wrong_graph")
def test_a_wrong_graph_is_not_written(checkpoint_file: Path, tmp_path: Path) -> None:
    with pytest.raises(ParityError) as failure:
        export_model(load_checkpoint(checkpoint_file), tmp_path / "tiny.onnx", "tiny", MESHES)
    assert list(tmp_path.iterdir()) == []
    # Every failure at once: both outputs, of each mesh and of the batch.
    for line in ("torus: scores", "sheet: evidence", "ragged batch of 2: scores"):
        assert f"{line} differs by" in str(failure.value)


@pytest.mark.usefixtures("wrong_graph")
def test_the_command_fails_and_leaves_what_was_there(checkpoint_file: Path, tmp_path: Path) -> None:
    path = tmp_path / "tiny.onnx"
    path.write_bytes(b"the model before")
    result = CliRunner().invoke(commands, ["export", str(checkpoint_file), "-o", str(path)])
    assert result.exit_code == 1
    assert f"{path} was not written" in result.stderr
    assert [(file.name, file.read_bytes()) for file in tmp_path.iterdir()] == [
        ("tiny.onnx", b"the model before")
    ]


@pytest.mark.parametrize(("share", "passes"), [(0.0, True), (1e-6, True), (1e-3, False)])
def test_the_tolerance_parts_rounding_from_error(
    model_file: Path,
    checkpoint_file: Path,
    share: float,
    passes: bool,
) -> None:
    network = load_checkpoint(checkpoint_file).network
    content = nudge(onnx.load(model_file), share).SerializeToString()
    if passes:
        parity = check_parity(content, network, MESHES)
        assert float(parity["scores"]) <= TOLERANCE
    else:
        with pytest.raises(ParityError, match="does not compute"):
            check_parity(content, network, MESHES)


def test_scores_that_are_no_numbers_never_agree(model_file: Path, checkpoint_file: Path) -> None:
    network = load_checkpoint(checkpoint_file).network
    content = nudge(onnx.load(model_file), float("nan")).SerializeToString()
    with pytest.raises(ParityError):
        check_parity(content, network, MESHES)
