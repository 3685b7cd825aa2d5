"""Hostile 3MF."""

import struct
import zipfile
from io import BytesIO

from tests.hostile.catalogue import Catalogue, replaced
from tests.model.loading import loading_builders as build

FILES = Catalogue("box.3mf")

_ROOT = "3D/3dmodel.model"
_MODEL = build.model_xml(build.mesh_xml())
_PACKAGE = build.threemf()
_ITEM = '<item objectid="1"/>'


def _add(title: str, fault: str | None, model: str | bytes) -> None:
    """A package of one part."""
    FILES.add(title, lambda: _package(model), fault)


def _package(model: str | bytes, method: int = zipfile.ZIP_DEFLATED, name: str = _ROOT) -> bytes:
    stream = BytesIO()
    with zipfile.ZipFile(stream, "w", method) as package:
        package.writestr(name, model)
    return stream.getvalue()


def _changed(old: str, new: str) -> str:
    return replaced(_MODEL.encode(), old.encode(), new.encode()).decode()


def _group(identifier: int, components: str) -> str:
    return f'<object id="{identifier}"><components>{components}</components></object>'


def _component(identifier: int) -> str:
    return f'<component objectid="{identifier}"/>'


def _transformed(transform: str) -> str:
    return build.model_xml(build.mesh_xml(), f'<item objectid="1" transform="{transform}"/>')


# The archive
for _title, _end in {
    "first header": 20,
    "data": 60,
    "directory": _PACKAGE.index(b"PK\1\2") + 20,
    "end": len(_PACKAGE) - 4,
}.items():
    FILES.add(f"cut in the {_title}", _PACKAGE[:_end], "truncated")
_directory = _PACKAGE.index(b"PK\1\2")
FILES.add(
    "a size that lies",
    _PACKAGE[: _directory + 24] + struct.pack("<I", 50) + _PACKAGE[_directory + 28 :],
    "truncated",
)
FILES.add(
    "a size of 4 GB",
    _PACKAGE[: _directory + 24] + b"\xfe\xff\xff\xff" + _PACKAGE[_directory + 28 :],
    "too-many-unpacked-bytes",
)
FILES.add("damaged data", _PACKAGE[:80] + bytes(20) + _PACKAGE[100:], "truncated")
FILES.add(
    "an offset past the end",
    _PACKAGE[: _directory + 42] + b"\xf0\xff\xff\xff" + _PACKAGE[_directory + 46 :],
    "truncated",
)
FILES.add(
    "encrypted",
    _PACKAGE[: _directory + 8] + b"\1" + _PACKAGE[_directory + 9 :],
    "unsupported-feature",
)
FILES.add("packed by bzip2", _package(_MODEL, zipfile.ZIP_BZIP2), "unsupported-feature")
FILES.add("packed by LZMA", _package(_MODEL, zipfile.ZIP_LZMA), "unsupported-feature")
FILES.add("an empty archive", b"PK\5\6" + bytes(18), "bad-header")
FILES.add("no model", _package("hello", name="letter.txt"), "bad-header")
FILES.add(
    "names of other folders", build.threemf({"../../evil": "x", "/abs": "y", _ROOT: _MODEL}), None
)
FILES.add(
    "20 000 entries",
    lambda: build.threemf({str(number): "" for number in range(20_000)} | {_ROOT: _MODEL}),
    "too-many-entries",
)
FILES.add(
    "a bomb of spaces",
    lambda: _package(_MODEL.replace("<build>", " " * 40_000_000 + "<build>")),
    "too-many-unpacked-bytes-per-byte",
)
FILES.add(
    "a bomb that is not read",
    lambda: build.threemf({"Metadata/thumbnail.png": "\0" * 20_000_000, _ROOT: _MODEL}),
    None,
)


def _extra_fields(size: int, entries: int) -> bytes:
    """Entries of so many bytes of empty extra fields each, in the list of the archive's files."""
    stream = BytesIO()
    with zipfile.ZipFile(stream, "w") as package:
        package.writestr(_ROOT, _MODEL)
        for number in range(entries):
            entry = zipfile.ZipInfo(str(number))
            package.writestr(entry, b"")
            entry.extra = b"\xfe\xca\0\0" * (size // 4)  # after its own header is written
    return stream.getvalue()


FILES.add("98 MB of extra fields", lambda: _extra_fields(65_000, 1500), "too-many-directory-bytes")
FILES.add("2 MB of extra fields", lambda: _extra_fields(65_000, 30), None)
FILES.add(
    "70 000 entries",
    lambda: build.archive({str(number): "" for number in range(70_000)}),
    "too-many-directory-bytes",
    "box.zip",
)


def _overlapping() -> bytes:
    """2000 entries that all are the same bytes."""
    archive = build.archive({"0000.stl": bytes(1_000_000)})
    start, stop = archive.index(b"PK\1\2"), archive.index(b"PK\5\6")
    entry = archive[start:stop]
    entries = b"".join(entry.replace(b"0000.stl", b"%04d.stl" % n) for n in range(2000))
    counts = struct.pack("<2HI", 2000, 2000, len(entries))
    return archive[:start] + entries + archive[stop : stop + 8] + counts + archive[stop + 16 :]


FILES.add("2000 entries over the same bytes", _overlapping, "several-meshes", "box.zip")

# XML
_add("no XML", "bad-document", "hello")
_add("no model part", "bad-header", "<other/>")
_add("XML cut off", "bad-document", _MODEL[:-20])
_add("an empty part", "bad-document", "")
_add("a document type", "bad-header", _changed("?>", "?><!DOCTYPE model>"))
_add(
    "an entity of a file",
    "bad-header",
    _changed("?>", '?><!DOCTYPE model [<!ENTITY a SYSTEM "file:///etc/passwd">]>'),
)
_add(
    "a type at an address",
    "bad-header",
    _changed("?>", '?><!DOCTYPE model SYSTEM "http://127.0.0.1:9/a.dtd">'),
)
_laughs = "".join(f'<!ENTITY a{n} "{f"&a{n - 1};" * 10}">' for n in range(1, 10))
_add(
    "a billion laughs",
    "bad-header",
    _changed("?>", f'?><!DOCTYPE model [<!ENTITY a0 "ha">{_laughs}]>'),
)
_add("an entity that is none", "bad-document", _changed("<build>", "&a;<build>"))
_add("UTF-16", None, _changed('"1.0"', '"1.0" encoding="utf-16"').encode("utf-16"))
_add("UTF-16 with a document type", "bad-header", _changed("?>", "?><!DOCTYPE a>").encode("utf-16"))
_add("UTF-7", "unsupported-feature", _changed('"1.0"', '"1.0" encoding="utf-7"'))
_add("an encoding that is none", "unsupported-feature", _changed('"1.0"', '"1.0" encoding="zip"'))
_add(
    "latin-1",
    None,
    _changed('"1.0"', '"1.0" encoding="iso-8859-1"')
    .replace("<build>", "<!-- caf\xe9 --><build>")
    .encode("latin-1"),
)
_add("mixed encodings", "bad-document", _changed("<build>", "<a>\xe9</a><build>").encode("latin-1"))
_long = "http://" + "long/" * 200_000
FILES.add(
    "a namespace of 1 MB",
    lambda: _package(_changed("<model ", f'<model xmlns:q="{_long}" '), zipfile.ZIP_STORED),
    "bad-document",
)
FILES.add(
    "3 million elements",
    lambda: _package(_changed("<build>", "<a/>" * 3_000_000 + "<build>"), zipfile.ZIP_STORED),
    "too-many-values",
)


def _attributes(count: int) -> str:
    return " ".join(f'a{number}=""' for number in range(count))


FILES.add(
    "2 million attributes",
    lambda: _package(
        _changed("<build>", f"<a {_attributes(100)}/>" * 20_000 + "<build>"), zipfile.ZIP_STORED
    ),
    "too-many-values",
)
_spaces = " ".join(f'xmlns:a{number}="b"' for number in range(1000))
FILES.add(
    "2 million namespaces",
    lambda: _package(_changed("<build>", f"<a {_spaces}/>" * 2100 + "<build>"), zipfile.ZIP_STORED),
    "too-many-values",
)
FILES.add(
    "values of 1 MB",
    lambda: _package(
        _changed("<build>", f'<a b="{"c" * 1_000_000}"/>' * 40 + "<build>"), zipfile.ZIP_STORED
    ),
    None,
)
_names = "".join(f"<n{number}/>" for number in range(40_000))
_add("40 000 names", "bad-document", _changed("<build>", _names + "<build>"))
_add(
    "a tag of 3 MB",
    "too-many-tag-bytes",
    _changed(
        "<build>",
        "".join(f'<a b="{n}"/>' for n in range(9_000))
        + f'<a b="{"".join(map(str, range(600_000)))}"/><build>',
    ),
)
_add(
    "100 000 tags within each other",
    "bad-document",
    _changed("<build>", "".join(f'<a b="{n}">' for n in range(100_000))),
)

# The model
_add("no build", "no-faces", build.model_xml(build.mesh_xml(), ""))
_add("nothing", "no-faces", build.model_xml("", ""))
_add("points alone", "no-faces", build.model_xml(build.mesh_xml([])))
_add(
    "triangles without vertices",
    "index-out-of-range",
    build.model_xml(
        '<object id="1"><mesh><triangles><triangle v1="0" v2="1" v3="2"/>'
        "</triangles></mesh></object>"
    ),
)
_add("words", "bad-number", _changed('v1="0"', 'v1="zero"'))
_add("an underscore", "bad-number", _changed('v1="0"', 'v1="0_0"'))
_add("an index of 30 digits", "bad-number", _changed('v1="0"', f'v1="{"9" * 30}"'))
_add("an index of 5000 digits", "bad-number", _changed('v1="0"', f'v1="{"9" * 5000}"'))
_add("index -1", "index-out-of-range", _changed('v1="0"', 'v1="-1"'))
_add("index past the end", "index-out-of-range", _changed('v1="0"', 'v1="8"'))
_add("no v3", "bad-document", _changed('v3="3"', 'v4="3"'))
_add("no id", "bad-document", _changed('object id="1"', 'object name="1"'))
_add("NaN", "non-finite-vertices", _changed('x="0.0"', 'x="nan"'))
_add(
    "past all floats",
    "extent-overflow",
    _MODEL.replace('x="0.0"', 'x="-1.7e308"').replace('x="1.0"', 'x="1.7e308"'),
)
_add(
    "an extension that is not read",
    "unsupported-feature",
    _changed("<model ", '<model requiredextensions="q" xmlns:q="http://q.example/1" '),
)

# The scene
_items = build.model_xml(build.mesh_xml(), _ITEM * 100_000)
_add("100 000 items", "too-many-unpacked-bytes-per-byte", _items)
FILES.add("100 000 items not packed", _package(_items, zipfile.ZIP_STORED), "too-many-geometries")
FILES.add(
    "9000 items of one mesh",
    lambda: _package(build.model_xml(build.mesh_xml(), _ITEM * 9000), zipfile.ZIP_STORED),
    None,
)
FILES.add(
    "4900 objects",
    lambda: _package(
        build.model_xml(
            "".join(build.mesh_xml(identifier=str(number)) for number in range(4900)),
            "".join(f'<item objectid="{number}"/>' for number in range(4900)),
        ),
        zipfile.ZIP_STORED,
    ),
    None,
)
_doubled = "".join(_group(n, _component(n - 1) * 2) for n in range(2, 40))
_add(
    "components that double 38 times",
    "too-many-geometries",
    build.model_xml(build.mesh_xml() + _doubled, '<item objectid="39"/>'),
)
_chain = "".join(_group(n, _component(n - 1)) for n in range(2, 4000))
_add(
    "components 3998 deep",
    None,
    build.model_xml(build.mesh_xml() + _chain, '<item objectid="3999"/>'),
)
_add("an object within itself", "bad-scene", build.model_xml(_group(1, _component(1))))
_add(
    "objects within each other",
    "bad-scene",
    build.model_xml(_group(1, _component(2)) + _group(2, _component(1))),
)
_add("an object that is none", "bad-reference", build.model_xml(_group(1, _component(9))))
_add(
    "a part of another folder",
    "missing-data",
    build.model_xml("", '<item objectid="1" p:path="/../../etc/passwd"/>'),
)
_add(
    "a part at an address",
    "missing-data",
    build.model_xml("", '<item objectid="1" p:path="http://127.0.0.1:9/a.model"/>'),
)
_add("a transform of 3 numbers", "bad-number", _transformed("1 2 3"))
_add("a transform of words", "bad-number", _transformed("one " * 12))
_add("a transform past all floats", "non-finite-vertices", _transformed("1e308 " * 12))
_add("a transform of zeros", "zero-extent", _transformed("0 " * 12))
_relation = (
    '<Relationships><Relationship Target="{}" TargetMode="{}" '
    'Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/></Relationships>'
)
FILES.add(
    "a root part of another folder",
    build.threemf({"_rels/.rels": _relation.format("../../etc/passwd", "Internal"), _ROOT: _MODEL}),
    "missing-data",
)
FILES.add(
    "a root part at an address",
    build.threemf(
        {"_rels/.rels": _relation.format("http://127.0.0.1:9/a", "External"), "other": _MODEL}
    ),
    "bad-header",
)
