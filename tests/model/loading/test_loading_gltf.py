"""glTF and GLB: scenes, and every feature that would be read wrongly is refused."""

import json

import loading_builders as build
import numpy as np
import pytest

from meshconv3d.model.errors import MalformedFile, MeshError, UnusableMesh
from meshconv3d.model.loading import load_mesh

HALF = [0, 0, 0.7071067811865476, 0.7071067811865476]  # a quarter turn around z


def load(document, data, pack=build.pack_glb):
    return load_mesh(pack(document, data))


def test_transforms_of_a_scene_are_flattened():
    document, data = build.gltf_document()
    document["nodes"] = [
        {"name": "world", "translation": [10, 0, 0], "children": [1, 2]},
        {"name": "world", "scale": [2, 2, 2], "mesh": 0},
        {"rotation": HALF, "children": [3], "camera": 0},
        {"mesh": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 0, 0, 1]},
        {"name": "not in the scene", "mesh": 0},
    ]
    document["cameras"] = [{"type": "perspective", "perspective": {"yfov": 1, "znear": 1}}]
    for pack in (build.pack_glb, build.pack_gltf):
        mesh = load(document, data, pack)
        assert len(mesh.faces) == 24
        assert build.volume(mesh) == pytest.approx(9 * build.VOLUME)
        parts = mesh.vertices[:8], mesh.vertices[8:]
        first, second = sorted(parts, key=lambda part: -part[:, 2].max())
        assert np.allclose(first, 2 * build.VERTICES + [10, 0, 0])
        x, y, z = (build.VERTICES + np.array([5, 0, 0])).T
        assert np.allclose(second, np.stack([10 - y, x, z], axis=1), atol=1e-6)


def test_a_mirror_does_not_turn_the_solid_inside_out():
    document, data = build.gltf_document()
    document["nodes"][0]["scale"] = [-1, 1, 1]
    assert build.is_box(load(document, data))


def test_meshes_that_no_scene_places_are_taken_as_they_are():
    document, data = build.gltf_document()
    del document["scene"], document["scenes"]
    assert build.is_box(load(document, data))
    del document["nodes"]
    assert build.is_box(load(document, data))


def test_points_and_lines_beside_a_mesh_are_ignored():
    document, data = build.gltf_document()
    for mode in range(4):
        document["meshes"].append({"primitives": [{"attributes": {"POSITION": 0}, "mode": mode}]})
    # The nodes above the mesh hold curves alone.
    document["nodes"] = [
        {"mesh": 4, "translation": [1, 0, 0], "children": [1]},
        {"mesh": 1, "children": [2]},
        {"mesh": 0},
    ]
    mesh = load(document, data)
    assert build.is_box(mesh)
    assert mesh.vertices[:, 0].min() == 1
    document["nodes"] = [{"mesh": 1}]
    with pytest.raises(UnusableMesh) as caught:
        load(document, data)
    assert caught.value.fault == "no-faces"


def test_several_primitives_keep_their_place():
    document, data = build.gltf_document()
    primitives = document["meshes"][0]["primitives"]
    document["meshes"][0]["primitives"] = primitives * 3
    document["nodes"][0]["translation"] = [0, 0, 9]
    mesh = load(document, data)
    assert build.is_box(mesh, boxes=3)
    assert mesh.vertices[:, 2].min() == 9


@pytest.mark.parametrize(("mode", "corners"), [(5, [0, 1, 2, 3]), (6, [0, 1, 3, 2])])
def test_strips_and_fans_are_wound_alike(mode, corners):
    square = load(*build.gltf_document(corners, mode=mode))
    assert len(square.faces) == 2
    a, b, c = (square.vertices[square.faces[:, corner]] for corner in range(3))
    assert np.cross(b - a, c - a).tolist() == [[0, 0, 2], [0, 0, 2]]


def test_interleaved_and_quantized_positions():
    document, data = build.gltf_document()
    table = np.zeros(8, dtype=[("pad", "<u2"), ("position", "<u2", 3), ("normal", "<f4", 3)])
    table["position"] = build.VERTICES
    document["extensionsRequired"] = ["KHR_mesh_quantization"]
    document["accessors"][0] |= {"componentType": 5123, "byteOffset": 2}
    document["bufferViews"] = [
        {"buffer": 0, "byteOffset": 72, "byteLength": table.nbytes, "byteStride": table.itemsize},
        {"buffer": 0, "byteLength": 72},
    ]
    data = data[96:] + table.tobytes()
    document["buffers"][0]["byteLength"] = len(data)
    assert build.is_box(load(document, data))
    document["accessors"][0]["normalized"] = True
    with pytest.raises(MalformedFile, match="normalized"):
        load(document, data)


def test_indices_outside_are_refused_even_beside_another_mesh():
    for index in (8, 65535):
        indices = build.FACES.ravel().copy()
        indices[7] = index
        document, data = build.gltf_document(indices)
        for nodes in ([{"mesh": 0}], [{"mesh": 0}, {"mesh": 0, "translation": [9, 9, 9]}]):
            document["nodes"] = nodes
            document["scenes"] = [{"nodes": list(range(len(nodes)))}]
            with pytest.raises(UnusableMesh) as caught:
                load(document, data)
            assert caught.value.fault == "index-out-of-range"


@pytest.mark.parametrize(
    "extension", ["KHR_draco_mesh_compression", "EXT_meshopt_compression", "ACME_secret"]
)
def test_required_extensions_that_are_not_read_are_named(extension):
    document, data = build.gltf_document()
    document["extensionsRequired"] = [extension]
    with pytest.raises(MalformedFile, match=extension):
        load(document, data)


def test_extensions_of_looks_are_no_hindrance():
    document, data = build.gltf_document()
    document["extensionsRequired"] = ["KHR_materials_unlit", "KHR_texture_transform"]
    document["extensionsUsed"] = ["ACME_secret"]
    assert build.is_box(load(document, data))


def test_draco_that_is_not_declared_is_refused():
    document, data = build.gltf_document()
    del document["accessors"][0]["bufferView"]
    with pytest.raises(MalformedFile, match="Draco"):
        load(document, data)


def test_sparse_accessors_are_refused_where_they_matter():
    document, data = build.gltf_document()
    document["accessors"].append(document["accessors"][0] | {"sparse": {"count": 1}})
    document["meshes"][0]["primitives"][0]["targets"] = [{"POSITION": 2}]
    assert build.is_box(load(document, data))
    document["meshes"][0]["primitives"][0]["attributes"]["POSITION"] = 2
    with pytest.raises(MalformedFile, match="sparse"):
        load(document, data)


@pytest.mark.parametrize(
    ("kind", "key", "value"),
    [
        ("accessors", "count", 9),
        ("accessors", "count", 10**12),
        ("accessors", "count", -1),
        ("accessors", "count", "8"),
        ("accessors", "byteOffset", 4),
        ("accessors", "type", "VEC4"),
        ("accessors", "componentType", 5125),
        ("accessors", "bufferView", 9),
        ("bufferViews", "byteLength", 10**6),
        ("bufferViews", "byteOffset", -4),
        ("bufferViews", "byteStride", 4),
        ("bufferViews", "buffer", 1),
        ("buffers", "byteLength", 10**6),
        ("nodes", "mesh", 1),
        ("nodes", "mesh", -1),
        ("nodes", "children", [0]),
        ("nodes", "children", [1]),
        ("nodes", "matrix", [1, 2, 3]),
        ("scenes", "nodes", [0, 0]),
        ("asset", "version", "1.0"),
    ],
)
def test_documents_that_make_no_sense_are_refused(kind, key, value):
    document, data = build.gltf_document()
    entry = document[kind] if kind == "asset" else document[kind][0]
    entry[key] = value
    with pytest.raises(MeshError):
        load(document, data)
    with pytest.raises(MeshError):
        load_mesh(json.dumps(document).encode(), "gltf")


def test_a_node_of_two_parents_is_refused():
    document, data = build.gltf_document()
    document["nodes"] = [{"children": [2]}, {"children": [2]}, {"mesh": 0}]
    document["scenes"] = [{"nodes": [0, 1]}]
    with pytest.raises(MalformedFile, match="two parents"):
        load(document, data)


def test_trailing_bytes_and_latin1_names():
    document, data = build.gltf_document()
    document["nodes"][0]["name"] = "caf"
    glb = build.pack_glb(document, data).replace(b'"caf"', b'"ca\xe9"')
    assert build.is_box(load_mesh(glb + b"\0\0trailing"))
    assert build.is_box(load_mesh(b"\xef\xbb\xbf" + build.gltf() + b"\n"))


def test_data_uris_without_base64():
    document, data = build.gltf_document()
    escaped = "".join(f"%{byte:02x}" for byte in data)
    document["buffers"][0]["uri"] = "data:application/octet-stream," + escaped
    assert build.is_box(load_mesh(json.dumps(document).encode()))


def test_a_missing_binary_chunk():
    document, _ = build.gltf_document()
    with pytest.raises(MalformedFile):
        load_mesh(json.dumps(document).encode(), "gltf")
