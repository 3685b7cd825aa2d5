"""Random splits: balanced, repeatable, and never two meshes in two places."""

from collections import Counter
from pathlib import Path

import pytest
from click.testing import CliRunner

from benchmarks.cubes.__main__ import data as commands
from meshconv3d.model.training.datasets import DatasetError, Sample, find_samples
from meshconv3d.model.training.splits import hold_out, random_split, write_split


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
    expected = {("train", 20 - held)} | ({("val", held)} if held else set())
    assert counts(chosen) == expected


def test_test_meshes_are_never_held_out(tmp_path: Path) -> None:
    samples = random_split(folder_of(tmp_path), 10, 0, 0)
    after = hold_out(samples, 0.4, 0)
    assert [s for s in after if s.split == "test"] == [s for s in samples if s.split == "test"]


def test_what_was_written_is_read_back(tmp_path: Path) -> None:
    chosen = random_split(folder_of(tmp_path), 10, 0, 0)
    table = tmp_path / "split.csv"
    write_split(chosen, table)
    assert find_samples(tmp_path, table) == chosen


def test_the_command_writes_a_split_for_training(tmp_path: Path) -> None:
    folder_of(tmp_path)
    table = tmp_path / "split.csv"
    arguments = ["split", str(tmp_path), str(table), "--train", "10", "--seed", "3"]
    result = CliRunner().invoke(commands, arguments)
    assert result.exit_code == 0, result.output
    assert "30 meshes to train on, 30 to test on" in result.output
    assert counts(find_samples(tmp_path, table)) == {("train", 10), ("test", 10)}


def test_two_files_of_one_name_cannot_be_told_apart(tmp_path: Path) -> None:
    folder_of(tmp_path)
    (tmp_path / "ants" / "test").mkdir()
    (tmp_path / "ants" / "test" / "T3.obj").touch()
    with pytest.raises(DatasetError, match=r"class ants has two files called T3\.obj"):
        write_split(find_samples(tmp_path), tmp_path / "split.csv")
