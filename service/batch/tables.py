"""Records in the forms that people open: JSON Lines, CSV, Parquet."""

import csv
import io
import json
from dataclasses import fields
from typing import Any, BinaryIO, Protocol

from meshconv3d.model.preparation import MeshReport
from meshconv3d.service.classifier import STAGES


class Table(Protocol):
    """Records on their way to a file."""

    def add(self, line: bytes) -> None:
        """Add a record, as a line of JSON. Raises OSError."""
        ...

    def close(self) -> None:
        """Finish the file, without which it may not be readable."""
        ...


class Lines:
    """JSON Lines: the records as they are."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file

    def add(self, line: bytes) -> None:
        """See `Table`."""
        self._file.write(line)

    def close(self) -> None:
        """See `Table`."""
        self._file.close()


class Csv:
    """A row for each record; what lies deeper has its path as its column, as `mesh.faces_in`. The
    scores are one column of JSON."""

    COLUMNS = (
        *("file", "class", "probability", "unknown", "novelty"),
        *("error.fault", "error.message", "model.name", "model.sha256"),
        *(f"mesh.{field.name}" for field in fields(MeshReport)),
        *(f"timings_ms.{stage}" for stage in STAGES),
        *("scores", "sha256", "run"),
    )

    def __init__(self, file: BinaryIO) -> None:
        self._file = io.TextIOWrapper(file, encoding="utf-8", newline="", write_through=True)
        self._rows = csv.DictWriter(_Rows(self._file), self.COLUMNS, extrasaction="ignore")
        self._rows.writeheader()

    def add(self, line: bytes) -> None:
        """See `Table`."""
        self._rows.writerow(_flat(json.loads(line)))

    def close(self) -> None:
        """See `Table`."""
        self._file.close()


class _Rows:
    """Ends rows with a line feed alone. The writer has to think otherwise: before Python 3.13 it
    quotes a carriage return only where it ends rows, and one in a name would make two of a row."""

    def __init__(self, file: io.TextIOWrapper) -> None:
        self._file = file

    def write(self, row: str) -> None:
        """Write one whole row."""
        self._file.write(row.removesuffix("\r\n") + "\n")


def _flat(record: dict[str, Any]) -> dict[str, Any]:
    row: dict[str, Any] = {}
    for name, value in record.items():
        if isinstance(value, dict):
            row.update({f"{name}.{inner}": one for inner, one in value.items()})
        else:
            row[name] = json.dumps(value) if isinstance(value, list | bool) else value
    return row
