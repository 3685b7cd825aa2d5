"""How much of a file is read before it is refused."""

from dataclasses import dataclass

from meshconv3d.model.errors import LimitExceeded


@dataclass(frozen=True)
class Limits:
    """The most that one file may hold; each count includes the limit itself.

    What the bytes declare is compared with the limits before anything of that size is made.
    The defaults are far above what a real mesh needs, and keep what one file can cost in check:
    a million-face mesh takes seconds and under 2 GB.
    """

    vertices: int = 10_000_000
    """Where instances are placed, each with its own; an STL has three for each triangle."""
    faces: int = 10_000_000
    """Triangles, after polygons are split and instances placed."""
    geometries: int = 10_000
    """Placed parts of a scene: its nodes, build items and components together.

    It bounds the depth of a scene too, which is walked without recursion.
    """
    repeated_faces: int = 1_000_000
    """Triangles that the parts of a scene have where they are placed once more."""
    instances: int = 250_000
    """Instances of a glTF file's meshes."""
    values: int = 2_000_000
    """Values in the JSON of a glTF file, where each becomes an object in memory."""
    tag_bytes: int = 2**20
    """Bytes of one tag of XML."""
    ear_steps: int = 10**9
    """Comparisons by which concave polygons are cut, 3 to 8 N^2 for one of N corners.

    About a second's work: one polygon of 11 000 to 18 000 corners, or any number of small ones.
    """
    entries: int = 10_000
    """Files in an archive, read or not; other files that one file names."""
    directory_bytes: int = 2**21
    """Bytes of the list of an archive's files."""
    piece_bytes: int = 2**29
    """Bytes of the other files in which a .gltf keeps its buffers, together."""
    unpacked_bytes: int = 2**29
    """Bytes that the files of an archive which are read unpack to, together.

    Eight million triangles; a tenth of a second of reading for each MiB, where every tag is empty.
    """
    unpacked_bytes_per_byte: int = 50
    """How many times the archive's own size that may be. XML of a mesh packs to a fourth or, with
    few digits, a sixteenth; of a lattice of equal cubes to a 37th."""

    converter_seconds: int = 25
    """Seconds in which a library of the extra `formats` reads a file."""

    def check(self, what: str, count: int, found: str | None = None) -> None:
        """Raises LimitExceeded where there are more.

        what: the name of one of the fields.
        found: what was found, as the beginning of a sentence; with None, `count` of it.
        """
        most = getattr(self, what)
        if count > most:
            found = found or f"the file has {count} {what.replace('_', ' ')}"
            raise LimitExceeded(what, most, found)
