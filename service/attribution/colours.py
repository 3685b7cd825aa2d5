"""Colour map of evidence: blue against a class, orange for it, near white for neither.

The map is linear from its middle to both ends in OKLab (Björn Ottosson, 2020), a perceptually
uniform space. Nearly all people with a colour vision deficiency can tell blue from orange.
"""

import numpy as np
from numpy.typing import NDArray

# Lightness, green to red, blue to yellow.
AGAINST = (0.45, -0.025, -0.160)
NEITHER = (0.94, 0.0, 0.0)
FOR = (0.55, 0.140, 0.105)

# OKLab to the cube roots of cone responses, and their cubes to linear sRGB.
_TO_CONES = np.array(
    [
        [1.0, 0.3963377774, 0.2158037573],
        [1.0, -0.1055613458, -0.0638541728],
        [1.0, -0.0894841775, -1.2914855480],
    ]
)
_TO_RGB = np.array(
    [
        [4.0767416621, -3.3077115913, 0.2309699292],
        [-1.2684380046, 2.6097574011, -0.3413193965],
        [-0.0041960863, -0.7034186147, 1.7076147010],
    ]
)


def linear_colours(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Linear RGB (N x 3, in [0, 1]) of values, which are clipped to -1 to 1."""
    strength = np.clip(np.abs(values), 0, 1)[:, None]
    end = np.where((values > 0)[:, None], FOR, AGAINST)
    lab = (1 - strength) * NEITHER + strength * end
    return np.clip((lab @ _TO_CONES.T) ** 3 @ _TO_RGB.T, 0, 1)


def srgb_colours(values: NDArray[np.float64]) -> NDArray[np.uint8]:
    """sRGB of values, N x 3 bytes."""
    linear = linear_colours(values)
    curved = np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    return np.round(255 * curved).astype(np.uint8)


def legend_colours(count: int = 11) -> list[str]:
    """Colours of even steps from -1 to 1, as web colours."""
    return [f"#{bytes(colour).hex()}" for colour in srgb_colours(np.linspace(-1, 1, count))]
