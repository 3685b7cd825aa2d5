"""MeshConv3D: what is this 3D mesh?

    >>> import meshconv3d
    >>> meshconv3d.load("objects").classify("chair.stl").label
    'chair'

This import is quick: the libraries are imported with the first name that needs them. The folders
`model`, `export` and `service` are links to those of the repository; a wheel holds the files.
"""

import importlib
import os
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from meshconv3d.export.metadata import ModelFileError
    from meshconv3d.model.errors import Error, MeshError
    from meshconv3d.service.classifier import Classifier
    from meshconv3d.service.prediction import Prediction

__all__ = ["Classifier", "Error", "MeshError", "ModelFileError", "Prediction", "load"]

_MODULES = {
    "Classifier": "service.classifier",
    "Error": "model.errors",
    "MeshError": "model.errors",
    "ModelFileError": "export.metadata",
    "Prediction": "service.prediction",
}


def load(model: str | os.PathLike[str] = "objects") -> "Classifier":
    """Load a model and test it on a sample mesh.

    `model` is the name of a shipped model, `"shrec11"` or `"objects"`, or the path of a file that
    `meshconv3d export` has written.

    Raises ModelFileError for any other file, and Error for a model that gives other scores on this
    machine than when it was exported.
    """
    from meshconv3d.service.classifier import Classifier

    return Classifier.load(model)


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    return getattr(importlib.import_module(f"{__name__}.{_MODULES[name]}"), name)
