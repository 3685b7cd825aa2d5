"""`meshconv3d serve`: the HTTP service under uvicorn."""

import copy
import signal

import click


@click.command()
@click.option("--model", help="Shipped model by name, or a model file. [default: shrec11]")
@click.option("--host", help="Address to listen on. [default: 127.0.0.1]")
@click.option("--port", type=int, help="Port to listen on; 0 takes a free one. [default: 8000]")
@click.option("--max-upload-bytes", type=int, help="Largest request body. [default: 104857600]")
@click.option("--workers", type=int, help="Meshes classified at the same time. [default: 2]")
def serve(**flags: str | int | None) -> None:
    """Answer over HTTP: POST a mesh to /v1/classify; the API is described at /openapi.json.

    Every option can also be set as a variable: MESHCONV3D_MODEL, MESHCONV3D_HOST, and so on.
    """
    import uvicorn
    import uvicorn.config

    from service.cli.shared import load_classifier, read_settings
    from service.http.app import create_app

    # To be stopped is no failure. The server drains first, then raises the signal once more.
    signal.signal(signal.SIGTERM, _stop)
    settings = read_settings(flags)
    app = create_app(load_classifier(settings.model), settings)
    logs = copy.deepcopy(uvicorn.config.LOGGING_CONFIG)
    logs["handlers"]["access"]["stream"] = "ext://sys.stderr"
    uvicorn.run(app, host=settings.host, port=settings.port, server_header=False, log_config=logs)


def _stop(*_: object) -> None:
    raise SystemExit(0)
