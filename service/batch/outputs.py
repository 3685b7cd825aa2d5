"""Output of a batch: FILE.jsonl, FILE.csv or FILE.parquet, written so that runs can be resumed.

JSON Lines on this machine are their own journal. Any other output is made of FILE.journal, beside
it, once all files are done; a finished Parquet file is made one again, to add further files.
"""

import base64
import csv
import io
import json
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import fields
from itertools import count, islice
from pathlib import Path
from typing import TYPE_CHECKING, Any, BinaryIO, Self, get_type_hints

from meshconv3d.model.files import replacing
from meshconv3d.model.preparation import MeshReport
from meshconv3d.service.batch.files import exists, filesystem, is_url, remote_errors
from meshconv3d.service.batch.resume import (
    Done,
    Entry,
    LocalJournal,
    NotWritten,
    RemoteJournal,
    as_entry,
    check_run,
    entry,
    fault_of,
    is_settled,
    kept_entry,
    parse_line,
)
from meshconv3d.service.batch.running import Tally
from meshconv3d.service.classifier import STAGES
from meshconv3d.service.records import Answer, Refusal, to_json

if TYPE_CHECKING:
    import pyarrow as pa

# Rows that are written to Parquet at a time, and so held in memory.
ROW_GROUP = 4096

# First characters of cells that a spreadsheet would take for formulas.
FORMULA = ("=", "+", "-", "@", "\t", "\r", "\n")

CSV_COLUMNS = (
    *("file", "class", "probability", "unknown", "novelty"),
    *("error.fault", "error.message", "model.name", "model.sha256"),
    *(f"mesh.{field.name}" for field in fields(MeshReport)),
    *(f"timings_ms.{stage}" for stage in STAGES),
    *("scores", "sha256", "run"),
)


class Output:
    """Output file of a batch: a path or a URL that ends with one of FORMS.

    tally: counts of what earlier runs have left, and of what is added.
    """

    def __init__(self, path: str, resume: bool, library: bool = False) -> None:
        """Check the path; `begin` writes. library: see `service.library`, which is Parquet.

        Raises NotWritten, also if a file would be overwritten; ModuleNotFoundError if an extra is
        missing; OSError."""
        form = path.rpartition(".")[2].lower()
        if form not in FORMS or (library and form != "parquet"):
            forms = ".parquet" if library else ", ".join(f".{form}" for form in FORMS)
            raise NotWritten(f"{path} does not end with a form that is written: {forms}")
        folder = Path(path).parent
        if not is_url(path) and not folder.is_dir():
            raise NotWritten(
                f"{path} cannot be written: there is no folder {folder}; make it first"
            )
        if form == "parquet":
            import pyarrow.parquet  # noqa: F401  # now, not after hours of work
        self.path = path
        self.tally = Tally()
        self._write = write_library if library else FORMS[form]
        self._is_journal = form == "jsonl" and not is_url(path)
        self.journal_path = path if self._is_journal else f"{path}.journal"
        self._done = Done()
        self._settled = True
        self._finished = not exists(self.journal_path) and exists(path)
        if self._finished and (form != "parquet" or is_url(path)):
            raise NotWritten(
                f"{path} is there already, and finished, without the {self.journal_path} of a run "
                "that --resume could go on with: name another file"
            )
        if exists(path if self._finished else self.journal_path) and not resume:
            raise NotWritten(
                f"{path} is there already, or was begun: go on with it by --resume, or name "
                "another file"
            )

    def begin(self, run: str) -> Iterator[Entry]:
        """Create or resume the output; yields the entries of earlier runs. run: see `run_id`.

        Raises OSError, and NotWritten for entries that are damaged or of other settings.
        """
        self._run = run
        path = self.journal_path
        if self._finished:
            with replacing(Path(path)) as file:
                write_lines(_read_parquet(self.path, run), file)
        self._journal = RemoteJournal(path) if is_url(path) else LocalJournal(Path(path))
        numbers = count(1)

        def is_kept(line: bytes) -> bool:
            found = kept_entry(line, next(numbers), run, path)
            return found is not None and self._done.add(found)

        self._journal.recover(is_kept)
        for found in map(parse_line, self._journal):
            self.tally.add(fault_of(found))
            self.tally.earlier += 1
            yield found

    def done_as(self, name: str) -> Collection[str]:
        """See `DoneAs`."""
        return self._done.take(name)

    def add(
        self, record: Answer | Refusal, sha256: str | None, picture: bytes | None = None
    ) -> None:
        """Append a record. sha256, picture: see `FileResult`. Raises OSError."""
        added = entry(record, sha256, self._run, picture)
        self._journal.add(to_json(added) + b"\n")
        self.tally.add(fault_of(added))
        self._settled = self._settled and is_settled(added)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        """After an error, keep the journal for --resume. Otherwise write the file, and remove the
        journal unless another attempt may change a record. Raises OSError."""
        self._journal.close()
        if kind is not None or self._is_journal:
            return
        with _new_file(self.path) as file:
            self._write(map(parse_line, self._journal), file)
        if self._settled:
            self._journal.remove()


@contextmanager
def _new_file(path: str) -> Iterator[BinaryIO]:
    if is_url(path):
        fs, inner = filesystem(path)
        with remote_errors(), fs.open(inner, "wb") as file:
            yield file
    else:
        with replacing(Path(path)) as file:
            yield file


def write_lines(entries: Iterable[Entry], file: BinaryIO) -> None:
    """Entries as JSON Lines."""
    file.writelines(to_json(one) + b"\n" for one in entries)


def write_csv(entries: Iterable[Entry], file: BinaryIO) -> None:
    """Entries as rows; nested values have their path as column, as `mesh.faces_in`. Lists and
    booleans are JSON. An apostrophe precedes text that a spreadsheet would take for a formula."""
    text = io.TextIOWrapper(file, encoding="utf-8", newline="", write_through=True)
    rows = csv.DictWriter(_Rows(text), CSV_COLUMNS, extrasaction="ignore")
    rows.writeheader()
    rows.writerows(map(_row, entries))
    text.detach()


class _Rows:
    """Replaces the writer's line ends by line feeds. Before Python 3.13, a writer quotes a carriage
    return in a cell only if its line ends contain one."""

    def __init__(self, file: io.TextIOWrapper) -> None:
        self._file = file

    def write(self, row: str) -> None:
        """Write one whole row."""
        self._file.write(row.removesuffix("\r\n") + "\n")


def _row(found: Entry) -> dict[str, object]:
    row: dict[str, object] = {}
    for name, value in _plain(found).items():
        cells = value if isinstance(value, dict) else {"": value}
        row |= {f"{name}.{inner}".rstrip("."): _cell(one) for inner, one in cells.items()}
    return row


def _cell(value: object) -> object:
    if isinstance(value, str):
        return f"'{value}" if value.startswith(FORMULA) else value
    return json.dumps(value) if isinstance(value, list | bool) else value


def _plain(found: Entry) -> dict[str, Any]:
    return found.model_dump(mode="json", by_alias=True)


def write_parquet(entries: Iterable[Entry], file: BinaryIO) -> None:
    """Entries in columns, nested as they are. Needs pyarrow, of the extra `parquet`."""
    _write_columns(map(_plain, entries), _schema(), file)


def write_library(entries: Iterable[Entry], file: BinaryIO) -> None:
    """Entries in columns, with those that `service.library` reads; pictures are bytes."""
    import pyarrow as pa

    schema = _schema()
    for name, kind in (
        ("embedding", pa.list_(pa.float32())),
        ("space", pa.string()),
        ("radius", pa.float64()),
        ("chirality", pa.list_(pa.float64())),
        ("picture", pa.binary()),
    ):
        schema = schema.append(pa.field(name, kind))

    def row(found: Entry) -> dict[str, Any]:
        picture = getattr(found, "picture", None)
        return _plain(found) | {"picture": picture and base64.b64decode(picture)}

    _write_columns(map(row, entries), schema, file)


def _read_parquet(path: str, run: str) -> Iterator[Entry]:
    """The entries of a finished file. Raises NotWritten for one that this run did not write."""
    import pyarrow as pa
    from pyarrow.parquet import ParquetFile

    try:
        for batch in ParquetFile(path).iter_batches(ROW_GROUP):
            for row in batch.to_pylist():
                if row.get("picture"):
                    row["picture"] = base64.b64encode(row["picture"]).decode()
                found = as_entry(_without_nulls(row))
                check_run(found, run, path)
                yield found
    except NotWritten:
        raise
    except (pa.ArrowException, OSError, KeyError, ValueError):
        raise NotWritten(
            f"{path} is there already, and was not written by this command, or is damaged: name "
            "another file"
        ) from None


def _without_nulls(row: dict[str, Any]) -> dict[str, Any]:
    """A row without the columns, and the stages, that its entry does not have."""
    found = {name: cell for name, cell in row.items() if cell is not None}
    times = {stage: ms for stage, ms in found.pop("timings_ms", {}).items() if ms is not None}
    optional = {"unknown": None, "picture": None} if "error" not in found else {"sha256": None}
    return optional | found | {"timings_ms": times}


def _schema() -> "pa.Schema":
    import pyarrow as pa

    types = {int: pa.int64(), float: pa.float64(), bool: pa.bool_()}
    report = get_type_hints(MeshReport)
    score = {"class": pa.string(), "probability": pa.float64(), "score": pa.float64()}
    return pa.schema(
        {
            "file": pa.string(),
            "class": pa.string(),
            "probability": pa.float64(),
            "unknown": pa.bool_(),
            "novelty": pa.float64(),
            "scores": pa.list_(pa.struct(score)),
            "error": pa.struct({"fault": pa.string(), "message": pa.string()}),
            "model": pa.struct({"name": pa.string(), "sha256": pa.string()}),
            "mesh": pa.struct(
                {
                    field.name: types.get(report[field.name], pa.string())
                    for field in fields(MeshReport)
                }
            ),
            "timings_ms": pa.struct(dict.fromkeys(STAGES, pa.float64())),
            "sha256": pa.string(),
            "run": pa.string(),
        }
    )


def _write_columns(rows: Iterator[dict[str, Any]], schema: "pa.Schema", file: BinaryIO) -> None:
    import pyarrow as pa
    from pyarrow.parquet import ParquetWriter

    with ParquetWriter(file, schema, compression="zstd") as writer:
        while group := list(islice(rows, ROW_GROUP)):
            writer.write_table(pa.Table.from_pylist(group, schema))


FORMS: dict[str, Callable[[Iterable[Entry], BinaryIO], None]] = {
    "jsonl": write_lines,
    "csv": write_csv,
    "parquet": write_parquet,
}
