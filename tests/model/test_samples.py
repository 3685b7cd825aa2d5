"""The sample meshes in the package: small, in many formats, each with its source."""

from pathlib import Path

import meshconv3d.model.samples
from meshconv3d.model.loading import load_mesh
from meshconv3d.model.preparation import prepare
from meshconv3d.model.samples import sample_paths

SOURCES = Path(meshconv3d.model.samples.__file__).with_name("SOURCES.md")


def test_they_are_small_and_show_the_formats_and_kinds_of_preparation() -> None:
    paths = sample_paths().values()
    assert len(paths) == 12
    assert sum(path.stat().st_size for path in paths) < 400_000
    assert {path.suffix[1:] for path in paths} == {
        *("3mf", "amf", "glb", "gltf", "obj", "off", "ply", "stl"),
    }
    resampled = {prepare(load_mesh(path), 500)[1].resampled for path in paths}
    assert resampled >= {"decimated", "subdivided"}


def test_each_names_its_author_and_source() -> None:
    rows = SOURCES.read_text(encoding="utf-8").splitlines()
    named = {row.split("|")[1].strip() for row in rows if row.startswith("| ")}
    assert {path.name for path in sample_paths().values()} <= named
