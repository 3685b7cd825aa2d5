"""Records as an engine gives them, and an object store that runs."""

import json
import os
import uuid
from collections.abc import Callable, Iterator

import pytest

from meshconv3d.service.batch.classifying import Outcome
from meshconv3d.service.batch.local import LocalFile
from meshconv3d.service.prediction import Failure
from meshconv3d.service.records import Refusal


@pytest.fixture
def outcome() -> Callable[..., Outcome]:
    """Makes the outcome of a file, by its name; refused with a fault, answered without."""

    def make(name: str, fault: str | None = None, sha256: str | None = "0" * 64) -> Outcome:
        if fault is not None:
            refusal = Refusal(file=name, error=Failure(fault, "no, \u201cwhy\u201d"))
            return Outcome(LocalFile(name), refusal.model_dump_json().encode(), sha256, fault)
        record = {
            "file": name,
            "class": "ring",
            "probability": 0.5,
            "unknown": False,
            "novelty": 1.0,
            "scores": [{"class": "ring", "probability": 0.5, "score": 1.5}],
            "model": {"name": "tiny", "sha256": "1" * 64},
            "mesh": {"faces_in": 12, "resampled": "none", "watertight": True},
            "timings_ms": {"read": 1.5},
        }
        content = json.dumps(record, separators=(",", ":")).encode()
        return Outcome(LocalFile(name), content, sha256, None)

    return make


@pytest.fixture(scope="module")
def bucket() -> Iterator[str]:
    """The URL of an empty bucket, in an S3 server that runs as long as the tests of a module."""
    from moto.server import ThreadedMotoServer
    from s3fs import S3FileSystem

    server = ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
    server.start()
    _, port = server.get_host_and_port()
    variables = {
        "AWS_ENDPOINT_URL": f"http://127.0.0.1:{port}",
        "AWS_ACCESS_KEY_ID": "test",
        "AWS_SECRET_ACCESS_KEY": "test",
        "AWS_DEFAULT_REGION": "us-east-1",
    }
    with pytest.MonkeyPatch.context() as patch:
        for name, value in variables.items():
            patch.setenv(name, value)
        # The server forgets nothing as long as the process lives.
        name = f"meshes-{uuid.uuid4()}"
        S3FileSystem().mkdir(name)
        yield f"s3://{name}"
    S3FileSystem.clear_instance_cache()
    server.stop()
    assert "AWS_ENDPOINT_URL" not in os.environ
