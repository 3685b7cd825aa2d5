"""Preparation and pooling of real meshes: `python -m benchmarks.preparation FOLDER`.

Prepares every mesh file under a folder, builds its topology with the paper's K and targets, and
prints what was found, what was done, and how many faces each pooling level ends with.
"""

import argparse
import statistics
import time
from collections import Counter
from pathlib import Path

from meshconv3d.model.config import NetworkConfig
from meshconv3d.model.errors import MeshError
from meshconv3d.model.loading import find_meshes, load_mesh
from meshconv3d.model.mesh import Mesh
from meshconv3d.model.preparation import MeshReport, prepare
from meshconv3d.model.topology.halfedges import find_twins
from meshconv3d.model.topology.inputs import mesh_inputs


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("folder", type=Path)
    folder = parser.parse_args().folder
    config = NetworkConfig(classes=("any",))
    files = find_meshes(folder)
    if not files:
        parser.error(f"no mesh files under {folder}")
    refused: Counter[str] = Counter()
    reports: list[MeshReport] = []
    levels: list[Counter[int]] = [Counter() for _ in config.targets]
    widths = [1 for _ in config.targets]
    milliseconds: list[float] = []
    nonmanifold_after = 0
    for file in files:
        started = time.perf_counter()
        try:
            mesh, report = prepare(load_mesh(file), config.face_budget)
        except MeshError as error:
            refused[error.fault] += 1
            continue
        milliseconds.append((time.perf_counter() - started) * 1000)
        reports.append(report)
        nonmanifold_after += _is_nonmanifold(mesh)
        topology = mesh_inputs(mesh, config).topology
        assert topology is not None  # pooling is geometric
        for level, count in enumerate(topology.face_counts[1:]):
            levels[level][count] += 1
            widths[level] = max(widths[level], topology.pools[level].shape[1])

    print(f"{len(files)} files, {len(reports)} prepared, refused: {dict(refused) or 'none'}")
    print(f"reading and preparing: median {statistics.median(milliseconds):.1f} ms")
    found = {
        "watertight": sum(r.watertight for r in reports),
        "with borders": sum(r.border_edges > 0 for r in reports),
        "with several components": sum(r.components > 1 for r in reports),
        "with non-manifold edges": sum(r.nonmanifold_edges > 0 for r in reports),
        "with vertices to weld": sum(r.vertices_merged > 0 for r in reports),
        "with winding to turn": sum(r.flipped > 0 for r in reports),
        "decimated": sum(r.resampled == "decimated" for r in reports),
        "subdivided": sum(r.resampled == "subdivided" for r in reports),
        "at the budget or one below": sum(
            config.face_budget - 1 <= r.faces_used <= config.face_budget for r in reports
        ),
        "above the budget": sum(r.faces_used > config.face_budget for r in reports),
        "that lost components": sum(r.components_lost > 0 for r in reports),
        "with area changed by over 20 %": sum(abs(r.area_kept - 1) > 0.2 for r in reports),
        "non-manifold afterwards": nonmanifold_after,
    }
    for title, count in found.items():
        print(f"  {title:32} {count:6}")
    print("faces after each pooling: target, widest gather, then count x meshes")
    for target, level, width in zip(config.targets, levels, widths, strict=True):
        near = sum(n for count, n in level.items() if target - 3 <= count <= target)
        common = ", ".join(f"{count} x {n}" for count, n in level.most_common(4))
        print(f"  {target}  W = {width:3}  within 3 below: {near / len(reports):.1%}  ({common})")


def _is_nonmanifold(mesh: Mesh) -> bool:
    return find_twins(mesh.faces, len(mesh.vertices))[2] > 0


if __name__ == "__main__":
    main()
