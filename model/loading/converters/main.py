"""Program of a converter process: `main.py SCRIPT INPUT OUTPUT SECONDS BYTES`.

Writes what the script's function `read` makes of the input: a GLB; or meshes (vertices V x 3,
corners and counts of polygons), which of them are shown, and the matrices (4 x 4, of column
vectors) that place these. A script refuses a file by `sys.exit` with the reason.
"""

import ctypes
import errno
import os
import resource
import runpy
import signal
import sys
from pathlib import Path

import numpy as np

NO_MEMORY, NO_ROOM = 3, 4  # exit statuses


def main() -> None:
    """Read the input within the bounds, and write the output."""
    script, source, target, seconds, size = sys.argv[1:]
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(1, signal.SIGKILL)  # PR_SET_PDEATHSIG: ends with its parent
    for what, most in (("CPU", int(seconds)), ("FSIZE", int(size)), ("CORE", 0)):
        resource.setrlimit(getattr(resource, f"RLIMIT_{what}"), (most, most))
    with open(target, "wb") as file:
        try:
            found = runpy.run_path(script)["read"](Path(source))
            if isinstance(found, bytes):
                file.write(found)
            else:
                np.savez(file, **_arrays(*found))
            file.flush()
        except SystemExit as refusal:
            np.savez(file, refusal=str(refusal))
        except MemoryError:
            os._exit(NO_MEMORY)
        except OSError as error:
            os._exit(NO_ROOM if error.errno == errno.ENOSPC else 1)
        except Exception:
            os._exit(1)
    os._exit(0)  # frees nothing, where some libraries crash


def _arrays(meshes: list[tuple], shown: list[int], matrices: list[np.ndarray]) -> dict:
    """All meshes one after another; sizes: how many vertices, corners and polygons each has."""
    if not meshes:
        sys.exit("the file shows no mesh; export one")
    vertices, corners, counts = map(np.concatenate, zip(*meshes, strict=True))
    return {
        "vertices": vertices.astype(np.float64),
        "corners": corners.astype(np.int64),
        "counts": counts.astype(np.int64),
        "sizes": np.array([tuple(map(len, mesh)) for mesh in meshes]),
        "shown": np.array(shown),
        "matrices": np.array(matrices),
    }


if __name__ == "__main__":
    main()
