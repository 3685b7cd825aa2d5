"""Routes that FastAPI describes, and that read their requests by themselves.

Their bodies are read by hand to be bounded, and so are their queries: FastAPI's way to an endpoint
with two parameters is a quarter of what the service does for a mesh beside classifying it.
"""

from typing import Any, TypeVar

from fastapi.exceptions import RequestValidationError
from fastapi.routing import APIRoute
from pydantic import BaseModel, Field, ValidationError
from starlette.requests import Request
from starlette.routing import Route
from starlette.types import Receive, Scope, Send


class DirectRoute(APIRoute):
    """Its endpoint takes the request, and nothing else, and returns a response."""

    def __init__(self, path: str, endpoint: Any, **description: Any) -> None:
        super().__init__(path, endpoint, **description)
        self._direct = Route(path, endpoint, methods=self.methods)

    async def handle(self, scope: Scope, receive: Receive, send: Send) -> None:
        await self._direct.handle(scope, receive, send)


class _Query(BaseModel):
    # What the default is called stands behind a key: not in the description, then.
    model: str | None = Field(
        None, description="name of the model; by default the first of /v1/models"
    )


class Asked(_Query):
    """The query of those who want classes."""

    top: int | None = Field(None, ge=1, description="only the N likeliest")


class AskedWhy(_Query):
    """The query of those who want an explanation."""

    label: str | None = Field(
        None, alias="class", description="class to explain; by default the likeliest"
    )


Query = TypeVar("Query", bound=_Query)


def read_query(request: Request, form: type[Query]) -> Query:
    """The query of a request. Raises RequestValidationError."""
    try:
        return form.model_validate(dict(request.query_params))
    except ValidationError as error:
        faults = [{**fault, "loc": ("query", *fault["loc"])} for fault in error.errors()]
        raise RequestValidationError(faults) from None


def described(form: type[_Query], body: dict) -> dict:
    """What the description says of a query and a body that are read by hand."""
    schemas = form.model_json_schema()["properties"]
    parameters = [
        {
            "name": name,
            "in": "query",
            "required": False,
            "schema": schema,
            "description": schema["description"],
        }
        for name, schema in schemas.items()
    ]
    return {"parameters": parameters, "requestBody": body}
