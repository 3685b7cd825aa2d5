"""`meshconv3d`: the table of commands.

A command's module is named as text and imported when it is run: `--version` must not wait for
NumPy, and nothing of training and export is imported to serve.
"""

import codecs
import importlib
import io
import logging
import os
import sys
from collections.abc import Callable

import click

# name -> (module of this package that has a command of this name, one line of help)
COMMANDS = {
    "classify": ("service.cli.classify", "Say what the meshes in files and folders are."),
    "batch": ("service.cli.batch", "Classify folders of any size into one file."),
    "explain": ("service.cli.explain", "Colour a mesh by what speaks for its class."),
    "teach": ("service.cli.teach", "Make a model of your own classes from a few examples."),
    "embed": ("service.cli.library", "Make a library of meshes, to search for alike ones."),
    "similar": ("service.cli.library", "Find the meshes of a library that are like one."),
    "duplicates": ("service.cli.library", "List the meshes of a library that are one shape."),
    "evaluate": ("service.cli.evaluate", "Measure how good a model is."),
    "serve": ("service.cli.serve", "Answer over HTTP."),
    "page": ("service.cli.page", "Write the page as a folder that needs no server."),
    "formats": ("service.cli.show", "List the file formats that are read."),
    "inspect": ("service.cli.show", "Show a model's card."),
    "train": ("model.training.cli", "Train a network on a folder of labelled meshes."),
    "export": ("export.cli", "Turn a checkpoint into one ONNX file."),
    "verify": ("export.cli", "Compare an ONNX file with its checkpoint."),
}

# Extra that installs a module, by the name under which it is imported.
EXTRAS = {
    **dict.fromkeys(("jinja2", "PIL"), "report"),
    "ray": "ray",
    "pyarrow": "parquet",
    "fsspec": "remote",
    "onnx": "teach",
    **dict.fromkeys(("torch", "onnxscript", "safetensors", "matplotlib"), "train"),
}

# Options of `batch` that were those of `classify` in scripts of before it.
BATCH_OPTIONS = {"--output", "--resume", "--sort-into", "--report"}

# Characters that the commands print and an encoding may lack; any other becomes "?".
ASCII = {"→": "->", "…": "..."}


class MissingExtra(click.ClickException):
    """Error of a call that needs an extra that is not installed; exits as after a wrong call."""

    exit_code = 2


class Commands(click.Group):
    """Group that imports a command when it is run, and knows the help of all without."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        module, _ = COMMANDS[cmd_name]
        return getattr(importlib.import_module(f"meshconv3d.{module}"), cmd_name)

    def resolve_command(
        self, ctx: click.Context, args: list[str]
    ) -> tuple[str | None, click.Command | None, list[str]]:
        if args[0] == "classify" and BATCH_OPTIONS.intersection(a.partition("=")[0] for a in args):
            click.echo("note: with this option, classify is now meshconv3d batch", err=True)
            args = ["batch", *args[1:]]
        return super().resolve_command(ctx, args)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl([(name, line) for name, (_, line) in COMMANDS.items()])

    def invoke(self, ctx: click.Context) -> object:
        try:
            return super().invoke(ctx)
        except ModuleNotFoundError as error:
            extra = EXTRAS.get((error.name or "").partition(".")[0])
            if extra is None:
                raise
            raise MissingExtra(
                f"this command needs {error.name}, which comes with an extra: "
                f"pip install 'meshconv3d[{extra}]'"
            ) from None
        except BrokenPipeError:
            # Here, since click would make it exit code 1.
            _drop_output()
            ctx.exit(0)


class _Once(logging.Filter):
    """Passes each message once: folders are walked several times, to count them, too."""

    def __init__(self) -> None:
        super().__init__()
        self._passed: set[str] = set()

    def filter(self, record: logging.LogRecord) -> bool:
        message = record.getMessage()
        new = message not in self._passed
        self._passed.add(message)
        return new


@click.group(cls=Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.version_option(package_name="meshconv3d", message="%(prog)s %(version)s")
def commands() -> None:
    """What is this 3D mesh? MeshConv3D classifies raw triangle meshes."""
    handler = logging.StreamHandler()
    handler.addFilter(_Once())
    logging.basicConfig(
        format="%(levelname)s %(message)s", level=logging.WARNING, handlers=[handler]
    )


def main() -> None:
    """Run the command line; a reader that closes the pipe early is no failure."""
    _prepare_streams()
    run: Callable[..., object] = commands
    try:
        status = run(prog_name="meshconv3d", standalone_mode=False)
        sys.stdout.flush()
    except (click.exceptions.Abort, SystemError) as error:
        if isinstance(error, SystemError) and not _comes_from_interrupt(error):
            raise
        click.echo("interrupted", err=True)
        sys.exit(130)
    except click.ClickException as error:
        error.show()
        sys.exit(error.exit_code)
    except (MemoryError, RuntimeError) as error:
        if isinstance(error, RuntimeError) and "can't start new thread" not in str(error):
            raise
        click.echo("Error: there is not enough memory (see ulimit -v)", err=True)
        sys.exit(1)
    except BrokenPipeError:
        _drop_output()
        sys.exit(0)
    except OSError as error:
        where = f": {error.filename}" if error.filename else ""
        click.echo(f"Error: {error.strerror or error}{where}", err=True)
        _drop_output()
        sys.exit(1)
    sys.exit(status if isinstance(status, int) else 0)


def _prepare_streams() -> None:
    """Have all three standard streams, and none that fails at a character."""
    # Python has None in place of a stream that the caller closed.
    sys.stdin = sys.stdin or open(os.devnull)  # noqa: SIM115 (open until exit)
    sys.stdout = sys.stdout or open(os.devnull, "w")  # noqa: SIM115
    codecs.register_error("ascii-like", _ascii_like)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="ascii-like")


def _ascii_like(error: UnicodeError) -> tuple[str, int]:
    """Error handler: characters that a terminal's encoding lacks, in ASCII."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    text = error.object[error.start : error.end]
    return "".join(ASCII.get(character, "?") for character in text), error.end


def _comes_from_interrupt(error: BaseException | None) -> bool:
    """Whether Ctrl-C came while compiled code ran, which reports it as an error of its own."""
    while error is not None:
        if isinstance(error, KeyboardInterrupt):
            return True
        error = error.__cause__
    return False


def _drop_output() -> None:
    """Discard what is left: Python flushes stdout at exit, and would complain then."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
