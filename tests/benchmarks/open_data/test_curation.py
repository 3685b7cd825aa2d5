"""The curation of the open data sets: its tables, on made-up meshes and on the real ones."""

import csv
import subprocess
import sys
import tarfile
from collections import Counter
from dataclasses import asdict, replace
from pathlib import Path

import pytest

from benchmarks.open_data.__main__ import curate, summary
from benchmarks.open_data.attribution import attribution
from benchmarks.open_data.curation import (
    LEAST,
    SETS,
    TABLES,
    CuratedMesh,
    Curation,
    CurationError,
    OpenClass,
    OpenMesh,
    read_table,
)
from benchmarks.open_data.layout import lay_out
from meshconv3d.model.datasets import list_samples
from tests.conftest import SHARED_DATA

needs_data = pytest.mark.skipif(
    not all((SHARED_DATA / f"{folder}.csv").is_file() for folder in SETS.values()),
    reason="needs the tables of the open data sets, which a clone does not have",
)


def mesh(folder: str, file: str, split: str = "train", fine_class: str = "") -> OpenMesh:
    return OpenMesh(
        folder, f"kit__{file}.ply", split, fine_class, "kencar", "", "CC0", "Kenney", "kenney/kit"
    )


TRAINED, HELD_OUT = OpenClass(False, False, False, ""), OpenClass(True, True, True, "")
# Cars, of which one is a cart and one is left out; food, of which only pizza is a class.
MESHES = [
    *(mesh("car", f"car_{i}") for i in range(LEAST)),
    mesh("car", "cart", "test"),
    mesh("car", "heap"),
    mesh("car", "taxi", "test"),
    mesh("car", "toy", "authors"),
    mesh("food", "slice", "val", "pizza"),
    mesh("food", "roast", "train", "meat"),
]
CURATION = Curation(
    folders={("car", ""): "car", ("food", ""): "", ("food", "pizza"): "pizza"},
    moves={("car", "kit__cart.ply"): "cart"},
    drops=frozenset({("car", "kit__heap.ply")}),
    classes={"car": TRAINED, "cart": HELD_OUT, "pizza": HELD_OUT},
)


def test_a_file_counts_before_its_fine_class_and_that_before_its_folder() -> None:
    labels = {c.mesh.file[5:-4]: c.label for c in CURATION.apply(MESHES)}
    assert labels == {
        **{f"car_{i}": "car" for i in range(LEAST)},
        "cart": "cart",
        "taxi": "car",
        "toy": "car",
        "slice": "pizza",
    }


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"folders": {("food", ""): ""}}, "lacks the folder car"),
        ({"folders": {**CURATION.folders, ("bus", ""): "car"}}, "no folder bus"),
        ({"folders": {**CURATION.folders, ("food", "soup"): ""}}, "no folder food/soup"),
        ({"moves": {("car", "kit__bus.ply"): "cart"}}, "no file car/kit__bus.ply to move"),
        ({"moves": {("car", "kit__cart.ply"): "bus"}}, "classes.csv lacks bus"),
        ({"drops": frozenset({("car", "kit__bus.ply")})}, "no file car/kit__bus.ply to drop"),
        ({"drops": frozenset({("car", "kit__cart.ply")})}, "is moved and dropped"),
        ({"drops": frozenset({("car", "kit__car_0.ply")})}, "class car has 4 meshes to train on"),
    ],
)
def test_tables_that_contradict_themselves_or_the_data_are_refused(
    changes: dict[str, object], complaint: str
) -> None:
    meshes = [m for m in MESHES if m.file != "kit__heap.ply"]
    with pytest.raises(CurationError, match=complaint):
        replace(CURATION, **{"drops": frozenset(), **changes}).apply(meshes)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("stray", "complaint"),
    [
        (replace(MESHES[0], licence="CC BY-NC"), "lacks the licence CC BY-NC"),
        (replace(MESHES[0], split="test"), "class car has two kit__car_0.ply"),
    ],
)
def test_licences_that_are_not_listed_and_files_of_one_name_are_refused(
    stray: OpenMesh, complaint: str
) -> None:
    with pytest.raises(CurationError, match=complaint):
        CURATION.apply([*MESHES, stray])


@pytest.fixture
def archive(tmp_path: Path) -> Path:
    """The meshes of MESHES as they are shipped; each holds its own name."""
    for m in MESHES:
        path = tmp_path / "open_cars" / m.folder / m.file
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(m.file)
    archive = tmp_path / "open_cars.tar.xz"
    with tarfile.open(archive, "w:xz") as tar:
        tar.add(tmp_path / "open_cars", "open_cars")
    return archive


def test_the_layout_is_what_train_and_evaluate_read(archive: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    assert lay_out("cars", CURATION.apply(MESHES), archive, out)
    tables = {
        "cars.csv": ("cars", {"train": LEAST, "test": 1}),
        "cars_authors.csv": ("cars", {"test": 1}),
        "cars_held_out.csv": ("cars_held_out", {"test": 2}),
    }
    assert {path.name for path in out.glob("*.csv")} == tables.keys()
    for table, (folder, splits) in tables.items():
        samples = list_samples(out / folder, out / table)
        assert Counter(sample.split for sample in samples) == splits
        assert all(sample.path.read_text() == sample.path.name for sample in samples)


def test_a_second_call_writes_nothing_and_one_with_other_tables_leaves_nothing_old(
    archive: Path, tmp_path: Path
) -> None:
    out = tmp_path / "out"
    assert lay_out("cars", CURATION.apply(MESHES), archive, out)
    assert not lay_out("cars", CURATION.apply(MESHES), archive, out)
    (out / "cars" / "car" / "test" / "kit__taxi.ply").unlink()
    assert lay_out("cars", CURATION.apply(MESHES), archive, out)
    moved = replace(CURATION, moves={}, classes={"car": TRAINED, "pizza": HELD_OUT})
    assert lay_out("cars", moved.apply(MESHES), archive, out)
    assert {path.name for path in (out / "cars_held_out").iterdir()} == {"pizza"}
    assert (out / "cars" / "car" / "test" / "kit__cart.ply").is_file()


def test_what_others_have_put_there_is_left_alone(archive: Path, tmp_path: Path) -> None:
    mine = tmp_path / "out" / "cars" / "mine.txt"
    mine.parent.mkdir(parents=True)
    mine.write_text("precious")
    with pytest.raises(CurationError, match="in the way"):
        lay_out("cars", CURATION.apply(MESHES), archive, tmp_path / "out")
    assert mine.read_text() == "precious"


def test_an_archive_without_a_mesh_is_refused(archive: Path, tmp_path: Path) -> None:
    curated = CURATION.apply([*MESHES, mesh("car", "lost")])
    with pytest.raises(CurationError, match=r"lacks 1 meshes, such as car/kit__lost.ply"):
        lay_out("cars", curated, archive, tmp_path / "out")


def test_every_author_is_named_with_source_licence_and_where_asked_titles() -> None:
    ford = replace(mesh("car", "Ford_Focus_2"), licence="CC-BY-3.0", source="sh3d_bsby", author="R")
    text = attribution(
        [CuratedMesh(m, "car", held_out=False) for m in (ford, mesh("car", "taxi", "test"))]
    )
    assert "- [Car Kit](https://github.com/kenney/kit) by Kenney (0 + 1)\n" in text
    assert "by R (1 + 0): Ford Focus\n" in text
    assert "## CC BY 3.0\n\n[The licence](https://creativecommons.org/licenses/by/3.0/).\n" in text
    assert "MIT No Attribution" not in text


def test_the_command_lays_out_both_sets(archive: Path, tmp_path: Path) -> None:
    """With tables of the real sets and the meshes of this one, it says what is wrong."""
    data = tmp_path / "data"
    data.mkdir()
    with (data / "open_objects.csv").open("w", newline="") as file:
        rows = [{"class": m.folder, **asdict(m)} for m in MESHES]
        table = csv.DictWriter(file, rows[0])
        table.writeheader()
        table.writerows(rows)
    done = subprocess.run(
        [sys.executable, "-m", "benchmarks.open_data", data, tmp_path / "out"],
        capture_output=True,
        text=True,
        cwd=TABLES.parents[1],
    )
    assert done.returncode == 2
    assert "folders.csv lacks the folder food" in done.stderr


@needs_data
@pytest.mark.parametrize("name", SETS)
def test_the_tables_fit_the_real_sets(name: str) -> None:
    curated = curate(name, SHARED_DATA)  # checks files, classes, sizes and licences
    labels = {c.label for c in curated if not c.held_out}
    assert labels.isdisjoint(c.label for c in curated if c.held_out)
    assert {c.label for c in curated} == set(Curation.read(TABLES / name).classes)
    assert all(line.isascii() for line in summary(curated).splitlines())
    places = {(c.label, c.mesh.file): c.mesh.split for c in curated}
    for row in read_table(TABLES / name / "near_duplicates.csv"):
        assert places[row["class"], row["file"]] == row["split"] != "train"
        assert places[row["class"], row["twin"]] == "train"


@needs_data
def test_objects_has_80_to_120_classes_and_no_maker_on_both_sides() -> None:
    curated = [c for c in curate("objects", SHARED_DATA) if not c.held_out]
    assert 80 <= len({c.label for c in curated}) <= 120
    apart = {c.mesh.author for c in curated if c.mesh.split == "authors"}
    assert apart.isdisjoint(c.mesh.author for c in curated if c.mesh.split != "authors")


@needs_data
def test_objects69_maps_to_classes_of_the_model() -> None:
    rows = read_table(TABLES / "objects" / "objects69.csv")
    assert {row["class"] for row in rows} <= Curation.read(TABLES / "objects").classes.keys()
    assert {row["objects69"] for row in rows} <= {
        row["class"] for row in read_table(SHARED_DATA / "objects69_split.csv")
    }


@needs_data
def test_samples_are_in_the_public_domain_and_not_trained_on_but_for_the_nut() -> None:
    known = {
        (name, c.mesh.folder, c.mesh.file): c for name in SETS for c in curate(name, SHARED_DATA)
    }
    for row in read_table(TABLES / "samples.csv"):
        curated = known[row["set"], row["folder"], row["file"]]
        assert curated.mesh.licence == "CC0"
        assert row["class"] == ("" if curated.held_out else curated.label)
        assert curated.held_out or curated.mesh.split == "test" or row["class"] == "nut"


@needs_data
def test_the_attribution_in_the_documentation_is_up_to_date() -> None:
    curated = [c for name in SETS for c in curate(name, SHARED_DATA)]
    path = TABLES.parents[1] / "docs" / "models" / "ATTRIBUTION.md"
    assert path.read_text(encoding="utf-8") == attribution(curated)
