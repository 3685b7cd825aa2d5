"""Errors of requests, and how every error is answered: `application/problem+json` (RFC 9457)."""

import asyncio
from collections.abc import Mapping
from http import HTTPStatus

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from pydantic import BaseModel, Field
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect

from meshconv3d.model.errors import (
    LimitExceeded,
    MalformedFile,
    MeshError,
    UnknownFormat,
    UnusableMesh,
)
from meshconv3d.service.attribution import NotExplained
from meshconv3d.service.http.context import context_of
from meshconv3d.service.workers import DeadlineExceeded

PROBLEM_JSON = "application/problem+json"

# Seconds until a refusal for lack of room is sent: refusing costs time that accepted requests need,
# and a client that is refused at once asks again at once.
PAUSE_SECONDS = 2.0

STATUSES: dict[type[MeshError], int] = {
    MalformedFile: 400,
    LimitExceeded: 413,
    UnknownFormat: 415,
    UnusableMesh: 422,
}

# Details of the framework's own errors, in our words.
DETAILS = {
    "Not Found": "there is nothing at this path; see /docs for what there is",
    "Method Not Allowed": "this path takes other methods, which the header Allow names",
}


class RequestError(Exception):
    """A request that is refused. fault: stable error code; limit: the limit that is exceeded, if
    any; headers: of the answer; pause: seconds until it is sent."""

    def __init__(
        self,
        status: int,
        fault: str,
        detail: str,
        limit: int | None = None,
        headers: Mapping[str, str] = {},
        pause: float = 0.0,
    ) -> None:
        super().__init__(detail)
        self.status = status
        self.fault = fault
        self.limit = limit
        self.headers = headers
        self.pause = pause


class Full(RequestError):
    """More work than can be done in time. retry_after: seconds until that changes."""

    def __init__(self, reason: str, retry_after: int, pause: float = PAUSE_SECONDS) -> None:
        detail = f"{reason}; try again in {retry_after} s, or at another instance"
        super().__init__(
            503, "full", detail, headers={"retry-after": str(retry_after)}, pause=pause
        )
        self.retry_after = retry_after


def request_error(error: Exception) -> RequestError:
    """Any error as the one that answers the request."""
    match error:
        case RequestError():
            return error
        case MeshError():
            limit = error.value if isinstance(error, LimitExceeded) else None
            more = "; batches go to /v1/classify/batch" if error.fault == "several-meshes" else ""
            return RequestError(STATUSES[type(error)], error.fault, str(error) + more, limit)
        case NotExplained():
            return RequestError(404, error.fault, str(error))
        case DeadlineExceeded():
            detail = (
                "there was no answer within the deadline; simplify the mesh, or try again later"
            )
            return RequestError(504, "deadline", detail)
        case ClientDisconnect():  # for the log: nobody reads the answer
            return RequestError(400, "client-gone", "the client has gone")
        case RequestValidationError():
            found = (f"{'.'.join(map(str, e['loc']))}: {e['msg']}" for e in error.errors())
            return RequestError(400, "bad-request", "; ".join(found))
        case HTTPException():
            fault = HTTPStatus(error.status_code).phrase.lower().replace(" ", "-")
            detail = DETAILS.get(error.detail, error.detail)
            return RequestError(error.status_code, fault, detail, headers=error.headers or {})
        case _:  # the log has the traceback; the client gets the id to ask about it
            detail = "the service failed on this request; report it with the request id"
            return RequestError(500, "internal", detail)


class Problem(BaseModel):
    """A problem document. `fault` is a stable error code for programs, `detail` is for people."""

    type: str = "about:blank"
    title: str
    status: int
    detail: str
    fault: str = Field(examples=["no-faces"])
    request_id: str
    limit: int | None = Field(None, description="the limit that was exceeded, if one was")


async def answer_error(request: Request, error: Exception) -> JSONResponse:
    """The answer to a request that failed: a problem document, or the form that the inference
    protocol has for errors."""
    refused, context = request_error(error), context_of(request)
    context.fault = refused.fault
    if refused.pause:
        refused.__traceback__ = None  # its frames hold the body
        await asyncio.sleep(refused.pause)
    if f"{request.scope['path']}/".startswith("/v2/"):
        return JSONResponse({"error": str(refused)}, refused.status, refused.headers)
    document = Problem(
        title=HTTPStatus(refused.status).phrase,
        status=refused.status,
        detail=str(refused),
        fault=refused.fault,
        request_id=context.request_id,
        limit=refused.limit,
    )
    content = document.model_dump(exclude_none=True)
    return JSONResponse(content, refused.status, refused.headers, media_type=PROBLEM_JSON)


def install_problem_handlers(app: FastAPI) -> None:
    """Answer every error that the routes raise."""
    for kind in (
        *(RequestError, MeshError, NotExplained, DeadlineExceeded, ClientDisconnect),
        *(RequestValidationError, HTTPException, Exception),
    ):
        app.add_exception_handler(kind, answer_error)
