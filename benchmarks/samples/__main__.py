"""Build the sample meshes: `python -m benchmarks.samples [FOLDER]` writes them all.

The same code gives the same files. Each shape is meshed far more finely than it is stored, then
simplified, as models of real things are.
"""

import sys
import zipfile
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path

import igl
import numpy as np
import trimesh

from benchmarks.samples.shapes import SHAPES
from benchmarks.samples.solids import surface
from meshconv3d.model.mesh import Mesh
from meshconv3d.model.preparation import into_unit_sphere


@dataclass(frozen=True)
class Recipe:
    """How a shape is stored: the format, the faces, and whether these are alike in size.

    Quadric simplification, where they are not, spends faces where the surface bends.
    """

    extension: str
    faces: int
    even: bool = False


SAMPLES = Path(__file__).parents[2] / "tests" / "articulated"

RECIPES: dict[str, Recipe] = {
    "ants": Recipe("obj", 500),
    "glasses": Recipe("ply", 2400, even=True),
    "hand": Recipe("stl", 1000),
    "lamp": Recipe("obj", 500),
    "laptop": Recipe("stl", 350),
    "octopus": Recipe("off", 500),
    "pliers": Recipe("glb", 3000, even=True),
    "snake": Recipe("3mf", 4000, even=True),
    "spiders": Recipe("ply", 500),
    "two_balls": Recipe("glb", 2000),
}

# Of a cell, as standard deviation: on exact planes simplification leaves a few needles, which
# surfaces that were scanned or sculpted never have.
ROUGHNESS = 0.05

_3MF_PARTS = {
    "[Content_Types].xml": (
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        '<Types xmlns="http://schemas.openxmlformats.org/package/2006/content-types">'
        '<Default Extension="rels" '
        'ContentType="application/vnd.openxmlformats-package.relationships+xml"/>'
        '<Default Extension="model" '
        'ContentType="application/vnd.ms-package.3dmanufacturing-3dmodel+xml"/></Types>'
    ),
    "_rels/.rels": (
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        '<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">'
        '<Relationship Target="/3D/3dmodel.model" Id="rel0" '
        'Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/></Relationships>'
    ),
    "3D/3dmodel.model": (
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        '<model unit="millimeter" '
        'xmlns="http://schemas.microsoft.com/3dmanufacturing/core/2015/02"><resources>'
        '<object id="1" type="model"><mesh><vertices>{vertices}</vertices>'
        "<triangles>{triangles}</triangles></mesh></object></resources>"
        '<build><item objectid="1"/></build></model>'
    ),
}


def build(name: str) -> Mesh:
    """The mesh of one shape, in the unit sphere, with coordinates of four decimals."""
    shape, recipe = SHAPES[name](), RECIPES[name]
    vertices, faces = surface(shape.solids, shape.blend, shape.step)
    vertices += np.random.default_rng(0).normal(0, ROUGHNESS * shape.step, vertices.shape)
    if recipe.even:
        mesh = Mesh(*igl.decimate(vertices, faces.astype(np.int64), recipe.faces)[:2])
    else:
        columns = np.asfortranarray(vertices), np.asfortranarray(faces)
        mesh = Mesh(*igl.qslim(*columns, recipe.faces)[:2])
    # Adding zero turns a negative zero, which text formats would spell out, into a plain one.
    return mesh.moved(np.round(into_unit_sphere(mesh.vertices, mesh.faces), 4) + 0.0)


def encode(mesh: Mesh, extension: str) -> bytes:
    """The mesh as a file of this format."""
    options = {"obj": {"header": None, "digits": 4}, "off": {"digits": 4}}
    if extension == "3mf":
        return _encode_3mf(mesh)
    content = trimesh.Trimesh(mesh.vertices, mesh.faces, process=False).export(
        file_type=extension, **options.get(extension, {})
    )
    return content.encode() if isinstance(content, str) else bytes(content)


def _encode_3mf(mesh: Mesh) -> bytes:
    """A package without the time of writing and random identifiers, which trimesh puts in."""
    fields = {
        "vertices": "".join(
            f'<vertex x="{x:g}" y="{y:g}" z="{z:g}"/>' for x, y, z in mesh.vertices.tolist()
        ),
        "triangles": "".join(
            f'<triangle v1="{a}" v2="{b}" v3="{c}"/>' for a, b, c in mesh.faces.tolist()
        ),
    }
    package = BytesIO()
    with zipfile.ZipFile(package, "w") as archive:
        for path, text in _3MF_PARTS.items():
            entry = zipfile.ZipInfo(path)
            entry.compress_type = zipfile.ZIP_DEFLATED
            archive.writestr(entry, text.format(**fields))
    return package.getvalue()


def main(folder: Path) -> None:
    """Write every sample into `folder`."""
    for name, recipe in RECIPES.items():
        path = folder / f"{name}.{recipe.extension}"
        path.write_bytes(encode(build(name), recipe.extension))
        sys.stdout.write(f"{path}: {recipe.faces} faces, {path.stat().st_size} bytes\n")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else SAMPLES)
