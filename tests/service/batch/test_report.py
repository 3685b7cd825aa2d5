"""What a report counts and keeps, and the file that it becomes."""

import html
import json
import re
import resource
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from meshconv3d.service.batch.report import MOST_NAMED, SLOWEST, Report, write_page
from meshconv3d.service.picture import picture
from tests.meshes import torus
from tests.service.batch.records import MODEL, answer, refusal

HOSTILE = "</script><script>alert(1)</script><img src=x onerror=alert(2)>&amp;\"'{{ 7 * 7 }}\u202e"


def report(most_shown: int = 100) -> Report:
    return Report(MODEL, "toys", most_shown)


def page(report: Report, folder: Path) -> str:
    write_page(report, folder / "report.html", 200.0)
    return (folder / "report.html").read_text("utf-8")


def entries(text: str) -> list[dict]:
    """What the page's script is given."""
    found = re.search(r'<script type="application/json" id="entries">(.*?)</script>', text, re.S)
    assert found
    return json.loads(found[1])


def test_everything_is_counted_once() -> None:
    toys = report()
    for i in range(30):
        toys.add(answer(f"{i}.obj", ("ring", "ball", "ball")[i % 3], i / 29))
    toys.add(answer("strange.obj", "ring", 0.99, unknown=True))
    toys.add(answer("no-limit.obj", "ring", 0.5, unknown=None))
    for fault in ("no-faces", "truncated", "no-faces"):
        toys.add(refusal("bad.obj", fault))
    assert toys.classes == {"ball": 20, "ring": 11}
    assert sum(toys.histogram) == toys.classified == 31
    assert toys.histogram[0] == 2
    assert toys.histogram[-1] == 2
    assert toys.unknown == 1
    assert {fault: found.files for fault, found in toys.faults.items()} == {
        "no-faces": 2,
        "truncated": 1,
    }
    assert toys.files == 35


def test_what_is_held_is_bounded_and_the_doubtful_and_the_rare_stay() -> None:
    toys = report(most_shown=60)
    for i in range(1000):
        toys.add(answer(f"{i}.obj", "ring", i / 1000, milliseconds=float(i + 2)))
        toys.add(refusal(f"{i}.bad"))
    for i in range(10):
        toys.add(answer(f"rare-{i}.obj", "ball", 0.9 + i / 100))
        toys.add(answer(f"strange-{i}.obj", "ring", 0.99, unknown=True))
    held = toys.gallery.least_certain_first()
    assert len(held) == 60
    assert sum(file["likeliest"][0][0] == "ball" for file in held) == 10
    assert sum(file["unknown"] for file in held) == 10
    assert [file["file"] for file in held[:40]] == [f"{i}.obj" for i in range(40)]
    assert [file for file, _ in toys.slowest] == [f"{999 - i}.obj" for i in range(SLOWEST)]
    assert toys.classified == 1010
    fault = toys.faults["no-faces"]
    assert (fault.files, len(fault.named)) == (1000, MOST_NAMED)


def test_the_page_is_one_file_that_says_all(tmp_path: Path) -> None:
    toys = report()
    toys.add(answer("here/ring.obj", "ring", 0.75, milliseconds=1234.5), picture(torus()))
    toys.add(answer("no-picture.obj", "ball", 0.5))
    toys.add(refusal("bad.obj", "truncated", "it ends too early"))
    text = page(toys, tmp_path)
    assert list(tmp_path.iterdir()) == [tmp_path / "report.html"]
    for words in ("toys", "0123456789ab", "3 min 20 s", "truncated", "it ends too early"):
        assert words in text
    assert "prepare 1233.5" in text
    doubtful, certain = entries(text)
    assert doubtful["picture"] is None
    assert certain["file"] == "here/ring.obj"
    assert certain["likeliest"] == [["ring", 0.75], ["something else", 0.25]]
    assert "No picture of 1: an earlier run classified them" in text


def test_an_unknown_file_has_the_unknown_ones_beside_it_that_are_like_it(tmp_path: Path) -> None:
    toys = report()
    toys.add(answer("known.obj", probability=0.1), None, np.array([1, 0], np.float32))
    for angle in (0.0, 0.1, 1.5, 0.2):
        direction = np.array([np.cos(angle), np.sin(angle)], np.float32)
        toys.add(answer(f"{angle}.obj", unknown=True), None, direction)
    found = entries(page(toys, tmp_path))
    alike = {one["file"]: [found[place]["file"] for place in one["alike"]] for one in found}
    assert alike["known.obj"] == []
    assert alike["0.0.obj"] == ["0.1.obj", "0.2.obj", "1.5.obj"]
    assert all("embedding" not in one for one in found)


def test_the_page_names_no_other_address(tmp_path: Path) -> None:
    toys = report()
    toys.add(answer("ring.obj"), picture(torus()))
    text = re.sub(r'"picture": "[^"]*"', "", page(toys, tmp_path))
    assert "No picture" not in text
    assert not re.search(r"https?:|//\w|@import|url\(|<link|<iframe|<base", text)
    assert "default-src 'none'" in html.unescape(text)
    assert "unsafe" not in text


PLACES = ["file", "class", "fault", "message", "model", "source"]


@pytest.mark.parametrize("where", PLACES)
def test_no_name_becomes_markup(tmp_path: Path, where: str) -> None:
    names = dict.fromkeys(PLACES, "plain")
    plain = page(_named(names), tmp_path)
    hostile = page(_named(names | {where: HOSTILE}), tmp_path)
    tags = re.compile(r"</?[a-z!][a-z0-9]*", re.IGNORECASE)
    assert tags.findall(hostile) == tags.findall(plain)
    assert len(entries(hostile)) == 1


def _named(names: dict[str, str]) -> Report:
    made = Report(replace(MODEL, name=names["model"]), names["source"])
    made.add(answer(names["file"], names["class"]))
    made.add(refusal(names["file"], names["fault"], names["message"]))
    return made


def test_a_batch_without_any_result_has_a_page(tmp_path: Path) -> None:
    assert "No file could be classified" in page(report(), tmp_path)
    only_unknown = report()
    only_unknown.add(answer("strange.obj", unknown=True))
    assert len(entries(page(only_unknown, tmp_path))) == 1


def test_a_page_for_which_there_is_no_room_leaves_the_one_before(tmp_path: Path) -> None:
    before = page(report(), tmp_path)
    toys = report()
    toys.add(answer("ring.obj"))
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limits[1]))
    try:
        with pytest.raises(OSError, match=r"report\.html"):
            page(toys, tmp_path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert [path.name for path in tmp_path.iterdir()] == ["report.html"]
    assert (tmp_path / "report.html").read_text() == before


def test_a_page_replaces_the_one_before(tmp_path: Path) -> None:
    first = page(report(), tmp_path)
    toys = report()
    toys.add(answer("ring.obj"))
    assert page(toys, tmp_path) != first
    assert [path.name for path in tmp_path.iterdir()] == ["report.html"]
