"""What a running service counts of itself, as it says at /metrics."""

import httpx
from prometheus_client.parser import text_string_to_metric_families

from tests.service.conftest import Service

Labels = frozenset[tuple[str, str]]


def metrics(service: Service) -> dict[tuple[str, Labels], float]:
    """All samples, by name and labels."""
    response = httpx.get(f"{service.url}/metrics")
    assert response.headers["content-type"].startswith("text/plain; version=")
    families = text_string_to_metric_families(response.text)
    samples = [sample for family in families for sample in family.samples]
    return {(sample.name, frozenset(sample.labels.items())): sample.value for sample in samples}


def value(service: Service, name: str, /, **labels: str) -> float:
    """The sample of this name, without the project's, and of these labels; 0 if there is none."""
    return metrics(service).get((f"meshconv3d_{name}", frozenset(labels.items())), 0.0)


def queue(service: Service) -> float:
    """How many meshes wait or run."""
    return value(service, "queue_meshes")
