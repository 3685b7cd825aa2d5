"""ZIP archives, of which no more is unpacked than the limits allow."""

import struct
import zipfile
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from io import BytesIO
from typing import BinaryIO

from meshconv3d.model.errors import MalformedFile, MeshError
from meshconv3d.model.loading.limits import Limits
from meshconv3d.model.loading.text import quoted

_BLOCK = 2**16  # bytes
_PLAIN = (zipfile.ZIP_STORED, zipfile.ZIP_DEFLATED)
# What damaged bytes make zipfile raise.
_DAMAGED = (
    zipfile.BadZipFile,
    zlib.error,
    struct.error,
    EOFError,
    IndexError,
    NotImplementedError,
    OSError,
    OverflowError,
    ValueError,
)


class Archive:
    """The files of an archive.

    source: its bytes, or a file that is open for reading and stays open.
    path_of: makes the path by which a file is known of the one that is written.
    names: these paths.

    Raises MalformedFile where it is no whole archive, LimitExceeded where it has too many files.
    """

    def __init__(
        self, source: bytes | BinaryIO, limits: Limits, path_of: Callable[[str], str] = str
    ) -> None:
        file = BytesIO(source) if isinstance(source, bytes) else source
        self._size = file.seek(0, 2)
        self._limits = limits
        self._unpacked = 0
        bounded = _BoundedReads(file, limits)
        with _damage_told():
            self._zip = zipfile.ZipFile(bounded)  # type: ignore[arg-type]
        bounded.opening = False
        entries = [entry for entry in self._zip.infolist() if not entry.is_dir()]
        limits.check("entries", len(entries))
        self._entries: dict[str, list[zipfile.ZipInfo]] = {}
        for entry in entries:
            self._entries.setdefault(path_of(entry.filename), []).append(entry)
        self.names = list(self._entries)

    def __contains__(self, name: str) -> bool:
        return name in self._entries

    def size(self, name: str) -> int:
        """Bytes of a file, as the archive declares it."""
        return self._entries[name][0].file_size

    def content(self, name: str) -> bytes:
        """A whole file, bounded by itself. Raises MalformedFile and LimitExceeded."""
        entry = self._entry(name)
        self._check(entry.file_size, entry.compress_size)
        return b"".join(self._unpack(entry))

    def blocks(self, name: str) -> Iterator[bytes]:
        """A file in small pieces, bounded together with those before it.

        Raises MalformedFile and LimitExceeded.
        """
        entry = self._entry(name)
        self._unpacked += entry.file_size
        self._check(self._unpacked, self._size)
        return self._unpack(entry)

    def _entry(self, name: str) -> zipfile.ZipInfo:
        entry, *others = self._entries[name]
        if others:
            raise MalformedFile(
                "repeated-name",
                f"the ZIP archive holds several files named {quoted(name)}; pack it again, "
                "with a name of its own for each",
            )
        return entry

    def _check(self, unpacked: int, packed: int) -> None:
        # zipfile gives no more than is declared.
        self._limits.check("unpacked_bytes", unpacked)
        self._limits.check("unpacked_bytes_per_byte", -(-unpacked // max(packed, 1)))

    def _unpack(self, entry: zipfile.ZipInfo) -> Iterator[bytes]:
        if entry.flag_bits & 1 or entry.compress_type not in _PLAIN:
            raise MalformedFile(
                "unsupported-feature",
                f"{quoted(entry.filename)} is encrypted or packed by another method than deflate",
            )
        with _damage_told(), self._zip.open(entry) as file:
            while block := file.read(_BLOCK):
                yield block


def is_zip(data: bytes) -> bool:
    """Whether the bytes begin as a ZIP archive does."""
    return data.startswith((b"PK\x03\x04", b"PK\x05\x06"))


def packed_format(data: bytes) -> str:
    """The extension of the format that a ZIP archive is in: 3mf, amf, usdz, or zip."""
    try:
        names = [name.lower() for name in Archive(data, Limits()).names]
    except MeshError:
        return "zip"
    if any(name.endswith(".model") for name in names):
        return "3mf"
    if names and names[0].endswith((".usd", ".usda", ".usdc")):
        return "usdz"
    return "amf" if len(names) == 1 and names[0].endswith(".amf") else "zip"


class _BoundedReads:
    """A file whose list of entries must not be larger than the limits allow: zipfile reads it at
    once when it opens an archive, and takes many times as long for it as for its bytes."""

    def __init__(self, file: BinaryIO | BytesIO, limits: Limits) -> None:
        self.opening = True
        self.seek, self.tell, self._file, self._limits = file.seek, file.tell, file, limits

    def read(self, size: int = -1) -> bytes:
        if self.opening:
            self._limits.check("directory_bytes", size)
        return self._file.read(size)

    def seekable(self) -> bool:
        return True


@contextmanager
def _damage_told() -> Iterator[None]:
    try:
        yield
    except MeshError:
        raise
    except _DAMAGED as error:
        raise MalformedFile(
            "truncated",
            "the package is no whole zip archive; it is cut off or damaged, "
            "export or upload it again",
        ) from error
