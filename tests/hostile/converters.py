"""Hostile files of the formats that libraries read, each in a process of its own."""

from tests.hostile.catalogue import Catalogue, replaced
from tests.model.loading import scene_builders as scenes

FILES = Catalogue("box.step")

_STEP, _DAE, _FBX, _USD = scenes.step(), scenes.dae(), scenes.fbx(), scenes.usda()
_BOX = scenes.usd_mesh()


def _nodes() -> bytes:
    """COLLADA: ten levels of ten instances each."""
    used = '<instance_node url="#n{}"/>'
    levels = "".join(
        f'<node id="n{level}">{10 * used.format(level - 1)}</node>' for level in range(1, 11)
    )
    first = '<node id="n0"><instance_geometry url="#g"/></node>'
    return scenes.dae(
        '<node><instance_node url="#n10"/></node>',
        f"<library_nodes>{first}{levels}</library_nodes>",
    )


def _instancer(count: int) -> bytes:
    """USD: a box at many points."""
    return scenes.usda(
        f"""def PointInstancer "many"
{{
    rel prototypes = </many/box>
    int[] protoIndices = [{", ".join(count * ["0"])}]
    point3f[] positions = [{", ".join(count * ["(1, 2, 3)"])}]
    {_BOX}
}}"""
    )


def _refers(to: str) -> bytes:
    return scenes.usda(f'def "a" (references = @{to}@)\n{{\n}}', _BOX)


_OTHER = b"DATA;\n#900=%s'/etc/hostname',$);\n"
for _kind in (b"DOCUMENT_FILE(", b"externally_defined_item ("):
    _text = replaced(_STEP, b"DATA;\n", _OTHER % _kind)
    FILES.add(f"STEP: {_kind.decode()}", _text, "unsupported-feature")
FILES.add("STEP: half of it", _STEP[: len(_STEP) // 2], "unsupported-feature")
FILES.add("STEP: nothing", b"ISO-10303-21;\nEND-ISO-10303-21;\n", "unreadable")
FILES.add("FBX: half of it", _FBX[: len(_FBX) // 2], "unreadable", "a.fbx")
FILES.add(
    "FBX: binary rubbish", b"Kaydara FBX Binary  \0\x1a\0" + b"\xff" * 500, "unreadable", "a.fbx"
)
FILES.add("FBX: an index of no vertex", _FBX.replace(b"a: 0,", b"a: 90,"), "unreadable", "a.fbx")
for _title, _type in (
    ("a file", b'<!DOCTYPE a [<!ENTITY b SYSTEM "file:///etc/hostname">]>'),
    ("entities", b'<!DOCTYPE a [<!ENTITY b "ha"><!ENTITY c "&b;&b;">]>'),
):
    _text = replaced(_DAE, b"<COLLADA", _type + b"<COLLADA")
    FILES.add(f"COLLADA: {_title}", _text, "unsupported-feature", "a.dae")
FILES.add("COLLADA: instances of instances", _nodes, "too-many-instances", "a.dae")
FILES.add("COLLADA: half of it", _DAE[: len(_DAE) // 2], "unreadable", "a.dae")
FILES.add(
    "COLLADA: no geometry of this name",
    replaced(_DAE, b'url="#g"', b'url="#h"'),
    "unreadable",
    "a.dae",
)
FILES.add(
    "COLLADA: a geometry at an address",
    replaced(_DAE, b'url="#g"', b'url="http://127.0.0.1:9/a.dae#g"'),
    "unreadable",
    "a.dae",
)
for _path in ("/etc/hostname", "../a.usda", "http://127.0.0.1:9/a.usda", "a.usda"):
    FILES.add(f"USD: a reference to {_path}", _refers(_path), "unsupported-feature", "a.usda")
    FILES.add(
        f"USDZ: a reference to {_path}",
        scenes.usdz({"b.usda": _refers(_path)}),
        "unsupported-feature",
        "a.usdz",
    )
FILES.add("USD: 300,000 instances", lambda: _instancer(300_000), "unsupported-feature", "a.usda")
FILES.add("USD: half of it", _USD[: len(_USD) // 2], "unreadable", "a.usda")
FILES.add("USD: binary rubbish", b"PXR-USDC" + b"\xff" * 500, "unreadable", "a.usdc")
FILES.add("USDZ: half of it", scenes.usdz({"a.usda": _USD})[:400], "format-mismatch", "a.usdz")
FILES.add("USDZ: no layer", scenes.usdz({"a.png": b""}), "format-mismatch", "a.usdz")
