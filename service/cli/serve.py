"""`meshconv3d serve`: the HTTP service."""

import signal
from collections.abc import Callable
from typing import Any, Literal, get_args, get_origin

import click
from pydantic.fields import FieldInfo

from meshconv3d.service.settings import Settings


def settings_options(command: Callable[..., Any]) -> Callable[..., Any]:
    """Give a command one option for each setting, in the order of the settings."""
    for name, setting in reversed(Settings.model_fields.items()):
        command = _option(name, setting)(command)
    return command


def _option(name: str, setting: FieldInfo) -> Callable[..., Any]:
    several = get_origin(setting.annotation) is tuple
    # Types and bounds are the settings' own, so that flags and variables fail alike.
    return click.option(
        "--" + (name.removesuffix("s") if several else name).replace("_", "-"),
        name,
        multiple=several,
        metavar=_metavar(setting),
        help=f"{setting.description} [default: {_default(setting)}]",
    )


def _metavar(setting: FieldInfo) -> str:
    if get_origin(setting.annotation) is Literal:
        return "|".join(get_args(setting.annotation))
    return {int: "INTEGER", float: "NUMBER"}.get(setting.annotation, "TEXT")  # type: ignore[arg-type]


def _default(setting: FieldInfo) -> str:
    default = setting.get_default(call_default_factory=True)
    if default in (None, ()):
        return "none"
    return ", ".join(default) if isinstance(default, tuple) else str(default)


@click.command()
@settings_options
def serve(**flags: Any) -> None:
    """Answer over HTTP: POST a mesh to /v1/classify; the API is described at /openapi.json.

    Every setting can also be given as a variable, MESHCONV3D_PORT for --port and so on; a flag
    goes before its variable. It stops at SIGTERM or SIGINT once all accepted work is answered; a
    second one ends it at once.
    """
    from meshconv3d.export.metadata import ModelFileError
    from meshconv3d.model.errors import Error
    from meshconv3d.service.classifier import SelfTestError
    from meshconv3d.service.cli.setup import read_settings
    from meshconv3d.service.http.server import (
        CannotListen,
        TooFewFiles,
        bind,
        raise_file_limit,
        run,
        start_workers,
    )
    from meshconv3d.service.logs import configure_logs
    from meshconv3d.service.workers import NotStarted

    settings = read_settings(flags)
    configure_logs(settings.log_format)
    signal.signal(signal.SIGTERM, _stop)  # until the server takes over
    try:
        if settings.library is not None:
            import meshconv3d.service.library  # noqa: F401 (its extra may be missing)
        raise_file_limit(settings)
        sockets = bind(settings)  # first: a port that is taken is told at once
        pool = start_workers(settings)
    except (CannotListen, TooFewFiles, ModelFileError, SelfTestError) as error:
        raise click.UsageError(str(error)) from None
    except NotStarted as error:
        raise click.ClickException(str(error)) from None
    try:
        run(settings, pool, sockets)
    except (Error, OSError) as error:
        raise click.UsageError(str(error)) from None
    finally:
        pool.close()


def _stop(*_: object) -> None:
    raise SystemExit(0)
