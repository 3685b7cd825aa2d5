"""`meshconv3d batch --sort-into` and `--report`: what a person does with a batch."""

import shutil
from pathlib import Path

import pytest

from tests.commands import meshconv3d
from tests.model.loading.loading_builders import archive


@pytest.fixture
def folder(tmp_path: Path, meshes: Path) -> Path:
    """Twenty rings, and one file without faces."""
    folder = tmp_path / "folder"
    folder.mkdir()
    for number in range(20):
        shutil.copy(meshes / "ring.obj", folder / f"{number:02}.obj")
    (folder / "none.obj").write_text("v 0 0 0\n")
    return folder


def test_files_are_sorted_and_reported(folder: Path, model_file: Path, tmp_path: Path) -> None:
    into, page, output = tmp_path / "sorted", tmp_path / "report.html", tmp_path / "all.jsonl"
    call = ("batch", folder, "--model", model_file, "--sort-into", into, "--report", page)
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


def test_files_that_could_not_be_sorted_are_counted(
    meshes: Path, model_file: Path, tmp_path: Path
) -> None:
    """A file in an archive that cannot be unpacked has nothing to link to or to copy."""
    packed = archive(
        {"a.obj": "v 0", "x.obj": "v 0", "ring.obj": (meshes / "ring.obj").read_bytes()}
    )
    (tmp_path / "a.zip").write_bytes(packed.replace(b"x.obj", b"a.obj"))
    into = tmp_path / "sorted"
    call = ("batch", tmp_path / "a.zip", "--model", model_file, "--sort-into", into)
    done = meshconv3d(*call, "--output", tmp_path / "all.jsonl")
    assert done.returncode == 1
    assert f"could not be read, and so not sorted into {into}: 1 file" in done.stderr
    assert len([path for path in into.rglob("*") if path.is_file()]) == 1


@pytest.mark.parametrize("path", ["", "**/*.obj", "s*/ring/*", "*/*/*/*.obj"])
def test_a_folder_that_would_be_classified_is_not_sorted_into(
    folder: Path, model_file: Path, path: str
) -> None:
    (folder / "s" / "ring" / "below").mkdir(parents=True)
    for place in (folder / "s" / "ring", folder / "s" / "ring" / "below"):
        shutil.copy(folder / "00.obj", place)
    into = folder / "sorted"
    call = ("batch", folder / path, "--model", model_file, "--output", folder / "all.csv")
    done = meshconv3d(*call, "--sort-into", into)
    assert done.returncode == 2
    assert "name a folder beside it" in done.stderr
    assert not into.exists()


def test_a_glob_that_does_not_reach_a_folder_lets_it_be_sorted_into(
    folder: Path, model_file: Path
) -> None:
    into = folder / "sorted"
    for number in range(2):
        output = folder / f"{number}.jsonl"
        call = ("batch", folder / "0?.*", "--model", model_file, "--output", output)
        done = meshconv3d(*call, "--sort-into", into)
        assert done.returncode == 0, done.stderr
        assert output.read_text().count("\n") == 10


def test_a_report_that_cannot_be_written_is_told(
    meshes: Path, model_file: Path, tmp_path: Path
) -> None:
    page = tmp_path / "missing" / "report.html"
    done = meshconv3d(
        *("batch", meshes / "ring.obj", "--model", model_file),
        *("--output", tmp_path / "all.csv", "--report", page),
    )
    assert (done.returncode, done.stdout) == (2, "")  # before any file is classified
    assert f"{page.parent} is no folder" in done.stderr


def test_a_report_takes_the_place_of_nothing_but_a_page(
    meshes: Path, model_file: Path, tmp_path: Path
) -> None:
    mesh = tmp_path / "ring.obj"
    mesh.write_bytes((meshes / "ring.obj").read_bytes())
    done = meshconv3d(
        *("batch", mesh, "--model", model_file, "--output", tmp_path / "all.csv"),
        *("--report", mesh),
    )
    assert done.returncode == 2
    assert "does not end with .html" in done.stderr
    assert mesh.read_bytes() == (meshes / "ring.obj").read_bytes()


def test_a_link_in_place_of_a_report_is_replaced(
    meshes: Path, model_file: Path, tmp_path: Path
) -> None:
    page, theirs = tmp_path / "report.html", tmp_path / "theirs"
    theirs.write_text("theirs")
    page.symlink_to(theirs)
    done = meshconv3d(
        *("batch", meshes / "ring.obj", "--model", model_file),
        *("--output", tmp_path / "all.csv", "--report", page),
    )
    assert done.returncode == 0, done.stderr
    assert not page.is_symlink()
    assert page.read_text().count('"picture": "') == 1
    assert theirs.read_text() == "theirs"
