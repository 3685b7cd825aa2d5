"""Where workers come from: imported by the process that forks them, so that each starts in a
fraction of a second, with all libraries loaded and all kernels compiled."""

import signal
import sys
from pickle import UnpicklingError
from types import TracebackType

import meshconv3d.service.workers.tasks  # noqa: F401 (that it is loaded is the point)
from meshconv3d.model.config import NetworkConfig
from meshconv3d.model.loading import load_mesh
from meshconv3d.model.preparation import prepare
from meshconv3d.model.samples import sample_paths
from meshconv3d.model.topology.inputs import mesh_inputs

# Who stops a service may signal all its processes at once, as a terminal does. This one and the
# workers go on until the service has finished what it accepted: they end when it does.
signal.signal(signal.SIGTERM, signal.SIG_IGN)
signal.signal(signal.SIGINT, signal.SIG_IGN)


def _told(kind: type[BaseException], error: BaseException, trace: TracebackType | None) -> None:
    """Say nothing of a worker that cannot be told what it is to do: who asked for it is gone."""
    if not issubclass(kind, EOFError | UnpicklingError):
        sys.__excepthook__(kind, error, trace)


sys.excepthook = _told

# The samples come in all formats, with too many faces and too few.
_config = NetworkConfig(classes=("this", "that"))
for _path in sample_paths().values():
    mesh_inputs(prepare(load_mesh(_path), _config.face_budget)[0], _config)
