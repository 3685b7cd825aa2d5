"""A whole pipeline takes vertices and faces, and computes what kernels and model file do."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import onnx
import pytest
from click.testing import CliRunner
from numpy.typing import NDArray

from meshconv3d.export.comparison import OUTPUTS, TOLERANCE, ParityError
from meshconv3d.export.metadata import PREFIX
from meshconv3d.export.onnx_file import export_model
from meshconv3d.export.parity import check_parity
from meshconv3d.export.runtime import onnxruntime as ort
from meshconv3d.export.runtime import open_session
from meshconv3d.export.whole import export_whole
from meshconv3d.export.whole.parity import run_by_name
from meshconv3d.export.whole.pipeline import OWN, topology_model
from meshconv3d.model.config import PRESETS, NetworkConfig
from meshconv3d.model.mesh import Mesh
from meshconv3d.model.nn.checkpoint import Checkpoint
from meshconv3d.model.preparation import into_unit_sphere, prepare
from meshconv3d.model.topology.inputs import (
    as_given,
    collate,
    input_names,
    mesh_inputs,
    whole_inputs,
)
from meshconv3d.service.cli.main import commands
from meshconv3d.service.models import open_model
from tests.conftest import SMALL, WIDER
from tests.meshes import cube, icosphere, moebius, sheet, together, torus
from tests.networks import untrained

# Not prepared: of any number of faces. The sphere's faces tie by its symmetry, and it has more
# faces than the integral invariants take all of.
MESHES: Mapping[str, Mesh] = {
    "closed": torus(),
    "bordered": sheet(),
    "components": together(torus(12, 6), cube(), sheet(3, 2)),
    "fewer faces than any target": cube(),
    "one face": Mesh(np.eye(3), [[0, 1, 2]]),
    "one-sided": moebius(),
    "symmetric and large": icosphere(3),
    "unused vertices": Mesh(
        np.concatenate([torus(12, 6).vertices, np.full((300, 3), 0.1)])[::-1],
        371 - torus(12, 6).faces,
    ),
    "prepared": prepare(together(torus(40, 20), cube()), 500)[0],
}
CONFIGS = {
    "default": SMALL,
    "objects": WIDER,
    "axes of the file, other sizes": replace(
        SMALL, axes="file", patch_size=4, channels=(8, 8), targets=(90, 20), pooling_norm="plain"
    ),
}


def in_sphere(mesh: Mesh) -> Mesh:
    return mesh.moved(into_unit_sphere(mesh.vertices, mesh.faces))


@pytest.fixture(scope="module", params=list(CONFIGS.values()), ids=list(CONFIGS))
def topology(request: pytest.FixtureRequest) -> tuple[NetworkConfig, ort.InferenceSession]:
    config = request.param
    opset = [onnx.helper.make_opsetid("", 20)]
    like = onnx.ModelProto(ir_version=10, opset_import=opset)
    model = topology_model(config, like)
    onnx.checker.check_model(model, full_check=True)
    return config, open_session(model.SerializeToString())


@pytest.mark.parametrize("name", MESHES)
def test_inputs_of_the_network_are_those_of_the_kernels(
    topology: tuple[NetworkConfig, ort.InferenceSession], name: str
) -> None:
    config, session = topology
    inputs = whole_inputs(in_sphere(MESHES[name]))
    expected = collate([mesh_inputs(as_given(inputs), config)])
    found = run_by_name(session, inputs, input_names(config))
    for each, array in expected.items():
        if each == "terms":
            np.testing.assert_allclose(found[each], array, atol=1e-4)
        else:
            np.testing.assert_array_equal(found[each], array, err_msg=each)
            assert found[each].dtype == array.dtype


def test_outputs_are_those_of_the_model(whole_file: Path, model_file: Path) -> None:
    whole, model = (open_session(path.read_bytes()) for path in (whole_file, model_file))
    assert [value.name for value in whole.get_outputs()] == list(OUTPUTS)
    for name, mesh in MESHES.items():
        inputs = whole_inputs(in_sphere(mesh))
        arrays: dict[str, NDArray] = collate([mesh_inputs(as_given(inputs), SMALL)])
        found, expected = (
            run_by_name(each, feed, OUTPUTS) for each, feed in ((whole, inputs), (model, arrays))
        )
        for output in OUTPUTS:
            scale = max(1.0, float(np.abs(expected[output]).max()))
            np.testing.assert_allclose(
                found[output], expected[output], atol=TOLERANCE * scale, err_msg=f"{name}: {output}"
            )


def test_the_file_has_standard_operators_and_two_inputs(whole_file: Path) -> None:
    model = onnx.load(whole_file)
    onnx.checker.check_model(model, full_check=True)
    assert [(entry.domain, entry.version) for entry in model.opset_import] == [("", 20)]
    assert not model.functions
    inputs = {
        value.name: (
            value.type.tensor_type.elem_type,
            [axis.dim_param or axis.dim_value for axis in value.type.tensor_type.shape.dim],
        )
        for value in model.graph.input
    }
    assert inputs == {
        "vertices": (onnx.TensorProto.FLOAT, ["vertices", 3]),
        "faces": (onnx.TensorProto.INT64, ["faces", 3]),
    }


def test_the_card_is_the_models_with_a_parity_of_its_own(
    whole_file: Path, model_file: Path
) -> None:
    cards = [
        {entry.key.removeprefix(PREFIX): entry.value for entry in onnx.load(path).metadata_props}
        for path in (whole_file, model_file)
    ]
    assert {name for name in cards[1] if cards[0][name] != cards[1][name]} == {"parity"}
    assert '"meshes": 12' in cards[0]["parity"]


@pytest.mark.parametrize(
    "settings",
    [
        {"pooling_norm": "plain", "channels": (8, 12), "targets": (300, 100)},
        PRESETS["paper"] | {"channels": (8, 12), "targets": (300, 100)},
    ],
    ids=["plain norm", "the paper to the letter"],
)
def test_learned_pooling_is_exported_as_a_whole_pipeline(
    settings: dict[str, Any], tmp_path: Path
) -> None:
    network = untrained(replace(SMALL, **{"pooling": "learned"} | settings))
    path = tmp_path / "whole.onnx"
    known = {name: in_sphere(MESHES[name]) for name in ("closed", "bordered")}
    card = export_model(Checkpoint(network), path, "learned", known)
    assert card.parity["meshes"] == 2
    model = onnx.load(path)
    onnx.checker.check_model(model, full_check=True)
    assert [entry.domain for entry in model.opset_import] == [""]
    # A sphere of faces that are exactly alike is dented: rounding would choose among them.
    others = {name: in_sphere(mesh) for name, mesh in MESHES.items() if "symmetric" not in name}
    sphere = icosphere(3)
    noise = np.random.default_rng(0).normal(0, 0.01, sphere.vertices.shape)
    others["dented"] = in_sphere(sphere.moved(sphere.vertices + noise))
    check_parity(path.read_bytes(), network, others)


def test_it_adds_less_than_200_kb(whole_file: Path, model_file: Path) -> None:
    assert whole_file.stat().st_size - model_file.stat().st_size < 200_000


def test_other_faces_are_not_written(
    model_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A topology stage with other targets chooses other faces."""
    wrong = topology_model(replace(SMALL, targets=(390, 300, 200)), onnx.load(model_file))
    monkeypatch.setattr("meshconv3d.export.whole.pipeline.topology_model", lambda *_: wrong)
    with pytest.raises(ParityError, match="torus: pools_0"):
        export_whole(onnx.load(model_file), tmp_path / "whole.onnx", {"torus": in_sphere(torus())})
    assert list(tmp_path.iterdir()) == []


def test_no_value_of_its_own_has_the_name_of_one_of_the_network(whole_file: Path) -> None:
    model = onnx.load(whole_file)
    names = [name for node in model.graph.node for name in node.output]
    assert len(names) == len(set(names))
    assert any(name.startswith(OWN) for name in names)


def test_the_command_takes_a_model_file(model_file: Path, whole_file: Path, tmp_path: Path) -> None:
    """So that models that were taught, which have no checkpoint, can be made whole."""
    path = tmp_path / "whole.onnx"
    arguments = ["export", str(model_file), "--whole", "-o", str(path)]
    result = CliRunner().invoke(commands, arguments)
    assert result.exit_code == 0, result.output
    assert "12 meshes" in result.stdout
    assert onnx.load(path).graph == onnx.load(whole_file).graph

    (tmp_path / "card.md").write_text("# Other")
    named = ["--name", "other", "--card", str(tmp_path / "card.md")]
    result = CliRunner().invoke(commands, [*arguments, *named])
    assert result.exit_code == 0, result.output
    card = open_model(str(path)).card
    assert (card.name, card.about) == ("other", "# Other")

    result = CliRunner().invoke(commands, ["export", str(path), "--whole", "-o", str(path)])
    assert result.exit_code == 1
    assert "is a whole pipeline" in result.stderr
