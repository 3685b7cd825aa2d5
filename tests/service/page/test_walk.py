"""The walk of a person who has never heard of mesh convolution, from the first command on: what a
file is and why, classes of their own, and meshes alike."""

from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Browser, expect

from meshconv3d.model.mesh import Mesh
from meshconv3d.model.samples import sample_paths
from tests.commands import meshconv3d
from tests.meshes import cube, icosphere, torus, write_off
from tests.service.conftest import services
from tests.service.page.conftest import DESKTOP, visits


def stretched(name: str, folder: Path, count: int) -> list[Path]:
    """Files of one solid, each of other proportions."""
    mesh = {"brick": cube(), "pebble": icosphere(2), "gasket": torus()}[name]
    rng = np.random.default_rng(len(name))
    folder.mkdir(parents=True)
    files = [folder / f"{name}{number}.off" for number in range(count)]
    for file in files:
        write_off(file, Mesh(mesh.vertices * rng.uniform(0.8, 1.2, 3), mesh.faces))
    return files


def test_from_a_file_to_own_classes_and_meshes_alike(
    browser: Browser, model_file: Path, tmp_path: Path, tmp_path_factory: pytest.TempPathFactory
) -> None:
    car = sample_paths()["car"]
    done = meshconv3d("classify", car, "--top", 1)
    assert '"class":"car"' in done.stdout

    found = [
        stretched(name, tmp_path / "found" / name, 4) for name in ("brick", "gasket", "pebble")
    ]
    for name in ("brick", "gasket", "pebble"):
        stretched(name, tmp_path / "examples" / name, 5)
    mine, library = tmp_path / "mine.onnx", tmp_path / "library.parquet"
    done = meshconv3d("teach", tmp_path / "examples", "-o", mine)
    assert "of 15 examples, each left out in turn" in done.stdout, done.stderr
    done = meshconv3d("embed", tmp_path / "found", car, "-o", library)
    assert "13 files: 13 classified" in done.stderr

    options = ("--model", "objects", "--model", str(mine), "--library", str(library))
    with services(model_file, tmp_path_factory) as start:
        site = start(*options, "--workers", "1", alone=True)
        with visits(browser, site) as visit:
            visitor = visit(**DESKTOP)
            # A file: what it is, how sure that is, and why.
            visitor.give(car)
            expect(visitor.at(".verdict")).to_contain_text("car")
            expect(visitor.at("#result")).to_contain_text("of 100 answers like this are right")
            expect(visitor.at("#view")).to_have_attribute("data-shows", "car")
            # The same person's own classes.
            visitor.ask("mine")
            visitor.give(found[1][0])
            expect(visitor.at(".verdict")).to_contain_text("gasket")
            # The file itself, and the three others of its kind, before all else.
            visitor.at("#result").get_by_role("button", name="Search the library").click()
            hits = visitor.at(".alike li")
            expect(hits).to_have_count(10)
            for place in range(4):
                expect(hits.nth(place)).to_contain_text("gasket")
                expect(hits.nth(place).locator("img")).to_be_visible()
