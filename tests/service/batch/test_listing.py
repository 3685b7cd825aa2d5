"""Which files are found, in which order, of this machine and others."""

import os
import subprocess
import zipfile
from collections import Counter
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread

import fsspec
import pytest

from meshconv3d.service.batch.files import LocalFile
from meshconv3d.service.batch.listing import Choice, Listing, NotListed, Shard, told

NAMES = ["a.obj", "a/b.STL", "a/b/c.ply", "a/d.obj", "a-b.obj", "b/e.off", "z.glb", "\u00e4.obj"]

OTHERS = [
    *("notes.txt", "a/no.json", "a/material.mtl", "picture.png"),  # beside meshes
    *("a.blend", "a/b.BLEND", "b/c.iges", "b/d.blend", "STEP/e.igs"),  # of other formats
    *("._a.obj", "a/._b.STL", "__MACOSX/._a.obj", "__MACOSX/a.obj", ".git/b.obj", ".c.blend"),
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Files of the names above, each holding its name, and others beside them."""
    folder = tmp_path_factory.mktemp("listing")
    for name in [*NAMES, *OTHERS]:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(name)
    (folder / "empty").mkdir()
    return folder


@pytest.fixture(params=["local", "zip", "memory", "s3"])
def anywhere(request: pytest.FixtureRequest, folder: Path, tmp_path: Path) -> Iterator[str]:
    """The same folder, in four places."""
    if request.param == "local":
        yield str(folder)
        return
    if request.param == "zip":
        with zipfile.ZipFile(tmp_path / "all.zip", "w") as archive:
            for name in [*NAMES, *OTHERS]:
                archive.write(folder / name, name)
        yield f"zip://::{tmp_path}/all.zip"
        return
    url = "memory://meshes" if request.param == "memory" else request.getfixturevalue("bucket")
    fs, path = fsspec.url_to_fs(url)
    fs.put(f"{folder}/", f"{path}/", recursive=True)
    yield url
    if request.param == "memory":
        fs.rm(path, recursive=True)


def below(listing: Listing) -> list[str]:
    return [file.below for file in listing]


def test_all_meshes_in_the_order_of_their_paths(anywhere: str) -> None:
    listing = Listing([anywhere])
    expected = sorted(NAMES, key=lambda name: name.split("/"))
    assert below(listing) == expected
    assert below(listing) == expected  # walked anew
    for file in listing:
        assert file.read().decode() == file.below
        assert file.size() == len(file.below.encode())


def test_files_of_other_formats_are_counted(anywhere: str) -> None:
    """Each time that files are asked for; those that were not asked for are not."""
    for _ in range(2):
        others: Counter[str] = Counter()
        assert len(list(Listing([anywhere]).files(others))) == len(NAMES)
        assert told(others) == "5 files of other formats: .blend 3, .iges 1, .igs 1"
    chosen: Counter[str] = Counter()
    list(Listing([anywhere], Choice(exclude=["*.blend", "*.BLEND", "*.igs"])).files(chosen))
    assert told(chosen) == "1 file of other formats: .iges 1"
    shards = Counter[str]()
    for number in (1, 2, 3):
        list(Listing([anywhere], Choice(shard=Shard(number, 3))).files(shards))
    assert shards == others


def test_hidden_files_are_found_where_they_are_named(folder: Path) -> None:
    assert below(Listing([f"{folder}/._a.obj", f"{folder}/.git"])) == ["._a.obj", "b.obj"]


def test_a_folder_of_other_formats_alone_says_so(folder: Path) -> None:
    (folder / "STEP" / "f.blend").touch()
    with pytest.raises(
        NotListed, match=r"; there are 2 files of other formats: \.blend 1, \.igs 1"
    ):
        Listing([f"{folder}/STEP"])
    (folder / "STEP" / "f.blend").unlink()


@pytest.fixture(params=["local", "memory"])
def packed(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[str]:
    """A folder with archives: of meshes, of none, and a damaged one."""
    files = {
        "z.obj": "z",
        "b/x.gltf": '{"uri": "x.bin"}',
        "b/x.bin": "data",
        "n.txt": "",
        "._z.obj": "",
    }
    held_by = {"a.ZIP": files, "none.zip": {"n.txt": ""}, "others.zip": {"a.blend": ""}}
    for name, held in held_by.items():
        with zipfile.ZipFile(tmp_path / name, "w") as archive:
            for path, content in held.items():
                archive.writestr(path, content)
    (tmp_path / "bad.zip").write_text("no archive")
    (tmp_path / "m.obj").write_text("m")
    if request.param == "local":
        yield str(tmp_path)
        return
    fs, path = fsspec.url_to_fs("memory://packed")
    fs.put(f"{tmp_path}/", f"{path}/", recursive=True)
    yield "memory://packed"
    fs.rm(path, recursive=True)


def test_each_mesh_in_an_archive_is_a_file(packed: str) -> None:
    """An archive that cannot be read or holds none is one itself, so that its result says why."""
    others: Counter[str] = Counter()
    listing = Listing([packed])
    found = [file.below for file in listing.files(others)]
    assert found == ["a.ZIP/b/x.gltf", "a.ZIP/z.obj", "bad.zip", "m.obj", "none.zip"]
    assert others == {".blend": 1}
    files = {file.below: file for file in listing}
    gltf = files["a.ZIP/b/x.gltf"]
    assert gltf.declared == ".gltf"
    assert gltf.pieces(gltf.read()) == {"x.bin": b"data"}
    assert files["a.ZIP/z.obj"].read() == b"z"
    assert all(file.size() == len(file.read()) for file in listing)
    with pytest.raises(NotListed, match=r"1 file of other formats: \.blend 1"):
        Listing([f"{packed}/others.zip"])
    assert below(Listing([packed], Choice(["*.obj"]))) == ["a.ZIP/z.obj", "m.obj"]
    assert below(Listing([f"{packed}/*.ZIP"])) == ["a.ZIP/b/x.gltf", "a.ZIP/z.obj"]


def test_a_mesh_in_an_archive_can_be_named(packed: str) -> None:
    (named,) = Listing([f"{packed}/a.ZIP/z.obj"])
    assert (named.name, named.read()) == (f"{packed}/a.ZIP/z.obj", b"z")
    assert below(Listing([f"{packed}/a.ZIP"])) == ["a.ZIP/b/x.gltf", "a.ZIP/z.obj"]
    assert below(Listing([f"{packed}/none.zip"])) == ["none.zip"]
    with pytest.raises(NotListed):
        Listing([f"{packed}/a.ZIP/gone.obj"])


@pytest.mark.parametrize("name", ["local", "memory"])
def test_pieces_lie_beside_their_file_or_below(name: str, tmp_path: Path) -> None:
    fs, path = fsspec.url_to_fs(str(tmp_path) if name == "local" else "memory://pieces")
    fs.makedirs(f"{path}/a/b", exist_ok=True)
    fs.pipe(
        f"{path}/a/x.gltf",
        b'{"buffers":[{"uri":"b/y%20z.bin"},{"uri":"gone.bin"},{"uri":"../up"}]}',
    )
    fs.pipe(f"{path}/a/b/y z.bin", b"data")
    fs.pipe(f"{path}/up", b"secret")
    (file,) = Listing([str(tmp_path) if name == "local" else "memory://pieces"])
    assert file.pieces(file.read()) == {"b/y z.bin": b"data"}


def test_a_file_that_was_found_can_be_named(anywhere: str) -> None:
    for file in Listing([anywhere]):
        (named,) = Listing([file.name])
        assert (named.name, named.read()) == (file.name, file.read())


@pytest.mark.parametrize(
    ("include", "exclude", "expected"),
    [
        (["*.obj"], [], ["a/d.obj", "a-b.obj", "a.obj", "\u00e4.obj"]),
        (["a/*"], [], ["a/b.STL", "a/d.obj"]),
        (["a/**"], ["**/b/*", "d.*"], ["a/b.STL"]),
        (["?.obj", "[z]*"], [], ["a/d.obj", "a.obj", "z.glb", "\u00e4.obj"]),
        ([], ["*.obj", "a/**"], ["b/e.off", "z.glb"]),
    ],
)
def test_patterns_choose(
    anywhere: str, include: list[str], exclude: list[str], expected: list[str]
) -> None:
    assert below(Listing([anywhere], Choice(include, exclude))) == expected


def test_shards_are_all_files_once(anywhere: str) -> None:
    shards = [below(Listing([anywhere], Choice(shard=Shard(i, 3)))) for i in (1, 2, 3)]
    together = [name for shard in shards for name in shard]
    assert sorted(together) == sorted(NAMES)
    assert len(shards[0]) < len(NAMES)


@pytest.mark.parametrize(
    ("glob", "expected"),
    [
        ("*.obj", ["a-b.obj", "a.obj", "\u00e4.obj"]),
        ("**/*.obj", ["a/d.obj", "a-b.obj", "a.obj", "\u00e4.obj"]),
        ("a/?.*", ["b.STL", "d.obj"]),
    ],
)
def test_globs(folder: Path, glob: str, expected: list[str]) -> None:
    assert below(Listing([f"{folder}/{glob}"])) == expected


def test_a_glob_behind_a_url(bucket: str, folder: Path) -> None:
    fs, path = fsspec.url_to_fs(bucket)
    fs.put(f"{folder}/", f"{path}/globs/", recursive=True)
    names = [file.name for file in Listing([f"{bucket}/globs/a/*.obj"])]
    assert names == [f"{bucket}/globs/a/d.obj"]


class Quiet(SimpleHTTPRequestHandler):
    """Serves a folder, and writes no log."""

    def log_message(self, format: str, *args: object) -> None:
        pass


def test_a_folder_over_http_whose_listing_tells_no_sizes(folder: Path) -> None:
    serve = partial(Quiet, directory=str(folder))
    with ThreadingHTTPServer(("127.0.0.1", 0), serve) as server:
        Thread(target=server.serve_forever).start()
        url = f"http://127.0.0.1:{server.server_port}"
        files = list(Listing([f"{url}/a/"]))
        assert [file.below for file in files] == ["b/c.ply", "b.STL", "d.obj"]
        for file in files:
            assert file.read().decode() == f"a/{file.below}"
            assert file.size() == len(file.read())
        gone = next(iter(Listing([f"{url}/a/"])))
        server.shutdown()
    assert gone.size() == 0
    with pytest.raises(OSError, match="No such file"):
        gone.read()


@pytest.mark.parametrize(
    ("path", "reason"),
    [
        ("{folder}/none.obj", "no such file or folder"),
        ("{folder}/*.gltf", "no mesh files under"),
        ("{folder}/empty", "no mesh files under"),
        ("memory://nothing", "no such file or folder: memory://nothing"),
        ("nothing://at/all", "cannot be opened: ValueError: Protocol not known: nothing"),
        ("zip://::{folder}/z.glb", "cannot be opened: BadZipFile"),
    ],
)
def test_paths_that_name_nothing(folder: Path, path: str, reason: str) -> None:
    with pytest.raises(NotListed, match=reason.replace("*", r"\*")):
        Listing([path.format(folder=folder)])


def test_what_is_no_file_is_left_out_but_not_a_broken_link(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.obj")
    (tmp_path / "folder.obj").mkdir()
    (tmp_path / "broken.obj").symlink_to("nowhere.obj")
    (tmp_path / "around.obj").symlink_to(tmp_path)
    (tmp_path / "good.obj").touch()
    assert below(Listing([str(tmp_path)])) == ["broken.obj", "good.obj"]


def test_folders_however_deep(tmp_path: Path) -> None:
    depth = 1100  # more than Python recurses
    here = os.getcwd()
    os.chdir(tmp_path)
    try:
        for _ in range(depth):
            os.mkdir("d")
            os.chdir("d")
        Path("deep.obj").touch()
    finally:
        os.chdir(here)
    try:
        assert below(Listing([str(tmp_path)])) == ["d/" * depth + "deep.obj"]
    finally:
        subprocess.run(["rm", "-r", tmp_path / "d"], check=True)  # shutil would recurse


@pytest.mark.parametrize("text", ["0/2", "3/2", "1", "a/b", "-1/2", "1/0"])
def test_no_shard(text: str) -> None:
    with pytest.raises(ValueError, match="no part of a whole"):
        Shard.parse(text)


def test_what_is_no_file_is_not_read() -> None:
    with pytest.raises(NotListed, match=r"/dev/zero cannot be opened: it is no file; .* to -"):
        Listing(["/dev/zero"])


def test_a_file_that_has_become_a_pipe_keeps_nobody(tmp_path: Path) -> None:
    path = tmp_path / "a.obj"
    path.write_text("v 0 0 0\n")
    (found,) = Listing([str(tmp_path)])
    path.unlink()
    os.mkfifo(path)
    with pytest.raises(OSError, match="it is no file"):
        found.read()


def test_a_file_is_the_same_from_any_folder(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As a machine of a cluster has it."""
    (tmp_path / "a.obj").write_text("content")
    monkeypatch.chdir(tmp_path)
    file = LocalFile.at("a.obj").shared()
    monkeypatch.chdir("/")
    assert (file.name, file.below, file.declared) == ("a.obj", "a.obj", ".obj")
    assert (file.size(), file.read()) == (7, b"content")


def test_a_machine_that_lacks_a_file_says_what_to_do(tmp_path: Path) -> None:
    missing = LocalFile.at(str(tmp_path / "a.obj")).shared()
    with pytest.raises(FileNotFoundError, match="No such file"):
        missing.read()
    with pytest.raises(FileNotFoundError, match=r"elsewhere has it and .* has not; put"):
        replace(missing, host="elsewhere").read()
