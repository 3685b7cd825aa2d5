"""Access control: host names, cross-site requests, API keys, and the port of the metrics."""

import hashlib
import hmac

from starlette.datastructures import Headers
from starlette.types import Scope

from meshconv3d.service.http.problems import RequestError
from meshconv3d.service.settings import Settings

# Open to the platform that runs the service: it has no key, and asks by address.
OPEN_PATHS = frozenset({"/livez", "/readyz", "/v2/health/live", "/v2/health/ready"})
# Open without a key: a browser opens the page, which then asks for one, and the API's description.
# They are the same wherever the service runs.
PAGE_PATHS = frozenset({"/", "/docs", "/openapi.json"})
ASSETS, METRICS = "/assets/", "/metrics"

_CHALLENGE = 'Bearer realm="meshconv3d"'


class Access:
    """Refuses requests for other host names, from pages of other sites, and without one of the API
    keys where there are any.

    With a port for the metrics, these are there, without a key, and nowhere else.
    """

    def __init__(self, settings: Settings) -> None:
        self._hosts = settings.hosts
        self._origins = settings.cors_origins
        self._digests = [_digest(key.get_secret_value().encode()) for key in settings.api_keys]
        self._metrics_port = settings.metrics_port

    def check(self, scope: Scope) -> None:
        """Raises RequestError for a request that is not allowed."""
        path, headers = scope["path"], Headers(scope=scope)
        if self._metrics_port is not None:
            at_metrics_port = scope["server"][1] == self._metrics_port
            if at_metrics_port != (path == METRICS):
                raise RequestError(404, "not-found", f"{METRICS} has a port of its own")
            if at_metrics_port:
                return
        if path in OPEN_PATHS:
            return
        self._check_host(headers)
        self._check_site(scope["method"], headers)
        if self._digests and path not in PAGE_PATHS and not path.startswith(ASSETS):
            self._check_key(headers)

    def _check_host(self, headers: Headers) -> None:
        """Against DNS rebinding: a page whose host name leads here is not one of ours."""
        if self._hosts is None:
            return
        for value in headers.getlist("host"):
            name, _, port = value.rpartition(":")
            host = name if port.isdigit() else value
            if host.rstrip(".").lower() not in self._hosts:
                detail = (
                    "this service does not answer for the host name of the request; where it "
                    "should, add the name to the setting allowed_hosts"
                )
                raise RequestError(421, "unknown-host", detail)

    def _check_site(self, method: str, headers: Headers) -> None:
        """Against forms that pages of other sites post in the name of their visitor."""
        cross_site = headers.get("sec-fetch-site") == "cross-site"
        if method == "POST" and cross_site and headers.get("origin") not in self._origins:
            detail = (
                "a page of another site may not post here; where it should, add its origin to the "
                "setting cors_origins"
            )
            raise RequestError(403, "cross-site", detail)

    def _check_key(self, headers: Headers) -> None:
        shown = _keys(headers)
        if any(self._is_known(key) for key in shown):
            return
        detail = "send an API key, in the header X-API-Key or as Authorization: Bearer"
        fault, challenge = "no-api-key", _CHALLENGE
        if shown:
            detail = "this API key is not known here; ask the operator of the service for one"
            fault, challenge = "wrong-api-key", f'{_CHALLENGE}, error="invalid_token"'
        raise RequestError(401, fault, detail, headers={"www-authenticate": challenge})

    def _is_known(self, key: bytes) -> bool:
        """Compare with every key, in a time that reveals nothing of any."""
        digest = _digest(key)
        return sum(hmac.compare_digest(digest, known) for known in self._digests) > 0


def _keys(headers: Headers) -> list[bytes]:
    """The keys that a request shows, in either header."""
    keys = headers.getlist("x-api-key")
    for value in headers.getlist("authorization"):
        scheme, _, credentials = value.partition(" ")
        if scheme.lower() == "bearer":
            keys.append(credentials.strip())
    return [key.encode("latin-1") for key in keys]


def _digest(key: bytes) -> bytes:
    return hashlib.sha256(key).digest()
