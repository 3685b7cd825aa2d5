"""The whole pipeline of the default model, and sample meshes that are prepared for it."""

from pathlib import Path

import numpy as np
import onnx
import pytest

from meshconv3d.export.whole import export_whole
from meshconv3d.model.loading import load_mesh
from meshconv3d.model.mesh import Mesh
from meshconv3d.model.preparation import prepare
from meshconv3d.model.samples import sample_paths
from meshconv3d.model.topology.inputs import as_given, collate, mesh_inputs, whole_inputs
from meshconv3d.service.models import Model, ModelFile, shipped_models
from tests.conftest import made_once
from tests.meshes import write_off


@pytest.fixture(scope="session")
def whole_model(tmp_path_factory: pytest.TempPathFactory) -> Path:
    def make(path: Path) -> Path:
        mesh, _ = prepare(load_mesh(sample_paths()["chair"]), 500)
        export_whole(onnx.load(shipped_models()["objects"]), path, {"chair": mesh})
        return path

    return made_once("objects-whole.onnx", make, tmp_path_factory)


@pytest.fixture(scope="session")
def model() -> Model:
    return ModelFile.read("objects").open()


@pytest.fixture(scope="session")
def prepared_samples(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Path]:
    """Prepared samples as OFF files, by name."""
    folder = tmp_path_factory.mktemp("prepared")
    for name, path in sample_paths().items():
        mesh, _ = prepare(load_mesh(path), 500)
        write_off(folder / f"{name}.off", mesh)
    return {path.stem: path for path in sorted(folder.iterdir())}


def scores_of(model: Model, path: Path) -> dict[str, float]:
    """The model's score of each class for a prepared mesh, by the kernels, the highest first."""
    mesh: Mesh = load_mesh(path)
    inputs = collate([mesh_inputs(as_given(whole_inputs(mesh)), model.card.config)])
    (scores,) = (np.asarray(output)[0] for output in model.session.run(["scores"], inputs))
    classes = model.card.config.classes
    return {classes[i]: float(scores[i]) for i in scores.argsort()[::-1]}
