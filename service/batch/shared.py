"""Files of this machine that other machines see by the same path."""

import os
import socket
from dataclasses import dataclass, replace
from pathlib import Path

from meshconv3d.service.batch.local import LocalFile


@dataclass(frozen=True)
class SharedFile:
    """A local file on its way to whichever machine reads it. file: with its whole path, since
    the other has another current folder. host: where it was listed."""

    name: str
    file: LocalFile
    host: str

    @classmethod
    def of(cls, file: LocalFile) -> "SharedFile":
        """As it is sent by the machine that listed it."""
        whole = os.path.join(os.getcwd(), file.path)
        return cls(file.name, replace(file, path=whole), socket.gethostname())

    @property
    def below(self) -> str:
        return self.file.below

    @property
    def declared(self) -> str | None:
        return self.file.declared

    @property
    def local(self) -> Path:
        return self.file.local

    def size(self) -> int:
        return self.file.size()

    def read(self) -> bytes:
        """All of it. Raises OSError, which says so if another machine has the file and this one
        has not."""
        try:
            return self.file.read()
        except FileNotFoundError as error:
            here = socket.gethostname()
            if here == self.host:
                raise
            raise FileNotFoundError(
                error.errno,
                f"{self.host} has it and {here} has not; put the files where every machine of the "
                "cluster sees them by the same path, or name them by URLs",
            ) from None
