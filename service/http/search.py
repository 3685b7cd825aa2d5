"""Routes to find meshes alike: the embedding of one, and search in the service's library."""

import asyncio
import base64
from typing import TYPE_CHECKING, Annotated

from fastapi import FastAPI, Query, Request, Response
from pydantic import BaseModel, Field

from meshconv3d.service.http.dispatch import Dispatcher
from meshconv3d.service.http.openapi import FILE_BODY, WORK_ERRORS, problem_responses
from meshconv3d.service.http.problems import RequestError
from meshconv3d.service.http.uploads import read_upload
from meshconv3d.service.http.v1 import ModelName, task_of
from meshconv3d.service.prediction import Prediction
from meshconv3d.service.records import Answer, EmbeddedAnswer, answer, embedded_answer, to_json

if TYPE_CHECKING:
    from meshconv3d.service.library import Library

MOST_MATCHES = 100

Count = Annotated[int, Query(ge=1, le=MOST_MATCHES, description="the N most alike")]


class Alike(BaseModel):
    """A mesh of the library that is like the one that was sent."""

    file: str = Field(examples=["chairs/thonet.stl"])
    class_: str = Field(serialization_alias="class", examples=["chair"])
    unknown: bool | None = Field(description="true: `class` is only the nearest")
    distance: float = Field(examples=[0.12], description="of the embeddings: 0 to 2")
    same_shape: float | None = Field(
        examples=[0.97],
        description="calibrated probability that both are one shape; null: the model has none",
    )
    picture: str | None = Field(description="base64 of a PNG, where the library has pictures")


class SimilarAnswer(BaseModel):
    """Answer of a search: what the mesh is, and the meshes that are most like it."""

    query: Answer
    library: int = Field(description="meshes in the library", examples=[4074])
    similar: list[Alike] = Field(description="most alike first")


class LibraryDescription(BaseModel):
    """The library that is searched: its number of meshes, and the model of their embeddings."""

    meshes: int
    model: str


class LibraryAnswer(BaseModel):
    """The library of the service; null where it has none."""

    library: LibraryDescription | None


def add_search_routes(app: FastAPI, dispatcher: Dispatcher, library: "Library | None") -> None:
    """Add the routes that embed and search. library: None where the service has none."""

    @app.post(
        "/v1/embed",
        response_model=EmbeddedAnswer,
        responses=problem_responses(*WORK_ERRORS),
        openapi_extra=FILE_BODY,
    )
    async def embed_mesh(request: Request, model: ModelName = None) -> Response:
        """Classify one mesh, and give its embedding, size and chirality."""
        name = dispatcher.model(model).card.name
        upload = await read_upload(request, dispatcher.settings)
        prediction = await dispatcher.predict(request, task_of(upload, name))
        content = to_json(embedded_answer(upload.name, prediction))
        return Response(content, media_type="application/json")

    @app.post(
        "/v1/similar",
        response_model=SimilarAnswer,
        responses=problem_responses(*WORK_ERRORS),
        openapi_extra=FILE_BODY,
    )
    async def find_similar(request: Request, top: Count = 10, model: ModelName = None) -> Response:
        """Find the meshes of the service's library that are most like one; the search is exact."""
        if library is None:
            raise RequestError(
                404, "not-found", "this service has no library; start it with: serve --library FILE"
            )
        card = library.card if model is None else dispatcher.model(model).card
        if card.space != library.card.space:
            detail = f"embeddings of {card.name} cannot be compared with those of the library"
            raise RequestError(400, "other-space", detail)
        upload = await read_upload(request, dispatcher.settings)
        prediction = await dispatcher.predict(request, task_of(upload, card.name))
        found = await asyncio.to_thread(_matches, library, prediction, top)
        content = SimilarAnswer(
            query=answer(upload.name, prediction), library=len(library), similar=found
        )
        return Response(to_json(content), media_type="application/json")

    @app.get("/v1/library", responses=problem_responses(401))
    async def describe_library() -> LibraryAnswer:
        """The library that is searched, if the service has one."""
        if library is None:
            return LibraryAnswer(library=None)
        return LibraryAnswer(
            library=LibraryDescription(meshes=len(library), model=library.card.name)
        )


def _matches(library: "Library", prediction: Prediction, top: int) -> list[Alike]:
    matches = library.nearest(prediction.embedding, top)
    pictures = library.pictures([match.row for match in matches])
    return [
        Alike(
            file=library.value("file", match.row),
            class_=library.value("class", match.row),
            unknown=library.value("unknown", match.row),
            distance=round(match.distance, 5),
            same_shape=match.probability and round(match.probability, 5),
            picture=base64.b64encode(picture).decode() if picture else None,
        )
        for match, picture in zip(matches, pictures, strict=True)
    ]
