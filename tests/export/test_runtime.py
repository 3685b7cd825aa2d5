"""Models at run time."""

import subprocess
import sys
from pathlib import Path

import pytest

from tests.commands import environment

# Runs a graph on more faces than fit into so many bytes beyond those of the process.
RUN_OUT = """
import resource, sys
from pathlib import Path

from meshconv3d.export.runtime import run
from meshconv3d.model.topology.inputs import collate, mesh_inputs
from meshconv3d.service.models import open_model
from tests.meshes import sheet

model = open_model(sys.argv[1])
small, large = (collate([mesh_inputs(sheet(n, n), model.card.config)]) for n in (10, 200))
run(model.session, ["scores"], small)
pages = int(Path("/proc/self/statm").read_text().split()[0])
most = pages * resource.getpagesize() + int(sys.argv[2])
resource.setrlimit(resource.RLIMIT_AS, (most, resource.RLIM_INFINITY))
try:
    run(model.session, ["scores"], large)
except MemoryError:
    print("MemoryError")
run(model.session, ["scores"], small)
"""


@pytest.mark.parametrize("spare", [0, 8 * 2**20])
def test_memory_that_runs_out_inside_onnxruntime_is_a_memory_error(
    model_file: Path, spare: int
) -> None:
    done = subprocess.run(
        [sys.executable, "-c", RUN_OUT, str(model_file), str(spare)],
        capture_output=True,
        text=True,
        env=environment(),
        cwd=Path(__file__).parents[2],
    )
    assert (done.stdout, done.stderr) == ("MemoryError\n", "")
