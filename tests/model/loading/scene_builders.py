"""The box in formats that libraries read, by text alone."""

import zipfile
from collections.abc import Mapping
from io import BytesIO

import numpy as np

from tests.model.loading.loading_builders import QUADS, VERTICES


def numbers(values, separator=" ") -> str:
    return separator.join(map(str, np.asarray(values).ravel().tolist()))


def step() -> bytes:
    """A solid of planes."""
    lines: list[str] = []

    def add(text: str) -> str:
        lines.append(text)
        return f"#{len(lines)}"

    def triple(kind: str, values: np.ndarray) -> str:
        return add(f"{kind}('',({','.join(map(repr, map(float, values)))}))")

    def axes(origin: np.ndarray, up: np.ndarray, right: np.ndarray) -> str:
        directions = [triple("DIRECTION", one / np.linalg.norm(one)) for one in (up, right)]
        place = triple("CARTESIAN_POINT", origin)
        return add(f"AXIS2_PLACEMENT_3D('',{place},{','.join(directions)})")

    points = VERTICES
    corners = [add(f"VERTEX_POINT('',{triple('CARTESIAN_POINT', point)})") for point in points]
    edges: dict[tuple[int, int], str] = {}
    faces = []
    for quad in QUADS:
        sides = []
        for start, end in zip(quad, np.roll(quad, -1), strict=True):
            low, high = sorted((int(start), int(end)))
            if (low, high) not in edges:
                along = points[high] - points[low]
                vector = add(f"VECTOR('',{triple('DIRECTION', along / np.linalg.norm(along))},1.)")
                line = add(f"LINE('',{triple('CARTESIAN_POINT', points[low])},{vector})")
                edges[low, high] = add(f"EDGE_CURVE('',{corners[low]},{corners[high]},{line},.T.)")
            forward = ".T." if start < end else ".F."
            sides.append(add(f"ORIENTED_EDGE('',*,*,{edges[low, high]},{forward})"))
        bound = add(f"FACE_OUTER_BOUND('',{add(f'''EDGE_LOOP('',({','.join(sides)}))''')},.T.)")
        a, b, c = points[quad[:3]]
        plane = add(f"PLANE('',{axes(a, np.cross(b - a, c - a), b - a)})")
        faces.append(add(f"ADVANCED_FACE('',({bound}),{plane},.T.)"))
    solid = add(f"MANIFOLD_SOLID_BREP('',{add(f'''CLOSED_SHELL('',({','.join(faces)}))''')})")
    units = [
        add("(LENGTH_UNIT()NAMED_UNIT(*)SI_UNIT($,.METRE.))"),
        add("(NAMED_UNIT(*)PLANE_ANGLE_UNIT()SI_UNIT($,.RADIAN.))"),
        add("(NAMED_UNIT(*)SI_UNIT($,.STERADIAN.)SOLID_ANGLE_UNIT())"),
    ]
    context = add(
        "(GEOMETRIC_REPRESENTATION_CONTEXT(3)GLOBAL_UNIT_ASSIGNED_CONTEXT"
        f"(({','.join(units)}))REPRESENTATION_CONTEXT('',''))"
    )
    origin = axes(np.zeros(3), np.array([0, 0, 1]), np.array([1, 0, 0]))
    shape = add(f"ADVANCED_BREP_SHAPE_REPRESENTATION('',({origin},{solid}),{context})")
    application = add("APPLICATION_CONTEXT('')")
    kind = add(f"PRODUCT_CONTEXT('',{application},'mechanical')")
    product = add(f"PRODUCT('box','box','',({kind}))")
    formation = add(f"PRODUCT_DEFINITION_FORMATION('','',{product})")
    design = add(f"PRODUCT_DEFINITION_CONTEXT('part definition',{application},'design')")
    definition = add(f"PRODUCT_DEFINITION('','',{formation},{design})")
    of_shape = add(f"PRODUCT_DEFINITION_SHAPE('','',{definition})")
    add(f"SHAPE_DEFINITION_REPRESENTATION({of_shape},{shape})")
    data = "".join(f"#{number}={line};\n" for number, line in enumerate(lines, 1))
    header = (
        "FILE_DESCRIPTION((''),'2;1');\nFILE_NAME('','',(''),(''),'','','');\n"
        "FILE_SCHEMA(('AUTOMOTIVE_DESIGN'));\n"
    )
    return (
        f"ISO-10303-21;\nHEADER;\n{header}ENDSEC;\nDATA;\n{data}ENDSEC;\nEND-ISO-10303-21;\n"
    ).encode()


def fbx(*nodes: tuple[str, int, str]) -> bytes:
    """One mesh, shown by nodes: name, the number of the parent from 1 (0: none), properties."""
    nodes = nodes or (("a", 0, ""),)
    corners = [(*quad[:3], ~quad[3]) for quad in QUADS.tolist()]
    models = "".join(
        f'Model: {200 + number}, "Model::{name}", "Mesh" {{\n'
        f"Properties70: {{\n{properties}\n}}\n}}\n"
        for number, (name, _, properties) in enumerate(nodes, 1)
    )
    links = "".join(
        f'C: "OO",{200 + number},{parent and 200 + parent}\nC: "OO",100,{200 + number}\n'
        for number, (_, parent, _) in enumerate(nodes, 1)
    )
    return f"""; FBX 7.4.0 project file
FBXHeaderExtension: {{
FBXHeaderVersion: 1003
FBXVersion: 7400
}}
GlobalSettings: {{
Version: 1000
Properties70: {{
P: "UnitScaleFactor", "double", "Number", "",2.54
}}
}}
Objects: {{
Geometry: 100, "Geometry::", "Mesh" {{
Vertices: *24 {{
a: {numbers(VERTICES, ",")}
}}
PolygonVertexIndex: *24 {{
a: {numbers(corners, ",")}
}}
GeometryVersion: 124
}}
{models}}}
Connections: {{
{links}}}
""".encode()


def dae(nodes='<node><instance_geometry url="#g"/></node>', library="") -> bytes:
    """One geometry `g`, shown by nodes."""
    source = (
        f'<source id="p"><float_array id="a" count="24">{numbers(VERTICES)}</float_array>'
        '<technique_common><accessor source="#a" count="8" stride="3">'
        + "".join(f'<param name="{axis}" type="float"/>' for axis in "XYZ")
        + "</accessor></technique_common></source>"
    )
    return (
        '<?xml version="1.0" encoding="utf-8"?>'
        '<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">'
        f'<asset><up_axis>Z_UP</up_axis></asset><library_geometries><geometry id="g"><mesh>{source}'
        '<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>'
        '<polylist count="6"><input semantic="VERTEX" source="#v" offset="0"/>'
        f"<vcount>4 4 4 4 4 4</vcount><p>{numbers(QUADS)}</p></polylist></mesh></geometry>"
        f"</library_geometries>{library}<library_visual_scenes>"
        f'<visual_scene id="s">{nodes}</visual_scene></library_visual_scenes>'
        '<scene><instance_visual_scene url="#s"/></scene></COLLADA>'
    ).encode()


def usda(*prims: str) -> bytes:
    """A text layer of prims."""
    return ('#usda 1.0\n(\n    upAxis = "Z"\n)\n' + "\n".join(prims or (usd_mesh(),))).encode()


def usd_mesh(name="box", more="") -> str:
    points = ", ".join(f"({numbers(point, ', ')})" for point in VERTICES)
    return f'''def Mesh "{name}"
{{
    int[] faceVertexCounts = [4, 4, 4, 4, 4, 4]
    int[] faceVertexIndices = [{numbers(QUADS, ", ")}]
    point3f[] points = [{points}]
    {more}
}}
'''


def usdz(files: Mapping[str, bytes]) -> bytes:
    """A package, in which each file begins at a multiple of 64 bytes."""
    stream = BytesIO()
    with zipfile.ZipFile(stream, "w") as package:
        for name, content in files.items():
            entry = zipfile.ZipInfo(name)
            begins = stream.tell() + 30 + len(name)
            padding = -(begins + 4) % 64
            entry.extra = b"\x86\x19" + padding.to_bytes(2, "little") + bytes(padding)
            package.writestr(entry, content)
    return stream.getvalue()
