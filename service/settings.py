"""Settings: a flag goes before a MESHCONV3D_* variable, and that before the default."""

import ipaddress
import re
from pathlib import Path
from typing import Annotated, Self

from pydantic import Field, SecretStr, field_validator, model_validator
from pydantic_settings import BaseSettings, NoDecode, SettingsConfigDict

from meshconv3d.model.loading import Limits
from meshconv3d.service.container import default_workers, usable_cpus
from meshconv3d.service.logs import LogFormat
from meshconv3d.service.models import shipped_models

MIB = 1024 * 1024
LIMITS = Limits()
# A scheme, a host and perhaps a port, as browsers send it.
ORIGIN = re.compile(r"https?://[a-z0-9.\-]+(:\d+)?|https?://\[[0-9a-f:]+\](:\d+)?")
# A host as the header Host has it, without a port; * for any.
HOST = re.compile(r"[a-zA-Z0-9._-]+|\[[0-9a-fA-F:]+\]|\*")
# Hosts of requests to a loopback address that no other site can take.
LOOPBACK_HOSTS = ("localhost", "127.0.0.1", "[::1]")
# Shorter keys can be guessed.
MIN_KEY_CHARACTERS = 16


class Settings(BaseSettings):
    """All settings of the service. Variable of a field: MESHCONV3D_FIELD; flag: --field."""

    model_config = SettingsConfigDict(env_prefix="MESHCONV3D_", hide_input_in_errors=True)

    models: Annotated[tuple[str, ...], NoDecode] = Field(
        default_factory=lambda: tuple(shipped_models()),
        min_length=1,
        description="Shipped models by name, or model files; the first is the default. "
        "Comma separated in the variable, a flag for each.",
    )
    library: Path | None = Field(
        default=None,
        description="Library, made by meshconv3d embed, in which /v1/similar searches.",
    )
    host: str = Field(default="127.0.0.1", description="Address to listen on.")
    port: int = Field(
        default=8000, ge=0, le=65535, description="Port to listen on; 0 takes a free one."
    )
    workers: int = Field(
        default_factory=usable_cpus,
        ge=1,
        le=256,
        description="Processes that read and classify, one mesh each at a time. "
        "By default one for each core that the process may use, or fewer where the memory of its "
        "container holds fewer.",
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
        le=2**50,
        description="Memory that one mesh may take in a worker, above what the models take.",
    )
    max_queue_requests: int = Field(
        default=256,
        ge=1,
        description="Most requests that wait or run at a time; of a batch, each mesh counts.",
    )
    max_queue_bytes: int = Field(
        default=512 * MIB, ge=1, description="Most bytes of request bodies held at a time."
    )
    max_batch_meshes: int = Field(
        default=64, ge=1, description="Most meshes in one request, within what the queue takes."
    )
    max_connections: int = Field(default=1024, ge=2, description="Most connections open at a time.")
    api_keys: Annotated[tuple[SecretStr, ...], NoDecode] = Field(
        default=(),
        description="Keys of which a request must show one; with none, the service is open. "
        "Comma separated in the variable, a flag for each; what is given as a flag, others on the "
        "machine can see.",
    )
    api_keys_file: Path | None = Field(
        default=None, description="File with further keys, one in each line."
    )
    cors_origins: Annotated[tuple[str, ...], NoDecode] = Field(
        default=(),
        description="Origins whose pages may ask, such as https://example.org. "
        "Comma separated in the variable, a flag for each.",
    )
    allowed_hosts: Annotated[tuple[str, ...], NoDecode] = Field(
        default=(),
        description="Host names that requests may name; * for any. By default those of loopback "
        "where host is a loopback address, else any. Comma separated in the variable, a flag for "
        "each.",
    )
    metrics_port: int | None = Field(
        default=None,
        ge=1,
        le=65535,
        description="Port for /metrics alone, without a key; by default it is at the port of the "
        "service.",
    )
    log_format: LogFormat = Field(
        default="auto",
        description="How the log is written to standard error; auto is text at a terminal, and "
        "json elsewhere.",
    )

    @field_validator("models", "api_keys", "cors_origins", "allowed_hosts", mode="before")
    @classmethod
    def _split(cls, value: object) -> object:
        return tuple(filter(None, value.split(","))) if isinstance(value, str) else value

    @field_validator("cors_origins")
    @classmethod
    def _are_origins(cls, origins: tuple[str, ...]) -> tuple[str, ...]:
        for origin in origins:
            if not ORIGIN.fullmatch(origin):
                raise ValueError(f"{origin!r} is no origin; name one as https://example.org:8080")
        return origins

    @field_validator("allowed_hosts")
    @classmethod
    def _are_hosts(cls, hosts: tuple[str, ...]) -> tuple[str, ...]:
        for host in hosts:
            if not HOST.fullmatch(host):
                raise ValueError(f"{host!r} is no host; name one without a port, as example.org")
        return hosts

    @model_validator(mode="after")
    def _fit_workers_into_memory(self) -> Self:
        if "workers" not in self.model_fields_set:
            self.workers = default_workers(self.worker_memory_bytes, self.max_queue_bytes)
        return self

    @model_validator(mode="after")
    def _read_keys(self) -> Self:
        if self.api_keys_file is not None:
            self.api_keys += _keys_in(self.api_keys_file)
        for key in self.api_keys:
            text = key.get_secret_value()
            if len(text) < MIN_KEY_CHARACTERS or not re.fullmatch("[!-~]+", text):
                raise ValueError(
                    f"an API key needs {MIN_KEY_CHARACTERS} characters or more, of ASCII without "
                    "blanks; make one with: openssl rand -hex 24"
                )
        return self

    @model_validator(mode="after")
    def _queue_takes_any_upload(self) -> Self:
        if self.max_queue_bytes < self.max_upload_bytes:
            raise ValueError(
                f"max_queue_bytes ({self.max_queue_bytes}) must be at least "
                f"max_upload_bytes ({self.max_upload_bytes})"
            )
        return self

    @property
    def hosts(self) -> frozenset[str] | None:
        """Hosts that requests may name, in lower case; None for any."""
        hosts = self.allowed_hosts or (LOOPBACK_HOSTS if _is_loopback(self.host) else ("*",))
        return None if "*" in hosts else frozenset(host.lower() for host in hosts)

    @property
    def limits(self) -> Limits:
        """What one file may hold."""
        return Limits(self.max_vertices, self.max_faces, self.max_geometries)

    @property
    def max_request_meshes(self) -> int:
        """Most meshes in one request: no more than the queue has places."""
        return min(self.max_batch_meshes, self.max_queue_requests)


def _keys_in(path: Path) -> tuple[SecretStr, ...]:
    """The keys in a file, one in each line."""
    try:
        lines = path.read_text(encoding="utf-8").split("\n")
    except OSError as error:
        raise ValueError(f"{path} cannot be read: {error.strerror}") from None
    except UnicodeDecodeError:
        raise ValueError(f"{path} is not a text file") from None
    keys = tuple(SecretStr(line.strip()) for line in lines if line.strip())
    if not keys:
        raise ValueError(f"{path} holds no API key; put one in each line")
    return keys


def _is_loopback(host: str) -> bool:
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return host == "localhost"
