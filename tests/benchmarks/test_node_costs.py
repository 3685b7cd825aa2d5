"""Operations and bytes of nodes, counted by hand; and of a real graph's nodes."""

import pytest

from benchmarks.node_costs import cost, product_sides, profile_nodes
from benchmarks.stages import Stages
from benchmarks.workloads import sample
from meshconv3d.model.preparation import prepare
from meshconv3d.service.models import ModelFile


def real(*shapes):
    return [("float", shape) for shape in shapes]


@pytest.mark.parametrize(
    ("kind", "inputs", "outputs", "operations", "moved"),
    [
        # Its weights, 3 x 5, are packed and no input any more.
        ("FusedGemm", real((2, 3), (5,)), real((2, 5)), 2 * 2 * 3 * 5, 4 * (6 + 15 + 10)),
        ("MatMul", real((2, 3), (3, 5)), real((2, 5)), 2 * 2 * 3 * 5, 4 * (6 + 15 + 10)),
        ("Gather", [*real((100, 4)), ("int64", (3,))], real((3, 4)), 0, 48 + 24 + 48),
        ("Sub", real((6, 9, 4), (6, 1, 4)), real((6, 9, 4)), 216, 4 * (216 + 24 + 216)),
        ("ReduceSum", [*real((6, 9, 4)), ("int64", (1,))], real((6, 4)), 216, 4 * 240 + 8),
        ("Concat", real((1, 4), (6, 4)), real((7, 4)), 0, 4 * 56),
        ("Reshape", real((6, 4)), real((24,)), 0, 0),
    ],
)
def test_costs_are_those_counted_by_hand(kind, inputs, outputs, operations, moved):
    assert cost(kind, inputs, outputs) == (operations, moved)


def test_the_nodes_of_a_model_file_hold_its_matrix_products():
    file = ModelFile.read("shrec11")
    model = file.open()
    config, mesh = model.card.config, sample()
    stages = Stages(mesh, prepare(mesh, config.face_budget)[0], config, model)
    nodes = profile_nodes(file.content, stages.arrays)
    assert all(node.milliseconds > 0 for node in nodes)
    columns = [product_sides(node)[2] for node in nodes if node.is_product]
    for width in (*config.channels, config.descriptor_hidden, len(config.classes)):
        assert width in columns
