"""How torch's exporter writes the operators of `model.nn.operators` into an ONNX graph."""

from collections.abc import Callable, Sequence

import torch
from onnx.defs import OpSchema
from onnxscript.values import Op, Opset

import meshconv3d.model.nn.operators  # noqa: F401 (defines torch.ops.meshconv3d)
from meshconv3d.export.operators import DOMAIN, VERSION

REAL, WHOLE, PRECISE = "tensor(float)", "tensor(int32)", "tensor(double)"


def _operator(
    name: str, inputs: Sequence[str], outputs: Sequence[str], attributes: Sequence[str]
) -> Op:
    schema = OpSchema(
        name,
        DOMAIN,
        VERSION,
        inputs=[OpSchema.FormalParameter(f"input_{i}", kind) for i, kind in enumerate(inputs)],
        outputs=[OpSchema.FormalParameter(f"output_{i}", kind) for i, kind in enumerate(outputs)],
        attributes=[OpSchema.Attribute(name, OpSchema.AttrType.INT) for name in attributes],
    )
    return Op(Opset(DOMAIN, VERSION), name, schema)


_GROW_PATCHES = _operator("GrowPatches", [WHOLE, PRECISE], [WHOLE], ["patch_size"])
_POOL_FACES = _operator(
    "PoolFaces",
    [REAL, WHOLE, PRECISE, WHOLE],
    [WHOLE, REAL, WHOLE, PRECISE, WHOLE],
    ["target", "squared_norm", "literal"],
)


# The exporter learns from these signatures which arguments are attributes.


def _grow_patches(twin, lengths, patch_size: int):
    return _GROW_PATCHES(twin, lengths, patch_size=patch_size)


def _pool_faces(
    features,
    twin,
    lengths,
    starts,
    target: int,
    squared_norm: int,
    literal: int,
):
    return _POOL_FACES(
        features,
        twin,
        lengths,
        starts,
        target=target,
        squared_norm=squared_norm,
        literal=literal,
    )


TRANSLATIONS: dict[Callable, Callable] = {
    torch.ops.meshconv3d.grow_patches.default: _grow_patches,
    torch.ops.meshconv3d.pool_faces.default: _pool_faces,
}
