"""Library: the embeddings of many meshes in a Parquet file, and exact search among them.

`meshconv3d embed` writes such a file; any tool that reads Parquet can use it. Needs pyarrow, of the
extra `parquet`.
"""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, Self

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray
from pyarrow.parquet import ParquetFile

from meshconv3d.export.metadata import ModelCard
from meshconv3d.model.chirality import are_mirror_images
from meshconv3d.model.errors import Error

COLUMNS = ("file", "sha256", "class", "unknown", "radius", "chirality", "space", "mesh.faces_in")
# Rows that are compared with all others at a time.
BLOCK = 1024
# Sizes and face counts that differ by less are the same.
SAME_SIZE = 0.01


class LibraryError(Error):
    """Error of a file that is no library, or is one of another embedding space."""


def model_of(path: Path) -> str:
    """Name of the model that a library was made with. Raises LibraryError, OSError."""
    with _library_errors(path):
        for batch in ParquetFile(path).iter_batches(1000, columns=["model.name"]):
            for row in batch["model"].to_pylist():
                if row:
                    return row["name"]
    raise LibraryError(f"{path} holds no mesh; add some with: meshconv3d embed")


@contextmanager
def _library_errors(path: Path) -> Iterator[None]:
    """Within it, errors of a file that is damaged, or no library, are LibraryErrors."""
    try:
        yield
    except (pa.ArrowInvalid, KeyError, ValueError) as error:
        raise LibraryError(
            f"{path} is no library of meshes, or damaged ({str(error).splitlines()[0]}); make one "
            f"with: meshconv3d embed PATH... -o {path}"
        ) from None
    except OSError as error:
        if error.errno is not None:
            raise
        raise LibraryError(f"{path} is damaged: make it again with meshconv3d embed") from None


class Match(NamedTuple):
    """A mesh of the library that is like another: its row, the distance of the embeddings, 0 to 2,
    and the calibrated probability that both are of one shape, None where the model has none."""

    row: int
    distance: float
    probability: float | None


@dataclass(frozen=True, eq=False)
class Library:
    """The meshes of a library: N rows, of those that could be classified.

    embeddings: N x A float32. card: of a model with the same embedding space.
    """

    path: Path
    table: pa.Table
    embeddings: NDArray[np.float32]
    card: ModelCard

    @classmethod
    def read(cls, path: Path, cards: Iterable[ModelCard]) -> Self:
        """Read a library that was made with one of these models, or with one that shares its
        embedding space. Raises LibraryError, OSError."""
        with _library_errors(path):
            table = ParquetFile(path).read([*COLUMNS, "embedding"])
            # Numbered before other rows go, to find their pictures again.
            table = table.append_column("row", pa.array(range(len(table))))
            # A file that has changed since has a later row.
            latest = dict(zip(table["file"].to_pylist(), range(len(table)), strict=True))
            table = table.take(sorted(latest.values()))
            table = table.filter(table["embedding"].is_valid())
        if not len(table):
            raise LibraryError(f"{path} holds no mesh; add some with: meshconv3d embed")
        spaces = table["space"].unique().to_pylist()
        card = next((card for card in cards if spaces == [card.space]), None)
        if card is None:
            raise LibraryError(
                f"{path} was made with another model, whose embeddings cannot be compared with "
                "those of this one: name that model, or make the library again"
            )
        column = table["embedding"].combine_chunks()
        embeddings = column.flatten().to_numpy().reshape(len(table), -1)
        return cls(path, table.drop(["embedding"]), embeddings, card)

    def __len__(self) -> int:
        return len(self.table)

    def value(self, name: str, row: int) -> Any:
        """Value of a column in one row."""
        return self.table[name][row].as_py()

    def nearest(self, embedding: NDArray[np.float32], count: int) -> list[Match]:
        """The `count` meshes that are most alike, the nearest first; exact."""
        cosines = self.embeddings @ embedding
        rows = np.argsort(-cosines, kind="stable")[:count]
        probabilities = [None] * len(rows)
        calibration = self.card.calibration
        if calibration and calibration.same_shape:
            probabilities = calibration.same_shape_probability(cosines[rows]).tolist()
        distances = np.sqrt(np.maximum(2 - 2 * cosines[rows].astype(np.float64), 0))
        return [
            Match(*each)
            for each in zip(rows.tolist(), distances.tolist(), probabilities, strict=True)
        ]

    def pictures(self, rows: Sequence[int]) -> list[bytes | None]:
        """PNG of each row, where pictures were drawn."""
        stored = [self.value("row", row) for row in rows]
        file = ParquetFile(self.path)
        if "picture" not in file.schema_arrow.names:
            return [None] * len(rows)
        sizes = [file.metadata.row_group(i).num_rows for i in range(file.num_row_groups)]
        starts = np.concatenate([[0], np.cumsum(sizes)])
        groups = np.searchsorted(starts, stored, side="right") - 1
        found: dict[int, bytes | None] = {}
        for group in np.unique(groups).tolist():
            column = file.read_row_group(group, ["picture"])["picture"]
            for row in (row for row, own in zip(stored, groups, strict=True) if own == group):
                found[row] = column[row - int(starts[group])].as_py()
        return [found[row] for row in stored]

    def duplicates(self, least: float) -> list[list[int]]:
        """Groups of rows that are of one shape with at least this probability, largest first.
        Raises LibraryError where the model has no calibration for it.

        Each mesh belongs to the group of the first mesh that it is alike; so no chain of small
        differences joins shapes that differ.
        """
        calibration = self.card.calibration
        if calibration is None or calibration.same_shape is None:
            raise LibraryError(
                f"the model {self.card.name} has no calibrated probability that meshes are of one "
                "shape; name the one that it was taught on, or one with validation meshes"
            )
        cosine = calibration.same_shape_cosine(least)
        hashes = self.table["sha256"].combine_chunks().dictionary_encode()
        # The same file is the same shape, however cautious the calibration is.
        owner = _first_of_each(hashes.indices.to_numpy())
        for first, rows in self._alike(cosine):
            free = owner[rows] == rows
            if owner[first] == first:
                owner[rows[free]] = first
        owner = owner[owner]  # of copies of a file that has joined another group
        groups: dict[int, list[int]] = {}
        for row, first in enumerate(owner.tolist()):
            groups.setdefault(first, []).append(row)
        return sorted((g for g in groups.values() if len(g) > 1), key=len, reverse=True)

    def _alike(self, cosine: float) -> Iterator[tuple[int, NDArray[np.int64]]]:
        """For each row, the later rows with at least this cosine."""
        for start in range(0, len(self), BLOCK):
            cosines = self.embeddings[start : start + BLOCK] @ self.embeddings[start:].T
            for place, row in enumerate(cosines):
                alike = np.flatnonzero(row[place + 1 :] >= cosine)
                yield start + place, alike + start + place + 1

    def relation(self, first: int, second: int) -> str:
        """How the second mesh differs from the first, in words."""
        if self.value("sha256", first) == self.value("sha256", second):
            return "same file"
        found = []
        sizes = [self.value("radius", row) for row in (first, second)]
        if abs(sizes[1] / sizes[0] - 1) > SAME_SIZE:
            found.append(f"{sizes[1] / sizes[0]:.3g} times as large")
        hands = [np.array(self.value("chirality", row)) for row in (first, second)]
        if are_mirror_images(*hands):
            found.append("mirrored")
        faces = [self.value("mesh", row)["faces_in"] for row in (first, second)]
        if abs(faces[1] / faces[0] - 1) > SAME_SIZE:
            found.append(f"{faces[1]:,} faces for {faces[0]:,}")
        return ", ".join(found) or "same shape"


def _first_of_each(numbers: NDArray[np.int64]) -> NDArray[np.int64]:
    """The first row with the number of each row."""
    _, first, inverse = np.unique(numbers, return_index=True, return_inverse=True)
    return first[inverse]
