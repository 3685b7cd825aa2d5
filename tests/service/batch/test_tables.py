"""Tables: each has all of a record."""

import csv
import io
import json
from collections.abc import Callable
from pathlib import Path
from typing import BinaryIO

import pyarrow.parquet

from meshconv3d.model.samples import sample_paths
from meshconv3d.service.batch.parquet import Parquet
from meshconv3d.service.batch.tables import Csv, Lines, Table
from meshconv3d.service.classifier import Classifier
from meshconv3d.service.evidence import explain
from meshconv3d.service.records import answer


class Kept(io.BytesIO):
    """A file whose content can be read after it is closed."""

    def close(self) -> None:
        pass


def test_all_of_an_explained_record_is_in_every_form(model_file: Path) -> None:
    """Which has a stage more than others."""
    explained = explain(Classifier.load(str(model_file)), sample_paths()["lamp"])
    record = answer("lamp.obj", explained.prediction).model_dump(by_alias=True, mode="json")
    record |= {"sha256": "0" * 64, "run": "1"}
    line = json.dumps(record).encode() + b"\n"

    def written(form: Callable[[BinaryIO], Table]) -> bytes:
        file = Kept()
        table = form(file)
        table.add(line)
        table.close()
        return file.getvalue()

    assert written(Lines) == line
    (row,) = pyarrow.parquet.read_table(io.BytesIO(written(Parquet))).to_pylist()
    assert row == record | {"error": None}
    (row,) = csv.DictReader(io.StringIO(written(Csv).decode()))
    empty = {"error.fault", "error.message", "mesh.note"}
    assert {name for name, value in row.items() if not value} == empty
    assert json.loads(row["scores"]) == record["scores"]
