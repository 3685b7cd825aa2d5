"""An explanation: exact, of any class, in every form."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from meshconv3d.model.loading import load_mesh
from meshconv3d.model.mesh import Mesh
from meshconv3d.model.nn.checkpoint import load_checkpoint
from meshconv3d.model.preparation import face_areas
from meshconv3d.service.attribution import (
    FORMS,
    Explanation,
    NotExplained,
    explain,
    explained_class,
)
from meshconv3d.service.attribution.colours import legend_colours, linear_colours, srgb_colours
from meshconv3d.service.classifier import Classifier
from tests.articulated import sample_paths
from tests.meshes import torus
from tests.service.conftest import obj


@pytest.fixture(scope="module")
def classifier(model_file: Path) -> Classifier:
    return Classifier.load(str(model_file))


@pytest.fixture(scope="module")
def explanation(classifier: Classifier) -> Explanation:
    return explain(classifier, sample_paths()["snake"])


@pytest.mark.parametrize("sample", ["lamp", "snake", "laptop"])
@pytest.mark.parametrize("label", ["ball", "box", "ring"])
def test_bias_and_contributions_sum_to_the_score(
    classifier: Classifier, checkpoint_file: Path, sample: str, label: str
) -> None:
    found = explain(classifier, sample_paths()[sample], label=label)
    plain = classifier.classify(sample_paths()[sample])
    index = plain.classes.index(label)
    bias = load_checkpoint(checkpoint_file).network.classify.bias[index].item()
    assert found.label == label
    assert found.bias == pytest.approx(bias, abs=1e-4)
    assert found.contributions.sum() + bias == pytest.approx(plain.scores[index], abs=1e-4)


def test_the_likeliest_class_unless_told(explanation: Explanation) -> None:
    assert explanation.label == explanation.prediction.label


def test_the_order_of_faces_does_not_matter(classifier: Classifier) -> None:
    mesh = torus()
    order = np.random.default_rng(0).permutation(len(mesh.faces))
    one = explain(classifier, obj(mesh))
    other = explain(classifier, obj(Mesh(mesh.vertices, mesh.faces[order])))
    assert other.contributions == pytest.approx(one.contributions[order], abs=1e-9)


def test_densities_mean_the_score_less_the_bias(explanation: Explanation) -> None:
    areas = face_areas(explanation.mesh.vertices, explanation.mesh.faces)
    mean = np.average(explanation.densities, weights=areas)
    assert mean == pytest.approx(explanation.score - explanation.bias, abs=1e-9)
    within = np.abs(explanation.densities) <= explanation.limit
    assert 0.95 <= areas[within].sum() / areas.sum() < 0.97


def test_what_cannot_be_explained(classifier: Classifier) -> None:
    with pytest.raises(NotExplained, match="no class 'cup', but ball, box, ring") as error:
        explain(classifier, sample_paths()["snake"], label="cup")
    assert error.value.fault == "unknown-class"
    with pytest.raises(NotExplained, match="learned pooling") as error:
        explained_class(("a", "b"), "learned", None)
    assert error.value.fault == "learned-pooling"


def test_glb_is_the_mesh_in_its_colours(explanation: Explanation) -> None:
    content = FORMS["glb"].write("snake.3mf", explanation)
    expected = explanation.mesh.vertices[explanation.mesh.faces]
    read = load_mesh(content, "glb")
    assert read.vertices[read.faces] == pytest.approx(expected, abs=1e-6)
    length = int.from_bytes(content[12:16], "little")
    document = json.loads(content[20 : 20 + length])
    material = document["materials"][0]
    assert material["doubleSided"]
    assert material["pbrMetallicRoughness"]["metallicFactor"] == 0
    extras = document["nodes"][0]["extras"]
    assert (extras["class"], extras["file"]) == (explanation.label, "snake.3mf")
    assert extras["colours"] == legend_colours()
    colours = np.frombuffer(content[-len(expected) * 24 :], "<u2").reshape(-1, 3, 4) / 65535
    assert (colours == colours[:, :1]).all()  # one for all corners of a face
    scaled = explanation.densities / explanation.limit
    assert colours[:, 0, :3] == pytest.approx(linear_colours(scaled), abs=1e-4)


def test_ply_has_colours_and_numbers(explanation: Explanation) -> None:
    content = FORMS["ply"].write(None, explanation)
    read = load_mesh(content, "ply")
    assert (read.vertices[read.faces] == explanation.mesh.vertices[explanation.mesh.faces]).all()
    count = len(explanation.mesh.faces)
    face = np.dtype([("n", "u1"), ("i", "<i4", 3), ("contribution", "<f8"), ("density", "<f8")])
    faces = np.frombuffer(content[-count * face.itemsize :], face)
    assert (faces["contribution"] == explanation.contributions).all()
    assert (faces["density"] == explanation.densities).all()


def test_json_has_the_answer_and_the_numbers(explanation: Explanation) -> None:
    record = json.loads(FORMS["json"].write("a.obj", explanation))
    evidence = record["evidence"]
    assert (record["file"], record["class"]) == ("a.obj", explanation.label)
    assert evidence["contributions"] == pytest.approx(explanation.contributions)
    assert sum(evidence["contributions"]) + evidence["bias"] == pytest.approx(evidence["score"])
    assert len(evidence["densities"]) == len(explanation.mesh.faces)


def test_forms_of_a_mesh_that_says_nothing(explanation: Explanation) -> None:
    silent = replace(explanation, contributions=np.zeros(len(explanation.mesh.faces)))
    assert silent.limit == 0
    for form in FORMS.values():
        assert form.write(None, silent)


def test_colours_are_as_far_apart_on_both_sides() -> None:
    values = np.linspace(-1, 1, 21)
    colours = linear_colours(values)
    light = colours @ [0.2126, 0.7152, 0.0722]
    assert (np.diff(light[:11]) > 0).all()
    assert (np.diff(light[10:]) < 0).all()
    assert colours[10] == pytest.approx(colours[10, 0], abs=1e-3)  # the middle is grey
    assert (colours[:10, 2] > colours[:10, 0]).all()
    assert (colours[11:, 0] > colours[11:, 2]).all()
    assert (srgb_colours(np.array([-9.0, 9.0])) == srgb_colours(np.array([-1.0, 1.0]))).all()
