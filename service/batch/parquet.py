"""Records as Parquet. Importing it needs pyarrow, of the extra `parquet`."""

import json
from dataclasses import fields
from typing import Any, BinaryIO, get_type_hints

import pyarrow as pa
from pyarrow.parquet import ParquetWriter

from meshconv3d.model.preparation import MeshReport
from meshconv3d.service.classifier import STAGES

# Records to a row group, which is what is held until it is written.
GROUP = 4096

_ARROW = {int: pa.int64(), float: pa.float64(), bool: pa.bool_()}
_REPORT = get_type_hints(MeshReport)
_SCORE = {"class": pa.string(), "probability": pa.float64(), "score": pa.float64()}

SCHEMA = pa.schema(
    {
        "file": pa.string(),
        "class": pa.string(),
        "probability": pa.float64(),
        "unknown": pa.bool_(),
        "novelty": pa.float64(),
        "scores": pa.list_(pa.struct(_SCORE)),
        "error": pa.struct({"fault": pa.string(), "message": pa.string()}),
        "model": pa.struct({"name": pa.string(), "sha256": pa.string()}),
        "mesh": pa.struct(
            {
                field.name: _ARROW.get(_REPORT[field.name], pa.string())
                for field in fields(MeshReport)
            }
        ),
        "timings_ms": pa.struct(dict.fromkeys(STAGES, pa.float64())),
        "sha256": pa.string(),
        "run": pa.string(),
    }
)


class Parquet:
    """The records as they are, in columns; see `service.batch.tables.Table`."""

    def __init__(self, file: BinaryIO) -> None:
        self._file = file
        self._writer = ParquetWriter(file, SCHEMA, compression="zstd")
        self._rows: list[dict[str, Any]] = []

    def add(self, line: bytes) -> None:
        """See `Table`."""
        self._rows.append(json.loads(line))
        if len(self._rows) >= GROUP:
            self._write()

    def _write(self) -> None:
        self._writer.write_table(pa.Table.from_pylist(self._rows, SCHEMA))
        self._rows = []

    def close(self) -> None:
        """See `Table`."""
        self._write()
        self._writer.close()
        self._file.close()
