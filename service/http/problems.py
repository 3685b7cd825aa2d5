"""Every error as `application/problem+json` (RFC 9457), from one table."""

import asyncio
from http import HTTPStatus

from fastapi import FastAPI, Request, Response
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
from meshconv3d.service.http.admission import Full
from meshconv3d.service.http.errors import TooLarge, Unreadable, UploadTooSlow
from meshconv3d.service.http.notes import notes_of
from meshconv3d.service.prediction import Failure
from meshconv3d.service.workers import DeadlineExceeded

PROBLEM_JSON = "application/problem+json"

# What the framework says of a request that no handler takes, and what we say.
DETAILS = {
    "Not Found": "there is nothing at this path; see /openapi.json for what there is",
    "Method Not Allowed": "this path takes other methods, which the header Allow names",
}

STATUSES: dict[type[MeshError], HTTPStatus] = {
    MalformedFile: HTTPStatus.BAD_REQUEST,
    UnknownFormat: HTTPStatus.UNSUPPORTED_MEDIA_TYPE,
    UnusableMesh: HTTPStatus.UNPROCESSABLE_ENTITY,
    LimitExceeded: HTTPStatus.REQUEST_ENTITY_TOO_LARGE,
}


class Problem(BaseModel):
    """A problem document. `fault` is a stable slug for programs, `detail` is for people."""

    type: str = "about:blank"
    title: str
    status: int
    detail: str
    fault: str = Field(examples=["no-faces"])
    request_id: str
    limit: int | None = Field(None, description="the limit that was hit, if one was")


def install_problem_handlers(app: FastAPI) -> None:
    """Answer every error of the app, its own and the framework's, with a problem document."""

    @app.exception_handler(MeshError)
    async def mesh_error(request: Request, error: MeshError) -> JSONResponse:
        limit = error.value if isinstance(error, LimitExceeded) else None
        return problem(request, STATUSES[type(error)], error.fault, str(error), limit)

    @app.exception_handler(NotExplained)
    async def not_explained(request: Request, error: NotExplained) -> JSONResponse:
        return problem(request, HTTPStatus.NOT_FOUND, error.fault, str(error))

    @app.exception_handler(TooLarge)
    async def too_large(request: Request, error: TooLarge) -> JSONResponse:
        status = HTTPStatus.REQUEST_ENTITY_TOO_LARGE
        return problem(request, status, error.fault, str(error), error.limit)

    @app.exception_handler(UploadTooSlow)
    async def too_slow(request: Request, error: UploadTooSlow) -> JSONResponse:
        response = problem(request, HTTPStatus.REQUEST_TIMEOUT, "upload-too-slow", str(error))
        response.headers["connection"] = "close"
        return response

    @app.exception_handler(Unreadable)
    async def no_http(request: Request, error: Unreadable) -> JSONResponse:
        return unreadable(request, error)

    @app.exception_handler(Full)
    async def too_much(request: Request, error: Full) -> JSONResponse:
        return await full(request, error)

    @app.exception_handler(DeadlineExceeded)
    async def too_late(request: Request, error: DeadlineExceeded) -> JSONResponse:
        why = reason(error)
        return problem(request, HTTPStatus.GATEWAY_TIMEOUT, why.fault, why.message)

    @app.exception_handler(RequestValidationError)
    async def invalid(request: Request, error: RequestValidationError) -> JSONResponse:
        problems = (f"{'.'.join(map(str, e['loc']))}: {e['msg']}" for e in error.errors())
        return problem(request, HTTPStatus.BAD_REQUEST, "bad-request", "; ".join(problems))

    @app.exception_handler(HTTPException)
    async def http_error(request: Request, error: HTTPException) -> JSONResponse:
        status = HTTPStatus(error.status_code)
        detail = DETAILS.get(error.detail, error.detail)
        response = problem(request, status, status.phrase.lower().replace(" ", "-"), detail)
        response.headers.update(error.headers or {})
        return response

    @app.exception_handler(ClientDisconnect)
    async def gone(request: Request, error: ClientDisconnect) -> Response:
        notes_of(request).fault = "client-gone"
        return Response(status_code=HTTPStatus.BAD_REQUEST)  # nobody is there to read it

    @app.exception_handler(Exception)
    async def unforeseen(request: Request, error: Exception) -> JSONResponse:
        # The log has the traceback; the client gets the id to ask about it.
        why = reason(error)
        return problem(request, HTTPStatus.INTERNAL_SERVER_ERROR, why.fault, why.message)


def reason(error: Exception) -> Failure:
    """Why a mesh could not be classified, whichever error says so."""
    if isinstance(error, MeshError):
        return Failure.of(error)
    if isinstance(error, Full):
        return Failure("full", str(error))
    if isinstance(error, DeadlineExceeded):
        message = "there was no answer within the deadline; simplify the mesh, or try again later"
        return Failure("deadline", message)
    message = "the service failed on this request; report it with the request id"
    return Failure("internal", message)


async def full(request: Request, error: Full) -> JSONResponse:
    """The answer to what is refused because there is too much to do, after a pause."""
    await asyncio.sleep(error.pause)
    why = reason(error)
    response = problem(request, HTTPStatus.SERVICE_UNAVAILABLE, why.fault, why.message)
    response.headers["retry-after"] = str(error.retry_after)
    return response


def unreadable(request: Request, error: Unreadable) -> JSONResponse:
    """The answer to what is no request; its connection takes no other."""
    response = problem(request, error.status, error.fault, str(error), error.limit)
    response.headers["connection"] = "close"
    return response


def problem(
    request: Request, status: HTTPStatus, fault: str, detail: str, limit: int | None = None
) -> JSONResponse:
    """One problem as a response: a problem document, or what the inference protocol wants."""
    notes = notes_of(request)
    notes.fault = fault
    if _is_of_inference_protocol(request):
        return JSONResponse({"error": detail}, status)
    document = Problem(
        title=status.phrase,
        status=status,
        detail=detail,
        fault=fault,
        request_id=notes.request_id,
        limit=limit,
    )
    return JSONResponse(
        document.model_dump(exclude_none=True),
        status,
        media_type=PROBLEM_JSON,
    )


def _is_of_inference_protocol(request: Request) -> bool:
    return f"{request.scope['path']}/".startswith("/v2/")
