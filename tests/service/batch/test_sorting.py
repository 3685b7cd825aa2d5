"""Files in folders by class: no two in one place, none outside, and twice is once."""

import os
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from meshconv3d.service.batch.sorting import SortedFolder
from meshconv3d.service.records import Answer, Refusal
from tests.service.batch.records import answer, refusal

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
    ("record", "folder"),
    [
        (answer("a.obj", "ring"), "ring"),
        (answer("a.obj", "ring", unknown=None), "ring"),
        (answer("a.obj", "ring", unknown=True), "unknown"),
        (refusal("a.obj", "no-faces"), "refused/no-faces"),
        (answer("a.obj", "büchse 2"), "büchse 2"),
        (answer("a.obj", "unknown"), "%75nknown"),
        (answer("a.obj", "Refused"), "%52efused"),
        (answer("a.obj", "air/plane"), "air%2Fplane"),
        (answer("a.obj", ".."), "%2E%2E"),
    ],
)
def test_a_file_is_linked_where_its_record_says(
    tmp_path: Path, source: Path, record: Answer | Refusal, folder: str
) -> None:
    place = SortedFolder(tmp_path / "sorted").place(record, source)
    assert place.parent == tmp_path / "sorted" / folder
    assert place.name.startswith("a.")
    assert place.suffix == ".obj"
    assert place.readlink() == source
    assert place.read_bytes() == b"a mesh"


def test_a_link_does_not_lead_outside(tmp_path: Path, source: Path) -> None:
    (tmp_path / "sorted").mkdir()
    (tmp_path / "sorted" / "ring").symlink_to(source.parent)
    with pytest.raises(OSError, match="leads out of the folder"):
        SortedFolder(tmp_path / "sorted").place(answer("a.obj", "ring"), source)
    assert [path.name for path in source.parent.iterdir()] == ["a.obj"]


def test_files_of_one_name_do_not_meet(tmp_path: Path, source: Path) -> None:
    there = tmp_path / "there" / "a.obj"
    there.parent.mkdir()
    there.write_bytes(b"another")
    folder = SortedFolder(tmp_path / "sorted")
    folder.place(answer("here/a.obj"), source)
    folder.place(answer("there/a.obj"), there)
    folder.place(answer("s3://bucket/a.obj"), b"a third")
    folder.place(answer("s3://bucket/below/a.obj"), b"a fourth")
    found = sorted(contents(tmp_path / "sorted").values())
    assert found == [b"a fourth", b"a mesh", b"a third", b"another"]


def test_what_was_refused_and_then_is_not_is_in_one_place(tmp_path: Path, source: Path) -> None:
    folder = SortedFolder(tmp_path / "sorted")
    folder.place(refusal("a.obj", "deadline"), source)
    other = folder.place(refusal("b.obj", "deadline"), source.with_name("b.obj"))
    for record in (refusal("a.obj", "no-faces"), answer("a.obj", "ring")):
        place = folder.place(record, source)
        links = {path for path in (tmp_path / "sorted").rglob("*") if path.is_symlink()}
        assert links == {place, other}


def test_twice_is_once(tmp_path: Path, source: Path) -> None:
    once = []
    for _ in range(2):
        folder = SortedFolder(tmp_path / "sorted")
        folder.place(answer("a.obj"), source)
        folder.place(answer("memory://a.obj"), b"bytes")
        once.append(contents(tmp_path / "sorted"))
    assert once[0] == once[1]
    assert len(once[0]) == 2


def test_a_relative_name_leads_there_from_anywhere(
    tmp_path: Path, source: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(source.parent)
    place = SortedFolder(Path("../sorted")).place(answer("a.obj"), Path("a.obj"))
    absolute = source.parent / place
    monkeypatch.chdir("/")
    assert absolute.read_bytes() == b"a mesh"


def test_what_a_killed_run_left_is_replaced(tmp_path: Path, source: Path) -> None:
    folder = SortedFolder(tmp_path / "sorted")
    place = folder.place(answer("a.obj"), source)
    place.unlink()
    place.with_name(f".{place.name}.part").write_bytes(b"half a m")
    place.write_bytes(b"something else")
    folder.place(answer("a.obj"), source)
    assert list(contents(tmp_path / "sorted").values()) == [b"a mesh"]


def test_without_links_files_are_copied(
    tmp_path: Path, source: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise PermissionError("no links here")

    monkeypatch.setattr(os, "symlink", refuse)
    for _ in range(2):
        place = SortedFolder(tmp_path / "sorted").place(answer("a.obj"), source)
        assert not place.is_symlink()
        assert place.read_bytes() == b"a mesh"


@given(label=NAMES, file=NAMES, fault=st.booleans())
def test_no_name_leads_outside(
    tmp_path_factory: pytest.TempPathFactory, label: str, file: str, fault: bool
) -> None:
    outer = tmp_path_factory.mktemp("outer")
    record = refusal(file, label) if fault else answer(file, label)
    place = SortedFolder(outer / "sorted").place(record, b"bytes")
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
    assert len({folder.place(answer("a", label), b"").parent for label in labels}) == len(labels)
