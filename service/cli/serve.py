"""`meshconv3d serve`: the HTTP service under uvicorn."""

import click


@click.command()
@click.option("--model", help="Shipped model by name, or a model file. [default: shrec11]")
@click.option("--host", help="Address to listen on. [default: 127.0.0.1]")
@click.option("--port", type=int, help="Port to listen on; 0 takes a free one. [default: 8000]")
@click.option("--max-upload-bytes", type=int, help="Largest request body. [default: 104857600]")
@click.option("--workers", type=int, help="Meshes classified at the same time. [default: 2]")
def serve(**flags: str | int | None) -> None:
    """Answer over HTTP: POST a mesh to /v1/classify; the API is described at /docs.

    Every option can also be set as a variable: MESHCONV3D_MODEL, MESHCONV3D_HOST, and so on.
    """
    import uvicorn
    from pydantic import ValidationError

    from service.cli.classify import load_classifier
    from service.http.app import create_app
    from service.settings import Settings

    given = {name: value for name, value in flags.items() if value is not None}
    try:
        settings = Settings.model_validate({**Settings().model_dump(), **given})
    except ValidationError as error:
        problems = [f"{'.'.join(map(str, e['loc']))}: {e['msg']}" for e in error.errors()]
        raise click.UsageError("bad setting: " + "; ".join(problems)) from None
    app = create_app(load_classifier(settings.model), settings)
    uvicorn.run(app, host=settings.host, port=settings.port, server_header=False)
