"""Finding, reading and refusing the files of a data set."""

import logging
import os
from pathlib import Path

import numpy as np
import pytest

from meshconv3d.model.mesh import Mesh
from meshconv3d.model.training.datasets import (
    DatasetError,
    class_names,
    find_samples,
    list_samples,
    load_samples,
)
from tests.meshes import cube, icosphere, torus
from tests.networks import topology_of


def write_off(path: Path, mesh: Mesh) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    lines = ["OFF", f"{len(mesh.vertices)} {len(mesh.faces)} 0"]
    lines += [" ".join(map(repr, row)) for row in mesh.vertices.tolist()]
    lines += ["3 " + " ".join(map(str, row)) for row in mesh.faces.tolist()]
    path.write_text("\n".join(lines) + "\n")


@pytest.fixture
def folders(tmp_path: Path) -> Path:
    """Three classes as CLASS/{train,test}/*.off, one with a file that is no mesh."""
    for label, mesh in (("ball", icosphere(1)), ("box", cube()), ("ring", torus(8, 6))):
        for split in ("train", "test"):
            write_off(tmp_path / label / split / "one.off", mesh)
            write_off(tmp_path / label / split / "two.OFF", mesh)
    (tmp_path / "box" / "train" / "broken.off").write_text("OFF\n1 1 0\nnothing\n")
    (tmp_path / "box" / "train" / "notes.txt").write_text("not a mesh")
    (tmp_path / "box" / "spare").mkdir()
    write_off(tmp_path / "box" / "spare" / "three.off", cube())
    return tmp_path


def described(samples, root) -> list[tuple[str, str, str]]:
    return [(str(s.path.relative_to(root)), s.label, s.split) for s in samples]


def test_folders_are_the_splits(folders):
    samples = find_samples(folders)
    assert described(samples, folders) == [
        ("ball/test/one.off", "ball", "test"),
        ("ball/test/two.OFF", "ball", "test"),
        ("ball/train/one.off", "ball", "train"),
        ("ball/train/two.OFF", "ball", "train"),
        ("box/test/one.off", "box", "test"),
        ("box/test/two.OFF", "box", "test"),
        ("box/train/broken.off", "box", "train"),
        ("box/train/one.off", "box", "train"),
        ("box/train/two.OFF", "box", "train"),
        ("ring/test/one.off", "ring", "test"),
        ("ring/test/two.OFF", "ring", "test"),
        ("ring/train/one.off", "ring", "train"),
        ("ring/train/two.OFF", "ring", "train"),
    ]
    assert class_names(samples) == ("ball", "box", "ring")


def test_the_working_folder_is_a_folder_like_any_other(folders, monkeypatch):
    """Its meshes have short paths, and those that lie in it directly have no class."""
    write_off(folders / "stray.off", cube())
    write_off(folders / "train" / "stray.off", cube())
    samples = described(find_samples(folders), folders)
    monkeypatch.chdir(folders)
    assert described(find_samples(Path()), Path()) == samples


@pytest.mark.parametrize("split", ["test", "val"])
def test_what_is_only_measured_on_needs_no_training_meshes(tmp_path, split):
    write_off(tmp_path / "box" / split / "a.off", cube())
    assert described(list_samples(tmp_path), tmp_path) == [(f"box/{split}/a.off", "box", split)]
    with pytest.raises(DatasetError, match="0 classes with training meshes"):
        find_samples(tmp_path)


def test_a_folder_without_splits_is_all_test(tmp_path):
    for place in ("box/b.off", "box/a.off", "ring/c.off", "stray.off", "box/below/d.off"):
        write_off(tmp_path / place, cube())
    assert described(list_samples(tmp_path), tmp_path) == [
        ("box/a.off", "box", "test"),
        ("box/b.off", "box", "test"),
        ("ring/c.off", "ring", "test"),
    ]
    write_off(tmp_path / "ring" / "train" / "e.off", cube())
    assert described(list_samples(tmp_path), tmp_path) == [("ring/train/e.off", "ring", "train")]


def test_nothing_to_list_is_an_empty_list(tmp_path):
    assert list_samples(tmp_path) == []


def test_a_table_names_the_splits_of_files_in_either_place(tmp_path):
    for place in ("box/a.off", "box/b.off", "ring/test/c.off", "ring/train/unnamed.off"):
        write_off(tmp_path / place, cube())
    table = tmp_path / "split.csv"
    table.write_text("file,split,class\na.off,train,box\nb.off,val,box\nc.off,train,ring\n")
    assert described(find_samples(tmp_path, table), tmp_path) == [
        ("box/a.off", "box", "train"),
        ("box/b.off", "box", "val"),
        ("ring/test/c.off", "ring", "train"),
    ]


@pytest.mark.parametrize(
    ("table", "says"),
    [
        ("class,file\nbox,one.off\n", "lacks the columns class,file,split"),
        ("", "lacks the columns"),
        ("class,file,split\nbox,one.off,training\n", r"one of train, val, test, got .*one\.off"),
        ("class,file,split\nbox,missing.off,train\n", "box/missing.off, which is not under"),
        ("class,file,split\nbox,one.off,test\n", "classes with training meshes"),
        ("class,file,split\n", "classes with training meshes"),
        (f"class,file,split\n{'a' * 200_000},b,train\n", "is no table"),
    ],
)
def test_a_table_that_does_not_fit_is_refused(folders, table, says):
    split_file = folders / "split.csv"
    split_file.write_text(table)
    with pytest.raises(DatasetError, match=says):
        find_samples(folders, split_file)


def test_what_is_no_data_set_is_refused(tmp_path):
    with pytest.raises(DatasetError, match="is not a folder"):
        find_samples(tmp_path / "missing")
    with pytest.raises(DatasetError, match=r"CLASS/train/\*\.obj"):
        find_samples(tmp_path)


def test_samples_are_prepared_and_bad_files_counted(folders, config, caplog):
    samples = [s for s in find_samples(folders) if s.split == "train"]
    with caplog.at_level(logging.WARNING):
        loaded = load_samples(samples, config)
    assert (loaded.refused, loaded.total) == (1, 7)
    assert "broken.off" in caplog.text
    assert [mesh.label for mesh in loaded.meshes] == [0, 0, 1, 1, 2, 2]
    for mesh in loaded.meshes:
        assert len(mesh.mesh.faces) in (499, 500)
        assert len(mesh.inputs.surface.twin) == 3 * len(mesh.mesh.faces)
        assert topology_of(mesh.inputs).face_counts[0] == len(mesh.mesh.faces)
        assert np.isfinite(mesh.inputs.terms).all()


def test_a_file_that_cannot_be_read_is_left_out(folders, config, caplog):
    (folders / "box" / "train" / "lost.off").symlink_to("nowhere")
    samples = [s for s in find_samples(folders) if s.split == "train"]
    assert load_samples(samples, config).refused == 2
    assert "lost.off" in caplog.text


def test_a_class_has_a_name_that_can_be_written_down(folders):
    os.rename(folders / "box", os.fsencode(folders) + b"/b\xffx")
    with pytest.raises(DatasetError, match=r"'b\\udcffx': rename its folder"):
        find_samples(folders)


def test_progress_sees_every_sample(folders, config):
    samples = find_samples(folders)[:3]
    seen = []

    def progress(items):
        for item in items:
            seen.append(item)
            yield item

    load_samples(samples, config, progress)
    assert seen == samples


def table_of(folder, *rows: str) -> str:
    """A split file over four cubes, two of a class, named by `rows`; its error."""
    for place in ("box/a.off", "box/b.off", "ring/c.off", "ring/d.off"):
        write_off(folder / place, cube())
    split_file = folder / "split.csv"
    split_file.write_text("\ufeffclass,file,split\n" + "\n".join(rows), encoding="utf-8")
    with pytest.raises(DatasetError) as caught:
        find_samples(folder, split_file)
    return str(caught.value)


def test_a_file_cannot_be_learnt_and_tested(tmp_path):
    rows = ["box,a.off,train", "ring,c.off,train", "box,a.off,test"]
    assert "more than once" in table_of(tmp_path, *rows)


def test_every_class_must_be_learnt_and_one_is_no_choice(tmp_path):
    (tmp_path / "key").mkdir()
    write_off(tmp_path / "key" / "e.off", cube())
    rows = ["box,a.off,train", "key,e.off,train", "ring,c.off,test"]
    assert "without training meshes: ring" in table_of(tmp_path, *rows)
    assert "at least 2 are needed" in table_of(tmp_path, *rows[:1])


def test_a_table_names_nothing_outside_its_folder(tmp_path):
    write_off(tmp_path / "outside.off", cube())
    row = "box,../../outside.off,train"
    assert "which is not under" in table_of(tmp_path / "data", row)
