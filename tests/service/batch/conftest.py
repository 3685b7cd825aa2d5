"""An object store that runs, and a browser, shared with the tests of the service's page."""

import os
import uuid
from collections.abc import Iterator

import pytest

from tests.service.page.conftest import browser, chromium

__all__ = ["browser", "chromium"]


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
