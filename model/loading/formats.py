"""The formats that are read, and how a file's format is decided."""

import re
from codecs import BOM_UTF8
from dataclasses import dataclass

from meshconv3d.model.errors import MalformedFile, UnknownFormat
from meshconv3d.model.loading.stl import is_exact_binary
from meshconv3d.model.loading.text import quoted


@dataclass(frozen=True)
class Format:
    """One format that is read.

    extension: its file extension, lower case, without a dot; the format's key in FORMATS.
    title: its name for people.
    media_types: media types that declare it, the preferred one first.
    """

    extension: str
    title: str
    media_types: tuple[str, ...]


FORMATS: dict[str, Format] = {
    known.extension: known
    for known in (
        Format("obj", "Wavefront OBJ", ("model/obj",)),
        Format("off", "Object File Format", ("model/off", "model/vnd.off")),
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
        ),
        Format("ply", "Stanford PLY", ("model/ply", "application/ply")),
        Format("glb", "binary glTF 2.0", ("model/gltf-binary",)),
        Format("gltf", "glTF 2.0", ("model/gltf+json",)),
        Format(
            "3mf",
            "3MF",
            ("model/3mf", "application/vnd.ms-package.3dmanufacturing-3dmodel+xml"),
        ),
    )
}

# Formats whose first bytes are fixed: what begins otherwise is not one of them.
_MARKED = frozenset({"ply", "glb", "gltf", "3mf"})

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
    if not declared:
        if content is None:
            raise UnknownFormat(
                "unknown-format",
                f"the content fits none of the formats that are read ({_listed()}); "
                "if it is one of them, give its file name too",
            )
        return FORMATS[content]
    extension = declared.rpartition(".")[2].strip().lower()
    if extension not in FORMATS:
        raise UnknownFormat(
            "unknown-format",
            f"{quoted(declared)} does not name a format that is read; "
            f"convert the mesh to one of these: {_listed()}",
        )
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
    if data.startswith((b"PK\x03\x04", b"PK\x05\x06")):
        return "3mf"
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


def _old_mac_obj(text: bytes) -> bool:
    """Whether this is OBJ with lines that end in a lone CR, which a regex's ^ does not see."""
    return b"\n" not in text and _OBJ.search(text.replace(b"\r", b"\n")) is not None


def _listed() -> str:
    return ", ".join(FORMATS)
