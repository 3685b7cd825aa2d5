"""Every benchmark has the common interface, and its pictures can be drawn."""

import importlib
import inspect

import numpy as np
import pytest

from benchmarks import plots, suite
from benchmarks.figures import Figure, Findings, line
from benchmarks.growth import exponent
from benchmarks.suite import ROOT
from tests.benchmarks.runs import findings, run_of


@pytest.mark.parametrize("name", suite.BENCHMARKS)
def test_a_benchmark_takes_a_model_and_gives_findings(name):
    run = importlib.import_module(f"benchmarks.{name}").run
    signature = inspect.signature(run, eval_str=True)
    assert list(signature.parameters) == ["model_name"]
    assert signature.return_annotation is Findings


def test_every_benchmark_is_listed():
    commands = {
        path.stem
        for path in (ROOT / "benchmarks").glob("*.py")
        if "\ndef run(model_name" in path.read_text() or "\ndef main(" in path.read_text()
    }
    commands.add("paper")  # a package
    assert commands - {"__main__"} == {*suite.BENCHMARKS, *suite.BY_THEMSELVES}


@pytest.mark.parametrize(
    ("figure", "end"),
    [
        (Figure(1.0, "ms"), "1 ms"),
        (Figure(1.0, "ms", 1.0), "goal 1: met"),
        (Figure(1.1, "ms", 1.0), "goal 1: missed"),
    ],
)
def test_a_figure_says_whether_its_goal_is_met(figure, end):
    assert line("time", figure).endswith(end)


@pytest.mark.parametrize("power", [1.0, 1.5])
def test_the_exponent_is_that_of_a_power(power):
    sizes = np.array([500, 5_000, 1_000_000])
    assert exponent(list(sizes), list(3.0 * sizes**power)) == pytest.approx(power)


def test_pictures_are_drawn_of_a_run(tmp_path):
    growth = findings()
    growth.tables = {"read": [{"faces": n, "ms": n / 1e3, "MB": n / 1e2} for n in (500, 5000)]}
    roofline = findings()
    roofline.tables = {
        "stages": {"read": {"floor": 0.1, "measured": 1.0}},
        "nodes": [{"kind": "Gemm", "floor": 0.1, "measured": 1.0}],
    }
    run = run_of(
        growth=growth,
        roofline=roofline,
        latency=findings(**{"prepared arrays to scores": (0.1, "yardsticks")}),
        training_step=findings(**{"ours, in yardsticks": (15.0, "yardsticks")}),
    )
    plots.draw(run, tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        f"performance-{name}.png" for name in ("growth", "peers", "roofline")
    ]
