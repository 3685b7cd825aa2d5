"""Translation of the operators of `model.nn.levels` for torch's ONNX exporter.

The exporter runs no kernel: it needs the shapes of their results, and ONNX operators in their
places, GrowPatches and PoolFaces. `export.whole.surface` writes those in standard ones.
"""

from collections.abc import Callable, Sequence

import torch
from onnx.defs import OpSchema
from onnxscript.values import Op, Opset
from torch import Tensor

from meshconv3d.export.whole.surface import DOMAIN
from meshconv3d.model.nn.levels import grow_patches, pool_faces

VERSION = 1
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


@grow_patches.register_fake
def _(faces: Tensor, lengths: Tensor, patch_size: int) -> Tensor:
    return faces.new_empty(faces.shape[0], patch_size)


@pool_faces.register_fake
def _(
    features: Tensor,
    faces: Tensor,
    lengths: Tensor,
    starts: Tensor,
    target: int,
    squared_norm: int,
    literal: int,
) -> tuple[Tensor, Tensor, Tensor, Tensor, Tensor]:
    context = torch.library.get_ctx()
    count, width = context.new_dynamic_size(min=1), context.new_dynamic_size(min=1)
    return (
        faces.new_empty(count, width),
        features.new_empty(count, width),
        faces.new_empty(count, 3),
        lengths.new_empty(3 * count),
        torch.empty_like(starts),
    )


# The types in these signatures tell the exporter which arguments are attributes.


def _grow_patches(faces, lengths, patch_size: int):
    return _GROW_PATCHES(faces, lengths, patch_size=patch_size)


def _pool_faces(
    features,
    faces,
    lengths,
    starts,
    target: int,
    squared_norm: int,
    literal: int,
):
    return _POOL_FACES(
        features,
        faces,
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
