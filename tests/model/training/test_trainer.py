"""Training learns, is repeatable, and goes on where it was killed."""

import json
from dataclasses import replace

import numpy as np
import pytest
import torch

from meshconv3d.model.config import NetworkConfig
from meshconv3d.model.preparation import prepare
from meshconv3d.model.topology.inputs import collate, mesh_inputs
from meshconv3d.model.training.augmentation import Augmentation
from meshconv3d.model.training.evaluation import accuracy, predict
from meshconv3d.model.training.meshes import LabelledMesh, LoadedSamples
from meshconv3d.model.training.trainer import LOG_FILE, RESUME_FILE, Trainer, TrainingConfig
from tests.meshes import cube, icosphere, torus

CONFIG = NetworkConfig(
    classes=("ball", "box", "ring"),
    face_budget=80,
    patch_size=6,
    channels=(8, 12, 16),
    targets=(60, 40, 20),
    descriptor_hidden=16,
    dropout=0.2,
    descriptor_channels=8,
)
TRAINING = TrainingConfig(epochs=4, batch_size=6, learning_rate=0.02)


class Killed(Exception):
    pass


@pytest.fixture(scope="module")
def shapes() -> list[list[LabelledMesh]]:
    """Balls, boxes and rings, each squeezed and dented a little; no copies of any."""
    rng = np.random.default_rng(0)
    meshes = []
    for _ in range(6):
        for label, shape in enumerate((icosphere(1), cube(), torus(8, 5))):
            squeezed = shape.vertices * rng.uniform(0.8, 1.2, 3)
            dented = squeezed + rng.normal(0, 0.02, squeezed.shape)
            mesh, _ = prepare(shape.moved(dented), CONFIG.face_budget)
            meshes.append([LabelledMesh(mesh, mesh_inputs(mesh, CONFIG), label)])
    return meshes


def weights(trainer: Trainer) -> dict[str, torch.Tensor]:
    return {name: tensor.clone() for name, tensor in trainer.network.state_dict().items()}


def ignore(record) -> None:
    pass


def kill_after(epoch: int):
    def on_epoch(record):
        if record["epoch"] == epoch:
            raise Killed

    return on_epoch


def same(one: dict[str, torch.Tensor], two: dict[str, torch.Tensor]) -> bool:
    assert one.keys() == two.keys()
    return all(torch.equal(one[name], two[name]) for name in one)


@pytest.fixture(scope="module")
def uninterrupted(shapes, tmp_path_factory) -> Trainer:
    trainer = Trainer(CONFIG, TRAINING, shapes, tmp_path_factory.mktemp("run"))
    trainer.run(ignore)
    return trainer


@pytest.mark.parametrize("epoch", [1, 3])
def test_a_killed_run_resumes_to_the_same_weights_bit_for_bit(
    shapes, uninterrupted, tmp_path, epoch
):
    with pytest.raises(Killed):
        Trainer(CONFIG, TRAINING, shapes, tmp_path).run(kill_after(epoch))
    torch.manual_seed(99)
    resumed = Trainer(CONFIG, TRAINING, shapes, tmp_path)
    assert resumed.resume() == epoch
    resumed.run(ignore)
    assert same(weights(resumed), weights(uninterrupted))
    timeless = [
        [{k: v for k, v in r.items() if k != "seconds"} for r in t.history]
        for t in (resumed, uninterrupted)
    ]
    assert timeless[0] == timeless[1]


def test_killed_in_the_middle_of_an_epoch_it_repeats_that_epoch(
    shapes, uninterrupted, tmp_path, monkeypatch
):
    trainer = Trainer(CONFIG, TRAINING, shapes, tmp_path)
    steps = iter(range(4))

    def loss_or_die(*args):
        if next(steps, None) is None:
            raise Killed
        return original(*args)

    original = trainer.loss
    monkeypatch.setattr(trainer, "loss", loss_or_die)
    with pytest.raises(Killed):
        trainer.run(ignore)
    resumed = Trainer(CONFIG, TRAINING, shapes, tmp_path)
    assert resumed.resume() == 1
    resumed.run(ignore)
    assert same(weights(resumed), weights(uninterrupted))


def test_resuming_a_finished_run_changes_nothing(shapes, uninterrupted):
    again = Trainer(CONFIG, TRAINING, shapes, uninterrupted.folder)
    assert again.resume() == TRAINING.epochs
    again.run(kill_after(0))
    assert same(weights(again), weights(uninterrupted))


def test_another_seed_gives_other_weights(shapes, uninterrupted, tmp_path):
    other = Trainer(CONFIG, replace(TRAINING, seed=1), shapes, tmp_path)
    other.run(ignore)
    assert not same(weights(other), weights(uninterrupted))


def test_every_epoch_sees_other_copies_in_another_order(shapes, tmp_path, monkeypatch):
    batches = []
    monkeypatch.setattr(
        "meshconv3d.model.training.trainer.collate",
        lambda batch: batches.append(collate(batch)) or batches[-1],
    )
    Trainer(CONFIG, replace(TRAINING, epochs=2), shapes, tmp_path).run(ignore)
    assert len(batches) == 6
    centroids = [{tuple(row) for row in batch["terms"][:, 9:12].tolist()} for batch in batches]
    assert all(not one & two for i, one in enumerate(centroids) for two in centroids[:i])


def test_an_empty_folder_starts_from_the_beginning(shapes, tmp_path):
    trainer = Trainer(CONFIG, TRAINING, shapes, tmp_path / "new" / "run")
    assert trainer.resume() == 0
    assert (tmp_path / "new" / "run").is_dir()


@pytest.mark.parametrize(
    ("config", "training", "count"),
    [
        (replace(CONFIG, patch_size=7), TRAINING, 18),
        (replace(CONFIG, classes=("a", "b", "c")), TRAINING, 18),
        (CONFIG, replace(TRAINING, epochs=5), 18),
        (CONFIG, replace(TRAINING, seed=5), 18),
        (CONFIG, replace(TRAINING, augmentation=Augmentation(jitter=0.5)), 18),
        (CONFIG, TRAINING, 17),
    ],
    ids=["network", "classes", "epochs", "seed", "augmentation", "data"],
)
def test_a_run_with_other_settings_or_data_is_not_resumed(
    shapes, uninterrupted, config, training, count
):
    trainer = Trainer(config, training, shapes[:count], uninterrupted.folder)
    before = weights(trainer)
    with pytest.raises(ValueError, match="other settings or data"):
        trainer.resume()
    assert same(weights(trainer), before)


def test_a_run_that_started_elsewhere_goes_on_as_itself_alone(shapes, uninterrupted, tmp_path):
    """It begins with the weights it is given, and not with those of the seed."""
    start = uninterrupted.network
    one = Trainer(CONFIG, TRAINING, shapes, tmp_path, start=start)
    assert same(one.network.geodesic.state_dict(), start.geodesic.state_dict())
    assert same(one.network.classify.state_dict(), start.classify.state_dict())
    with pytest.raises(Killed):
        one.run(kill_after(1))
    assert Trainer(CONFIG, TRAINING, shapes, tmp_path, start=start).resume() == 1
    with pytest.raises(ValueError, match="other settings or data"):
        Trainer(CONFIG, TRAINING, shapes, tmp_path).resume()
    with pytest.raises(ValueError, match="other settings or data"):
        Trainer(CONFIG, TRAINING, shapes, tmp_path, start=one.network).resume()


def test_the_log_has_a_line_for_each_epoch(uninterrupted):
    lines = (uninterrupted.folder / LOG_FILE).read_text().splitlines()
    records = [json.loads(line) for line in lines]
    assert [record["epoch"] for record in records] == [1, 2, 3, 4]
    assert records == uninterrupted.history
    assert records[0].keys() >= {"loss", "train_accuracy", "learning_rate", "seconds"}
    assert (uninterrupted.folder / RESUME_FILE).is_file()


def test_validation_figures_join_the_record(shapes, tmp_path):
    trainer = Trainer(CONFIG, replace(TRAINING, epochs=2), shapes, tmp_path)
    seen = []
    trainer.run(
        seen.append, lambda network: {"val_accuracy": accuracy(network, LoadedSamples(shapes, 0))}
    )
    assert [0 <= record["val_accuracy"] <= 1 for record in seen] == [True, True]
    assert seen == trainer.history


def test_three_shapes_are_learnt(shapes, tmp_path):
    trainer = Trainer(CONFIG, replace(TRAINING, epochs=20), shapes, tmp_path)
    checkpoint = trainer.run(ignore)
    assert trainer.history[-1]["loss"] < trainer.history[0]["loss"]
    assert trainer.history[-1]["train_accuracy"] >= 0.9
    assert accuracy(checkpoint.network, LoadedSamples(shapes, 0)) >= 0.9
    assert not checkpoint.network.training
    assert checkpoint.training["protocol"]["epochs"] == 20


def test_prediction_does_not_depend_on_the_batch(shapes, uninterrupted):
    meshes = [mesh for (mesh,) in shapes]
    together = predict(uninterrupted.network, meshes).scores.numpy()
    alone = [predict(uninterrupted.network, [mesh]).scores[0].numpy() for mesh in meshes]
    assert together == pytest.approx(np.array(alone), abs=1e-5)
    assert together.shape == (18, 3)


def test_refused_files_count_as_wrong(shapes, uninterrupted):
    right = accuracy(uninterrupted.network, LoadedSamples(shapes, 0)) * 18
    with_refused = accuracy(uninterrupted.network, LoadedSamples(shapes, 9))
    assert with_refused == pytest.approx(right / 27)
    assert accuracy(uninterrupted.network, LoadedSamples([], 9)) == 0


def test_an_epoch_draws_one_version_of_every_mesh(shapes, tmp_path, monkeypatch):
    """A mesh and its copy, told apart by their face counts."""
    copy = prepare(cube(), 500)[0]
    other = LabelledMesh(copy, mesh_inputs(copy, CONFIG), 0)
    drawn = []
    monkeypatch.setattr(
        "meshconv3d.model.training.trainer.collate",
        lambda batch: drawn.extend(len(inputs.terms) for inputs in batch) or collate(batch),
    )
    versions = [[mesh, other] for (mesh,) in shapes]
    Trainer(CONFIG, replace(TRAINING, epochs=3), versions, tmp_path).run(ignore)
    copies = sum(count >= 499 for count in drawn)
    assert len(shapes) * 3 - 3 * TRAINING.batch_size < len(drawn) <= len(shapes) * 3
    assert 0.2 < copies / len(drawn) < 0.8


def test_a_run_is_not_resumed_on_moved_meshes(shapes, uninterrupted):
    (first,), *others = shapes
    moved = replace(first, mesh=first.mesh.moved(first.mesh.vertices * 0.9))
    trainer = Trainer(CONFIG, TRAINING, [[moved], *others], uninterrupted.folder)
    with pytest.raises(ValueError, match="other settings or data"):
        trainer.resume()
