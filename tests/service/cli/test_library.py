"""`meshconv3d embed`, `similar`, `duplicates`, and the routes that search."""

import base64
import json
from pathlib import Path

import httpx
import numpy as np
import pytest
from pyarrow import parquet

from meshconv3d.model.mesh import Mesh
from meshconv3d.service.library import Library
from meshconv3d.service.models import open_model
from tests.commands import meshconv3d
from tests.meshes import cube, icosphere, sheet, together, write_off
from tests.service.conftest import Start

# Boxes of different sizes along a winding line: no plane of symmetry.
PLACES = ((0, 0, 0, 1.0), (2, 0, 0, 0.7), (2, 1.5, 0, 0.5), (2, 1.5, 1.2, 0.3))
STEPS = together(*(Mesh(cube().vertices * size + place, cube().faces) for *place, size in PLACES))


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Boxes in steps, also renumbered, larger, and mirrored; other shapes, and no mesh."""
    folder = tmp_path_factory.mktemp("shapes")
    order = np.random.default_rng(0).permutation(len(STEPS.faces))
    write_off(folder / "steps.off", STEPS)
    write_off(folder / "steps_renumbered.off", Mesh(STEPS.vertices, STEPS.faces[order]))
    (folder / "steps_copy.off").write_bytes((folder / "steps.off").read_bytes())
    write_off(folder / "steps_large.off", Mesh(STEPS.vertices * 2, STEPS.faces))
    write_off(
        folder / "steps_mirrored.off", Mesh(STEPS.vertices * (1, 1, -1), STEPS.faces[:, ::-1])
    )
    for name, mesh in (("ball", icosphere(2)), ("cube", cube()), ("sheet", sheet())):
        write_off(folder / f"{name}.off", mesh)
    (folder / "broken.stl").write_bytes(b"nothing")
    return folder


@pytest.fixture(scope="module")
def library(folder: Path, model_file: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    file = tmp_path_factory.mktemp("library") / "library.parquet"
    done = meshconv3d("embed", folder, "-o", file, "--model", model_file)
    assert done.returncode == 1, done.stderr  # one file is no mesh
    return file


def names(lines: str) -> list[str]:
    return [Path(json.loads(line)["file"]).stem for line in lines.splitlines()]


def test_a_library_is_a_table_that_others_read(library: Path) -> None:
    rows = parquet.read_table(library).to_pylist()
    embedded = [row for row in rows if row["embedding"]]
    assert len(rows) == 9
    assert len(embedded) == 8
    lengths = [np.linalg.norm(row["embedding"]) for row in embedded]
    assert lengths == pytest.approx([1] * 8, abs=1e-3)
    assert {row["space"] for row in embedded} != {None}
    assert all(row["picture"].startswith(b"\x89PNG") for row in embedded)


def test_a_library_grows_by_what_has_come(
    folder: Path, library: Path, model_file: Path, tmp_path: Path
) -> None:
    """What is there stays as it is, and is not classified again."""
    (tmp_path / "more").mkdir()
    write_off(tmp_path / "more" / "two.off", together(cube(), icosphere(1)))
    grown = tmp_path / "library.parquet"
    grown.write_bytes(library.read_bytes())
    call = ("embed", folder, tmp_path / "more", "-o", grown, "--model", model_file)
    assert "--resume" in meshconv3d(*call).stderr
    done = meshconv3d(*call, "--resume")
    assert "10 files: 9 classified, 1 refused (truncated 1), 9 of them earlier" in done.stderr
    before, after = parquet.read_table(library), parquet.read_table(grown)
    assert after.slice(0, 9).equals(before)
    assert after["file"].to_pylist()[9:] == [str(tmp_path / "more" / "two.off")]


def test_a_library_of_other_settings_is_not_touched(
    folder: Path, library: Path, tmp_path: Path
) -> None:
    other = tmp_path / "library.parquet"
    other.write_bytes(library.read_bytes())
    done = meshconv3d("embed", folder, "-o", other, "--model", "shrec11", "--resume")
    assert done.returncode == 2
    assert "was written by another model" in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["library.parquet"]
    assert other.read_bytes() == library.read_bytes()


def test_a_file_that_has_changed_is_found_as_it_is_now(model_file: Path, tmp_path: Path) -> None:
    """Its newest row counts, also where it was no mesh before."""
    folder, file = tmp_path / "found", tmp_path / "library.parquet"
    folder.mkdir()
    write_off(folder / "a.off", STEPS)
    (folder / "b.off").write_text("nothing")
    meshconv3d("embed", folder, "-o", file, "--model", model_file)
    write_off(folder / "a.off", icosphere(2))
    write_off(folder / "b.off", STEPS)
    assert meshconv3d("embed", folder, "-o", file, "--model", model_file, "--resume").stderr
    done = meshconv3d("similar", folder / "b.off", "--in", file, "--model", model_file)
    assert names(done.stdout) == ["b", "a"]


def test_a_library_without_its_pictures_is_still_one(
    library: Path, model_file: Path, tmp_path: Path
) -> None:
    bare, page = tmp_path / "bare.parquet", tmp_path / "groups.html"
    parquet.write_table(parquet.read_table(library).drop(["picture"]), bare)
    done = meshconv3d("duplicates", bare, "--report", page, "--model", model_file)
    assert done.returncode == 0, done.stderr
    assert page.exists()


def test_a_library_that_is_damaged_inside_is_told_as_that(library: Path, tmp_path: Path) -> None:
    damaged = tmp_path / "damaged.parquet"
    content = library.read_bytes()
    damaged.write_bytes(
        content[:500] + bytes(len(content) // 2) + content[500:][len(content) // 2 :]
    )
    for call in (("duplicates", damaged), ("embed", library, "-o", damaged, "--resume")):
        done = meshconv3d(*call, "--model", "shrec11")
        assert done.returncode == 2
        assert f"{damaged}" in done.stderr
        assert "damaged" in done.stderr


def test_copies_of_a_file_are_grouped_whatever_is_asked_for(
    library: Path, model_file: Path
) -> None:
    done = meshconv3d("duplicates", library, "--model", model_file, "--least", 0.999999)
    groups = [{Path(one["file"]).stem for one in json.loads(x)} for x in done.stdout.splitlines()]
    # Others may be the same mesh once they are prepared.
    assert any({"steps", "steps_copy"} <= group for group in groups)


def test_a_library_is_searched_with_the_model_that_it_was_made_with(
    folder: Path, library: Path, tmp_path: Path
) -> None:
    done = meshconv3d("similar", folder / "steps.off", "--in", library)
    assert done.returncode == 2
    assert "made with the model tiny" in done.stderr
    own = tmp_path / "own.parquet"
    meshconv3d("embed", folder / "steps.off", folder / "ball.off", "-o", own, "--model", "parts")
    done = meshconv3d("similar", folder / "steps.off", "--in", own)
    assert names(done.stdout) == ["steps", "ball"]


def test_the_same_shape_is_nearest(folder: Path, library: Path, model_file: Path) -> None:
    done = meshconv3d(
        "similar", folder / "steps.off", "--in", library, "--top", 5, "--model", model_file
    )
    near = {"steps", "steps_copy", "steps_renumbered", "steps_large"}
    assert set(names(done.stdout)[:4]) == near
    first = json.loads(done.stdout.splitlines()[0])
    assert first["distance"] == pytest.approx(0, abs=1e-3)
    assert first["same_shape"] > 0.7


def test_duplicates_are_grouped_and_told_apart(
    library: Path, model_file: Path, tmp_path: Path
) -> None:
    page = tmp_path / "page.html"
    done = meshconv3d(
        "duplicates", library, "--model", model_file, "--least", 0.6, "--report", page
    )
    groups = [
        {Path(one["file"]).stem: one["differs"] for one in json.loads(line)}
        for line in done.stdout.splitlines()
    ]
    group = next(group for group in groups if "steps" in group)
    assert group["steps"] == "first"
    assert group["steps_renumbered"] == "same shape"
    assert group["steps_copy"] == "same file"
    assert group["steps_large"] == "2 times as large"
    assert not {"ball", "cube", "sheet"} & set(group)
    assert "data:image/png" in page.read_text()


def test_a_library_without_duplicates_has_a_page_that_says_so(
    folder: Path, model_file: Path, tmp_path: Path
) -> None:
    file, page = tmp_path / "library.parquet", tmp_path / "page.html"
    meshconv3d("embed", folder / "steps.off", "-o", file, "--model", model_file)
    done = meshconv3d("duplicates", file, "--model", model_file, "--report", page)
    assert (done.returncode, done.stdout) == (0, "")
    assert "0 groups of one shape" in page.read_text()


def test_a_mirror_image_is_told_apart(library: Path, model_file: Path) -> None:
    found = Library.read(library, [open_model(str(model_file)).card])
    rows = {Path(found.value("file", row)).stem: row for row in range(len(found))}
    assert found.relation(rows["steps"], rows["steps_mirrored"]) == "mirrored"
    assert found.relation(rows["steps"], rows["steps_renumbered"]) == "same shape"
    assert found.relation(rows["steps"], rows["steps"]) == "same file"


def test_a_library_of_another_model_is_refused(
    library: Path, folder: Path, model_file: Path, tmp_path: Path
) -> None:
    for arguments in (
        ("similar", folder / "steps.off", "--in", library, "--model", "shrec11"),
        ("duplicates", library, "--model", "shrec11"),
    ):
        done = meshconv3d(*arguments)
        assert done.returncode == 2
        assert "another model" in done.stderr
    other = tmp_path / "other.parquet"
    other.write_bytes(b"PAR1 no table")
    done = meshconv3d("duplicates", other, "--model", model_file)
    assert done.returncode == 2
    assert "is no library" in done.stderr


def test_the_service_searches_its_library(start: Start, library: Path, folder: Path) -> None:
    url = start("--library", str(library)).url
    assert httpx.get(f"{url}/v1/library").json() == {"library": {"meshes": 8, "model": "tiny"}}
    with (folder / "steps_renumbered.off").open("rb") as file:
        found = httpx.post(f"{url}/v1/similar?top=4", files={"file": file}).json()
    assert found["library"] == 8
    assert found["query"]["file"] == "steps_renumbered.off"
    assert {Path(one["file"]).stem for one in found["similar"]} == {
        "steps",
        "steps_copy",
        "steps_renumbered",
        "steps_large",
    }
    assert base64.b64decode(found["similar"][0]["picture"]).startswith(b"\x89PNG")
    with (folder / "steps_large.off").open("rb") as file:
        answer = httpx.post(f"{url}/v1/embed", files={"file": file}).json()
    rows = {Path(row["file"]).stem: row for row in parquet.read_table(library).to_pylist()}
    assert answer["embedding"] == pytest.approx(rows["steps_large"]["embedding"], abs=1e-5)
    assert answer["radius"] == pytest.approx(2 * rows["steps"]["radius"])


def test_a_service_without_a_library_says_how_to_start_one(client: httpx.Client) -> None:
    assert client.get("/v1/library").json() == {"library": None}
    answer = client.post("/v1/similar", files={"file": ("a.off", b"OFF")})
    assert answer.status_code == 404
    assert "--library" in answer.json()["detail"]
