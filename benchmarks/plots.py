"""The pictures of docs/performance.md, from one run."""

from pathlib import Path

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes

from benchmarks.figures import Findings
from benchmarks.peers import MEASURED_ELSEWHERE
from benchmarks.suite import Run

OURS, OTHERS = "#2a6fbb", "#b0b7bf"


def draw(run: Run, folder: Path) -> None:
    """Write performance-{growth,peers,roofline}.png; `run` is one of all benchmarks."""
    found = run.findings
    figure, (time, memory) = plt.subplots(1, 2, figsize=(10, 4))
    draw_growth(time, found["growth"], "ms", "milliseconds")
    draw_growth(memory, found["growth"], "MB", "MB above what it is given")
    time.legend(fontsize=8)
    _save(figure, folder / "performance-growth.png")

    figure, (mesh, step) = plt.subplots(1, 2, figsize=(10, 3))
    ours = found["latency"].figures["prepared arrays to scores"].value
    draw_peers(mesh, ours, "arrays_to_scores", "one mesh, arrays to scores")
    ours = found["training_step"].figures["ours, in yardsticks"].value
    draw_peers(step, ours, "training_step", "one training step, 50 meshes")
    _save(figure, folder / "performance-peers.png")

    figure, axes = plt.subplots(figsize=(10, 3.4))
    draw_roofline(axes, found["roofline"])
    _save(figure, folder / "performance-roofline.png")


def draw_growth(axes: Axes, growth: Findings, field: str, label: str) -> None:
    """A curve for each stage, and the slopes of F and F log F from the lowest of them."""
    for name, points in growth.tables.items():
        axes.loglog(
            [p["faces"] for p in points], [max(p[field], 1e-2) for p in points], "o-", label=name
        )
    if field == "ms":
        points = min(growth.tables.values(), key=lambda points: points[0]["ms"])
        faces = np.array([p["faces"] for p in points])
        curve = faces * np.log(faces)
        axes.loglog(faces, curve * points[0]["ms"] / curve[0] / 2, "k:", label="F log F")
    axes.set_xlabel("faces")
    axes.set_ylabel(label)
    axes.grid(alpha=0.3)


def draw_peers(axes: Axes, ours: float, field: str, title: str) -> None:
    """Costs in yardsticks, as bars: ours as measured, the others' as quoted."""
    costs = {"MeshConv3D": ours}
    costs |= {name: getattr(peer, field) for name, peer in MEASURED_ELSEWHERE.items()}
    names = sorted(costs, key=lambda name: -costs[name])
    colours = [OURS if name == "MeshConv3D" else OTHERS for name in names]
    bars = axes.barh(names, [costs[name] for name in names], color=colours)
    axes.bar_label(bars, fmt="%.3g", padding=3, fontsize=8)
    axes.set_xscale("log")
    axes.margins(x=0.2)
    axes.set_title(f"{title}; yardsticks", fontsize=10)


def draw_roofline(axes: Axes, roofline: Findings) -> None:
    """Each stage's floor and time, and those of the graph by kind of node."""
    rows = dict(roofline.tables["stages"])
    for node in roofline.tables["nodes"]:
        row = rows.setdefault(f"  {node['kind']}", {"floor": 0.0, "measured": 0.0})
        row["floor"] += node["floor"]
        row["measured"] += node["measured"]
    rows = {name: row for name, row in rows.items() if row["measured"] >= 0.01}
    names = list(rows)
    places = np.arange(len(names))
    axes.bar(places, [rows[n]["measured"] for n in names], color=OTHERS, label="measured")
    axes.bar(places, [rows[n]["floor"] for n in names], color=OURS, width=0.5, label="floor")
    axes.set_xticks(places, names, rotation=45, ha="right", fontsize=8)
    axes.set_ylabel("milliseconds")
    axes.legend()


def _save(figure, path: Path) -> None:
    figure.tight_layout()
    figure.savefig(path, dpi=110)
    plt.close(figure)
