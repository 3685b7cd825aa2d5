"""Costs of whole tasks: `python -m benchmarks.costs DATA/objects69 SPLIT.csv`.

From the bytes of real files to scores, the median over the test files of a data set; then larger
meshes, arrays, and the command over a folder. In yardsticks, each beside its goal.
"""

import argparse
import statistics
import tempfile
from pathlib import Path

from benchmarks import batch
from benchmarks.figures import Findings, heading
from benchmarks.measuring import best, yardstick
from benchmarks.workloads import as_file, sample, torus
from meshconv3d.model.datasets import find_samples
from meshconv3d.model.errors import MeshError
from meshconv3d.model.preparation import prepare
from meshconv3d.service.classifier import Classifier

# Goals in yardsticks.
REAL_FILE = 0.25
PREPARE_5_000 = 0.14
STL_100_000 = 3.3
ARRAYS_500 = 0.12
FILE_OF_COMMAND = 0.18
FILES = 600


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("data", type=Path)
    parser.add_argument("split", type=Path, help="CSV with the columns class,file,split")
    parser.add_argument("--model", default="objects", help="shipped model or model file")
    arguments = parser.parse_args()
    classifier = Classifier.load(arguments.model)
    budget = classifier.model.card.config.face_budget
    large, small, stl = torus(5_000), sample(), as_file(torus(100_000), "stl")
    times = best(
        {
            "yardstick": yardstick(),
            "prepare": lambda: prepare(large, budget),
            "stl": lambda: classifier.classify(stl, "stl"),
            "arrays": lambda: classifier.classify((small.vertices, small.faces)),
        }
    )
    findings = Findings(times["yardstick"])
    heading(f"One thread; {classifier.model.card.name}")
    files = [s.path for s in find_samples(arguments.data, arguments.split) if s.split == "test"]
    shares = [share for path in files if (share := _share(classifier, path)) is not None]
    title = f"bytes of a real file to scores, median of {len(shares)} of {len(files)}"
    findings.add(title, statistics.median(shares), "yardsticks", REAL_FILE)
    findings.cost("preparation of 5,000 faces", times["prepare"], PREPARE_5_000)
    findings.cost("100,000 faces as STL to scores", times["stl"], STL_100_000)
    findings.cost("arrays of 500 faces to scores", times["arrays"], ARRAYS_500)
    each = _of_command(arguments.model)
    findings.cost(f"each of {FILES} OBJ, by the command", each, FILE_OF_COMMAND)


def _share(classifier: Classifier, path: Path) -> float | None:
    """Yardsticks from the bytes of a file to scores, None for one that is refused."""
    content = path.read_bytes()
    try:
        times = best(
            {"": lambda: classifier.classify(content, path.suffix[1:]), "unit": yardstick()}, 0.05
        )
    except MeshError:
        return None
    return times[""] / times["unit"]


def _of_command(model: str) -> float:
    """Milliseconds that `meshconv3d batch` computes for a file of 500 faces, on one core."""
    content = as_file(sample(), "obj")
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary, "files")
        folder.mkdir()
        for number in range(FILES):
            (folder / f"{number:04}.obj").write_bytes(content)
        way = batch.Way("1 worker", ("--workers", "1", "--model", model))
        done = batch.run(folder, Path(temporary, "results.jsonl"), way)
    return (done.here + done.workers) / FILES * 1000


if __name__ == "__main__":
    main()
