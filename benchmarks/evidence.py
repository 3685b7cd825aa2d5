"""Deletion test of the evidence: `python -m benchmarks.evidence DATA`.

Takes test meshes of a data set as the network sees them, removes the tenth of the faces that say
most for the winning class, or as many at random, sends what is left through the whole pipeline,
and prints by how much the winner's score falls. Where evidence is only a picture, both fall alike.
"""

import argparse
from pathlib import Path

import numpy as np

from meshconv3d.model.datasets import find_samples
from meshconv3d.model.loading import load_mesh
from meshconv3d.model.mesh import Mesh
from meshconv3d.model.preparation import prepare
from meshconv3d.service.classifier import Classifier


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0] if __doc__ else None)
    parser.add_argument("data", type=Path, help="folder laid out as CLASS/{train,test}/*.obj")
    parser.add_argument("--split", type=Path, help="CSV with the columns class,file,split")
    parser.add_argument("--model", default="shrec11", help="shipped model or model file")
    parser.add_argument("--meshes", type=int, help="only so many test meshes, drawn at random")
    parser.add_argument("--share", type=float, default=0.1, help="of the faces to remove")
    arguments = parser.parse_args()

    classifier = Classifier.load(arguments.model)
    budget = classifier.model.card.config.face_budget
    rng = np.random.default_rng(0)
    paths = [s.path for s in find_samples(arguments.data, arguments.split) if s.split == "test"]
    if arguments.meshes:
        paths = rng.choice(np.array(paths, object), arguments.meshes, replace=False).tolist()
    falls: dict[str, list[float]] = {"most evidence": [], "least evidence": [], "random": []}
    lost = dict.fromkeys(falls, 0)
    for path in paths:
        mesh = prepare(load_mesh(path), budget)[0]
        whole = classifier.run(mesh, {})
        winner = int(np.argmax(whole.prediction.scores))
        shares = whole.contributions(winner)
        orders = {
            "most evidence": np.argsort(-shares),
            "least evidence": np.argsort(shares),
            "random": rng.permutation(len(shares)),
        }
        for title, order in orders.items():
            kept = np.sort(order[round(arguments.share * len(order)) :])
            rest = Mesh(whole.prepared.vertices, whole.prepared.faces[kept])
            left = classifier.classify(rest)
            falls[title].append(float(whole.prediction.scores[winner] - left.scores[winner]))
            lost[title] += int(np.argmax(left.scores)) != winner
    print(f"{arguments.model} on {len(paths)} test meshes of {arguments.data.name}")
    print(f"faces removed ({arguments.share:.0%})  fall of the winner's score  another class wins")
    for title, values in falls.items():
        spread = f"{np.mean(values):.2f} (median {np.median(values):.2f})"
        print(f"  {title:19}  {spread:26}  {lost[title] / len(paths):18.1%}")
    more = np.array(falls["most evidence"]) > np.array(falls["random"])
    print(f"most evidence falls deeper than random on {more.mean():.1%} of the meshes")


if __name__ == "__main__":
    main()
