"""Makes the pages that repeat the code: docs/python.md, the Python reference, from its docstrings,
and docs/settings.md from the descriptions of the settings.

python -m docs.reference
"""

import inspect
from collections.abc import Callable
from pathlib import Path

import meshconv3d
from meshconv3d.model.config import PRESETS, list_settings
from meshconv3d.service.settings import Settings

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

SETTINGS_HEAD = """\
# Settings

Made from their descriptions by `python -m docs.reference`.

## Of the network

`meshconv3d train DATA --out RUN --preset PRESET --set NAME=VALUE` sets one, and
`meshconv3d train --settings` lists them. The presets are the columns: `default`, `objects` for
meshes in many parts, `paper` for the paper to the letter.
[method.md](method.md#which-settings-and-why) says what each was chosen by.
"""

SERVICE_HEAD = """\
## Of the service

A flag of `meshconv3d serve`, or a variable: `--port` or `MESHCONV3D_PORT`.
[operations.md](operations.md) says how to choose them. Defaults are in `meshconv3d serve --help`,
since some depend on the machine.
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
    """The Python reference."""
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


def settings() -> str:
    """The settings of the network and of the service."""
    network = [("setting", *PRESETS, "what it is")]
    network += [
        (f"`{setting.name}`", *setting.presets.values(), setting.about)
        for setting in list_settings()
    ]
    service = [("setting", "what it is")]
    service += [(f"`{name}`", field.description) for name, field in Settings.model_fields.items()]
    return "\n".join((SETTINGS_HEAD, _table(network), SERVICE_HEAD, _table(service)))


def _table(rows: list[tuple[str | None, ...]]) -> str:
    """A table in Markdown; the first row is its head."""
    lines = [
        f"| {' | '.join((cell or '').replace('|', chr(92) + '|') for cell in row)} |"
        for row in rows
    ]
    return "\n".join((lines[0], "|" + " --- |" * len(rows[0]), *lines[1:], ""))


PAGES = {"python.md": reference, "settings.md": settings}

if __name__ == "__main__":
    for name, page in PAGES.items():
        (Path(__file__).parent / name).write_text(page(), encoding="utf-8")
