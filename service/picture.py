"""Small picture of a mesh, drawn with Pillow."""

from io import BytesIO

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw

from meshconv3d.model.mesh import Mesh

SIZE = 96  # pixels
OVERSAMPLING = 4
MARGIN = 0.04  # of the picture, on each side

# Direction of the camera, right of the front and above it; y is up, as on the page.
AZIMUTH, ELEVATION = np.radians((35, 20))

# Direction of the light: left of the camera, above and behind it.
LIGHT = np.array([-0.4, 0.6, 0.7]) / np.linalg.norm([-0.4, 0.6, 0.7])

# Greys in the shade and in the light, visible on a light page and on a dark one.
DARKEST, BRIGHTEST = 62, 205
SHADES = 16  # with these a PNG takes four bits a pixel


def picture(mesh: Mesh, size: int = SIZE) -> bytes:
    """PNG of size x size pixels: the mesh in three-quarter view, grey on a transparent ground.

    Painter's algorithm: faces are painted from the farthest to the nearest. The small, even faces
    of a prepared mesh permit it; docs/batch-report.md says how often a pixel is wrong.
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
    """Rotation matrix, 3 x 3: its columns point right, up, and towards the camera."""
    right = np.array([np.cos(AZIMUTH), 0, -np.sin(AZIMUTH)])
    ahead = np.array([np.sin(AZIMUTH), 0, np.cos(AZIMUTH)])
    towards = np.cos(ELEVATION) * ahead + [0, np.sin(ELEVATION), 0]
    return np.stack([right, np.cross(towards, right), towards], axis=1)


def _on_canvas(points: NDArray[np.float64], size: int) -> NDArray[np.float64]:
    """Points (V x 2, y up) in pixels (y down), centred and scaled to the picture."""
    low, high = points.min(axis=0), points.max(axis=0)
    scale = size * (1 - 2 * MARGIN) / (high - low).max()
    return (points - (low + high) / 2) * (scale, -scale) + size / 2


def _shades(triangles: NDArray[np.float64]) -> NDArray[np.float64]:
    """Grey of each triangle (F x 3 x 3, in camera coordinates), whose sides are lit alike."""
    a, b, c = triangles.transpose(1, 0, 2)
    normals = np.cross(b - a, c - a)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    facing = np.where(normals[:, 2:] < 0, -normals, normals)
    return DARKEST + (BRIGHTEST - DARKEST) * np.clip(facing @ LIGHT, 0, 1)
