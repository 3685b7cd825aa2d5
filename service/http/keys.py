"""API keys: who may ask, where the service is not open to all."""

import hashlib
import hmac
from collections.abc import Sequence
from http import HTTPStatus
from typing import Any

from pydantic import SecretStr
from starlette.datastructures import Headers
from starlette.requests import Request
from starlette.types import ASGIApp, Receive, Scope, Send

from meshconv3d.service.http.problems import problem

# What asks there has no key: the platform that runs the service.
OPEN_PATHS = frozenset({"/livez", "/readyz", "/v2/health/live", "/v2/health/ready"})
# Nor has a browser that opens the page, which then asks for one, or follows its link to the
# description: that is the same wherever the service runs.
PAGE, ASSETS, DESCRIPTION = "/", "/assets/", "/openapi.json"

_CHALLENGE = 'Bearer realm="meshconv3d"'


class Keyed:
    """ASGI middleware: let through who shows one of the keys, and everyone to the probes and to
    the files of the page and the API's description."""

    def __init__(self, app: ASGIApp, keys: Sequence[SecretStr]) -> None:
        self.app = app
        self._digests = [_digest(key.get_secret_value().encode()) for key in keys]

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http" or _is_open(scope["path"]):
            await self.app(scope, receive, send)
            return
        shown = _shown(Headers(scope=scope))
        if any(self._is_known(key) for key in shown):
            await self.app(scope, receive, send)
            return
        detail = "send an API key, in the header X-API-Key or as Authorization: Bearer"
        fault, challenge = "no-api-key", _CHALLENGE
        if shown:
            detail = "this API key is not known here; ask who runs the service for one"
            fault, challenge = "wrong-api-key", f'{_CHALLENGE}, error="invalid_token"'
        response = problem(Request(scope), HTTPStatus.UNAUTHORIZED, fault, detail)
        response.headers["www-authenticate"] = challenge
        await response(scope, receive, send)

    def _is_known(self, key: bytes) -> bool:
        """Compare with every key, in a time that tells nothing of any."""
        digest = _digest(key)
        return sum(hmac.compare_digest(digest, known) for known in self._digests) > 0


def _is_open(path: str) -> bool:
    return path in OPEN_PATHS or path in (PAGE, DESCRIPTION) or path.startswith(ASSETS)


def describe_keys(description: dict[str, Any]) -> None:
    """Say in an OpenAPI document that keys are needed, and where they are not."""
    schemes = {
        "key": {"type": "apiKey", "in": "header", "name": "X-API-Key"},
        "bearer": {"type": "http", "scheme": "bearer"},
    }
    description["components"]["securitySchemes"] = schemes
    description["security"] = [{name: []} for name in schemes]
    for path in OPEN_PATHS & set(description["paths"]):
        for operation in description["paths"][path].values():
            operation["security"] = []


def _shown(headers: Headers) -> list[bytes]:
    """The keys that a request shows, in either header."""
    keys = headers.getlist("x-api-key")
    for value in headers.getlist("authorization"):
        scheme, _, credentials = value.partition(" ")
        if scheme.lower() == "bearer":
            keys.append(credentials.strip())
    return [key.encode("latin-1") for key in keys]


def _digest(key: bytes) -> bytes:
    return hashlib.sha256(key).digest()
