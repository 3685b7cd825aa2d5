"""Simplification beside libigl's qslim: `python -m benchmarks run decimation`.

With `python -m benchmarks.decimation FOLDER [COUNT]`: how far the surfaces of real meshes, drawn at
random from the files under a folder, move as each brings them to 500 faces.
"""

import argparse
from collections.abc import Callable
from pathlib import Path

import igl
import numpy as np
from numpy.typing import NDArray

from benchmarks.figures import MILLISECONDS, Findings, heading
from benchmarks.measuring import best, yardstick
from benchmarks.workloads import torus
from meshconv3d.model.errors import MeshError
from meshconv3d.model.loading import find_meshes, load_mesh
from meshconv3d.model.mesh import Mesh
from meshconv3d.model.preparation import face_areas, surface_area
from meshconv3d.model.preparation.cleaning import CleanSurface, clean
from meshconv3d.model.preparation.simplification import simplify
from meshconv3d.service.models import open_model

FACES = 100_000
# Share of the time of qslim that ours may take.
OF_QSLIM = 0.1
BUDGET = 500
# Points of each surface whose distance from the other is measured.
POINTS = 4000

Simplifier = Callable[[CleanSurface, int], tuple[NDArray[np.float64], NDArray]]


def ours(surface: CleanSurface, budget: int) -> tuple[NDArray[np.float64], NDArray]:
    return simplify(surface.vertices, surface.faces, surface.twin, budget)[:2]


def qslim(surface: CleanSurface, budget: int) -> tuple[NDArray[np.float64], NDArray]:
    columns = np.asfortranarray(surface.vertices), np.asfortranarray(surface.faces)
    vertices, faces = igl.qslim(*columns, budget)[:2]
    return np.asarray(vertices), np.asarray(faces)


def run(model_name: str) -> Findings:
    """Measure and print, to the face budget of a model by name or file."""
    budget = open_model(model_name).card.config.face_budget
    surface = clean(torus(FACES))
    times = best(
        {
            "yardstick": yardstick(),
            "ours": lambda: ours(surface, budget),
            "qslim": lambda: qslim(surface, budget),
        }
    )
    findings = Findings(times["yardstick"])
    heading(f"{len(surface.faces):,} faces to {budget}, one thread")
    findings.add("ours", times["ours"], MILLISECONDS)
    findings.add("qslim", times["qslim"], MILLISECONDS)
    findings.add("ours over qslim", times["ours"] / times["qslim"], "times", OF_QSLIM)
    return findings


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("folder", type=Path)
    parser.add_argument("count", type=int, nargs="?", default=120)
    arguments = parser.parse_args()
    files = find_meshes(arguments.folder)
    surfaces: list[CleanSurface] = []
    for i in np.random.default_rng(0).permutation(len(files)):
        try:
            surface = clean(load_mesh(files[i]))
        except MeshError:
            continue
        if len(surface.faces) >= 2 * BUDGET:
            surfaces.append(surface)
        if len(surfaces) == arguments.count:
            break
    print(f"{len(surfaces)} meshes of {2 * BUDGET} faces or more, to {BUDGET}")
    print(f"{'':12}Hausdorff distance, %   mean distance, %   area kept            above")
    print(f"{'':12}of the diagonal, at     of the diagonal    at 5 / 50 / 95 %     the budget")
    print(f"{'':12}50 / 95 %")
    simplifiers: dict[str, Simplifier] = {"ours": ours, "qslim": qslim}
    for name, simplifier in simplifiers.items():
        found = np.array([compare(surface, *simplifier(surface, BUDGET)) for surface in surfaces])
        farthest, mean, area, faces = found.T
        print(
            f"{name:12}{np.median(farthest):.2f} / {np.percentile(farthest, 95):<16.2f}"
            f"{np.mean(mean):<19.3f}"
            f"{' / '.join(f'{p:.2f}' for p in np.percentile(area, [5, 50, 95])):21}"
            f"{np.count_nonzero(faces > BUDGET)}"
        )


def compare(
    surface: CleanSurface, vertices: NDArray[np.float64], faces: NDArray
) -> tuple[float, float, float, int]:
    """Hausdorff and mean distance, both ways, in % of the diagonal; area kept; and faces."""
    before, after = Mesh(surface.vertices, surface.faces), Mesh(vertices, faces)
    there, back = distances(before, after), distances(after, before)
    percent = 100 / np.linalg.norm(np.ptp(surface.vertices, axis=0))
    kept = surface_area(after.vertices, after.faces) / surface_area(before.vertices, before.faces)
    farthest = max(there.max(), back.max()) * percent
    return farthest, (there.mean() + back.mean()) / 2 * percent, kept, len(faces)


def distances(one: Mesh, other: Mesh) -> NDArray[np.float64]:
    """From points drawn from one surface to the nearest of the other."""
    rng = np.random.default_rng(0)
    ends = np.cumsum(face_areas(one.vertices, one.faces))
    chosen = np.searchsorted(ends, rng.random(POINTS) * ends[-1]).clip(max=len(ends) - 1)
    a, b, c = one.vertices[one.faces[chosen]].transpose(1, 0, 2)
    root, v = np.sqrt(rng.random((POINTS, 1))), rng.random((POINTS, 1))
    points = (1 - root) * a + root * ((1 - v) * b + v * c)
    faces = other.faces.astype(np.int64)
    squares = igl.point_mesh_squared_distance(points, other.vertices, faces)[0]
    return np.sqrt(np.maximum(squares, 0))


if __name__ == "__main__":
    main()
