"""Zip archives, of which no more is unpacked than the limits allow."""

import struct
import zipfile
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO

from meshconv3d.model.errors import MalformedFile
from meshconv3d.model.loading.limits import Limits
from meshconv3d.model.loading.text import quoted

_BLOCK = 2**16  # bytes
_DIRECTORY_ENTRY = b"PK\x01\x02"
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
    """The files of an archive by their names, which are compared without case.

    Raises MalformedFile where the bytes are no whole archive, LimitExceeded where it has too many
    files.
    """

    def __init__(self, data: bytes, limits: Limits) -> None:
        limits.check("entries", data.count(_DIRECTORY_ENTRY))
        with _damage_told():
            self._zip = zipfile.ZipFile(BytesIO(data))
        self._entries = {normal(entry.filename): entry for entry in self._zip.infolist()}
        self._size = len(data)
        self._unpacked = 0
        self._limits = limits

    def __contains__(self, name: str) -> bool:
        return name in self._entries

    def read(self, name: str) -> Iterator[bytes]:
        """A file in small blocks. Raises MalformedFile and LimitExceeded."""
        entry = self._entries[name]
        if entry.flag_bits & 1 or entry.compress_type not in _PLAIN:
            raise MalformedFile(
                "unsupported-feature",
                f"{quoted(name)} is encrypted or packed by another method than deflate",
            )
        # zipfile gives no more than is declared here.
        self._unpacked += entry.file_size
        self._limits.check("unpacked_bytes", self._unpacked)
        self._limits.check("unpacked_bytes_per_byte", -(-self._unpacked // self._size))
        with _damage_told(), self._zip.open(entry) as file:
            while block := file.read(_BLOCK):
                yield block


def normal(path: str) -> str:
    """Names are compared without case, and from the root of the archive."""
    return path.replace("\\", "/").lstrip("/").lower()


@contextmanager
def _damage_told() -> Iterator[None]:
    try:
        yield
    except _DAMAGED as error:
        raise MalformedFile(
            "truncated",
            "the package is no whole zip archive; it is cut off or damaged, "
            "export or upload it again",
        ) from error
