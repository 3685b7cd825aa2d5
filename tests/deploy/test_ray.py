"""The files in deploy/ for KubeRay are what it takes, and fit the command and the service."""

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

from ray.serve.schema import ServeApplicationSchema, ServeDeploySchema

from meshconv3d.service.http.ray_serve import application

DEPLOY = Path(__file__).parents[2] / "deploy"
# The fields of KubeRay's definitions that are used here.
JOB_FIELDS = {
    "entrypoint": str,
    "shutdownAfterJobFinishes": bool,
    "ttlSecondsAfterFinished": int,
    "rayClusterSpec": dict,
}
SERVICE_FIELDS = {"serveConfigV2": str, "rayClusterConfig": dict}
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

BOTH = pytest.mark.parametrize("name", ["rayjob.yaml", "rayservice.yaml"])


def manifest(name: str) -> dict[str, Any]:
    return yaml.safe_load((DEPLOY / name).read_text(encoding="utf-8"))


def cluster_of(name: str) -> dict[str, Any]:
    spec = manifest(name)["spec"]
    return spec["rayClusterSpec" if name == "rayjob.yaml" else "rayClusterConfig"]


def groups_of(name: str) -> list[dict[str, Any]]:
    """The head's group, then the workers'."""
    cluster = cluster_of(name)
    return [cluster["headGroupSpec"], *cluster["workerGroupSpecs"]]


def containers_of(name: str) -> list[dict[str, Any]]:
    return [one for group in groups_of(name) for one in group["template"]["spec"]["containers"]]


def served() -> ServeApplicationSchema:
    """The application as Ray Serve reads it."""
    config = yaml.safe_load(manifest("rayservice.yaml")["spec"]["serveConfigV2"])
    (application,) = ServeDeploySchema.model_validate(config).applications
    return application


def has_fields(document: dict[str, Any], fields: dict[str, type]) -> bool:
    return set(document) == set(fields) and all(
        isinstance(document[field], kind) for field, kind in fields.items()
    )


@BOTH
def test_kuberay_takes_the_manifest(name: str) -> None:
    document, cluster = manifest(name), cluster_of(name)
    assert set(document) == {"apiVersion", "kind", "metadata", "spec"}
    assert document["apiVersion"] == "ray.io/v1"
    kind, fields = {
        "rayjob.yaml": ("RayJob", JOB_FIELDS),
        "rayservice.yaml": ("RayService", SERVICE_FIELDS),
    }[name]
    assert document["kind"] == kind
    assert has_fields(document["spec"], fields)
    assert has_fields(cluster, CLUSTER_FIELDS)
    assert has_fields(cluster["headGroupSpec"], HEAD_FIELDS)
    for group in cluster["workerGroupSpecs"]:
        assert has_fields(group, WORKER_FIELDS | {"groupName": str})
        assert group["minReplicas"] <= group["replicas"] <= group["maxReplicas"]


@BOTH
def test_kubernetes_takes_the_pods(name: str) -> None:
    for group in groups_of(name):
        assert all(isinstance(value, str) for value in group["rayStartParams"].values())
        pod = {"apiVersion": "v1", "kind": "Pod", "metadata": {"name": "pod"}}
        pod["spec"] = group["template"]["spec"]
        kubernetes_validate.validate(pod, kubernetes_validate.latest_version(), strict=True)
        assert pod["spec"]["securityContext"]["runAsNonRoot"] is True
        assert pod["spec"]["enableServiceLinks"] is False


@BOTH
def test_nobody_gets_in_and_nothing_phones_home(name: str) -> None:
    assert cluster_of(name)["authOptions"] == {"mode": "token"}
    for container in containers_of(name):
        assert {"name": "RAY_USAGE_STATS_ENABLED", "value": "0"} in container["env"]
        assert container["securityContext"]["allowPrivilegeEscalation"] is False


@BOTH
def test_every_variable_is_a_setting(name: str) -> None:
    known = {f"MESHCONV3D_{field.upper()}" for field in Settings.model_fields}
    for container in containers_of(name):
        assert {one["name"] for one in container["env"]} <= known | {"RAY_USAGE_STATS_ENABLED"}


@BOTH
def test_all_nodes_have_one_image_of_one_version(name: str) -> None:
    assert len({container["image"] for container in containers_of(name)}) == 1
    image = re.search(r"FROM rayproject/ray:([\d.]+)-", (DEPLOY / "ray.Dockerfile").read_text())
    assert image is not None
    assert cluster_of(name)["rayVersion"] == image[1]


def test_the_job_is_a_call_that_can_be_gone_on_with() -> None:
    program, command, *arguments = shlex.split(manifest("rayjob.yaml")["spec"]["entrypoint"])
    assert (program, command) == ("meshconv3d", "batch")
    given = batch.make_context("batch", arguments).params
    assert (given["address"], given["resume"]) == ("auto", True)
    assert given["file"].startswith("s3://")


def test_the_service_is_what_serve_finds() -> None:
    asked = served()
    assert asked.import_path == f"{application.__module__}:{application.__name__}"
    settings = Settings(**asked.args)
    (deployment,) = asked.deployments
    assert deployment.name == application(settings)._bound_deployment.name


def test_serve_waits_longer_than_a_request_may_take() -> None:
    config = yaml.safe_load(manifest("rayservice.yaml")["spec"]["serveConfigV2"])
    settings = Settings(**served().args)
    assert config["http_options"]["request_timeout_s"] > settings.deadline_seconds
    (workers,) = cluster_of("rayservice.yaml")["workerGroupSpecs"]
    assert workers["template"]["spec"]["terminationGracePeriodSeconds"] > settings.grace_seconds


def test_a_node_of_the_service_has_room_for_one_replica() -> None:
    settings = Settings(**served().args)
    (workers,) = cluster_of("rayservice.yaml")["workerGroupSpecs"]
    assert int(workers["rayStartParams"]["num-cpus"]) == settings.workers
    most = settings.workers * settings.worker_memory_bytes + 3 * settings.max_queue_bytes
    assert memory_of(workers) > most


def test_a_node_of_the_job_has_room_for_its_workers(monkeypatch: pytest.MonkeyPatch) -> None:
    from meshconv3d.service.batch.running import HELD_BYTES

    (workers,) = cluster_of("rayjob.yaml")["workerGroupSpecs"]
    (container,) = workers["template"]["spec"]["containers"]
    for one in container["env"]:
        monkeypatch.setenv(one["name"], one["value"])
    each = Settings().worker_memory_bytes + HELD_BYTES
    assert memory_of(workers) > int(workers["rayStartParams"]["num-cpus"]) * each


def memory_of(group: dict[str, Any]) -> int:
    (container,) = group["template"]["spec"]["containers"]
    return int(container["resources"]["limits"]["memory"].removesuffix("Gi")) * GIB
