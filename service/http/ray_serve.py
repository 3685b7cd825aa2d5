"""The app under Ray Serve, which starts, scales and replaces it, and hands it requests.

Importing it needs ray, of the extra `ray`: `serve run service.http.ray_serve:application`.
"""

import os

# Read as Ray is imported: nothing phones home.
os.environ["RAY_USAGE_STATS_ENABLED"] = "0"

from ray import serve
from starlette.types import ASGIApp

from meshconv3d.service.http.app import create_app
from meshconv3d.service.http.behind import open_admission, start_workers
from meshconv3d.service.logs import configure_logs
from meshconv3d.service.settings import Settings


def application(settings: Settings) -> serve.Application:
    """What Serve runs. Settings come from the application's `args` over the variables, as flags
    do; address, port and the bounds on connections are Serve's own.

    A replica takes as many CPUs as it has workers. Requests wait at the replica, as many as there
    are connections to the plain service: it says no, and when to ask again, as that does.
    """
    deployment = serve.deployment(
        Replica,
        name="meshconv3d",
        max_ongoing_requests=settings.max_connections,
        graceful_shutdown_timeout_s=settings.grace_seconds,
        ray_actor_options={"num_cpus": settings.workers},
    )
    return deployment.bind(settings)


@serve.ingress()
class Replica:
    """The app over worker processes of its own."""

    def __init__(self, settings: Settings) -> None:
        """Wait until the workers are warm, which end with this process. Raises ModelFileError,
        SelfTestError or NotStarted."""
        configure_logs(settings.log_format)
        self._settings = settings
        self._pool = start_workers(settings)

    def __serve_build_asgi_app__(self) -> ASGIApp:  # by this name Serve asks for it
        return create_app(self._pool, open_admission(self._settings), self._settings)

    def check_health(self) -> None:
        """Serve replaces a replica for which this raises."""
        if not self._pool.alive:
            raise RuntimeError("no worker is alive")
