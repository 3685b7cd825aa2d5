"""The formats that are read are the same in the program, the command and the manual."""

import dataclasses
import json
import re
from pathlib import Path

from click.testing import CliRunner

from meshconv3d.model.loading import TABLE, Limits
from meshconv3d.service.cli.show import formats

MANUAL = Path(__file__).parents[3] / "docs" / "formats.md"


def rows(header: str) -> list[list[str]]:
    """The cells of a table of the manual, below its header."""
    table = MANUAL.read_text().partition(f"| {header} |")[2].partition("\n\n")[0]
    return [[cell.strip() for cell in line.split("|")[1:-1]] for line in table.splitlines()[2:]]


def test_the_command_lists_every_format():
    lines = CliRunner().invoke(formats, ["--json"]).output.splitlines()
    told = [json.loads(line) for line in lines]
    assert [one["extension"] for one in told] == list(TABLE)
    assert told[-1]["media_types"][0] == "application/zip"
    table = CliRunner().invoke(formats).output
    assert all(f".{extension} " in table for extension in TABLE)


def test_the_manual_lists_every_format():
    expected = [
        [
            one.title,
            ", ".join(f"`.{extension}`" for extension in (one.extension, *one.aliases)),
            one.notes + ("; extra `formats`" if one.library else ""),
        ]
        for one in TABLE.values()
    ]
    assert rows("format | extension | of it") == expected


def test_the_manual_has_every_limit_with_its_default():
    units = {"MiB": 2**20}
    told = {}
    for name, default, _ in rows("limit | default | of"):
        matched = re.fullmatch(r"([0-9 ]+?)(?: (MiB))?", default)
        assert matched
        number, unit = matched.groups()
        told[name.strip("`")] = int(number.replace(" ", "")) * units.get(unit, 1)
    assert told == dataclasses.asdict(Limits())
