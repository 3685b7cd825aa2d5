"""glTF and GLB: scenes, and every feature that would be read wrongly is refused."""

import json

import loading_builders as build
import numpy as np
import pytest

from meshconv3d.model.errors import MalformedFile, MeshError, UnusableMesh
from meshconv3d.model.loading import load_mesh

HALF = [0, 0, 0.7071067811865476, 0.7071067811865476]  # a quarter turn around z


def box_at(x, y, z):
    return build.VERTICES + np.array([x, y, z])


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
        assert np.allclose(first, 2 * box_at(5, 0, 0))
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


@pytest.mark.parametrize(
    ("component", "most"), [(5120, 127), (5121, 255), (5122, 32767), (5123, 65535)]
)
def test_normalized_positions_span_one(component, most):
    document, data = build.gltf_document()
    thirds = (
        np.array([[-1, 0, 1], [1, 0, 0], [0, 1 / 3, 1]])
        if component in (5120, 5122)
        else (np.array([[0, 1, 0], [1, 0, 0], [0, 1 / 3, 1]]))
    )
    number, data = build.add_array(
        document, data, np.round(thirds * most), "VEC3", component, normalized=True
    )
    document["meshes"][0]["primitives"] = [{"attributes": {"POSITION": number}}]
    assert np.allclose(load(document, data).vertices, thirds, atol=0.5 / most)


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


@pytest.mark.parametrize("key", ["extensionsRequired", "extensionsUsed"])
def test_extensions_that_move_vertices_and_are_not_read_are_named(key):
    document, data = build.gltf_document()
    document[key] = ["MPEG_mesh_linking"]
    with pytest.raises(MalformedFile, match="MPEG_mesh_linking"):
        load(document, data)


def test_required_extensions_that_nobody_knows_are_named():
    document, data = build.gltf_document()
    document["extensionsRequired"] = ["ACME_secret"]
    with pytest.raises(MalformedFile, match="ACME_secret"):
        load(document, data)


def test_extensions_of_looks_are_no_hindrance():
    document, data = build.gltf_document()
    document["extensionsRequired"] = ["KHR_materials_unlit", "KHR_texture_transform"]
    document["extensionsUsed"] = ["ACME_secret"]
    assert build.is_box(load(document, data))


def test_positions_without_data_are_refused():
    document, data = build.gltf_document()
    del document["accessors"][0]["bufferView"]
    with pytest.raises(MalformedFile, match="no data"):
        load(document, data)


@pytest.mark.parametrize("based", [True, False])
def test_sparse_accessors_replace_rows(based):
    """With a view the rows of that are replaced, without one those of zeros."""
    document, data = build.gltf_document()
    rows = [1, 2, 3, 4, 5, 6, 7]
    at, data = build.add_array(document, data, rows, "SCALAR", 5121)
    values, data = build.add_array(document, data, build.VERTICES[rows], "VEC3", 5126)
    wrong, data = build.add_array(document, data, 7 - build.VERTICES * 0, "VEC3", 5126)
    views = [document["accessors"].pop()["bufferView"] for _ in (wrong, values, at)]
    sparse = {
        "count": len(rows),
        "indices": {"bufferView": views[2], "componentType": 5121},
        "values": {"bufferView": views[1]},
    }
    document["accessors"][0]["sparse"] = sparse
    if based:
        document["accessors"][0]["bufferView"] = views[0]
        mesh = load(document, data)
        assert mesh.vertices[0].tolist() == [7, 7, 7]
        assert np.array_equal(mesh.vertices[1:], build.VERTICES[1:])
    else:
        del document["accessors"][0]["bufferView"]
        assert build.is_box(load(document, data))
    for key, value in (("count", 9), ("values", {}), ("indices", {"bufferView": views[2]})):
        document["accessors"][0]["sparse"] = sparse | {key: value}
        with pytest.raises(MalformedFile):
            load(document, data)
    document["accessors"][0]["sparse"] = sparse
    document["accessors"][0]["count"] = 7
    with pytest.raises(MalformedFile, match="past its end"):
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


@pytest.mark.parametrize("roots", [[0], [0, 1], [1, 0, 1], [1]])
def test_a_node_is_drawn_once_under_its_parent_whatever_else_lists_it(roots):
    document, data = build.gltf_document()
    document["nodes"] = [{"children": [1, 1], "translation": [5, 0, 0]}, {"mesh": 0}]
    document["scenes"] = [{"nodes": roots}]
    mesh = load(document, data)
    assert build.is_box(mesh)
    assert mesh.vertices[:, 0].min() == 5


def test_hidden_nodes_are_not_drawn_nor_what_is_below_them():
    document, data = build.gltf_document()
    hidden = {"KHR_node_visibility": {"visible": False}}
    document["nodes"] = [{"mesh": 0}, {"children": [2], "extensions": hidden}, {"mesh": 0}]
    document["scenes"] = [{"nodes": [0, 1]}]
    assert build.is_box(load(document, data))


def skinned(joints, weights, types=(5121, 5126), matrices=None, sets=1):
    """The box, whose vertices follow two joints; the nodes of joints are 1 and 2 of three."""
    document, data = build.gltf_document()
    attributes = document["meshes"][0]["primitives"][0]["attributes"]
    for number in range(sets):
        columns = slice(4 * number, 4 * number + 4)
        for name, table, kind in (("JOINTS", joints, types[0]), ("WEIGHTS", weights, types[1])):
            attributes[f"{name}_{number}"], data = build.add_array(
                document, data, np.asarray(table)[:, columns], "VEC4", kind, normalized=kind != 5126
            )
    skin: dict = {"joints": [1, 2]}
    document["skins"] = [skin]
    if matrices is not None:
        stored = np.asarray(matrices).transpose(0, 2, 1).reshape(-1, 16)
        skin["inverseBindMatrices"], data = build.add_array(document, data, stored, "MAT4", 5126)
    document["nodes"] = [
        # The transform of a skinned node is ignored, and that of those above it.
        {"children": [3], "scale": [9, 9, 9]},
        {"translation": [10, 0, 0]},
        {"translation": [0, 20, 0], "rotation": HALF},
        {"mesh": 0, "skin": 0, "translation": [100, 0, 0]},
    ]
    document["scenes"] = [{"nodes": [0, 1, 2]}]
    return document, data


FIRST, SECOND = [[0, 1, 0, 0]] * 8, [[1, 0, 0, 0]] * 8
AT_FIRST = box_at(10, 0, 0)
AT_SECOND = np.stack([-build.VERTICES[:, 1], 20 + build.VERTICES[:, 0], build.VERTICES[:, 2]], 1)


@pytest.mark.parametrize("joint_type", [5121, 5123])
@pytest.mark.parametrize(
    ("weight_type", "half"), [(5126, 0.5), (5126, 0.25), (5121, 127), (5123, 32767)]
)
def test_skins_place_vertices_where_joints_are(joint_type, weight_type, half):
    """Weights that do not sum to one are normalised; matrices that are not there change nothing."""
    for table, expected in ((FIRST, AT_FIRST), (SECOND, AT_SECOND)):
        one = np.tile([1.0 if weight_type == 5126 else 255, 0, 0, 0], (8, 1))
        mesh = load(*skinned(table, one, (joint_type, weight_type)))
        assert np.allclose(mesh.vertices, expected, atol=1e-6)
    both = np.tile([half, half, 0, 0], (8, 1))
    mesh = load(*skinned(FIRST, both, (joint_type, weight_type)))
    assert np.allclose(mesh.vertices, (AT_FIRST + AT_SECOND) / 2, atol=1e-6)


def test_inverse_bind_matrices_come_before_the_joints():
    matrix = np.eye(4)
    matrix[:3, 3] = 1, 2, 3
    whole = np.tile([1, 0, 0, 0], (8, 1))
    mesh = load(*skinned(FIRST, whole, matrices=[matrix, np.eye(4)]))
    assert np.allclose(mesh.vertices, box_at(11, 2, 3), atol=1e-6)
    with pytest.raises(MalformedFile, match="inverse bind"):
        load(*skinned(FIRST, whole, matrices=[matrix]))


def test_a_second_set_of_joints_counts_too():
    joints = np.tile([0, 0, 0, 0, 1, 0, 0, 0], (8, 1))
    weights = np.tile([0.5, 0, 0, 0, 0.5, 0, 0, 0], (8, 1))
    mesh = load(*skinned(joints, weights, sets=2))
    assert np.allclose(mesh.vertices, (AT_FIRST + AT_SECOND) / 2, atol=1e-6)
    document, data = skinned(joints, weights)
    attributes = document["meshes"][0]["primitives"][0]["attributes"]
    for number in range(5):
        attributes[f"JOINTS_{number}"] = attributes["JOINTS_0"]
        attributes[f"WEIGHTS_{number}"] = attributes["WEIGHTS_0"]
    with pytest.raises(MalformedFile, match="16 joints"):
        load(document, data)


def test_joints_that_are_none_matter_where_they_have_weight():
    joints, weights = np.tile([0, 200, 0, 0], (8, 1)), np.tile([1.0, 0, 0, 0], (8, 1))
    assert np.allclose(load(*skinned(joints, weights)).vertices, AT_FIRST)
    weights[3] = [0, 1, 0, 0]
    with pytest.raises(MalformedFile, match="joint"):
        load(*skinned(joints, weights))


def test_a_mesh_is_shown_as_each_skin_has_it():
    document, data = skinned(FIRST, np.tile([1, 0, 0, 0], (8, 1)))
    document["skins"].append({"joints": [2, 1]})
    document["nodes"] += [{"mesh": 0, "skin": 1}, {"mesh": 0, "translation": [0, 0, 50]}]
    document["scenes"][0]["nodes"] += [4, 5]
    vertices = np.split(load(document, data).vertices, 3)
    expected = [box_at(0, 0, 50), AT_FIRST, AT_SECOND]
    for table in expected:
        assert any(np.allclose(table, found, atol=1e-6) for found in vertices)


def test_morph_targets_are_applied_as_the_node_or_else_the_mesh_says():
    document, data = build.gltf_document()
    up, data = build.add_array(document, data, np.tile([0, 0, 4], (8, 1)), "VEC3", 5126)
    right, data = build.add_array(document, data, np.tile([2, 0, 0], (8, 1)), "VEC3", 5122)
    document["accessors"].append({"componentType": 5126, "count": 8, "type": "VEC3"})  # of zeros
    mesh = document["meshes"][0]
    mesh["primitives"][0]["targets"] = [
        {"POSITION": up},
        {"POSITION": right},
        {"NORMAL": up},
        {"POSITION": right + 1},
    ]
    for of_mesh, of_node, moved in (
        (None, None, [0, 0, 0]),
        ([0.5, 1, 1, 1], None, [2, 0, 2]),
        ([0.5, 1, 1, 1], [0, 3, 0, 0], [6, 0, 0]),
        ([1], None, [0, 0, 4]),
    ):
        mesh.pop("weights", None)
        mesh |= {"weights": of_mesh} if of_mesh else {}
        document["nodes"] = [{"mesh": 0} | ({"weights": of_node} if of_node else {})]
        assert np.allclose(load(document, data).vertices, build.VERTICES + moved)
    document["accessors"][up]["count"] = 7
    document["nodes"] = [{"mesh": 0, "weights": [1, 1]}]
    with pytest.raises(MalformedFile, match="8 rows"):
        load(document, data)


def instanced(rotation=5126):
    document, data = build.gltf_document()
    at, data = build.add_array(document, data, [[0, 0, 0], [9, 0, 0], [0, 9, 0]], "VEC3", 5126)
    most = {5126: 1, 5120: 127, 5122: 32767}[rotation]
    turns = np.round(np.array([[0, 0, 0, 1], HALF, [0, 0, 1, 0]]) * most, 0 if most > 1 else 9)
    turn, data = build.add_array(
        document, data, turns, "VEC4", rotation, normalized=rotation != 5126
    )
    size, data = build.add_array(document, data, [[1, 1, 1], [2, 2, 2], [1, 1, -1]], "VEC3", 5126)
    attributes = {"TRANSLATION": at, "ROTATION": turn, "SCALE": size, "_ID": 0}
    document["nodes"][0]["extensions"] = {"EXT_mesh_gpu_instancing": {"attributes": attributes}}
    document["nodes"][0]["scale"] = [10, 10, 10]
    document["extensionsUsed"] = ["EXT_mesh_gpu_instancing"]
    return document, data


@pytest.mark.parametrize("rotation", [5126, 5120, 5122])
@pytest.mark.parametrize("required", [True, False])
def test_instances_are_placed_within_their_node(rotation, required):
    document, data = instanced(rotation)
    if required:
        document["extensionsRequired"] = document["extensionsUsed"]
    mesh = load(document, data)
    assert len(mesh.faces) == 36
    assert build.volume(mesh) == pytest.approx(1000 * build.VOLUME * (1 + 8 + 1), rel=1e-3)
    x, y, z = build.VERTICES.T
    expected = [
        build.VERTICES,
        np.stack([9 - 2 * y, 2 * x, 2 * z], axis=1),
        np.stack([-x, 9 - y, -z], axis=1),
    ]
    assert np.allclose(mesh.vertices.reshape(3, 8, 3), 10 * np.array(expected), atol=1)


def test_transforms_of_instances_must_be_as_many():
    document, data = instanced()
    document["accessors"][-1]["count"] = 2
    with pytest.raises(MalformedFile, match="differ in number"):
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


def test_gltf_1_has_skins_and_several_meshes_a_node():
    document, data = build.gltf1_document()
    shape = np.eye(4)
    shape[:3, 3] = 0, 0, 7
    document["nodes"] = {
        "root": {"children": ["leaf"], "translation": [3, 0, 0]},
        "leaf": {"meshes": ["box", "box"], "skin": "skin", "skeletons": ["bone"]},
        "bone": {"jointName": "hip", "translation": [0, 5, 0]},
    }
    document["skins"] = {
        "skin": {"jointNames": ["hip"], "bindShapeMatrix": shape.T.ravel().tolist()}
    }
    joints = (
        np.zeros((8, 4), "<f4").tobytes() + np.tile([1, 0, 0, 0], (8, 1)).astype("<f4").tobytes()
    )
    document["bufferViews"]["third"] = {"buffer": "box", "byteOffset": len(data)}
    common = {"bufferView": "third", "componentType": 5126, "count": 8, "type": "VEC4"}
    document["accessors"] |= {"joints": common, "weights": common | {"byteOffset": 128}}
    attributes = document["meshes"]["box"]["primitives"][0]["attributes"]
    attributes |= {"JOINT": "joints", "WEIGHT": "weights"}
    document["buffers"]["box"] = {"uri": build.data_uri(data + joints)}
    mesh = load_mesh(json.dumps(document).encode())
    assert build.is_box(mesh, boxes=2)
    assert np.allclose(mesh.vertices[:8], box_at(0, 5, 7))
    document["nodes"]["bone"]["jointName"] = "knee"
    with pytest.raises(MalformedFile):
        load_mesh(json.dumps(document).encode())


def test_gltf_1_quantized_attributes_are_decoded():
    document, data = build.gltf1_document()
    data = (build.VERTICES * 100).astype("<u2").tobytes() + data[96:]
    document["accessors"]["points"] |= {
        "componentType": 5123,
        "byteStride": 6,
        "extensions": {
            "WEB3D_quantized_attributes": {
                "decodeMatrix": [0.01, 0, 0, 0, 0, 0.01, 0, 0, 0, 0, 0.01, 0, 4, 5, 6, 1]
            }
        },
    }
    document["bufferViews"]["first"]["byteLength"] = 48
    document["bufferViews"]["second"]["byteOffset"] = 48
    document["buffers"]["box"] = {"uri": build.data_uri(data)}
    mesh = load_mesh(json.dumps(document).encode())
    assert np.allclose(mesh.vertices, box_at(4, 5, 6))


@pytest.mark.parametrize(
    ("kind", "name", "key", "value"),
    [
        ("scenes", "all", "nodes", ["nobody"]),
        ("nodes", "leaf", "meshes", [0]),
        ("nodes", "root", "children", ["root"]),
        ("accessors", "points", "bufferView", "nobody"),
        ("bufferViews", "first", "buffer", None),
        ("bufferViews", "first", "byteLength", 10**9),
        ("accessors", "points", "byteStride", 1),
    ],
)
def test_gltf_1_documents_that_make_no_sense_are_refused(kind, name, key, value):
    document, data = build.gltf1_document()
    document["buffers"]["box"]["uri"] = build.data_uri(data)
    document[kind][name][key] = value
    with pytest.raises(MeshError):
        load_mesh(json.dumps(document).encode())


def draco_box(**changes):
    """The box, packed by Draco; the accessors declare it and hold nothing."""
    DracoPy = pytest.importorskip("DracoPy")
    vertices, faces = build.VERTICES.astype("f4"), build.FACES.astype("u4")
    packed = DracoPy.encode(
        vertices, faces=faces, quantization_bits=14, preserve_order=changes.pop("ordered", False)
    )
    decoded = DracoPy.decode(packed)
    document, _ = build.gltf_document()
    document["bufferViews"] = [{"buffer": 0, "byteLength": len(packed)}]
    document["buffers"] = [{"byteLength": len(packed)}]
    for accessor, count in zip(document["accessors"], (len(decoded.points), 36), strict=True):
        del accessor["bufferView"]
        accessor["count"] = count
    document["accessors"][0] |= changes
    extension = {"bufferView": 0, "attributes": {"POSITION": 0}}
    document["meshes"][0]["primitives"][0]["extensions"] = {"KHR_draco_mesh_compression": extension}
    document["extensionsRequired"] = ["KHR_draco_mesh_compression"]
    return document, packed


@pytest.mark.parametrize("ordered", [True, False])
def test_draco_is_read(ordered):
    document, packed = draco_box(ordered=ordered)
    assert build.is_box(load(document, packed))
    document["meshes"][0]["primitives"] *= 2
    assert build.is_box(load(document, packed), boxes=2)


def test_draco_that_is_not_as_declared_is_refused():
    for document, packed in (draco_box(count=7), draco_box(count=900), draco_box()):
        for data in (packed, packed[:-9], b"OBJ" + packed[3:]):
            if data is packed and document["accessors"][0]["count"] not in (7, 900):
                continue
            with pytest.raises(MalformedFile) as caught:
                load(document, data.ljust(len(packed), b"\0"))
            assert caught.value.fault == "bad-draco"
    document, packed = draco_box()
    document["accessors"][1]["count"] = 39
    with pytest.raises(MalformedFile):
        load(document, packed)


@pytest.mark.parametrize("name", ["KHR_meshopt_compression", "EXT_meshopt_compression"])
def test_meshopt_is_read_in_both_spellings(name):
    document, data = meshopt_box(name)
    assert build.is_box(load(document, data))


def meshopt_box(name):
    """The box, whose positions are packed by meshopt, without a delta that is short; the view's own
    buffer has no data."""
    document, data = build.gltf_document()
    rows = build.VERTICES.astype("<f4").view("u1").reshape(8, 12)
    deltas = np.diff(rows, axis=0, prepend=np.zeros((1, 12), "u1")).astype("i1").astype(int)
    codes = np.where(deltas < 0, -2 * deltas - 1, 2 * deltas).astype("u1")
    columns = b"".join(b"\3" + column.tobytes() + bytes(8) for column in codes.T)
    packed = b"\xa0" + columns + bytes(32)
    document["bufferViews"][0] = {
        "buffer": 1,
        "byteLength": 96,
        "extensions": {
            name: {
                "buffer": 0,
                "byteOffset": len(data),
                "byteLength": len(packed),
                "byteStride": 12,
                "count": 8,
                "mode": "ATTRIBUTES",
            }
        },
    }
    document["buffers"] = [{"byteLength": len(data) + len(packed)}, {"byteLength": 96}]
    document["extensionsRequired"] = [name]
    return document, data + packed
