"""Models at run time."""

import subprocess
import sys
from pathlib import Path

from tests.commands import environment

# Runs a graph on many faces with ever less memory to spare, until it does not succeed.
RUN_OUT = """
import resource, sys
from pathlib import Path

from meshconv3d.export.runtime import run
from meshconv3d.model.topology.inputs import collate, mesh_inputs
from meshconv3d.service.models import open_model
from tests.meshes import sheet

model = open_model(sys.argv[1])
inputs = collate([mesh_inputs(sheet(100, 100), model.card.config)])
run(model.session, ["scores"], inputs)
for spare in range(32, -1, -1):
    pages = int(Path("/proc/self/statm").read_text().split()[0])
    most = pages * resource.getpagesize() + spare * 2**20
    resource.setrlimit(resource.RLIMIT_AS, (most, resource.RLIM_INFINITY))
    try:
        run(model.session, ["scores"], inputs)
    except MemoryError:
        print("MemoryError")
        break
"""


def test_memory_that_runs_out_inside_onnxruntime_is_a_memory_error(model_file: Path) -> None:
    done = subprocess.run(
        [sys.executable, "-c", RUN_OUT, str(model_file)],
        capture_output=True,
        text=True,
        env=environment(),
        cwd=Path(__file__).parents[2],
    )
    assert (done.stdout, done.stderr) == ("MemoryError\n", "")
