"""Runtimes of other languages give the scores of the package for a whole pipeline."""

import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

import pytest

from meshconv3d.service.models import Model
from tests.examples.conftest import scores_of

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples"


def run(*command: object) -> list[str]:
    done = subprocess.run(
        [str(part) for part in command],
        capture_output=True,
        text=True,
        cwd=EXAMPLES,
        env={"PATH": "/usr/bin:/bin:/usr/local/bin", "ORT_DISABLE_TELEMETRY": "1"},
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.splitlines()


def assert_best(lines: Sequence[str], model: Model, mesh: Path) -> None:
    """Three lines are the three best classes and their scores."""
    expected = list(scores_of(model, mesh).items())[:3]
    found = [line.rsplit(" ", 1) for line in lines]
    assert [name for name, _ in found] == [name for name, _ in expected]
    for (_, ours), (_, theirs) in zip(found, expected, strict=True):
        assert float(ours) == pytest.approx(theirs, abs=1e-3)


@pytest.mark.parametrize("name", ["chair", "wolf", "car"])
def test_python_with_onnxruntime_and_numpy_alone(
    whole_model: Path, model: Model, prepared_samples: dict[str, Path], name: str
) -> None:
    mesh = prepared_samples[name]
    # Isolated from the working folder, in which the package lies.
    lines = run(sys.executable, "-I", EXAMPLES / "any_runtime.py", whole_model, mesh)
    assert_best(lines, model, mesh)


def test_the_example_takes_nothing_of_ours() -> None:
    assert "meshconv3d" not in "".join(
        line
        for line in (EXAMPLES / "any_runtime.py").read_text().splitlines()
        if line.startswith(("import", "from"))
    )
