"""The table of the formats that are read, and how a file's format is decided.

A format is a module with its reader, and a row of this table.
"""

import re
from codecs import BOM_UTF8
from collections.abc import Callable
from dataclasses import dataclass

from meshconv3d.model.errors import MalformedFile, UnknownFormat
from meshconv3d.model.loading.archive import is_3mf, is_zip
from meshconv3d.model.loading.gltf import read_glb, read_gltf
from meshconv3d.model.loading.obj import read_obj
from meshconv3d.model.loading.off import read_off
from meshconv3d.model.loading.ply import read_ply
from meshconv3d.model.loading.stl import is_exact_binary, read_stl
from meshconv3d.model.loading.text import quoted
from meshconv3d.model.loading.threemf import read_3mf
from meshconv3d.model.loading.triangles import NotedTriangles, Triangles


@dataclass(frozen=True)
class Format:
    """One format that is read.

    extension: its file extension, in small letters, without a dot; its key in FORMATS.
    title: its name for people.
    media_types: media types that declare it, the preferred one first.
    notes: what of it is read, for people.
    read: makes triangles of the bytes of a file within Limits, and where `in_pieces` of the other
        files that it refers to, by their relative paths. An archive has none: its files are read.
    in_pieces: whether such files may lie beside it.
    """

    extension: str
    title: str
    media_types: tuple[str, ...]
    notes: str
    read: Callable[..., Triangles | NotedTriangles]
    in_pieces: bool = False

    def to_dict(self) -> dict[str, str | list[str]]:
        """What is to be told of it."""
        return {
            "format": self.title,
            "extension": self.extension,
            "media_types": list(self.media_types),
            "notes": self.notes,
        }


def _no_triangles(*_: object) -> Triangles:
    raise ValueError("an archive has no triangles of its own")


ARCHIVE = Format(
    "zip",
    "ZIP archive",
    ("application/zip", "application/x-zip-compressed"),
    "one mesh; several in a batch",
    _no_triangles,
)

FORMATS: dict[str, Format] = {
    known.extension: known
    for known in (
        Format("obj", "Wavefront OBJ", ("model/obj",), "faces; materials are ignored", read_obj),
        Format(
            "off",
            "Object File Format",
            ("model/off", "model/vnd.off"),
            "text and binary, of 3-D",
            read_off,
        ),
        Format(
            "stl",
            "STL",
            (
                "model/stl",
                "model/x.stl-binary",
                "model/x.stl-ascii",
                "application/sla",
                "application/vnd.ms-pki.stl",
            ),
            "binary and text",
            read_stl,
        ),
        Format(
            "ply", "Stanford PLY", ("model/ply", "application/ply"), "binary and text", read_ply
        ),
        Format(
            "glb",
            "binary glTF",
            ("model/gltf-binary",),
            "1.0 and 2.0, with Draco, meshopt, skins and instances",
            read_glb,
            in_pieces=True,
        ),
        Format(
            "gltf",
            "glTF",
            ("model/gltf+json",),
            "as binary glTF; with the .bin files beside it",
            read_gltf,
            in_pieces=True,
        ),
        Format(
            "3mf",
            "3MF",
            ("model/3mf", "application/vnd.ms-package.3dmanufacturing-3dmodel+xml"),
            "without the modifier volumes of slicers",
            read_3mf,
        ),
        ARCHIVE,
    )
}

# Formats whose first bytes are fixed: what begins otherwise is not one of them.
_MARKED = frozenset({"ply", "glb", "gltf", "3mf", "zip"})

_SNIFFED = 2**20  # bytes
_OFF = re.compile(rb"(?:\s*#[^\r\n]*[\r\n])*\s*(?:ST)?C?N?4?n?OFF(?:\b|(?=\d))")
_OBJ = re.compile(rb"^[ \t]*v[ \t]+[-+.\d]", re.MULTILINE)


def detect_format(data: bytes, declared: str | None) -> Format:
    """The format of `data`, decided from its content and its declared name together.

    declared: a file name ("cup.STL") or an extension ("stl", ".stl"); with None the content
        alone decides. A word without a dot is taken as an extension.

    Raises UnknownFormat when the extension is not one that is read, when name and content
    contradict each other, or when there is no name and the content fits no format; MalformedFile
    when there are no bytes at all.
    """
    if not data:
        raise MalformedFile("empty-file", "the file is empty (0 bytes); export it again")
    content = _sniff(data)
    if content == "zip" and (_extension(declared or "") == "3mf" or is_3mf(data)):
        content = "3mf"
    if not declared:
        if content is None:
            raise UnknownFormat(
                "unknown-format",
                f"the content fits none of the formats that are read ({_listed()}); "
                "if it is one of them, give its file name too",
            )
        return FORMATS[content]
    extension = _extension(declared)
    if extension not in FORMATS:
        raise UnknownFormat(
            "unknown-format",
            f"{quoted(declared)} does not name a format that is read; "
            f"convert the mesh to one of these: {_listed()}",
        )
    if content == "3mf" and extension == "zip":
        return FORMATS[content]  # a browser may have named it so
    if content != extension and (content is not None or extension in _MARKED):
        found = f"is {FORMATS[content].title} ({content})" if content else "is something else"
        raise UnknownFormat(
            "format-mismatch",
            f"the file is declared as {extension} ({quoted(declared)}), but its content {found}; "
            "correct the file name, or export the mesh again",
        )
    return FORMATS[extension]


def _sniff(data: bytes) -> str | None:
    """The extension of the format that the content is certainly in, or None."""
    if is_exact_binary(data):
        # First, since the 80 bytes of a binary STL's header may spell anything.
        return "stl"
    if data.startswith(b"glTF"):
        return "glb"
    if is_zip(data):
        return "zip"
    text = data[:_SNIFFED].removeprefix(BOM_UTF8)
    if re.match(rb"ply\s", text):
        return "ply"
    start = text[:256].lstrip()
    if start.startswith(b"{"):
        return "gltf"
    if start[:5].lower() == b"solid":
        return "stl"
    if _OFF.match(text):
        return "off"
    if b"\0" not in text[:4096].rstrip(b"\0") and (_OBJ.search(text) or _old_mac_obj(text)):
        return "obj"
    return None


def _extension(declared: str) -> str:
    return declared.rpartition(".")[2].strip().lower()


def _old_mac_obj(text: bytes) -> bool:
    """Whether this is OBJ with lines that end in a lone CR, which a regex's ^ does not see."""
    return b"\n" not in text and _OBJ.search(text.replace(b"\r", b"\n")) is not None


def _listed() -> str:
    return ", ".join(FORMATS)
