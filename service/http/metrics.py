"""What the service counts of itself, for Prometheus."""

import functools
from collections.abc import Iterable

from prometheus_client import (
    CollectorRegistry,
    Counter,
    Gauge,
    GCCollector,
    Histogram,
    PlatformCollector,
    ProcessCollector,
)
from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
from prometheus_client.registry import Collector

from meshconv3d.service.http.admission import Admission
from meshconv3d.service.http.notes import Notes
from meshconv3d.service.workers import WorkerPool

# From a stage of a small mesh to a request at its deadline, in seconds.
BUCKETS = (0.0005, 0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1, 2.5, 5, 10, 30, 60)


class Metrics:
    """The counters of one app, in a registry of their own."""

    def __init__(self, pool: WorkerPool, admission: Admission) -> None:
        self.registry = CollectorRegistry()
        for collector in (ProcessCollector, PlatformCollector, GCCollector):
            collector(registry=self.registry)
        self.registry.register(_State(pool, admission))
        requests = Counter(
            "meshconv3d_requests",
            "Requests answered; fault is empty where there was none.",
            ["route", "status", "fault"],
            registry=self.registry,
        )
        meshes = Counter(
            "meshconv3d_meshes",
            "Mesh files answered, each of a batch; fault is empty where there was none.",
            ["fault"],
            registry=self.registry,
        )
        seconds = Histogram(
            "meshconv3d_request_seconds",
            "From a request's head to the end of its answer.",
            ["route"],
            buckets=BUCKETS,
            registry=self.registry,
        )
        stages = Histogram(
            "meshconv3d_stage_seconds",
            "Stages of classified meshes: upload, queue, read, prepare, topology, infer.",
            ["stage"],
            buckets=BUCKETS,
            registry=self.registry,
        )
        # To find a counter by its labels takes longer than to count.
        self._requests = functools.cache(requests.labels)
        self._meshes = functools.cache(meshes.labels)
        self._seconds = functools.cache(seconds.labels)
        self._stages = functools.cache(stages.labels)
        models = Gauge(
            "meshconv3d_model_info",
            "1 for each model that is served.",
            ["name", "sha256"],
            registry=self.registry,
        )
        for name, info in pool.models.items():
            models.labels(name, info.sha256).set(1)

    def observe(self, route: str, status: int, seconds: float, notes: Notes) -> None:
        """Count one request that is over."""
        self._requests(route, status, notes.fault or "").inc()
        self._seconds(route).observe(seconds)
        for fault in notes.outcomes:
            self._meshes(fault).inc()
        for stage, taken in notes.stages:
            self._stages(stage).observe(taken)


class _State(Collector):
    """What can be read off when it is asked for."""

    def __init__(self, pool: WorkerPool, admission: Admission) -> None:
        self._pool = pool
        self._admission = admission

    def collect(self) -> Iterable[Metric]:
        admission, pool = self._admission, self._pool
        for name, text, value in (
            ("queue_meshes", "Meshes that wait or run.", admission.requests),
            ("queue_bytes", "Bytes of request bodies that are held.", admission.bytes),
            ("workers_alive", "Worker processes that are warm.", pool.alive),
        ):
            yield GaugeMetricFamily(f"meshconv3d_{name}", text, value)
        yield CounterMetricFamily(
            "meshconv3d_worker_restarts", "Worker processes that were replaced.", pool.restarts
        )
