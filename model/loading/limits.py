"""How much of a file is read before it is refused."""

from dataclasses import dataclass

from model.errors import LimitExceeded


@dataclass(frozen=True)
class Limits:
    """The most that one file may hold; each count includes the limit itself.

    The defaults are far above what a real mesh needs, and keep what one file can cost in check:
    a million-face mesh takes seconds and under 2 GB.
    """

    vertices: int = 10_000_000
    faces: int = 10_000_000
    """Triangles, after polygons are split and instances placed."""
    geometries: int = 10_000
    """Placed parts of a scene: its nodes, build items and components together."""

    def check(self, what: str, count: int) -> None:
        """Raises LimitExceeded where there are more. what: the name of one of the fields."""
        most = getattr(self, what)
        if count > most:
            raise LimitExceeded(what, most, f"the file has {count} {what}")
