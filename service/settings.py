"""What an operator can set: a flag over a MESHCONV3D_* variable over the default."""

import os
from typing import Annotated, Self

from pydantic import Field, field_validator, model_validator
from pydantic_settings import BaseSettings, NoDecode, SettingsConfigDict

from model.loading import Limits
from service.models import shipped_models

MIB = 1024 * 1024
LIMITS = Limits()


class Settings(BaseSettings):
    """One typed field for each setting: its variable is MESHCONV3D_<FIELD>, its flag --field."""

    model_config = SettingsConfigDict(env_prefix="MESHCONV3D_")

    models: Annotated[tuple[str, ...], NoDecode] = Field(
        default_factory=lambda: tuple(shipped_models()),
        min_length=1,
        description="Shipped models by name, or model files; the first is the default. "
        "Comma separated in the variable, a flag for each.",
    )
    host: str = Field(default="127.0.0.1", description="Address to listen on.")
    port: int = Field(
        default=8000, ge=0, le=65535, description="Port to listen on; 0 takes a free one."
    )
    workers: int = Field(
        default_factory=lambda: len(os.sched_getaffinity(0)),
        ge=1,
        le=256,
        description="Processes that read and classify, one mesh each at a time. "
        "By default one for each usable core.",
    )
    deadline_seconds: float = Field(
        default=30.0,
        gt=0,
        le=3600,
        description="Time for one request, from its headers to its answer.",
    )
    grace_seconds: int = Field(
        default=30,
        ge=0,
        le=3600,
        description="Time to finish what was accepted, once told to stop.",
    )
    max_upload_bytes: int = Field(
        default=100 * MIB, ge=1, description="Largest request body that is accepted."
    )
    max_vertices: int = Field(
        default=LIMITS.vertices, ge=3, description="Most vertices that one file may hold."
    )
    max_faces: int = Field(
        default=LIMITS.faces, ge=1, description="Most triangles that one file may hold."
    )
    max_geometries: int = Field(
        default=LIMITS.geometries, ge=1, description="Most placed parts that one scene may hold."
    )
    worker_memory_bytes: int = Field(
        default=2048 * MIB,
        ge=64 * MIB,
        description="Memory that one mesh may take in a worker, above what the models take.",
    )
    max_queue_requests: int = Field(
        default=256, ge=1, description="Most requests that wait or run at a time."
    )
    max_queue_bytes: int = Field(
        default=512 * MIB, ge=1, description="Most bytes of request bodies held at a time."
    )
    max_connections: int = Field(default=1024, ge=2, description="Most connections open at a time.")

    @field_validator("models", mode="before")
    @classmethod
    def _split(cls, value: object) -> object:
        return tuple(filter(None, value.split(","))) if isinstance(value, str) else value

    @model_validator(mode="after")
    def _queue_takes_any_upload(self) -> Self:
        if self.max_queue_bytes < self.max_upload_bytes:
            raise ValueError(
                f"max_queue_bytes ({self.max_queue_bytes}) must be at least "
                f"max_upload_bytes ({self.max_upload_bytes})"
            )
        return self

    @property
    def limits(self) -> Limits:
        """What one file may hold."""
        return Limits(self.max_vertices, self.max_faces, self.max_geometries)
