"""The data set on disk: its split, the same bytes for the same seed, going on, refusals."""

from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result

from benchmarks.cubes.__main__ import cubes as command
from benchmarks.cubes.engraving import MOST_CORNERS, engraved_cube
from benchmarks.cubes.generation import (
    HELD_OUT_FILE,
    RECORD_FILE,
    claim,
    generate,
    plan,
    run,
    write_held_out,
)
from benchmarks.cubes.recipe import RECIPE, CubesError, Recipe
from benchmarks.cubes.silhouettes import outline
from meshconv3d.model.datasets import find_samples
from meshconv3d.model.loading import load_mesh
from meshconv3d.model.mesh import Mesh
from meshconv3d.model.topology.halfedges import find_twins


def make(silhouettes: Path, out: Path, recipe: Recipe, seed: int = 0, workers: int = 1) -> int:
    """All of it; returns how many cubes were written."""
    claim(out, recipe, seed)
    return sum(generate(plan(silhouettes, out, recipe, seed), workers))


def contents(out: Path) -> dict[str, bytes]:
    return {str(p.relative_to(out)): p.read_bytes() for p in out.rglob("*") if p.is_file()}


def is_sound(mesh: Mesh) -> bool:
    """Closed, with 500 faces, and every edge run once in either direction."""
    twin, border, nonmanifold = find_twins(mesh.faces, len(mesh.vertices))
    ends = np.roll(mesh.faces, -1, axis=1).reshape(-1)
    alike = np.array_equal(mesh.faces.reshape(-1)[twin], ends)
    return len(mesh.faces) == 500 and alike and border == nonmanifold == 0


def test_the_original_has_22_classes_and_about_as_many_cubes():
    assert len(RECIPE.classes) == len(set(RECIPE.classes)) == 22
    assert len(RECIPE.classes) * RECIPE.train * RECIPE.copies == 3740
    assert len(RECIPE.classes) * RECIPE.test * RECIPE.copies == 660


def test_cubes_lie_as_training_wants_them_and_are_sound(silhouettes, recipe, tmp_path):
    assert make(silhouettes, tmp_path / "out", recipe) == 16
    samples = find_samples(tmp_path / "out")
    for label in ("Moon", "star"):
        for split, count in (("train", 6), ("test", 2)):
            chosen = [s for s in samples if (s.label, s.split) == (label, split)]
            assert len(chosen) == count
    assert all(is_sound(load_mesh(sample.path)) for sample in samples)


def test_a_file_holds_the_cube_of_its_silhouette_and_copy(silhouettes, recipe, tmp_path):
    make(silhouettes, tmp_path / "out", recipe, seed=9)
    file = next((tmp_path / "out" / "star").rglob("star-03-01.ply"))
    shape = outline(silhouettes / "star-3.gif", MOST_CORNERS)
    cube = engraved_cube(shape, np.random.default_rng([9, 1, 3, 1]))
    stored = load_mesh(file)
    assert np.array_equal(stored.faces, cube.faces)
    assert np.array_equal(stored.vertices, cube.vertices.astype(np.float32))


def test_no_silhouette_is_on_both_sides(silhouettes, recipe, tmp_path):
    make(silhouettes, tmp_path / "out", recipe)
    sides = {"train": set(), "test": set()}
    for sample in find_samples(tmp_path / "out"):
        name, _, copy = sample.path.stem.rpartition("-")
        sides[sample.split].add(name)
        assert copy in ("00", "01")
    assert (len(sides["train"]), len(sides["test"])) == (6, 2)
    assert sides["train"].isdisjoint(sides["test"])


def test_validation_holds_whole_silhouettes_out(silhouettes, recipe, tmp_path):
    make(silhouettes, tmp_path / "out", recipe)
    tasks = plan(silhouettes, tmp_path / "out", recipe, 0)
    write_held_out(tasks, tmp_path / "out")
    samples = find_samples(tmp_path / "out", tmp_path / "out" / HELD_OUT_FILE)
    counts = Counter((sample.label, sample.split) for sample in samples)
    each = {"train": 2, "val": 4, "test": 2}
    assert counts == {(label, split): n for label in recipe.classes for split, n in each.items()}
    assert len({(s.path.stem[:-3], s.split) for s in samples}) == 8
    plain = {sample.path: sample.split for sample in find_samples(tmp_path / "out")}
    assert all(plain[s.path] == s.split for s in samples if s.split != "val")
    assert all(plain[s.path] == "train" for s in samples if s.split == "val")


def test_the_seed_draws_the_split(silhouettes, recipe, tmp_path):
    drawn = {
        tuple(t.silhouette.name for t in plan(silhouettes, tmp_path, recipe, seed) if is_test(t))
        for seed in range(20)
    }
    assert len(drawn) > 5


def is_test(task) -> bool:
    return task.folder.name == "test"


def test_the_same_seed_gives_the_same_bytes_with_any_number_of_workers(
    silhouettes, recipe, tmp_path
):
    for folder, seed, workers in (("one", 3, 1), ("two", 3, 2), ("other", 4, 1)):
        make(silhouettes, tmp_path / folder, recipe, seed, workers)
    one, two, other = (contents(tmp_path / folder) for folder in ("one", "two", "other"))
    assert one == two
    assert len(set(one.values())) == 17
    assert set(one.values()).isdisjoint(other.values())


def test_an_interrupted_run_goes_on(silhouettes, recipe, tmp_path):
    out = tmp_path / "out"
    make(silhouettes, out, recipe)
    whole = contents(out)
    lost = sorted(out.rglob("*.ply"))[3:9]
    for path in lost:
        path.unlink()
    (out / "Moon" / "train" / "Moon-01-00.ply.partial").write_bytes(b"cut off")
    kept = {path: path.stat().st_mtime_ns for path in out.rglob("*.ply")}
    assert make(silhouettes, out, recipe) == len(lost)
    assert {name: data for name, data in contents(out).items() if "partial" not in name} == whole
    assert all(path.stat().st_mtime_ns == time for path, time in kept.items())
    assert make(silhouettes, out, recipe) == 0


def test_a_folder_takes_cubes_of_one_seed_only(silhouettes, recipe, tmp_path):
    make(silhouettes, tmp_path / "out", recipe, seed=0)
    with pytest.raises(CubesError, match=rf"another seed or recipe \(see .*{RECORD_FILE}\)"):
        claim(tmp_path / "out", recipe, 1)
    with pytest.raises(CubesError, match="something else"):
        claim(silhouettes, recipe, 0)


def test_a_bad_image_is_named_and_the_rest_stays(silhouettes, recipe, tmp_path):
    (silhouettes / "star-2.gif").write_bytes(b"GIF89a")
    with pytest.raises(CubesError, match=r"star-2\.gif cannot be read"):
        make(silhouettes, tmp_path / "out", recipe, workers=2)
    assert all(is_sound(load_mesh(path)) for path in (tmp_path / "out").rglob("*.ply"))


def test_a_cube_that_fails_names_its_silhouette(silhouettes, recipe, tmp_path, monkeypatch):
    def fail(shape, rng):
        raise CubesError("the engraved cube has 502 faces, not 500")

    monkeypatch.setattr("benchmarks.cubes.generation.engraved_cube", fail)
    with pytest.raises(CubesError, match=r"Moon-0\d\.gif, copy 0: the engraved cube has 502"):
        make(silhouettes, tmp_path / "out", recipe)
    assert not list(tmp_path.rglob("*.ply*"))


@pytest.fixture
def small(monkeypatch, recipe) -> None:
    monkeypatch.setattr("benchmarks.cubes.recipe.RECIPE", recipe)


def cubes(*arguments: object) -> Result:
    return CliRunner().invoke(command, [*map(str, arguments)])


@pytest.mark.usefixtures("small")
def test_the_command_says_what_it_made(silhouettes, tmp_path):
    out = tmp_path / "out"
    first = cubes(silhouettes, out, "--workers", 1)
    assert (first.exit_code, first.stderr) == (0, "")
    says = "{} cubes; 12 to train on and 4 to test on are in " + str(out) + "\n"
    assert first.stdout == "wrote " + says.format(16)
    assert len(find_samples(out, out / HELD_OUT_FILE)) == 16
    next(out.rglob("*.ply")).unlink()
    assert cubes(silhouettes, out, "--workers", 1).stdout == "wrote " + says.format(1)


@pytest.mark.usefixtures("small")
def test_the_command_says_what_is_missing(silhouettes, tmp_path):
    (silhouettes / "star-3.gif").unlink()
    result = cubes(silhouettes, tmp_path / "out")
    assert result.exit_code == 2
    assert "star (3)" in result.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.usefixtures("small")
def test_the_command_fails_on_a_bad_image(silhouettes, tmp_path):
    (silhouettes / "star-3.gif").write_bytes(b"GIF89a")
    result = cubes(silhouettes, tmp_path / "out", "--workers", 1)
    assert result.exit_code == 1
    assert "star-3.gif cannot be read as an image" in result.stderr


def test_the_real_silhouettes_are_engraved(mpeg7, tmp_path):
    tasks = plan(mpeg7, tmp_path, RECIPE, 0)
    assert len(tasks) == 22 * 20
    for task in tasks:
        assert 3 <= len(outline(task.silhouette.path, MOST_CORNERS)) <= MOST_CORNERS
    for task in tasks[::20]:
        assert run(task) == 10
    files = list(tmp_path.rglob("*.ply"))
    assert len(files) == 220
    assert all(is_sound(load_mesh(path)) for path in files)
