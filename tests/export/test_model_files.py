"""A file that cannot be run rightly is refused when it is opened, with the reason."""

import json
import random
from collections.abc import Callable
from pathlib import Path

import numpy as np
import onnx
import pytest
import safetensors.numpy

from meshconv3d.export.metadata import FORMAT_VERSION, PREFIX, ModelFileError
from meshconv3d.service.models import open_model

Change = Callable[[onnx.ModelProto], None]


def set_property(name: str, value: object) -> Change:
    def change(graph: onnx.ModelProto) -> None:
        entries = {entry.key: entry.value for entry in graph.metadata_props}
        onnx.helper.set_model_props(graph, entries | {PREFIX + name: json.dumps(value)})

    return change


def drop_properties(prefix: str) -> Change:
    def change(graph: onnx.ModelProto) -> None:
        entries = {entry.key: entry.value for entry in graph.metadata_props}
        kept = {key: value for key, value in entries.items() if not key.startswith(prefix)}
        del graph.metadata_props[:]
        onnx.helper.set_model_props(graph, kept)

    return change


def newer_format(graph: onnx.ModelProto) -> None:
    graph.ir_version = 99


def newer_operators(graph: onnx.ModelProto) -> None:
    graph.opset_import[0].version = 99


def rename_output(graph: onnx.ModelProto) -> None:
    graph.graph.node.append(onnx.helper.make_node("Identity", ["evidence"], ["hints"]))
    graph.graph.output[1].name = "hints"


def change_config(**fields: object) -> Change:
    def change(graph: onnx.ModelProto) -> None:
        (entry,) = (e for e in graph.metadata_props if e.key == PREFIX + "config")
        entry.value = json.dumps(json.loads(entry.value) | fields)

    return change


def test_an_untouched_model_opens(model_file: Path) -> None:
    model = open_model(str(model_file))
    assert model.card.name == "tiny"
    assert model.card.config.classes == ("ball", "box", "ring")
    assert len(model.sha256) == 64


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (drop_properties(PREFIX), "not one of meshconv3d"),
        (drop_properties(PREFIX + "config"), "damaged.*config"),
        (set_property("config", {"classes": "ring"}), "damaged"),
        (set_property("format_version", FORMAT_VERSION + 1), "upgrade meshconv3d"),
        (set_property("preparation", {"face_budget": 500}), "prepares them as"),
        (change_config(face_budget=400), "prepares them as"),
        (change_config(classes=["ball", "box"]), "damaged.*one score for each class"),
        (change_config(targets=[400, 300], channels=[8, 12]), "the graph takes"),
        (newer_format, "newer onnxruntime than the one.*upgrade it"),
        (newer_operators, "newer onnxruntime than the one.*upgrade it"),
        (rename_output, r"gives \['embedding', 'hints', 'novelty', 'scores'\]"),
    ],
)
def test_a_changed_file_is_refused(
    model_file: Path, tmp_path: Path, change: Change, reason: str
) -> None:
    graph = onnx.load(model_file)
    change(graph)
    path = tmp_path / "changed.onnx"
    path.write_bytes(graph.SerializeToString())
    with pytest.raises(ModelFileError, match=f"(?s){path}.*{reason}"):
        open_model(str(path))


def test_a_foreign_onnx_model_is_refused(tmp_path: Path) -> None:
    value = onnx.helper.make_tensor_value_info
    nodes = [onnx.helper.make_node("Relu", ["x"], ["y"])]
    shape = onnx.TensorProto.FLOAT, ["n"]
    graph = onnx.helper.make_graph(nodes, "foreign", [value("x", *shape)], [value("y", *shape)])
    opset = [onnx.helper.make_opsetid("", 20)]
    path = tmp_path / "foreign.onnx"
    path.write_bytes(
        onnx.helper.make_model(graph, opset_imports=opset, ir_version=10).SerializeToString()
    )
    with pytest.raises(ModelFileError, match=r"not one of meshconv3d.*meshconv3d export"):
        open_model(str(path))


def test_weights_in_another_file_are_refused(
    model_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Even where the other file is at hand: the hash of the model does not cover it."""
    path = tmp_path / "external.onnx"
    onnx.save(
        onnx.load(model_file),
        path,
        save_as_external_data=True,
        location="external.data",
        size_threshold=0,
    )
    monkeypatch.chdir(tmp_path)
    with pytest.raises(ModelFileError, match=r"another file.*hash"):
        open_model(str(path))


def test_a_checkpoint_is_told_how_to_become_a_model(tmp_path: Path) -> None:
    path = tmp_path / "model.safetensors"
    path.write_bytes(safetensors.numpy.save({"weight": np.zeros(3, np.float32)}))
    with pytest.raises(ModelFileError, match=r"checkpoint.*meshconv3d export"):
        open_model(str(path))


@pytest.mark.parametrize("content", [b"", b"junk", b"\0" * 1000, b"v 0 0 0\nf 1 1 1\n"])
def test_what_is_no_onnx_is_refused(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "junk.onnx"
    path.write_bytes(content)
    with pytest.raises(ModelFileError):
        open_model(str(path))


def test_a_cut_file_is_refused(model_file: Path, tmp_path: Path) -> None:
    content = model_file.read_bytes()
    path = tmp_path / "cut.onnx"
    for length in range(0, len(content) - 1, len(content) // 17):
        path.write_bytes(content[:length])
        with pytest.raises(ModelFileError):
            open_model(str(path))


def test_damage_raises_nothing_but_the_models_own_error(
    model_file: Path, tmp_path: Path, capfd: pytest.CaptureFixture
) -> None:
    content = model_file.read_bytes()
    path = tmp_path / "damaged.onnx"
    random_byte = random.Random(0)
    refused = 0
    for _ in range(150):
        damaged = bytearray(content)
        for _ in range(3):
            damaged[random_byte.randrange(len(damaged))] = random_byte.randrange(256)
        path.write_bytes(damaged)
        try:
            open_model(str(path))
        except ModelFileError:
            refused += 1
    assert refused > 50
    assert capfd.readouterr().out == ""  # where the answers go


def test_a_missing_file_is_told_with_what_there_is(tmp_path: Path) -> None:
    with pytest.raises(ModelFileError, match=r"no model '.*nothing.onnx'.*shipped model"):
        open_model(str(tmp_path / "nothing.onnx"))
    with pytest.raises(ModelFileError, match="no model"):
        open_model(str(tmp_path))
