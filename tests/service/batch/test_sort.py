"""Files in folders by class: no two in one place, none outside, and twice is once."""

import os
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshconv3d.service.batch.files import LocalFile, RemoteFile
from meshconv3d.service.batch.running import FileResult
from meshconv3d.service.batch.sort import SortedFolder
from meshconv3d.service.prediction import Failure, Result
from tests.results import prediction

HOSTILE = [
    "..",
    ".",
    "",
    "/",
    "a/b",
    "a\\b",
    "../../etc",
    "%2E",
    ".hidden",
    "end.",
    " ",
    "\0",
    "\n",
]
NAMES = st.one_of(st.sampled_from(HOSTILE), st.text(max_size=300))


class Remote(RemoteFile):
    """A file behind a URL that nobody asks."""

    def read(self) -> bytes:
        return self.path.encode()


def remote(name: str, content: str = "bytes") -> Remote:
    below = name.partition("::")[0]
    return Remote(name, below, None, url="memory://", path=content, length=None)


def known(label: str = "ring", unknown: bool | None = False) -> Result:
    return replace(prediction(classes=(label, "")), unknown=unknown)


def refused(fault: str = "no-faces") -> Result:
    return Failure(fault, "why")


def placed(folder: SortedFolder, file: Path | RemoteFile, result: Result) -> Path:
    found = file if isinstance(file, RemoteFile) else LocalFile.at(str(file))
    place = folder.place(FileResult(found, result, "0" * 64))
    assert place is not None
    return place


def contents(folder: Path) -> dict[str, bytes]:
    """Every file below a folder, by its place."""
    files = (path for path in folder.rglob("*") if not path.is_dir())
    return {str(path.relative_to(folder)): path.read_bytes() for path in files}


@pytest.fixture
def source(tmp_path: Path) -> Path:
    path = tmp_path / "here" / "a.obj"
    path.parent.mkdir()
    path.write_bytes(b"a mesh")
    return path


@pytest.mark.parametrize(
    ("result", "folder"),
    [
        (known(), "ring"),
        (known(unknown=None), "ring"),
        (known(unknown=True), "unknown"),
        (refused(), "refused/no-faces"),
        (known("büchse 2"), "büchse 2"),
        (known("unknown"), "%75nknown"),
        (known("Refused"), "%52efused"),
        (known("air/plane"), "air%2Fplane"),
        (known(".."), "%2E%2E"),
    ],
)
def test_a_file_is_linked_where_its_result_says(
    tmp_path: Path, source: Path, result: Result, folder: str
) -> None:
    place = placed(SortedFolder(tmp_path / "sorted"), source, result)
    assert place.parent == tmp_path / "sorted" / folder
    assert place.name.startswith("a.")
    assert place.suffix == ".obj"
    assert place.readlink() == source
    assert place.read_bytes() == b"a mesh"


def test_a_link_does_not_lead_outside(tmp_path: Path, source: Path) -> None:
    (tmp_path / "sorted").mkdir()
    (tmp_path / "sorted" / "ring").symlink_to(source.parent)
    with pytest.raises(OSError, match="ring is no folder, or a link to one"):
        placed(SortedFolder(tmp_path / "sorted"), source, known())
    assert [path.name for path in source.parent.iterdir()] == ["a.obj"]


def test_files_of_one_name_do_not_meet(tmp_path: Path, source: Path) -> None:
    there = tmp_path / "there" / "a.obj"
    there.parent.mkdir()
    there.write_bytes(b"another")
    folder = SortedFolder(tmp_path / "sorted")
    placed(folder, source, known())
    placed(folder, there, known())
    placed(folder, remote("s3://bucket/a.obj", "a third"), known())
    placed(folder, remote("s3://bucket/below/a.obj", "a fourth"), known())
    found = sorted(contents(tmp_path / "sorted").values())
    assert found == [b"a fourth", b"a mesh", b"a third", b"another"]


def test_what_was_refused_and_then_is_not_is_in_one_place(tmp_path: Path, source: Path) -> None:
    folder = SortedFolder(tmp_path / "sorted")
    placed(folder, source, refused("deadline"))
    other = placed(folder, source.with_name("b.obj"), refused("deadline"))
    for result in (refused(), known()):
        place = placed(folder, source, result)
        links = {path for path in (tmp_path / "sorted").rglob("*") if path.is_symlink()}
        assert links == {place, other}


@pytest.mark.parametrize("linked", ["refused", "refused/deadline"])
def test_nothing_outside_is_removed(tmp_path: Path, source: Path, linked: str) -> None:
    """Where the folder of refusals, or one in it, is a link to a folder with a file of its name."""
    folder = SortedFolder(tmp_path / "sorted")
    name = placed(folder, source, known()).name
    outside = tmp_path / "outside"
    theirs = (outside / "deadline" if linked == "refused" else outside) / name
    theirs.parent.mkdir(parents=True)
    theirs.write_text("theirs")
    (tmp_path / "sorted" / linked).parent.mkdir(exist_ok=True)
    (tmp_path / "sorted" / linked).symlink_to(outside)
    placed(folder, source, known())
    with pytest.raises(OSError, match="is no folder, or a link to one"):
        placed(folder, source, refused("deadline"))
    assert theirs.read_text() == "theirs"
    assert contents(outside) == {str(theirs.relative_to(outside)): b"theirs"}


def test_a_file_of_an_archive_keeps_its_own_name(tmp_path: Path) -> None:
    place = placed(
        SortedFolder(tmp_path), remote("zip://below/a.obj::/data/parts.zip", "a mesh"), known()
    )
    assert (place.name[:2], place.suffix) == ("a.", ".obj")
    assert place.read_bytes() == b"a mesh"


def test_what_could_not_be_read_from_afar_has_no_place(tmp_path: Path) -> None:
    one = FileResult(remote("s3://bucket/a.obj"), refused("unreadable"), None)
    assert SortedFolder(tmp_path / "sorted").place(one) is None
    assert not (tmp_path / "sorted").exists()


@pytest.mark.parametrize("planted", ["", ".part"])
def test_a_planted_link_is_replaced(tmp_path: Path, planted: str) -> None:
    theirs = tmp_path / "theirs"
    theirs.write_text("theirs")
    folder = SortedFolder(tmp_path / "sorted")
    place = placed(folder, remote("s3://bucket/a.obj"), known())
    place.unlink()
    place.with_name(f".{place.name}.part" if planted else place.name).symlink_to(theirs)
    placed(folder, remote("s3://bucket/a.obj"), known())
    assert contents(tmp_path / "sorted") == {f"ring/{place.name}": b"bytes"}
    assert not place.is_symlink()
    assert theirs.read_text() == "theirs"


def test_twice_is_once(tmp_path: Path, source: Path) -> None:
    once = []
    for _ in range(2):
        folder = SortedFolder(tmp_path / "sorted")
        placed(folder, source, known())
        placed(folder, remote("memory://a.obj"), known())
        once.append(contents(tmp_path / "sorted"))
    assert once[0] == once[1]
    assert len(once[0]) == 2


def test_a_relative_name_leads_there_from_anywhere(
    tmp_path: Path, source: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(source.parent)
    place = placed(SortedFolder(Path("../sorted")), Path("a.obj"), known())
    absolute = source.parent / place
    monkeypatch.chdir("/")
    assert absolute.read_bytes() == b"a mesh"


def test_what_a_killed_run_left_is_replaced(tmp_path: Path, source: Path) -> None:
    folder = SortedFolder(tmp_path / "sorted")
    place = placed(folder, source, known())
    place.unlink()
    place.with_name(f".{place.name}.part").write_bytes(b"half a m")
    place.write_bytes(b"something else")
    placed(folder, source, known())
    assert list(contents(tmp_path / "sorted").values()) == [b"a mesh"]


def test_without_links_files_are_copied(
    tmp_path: Path, source: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise PermissionError("no links here")

    monkeypatch.setattr(os, "symlink", refuse)
    for _ in range(2):
        place = placed(SortedFolder(tmp_path / "sorted"), source, known())
        assert not place.is_symlink()
        assert place.read_bytes() == b"a mesh"


@given(label=NAMES, file=NAMES, fault=st.booleans())
def test_no_name_leads_outside(
    tmp_path_factory: pytest.TempPathFactory, label: str, file: str, fault: bool
) -> None:
    outer = tmp_path_factory.mktemp("outer")
    result = refused(label) if fault else known(label)
    place = placed(SortedFolder(outer / "sorted"), remote(file), result)
    assert list(outer.iterdir()) == [outer / "sorted"]
    assert place.resolve() == place
    depth = 3 if fault else 2
    assert len(place.relative_to(outer / "sorted").parts) == depth
    assert contents(outer / "sorted") == {str(place.relative_to(outer / "sorted")): b"bytes"}


@given(first=NAMES, second=NAMES)
def test_different_classes_have_different_folders(
    tmp_path_factory: pytest.TempPathFactory, first: str, second: str
) -> None:
    folder = SortedFolder(tmp_path_factory.mktemp("sorted"))
    labels = {first, second}
    places = {placed(folder, remote("a"), known(label)).parent for label in labels}
    assert len(places) == len(labels)
