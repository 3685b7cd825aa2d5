"""Comparison of the outputs of a model file with those that they should be."""

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

TOLERANCE = 1e-4
OUTPUTS = ("scores", "evidence", "novelty", "embedding")

Runs = Mapping[str, Mapping[str, NDArray]]
"""The outputs of several runs by their names, by the title of each run."""


class ParityError(RuntimeError):
    """The file computes something else, by more than the tolerance or in shape."""


def compare_outputs(found: Runs, expected: Runs, source: str) -> dict[str, float]:
    """Largest difference of each output, relative to its largest expected value in any run.

    source: whose outputs are expected. Raises ParityError listing every failure.
    """
    worst = dict.fromkeys(OUTPUTS, 0.0)
    scales = {
        name: max(float(np.abs(outputs[name]).max()) for outputs in expected.values())
        for name in OUTPUTS
    }
    failures = []
    for title, outputs in expected.items():
        for name in OUTPUTS:
            difference = relative_difference(found[title][name], outputs[name], scales[name])
            worst[name] = max(worst[name], difference)
            if not difference <= TOLERANCE:
                failures.append(f"{title}: {name} differs by {difference:.2e}")
    if failures:
        raise ParityError(
            f"the file does not compute what {source} does (tolerance {TOLERANCE:g}, relative):"
            "\n  " + "\n  ".join(failures)
        )
    return {name: float(f"{value:.3g}") for name, value in worst.items()}


def relative_difference(found: NDArray, expected: NDArray, scale: float) -> float:
    """Largest absolute difference over `scale`; infinite if the shapes differ."""
    if found.shape != expected.shape:
        return float("inf")
    return float(np.abs(found - expected).max() / max(scale, 1e-12))
