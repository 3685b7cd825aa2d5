"""What can be wrong with a mesh, as values that know nothing of HTTP or the command line."""


class MeshError(ValueError):
    """Something is wrong with one mesh or its file; the message says what, and what to do.

    `fault` is a short stable slug for programs, as `"non-finite-vertices"`; the message is for
    people.
    """

    def __init__(self, fault: str, message: str) -> None:
        super().__init__(message)
        self.fault = fault

    def __reduce__(self) -> tuple[type, tuple]:
        # The default would rebuild from `args` alone and fail across process boundaries.
        return type(self), (self.fault, str(self))


class UnknownFormat(MeshError):
    """The format is not one that is read, or the name and the content disagree."""


class MalformedFile(MeshError):
    """The bytes cannot be read as the format that they claim to be."""


class UnusableMesh(MeshError):
    """The file was read, but what it holds is no mesh that can be classified."""


class LimitExceeded(MeshError):
    """The file holds more than is read. `limit` names the limit, `value` is what it is."""

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
