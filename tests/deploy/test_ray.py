"""The file in deploy/ for KubeRay is what it takes, and fits the command."""

import re
import shlex
from pathlib import Path
from typing import Any

import kubernetes_validate
import pytest
import yaml

from meshconv3d.service.cli.batch import batch
from meshconv3d.service.settings import Settings

pytest.importorskip("ray", reason="needs the extra `ray`")

DEPLOY = Path(__file__).parents[2] / "deploy"
# The fields of KubeRay's definitions that are used here.
JOB_FIELDS = {
    "entrypoint": str,
    "shutdownAfterJobFinishes": bool,
    "ttlSecondsAfterFinished": int,
    "rayClusterSpec": dict,
}
CLUSTER_FIELDS = {
    "rayVersion": str,
    "enableInTreeAutoscaling": bool,
    "authOptions": dict,
    "headGroupSpec": dict,
    "workerGroupSpecs": list,
}
HEAD_FIELDS = {"rayStartParams": dict, "template": dict}
WORKER_FIELDS = HEAD_FIELDS | dict.fromkeys(("replicas", "minReplicas", "maxReplicas"), int)
GIB = 2**30


def manifest() -> dict[str, Any]:
    return yaml.safe_load((DEPLOY / "rayjob.yaml").read_text(encoding="utf-8"))


def cluster() -> dict[str, Any]:
    return manifest()["spec"]["rayClusterSpec"]


def groups() -> list[dict[str, Any]]:
    """The head's group, then the workers'."""
    return [cluster()["headGroupSpec"], *cluster()["workerGroupSpecs"]]


def containers() -> list[dict[str, Any]]:
    return [one for group in groups() for one in group["template"]["spec"]["containers"]]


def has_fields(document: dict[str, Any], fields: dict[str, type]) -> bool:
    return set(document) == set(fields) and all(
        isinstance(document[field], kind) for field, kind in fields.items()
    )


def test_kuberay_takes_the_manifest() -> None:
    document = manifest()
    assert set(document) == {"apiVersion", "kind", "metadata", "spec"}
    assert (document["apiVersion"], document["kind"]) == ("ray.io/v1", "RayJob")
    assert has_fields(document["spec"], JOB_FIELDS)
    assert has_fields(cluster(), CLUSTER_FIELDS)
    assert has_fields(cluster()["headGroupSpec"], HEAD_FIELDS)
    for group in cluster()["workerGroupSpecs"]:
        assert has_fields(group, WORKER_FIELDS | {"groupName": str})
        assert group["minReplicas"] <= group["replicas"] <= group["maxReplicas"]


def test_kubernetes_takes_the_pods() -> None:
    for group in groups():
        assert all(isinstance(value, str) for value in group["rayStartParams"].values())
        pod = {"apiVersion": "v1", "kind": "Pod", "metadata": {"name": "pod"}}
        pod["spec"] = group["template"]["spec"]
        kubernetes_validate.validate(pod, kubernetes_validate.latest_version(), strict=True)
        assert pod["spec"]["securityContext"]["runAsNonRoot"] is True
        assert pod["spec"]["enableServiceLinks"] is False


def test_nobody_gets_in_and_nothing_phones_home() -> None:
    assert cluster()["authOptions"] == {"mode": "token"}
    for container in containers():
        assert {"name": "RAY_USAGE_STATS_ENABLED", "value": "0"} in container["env"]
        assert container["securityContext"]["allowPrivilegeEscalation"] is False


def test_every_variable_is_a_setting() -> None:
    known = {f"MESHCONV3D_{field.upper()}" for field in Settings.model_fields}
    for container in containers():
        assert {one["name"] for one in container["env"]} <= known | {"RAY_USAGE_STATS_ENABLED"}


def test_all_nodes_have_one_image_of_one_version() -> None:
    assert len({container["image"] for container in containers()}) == 1
    image = re.search(r"FROM rayproject/ray:([\d.]+)-", (DEPLOY / "ray.Dockerfile").read_text())
    assert image is not None
    assert cluster()["rayVersion"] == image[1]


def test_the_job_is_a_call_that_can_be_gone_on_with() -> None:
    program, command, *arguments = shlex.split(manifest()["spec"]["entrypoint"])
    assert (program, command) == ("meshconv3d", "batch")
    given = batch.make_context("batch", arguments).params
    assert (given["ray"], given["resume"]) == ("auto", True)
    assert given["file"].startswith("s3://")


def test_a_node_of_the_job_has_room_for_its_workers(monkeypatch: pytest.MonkeyPatch) -> None:
    from meshconv3d.service.batch.running import HELD_BYTES

    (workers,) = cluster()["workerGroupSpecs"]
    (container,) = workers["template"]["spec"]["containers"]
    for one in container["env"]:
        monkeypatch.setenv(one["name"], one["value"])
    each = Settings().worker_memory_bytes + HELD_BYTES
    assert memory_of(workers) > int(workers["rayStartParams"]["num-cpus"]) * each


def memory_of(group: dict[str, Any]) -> int:
    (container,) = group["template"]["spec"]["containers"]
    return int(container["resources"]["limits"]["memory"].removesuffix("Gi")) * GIB
