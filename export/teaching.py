"""Teaching: classes of a user's own on the features of a trained model, without torch or gradients.

Each class is the direction of the mean of its examples' features, whitened by a covariance that all
classes share: that of the base model, until there are many examples. The class with the smallest
angle wins, as in SimpleShot (Wang et al., 2019): a mean of few examples is too long by their noise,
and a discriminant by distance (Fisher, 1936) gets a fourth fewer right from one example. A score is
linear in the features, so that it stays an exact sum over faces. The result is a file of
the base's kind: its graph with another head.
"""

import base64
import hashlib
import json
import re
import zlib
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from datetime import date
from functools import cached_property
from typing import Any, Self

import numpy as np
import onnx
from numpy.typing import NDArray
from onnx import numpy_helper

from meshconv3d.export.metadata import ModelCard, ModelFileError, Probe, read_card
from meshconv3d.export.runtime import graph_inputs, open_session, run
from meshconv3d.model.calibration import Calibration, calibrate, softmax
from meshconv3d.model.mesh import Mesh
from meshconv3d.model.preparation import prepare

# Properties of a taught file that hold its examples' features and, of its base, the within-class
# whitening matrix above what may be of none of the classes, so that it can be taught more.
EXAMPLES, BASE = "meshconv3d-examples", "meshconv3d-base"
# The tensor of the graph that multiplies the features of each face, C x N_c.
EVIDENCE_WEIGHT = "classify.weight.transposed"
# Divides all scores: a temperature near 1 then fits them.
SCALE = 8.0
TINY = 1e-12
# An example is doubted if the others give another class at least this probability.
DOUBTED = 0.9
# Classes with fewer examples are named to the user.
ENOUGH = 5
# Pairs of confused classes that a card names.
MOST_PAIRS = 20
# With fewer examples that can be left out, probabilities and the limit of unknown are guesses.
LEAST_CALIBRATED = 10
# Share of the left-out examples that is unknown: each is farther from the few others of its class
# than a new mesh is from all of them.
LEFT_OUT_REFUSED = 0.1


@dataclass(frozen=True, eq=False)
class Examples:
    """Examples to learn from: for each its file's name, class (an index) and features, M x C."""

    classes: tuple[str, ...]
    files: tuple[str, ...]
    labels: NDArray[np.int64]
    features: NDArray[np.float32]

    @classmethod
    def of(
        cls, names: Sequence[str], files: Sequence[str], features: Sequence[NDArray[np.float32]]
    ) -> Self:
        """Examples of which each has the name of its class, its file and its features, C.

        Features are rounded to half precision, as a model file keeps them.
        """
        classes = tuple(sorted(set(names)))
        labels = np.array([classes.index(name) for name in names], np.int64)
        stacked = np.stack(features) if features else np.zeros((0, 0), np.float32)
        return cls(classes, tuple(files), labels, stacked.astype("<f2").astype(np.float32))

    @cached_property
    def counts(self) -> NDArray[np.int64]:
        """Number of examples of each class, N_c."""
        return np.bincount(self.labels, minlength=len(self.classes))

    def joined(self, other: Self) -> Self:
        """These and others; classes of one name become one, an example of one name is replaced."""
        rows: dict[tuple[str, str], NDArray] = {}
        for each in (self, other):
            names = (each.classes[label] for label in each.labels)
            rows |= zip(zip(names, each.files, strict=True), each.features, strict=True)
        names, files = zip(*rows, strict=True)
        return self.of(names, files, list(rows.values()))

    def distinct(self) -> tuple[Self, list[list[str]]]:
        """One example of each mesh in a class, and the files of each mesh that had several."""
        groups: dict[tuple[int, bytes], list[int]] = {}
        for row, (label, features) in enumerate(zip(self.labels, self.features, strict=True)):
            groups.setdefault((int(label), features.tobytes()), []).append(row)
        kept = [group[0] for group in groups.values()]
        files = tuple(self.files[row] for row in kept)
        copies = [[self.files[row] for row in group] for group in groups.values() if len(group) > 1]
        return type(self)(self.classes, files, self.labels[kept], self.features[kept]), copies

    def to_property(self) -> str:
        """Text for the metadata of a model file."""
        packed = zlib.compress(self.features.astype("<f2").tobytes(), 9)
        return json.dumps(
            {
                "classes": self.classes,
                "files": self.files,
                "labels": self.labels.tolist(),
                "features": base64.b64encode(packed).decode(),
            }
        )

    @classmethod
    def from_property(cls, text: str) -> Self:
        """The examples of a taught file. Raises ModelFileError."""
        try:
            values = json.loads(text)
            features = np.frombuffer(zlib.decompress(base64.b64decode(values["features"])), "<f2")
            labels = np.array(values["labels"], np.int64)
            return cls(
                tuple(values["classes"]),
                tuple(values["files"]),
                labels,
                features.reshape(len(labels), -1).astype(np.float32),
            )
        except (ValueError, KeyError, TypeError, zlib.error) as error:
            raise ModelFileError(f"the examples in the model file are damaged: {error}") from None


@dataclass(frozen=True, eq=False)
class Head:
    """Scores, features @ weight.T + bias, and the parameters of `model.nn.feature_space.Novelty`.

    weight: N_c x C. bias: N_c. within: C x C. means: N_c x C. others: N_o x C.
    """

    weight: NDArray[np.float32]
    bias: NDArray[np.float32]
    within: NDArray[np.float32]
    means: NDArray[np.float32]
    others: NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class LeftOut:
    """What the other examples say of each example that is not the only one of its class.

    members: their M' numbers among the examples. labels: M'. scores: M' x N_c. novelty: M'.
    """

    members: NDArray[np.int64]
    labels: NDArray[np.int64]
    scores: NDArray[np.float64]
    novelty: NDArray[np.float64]

    @property
    def accuracy(self) -> float:
        """Share of them that the others classify rightly."""
        return float(np.mean(self.scores.argmax(axis=1) == self.labels))


class Teacher:
    """A model whose head is replaced by one for other classes."""

    def __init__(self, content: bytes) -> None:
        """content: a model file or a whole-pipeline file. Raises ModelFileError."""
        self._sha256 = hashlib.sha256(content).hexdigest()
        properties = open_session(content).get_modelmeta().custom_metadata_map
        self._graph = onnx.load_model_from_string(content)
        self.card = read_card(properties)
        taught = properties.get(EXAMPLES)
        self.examples = None if taught is None else Examples.from_property(taught)
        """Those that this file was taught with, if any."""
        nodes = {node.output[0]: node for node in self._graph.graph.node}
        self._pooled = nodes["scores"].input[0]
        # The exporter may have transposed the weights of evidence beforehand, or not.
        nodes["evidence"].input[1] = EVIDENCE_WEIGHT
        weight = numpy_helper.to_array(self._tensor("classify.weight"))
        self._replace(EVIDENCE_WEIGHT, np.ascontiguousarray(weight.T))
        self._centre, self._base_within, self._overall = (
            numpy_helper.to_array(self._tensor(f"novelty.{name}")).astype(np.float64)
            for name in ("centre", "within", "overall")
        )
        self._others = self._graph_others()
        if self.examples is not None:
            self._restore_base(properties.get(BASE, ""))
        self._session = self._open_features()

    def _restore_base(self, text: str) -> None:
        """Put the base's whitening matrix and others in the place of the taught ones.

        Raises ModelFileError.
        """
        channels = len(self._centre)
        try:
            flat = np.frombuffer(zlib.decompress(base64.b64decode(text)), "<f4")
            rows = flat.reshape(-1, channels).astype(np.float64)
            if len(rows) < channels:
                raise ValueError("it is too short")
        except (ValueError, zlib.error) as error:
            raise ModelFileError(f"the base in the model file is damaged: {error}") from None
        self._base_within, self._others = rows[:channels], rows[channels:]

    def _graph_others(self) -> NDArray[np.float64]:
        """What may be of none of the classes to teach, whitened, N_o x C, if the graph has room for
        any: the base's meshes of no class, and the means of its classes."""
        if "novelty.others" not in {tensor.name for tensor in self._graph.graph.initializer}:
            return np.zeros((0, len(self._centre)))
        found = [
            numpy_helper.to_array(self._tensor(f"novelty.{name}")) for name in ("others", "means")
        ]
        return np.concatenate(found).astype(np.float64)

    def _tensor(self, name: str) -> onnx.TensorProto:
        """A tensor of the graph by name; it is added if there is none."""
        tensors = self._graph.graph.initializer
        found = next((tensor for tensor in tensors if tensor.name == name), None)
        return tensors.add() if found is None else found

    def _replace(self, name: str, values: NDArray[np.float32]) -> None:
        """Give a tensor of the graph other values."""
        self._tensor(name).CopyFrom(numpy_helper.from_array(values, name))

    def _open_features(self) -> Any:
        """A session on the graph up to the pooled features."""
        graph = onnx.ModelProto()
        graph.CopyFrom(self._graph)
        del graph.graph.output[:]
        kind = onnx.TensorProto.FLOAT
        graph.graph.output.append(
            onnx.helper.make_tensor_value_info(self._pooled, kind, ["batch", len(self._centre)])
        )
        return open_session(graph.SerializeToString())

    def features(self, mesh: Mesh) -> NDArray[np.float32]:
        """The features of a mesh that the head reads, C. Raises UnusableMesh."""
        return self._run(self._session, self._pooled, mesh)

    def _run(self, session: Any, output: str, mesh: Mesh) -> NDArray[np.float32]:
        """One output of a session for a mesh. Raises UnusableMesh."""
        config = self.card.config
        prepared, _ = prepare(mesh, config.face_budget)
        return run(session, [output], graph_inputs(session, prepared, config).arrays)[0][0]

    def fit(self, examples: Examples) -> tuple[Head, LeftOut]:
        """The head for some examples, and what they say of one another."""
        offset = examples.features - self._centre
        base = offset @ self._base_within
        means = _means(base, examples)
        whitening = _whitening(base - means[examples.labels], examples)
        within, others = self._base_within @ whitening, self._strangers(base, examples) @ whitening
        points = offset @ within
        means = _means(points, examples)
        far = np.sum((offset @ self._overall) ** 2, axis=1)
        head = _head(means, within, others, self._centre)
        return head, _leave_one_out(points, means, others, far, examples)

    def _strangers(self, points: NDArray[np.float64], examples: Examples) -> NDArray[np.float64]:
        """`_others` without those that are like a class to teach: nearest to most of its examples.

        points: M x C, of the examples, whitened by the base.
        """
        if not len(self._others):
            return self._others
        nearest = _squares(points, self._others).argmin(axis=1)
        votes = np.zeros((len(examples.classes), len(self._others)))
        np.add.at(votes, (examples.labels, nearest), 1)
        alike = (votes > examples.counts[:, None] / 2).any(axis=0)
        return self._others if alike.all() else self._others[~alike]

    def teach(
        self, name: str, examples: Examples, probe: tuple[str, Mesh], by: str | None = None
    ) -> "Taught":
        """A model file for the classes of some examples.

        probe: a sample's name and mesh, for the self test. by: the teacher, for the card.
        """
        head, left_out = self.fit(examples)
        self._replace("classify.weight", head.weight)
        self._replace("classify.bias", head.bias)
        self._replace(EVIDENCE_WEIGHT, np.ascontiguousarray(head.weight.T))
        self._replace("novelty.within", head.within)
        self._replace("novelty.means", head.means)
        if len(head.others):
            self._replace("novelty.others", head.others)
        for output in self._graph.graph.output:
            if output.name in ("scores", "evidence"):
                output.type.tensor_type.shape.dim[-1].dim_value = len(examples.classes)
        del self._graph.graph.value_info[:]  # shapes inside the graph, some of the old classes
        sample, mesh = probe
        scores = self.features(mesh) @ head.weight.T + head.bias
        record = self._record(examples, by)
        card = replace(
            self.card,
            name=name,
            config=replace(self.card.config, classes=examples.classes),
            training={"taught": record},
            accuracy=_accuracy(left_out, len(examples.files)),
            calibration=self._calibrate(left_out),
            probe=Probe(sample, tuple(round(float(score), 5) for score in scores)),
            about=_about(name, by, record["base"]["name"], examples, left_out),
        )
        base = np.concatenate([self._base_within, self._others]).astype("<f4")
        properties = card.to_properties() | {
            EXAMPLES: examples.to_property(),
            BASE: base64.b64encode(zlib.compress(base.tobytes(), 9)).decode(),
        }
        onnx.helper.set_model_props(self._graph, properties)
        content = self._graph.SerializeToString()
        found = self._run(open_session(content), "scores", mesh)
        if not np.allclose(found, scores, rtol=1e-4, atol=1e-4):
            raise ModelFileError("the base model's graph is not one that its export writes")
        return Taught(content, card, left_out)

    def _calibrate(self, left_out: LeftOut) -> Calibration | None:
        """The calibration on examples that were left out; embeddings are those of the base, and so
        is what is calibrated of them."""
        if len(left_out.labels) < LEAST_CALIBRATED:
            return None
        same_shape = self.card.calibration and self.card.calibration.same_shape
        return calibrate(
            left_out.scores,
            left_out.novelty,
            left_out.labels,
            same_shape,
            refused=LEFT_OUT_REFUSED,
        )

    def _record(self, examples: Examples, by: str | None) -> dict[str, Any]:
        """What the card says of the teaching."""
        base = {"name": self.card.name, "sha256": self._sha256}
        if self.examples is not None:  # its own base is the base of what is added to it
            base = self.card.training["taught"]["base"]
        counts = dict(zip(examples.classes, examples.counts.tolist(), strict=True))
        return {"base": base, "examples": counts, **({"by": by} if by else {})}


@dataclass(frozen=True, eq=False)
class Taught:
    """A taught model file, its card, and what its examples say of one another."""

    content: bytes
    card: ModelCard
    left_out: LeftOut


def _means(points: NDArray[np.float64], examples: Examples) -> NDArray[np.float64]:
    """Mean of each class, N_c x C."""
    sums = np.zeros((len(examples.classes), points.shape[1]))
    np.add.at(sums, examples.labels, points)
    return sums / examples.counts[:, None]


def _whitening(offset: NDArray[np.float64], examples: Examples) -> NDArray[np.float64]:
    """A matrix, C x C, that gives the examples' offsets from their classes unit covariance.

    That is shrunk towards a multiple of the base's, in whose coordinates they are: by half where
    there are as many examples as channels.
    """
    channels = offset.shape[1]
    freedom = len(offset) - len(examples.classes)
    spread = np.sum(offset**2) / (freedom * channels) if freedom else 1.0
    covariance = (np.eye(channels) * channels * spread + offset.T @ offset) / (channels + freedom)
    return np.linalg.inv(np.linalg.cholesky(covariance)).T


def _head(
    means: NDArray[np.float64],
    within: NDArray[np.float64],
    others: NDArray[np.float64],
    centre: NDArray[np.float64],
) -> Head:
    """The head of classes with these whitened means, N_c x C: its scores part by the angle."""
    weight = means / _lengths(means)[:, None] * _length(means) @ within.T / SCALE
    bias = -weight @ centre
    return Head(*(each.astype(np.float32) for each in (weight, bias, within, means, others)))


def _leave_one_out(
    points: NDArray[np.float64],
    means: NDArray[np.float64],
    others: NDArray[np.float64],
    far: NDArray[np.float64],
    examples: Examples,
) -> LeftOut:
    """Classify each example by the mean and the covariance of the others.

    points, means, others: whitened, M x C, N_c x C and N_o x C. far: M, the distances from all
    classes as one.
    """
    members = np.flatnonzero(examples.counts[examples.labels] > 1)
    labels, points = examples.labels[members], points[members]
    counts = examples.counts[labels]
    here = np.arange(len(labels))
    offsets = points - means[labels]
    own = means[labels] - offsets / (counts - 1)[:, None]  # the means of the others
    classes, means = len(means), np.concatenate([means, others])
    squares = _squares(points, means)
    squares[here, labels] = np.sum((points - own) ** 2, axis=1)
    products, lengths = points @ means.T, np.tile(np.sum(means**2, axis=1), (len(points), 1))
    products[here, labels] = np.sum(points * own, axis=1)
    lengths[here, labels] = np.sum(own**2, axis=1)
    # Along the offset that is lost.
    along_means = offsets @ means.T
    along_means[here, labels] = np.sum(offsets * own, axis=1)
    along = np.sum(points * offsets, axis=1)[:, None]
    # Sherman and Morrison: the covariance is a sum, which loses one product of offsets.
    total = points.shape[1] + len(examples.labels) - len(examples.classes)
    share = counts / (counts - 1) / total
    lost = 1 - share * np.sum(offsets**2, axis=1)
    gain = (share / np.maximum(lost, 1e-9))[:, None]
    squares = (squares + gain * (along - along_means) ** 2) * (total - 1) / total
    products = (products + gain * along * along_means) * (total - 1) / total
    lengths = (lengths + gain * along_means**2) * (total - 1) / total
    scores = products / np.sqrt(np.maximum(lengths, TINY)) * _length(means[:classes]) / SCALE
    scores = scores[:, :classes]
    background = far[members]
    if len(others):
        background = (background + squares[:, classes:].min(axis=1)) / 2
    return LeftOut(members, labels, scores, squares[:, :classes].min(axis=1) - background)


def _lengths(means: NDArray[np.float64]) -> NDArray[np.float64]:
    """Length of each whitened mean, N_c."""
    return np.sqrt(np.maximum(np.sum(means**2, axis=1), TINY))


def _length(means: NDArray[np.float64]) -> float:
    """Typical length of the means, which scales the scores as distances would."""
    return float(np.sqrt(np.mean(_lengths(means) ** 2)))


def _squares(points: NDArray[np.float64], means: NDArray[np.float64]) -> NDArray[np.float64]:
    """Squared distance of each point from each mean, M x N_c."""
    lengths = np.sum(points**2, axis=1)[:, None] + np.sum(means**2, axis=1)
    return np.maximum(lengths - 2 * points @ means.T, 0)


def _accuracy(left_out: LeftOut, examples: int) -> dict[str, Any]:
    if not len(left_out.labels):
        return {}
    share = round(left_out.accuracy, 5)
    return {"selection": "leave one out", "left_out": share, "examples": examples}


def _about(name: str, by: str | None, base: str, examples: Examples, left_out: LeftOut) -> str:
    """Description in Markdown."""
    author = f" by {by}" if by else ""
    lines = [
        f"# {name}",
        "",
        f"Taught{author} on {date.today().isoformat()} with {len(examples.files)} examples of "
        f"{len(examples.classes)} classes, on the features of `{base}`.",
    ]
    if len(left_out.labels):
        lines.append(
            f"Of {len(left_out.labels)} examples that were left out one by one, the others "
            f"classify {left_out.accuracy:.1%} rightly."
        )
    lines += ["", "| class | examples |", "|---|---|"]
    rows = zip(examples.classes, examples.counts.tolist(), strict=True)
    lines += [f"| {_escaped(label)} | {count} |" for label, count in rows]
    if pairs := confusions(examples, left_out):
        lines += ["", "Taken for another class:", ""]
        lines += [
            f"- {_escaped(right)} for {_escaped(given)}: {count}"
            for right, given, count in pairs[:MOST_PAIRS]
        ]
    return "\n".join(lines) + "\n"


def _escaped(name: str) -> str:
    """A name as text of Markdown, also in a table."""
    return re.sub(r"([\\`*<|\[])", r"\\\1", name)


def in_several_classes(examples: Examples) -> list[list[str]]:
    """Groups of examples that are one mesh, and are not all of one class: their files."""
    groups: dict[bytes, list[int]] = {}
    for row, features in enumerate(examples.features):
        groups.setdefault(features.tobytes(), []).append(row)
    return [
        [examples.files[row] for row in group]
        for group in groups.values()
        if len(set(examples.labels[group].tolist())) > 1
    ]


def doubted(examples: Examples, left_out: LeftOut, temperature: float) -> list[tuple[str, str]]:
    """Examples that look mislabelled: the file, and the class that the others give it."""
    shares = softmax(left_out.scores / temperature)
    found = []
    for member, label, share in zip(left_out.members, left_out.labels, shares, strict=True):
        best = int(share.argmax())
        if best != label and share[best] >= DOUBTED:
            found.append((examples.files[member], examples.classes[best]))
    return found


def confusions(examples: Examples, left_out: LeftOut) -> list[tuple[str, str, int]]:
    """Classes, right and given, and how many left-out examples; the most frequent first."""
    given = left_out.scores.argmax(axis=1)
    pairs = Counter(
        (examples.classes[label], examples.classes[best])
        for label, best in zip(left_out.labels.tolist(), given.tolist(), strict=True)
        if label != best
    )
    return [(*pair, count) for pair, count in pairs.most_common()]
