"""The shapes: each one class of SHREC11, put together from limbs, balls and boxes.

Only proportions matter, since meshes are scaled into the unit sphere. They follow the kind of
thing, in a pose of its own; every class is one closed surface without handles.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from benchmarks.samples.solids import Solid, ball, box, limb, turn


@dataclass(frozen=True)
class Shape:
    """Solids, how softly they join, and the cell width that resolves their thinnest part."""

    solids: list[Solid]
    blend: float
    step: float


def snake() -> Shape:
    """A slithering body, thickest in its middle third, with a flat head and a thin tail."""
    s = np.linspace(0, 1, 60)
    heading = 1.35 * np.sin(2 * np.pi * 1.6 * s + 0.4) + 0.5 * s
    path = np.cumsum(np.stack([np.cos(heading), np.sin(heading), 0 * s], axis=1), axis=0) / 60
    path[:, 2] = 0.10 * np.maximum(s - 0.85, 0) / 0.15
    body = limb(path * 10, [0.015, 0.045, 0.07, 0.085, 0.09, 0.09, 0.085, 0.075, 0.07], smooth=1)
    neck, tip = path[-3] * 10, path[-1] * 10
    forward = (tip - neck) / np.linalg.norm(tip - neck)
    side = np.cross([0, 0, 1], forward)
    side /= np.linalg.norm(side)
    frame = [forward, side, np.cross(forward, side)]
    return Shape([body, ball(tip + 0.12 * forward, [0.27, 0.15, 0.09], frame)], 0.05, 0.03)


def two_balls() -> Shape:
    """Two equal balls at the ends of a slack cord."""
    cord = limb(
        [
            [-2.2, 0, 0],
            [-1.4, -1.2, 0.3],
            [-0.3, -1.5, 0.2],
            [0.3, -0.2, -0.3],
            [1.2, 0.3, -0.4],
            [2.0, -0.6, 0],
            [2.6, 0.6, 0.2],
        ],
        [0.2],
    )
    return Shape([cord, ball([-2.4, 0.7, 0], 0.95), ball([2.8, 1.3, 0.2], 0.95)], 0.1, 0.06)


def octopus() -> Shape:
    """A long mantle and eight arms that spread and curl from its open end."""
    solids: list[Solid] = [limb([[0, 0, 0.1], [0, 0, 1.1], [0, 0, 1.9]], [0.68, 0.78, 0.6])]
    down = np.array([0, 0, -1.0])
    for arm in range(8):
        angle = 2 * np.pi * arm / 8 + 0.2
        out = np.array([np.cos(angle), np.sin(angle), 0])
        aside = np.cross(out, down)
        spread, curl = 0.9 + 0.45 * np.sin(2.3 * arm), np.cos(1.7 * arm)
        line = [
            0.45 * out + 0.1 * down,
            0.6 * out + 0.6 * down,
            (0.6 + 0.45 * spread) * out + 1.15 * down,
            (0.6 + 1.0 * spread) * out + 1.6 * down + 0.25 * curl * aside,
            (0.6 + 1.55 * spread) * out + (2.1 - 0.7 * spread) * down + 0.6 * curl * aside,
        ]
        solids.append(limb(line, [0.16, 0.15, 0.14, 0.13, 0.12]))
    return Shape(solids, 0.1, 0.05)


def laptop() -> Shape:
    """A base and an open lid of equal size, joined along the hinge."""
    opening = turn(0, 105)
    lid = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1.0]]) @ opening
    base = box([0, 0.75, 0], [1.0, 0.75, 0.05], power=12)
    return Shape([base, box(0.75 * lid[1], [1.0, 0.75, 0.045], lid, power=12)], 0.03, 0.03)


def lamp() -> Shape:
    """A desk lamp: a round foot, a bent neck and a shade like a trumpet's bell."""
    line = [
        [0, 0, 0],
        [0.05, 0, 0.7],
        [0.4, 0.1, 1.5],
        [0.2, 0.2, 2.3],
        [0.7, 0.2, 2.9],
        [1.5, 0.1, 2.8],
        [2.0, 0, 2.3],
    ]
    neck = limb(line, [0.15])
    end = neck.line[-1]
    forward = end - neck.line[-3]
    forward /= np.linalg.norm(forward)
    side = np.cross(forward, [1.0, 0, 0])
    side /= np.linalg.norm(side)
    foot = ball([0, 0, 0], [1.1, 1.1, 0.16])
    shade = ball(end + 0.65 * forward, [1.1, 1.1, 0.16], [np.cross(side, forward), side, forward])
    flare = [end, end + 0.33 * forward, end + 0.65 * forward]
    return Shape([foot, neck, limb(flare, [0.15, 0.28, 0.65], smooth=1), shade], 0.2, 0.05)


def spiders() -> Shape:
    """A broad thorax, a round abdomen close behind it, and eight bent legs."""
    solids: list[Solid] = [
        ball([0, 0, 0], [1.0, 0.9, 0.55]),
        ball([-1.55, 0.1, 0.2], [0.85, 0.72, 0.68]),
        limb([[-1.2, 0, 0.05], [-0.6, 0, 0]], [0.32], smooth=1),
    ]
    for side in (-1, 1):
        for leg, degrees in enumerate((30, 65, 98, 132)):
            angle = np.radians(degrees + 5 * side)
            out = np.array([np.cos(angle), side * np.sin(angle), 0])
            bend = np.array([0.1 * np.cos(leg * 2.0 + side), 0, 0])
            rise = np.array([0, 0, 1.0])
            line = [
                0.6 * out,
                1.2 * out + 0.15 * rise,
                1.85 * out + 0.2 * rise + bend,
                2.4 * out - 0.1 * rise + 2 * bend,
                2.75 * out - 0.55 * rise + 3 * bend,
            ]
            solids.append(limb(line, [0.17, 0.16, 0.15, 0.14, 0.13]))
    return Shape(solids, 0.1, 0.05)


def ants() -> Shape:
    """Head, stout thorax and long abdomen in a row; six short legs and two antennae."""
    solids: list[Solid] = [
        ball([1.75, 0, 0.1], [0.6, 0.56, 0.5]),
        limb([[-1.0, 0, 0.05], [0, 0, 0], [1.3, 0, 0.05]], [0.28, 0.42, 0.3]),
        ball([-1.95, 0.15, 0.2], [1.1, 0.52, 0.5], turn(2, -8)),
    ]
    for side in (-1, 1):
        for leg, x in enumerate((-0.55, 0.1, 0.75)):
            slant = 0.6 * (leg - 1) + 0.15 * side
            line = [
                [x, 0.15 * side, 0],
                [x + 0.2 * slant, 0.7 * side, 0.15],
                [x + 0.7 * slant, 1.25 * side, 0.0],
                [x + slant, 1.5 * side, -0.5],
            ]
            solids.append(limb(line, [0.17, 0.15, 0.14, 0.13]))
        feeler = [
            [1.95, 0.25 * side, 0.2],
            [2.35, 0.55 * side, 0.35],
            [2.85, 0.8 * side, 0.3],
            [3.25, 0.8 * side + 0.15, 0.05],
        ]
        solids.append(limb(feeler, [0.16, 0.15, 0.14, 0.13]))
    return Shape(solids, 0.1, 0.045)


def glasses() -> Shape:
    """Two glazed lenses and a bridge, with temples that are nearly unfolded."""
    solids: list[Solid] = []
    for side in (-1, 1):
        tilt = turn(1, 8 * side)
        solids.append(box([side * 0.82, 0, 0], [0.62, 0.48, 0.06], tilt, power=4))
        hinge = np.array([side * 1.42, 0.25, -0.02])
        fold = np.array([-side * (0.25 if side < 0 else 0.5), 0, -1.0])
        line = [
            hinge - [side * 0.15, 0, 0],
            hinge + 0.15 * fold,
            hinge + 1.2 * fold,
            hinge + 2.1 * fold + [0, -0.05, 0],
            hinge + 2.6 * fold + [0, -0.4, 0],
        ]
        solids.append(limb(line, [0.07, 0.07, 0.065, 0.06]))
    solids.append(limb([[-0.35, 0.2, 0], [0, 0.28, 0.05], [0.35, 0.2, 0]], [0.075]))
    return Shape(solids, 0.04, 0.03)


def pliers() -> Shape:
    """Two levers crossing at a pivot: long curved handles, slim tapering jaws."""
    solids: list[Solid] = [ball([0, 0, 0], [0.4, 0.4, 0.24])]
    for side in (-1, 1):
        lever = [
            [-3.2, 1.45 * side, 0],
            [-2.2, 1.4 * side, 0],
            [-1.2, 0.95 * side, 0],
            [-0.4, 0.3 * side, 0],
            [0, 0, 0],
        ]
        solids.append(limb(lever, [0.21, 0.22, 0.22, 0.22, 0.24]))
        jaw = [[0, 0, 0], [0.5, 0.3 * side, 0], [2.6, 0.95 * side, 0]]
        solids.append(limb(jaw, [0.26, 0.24, 0.07], smooth=1))
    return Shape(solids, 0.08, 0.05)


def hand() -> Shape:
    """A spread right hand with a stump of the wrist, the little finger bent."""
    palm = box([0, 0, 0], [0.95, 0.85, 0.3], power=3)
    wrist = box([-1.3, 0.0, 0], [0.9, 0.5, 0.36], power=5)
    solids: list[Solid] = [palm, wrist]
    for finger, (y, degrees, length) in enumerate(
        ((-0.62, -16, 1.25), (-0.22, -4, 1.55), (0.2, 5, 1.65), (0.6, 15, 1.5))
    ):
        out = np.array([np.cos(np.radians(degrees)), np.sin(np.radians(degrees)), 0])
        root = np.array([0.6, y, 0])
        droop = np.array([0, 0, -0.5 if finger == 0 else -0.12])
        solids.append(
            limb(
                [
                    root,
                    root + out * 0.35 * (1 + length),
                    root + out * (0.3 + 0.75 * length) + droop * 0.4,
                    root + out * (0.3 + length) + droop,
                ],
                [0.23, 0.2, 0.17],
            )
        )
    solids.append(
        limb(
            [[-0.5, 0.5, -0.1], [0.1, 1.1, -0.25], [0.6, 1.6, -0.35], [1.0, 1.85, -0.3]],
            [0.33, 0.27, 0.22, 0.18],
        )
    )
    return Shape(solids, 0.15, 0.05)


SHAPES: dict[str, Callable[[], Shape]] = {
    shape.__name__: shape
    for shape in (
        ants,
        glasses,
        hand,
        lamp,
        laptop,
        octopus,
        pliers,
        snake,
        spiders,
        two_balls,
    )
}
