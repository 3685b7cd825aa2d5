"""Training: AdamW under a one-cycle schedule, deterministic, resumable after a kill."""

import hashlib
import json
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass, field
from functools import cached_property
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import nn

from meshconv3d.model.config import NetworkConfig
from meshconv3d.model.files import write_whole
from meshconv3d.model.nn.checkpoint import Checkpoint, load_tensors, save_tensors
from meshconv3d.model.nn.network import Network, as_tensors
from meshconv3d.model.topology.inputs import collate
from meshconv3d.model.training.augmentation import Augmentation
from meshconv3d.model.training.meshes import LabelledMesh

RESUME_FILE = "resume.safetensors"
LOG_FILE = "log.jsonl"


@dataclass(frozen=True)
class TrainingConfig:
    """Settings of training; with the data they determine the weights."""

    seed: int = 0
    epochs: int = 60
    batch_size: int = 16
    learning_rate: float = 3e-3
    """The peak of the one-cycle schedule."""
    weight_decay: float = 0.05
    label_smoothing: float = 0.1
    copies: int = 10
    """Varied copies of each mesh; an epoch draws one of them or the mesh itself."""
    augmentation: Augmentation = field(default_factory=Augmentation)


class Trainer:
    """Trains a network epoch by epoch and keeps in `folder` what resuming needs.

    versions: for every mesh, itself and its varied copies; each epoch draws one of them.
    start: a network to take the features of, see `Network.take_features`.

    All random choices of an epoch come from generators seeded by (seed, epoch): a run that was
    interrupted and resumed ends with the weights of one that was not.
    """

    def __init__(
        self,
        config: NetworkConfig,
        training: TrainingConfig,
        versions: Sequence[Sequence[LabelledMesh]],
        folder: Path,
        device: str = "cpu",
        start: Network | None = None,
    ) -> None:
        torch.manual_seed(training.seed)
        self.training = training
        self.versions = versions
        self.folder = folder
        self.device = torch.device(device)
        self.start = start
        self.network = Network(config)
        if start is not None:
            self.network.take_features(start)
        self.network.to(self.device)
        self.optimiser = torch.optim.AdamW(
            self.network.parameters(), training.learning_rate, weight_decay=training.weight_decay
        )
        self.batches = max(len(versions) // training.batch_size, 1)
        self.schedule = torch.optim.lr_scheduler.OneCycleLR(
            self.optimiser, training.learning_rate, total_steps=training.epochs * self.batches
        )
        self.loss = nn.CrossEntropyLoss(label_smoothing=training.label_smoothing)
        self.history: list[dict[str, Any]] = []
        folder.mkdir(parents=True, exist_ok=True)

    def run(
        self,
        on_epoch: Callable[[dict[str, Any]], None],
        validate: Callable[[Network], dict[str, Any]] = lambda network: {},
    ) -> Checkpoint:
        """Train to the last epoch. `validate` adds its figures to each epoch's record."""
        for epoch in range(len(self.history), self.training.epochs):
            record = self._train_epoch(epoch) | validate(self.network)
            self.history.append(record)
            self._save()
            on_epoch(record)
        return Checkpoint(self.network.cpu().eval(), training={"protocol": asdict(self.training)})

    def resume(self) -> int:
        """Restore the last finished epoch of a run in the folder; returns the epochs done.

        Raises ValueError if that run had other settings or data.
        """
        path = self.folder / RESUME_FILE
        if not path.exists():
            return 0
        tensors, metadata = load_tensors(path)
        if metadata.get("identity") != self._identity:
            raise ValueError(
                f"{path} belongs to a run with other settings or data; "
                "choose another --out folder, or delete that one to start again"
            )
        self.network.load_state_dict(_with_prefix(tensors, "network."))
        state = json.loads(metadata["optimiser"])
        for name, tensor in _with_prefix(tensors, "optimiser.").items():
            parameter, key = name.split(".", 1)
            state["state"].setdefault(int(parameter), {})[key] = tensor
        self.optimiser.load_state_dict(state)
        self.schedule.load_state_dict(json.loads(metadata["schedule"]))
        self.history = json.loads(metadata["history"])
        return len(self.history)

    @cached_property
    def _identity(self) -> str:
        """Settings, classes, data and start, which must agree for a run to be resumed."""
        data = hashlib.sha256()
        if self.start is not None:
            for tensor in self.start.state_dict().values():
                data.update(tensor.numpy().tobytes())
        for version in chain.from_iterable(self.versions):
            data.update(version.mesh.vertices.tobytes() + version.mesh.faces.tobytes())
            data.update(version.label.to_bytes(4, "little"))
        return json.dumps(
            [json.dumps(asdict(self.network.config)), asdict(self.training), data.hexdigest()],
            sort_keys=True,
        )

    def _save(self) -> None:
        state = self.optimiser.state_dict()
        tensors = {f"network.{k}": v for k, v in self.network.state_dict().items()}
        for parameter, values in state["state"].items():
            tensors |= {f"optimiser.{parameter}.{k}": v for k, v in values.items()}
        metadata = {
            "identity": self._identity,
            "optimiser": json.dumps({"state": {}, "param_groups": state["param_groups"]}),
            "schedule": json.dumps(self.schedule.state_dict()),
            "history": json.dumps(self.history),
        }
        save_tensors(tensors, metadata, self.folder / RESUME_FILE)
        lines = "".join(json.dumps(record) + "\n" for record in self.history)
        write_whole(self.folder / LOG_FILE, lines.encode())

    def _train_epoch(self, epoch: int) -> dict[str, Any]:
        started = time.perf_counter()
        rate = self.schedule.get_last_lr()[0]
        total_loss, right, seen = 0.0, 0, 0
        self.network.train()
        # Dropout draws from torch's own generator.
        state = np.random.SeedSequence([self.training.seed, epoch]).generate_state(1)
        torch.manual_seed(int(state[0]))
        for arrays, labels in self._batches(epoch):
            scores = self.network(*as_tensors(arrays, self.device)).scores
            target = torch.from_numpy(labels).to(self.device)
            loss = self.loss(scores, target)
            self.optimiser.zero_grad()
            loss.backward()
            self.optimiser.step()
            self.schedule.step()
            total_loss += loss.item() * len(labels)
            right += int((scores.argmax(dim=1) == target).sum())
            seen += len(labels)
        return {
            "epoch": epoch + 1,
            "loss": round(total_loss / seen, 5),
            "train_accuracy": round(right / seen, 5),
            "learning_rate": rate,
            "seconds": round(time.perf_counter() - started, 2),
        }

    def _batches(self, epoch: int) -> Iterator[tuple[dict[str, np.ndarray], np.ndarray]]:
        """Augmented batches of one epoch, without the few meshes that fill no batch."""
        rng = np.random.default_rng([self.training.seed, epoch])
        order = rng.permutation(len(self.versions))
        for batch in np.array_split(order[: self.batches * self.training.batch_size], self.batches):
            chosen = [self.versions[i][rng.integers(len(self.versions[i]))] for i in batch]
            inputs = [
                self.training.augmentation.apply(mesh, self.network.config, rng) for mesh in chosen
            ]
            yield collate(inputs), np.array([mesh.label for mesh in chosen], dtype=np.int64)


def _with_prefix(tensors: dict[str, torch.Tensor], prefix: str) -> dict[str, torch.Tensor]:
    return {k.removeprefix(prefix): v for k, v in tensors.items() if k.startswith(prefix)}
