"""Limits: each is kept to the unit, by every format, and pieces are read as the whole is."""

import loading_builders as build
import pytest

from meshconv3d.model.errors import LimitExceeded
from meshconv3d.model.loading import Limits, load_mesh

SPELLINGS = pytest.mark.parametrize(
    ("extension", "data"), build.SPELLINGS.values(), ids=build.SPELLINGS.keys()
)


def refused(data: bytes, extension: str, **limits: int) -> LimitExceeded:
    with pytest.raises(LimitExceeded) as caught:
        load_mesh(data, extension, Limits(**limits))
    error = caught.value
    (limit,) = limits.items()
    assert (error.limit, error.value) == limit
    assert error.fault == f"too-many-{error.limit.replace('_', '-')}"
    assert str(error.value) in str(error)
    return error


@SPELLINGS
def test_vertices_and_faces_are_limited_to_the_one(extension, data):
    vertices = len(load_mesh(data, extension).vertices)
    assert build.is_box(load_mesh(data, extension, Limits(vertices=vertices, faces=12)))
    refused(data, extension, vertices=vertices - 1)
    refused(data, extension, faces=11)


def test_polygons_count_as_triangles():
    for extension, data in (("obj", build.obj([range(8)])), ("off", build.off([range(8)]))):
        assert len(load_mesh(data, extension, Limits(faces=6)).faces) == 6
        refused(data, extension, faces=5)


def test_cutting_concave_polygons_is_limited():
    data = b"v 0 0 0\nv 2 1 0\nv 0 2 0\nv 1 1 0\nf 1 2 3 4\n"
    assert len(load_mesh(data, "obj", Limits(ear_steps=48)).faces) == 2
    refused(data, "obj", ear_steps=47)


def test_placed_parts_count_each_time():
    document, data = build.gltf_document()
    document["nodes"] = [{"mesh": 0}] * 3
    document["scenes"] = [{"nodes": [0, 1, 2]}]
    items = '<item objectid="1"/>' * 3
    package = build.threemf({"3D/3dmodel.model": build.model_xml(build.mesh_xml(), items)})
    # An object and its three items are four.
    for extension, made, geometries in (
        ("glb", build.pack_glb(document, data), 3),
        ("3mf", package, 4),
    ):
        enough = Limits(vertices=24, faces=36, geometries=geometries)
        assert build.is_box(load_mesh(made, extension, enough), boxes=3)
        refused(made, extension, vertices=23)
        refused(made, extension, faces=35)
        refused(made, extension, geometries=geometries - 1)


def test_primitives_over_the_same_positions_share_their_vertices():
    document, data = build.gltf_document()
    document["meshes"][0]["primitives"] *= 4
    mesh = load_mesh(build.pack_glb(document, data), "glb", Limits(vertices=8))
    assert len(mesh.vertices) == 8
    assert build.is_box(mesh, boxes=4)


def test_values_of_a_document_are_limited():
    document, data = build.gltf_document()
    document["extras"] = [0] * 100
    made = build.pack_glb(document, data)
    assert build.is_box(load_mesh(made, "glb", Limits(values=250)))
    refused(made, "glb", values=100)


def test_an_archive_is_limited():
    model = build.model_xml(build.mesh_xml())
    package = build.threemf({"3D/3dmodel.model": model, "photo.png": "x" * 10_000})
    enough = Limits(entries=2, unpacked_bytes=len(model))
    assert build.is_box(load_mesh(package, "3mf", enough))
    refused(package, "3mf", entries=1)
    refused(package, "3mf", unpacked_bytes=len(model) - 1)
    refused(package, "3mf", unpacked_bytes_per_byte=1)
