"""What is to be seen in a part of the page."""

from io import BytesIO

import numpy as np
from numpy.typing import NDArray
from PIL import Image
from playwright.sync_api import Locator


def pixels(part: Locator) -> NDArray[np.int16]:
    """Height x width x 3."""
    with Image.open(BytesIO(part.screenshot())) as image:
        return np.asarray(image.convert("RGB"), dtype=np.int16)


def changed(before: NDArray[np.int16], after: NDArray[np.int16]) -> float:
    """The share of pixels that differ clearly."""
    assert before.shape == after.shape
    return float((np.abs(before - after).max(axis=2) > 12).mean())


def orange(image: NDArray[np.int16]) -> float:
    """The share of pixels that are clearly more red than blue."""
    return float((image[..., 0] - image[..., 2] > 60).mean())


def blue(image: NDArray[np.int16]) -> float:
    """The share of pixels that are clearly more blue than red."""
    return float((image[..., 2] - image[..., 0] > 60).mean())
