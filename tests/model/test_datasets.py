"""Listing and splitting the files of a data set, by their names and places alone."""

import os
from collections import Counter
from pathlib import Path

import pytest

from meshconv3d.model.datasets import (
    DatasetError,
    Sample,
    class_names,
    find_samples,
    hold_out,
    list_samples,
    random_split,
    write_split,
)


def touch(root: Path, *places: str) -> Path:
    """Empty files: nothing is read before training."""
    for place in places:
        (root / place).parent.mkdir(parents=True, exist_ok=True)
        (root / place).touch()
    return root


@pytest.fixture
def folders(tmp_path: Path) -> Path:
    """Three classes as CLASS/{train,test}/*.off."""
    for label in ("ball", "box", "ring"):
        for split in ("train", "test"):
            touch(tmp_path / label / split, "one.off", "two.OFF")
    return touch(tmp_path, "box/train/broken.off", "box/train/notes.txt")


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
    touch(folders, "stray.off")
    touch(folders, "train/stray.off")
    samples = described(find_samples(folders), folders)
    monkeypatch.chdir(folders)
    assert described(find_samples(Path()), Path()) == samples


@pytest.mark.parametrize("split", ["test", "val"])
def test_what_is_only_measured_on_needs_no_training_meshes(tmp_path, split):
    touch(tmp_path / "box" / split, "a.off")
    assert described(list_samples(tmp_path), tmp_path) == [(f"box/{split}/a.off", "box", split)]
    with pytest.raises(DatasetError, match="0 classes with training meshes"):
        find_samples(tmp_path)


def test_a_folder_without_splits_is_one_split(tmp_path):
    """All to test on or, to train, all to train on; folders within a class change nothing."""
    touch(tmp_path, "box/b.off", "box/a.off", "ring/c.off", "box/below/d.off")
    expected = [
        ("box/a.off", "box", "test"),
        ("box/b.off", "box", "test"),
        ("box/below/d.off", "box", "test"),
        ("ring/c.off", "ring", "test"),
    ]
    assert described(list_samples(tmp_path), tmp_path) == expected
    trained = [(path, label, "train") for path, label, _ in expected]
    assert described(find_samples(tmp_path), tmp_path) == trained
    touch(tmp_path, "ring/train/e.off")
    assert described(list_samples(tmp_path), tmp_path) == [("ring/train/e.off", "ring", "train")]


@pytest.mark.parametrize(
    ("folder", "split"),
    [
        ("Test", "test"),
        ("TEST", "test"),
        ("testing", "test"),
        ("val", "val"),
        ("Validation", "val"),
        ("valid", "val"),
        ("Training", "train"),
        ("train/scan1", "train"),
        ("train/scan1/test", "train"),
        ("scan1/test", "test"),
    ],
)
def test_split_folders_are_known_by_any_usual_name(tmp_path, caplog, folder, split):
    touch(tmp_path, "box/train/a.off", f"box/{folder}/b.off")
    samples = described(list_samples(tmp_path), tmp_path)
    assert (f"box/{folder}/b.off", "box", split) in samples
    assert not caplog.text
    table = tmp_path / "split.csv"
    table.write_text(f"class,file,split\nbox,b.off,{folder.partition('/')[0]}\n")
    if "/" not in folder:
        assert [s.split for s in list_samples(tmp_path, table)] == [split]


def test_split_folders_may_lie_above_the_classes(tmp_path, caplog):
    touch(tmp_path, "Train/box/a.off", "Train/ring/b.off", "test/box/c.off", "test/stray.off")
    assert described(find_samples(tmp_path), tmp_path) == [
        ("Train/box/a.off", "box", "train"),
        ("Train/ring/b.off", "ring", "train"),
        ("test/box/c.off", "box", "test"),
    ]
    assert "1 of 4 mesh files" in caplog.text
    assert "expected train/CLASS/FILE" in caplog.text


def test_a_class_may_be_called_train(tmp_path):
    touch(tmp_path, "train/train/a.off", "bus/train/b.off")
    assert class_names(find_samples(tmp_path)) == ("bus", "train")


def test_files_of_no_split_are_counted_and_named(tmp_path, caplog):
    touch(tmp_path, *(f"{label}/train/{i}.off" for label in ("box", "ring") for i in range(3)))
    touch(tmp_path, "box/spare/x.off", "ring/y.off", "z.off", "ring/._w.off", "ring/notes.txt")
    assert len(find_samples(tmp_path)) == 6
    assert "3 of 9 mesh files" in caplog.text
    assert "CLASS/train/FILE" in caplog.text
    assert "box/spare/x.off, ring/y.off, z.off" in caplog.text
    caplog.clear()
    touch(tmp_path, *(f"box/more/{i:02d}.off" for i in range(20)))
    find_samples(tmp_path)
    assert "23 of 29 mesh files" in caplog.text
    assert "box/more/09.off and 13 more" in caplog.text


def test_nothing_to_list_is_an_empty_list(tmp_path):
    assert list_samples(tmp_path) == []


def test_a_table_names_the_splits_of_files_in_either_place(tmp_path):
    for place in ("box/a.off", "box/b.off", "ring/test/c.off", "ring/train/unnamed.off"):
        touch(tmp_path, place)
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
        ("class,file,split\nbox,one.off,learn\n", r"one of train, val, test, got .*one\.off"),
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


def test_a_class_has_a_name_that_can_be_written_down(folders):
    os.rename(folders / "box", os.fsencode(folders) + b"/b\xffx")
    with pytest.raises(DatasetError, match=r"'b\\udcffx': rename its folder"):
        find_samples(folders)


def table_of(folder, *rows: str) -> str:
    """A split file over four cubes, two of a class, named by `rows`; its error."""
    for place in ("box/a.off", "box/b.off", "ring/c.off", "ring/d.off"):
        touch(folder, place)
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
    touch(tmp_path, "key/e.off")
    rows = ["box,a.off,train", "key,e.off,train", "ring,c.off,test"]
    assert "without training meshes: ring" in table_of(tmp_path, *rows)
    assert "at least 2 are needed" in table_of(tmp_path, *rows[:1])


def test_a_table_names_nothing_outside_its_folder(tmp_path):
    touch(tmp_path, "outside.off")
    row = "box,../../outside.off,train"
    assert "which is not under" in table_of(tmp_path / "data", row)


def folder_of(root: Path, of_each: int = 20) -> list[Sample]:
    """Three classes of empty files, all in the split train."""
    for label in ("ants", "birds", "cats"):
        (root / label / "train").mkdir(parents=True)
        for number in range(of_each):
            (root / label / "train" / f"T{number}.obj").touch()
    return find_samples(root)


def counts(samples: list[Sample]) -> set[tuple]:
    per_class = Counter((s.label, s.split) for s in samples)
    return {(split, count) for (_, split), count in per_class.items()}


def test_every_class_is_split_alike(tmp_path: Path) -> None:
    samples = folder_of(tmp_path)
    chosen = random_split(samples, 7, 3, seed=0)
    assert counts(chosen) == {("train", 7), ("val", 3), ("test", 10)}
    assert [s.path for s in chosen] == [s.path for s in samples]


def test_validation_is_held_out_of_what_would_be_trained_on(tmp_path: Path) -> None:
    samples = folder_of(tmp_path)
    whole = {s.path for s in random_split(samples, 10, 0, seed=4) if s.split == "train"}
    parted = {s.path for s in random_split(samples, 7, 3, seed=4) if s.split != "test"}
    assert whole == parted


def test_the_seed_and_the_names_decide_and_nothing_else(tmp_path: Path) -> None:
    (tmp_path / "here").mkdir()
    (tmp_path / "there").mkdir()
    here, there = (folder_of(tmp_path / name) for name in ("here", "there"))
    one, same = (random_split(s, 10, 0, 1) for s in (here, there[::-1]))
    assert [s.split for s in one] == [s.split for s in same]
    assert [s.split for s in one] != [s.split for s in random_split(here, 10, 0, 2)]


def test_a_class_without_test_meshes_is_named(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match=r"class ants has 10 meshes.*leave none to test on"):
        random_split(folder_of(tmp_path, 10), 8, 2, 0)


@pytest.mark.parametrize(("share", "held"), [(0, 0), (0.125, 2), (0.5, 10)])
def test_a_share_of_every_class_is_held_out(tmp_path: Path, share: float, held: int) -> None:
    chosen = hold_out(folder_of(tmp_path), share, seed=0)
    assert Counter(sample.label for sample in chosen) == Counter(
        dict.fromkeys(("ants", "birds", "cats"), held) if held else {}
    )


def test_what_was_written_is_read_back(tmp_path: Path) -> None:
    chosen = random_split(folder_of(tmp_path), 10, 0, 0)
    table = tmp_path / "split.csv"
    write_split(chosen, table)
    assert find_samples(tmp_path, table) == chosen


def test_two_files_of_one_name_cannot_be_told_apart(tmp_path: Path) -> None:
    folder_of(tmp_path)
    (tmp_path / "ants" / "test").mkdir()
    (tmp_path / "ants" / "test" / "T3.obj").touch()
    with pytest.raises(DatasetError, match=r"class ants has two files called T3\.obj"):
        write_split(find_samples(tmp_path), tmp_path / "split.csv")
