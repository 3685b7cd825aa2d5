"""What is in the exported file, read with onnx itself."""

import getpass
from pathlib import Path

import onnx
import pytest

from meshconv3d.export.metadata import PREFIX
from meshconv3d.export.onnx_file import OPSET


@pytest.fixture(scope="module")
def graph(model_file: Path) -> onnx.ModelProto:
    return onnx.load(model_file)


def test_the_file_is_valid_onnx(graph: onnx.ModelProto) -> None:
    onnx.checker.check_model(graph, full_check=True)
    assert [(entry.domain, entry.version) for entry in graph.opset_import] == [("", OPSET)]


def test_the_file_is_self_contained(graph: onnx.ModelProto) -> None:
    assert not graph.functions
    locations = {tensor.data_location for tensor in graph.graph.initializer}
    assert locations == {onnx.TensorProto.DEFAULT}


def test_faces_batch_and_pooling_widths_are_symbolic(graph: onnx.ModelProto) -> None:
    axes = {
        value.name: [axis.dim_param or axis.dim_value for axis in value.type.tensor_type.shape.dim]
        for value in (*graph.graph.input, *graph.graph.output)
    }
    faces = axes["terms"][0]
    assert isinstance(faces, str)
    assert axes["patches_0"] == [faces, 10]
    assert axes["scores"] == [axes["readout"][0], 3]
    assert axes["evidence"] == [axes["pools_2"][0], 3]
    ragged = [axes["pools_0"], axes["pools_1"], axes["pools_2"], axes["readout"]]
    assert all(isinstance(axis, str) for shape in ragged for axis in shape)
    for level in (1, 2):
        assert axes[f"patches_{level}"][0] == axes[f"pools_{level - 1}"][0] != faces


def test_the_card_is_in_the_files_metadata(graph: onnx.ModelProto) -> None:
    names = {entry.key.removeprefix(PREFIX) for entry in graph.metadata_props}
    assert {"format_version", "name", "config", "preparation", "probe", "parity"} <= names


def test_nothing_tells_where_the_file_was_made(model_file: Path, checkpoint_file: Path) -> None:
    content = model_file.read_bytes()
    for local in (Path(onnx.__file__).parents[1], Path(__file__).parents[2], checkpoint_file):
        assert str(local).encode() not in content
    for trace in (b".py", b"site-packages", b"/home/", b"/root/", getpass.getuser().encode()):
        assert trace not in content, trace
