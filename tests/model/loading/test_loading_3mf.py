"""3MF: components, the production extension, and numbers that are none."""

import re

import loading_builders as build
import numpy as np
import pytest

from meshconv3d.model.errors import MalformedFile, MeshError
from meshconv3d.model.loading import load_mesh

ROOT = "3D/3dmodel.model"


def component(identifier, transform="1 0 0 0 1 0 0 0 1 0 0 0", path=""):
    path = f'p:path="{path}" ' if path else ""
    return f'<component {path}objectid="{identifier}" transform="{transform}"/>'


def group(identifier, *components):
    return f'<object id="{identifier}"><components>{"".join(components)}</components></object>'


def moved(x):
    return f"1 0 0 0 1 0 0 0 1 {x} 0 0"


def test_components_and_items_place_meshes():
    objects = build.mesh_xml() + group("2", component("1"), component("1", moved(5)))
    items = f'<item objectid="2" transform="{moved(100)}"/><item objectid="1"/>'
    mesh = load_mesh(build.threemf({ROOT: build.model_xml(objects, items)}))
    assert build.is_box(mesh, boxes=3)
    assert sorted(set(mesh.vertices[:, 0])) == [0, 1, 100, 101, 105, 106]


def test_components_compose_inner_first():
    objects = build.mesh_xml() + group("2", component("1", moved(5)))
    items = '<item objectid="2" transform="2 0 0 0 2 0 0 0 2 1 0 0"/>'
    mesh = load_mesh(build.threemf({ROOT: build.model_xml(objects, items)}))
    assert build.volume(mesh) == pytest.approx(8 * build.VOLUME)
    assert sorted(set(mesh.vertices[:, 0])) == [11, 13]


def test_deep_components_lose_no_instance():
    levels = "".join(
        group(level, *(component(level - 1, moved(x * 10**level)) for x in range(5)))
        for level in (2, 3, 4)
    )
    model = build.model_xml(build.mesh_xml() + levels, '<item objectid="4"/>')
    assert build.is_box(load_mesh(build.threemf({ROOT: model})), boxes=125)


def test_items_of_one_part_number_are_all_placed():
    items = "".join(
        f'<item objectid="1" partnumber="same" transform="{moved(x)}"/>' for x in (0, 5, 10)
    )
    model = build.model_xml(build.mesh_xml(), items)
    assert build.is_box(load_mesh(build.threemf({ROOT: model})), boxes=3)


def test_production_parts_hold_several_objects_with_the_same_ids_as_the_root():
    other = build.model_xml(build.mesh_xml() + build.mesh_xml(identifier="2"), "")
    path = "/3D/Objects/Other.model"
    objects = group("1", component("1", path=path), component("2", moved(5), path=path))
    objects += group("2", component("1", moved(9), path=path))
    items = '<item objectid="1"/><item objectid="2"/>'
    package = build.threemf({ROOT: build.model_xml(objects, items), path[1:]: other})
    assert build.is_box(load_mesh(package), boxes=3)
    direct = build.model_xml("", f'<item objectid="2" p:path="{path}"/>')
    assert build.is_box(load_mesh(build.threemf({ROOT: direct, path[1:]: other})))
    with pytest.raises(MalformedFile, match="no part"):
        load_mesh(build.threemf({ROOT: direct}))


def test_the_root_part_is_the_one_that_the_package_names():
    relation = (
        '<Relationships xmlns="http://schemas.openxmlformats.org/package/2006/relationships">'
        '<Relationship Target="/Models/Box.model" Id="r0" '
        'Type="http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"/></Relationships>'
    )
    box = build.model_xml(build.mesh_xml(), unit="inch")
    parts = {"_rels/.rels": relation, "Models/Box.model": box, "photo.png": "none"}
    assert build.is_box(load_mesh(build.threemf(parts)))


def test_elements_of_extensions_are_not_taken_for_the_core():
    slices = (
        '<s:slicestack xmlns:s="http://schemas.microsoft.com/3dmanufacturing/slice/2015/07" id="9">'
        '<s:slice><s:vertices><s:vertex x="0" y="0"/></s:vertices></s:slice></s:slicestack>'
    )
    assert build.is_box(
        load_mesh(build.threemf({ROOT: build.model_xml(build.mesh_xml() + slices)}))
    )


def test_prefixes_and_encodings_are_those_of_the_text():
    model = build.model_xml(build.mesh_xml()).replace("xmlns=", "xmlns:core=")
    model = re.sub(r"(</?)(\w+)", r"\1core:\2", model)
    assert "<core:vertex " in model
    for encoding in ("utf-8", "utf-8-sig", "utf-16"):
        assert build.is_box(load_mesh(build.threemf({ROOT: model.encode(encoding)})))
    named = model.replace('"1.0"?', '"1.0" encoding="ISO-8859-1"?')
    named = named.replace("<core:object ", '<core:object name="caf\xe9" ')
    assert build.is_box(load_mesh(build.threemf({ROOT: named.encode("latin-1")})))


def test_what_the_build_does_not_place_is_not_loaded():
    objects = build.mesh_xml() + build.mesh_xml(identifier="2")
    assert build.is_box(load_mesh(build.threemf({ROOT: build.model_xml(objects)})))


@pytest.mark.parametrize("bad", ["1,0", "one", "", "1 1", "0x1"])
def test_numbers_that_are_none(bad):
    box = build.mesh_xml()
    for model in (
        box.replace('x="1"', f'x="{bad}"').replace('x="1.0"', f'x="{bad}"'),
        box[::-1].replace('"0.3"=z'[::1], f'"{bad[::-1]}"=z', 1)[::-1],
        box[::-1].replace('"7"=3v', f'"{bad[::-1]}"=3v', 1)[::-1],
    ):
        assert model != box
        with pytest.raises(MalformedFile):
            load_mesh(build.threemf({ROOT: build.model_xml(model)}))


@pytest.mark.parametrize(
    "model",
    [
        build.model_xml(group("1", component("1"))),
        build.model_xml(group("1", component("2")) + group("2", component("1"))),
        build.model_xml(group("1", component("9"))),
        build.model_xml(build.mesh_xml(), '<item objectid="1" transform="1 2 3"/>'),
        build.model_xml(build.mesh_xml()).replace("?>", "?><!DOCTYPE model>"),
        build.model_xml(build.mesh_xml()).replace(
            "?>", '?><!DOCTYPE model [<!ENTITY a SYSTEM "file:///etc/hostname">]>'
        ),
        build.model_xml(build.mesh_xml()).replace(
            "<model ", '<model xmlns:q="http://acme.example/secret/1" requiredextensions="q" '
        ),
        "<model>",
        "<other/>",
    ],
)
def test_models_that_make_no_sense_are_refused(model):
    with pytest.raises(MeshError):
        load_mesh(build.threemf({ROOT: model}))


def test_a_zip_that_is_no_3mf():
    with pytest.raises(MalformedFile, match="no 3MF package"):
        load_mesh(build.threemf({"letter.txt": "hello"}), "3mf")


@pytest.mark.parametrize("target", ["/3D/a b.model", "3D/a b.model", "./3D/./a%20b.model"])
@pytest.mark.parametrize("name", ["3D/a b.model", "3d/A%20b.model", "/3D\\a b.model"])
def test_references_are_relative_to_the_package_and_may_be_escaped(target, name):
    kind = "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"
    relation = f'<Relationships><Relationship Target="{target}" Type="{kind}"/></Relationships>'
    box = build.model_xml(build.mesh_xml())
    assert build.is_box(load_mesh(build.threemf({"_rels/.rels": relation, name: box})))


@pytest.mark.parametrize("path", ["/3D/Objects/b.model", "Objects/b.model", "3D/Objects/b.model"])
def test_references_of_parts_are_relative_to_their_folder(path):
    root = build.model_xml("", f'<item objectid="1" p:path="{path}"/>')
    box = build.model_xml(build.mesh_xml(), "")
    assert build.is_box(load_mesh(build.threemf({ROOT: root, "3D/Objects/b.model": box})))


def volume(first, last, *settings):
    keys = "".join(
        f'<metadata type="volume" key="{key}" value="{value}"/>' for key, value in settings
    )
    return f'<volume firstid="{first}" lastid="{last}">{keys}</volume>'


@pytest.mark.parametrize("name", ["Slic3r_PE_model.config", "SuperSlicer_model.config"])
@pytest.mark.parametrize(
    "setting",
    [
        ("volume_type", "ParameterModifier"),
        ("volume_type", "NegativeVolume"),
        ("volume_type", "SupportBlocker"),
        ("volume_type", "SupportEnforcer"),
        ("modifier", "1"),
    ],
)
def test_volumes_that_prusaslicer_does_not_print_are_left_out(name, setting):
    three = np.concatenate([build.FACES] * 3)
    part = ("volume_type", "ModelPart"), ("modifier", "0")
    volumes = volume(0, 11, *part) + volume(12, 23, ("name", "a"), setting) + volume(24, 35)
    config = f'<config><object id="1">{volumes}</object><object id="7">{volumes}</object></config>'
    model = build.model_xml(build.mesh_xml(three))
    package = {ROOT: model, f"Metadata/{name}": config}
    assert build.is_box(load_mesh(build.threemf(package)), boxes=2)
    # An old one, which is no XML behind a name with an ampersand.
    package[f"Metadata/{name}"] = config.replace('<object id="7">', "<a b='&'/>")
    assert build.is_box(load_mesh(build.threemf(package)), boxes=2)


@pytest.mark.parametrize(
    "subtype", ["modifier_part", "negative_part", "support_enforcer", "support_blocker"]
)
def test_parts_that_bambustudio_does_not_print_are_left_out(subtype):
    path = "/3D/Objects/a.model"
    other = build.model_xml(build.mesh_xml() + build.mesh_xml(identifier="2"), "")
    objects = group("8", component("1", path=path), component("2", moved(5), path=path))
    config = (
        '<config><object id="8"><metadata key="name" value="a"/><part id="1" '
        f'subtype="normal_part"/><part id="2" subtype="{subtype}"/></object></config>'
    )
    package = {
        ROOT: build.model_xml(objects, '<item objectid="8"/>'),
        path[1:]: other,
        "Metadata/model_settings.config": config,
    }
    mesh = load_mesh(build.threemf(package))
    assert build.is_box(mesh)
    assert mesh.vertices[:, 0].max() == 1


@pytest.mark.parametrize("kind", ["support", "solidsupport"])
def test_objects_that_are_supports_are_left_out(kind):
    support = build.mesh_xml(identifier="2").replace("<object ", f'<object type="{kind}" ')
    items = '<item objectid="1"/><item objectid="2"/>'
    model = build.model_xml(build.mesh_xml() + support, items)
    assert build.is_box(load_mesh(build.threemf({ROOT: model})))
