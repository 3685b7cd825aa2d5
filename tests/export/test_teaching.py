"""A taught head parts classes by the angle of their means; its file is an ordinary model file."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from meshconv3d.export.metadata import ModelFileError
from meshconv3d.export.runtime import open_session
from meshconv3d.export.teaching import (
    EXAMPLES,
    Examples,
    Teacher,
    confusions,
    doubted,
    in_several_classes,
)
from meshconv3d.model.loading import load_mesh
from meshconv3d.model.preparation import prepare
from meshconv3d.model.samples import sample_paths
from meshconv3d.model.topology.inputs import collate, mesh_inputs
from meshconv3d.service.models import ModelFile

CLASSES = ("bolt", "nut", "ring", "washer")


@pytest.fixture(scope="module")
def teacher(model_file: Path) -> Teacher:
    return Teacher(model_file.read_bytes())


def drawn(teacher: Teacher, of_each: int, apart: float = 0.5, seed: int = 0) -> Examples:
    """Examples of four classes around random means."""
    rng = np.random.default_rng(seed)
    channels = len(teacher._centre)
    means = rng.normal(0, apart, (len(CLASSES), channels))
    labels = np.arange(of_each * len(CLASSES)) % len(CLASSES)
    features = means[labels] + rng.normal(0, 0.2, (len(labels), channels))
    files = tuple(f"{i}.stl" for i in range(len(labels)))
    return Examples(CLASSES, files, labels, features.astype(np.float32))


def without(examples: Examples, member: int) -> Examples:
    kept = [i for i in range(len(examples.files)) if i != member]
    files = tuple(examples.files[i] for i in kept)
    return Examples(examples.classes, files, examples.labels[kept], examples.features[kept])


def test_scores_part_by_angle_under_the_shared_covariance(teacher: Teacher) -> None:
    examples = drawn(teacher, 6)
    head, _ = teacher.fit(examples)
    point = np.random.default_rng(1).normal(0, 0.5, len(teacher._centre))
    scores = head.weight @ point + head.bias
    whitened = (point - teacher._centre) @ head.within
    lengths = np.linalg.norm(head.means, axis=1)
    cosines = head.means @ whitened / lengths / np.linalg.norm(whitened)
    assert scores / scores[0] == pytest.approx(cosines / cosines[0], rel=1e-3, abs=1e-3)
    assert scores.argmax() == cosines.argmax()


def test_one_example_of_each_class_is_enough(teacher: Teacher) -> None:
    examples = drawn(teacher, 1)
    head, left_out = teacher.fit(examples)
    given = (examples.features @ head.weight.T + head.bias).argmax(axis=1)
    assert given.tolist() == examples.labels.tolist()
    assert len(left_out.labels) == 0


def test_leaving_one_out_is_as_if_it_had_never_been_taught(teacher: Teacher) -> None:
    examples = drawn(teacher, 5, apart=0.1)
    _, left_out = teacher.fit(examples)
    assert 0.2 < left_out.accuracy < 1  # there is something to tell
    for place, member in enumerate(left_out.members.tolist()):
        head, _ = teacher.fit(without(examples, member))
        literal = head.weight @ examples.features[member] + head.bias
        found = left_out.scores[place]
        # They differ by a constant, and by what the example adds to the mean variance.
        assert found - found.mean() == pytest.approx(literal - literal.mean(), rel=0.15, abs=0.15)


def test_a_mislabelled_example_is_named(teacher: Teacher) -> None:
    examples = drawn(teacher, 8, apart=2)
    labels = examples.labels.copy()
    labels[0] = 3  # it was 0
    wrong = Examples(CLASSES, examples.files, labels, examples.features)
    _, left_out = teacher.fit(wrong)
    assert doubted(wrong, left_out, 1.0) == [("0.stl", "bolt")]
    assert confusions(wrong, left_out) == [("washer", "bolt", 1)]


def test_one_mesh_in_two_classes_is_named() -> None:
    rows = np.random.default_rng(0).normal(size=(4, 8)).astype(np.float32)
    features = [rows[0], rows[1], rows[0], rows[2], rows[2]]
    examples = Examples.of(["a", "a", "b", "b", "b"], ["1", "2", "3", "4", "5"], features)
    assert in_several_classes(examples) == [["1", "3"]]


def test_a_taught_file_gives_the_scores_of_its_head_and_the_embedding_of_its_base(
    teacher: Teacher, model_file: Path
) -> None:
    name, path = next(iter(sample_paths().items()))
    mesh = load_mesh(path)
    prepared, _ = prepare(mesh, teacher.card.config.face_budget)
    inputs = mesh_inputs(prepared, teacher.card.config)
    own = Teacher(model_file.read_bytes())
    examples = drawn(own, 3)
    head, left_out = own.fit(examples)
    taught = own.teach("mine", examples, (name, mesh), by="Anna")
    session = open_session(taught.content)
    outputs: dict[str, Any] = dict(
        zip(
            (output.name for output in session.get_outputs()),
            session.run(None, collate([inputs])),
            strict=True,
        )
    )
    expected = teacher.features(mesh) @ head.weight.T + head.bias
    assert outputs["scores"][0] == pytest.approx(expected, rel=1e-4, abs=1e-4)
    assert outputs["evidence"].mean(axis=0) + head.bias == pytest.approx(
        expected, rel=1e-3, abs=1e-3
    )
    base = open_session(model_file.read_bytes())
    assert np.array_equal(
        outputs["embedding"], np.asarray(base.run(["embedding"], collate([inputs]))[0])
    )
    card = taught.card
    assert card.config.classes == CLASSES
    assert card.space == teacher.card.space
    assert card.accuracy["left_out"] == round(left_out.accuracy, 5)
    assert card.training["taught"]["by"] == "Anna"
    assert card.training["taught"]["examples"] == dict.fromkeys(CLASSES, 3)
    assert "Taught by Anna" in card.about


def test_adding_examples_is_as_teaching_all_at_once(teacher: Teacher) -> None:
    everything = drawn(teacher, 4)
    some = Examples(
        CLASSES[:3],
        tuple(f for f, label in zip(everything.files, everything.labels, strict=True) if label < 3),
        everything.labels[everything.labels < 3],
        everything.features[everything.labels < 3],
    )
    others = Examples(
        CLASSES[3:],
        tuple(
            f for f, label in zip(everything.files, everything.labels, strict=True) if label == 3
        ),
        np.zeros(4, np.int64),
        everything.features[everything.labels == 3],
    )
    joined = Examples.from_property(some.to_property()).joined(others)
    assert joined.classes == CLASSES
    order = [everything.files.index(file) for file in joined.files]
    assert joined.labels.tolist() == everything.labels[order].tolist()
    assert joined.features == pytest.approx(everything.features[order], rel=1e-3)
    again = joined.joined(others)
    assert len(again.files) == len(everything.files)  # one of the same name is replaced


def test_a_file_that_is_taught_more_goes_on_with_its_base(model_file: Path) -> None:
    """Not with the covariance of its earlier examples, which would count twice."""
    sample = next(iter(sample_paths().items()))
    probe = sample[0], load_mesh(sample[1])
    first = Teacher(model_file.read_bytes())
    examples = drawn(first, 4)
    taught = first.teach("mine", examples, probe)
    again = Teacher(taught.content)
    assert again.examples is not None
    ours, theirs = (t.fit(e)[0] for t, e in ((first, examples), (again, again.examples)))
    for one, other in zip(vars(ours).values(), vars(theirs).values(), strict=True):
        assert other == pytest.approx(one, rel=2e-2, abs=2e-2)
    base = first.card.calibration
    assert base is not None
    assert taught.card.calibration is not None
    assert taught.card.calibration.same_shape == base.same_shape


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"classes":[],"files":[],"labels":[0]}'])
def test_damaged_examples_are_refused(text: str) -> None:
    with pytest.raises(ModelFileError, match="damaged"):
        Examples.from_property(text)


def test_examples_are_beside_the_card_in_the_file() -> None:
    assert not EXAMPLES.startswith("meshconv3d.")


def test_classes_of_the_base_that_are_not_taught_are_others() -> None:
    base = Teacher(ModelFile.read("objects").content)
    within = base._base_within
    points = base._others  # whitened: shapes of no class, then the means of the base's classes
    names = base.card.config.classes
    chair, car, table = (
        len(points) - len(names) + names.index(n) for n in ("chair", "car", "table")
    )
    rng = np.random.default_rng(0)
    near = np.repeat(points[[chair, car]], 5, axis=0) + rng.normal(0, 1, (10, points.shape[1]))
    features = near @ np.linalg.inv(within) + base._centre
    examples = Examples.of(
        ["mine"] * 5 + ["yours"] * 5, [str(i) for i in range(10)], list(features.astype(np.float32))
    )
    head, left_out = base.fit(examples)
    back = head.others @ np.linalg.inv(head.within) @ within

    def is_other(place: int) -> bool:
        return bool(np.isclose(back, points[place], rtol=1e-2, atol=1e-2).all(axis=1).any())

    assert [is_other(place) for place in (chair, car, table)] == [False, False, True]
    assert len(head.others) == len(points) - 2
    assert len(left_out.labels) == 10


def test_copies_of_a_mesh_count_once_in_a_class() -> None:
    rows = np.random.default_rng(0).normal(size=(3, 8)).astype(np.float32)
    features = [rows[0], rows[0], rows[1], rows[2], rows[0]]
    examples = Examples.of(["a", "a", "a", "b", "b"], ["1", "2", "3", "4", "5"], features)
    distinct, copies = examples.distinct()
    assert distinct.files == ("1", "3", "4", "5")
    assert distinct.counts.tolist() == [2, 2]
    assert copies == [["1", "2"]]


def test_a_mesh_that_was_taught_is_known_again_in_another_class() -> None:
    rows = np.random.default_rng(0).normal(size=(2, 8)).astype(np.float32)
    taught = Examples.of(["a", "b"], ["1", "2"], list(rows))
    again = Examples.from_property(taught.to_property())
    more = again.joined(Examples.of(["c"], ["3"], [rows[0]]))
    assert in_several_classes(more) == [["1", "3"]]
