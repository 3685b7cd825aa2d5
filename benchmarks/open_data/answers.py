"""What people are told of meshes to test on: `python -m benchmarks.open_data.answers DATA`.

DATA is what `python -m benchmarks.open_data` laid out. For each of the two shipped models and each
of its sets, by the code that serves it: how many meshes are answered rightly, how many are unknown,
and of the answers of 0.9 or more how many are wrong. For meshes of classes that were left out, and
for shapes of no class, how many are unknown, and how many have such an answer.

With `--objects69 FOLDER SPLIT`, `objects` also names the test meshes of that set; objects69.csv has
the names that are right for each of its folders, and folders without one are left out.
"""

import argparse
from collections.abc import Iterable, Sequence
from pathlib import Path

from benchmarks.open_data.curation import read_table
from benchmarks.open_data.heads import SHAPES, TESTED
from benchmarks.shapes import make_shapes
from meshconv3d.model.datasets import Sample, list_samples
from meshconv3d.service.classifier import Classifier, MeshSource
from meshconv3d.service.prediction import Prediction

SURE = 0.9


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("data", type=Path)
    parser.add_argument("--objects69", type=Path, nargs=2, metavar=("FOLDER", "SPLIT"))
    arguments = parser.parse_args()
    data = arguments.data
    print(f"{'model':8} {'meshes':20} number   right  unknown  sure  of them wrong")
    for name, more in TESTED.items():
        classifier = Classifier.load(name)
        for part in (name, *(f"{name}_{part}" for part in more)):
            tested = tested_samples(data / name, data / f"{part}.csv")
            show(classifier, part, [s.path for s in tested], [{s.label} for s in tested])
        show(classifier, "classes left out", sorted((data / f"{name}_held_out").glob("*/*")))
        show(classifier, "shapes of no class", make_shapes(*SHAPES["test"]))
    if arguments.objects69:
        table = read_table(Path(__file__).parent / "objects69.csv")
        names = {row["folder"]: set(row["classes"].split()) for row in table}
        tested = [s for s in tested_samples(*arguments.objects69) if s.label in names]
        labels = [names[s.label] for s in tested]
        show(Classifier.load("objects"), "objects69", [s.path for s in tested], labels)


def tested_samples(folder: Path, split_file: Path) -> list[Sample]:
    return [s for s in list_samples(folder, split_file) if s.split == "test"]


def show(
    classifier: Classifier,
    part: str,
    meshes: Iterable[MeshSource],
    labels: Sequence[set[str]] | None = None,
) -> None:
    """Classify and print a row. labels: the classes that are right; None where none is."""
    answers = list(classifier.classify_many(meshes))
    pairs = zip(answers, labels or [set()] * len(answers), strict=True)
    found = [(answer, label) for answer, label in pairs if isinstance(answer, Prediction)]
    right = sum(answer.label in label for answer, label in found) / len(answers)
    unknown = sum(bool(answer.unknown) for answer, _ in found) / len(found)
    sure = [answer.label in label for answer, label in found if answer.probability >= SURE]
    shown = f"{right:6.1%}" if labels else f"{'':6}"
    print(
        f"{classifier.model.card.name:8} {part:20} {len(answers):6}  {shown}  {unknown:6.1%}  "
        f"{len(sure):4}  {sure.count(False):13}",
        flush=True,
    )


if __name__ == "__main__":
    main()
