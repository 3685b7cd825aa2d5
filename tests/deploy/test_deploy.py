"""The files in deploy/ are what the platforms take, and fit the service that they start."""

import json
import os
import re
import urllib.request
from pathlib import Path
from typing import Any

import kubernetes_validate
import pytest
import yaml
from compose_pydantic import ComposeSpecification
from starlette.routing import Route

from meshconv3d.model.loading import Limits
from meshconv3d.service.container import SERVICE_BYTES, WORKER_BYTES
from meshconv3d.service.http.admission import Admission
from meshconv3d.service.http.app import create_app
from meshconv3d.service.http.telemetry import TelemetryMiddleware
from meshconv3d.service.settings import Settings
from meshconv3d.service.workers import Setup, WorkerPool
from tests.results import model_info

ROOT = Path(__file__).parents[2]
DEPLOY = ROOT / "deploy"
# What KServe's predictor has beside the fields of a pod.
KSERVE_FIELDS = {"minReplicas": int, "maxReplicas": int, "timeout": int}
KUBERNETES_GRACE = 30


def documents(name: str) -> list[dict[str, Any]]:
    return list(yaml.safe_load_all((DEPLOY / name).read_text(encoding="utf-8")))


def inference_service() -> dict[str, Any]:
    (document,) = documents("kserve.yaml")
    return document


def kubernetes(kind: str) -> dict[str, Any]:
    (document,) = (each for each in documents("kubernetes.yaml") if each["kind"] == kind)
    return document


def pod_of(name: str) -> dict[str, Any]:
    """The pod that a file describes."""
    if name == "kserve.yaml":
        predictor = inference_service()["spec"]["predictor"]
        return {key: value for key, value in predictor.items() if key not in KSERVE_FIELDS}
    return kubernetes("Deployment")["spec"]["template"]["spec"]


def container_of(name: str) -> dict[str, Any]:
    (container,) = pod_of(name)["containers"]
    return container


def compose() -> dict[str, Any]:
    (document,) = documents("compose.yaml")
    return document["services"]["meshconv3d"]


def environment_of(name: str) -> dict[str, str | None]:
    """The variables that a file sets; None for what comes from a secret."""
    if name == "compose.yaml":
        return compose()["environment"]
    return {entry["name"]: entry.get("value") for entry in container_of(name)["env"]}


def paths() -> set[str]:
    """The paths of the service."""
    pool = WorkerPool(Setup((), Limits(), memory_bytes=0, seconds=1.0), workers=0)
    pool.models = {"any": model_info()}
    app = create_app(pool, Admission(9, 9999, 9.0, workers=1), Settings())
    assert isinstance(app, TelemetryMiddleware)
    return {route.path for route in app.routes if isinstance(route, Route)}


def settings_of(name: str, monkeypatch: pytest.MonkeyPatch) -> Settings:
    """What the service makes of the variables that a file sets."""
    for variable, value in environment_of(name).items():
        monkeypatch.setenv(variable, value or "from-a-secret-0123456789")
    return Settings()


EVERY = pytest.mark.parametrize("name", ["kubernetes.yaml", "kserve.yaml", "compose.yaml"])
IN_PODS = pytest.mark.parametrize("name", ["kubernetes.yaml", "kserve.yaml"])


def test_kubernetes_takes_the_manifests() -> None:
    found = documents("kubernetes.yaml")
    assert [each["kind"] for each in found] == ["Deployment", "Service", "HorizontalPodAutoscaler"]
    for document in found:
        kubernetes_validate.validate(document, kubernetes_validate.latest_version(), strict=True)


def test_kserve_takes_the_inference_service() -> None:
    document = inference_service()
    assert set(document) == {"apiVersion", "kind", "metadata", "spec"}
    assert document["apiVersion"] == "serving.kserve.io/v1beta1"
    assert document["kind"] == "InferenceService"
    assert list(document["spec"]) == ["predictor"]
    predictor = document["spec"]["predictor"]
    for field, kind in KSERVE_FIELDS.items():
        assert isinstance(predictor[field], kind)
    # It finds its container by this name.
    assert container_of("kserve.yaml")["name"] == "kserve-container"
    pod = {"apiVersion": "v1", "kind": "Pod", "metadata": document["metadata"]}
    pod["spec"] = pod_of("kserve.yaml")
    kubernetes_validate.validate(pod, kubernetes_validate.latest_version(), strict=True)


def test_compose_takes_the_file() -> None:
    (document,) = documents("compose.yaml")
    ComposeSpecification.model_validate(document)
    assert (DEPLOY / compose()["build"] / "Dockerfile").is_file()


def test_a_field_that_is_misspelt_is_found() -> None:
    """So that the tests above can fail."""
    deployment = kubernetes("Deployment")
    deployment["spec"]["template"]["spec"]["containers"][0]["livenesProbe"] = {}
    with pytest.raises(kubernetes_validate.ValidationError):
        kubernetes_validate.validate(deployment, kubernetes_validate.latest_version(), strict=True)
    with pytest.raises(ValueError, match="red_only"):
        ComposeSpecification.model_validate({"services": {"one": {"red_only": True}}})


@EVERY
def test_every_variable_is_a_setting(name: str, monkeypatch: pytest.MonkeyPatch) -> None:
    known = {f"MESHCONV3D_{field.upper()}" for field in Settings.model_fields}
    assert set(environment_of(name)) <= known
    settings = settings_of(name, monkeypatch)
    assert settings.host == "0.0.0.0"


@IN_PODS
def test_ports_and_paths_are_those_of_the_service(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    container = container_of(name)
    (port,) = container["ports"]
    assert port["containerPort"] == settings_of(name, monkeypatch).port
    probes = [value["httpGet"] for key, value in container.items() if key.endswith("Probe")]
    assert len(probes) >= 2
    for probe in probes:
        assert probe["path"] in paths()
        assert probe["port"] in (port["name"], port["containerPort"])


def test_parts_find_each_other() -> None:
    deployment, service = kubernetes("Deployment"), kubernetes("Service")
    labels = deployment["spec"]["template"]["metadata"]["labels"]
    assert deployment["spec"]["selector"]["matchLabels"] == service["spec"]["selector"] == labels
    (port,) = service["spec"]["ports"]
    assert port["targetPort"] == container_of("kubernetes.yaml")["ports"][0]["name"]
    target = kubernetes("HorizontalPodAutoscaler")["spec"]["scaleTargetRef"]
    assert (target["kind"], target["name"]) == ("Deployment", deployment["metadata"]["name"])


def test_compose_publishes_the_port_of_the_service(monkeypatch: pytest.MonkeyPatch) -> None:
    port = settings_of("compose.yaml", monkeypatch).port
    (published,) = compose()["ports"]
    assert published.rpartition(":")[2] == str(port)
    assert compose()["cpus"] >= 1


@pytest.mark.parametrize("port", [None, 8123])
def test_the_health_check_of_the_image_follows_the_port(port: int | None) -> None:
    (check,) = re.findall(r"HEALTHCHECK .*\\\n +CMD (\[.*\])", (ROOT / "Dockerfile").read_text())
    asked: list[str] = []
    environ = {} if port is None else {"MESHCONV3D_PORT": str(port)}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "environ", environ)
        patch.setattr(urllib.request, "urlopen", lambda url, timeout: asked.append(url))
        exec(json.loads(check)[2], {})
    assert asked == [f"http://127.0.0.1:{port or 8000}/readyz"]


@EVERY
def test_the_platform_waits_longer_than_the_service(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    grace = settings_of(name, monkeypatch).grace_seconds
    if name == "compose.yaml":
        assert int(compose()["stop_grace_period"].removesuffix("s")) > grace
        return
    before = container_of(name).get("lifecycle", {}).get("preStop", {}).get("exec", {})
    slept = int(before["command"][-1]) if before else 0
    assert pod_of(name).get("terminationGracePeriodSeconds", KUBERNETES_GRACE) > grace + slept


def test_kserve_waits_longer_than_a_request_may_take(monkeypatch: pytest.MonkeyPatch) -> None:
    deadline = settings_of("kserve.yaml", monkeypatch).deadline_seconds
    assert inference_service()["spec"]["predictor"]["timeout"] > deadline


@IN_PODS
def test_a_pod_may_do_nothing_but_serve(name: str) -> None:
    pod, container = pod_of(name), container_of(name)
    assert pod["securityContext"]["runAsNonRoot"] is True
    assert pod["securityContext"]["seccompProfile"] == {"type": "RuntimeDefault"}
    assert pod["automountServiceAccountToken"] is False
    assert pod["enableServiceLinks"] is False
    rights = container["securityContext"]
    assert rights["readOnlyRootFilesystem"] is True
    assert rights["allowPrivilegeEscalation"] is False
    assert rights["capabilities"] == {"drop": ["ALL"]}
    # The user that the image has.
    assert f"--uid {pod['securityContext']['runAsUser']} " in (ROOT / "Dockerfile").read_text()


@IN_PODS
def test_limits_leave_room_for_what_the_settings_allow(
    name: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As docs/operations.md counts it."""
    settings = settings_of(name, monkeypatch)
    limit = container_of(name)["resources"]["limits"]["memory"]
    workers = settings.workers * (WORKER_BYTES + settings.worker_memory_bytes)
    most = SERVICE_BYTES + settings.max_queue_bytes + workers
    assert int(limit.removesuffix("Gi")) * 2**30 > most
