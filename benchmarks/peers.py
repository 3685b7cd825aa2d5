"""Costs of other implementations in yardsticks, measured elsewhere on this kind of machine.

These are quoted, not run here: each peer's own code on meshes of 500 faces, the yardstick timed in
the same process. None stands where nothing was measured.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Peer:
    """arrays_to_scores: one mesh. training_step: forward and backward on 50 meshes."""

    arrays_to_scores: float
    training_step: float


MEASURED_ELSEWHERE = {
    "MeshNet": Peer(3.1, 337),
    "DiffusionNet": Peer(4.5, 40),
    "MeshCNN": Peer(6.4, 582),
    "ExMeshCNN": Peer(11.6, 98),
    "the authors' operators": Peer(25, 861),
}
# The network of DiffusionNet by itself, after its operators were computed.
DIFFUSION_NETWORK_ALONE = 0.26
# Peak memory of their training steps, from the least to the most.
TRAINING_GIGABYTES = (1.0, 2.7)


def show(ours: float, field: str) -> None:
    """Print a field of every peer beside ours, in yardsticks."""
    print("  as measured elsewhere on this kind of machine, in yardsticks:")
    for name, peer in MEASURED_ELSEWHERE.items():
        theirs = getattr(peer, field)
        print(f"    {name:42}{theirs:>10g} {theirs / ours:>8.0f} times ours")
