"""Telemetry: an id, a log line and counters for every request."""

import logging
import time
from collections.abc import Iterable, Sequence

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
from starlette.datastructures import Headers
from starlette.routing import BaseRoute, Match
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from meshconv3d.service.http.admission import Admission
from meshconv3d.service.http.context import RequestContext
from meshconv3d.service.workers import WorkerPool

log = logging.getLogger(__name__)

# Histogram bounds in seconds: from one stage of a small mesh to a request at its deadline.
BUCKETS = (0.0005, 0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 0.5, 1, 2.5, 5, 10, 30, 60)

# Label for paths without a route: clients can invent any number of them.
NO_ROUTE = "none"

# Answers of the API are data: they load nothing and stand in no frame. The page has a policy of
# its own, and browsers obey all that an answer carries, so that others alone get this one.
DATA_POLICY = (b"content-security-policy", b"default-src 'none'; frame-ancestors 'none'")


class Metrics:
    """Prometheus counters of one app, in a registry of their own."""

    def __init__(self, pool: WorkerPool, admission: Admission) -> None:
        self.registry = CollectorRegistry()
        for collector in (ProcessCollector, PlatformCollector, GCCollector):
            collector(registry=self.registry)
        self.registry.register(_State(pool, admission))
        self._requests = Counter(
            "meshconv3d_requests",
            "Requests answered; fault is empty where there was none.",
            ["route", "status", "fault"],
            registry=self.registry,
        )
        self._meshes = Counter(
            "meshconv3d_meshes",
            "Mesh files answered, each of a batch; fault is empty where there was none.",
            ["fault"],
            registry=self.registry,
        )
        self._seconds = Histogram(
            "meshconv3d_request_seconds",
            "From a request's head to the end of its answer.",
            ["route"],
            buckets=BUCKETS,
            registry=self.registry,
        )
        self._stages = Histogram(
            "meshconv3d_stage_seconds",
            "Stages of classified meshes: upload, queue, read, prepare, topology, infer.",
            ["stage"],
            buckets=BUCKETS,
            registry=self.registry,
        )
        models = Gauge(
            "meshconv3d_model_info",
            "1 for each model that is served.",
            ["name", "sha256"],
            registry=self.registry,
        )
        for name, info in pool.models.items():
            models.labels(name, info.sha256).set(1)

    def observe(self, route: str, status: int, seconds: float, context: RequestContext) -> None:
        """Count one request that is over."""
        self._requests.labels(route, status, context.fault or "").inc()
        self._seconds.labels(route).observe(seconds)
        for fault in context.outcomes:
            self._meshes.labels(fault).inc()
        for stage, taken in context.stages:
            self._stages.labels(stage).observe(taken)


class _State(Collector):
    """Gauges that are read when they are asked for."""

    def __init__(self, pool: WorkerPool, admission: Admission) -> None:
        self._pool = pool
        self._admission = admission

    def collect(self) -> Iterable[Metric]:
        admission, pool = self._admission, self._pool
        for name, text, value in (
            ("queue_meshes", "Meshes that wait or run.", admission.meshes),
            ("queue_bytes", "Bytes of request bodies that are held.", admission.bytes),
            ("workers_alive", "Worker processes that are warm.", pool.alive),
        ):
            yield GaugeMetricFamily(f"meshconv3d_{name}", text, value)
        yield CounterMetricFamily(
            "meshconv3d_worker_restarts", "Worker processes that were replaced.", pool.restarts
        )


class TelemetryMiddleware:
    """ASGI middleware: gives each request its context, answers with its id and trace, and logs and
    counts how it ended.

    routes: those of the app, by which requests are counted.
    """

    def __init__(self, app: ASGIApp, routes: Sequence[BaseRoute], metrics: Metrics) -> None:
        self.app = app
        self.routes = routes
        self.metrics = metrics

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self.app(scope, receive, send)
            return
        started = time.perf_counter()
        original = dict(scope)  # routing writes into the scope
        context = RequestContext.begin(Headers(scope=scope).getlist("traceparent"))
        scope.setdefault("state", {})["context"] = context
        headers = [
            (b"x-request-id", context.request_id.encode()),
            (b"traceparent", context.traceparent.encode()),
        ]
        status = 0

        async def send_with_ids(message: Message) -> None:
            nonlocal status
            if message["type"] == "http.response.start":
                status = message["status"]
                message["headers"] = [*message["headers"], *headers]
                if context.stages:
                    message["headers"].append((b"server-timing", _timing(context.stages)))
                if DATA_POLICY[0] not in dict(message["headers"]):
                    message["headers"].append(DATA_POLICY)
            await send(message)

        try:
            await self.app(scope, receive, send_with_ids)
        except Exception:  # it was answered, with the id alone
            log.exception("request %s failed", context.request_id, extra=context.ids)
        finally:
            seconds = time.perf_counter() - started
            route = self._route(original)
            self.metrics.observe(route, status, seconds, context)
            _log(scope["method"], route, status, seconds, context)

    def _route(self, scope: Scope) -> str:
        for route in self.routes:
            match, _ = route.matches(scope)
            if match is not Match.NONE:
                return getattr(route, "path", NO_ROUTE)
        return NO_ROUTE


def _timing(stages: Iterable[tuple[str, float]]) -> bytes:
    """The header Server-Timing: milliseconds of each stage that has ended."""
    return ", ".join(f"{name};dur={seconds * 1000:.1f}" for name, seconds in stages).encode()


def _log(method: str, route: str, status: int, seconds: float, context: RequestContext) -> None:
    outcome = f"{status} {context.fault}" if context.fault else status
    fields = {
        "method": method,
        "route": route,
        "status": status,
        "fault": context.fault,
        "duration_ms": round(seconds * 1000, 1),
        "bytes": context.received,
        "sha256": context.hashes,
    }
    log.info(
        "%s %s %s in %.1f ms",
        *(method, route, outcome, seconds * 1000),
        extra=context.ids | fields,
    )
