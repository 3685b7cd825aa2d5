"""The table of the formats that are read, and how a file's format is decided.

A format is a module with its reader, and a row of this table.
"""

import re
from codecs import BOM_UTF8
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from importlib.util import find_spec

from meshconv3d.model.errors import MalformedFile, MeshError, UnknownFormat
from meshconv3d.model.loading.amf import read_amf
from meshconv3d.model.loading.archive import is_zip, packed_format
from meshconv3d.model.loading.converters import convert
from meshconv3d.model.loading.gltf import read_glb, read_gltf
from meshconv3d.model.loading.obj import read_obj
from meshconv3d.model.loading.off import read_off
from meshconv3d.model.loading.ply import read_ply
from meshconv3d.model.loading.stl import is_exact_binary, read_stl
from meshconv3d.model.loading.text import quoted
from meshconv3d.model.loading.threemf import read_3mf
from meshconv3d.model.loading.triangles import NotedTriangles, Triangles

EXTRA = "formats"


@dataclass(frozen=True)
class FormatRow:
    """Row of the table of formats for people and programs; see `Format`."""

    format: str
    extension: str
    aliases: list[str]
    media_types: list[str]
    notes: str
    missing_extra: str | None


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
    aliases: further file extensions.
    library: what reading it imports, of the extra EXTRA; None where no extra is needed.
    """

    extension: str
    title: str
    media_types: tuple[str, ...]
    notes: str
    read: Callable[..., Triangles | NotedTriangles]
    in_pieces: bool = False
    aliases: tuple[str, ...] = ()
    library: str | None = None

    @property
    def missing_extra(self) -> str | None:
        """The extra without which this installation does not read it, if it is one."""
        return EXTRA if self.library and find_spec(self.library) is None else None

    @property
    def row(self) -> FormatRow:
        """The row of the table."""
        return FormatRow(
            format=self.title,
            extension=self.extension,
            aliases=list(self.aliases),
            media_types=list(self.media_types),
            notes=self.notes,
            missing_extra=self.missing_extra,
        )


def _no_triangles(*_: object) -> Triangles:
    raise ValueError("an archive has no triangles of its own")


ARCHIVE = Format(
    "zip",
    "ZIP archive",
    ("application/zip", "application/x-zip-compressed"),
    "one mesh; several in a batch",
    _no_triangles,
)

TABLE: dict[str, Format] = {
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
        Format(
            "amf",
            "AMF",
            ("application/x-amf",),
            "with constellations; without the modifier volumes of slicers",
            read_amf,
        ),
        Format(
            "step",
            "STEP",
            ("model/step", "application/step"),
            "solids and shells",
            partial(convert, "step"),
            aliases=("stp",),
            library="cascadio",
        ),
        Format(
            "fbx",
            "FBX",
            ("model/fbx", "application/vnd.autodesk.fbx"),
            "meshes at rest, with skins and blend shapes",
            partial(convert, "fbx"),
            library="ufbx",
        ),
        Format(
            "dae",
            "COLLADA",
            ("model/vnd.collada+xml",),
            "meshes; skinned ones as they are bound",
            partial(convert, "dae"),
            library="collada",
        ),
        Format(
            "usdz",
            "USD",
            ("model/vnd.usdz+zip", "model/vnd.usd", "model/vnd.usda", "model/vnd.usdc"),
            "meshes, with instances, at the first time",
            partial(convert, "usd"),
            aliases=("usd", "usda", "usdc"),
            library="pxr",
        ),
        ARCHIVE,
    )
}
# What this installation reads.
FORMATS = {name: known for name, known in TABLE.items() if known.missing_extra is None}
_BY_ALIAS = {name: known for known in TABLE.values() for name in (known.extension, *known.aliases)}

# Formats whose first bytes are fixed: what begins otherwise is not one of them.
_MARKED = frozenset(["ply", "glb", "gltf", "3mf", "amf", "step", "fbx", "dae", "usdz", "zip"])

_SNIFFED = 2**20  # bytes
_STARTS = 4096  # bytes before the root of XML
_OFF = re.compile(rb"(?:\s*#[^\r\n]*[\r\n])*\s*(?:ST)?C?N?4?n?OFF(?:\b|(?=\d))")
_XML = re.compile(rb"<(amf|COLLADA)[\s>]")
_FBX = re.compile(rb"Kaydara FBX Binary|\s*; ?FBX|(?s:.{0,2000}?)\bFBXHeaderExtension\s*:")
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
    known = named_format(_extension(declared)) if declared else None
    if content == "zip":
        content = packed_format(data)
        if content == "zip" and known is TABLE["3mf"]:
            content = "3mf"
    if not declared:
        if content is None:
            raise UnknownFormat(
                "unknown-format",
                f"the content fits none of the formats that are read ({_listed()}); "
                "if it is one of them, give its file name too",
            )
        return _installed(TABLE[content])
    if known is None:
        raise UnknownFormat(
            "unknown-format",
            f"{quoted(declared)} does not name a format that is read; "
            f"convert the mesh to one of these: {_listed()}",
        )
    extension = _installed(known).extension
    if content is not None and extension == "zip" and is_zip(data):
        return _installed(TABLE[content])  # a browser may have named it so
    if content != extension and (content is not None or extension in _MARKED):
        found = f"is {TABLE[content].title} ({content})" if content else "is something else"
        raise UnknownFormat(
            "format-mismatch",
            f"the file is declared as {extension} ({quoted(declared)}), but its content {found}; "
            "correct the file name, or export the mesh again",
        )
    return known


def is_archive(data: bytes, declared: str | None) -> bool:
    """Whether `data` is an archive of mesh files, or a damaged one."""
    try:
        return detect_format(data, declared) is ARCHIVE
    except MeshError:
        return False


def named_format(extension: str) -> Format | None:
    """The format of a file extension, in small letters, whether it is installed or not."""
    return _BY_ALIAS.get(extension)


def _installed(known: Format) -> Format:
    """The format, if it is read. Raises UnknownFormat, which names the extra."""
    if known.missing_extra is None:
        return known
    raise UnknownFormat(
        "unknown-format",
        f"{known.title} is read where meshconv3d is installed with an extra, "
        f"pip install 'meshconv3d[{known.missing_extra}]'; or convert the mesh to one of these: "
        f"{_listed()}",
    )


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
    if start.startswith(b"ISO-10303-21"):
        return "step"
    if start.startswith(b"<") and (found := _XML.search(text, 0, _STARTS)):
        return "amf" if found[1] == b"amf" else "dae"
    if start.startswith((b"PXR-USDC", b"#usda")):
        return "usdz"
    if _FBX.match(text):
        return "fbx"
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
