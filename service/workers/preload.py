"""Imported by the fork server, so that each worker is forked with all libraries loaded and all
kernels compiled, in a fraction of a second."""

import os
import signal
import sys
from pickle import UnpicklingError
from types import TracebackType

import numpy as np

import meshconv3d.service.workers.tasks  # noqa: F401 (loading it is the purpose)
from meshconv3d.model.attribution import onto_file
from meshconv3d.model.config import NetworkConfig
from meshconv3d.model.loading import load_mesh, warm_up
from meshconv3d.model.mesh import Mesh
from meshconv3d.model.preparation import prepare
from meshconv3d.model.samples import sample_paths
from meshconv3d.model.topology.inputs import mesh_inputs

# A terminal or a service manager signals all processes of the service at once. The fork server and
# the workers, which inherit this, go on until the service has drained; they end when it closes.
signal.signal(signal.SIGTERM, signal.SIG_IGN)
signal.signal(signal.SIGINT, signal.SIG_IGN)


def _excepthook(kind: type[BaseException], error: BaseException, trace: TracebackType) -> None:
    """Print the error, unless it is of a worker whose service ended before it had its setup."""
    if not issubclass(kind, EOFError | UnpicklingError):
        sys.__excepthook__(kind, error, trace)


sys.excepthook = _excepthook

# Compiling, where no kernels are cached, takes a minute, in which a stop ends the service alone.
_SERVICE = os.getppid()
LOOK_SECONDS = 0.2


def _end_with_service(*_: object) -> None:
    if os.getppid() != _SERVICE:
        os._exit(0)


signal.signal(signal.SIGALRM, _end_with_service)
signal.setitimer(signal.ITIMER_REAL, LOOK_SECONDS, LOOK_SECONDS)
warm_up()
# Between them, the samples take every path but one: all formats, too many faces and too few.
_config = NetworkConfig(classes=("this", "that"), integral_invariants=True)
for _path in sample_paths().values():
    _mesh = load_mesh(_path)
    _prepared, _ = prepare(_mesh, _config.face_budget)
    mesh_inputs(_prepared, _config)
# More parts than faces: of two loose triangles, one is kept.
prepare(Mesh(np.arange(18.0).reshape(6, 3) ** 2, np.arange(6).reshape(2, 3)), 1)
onto_file(np.ones(len(_prepared.faces)), _prepared, _mesh)  # for explanations
signal.setitimer(signal.ITIMER_REAL, 0)
signal.signal(signal.SIGALRM, signal.SIG_DFL)
