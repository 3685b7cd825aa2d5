"""`meshconv3d classify --sort-into` and `--report`: what a person does with a batch."""

import shutil
from pathlib import Path

import pytest

from tests.commands import meshconv3d


@pytest.fixture
def folder(tmp_path: Path, meshes: Path) -> Path:
    """Rings, more than are classified without workers, and one file without faces."""
    folder = tmp_path / "folder"
    folder.mkdir()
    for number in range(20):
        shutil.copy(meshes / "ring.obj", folder / f"{number:02}.obj")
    (folder / "none.obj").write_text("v 0 0 0\n")
    return folder


def test_files_are_sorted_and_reported(folder: Path, model_file: Path, tmp_path: Path) -> None:
    into, page, output = tmp_path / "sorted", tmp_path / "report.html", tmp_path / "all.jsonl"
    call = ("classify", folder, "--model", model_file, "--sort-into", into, "--report", page)
    done = meshconv3d(*call, "--output", output)
    assert (done.returncode, done.stdout) == (1, ""), done.stderr
    links = [path for path in into.rglob("*") if path.is_symlink()]
    assert {link.readlink() for link in links} == set(folder.iterdir())
    assert [link.parent.name for link in links if link.readlink().stem == "none"] == ["no-faces"]
    text = page.read_text()
    assert "20.obj" not in text
    assert "19.obj" in text
    assert text.count('"picture": "') == 20  # that of a refused file there is none
    assert "no-faces" in text

    (folder / "21.obj").write_text((folder / "00.obj").read_text() + "# another\n")
    again = meshconv3d(*call, "--output", output, "--resume")
    assert again.returncode == 1, again.stderr
    assert len([path for path in into.rglob("*") if path.is_symlink()]) == 22
    text = page.read_text()
    assert "19.obj" in text  # of the run before
    assert "21.obj" in text
    assert "No picture of 20" in text


def test_a_few_files_have_their_pictures_too(
    meshes: Path, model_file: Path, tmp_path: Path
) -> None:
    page = tmp_path / "report.html"
    done = meshconv3d("classify", meshes / "ring.obj", "--model", model_file, "--report", page)
    assert done.returncode == 0, done.stderr
    assert page.read_text().count('"picture": "') == 1


@pytest.mark.parametrize("path", ["", "**/*.obj", "s*/ring/*", "*/*/*/*.obj"])
def test_a_folder_that_would_be_classified_is_not_sorted_into(
    folder: Path, model_file: Path, path: str
) -> None:
    (folder / "s" / "ring" / "below").mkdir(parents=True)
    for place in (folder / "s" / "ring", folder / "s" / "ring" / "below"):
        shutil.copy(folder / "00.obj", place)
    into = folder / "sorted"
    done = meshconv3d("classify", folder / path, "--model", model_file, "--sort-into", into)
    assert done.returncode == 2
    assert "name a folder beside it" in done.stderr
    assert not into.exists()


def test_a_glob_that_does_not_reach_a_folder_lets_it_be_sorted_into(
    folder: Path, model_file: Path
) -> None:
    into = folder / "sorted"
    for _ in range(2):
        done = meshconv3d(
            *("classify", folder / "0?.*", "--model", model_file, "--sort-into", into)
        )
        assert (done.returncode, done.stdout.count("\n")) == (0, 10), done.stderr


def test_standard_input_has_no_place_to_link_to(model_file: Path, tmp_path: Path) -> None:
    done = meshconv3d("classify", "-", "--model", model_file, "--sort-into", tmp_path / "sorted")
    assert done.returncode == 2
    assert "leave out -" in done.stderr


def test_a_report_that_cannot_be_written_is_told(
    meshes: Path, model_file: Path, tmp_path: Path
) -> None:
    page = tmp_path / "missing" / "report.html"
    done = meshconv3d("classify", meshes / "ring.obj", "--model", model_file, "--report", page)
    assert (done.returncode, done.stdout) == (2, "")  # before any file is classified
    assert f"{page.parent} is no folder" in done.stderr


def test_a_report_takes_the_place_of_nothing_but_a_page(
    meshes: Path, model_file: Path, tmp_path: Path
) -> None:
    mesh = tmp_path / "ring.obj"
    mesh.write_bytes((meshes / "ring.obj").read_bytes())
    done = meshconv3d("classify", mesh, "--model", model_file, "--report", mesh)
    assert done.returncode == 2
    assert "does not end with .html" in done.stderr
    assert mesh.read_bytes() == (meshes / "ring.obj").read_bytes()
