"""What else the graph could be: `python -m benchmarks run alternatives`.

The sums over patches in other forms of onnxruntime's operations, beside the exported one and the
compiled loops of training, which no graph can call; then the whole graph under other options of a
session, and with its weights as eight-bit integers, with how far that moves the scores of the
samples.
"""

import tempfile
from pathlib import Path

import numpy as np
import onnx
from numpy.typing import NDArray

from benchmarks.figures import MILLISECONDS, Findings, heading
from benchmarks.measuring import best, yardstick
from benchmarks.stages import OUTPUTS
from benchmarks.workloads import sample
from meshconv3d.export.runtime import onnxruntime, session_options
from meshconv3d.model.loading import load_mesh
from meshconv3d.model.nn.cpu_autograd import gather_patches
from meshconv3d.model.preparation import prepare
from meshconv3d.model.samples import sample_paths
from meshconv3d.model.topology.inputs import collate, mesh_inputs
from meshconv3d.service.models import ModelFile

STACKED = """
        rows = Gather <axis = 0> (table, {index})
        centre = Unsqueeze (features, {axis})
        differences = Sub (rows, centre)
        distances = Abs (differences)
        sums = ReduceSum <keepdims = 0> (rows, {axis})
        far = ReduceSum <keepdims = 0> (distances, {axis})"""
# Sums of a patch's rows, and of their absolute differences to the face. `slots` are the columns of
# the patches, so that one row of them is one slot of all faces.
SUMS = {
    "side by side, as exported": STACKED.format(index="patches", axis="one"),
    "distances as norms": """
        rows = Gather <axis = 0> (table, patches)
        centre = Unsqueeze (features, one)
        differences = Sub (rows, centre)
        sums = ReduceSum <keepdims = 0> (rows, one)
        far = ReduceL1 <keepdims = 0> (differences, one)""",
    "distances from the greater": """
        rows = Gather <axis = 0> (table, patches)
        centre = Unsqueeze (features, one)
        greater = Max (rows, centre)
        sums = ReduceSum <keepdims = 0> (rows, one)
        many = ReduceSum <keepdims = 0> (greater, one)
        twice = Add (many, many)
        all = Mul (features, count)
        apart = Sub (twice, sums)
        far = Sub (apart, all)""",
    "slots before faces": STACKED.format(index="slots", axis="zero"),
    "a gather for each slot": """
        {slots}
        sums = Sum ({rows})
        far = Sum ({distances})""",
}
SLOT = """
        slot{k} = Gather <axis = 0> (slots, at{k})
        row{k} = Gather <axis = 0> (table, slot{k})
        difference{k} = Sub (row{k}, features)
        distance{k} = Abs (difference{k})"""

OTHER_OPTIONS = {
    "without an arena": {"enable_cpu_mem_arena": False},
    "without a memory pattern": {"enable_mem_pattern": False},
}


def run(model_name: str) -> Findings:
    """Measure and print; the model by name or file."""
    findings = Findings(best({"yardstick": yardstick()})["yardstick"])
    model = ModelFile.read(model_name)
    config = model.open().card.config
    meshes = [sample(), *map(load_mesh, sample_paths().values())]
    prepared = [prepare(mesh, config.face_budget)[0] for mesh in meshes]
    inputs = [collate([mesh_inputs(mesh, config)]) for mesh in prepared]
    descriptors = 3 if config.integral_invariants else 2
    widths = (descriptors * config.descriptor_channels, *config.channels)
    for level, width in enumerate(widths[: config.levels]):
        compare_sums(findings, inputs[0][f"patches_{level}"][:, 1:], width)
    compare_graphs(findings, model.content, inputs)
    return findings


def compare_sums(findings: Findings, patches: NDArray[np.int32], width: int) -> None:
    """Print the time of every form over the patches of a level, with so many channels. All give
    the same, which is checked."""
    faces, slots = patches.shape
    table = np.maximum(np.random.default_rng(0).normal(size=(faces + 1, width)), 0)
    table = table.astype(np.float32)
    table[0] = 0
    given = {"table": table, "features": table[1:], "patches": patches, "slots": patches.T.copy()}
    sessions = {name: _sums(form, slots) for name, form in SUMS.items()}
    results = [session.run(None, given) for session in sessions.values()]
    for result in results[1:]:
        for found, expected in zip(result, results[0], strict=True):
            np.testing.assert_allclose(np.asarray(found), np.asarray(expected), 1e-4, 1e-4)
    statistics = np.empty((faces, 3 * width), np.float32)

    def loops() -> None:
        gather_patches(given["features"], given["patches"], 0, True, statistics)

    loops()
    for found, expected in zip(np.split(statistics, 3, axis=1)[1:], results[0], strict=True):
        np.testing.assert_allclose(found, np.asarray(expected), 1e-4, 1e-4)
    heading(f"Sums over {slots} neighbours of {faces} faces, {width} channels")
    calls = {name: lambda s=s: s.run(None, given) for name, s in sessions.items()}
    times = best({**calls, "compiled loops, in no graph": loops}, seconds=0.5)
    for name, elapsed in times.items():
        findings.add(f"{faces} faces: {name}", elapsed, MILLISECONDS)


def _sums(form: str, slots: int) -> onnxruntime.InferenceSession:
    """A session on the sums alone."""
    each = {name: ", ".join(f"{name}{k}" for k in range(slots)) for name in ("row", "distance")}
    nodes = form.format(
        slots="".join(SLOT.format(k=k) for k in range(slots)),
        rows=each["row"],
        distances=each["distance"],
    )
    constants = {"zero": "int64[1] zero = {0}", "one": "int64[1] one = {1}"}
    constants["count"] = f"float[1] count = {{{slots}}}"
    constants |= {f"at{k}": f"int64 at{k} = {{{k}}}" for k in range(slots)}
    used = ", ".join(text for name, text in constants.items() if f", {name})" in nodes)
    model = onnx.parser.parse_model(f"""
        <ir_version: 10, opset_import: ["" : 18]>
        sums (float[M, C] table, float[N, C] features, int32[N, K] patches, int32[K, N] slots)
            => (float[N, C] sums, float[N, C] far) <{used}> {{{nodes}
        }}""")
    content = model.SerializeToString()
    return onnxruntime.InferenceSession(content, session_options(content))


def compare_graphs(findings: Findings, content: bytes, inputs: list[dict[str, NDArray]]) -> None:
    """Print the time of the first input under every way to run a graph, and how far the scores of
    all inputs move, relative to the largest."""
    sessions = {"as it is": _session(content, {})}
    sessions |= {name: _session(content, options) for name, options in OTHER_OPTIONS.items()}
    sessions["weights of eight bits"] = _session(_quantized(content), {})
    exact = _scores(sessions["as it is"], inputs)
    heading("The graph")
    times = best({n: lambda s=s: s.run(OUTPUTS, inputs[0]) for n, s in sessions.items()})
    for name, elapsed in times.items():
        findings.add(name, elapsed, MILLISECONDS)
        moved = np.abs(_scores(sessions[name], inputs) - exact).max(axis=1)
        print(f"    scores move by {(moved / np.abs(exact).max(axis=1)).max():.1e} at most")


def _scores(
    session: onnxruntime.InferenceSession, inputs: list[dict[str, NDArray]]
) -> NDArray[np.float32]:
    """One row for each input."""
    return np.concatenate([np.asarray(session.run(["scores"], arrays)[0]) for arrays in inputs])


def _session(content: bytes, options: dict[str, bool]) -> onnxruntime.InferenceSession:
    chosen = session_options(content)
    for name, value in options.items():
        setattr(chosen, name, value)
    return onnxruntime.InferenceSession(content, chosen)


def _quantized(content: bytes) -> bytes:
    from onnxruntime.quantization import quantize_dynamic  # noqa: TID251 (it has been told by now)

    model = onnx.load_from_string(content)
    del model.graph.value_info[:]  # of types that change
    with tempfile.TemporaryDirectory() as folder:
        before, after = Path(folder, "before.onnx"), Path(folder, "after.onnx")
        onnx.save(model, before)
        quantize_dynamic(before, after)
        return after.read_bytes()
