"""Errors of meshes and models, which know nothing of HTTP or the command line."""


class Error(ValueError):
    """Base of all errors of a mesh or a model.

    The message says what was wrong, what was expected, and what to do.
    """


class MeshError(Error):
    """Error of one mesh, or of its file. fault: short stable code, as `"non-finite-vertices"`."""

    def __init__(self, fault: str, message: str) -> None:
        super().__init__(message)
        self.fault = fault

    def __reduce__(self) -> tuple[type, tuple]:
        # The default would rebuild from `args` alone and fail across process boundaries.
        return type(self), (self.fault, str(self))


class UnknownFormat(MeshError):
    """Error of a format that is not read, or that the name and the content disagree on."""


class MalformedFile(MeshError):
    """Error of bytes that cannot be read as the format that they claim to be."""


class UnusableMesh(MeshError):
    """Error of content that was read and is no mesh that can be classified."""


class LimitExceeded(MeshError):
    """Error of a file that holds more than is read. limit: its name; value: the most allowed."""

    def __init__(self, limit: str, value: int, found: str) -> None:
        super().__init__(
            f"too-many-{limit.replace('_', '-')}",
            f"{found}, more than the limit of {value}; simplify the mesh or split it up",
        )
        self.limit = limit
        self.value = value
        self._found = found

    def __reduce__(self) -> tuple[type, tuple]:
        return type(self), (self.limit, self.value, self._found)
