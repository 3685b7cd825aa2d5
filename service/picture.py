"""A small picture of a mesh, drawn without a graphics card."""

from io import BytesIO

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from meshconv3d.model.mesh import Mesh

SIZE = 96  # pixels
OVERSAMPLING = 4
MARGIN = 0.04  # of the picture, on each side

# Where the camera stands: to the right of the front and above it, with y upwards, as on the page.
AZIMUTH, ELEVATION = np.radians((35, 20))

# Light comes from the left, above, and behind the camera.
LIGHT = np.array([-0.4, 0.6, 0.7]) / np.linalg.norm([-0.4, 0.6, 0.7])

# From grey in the shade to grey in the light: apart from a light page and from a dark one.
DARKEST, BRIGHTEST = 62, 205
SHADES = 16  # with these a PNG takes four bits a pixel


def picture(mesh: Mesh, size: int = SIZE) -> bytes:
    """A PNG of size x size pixels: the mesh in three-quarter view, in grey, on nothing.

    The faces are painted from the farthest to the nearest, which the small and even ones of a
    prepared mesh permit; see docs/batch-report.md for how often that is wrong.
    """
    seen = mesh.vertices @ _camera()
    depth = seen[mesh.faces, 2].mean(axis=1)
    corners = _on_canvas(seen[:, :2], size * OVERSAMPLING)[mesh.faces].reshape(-1, 6)
    shades = _shades(seen[mesh.faces])
    canvas = Image.new("LA", (size * OVERSAMPLING, size * OVERSAMPLING))
    draw = ImageDraw.Draw(canvas)
    order = np.argsort(depth)
    for face, shade in zip(corners[order].tolist(), shades[order].tolist(), strict=True):
        draw.polygon(face, fill=(int(shade), 255))
    small = canvas.reduce(OVERSAMPLING).convert("RGBA")
    file = BytesIO()
    small.quantize(SHADES, Image.Quantize.FASTOCTREE).save(file, "PNG")
    return file.getvalue()


def _camera() -> NDArray[np.float64]:
    """3 x 3: its columns are the directions right, up, and towards the camera."""
    towards = np.array(
        [
            np.cos(ELEVATION) * np.sin(AZIMUTH),
            np.sin(ELEVATION),
            np.cos(ELEVATION) * np.cos(AZIMUTH),
        ]
    )
    right = np.array([np.cos(AZIMUTH), 0, -np.sin(AZIMUTH)])
    return np.stack([right, np.cross(towards, right), towards], axis=1)


def _on_canvas(points: NDArray[np.float64], size: int) -> NDArray[np.float64]:
    """Points (V x 2, y upwards) in pixels, y downwards: in the middle, and as large as fits."""
    low, high = points.min(axis=0), points.max(axis=0)
    scale = size * (1 - 2 * MARGIN) / (high - low).max()
    return (points - (low + high) / 2) * (scale, -scale) + size / 2


def _shades(triangles: NDArray[np.float64]) -> NDArray[np.float64]:
    """The grey of each triangle (F x 3 x 3, seen from the camera); both its sides are lit."""
    a, b, c = triangles.transpose(1, 0, 2)
    normals = np.cross(b - a, c - a)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    facing = np.where(normals[:, 2:] < 0, -normals, normals)
    return DARKEST + (BRIGHTEST - DARKEST) * np.clip(facing @ LIGHT, 0, 1)
