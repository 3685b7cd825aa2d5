"""The paper's tables: what documents quote is what runs gave, and the data sets that cannot be had
here are read as they are laid out."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.paper import accuracy, tables
from benchmarks.paper.accuracy import PROTOCOLS, Protocol, Training
from benchmarks.suite import ROOT
from meshconv3d.model.config import PRESETS
from meshconv3d.model.mesh import Mesh
from meshconv3d.model.training.variation import with_faces
from tests.meshes import cube, icosphere, torus

DOCUMENT = (ROOT / "docs" / "paper.md").read_text()
SHAPES = {"airplane": torus(), "flower_pot": icosphere(2), "night_stand": cube()}
FACES = (500, 498, 412, 1000)
# A network that is trained in seconds.
SMALL = ("--set", "channels=[8,12,16]", "--batch-size", "4", "--copies", "0")


def test_documents_show_the_tables_of_the_results():
    *others, summary = tables.all_tables()
    for table in others:
        assert table in DOCUMENT
    assert summary in (ROOT / "README.md").read_text()


def test_every_result_is_of_a_protocol_and_says_how_it_was_made():
    protocols = {one.title: one for several in PROTOCOLS.values() for one in several}
    for title, networks in accuracy.read_results().items():
        for network, runs in networks.items():
            for seed, run in runs.items():
                *settings, _, number, _, _ = protocols[title].arguments(network, int(seed))
                assert set(settings) <= set(run["command"].split())
                assert number == seed
                assert run["epochs"] == protocols[title].networks[network].epochs
                # A share of whole meshes.
                right = run["test"] * run["test_meshes"]
                assert right == pytest.approx(round(right), abs=0.05)


@pytest.mark.parametrize(
    ("tests", "expected"),
    [
        ([], "not run"),
        ([1.0], "100.00 (1 seed)"),
        ([1.0, 1.0], "100.00 (2 seeds)"),
        ([1.0, 0.99, 0.995], "99.50 (3 seeds, 99.00 to 100.00)"),
    ],
)
def test_an_accuracy_is_the_mean_over_the_seeds(tests, expected):
    protocol = PROTOCOLS["shrec11"][0]
    runs = {str(seed): {"test": share} for seed, share in enumerate(tests)}
    first = tables.table_1({protocol.title: {"paper": runs}}).splitlines()[2]
    assert first == f"| SHREC11, split 16 | 98.6 | 100 | 100 | 100 | {expected} | not run |"


def test_run_times_are_relative_to_the_preset_paper():
    yardsticks = {"paper": 20.0, "default": 10.0}
    memory = {"paper": 400.0, "default": 300.0}
    table = tables.table_3({"yardsticks": yardsticks, "megabytes": memory}, 15.0)
    assert "| MeshConv3D | 1 | 682 | 1.00 | 400 |" in table
    assert "| our default | - | - | 0.50 | 300 |" in table
    # 582 yardsticks: 38.8 times `default`.
    assert "| MeshCNN | 1.40 | 2596 | 19.40 | - |" in table


def write(path: Path, mesh: Mesh) -> None:
    """As Manifold40 has its OBJ files, and ModelNet40 many of its OFF files."""
    points = ["{:.6f} {:.6f} {:.6f}".format(*point) for point in mesh.vertices.tolist()]
    if path.suffix == ".obj":
        lines = [f"v {point}" for point in points]
        lines += ["f {} {} {}".format(*face) for face in (mesh.faces + 1).tolist()]
    else:
        lines = [f"OFF{len(mesh.vertices)} {len(mesh.faces)} 0", *points]
        lines += ["3 {} {} {}".format(*face) for face in mesh.faces.tolist()]
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("\n".join(lines) + "\n")


@pytest.mark.parametrize(
    ("command", "suffix", "network"),
    [("manifold40", "obj", "default"), ("modelnet40", "off", "paper")],
)
def test_a_folder_laid_out_as_the_data_set_is_trained_on_and_scored(
    command, suffix, network, tmp_path
):
    """CLASS/{train,test}/CLASS_0001.obj or .off, some classes with an underscore in their name."""
    data, result = tmp_path / "data", tmp_path / "result.json"
    rng = np.random.default_rng(0)
    for label, shape in SHAPES.items():
        for number in range(1, 7):
            mesh = with_faces(shape, FACES[number % len(FACES)])
            stretched = mesh.moved(mesh.vertices * rng.uniform(0.7, 1.4, 3))
            split = "train" if number <= 4 else "test"
            write(data / label / split / f"{label}_{number:04d}.{suffix}", stretched)
    (protocol,) = PROTOCOLS[command]
    small = Training(1, (*protocol.networks[network].options, *SMALL))
    short = replace(protocol, networks={network: small})
    accuracy.measure([short], data, tmp_path / "runs", [3], result)
    run = accuracy.read_results(result)[protocol.title][network]["3"]
    assert (run["train_meshes"], run["test_meshes"], run["epochs"]) == (12, 6, 1)
    assert 0 <= run["test"] <= 1


def test_what_a_result_has_is_not_run_again(tmp_path):
    result = tmp_path / "result.json"
    result.write_text(json.dumps({"any": {"paper": {"0": {"test": 1.0}}}}))
    before = result.read_bytes()
    accuracy.measure(
        [Protocol("any", {"paper": Training(1, ())})], tmp_path / "none", tmp_path, [0], result
    )
    assert result.read_bytes() == before


def test_the_first_network_of_a_protocol_is_the_paper_to_the_letter():
    assert set(PRESETS["paper"]) == {
        *("axes", "patch_size", "patch_reduction", "pooling", "literal_pooling")
    }
    for protocols in PROTOCOLS.values():
        for protocol in protocols:
            title, training = next(iter(protocol.networks.items()))
            assert (title, training.options) == ("paper", ("--preset", "paper", "--copies", "0"))
