"""Makes docs/python.md, the Python reference, from the docstrings.

python -m docs.reference > docs/python.md
"""

import inspect
from collections.abc import Callable

import meshconv3d

HEAD = """\
# Python

Made from the docstrings by `python -m docs.reference`.

```python
import numpy as np
import trimesh

import meshconv3d

objects = meshconv3d.load("objects")
result = objects.classify("model/samples/car.glb")
print(result.label, result.unknown)  # car False

mesh = trimesh.load_mesh("model/samples/train.stl")
print(objects.classify(mesh).label)  # train
print(objects.classify((np.array(mesh.vertices), np.array(mesh.faces))).label)  # train

found, failed = objects.classify_many(["model/samples/house.3mf", "nothing.stl"])
print(found.label, isinstance(failed, meshconv3d.MeshError), failed.fault)  # house True unreadable
```

`meshconv3d` is the one name that is installed. It is typed (`py.typed`). Modules below it, such as
`meshconv3d.service`, may change with each version. The first mesh after an installation takes some
seconds longer: kernels are compiled, and kept.
"""

# The parts of the reference: a heading, an object, and the members that are described with it.
PARTS = (
    ("load", meshconv3d.load, ()),
    ("Classifier", meshconv3d.Classifier, ("classify", "classify_many")),
    ("Prediction", meshconv3d.Prediction, ("top",)),
    ("Error", meshconv3d.Error, ()),
    ("MeshError", meshconv3d.MeshError, ()),
    ("ModelFileError", meshconv3d.ModelFileError, ()),
)


def reference() -> str:
    """The page."""
    sections = [HEAD]
    for name, thing, members in PARTS:
        title = f"meshconv3d.{name}{_signature(thing) if inspect.isfunction(thing) else ''}"
        sections.append(f"## `{title}`\n\n{inspect.getdoc(thing)}\n")
        for member in members:
            method = getattr(thing, member)
            sections.append(
                f"### `{name}.{member}{_signature(method)}`\n\n{inspect.getdoc(method)}\n"
            )
    return "\n".join(sections)


def _signature(function: Callable[..., object]) -> str:
    """Names and defaults of the arguments, without types."""
    parameters = [
        parameter.replace(annotation=parameter.empty)
        for name, parameter in inspect.signature(function).parameters.items()
        if name != "self"
    ]
    return str(inspect.Signature(parameters))


if __name__ == "__main__":
    print(reference(), end="")  # noqa: T201 (the page)
