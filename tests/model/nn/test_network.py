"""What must not change the scores, and what they are the sum of."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from meshconv3d.model.config import NetworkConfig
from meshconv3d.model.loading import load_mesh
from meshconv3d.model.mesh import Mesh
from meshconv3d.model.nn.network import Network, as_tensors
from meshconv3d.model.preparation import prepare
from meshconv3d.model.topology.inputs import MeshInputs, collate, mesh_inputs
from meshconv3d.model.training.variation import subdivided
from tests.meshes import cube, moebius, sheet, together, torus
from tests.networks import topology_of, untrained


def close(expected: np.ndarray):
    """Equal up to what float32 arithmetic rounds away."""
    return pytest.approx(expected, abs=2e-5 * max(1.0, float(np.abs(expected).max())))


def run(network: Network, batch: list[MeshInputs]) -> tuple[np.ndarray, np.ndarray]:
    with torch.inference_mode():
        scores, evidence, *_ = network(*as_tensors(collate(batch)))
    return scores.numpy(), evidence.numpy()


def score(network: Network, mesh: Mesh) -> np.ndarray:
    """From the mesh as loaded to its scores."""
    prepared, _ = prepare(mesh, network.config.face_budget)
    return run(network, [mesh_inputs(prepared, network.config)])[0][0]


def renumbered(mesh: Mesh, rng: np.random.Generator) -> Mesh:
    order = rng.permutation(len(mesh.vertices))
    return Mesh(mesh.vertices[order], np.argsort(order)[mesh.faces])


def shuffled(mesh: Mesh, rng: np.random.Generator) -> Mesh:
    return Mesh(mesh.vertices, rng.permutation(mesh.faces))


def corners_rotated(mesh: Mesh, rng: np.random.Generator) -> Mesh:
    turns = rng.integers(0, 3, (len(mesh.faces), 1))
    return Mesh(mesh.vertices, np.take_along_axis(mesh.faces, (np.arange(3) + turns) % 3, axis=1))


def wound_at_random(mesh: Mesh, rng: np.random.Generator) -> Mesh:
    turn = rng.random(len(mesh.faces)) < 0.5
    return Mesh(mesh.vertices, np.where(turn[:, None], mesh.faces[:, ::-1], mesh.faces))


def moved_and_scaled(mesh: Mesh, rng: np.random.Generator) -> Mesh:
    return mesh.moved((mesh.vertices + rng.normal(0, 50, 3)) * 10 ** rng.uniform(-3, 5))


CHANGES = [renumbered, shuffled, corners_rotated, wound_at_random, moved_and_scaled]
CLOSED = {
    "torus": torus(),
    "another": torus(50, 5, tube=0.7),
    "two": together(torus(15, 10), torus(20, 5).moved(torus(20, 5).vertices + 4)),
    "subdivided": torus(12, 8),
    "decimated": torus(40, 20),
}


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize("mesh", CLOSED.values(), ids=CLOSED.keys())
def test_how_a_mesh_is_written_down_does_not_change_its_scores(either, mesh, change, seed):
    network = untrained(either)
    other = change(mesh, np.random.default_rng(seed))
    assert score(network, other) == close(score(network, mesh))


def crate() -> Mesh:
    """As modelled by hand: flat, symmetric and full of ties, with parts that touch, faces that are
    there twice in both windings, and an open lid."""
    box = subdivided(subdivided(subdivided(cube())))
    lid = sheet(10, 10)
    beside = box.moved(box.vertices * [0.5, 0.25, 0.5] + [1, 0, 0])
    whole = together(box, beside, lid.moved(lid.vertices * 0.1 + [0, 0, 2]))
    again = [whole.faces[:40], whole.faces[20:60, ::-1]]
    return Mesh(whole.vertices, np.concatenate([whole.faces, *again]))


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("change", CHANGES)
def test_nor_does_it_for_a_mesh_as_modelled_by_hand(either, change, seed):
    network = untrained(either)
    other = change(crate(), np.random.default_rng(seed))
    assert score(network, other) == close(score(network, crate()))


@pytest.mark.parametrize("change", [renumbered, shuffled, corners_rotated, moved_and_scaled])
def test_nor_does_it_for_an_open_sheet(either, change):
    mesh = sheet(25, 10)
    network = untrained(either)
    other = change(mesh, np.random.default_rng(0))
    assert score(network, other) == close(score(network, mesh))


def test_the_shape_does_change_the_scores(either):
    network = untrained(either)
    one, two, three = (score(network, CLOSED[name]) for name in ("torus", "another", "two"))
    assert np.abs(one - two).max() > 0.01
    assert np.abs(one - three).max() > 0.01


@pytest.mark.parametrize("change", CHANGES)
def test_how_a_real_mesh_is_written_down_does_not_change_its_scores(either, shrec, change):
    network = untrained(either)
    for path in sorted(shrec.glob("*/test/*.obj"))[::40]:
        mesh = load_mesh(path)
        other = change(mesh, np.random.default_rng(0))
        assert score(network, other) == close(score(network, mesh)), path


MIXED = {
    "closed": torus(),
    "small": cube(),
    "one face": Mesh(np.eye(3), [[0, 1, 2]]),
    "open": sheet(9, 7),
    "components": together(cube(), sheet(3, 3), torus(9, 6)),
    "one-sided": moebius(),
}


@pytest.mark.parametrize(
    "changes", [{}, {"convolutions": 2}, {"patch_size": 1}, {"patch_size": 40}]
)
def test_a_ragged_batch_scores_each_mesh_as_it_does_alone(either, changes):
    config = replace(either, **changes)
    network = untrained(config)
    batch = [mesh_inputs(mesh, config) for mesh in MIXED.values()]
    scores, evidence = run(network, batch)
    singles = [run(network, [inputs]) for inputs in batch]
    assert scores == close(np.concatenate([s for s, _ in singles]))
    assert evidence == close(np.concatenate([e for _, e in singles]))


@pytest.mark.parametrize("mesh", MIXED.values(), ids=MIXED.keys())
def test_scores_are_the_bias_plus_the_mean_of_the_evidence(either, mesh):
    network = untrained(either)
    inputs = mesh_inputs(mesh, either)
    scores, evidence = run(network, [inputs])
    assert evidence.shape == (topology_of(inputs).face_counts[-1], 3)
    bias = network.classify.bias.detach().numpy()
    assert scores[0] == close(bias + evidence.mean(axis=0))


def test_other_depths_and_widths_work():
    config = NetworkConfig(
        classes=("a", "b"), channels=(4,), targets=(100,), patch_size=3, absolute_offsets=True
    )
    scores, evidence = run(untrained(config), [mesh_inputs(torus(), config)])
    assert scores.shape == (1, 2)
    assert evidence.shape[1] == 2
    assert 97 <= len(evidence) <= 100


def test_features_are_taken_from_a_network_of_other_classes(prepared_torus):
    """All that tells neither one's classes apart, and nothing else."""
    config = NetworkConfig(classes=("a", "b"), channels=(8, 12, 16), dropout=0.3)
    torch.manual_seed(1)
    other = Network(replace(config, classes=("c", "d", "e"))).eval()
    network = Network(config).eval()
    before = {name: tensor.clone() for name, tensor in network.classify.state_dict().items()}
    network.take_features(other)
    inputs = as_tensors(collate([mesh_inputs(prepared_torus, config)]))
    for mine, theirs in zip(network.features(*inputs), other.features(*inputs), strict=True):
        assert torch.equal(mine, theirs)
    assert all(torch.equal(network.classify.state_dict()[name], before[name]) for name in before)


def test_everything_learned_is_taken_from_a_network_of_the_same_classes(prepared_torus):
    config = NetworkConfig(classes=("a", "b"), channels=(8, 12, 16))
    other, network = Network(config).eval(), Network(config).eval()
    network.take_features(other)
    inputs = as_tensors(collate([mesh_inputs(prepared_torus, config)]))
    assert torch.equal(network(*inputs).scores, other(*inputs).scores)


@pytest.fixture
def prepared_torus() -> Mesh:
    return prepare(torus(), 500)[0]
