"""Solids as distance functions, blended into one closed surface.

A boolean union of primitives leaves slivers and hard creases; a surface cut from one distance
field has even triangles, rounded joints and no holes, whatever the primitives were.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import igl
import numpy as np
from numpy.typing import ArrayLike, NDArray

Points = NDArray[np.float64]


class Solid(Protocol):
    """A primitive: signed distances, negative inside, and a box around it."""

    def distance(self, points: Points) -> NDArray[np.float64]:
        """Distances (approximate away from the surface) of ... x 3 points."""
        ...

    def bounds(self) -> tuple[Points, Points]:
        """Lowest and highest corner."""
        ...


@dataclass(frozen=True, eq=False)
class Limb:
    """A tube along a polyline, P x 3, whose radius, one for each point, varies between them."""

    line: Points
    radii: NDArray[np.float64]

    def distance(self, points: Points) -> NDArray[np.float64]:
        nearest = np.full(points.shape[:-1], np.inf)
        for start, end, r0, r1 in zip(
            self.line, self.line[1:], self.radii, self.radii[1:], strict=False
        ):
            along = end - start
            t = np.clip((points - start) @ along / (along @ along), 0.0, 1.0)
            axis = np.linalg.norm(points - start - t[..., None] * along, axis=-1)
            np.minimum(nearest, axis - (r0 + t * (r1 - r0)), out=nearest)
        return nearest

    def bounds(self) -> tuple[Points, Points]:
        radius = self.radii[:, None]
        return (self.line - radius).min(axis=0), (self.line + radius).max(axis=0)


@dataclass(frozen=True, eq=False)
class Box:
    """A rounded box, or with `power` 2 an ellipsoid: a superquadric in its own frame.

    frame: its axes as rows, orthonormal. half: half its size along each of them.
    """

    centre: Points
    half: Points
    frame: NDArray[np.float64]
    power: float

    def distance(self, points: Points) -> NDArray[np.float64]:
        local = np.abs((points - self.centre) @ self.frame.T)
        level = ((local / self.half) ** self.power).sum(axis=-1) ** (1 / self.power)
        # First-order distance: the level's excess over the length of its gradient.
        scaled = (local / self.half / np.maximum(level, 1e-9)[..., None]) ** (self.power - 1)
        return (level - 1) / np.maximum(np.linalg.norm(scaled / self.half, axis=-1), 1e-9)

    def bounds(self) -> tuple[Points, Points]:
        reach = np.abs(self.frame.T) @ self.half
        return self.centre - reach, self.centre + reach


def limb(line: ArrayLike, radii: ArrayLike, smooth: int = 8) -> Limb:
    """A tube through the points of `line`, curved where `smooth` > 1 pieces join two of them.

    radii: spread evenly over the points; fewer than points are interpolated.
    """
    points, radii = np.asarray(line, float), np.atleast_1d(np.asarray(radii, float))
    curve = catmull_rom(points, smooth) if smooth > 1 else points
    places = np.linspace(0, 1, len(radii))
    return Limb(curve, np.interp(np.linspace(0, 1, len(curve)), places, radii))


def ball(centre: ArrayLike, half: ArrayLike, frame: ArrayLike | None = None) -> Box:
    """An ellipsoid; `half` may be one radius."""
    return box(centre, half, frame, power=2.0)


def box(
    centre: ArrayLike, half: ArrayLike, frame: ArrayLike | None = None, power: float = 10.0
) -> Box:
    """A box, the more rounded the lower its `power`."""
    axes = np.eye(3) if frame is None else np.asarray(frame, float)
    size = np.broadcast_to(np.asarray(half, float), 3)
    return Box(np.asarray(centre, float), size, axes, power)


def catmull_rom(points: Points, pieces: int) -> Points:
    """A curve through all points, each gap cut into `pieces`."""
    padded = np.concatenate([[2 * points[0] - points[1]], points, [2 * points[-1] - points[-2]]])
    a, b, c, d = (padded[i : len(padded) - 3 + i, None] for i in range(4))
    t = np.arange(pieces)[:, None] / pieces
    curve = b + t * (c - a) / 2 + t**2 * (a - 2.5 * b + 2 * c - d / 2)
    curve += t**3 * (1.5 * (b - c) + (d - a) / 2)
    return np.concatenate([curve.reshape(-1, 3), points[-1:]])


def turn(axis: int, degrees: float) -> NDArray[np.float64]:
    """The rotation about a coordinate axis; its rows are a turned `frame`."""
    sine, cosine = np.sin(np.radians(degrees)), np.cos(np.radians(degrees))
    i, j = (axis + 1) % 3, (axis + 2) % 3
    matrix = np.eye(3)
    matrix[[i, i, j, j], [i, j, i, j]] = cosine, sine, -sine, cosine
    return matrix


def surface(solids: Sequence[Solid], blend: float, step: float) -> tuple[Points, NDArray[np.int32]]:
    """The boundary of the solids' union by marching cubes of width `step`.

    blend: how near to each other surfaces melt together; 0 keeps the crease.
    """
    pad = blend + 3 * step
    boxes = [(low - pad, high + pad) for low, high in (solid.bounds() for solid in solids)]
    origin = np.min([low for low, _ in boxes], axis=0)
    shape = np.ceil((np.max([high for _, high in boxes], axis=0) - origin) / step).astype(int) + 1
    field = np.full(shape, pad)
    for solid, (low, high) in zip(solids, boxes, strict=True):
        # Beyond its padded box a solid is too far away to matter.
        first = np.floor((low - origin) / step).astype(int)
        last = np.ceil((high - origin) / step).astype(int) + 1
        window = tuple(slice(*ends) for ends in zip(first, last, strict=True))
        block = field[window]
        grid = np.moveaxis(np.indices(block.shape), 0, -1) + first
        field[window] = _melt(block, solid.distance(origin + step * grid), blend)
    # igl runs through x fastest.
    corners = np.indices(shape[::-1]).reshape(3, -1)[::-1].T * step + origin
    vertices, faces, _ = igl.marching_cubes(field.ravel(order="F"), corners, *field.shape, 0.0)
    return np.array(vertices, dtype=np.float64), np.array(faces, dtype=np.int32)


def _melt(one: NDArray, other: NDArray, blend: float) -> NDArray[np.float64]:
    """The lesser of two distances, rounded off where they differ by less than `blend`."""
    if blend == 0:
        return np.minimum(one, other)
    overlap = np.maximum(blend - np.abs(one - other), 0.0) / blend
    return np.minimum(one, other) - overlap**2 * blend / 4
