"""`meshconv3d`: the table of commands.

Commands are named as text and imported when one is run: `--version` must not wait for NumPy, and
the rooms of training and export stay unknown to this one.
"""

import codecs
import importlib
import importlib.metadata
import io
import logging
import os
import sys
from collections.abc import Callable

import click

# name -> (module:function in this package, one line of help)
COMMANDS = {
    "classify": (
        "service.cli.classify:classify",
        "Say what the meshes in files and folders are.",
    ),
    "batch": (
        "service.cli.batch:batch",
        "Classify folders of any size into one file.",
    ),
    "explain": (
        "service.cli.explain:explain",
        "Colour a mesh by what speaks for its class.",
    ),
    "evaluate": ("service.cli.evaluate:evaluate", "Measure how good a model is."),
    "serve": ("service.cli.serve:serve", "Answer over HTTP."),
    "formats": ("service.cli.formats:formats", "List the file formats that are read."),
    "inspect": ("service.cli.inspect:inspect", "Show a model's card."),
    "train": (
        "model.training.cli:train",
        "Train a network on a folder of labelled meshes.",
    ),
    "export": ("export.cli:export", "Turn a checkpoint into one ONNX file."),
    "verify": ("export.cli:verify", "Compare an ONNX file with its checkpoint."),
}

# What each extra installs, by the names under which it is imported.
EXTRAS = {
    "report": {"jinja2", "PIL"},
    "ray": {"ray"},
    "parquet": {"pyarrow"},
    "remote": {"fsspec"},
    "train": {"torch", "onnx", "onnxscript", "safetensors", "matplotlib"},
}


# Characters that the commands print and an encoding may lack; any other becomes "?".
ASCII = {"→": "->", "…": "..."}


class MissingExtra(click.ClickException):
    """A call that cannot be done as the package is installed; its exit code is a wrong one's."""

    exit_code = 2


class Commands(click.Group):
    """A group that imports a command when it is run, and knows the help of all without."""

    def list_commands(self, ctx: click.Context) -> list[str]:
        return list(COMMANDS)

    def get_command(self, ctx: click.Context, cmd_name: str) -> click.Command | None:
        if cmd_name not in COMMANDS:
            return None
        module, function = COMMANDS[cmd_name][0].split(":")
        return getattr(importlib.import_module(f"meshconv3d.{module}"), function)

    def format_commands(self, ctx: click.Context, formatter: click.HelpFormatter) -> None:
        with formatter.section("Commands"):
            formatter.write_dl([(name, line) for name, (_, line) in COMMANDS.items()])

    def invoke(self, ctx: click.Context) -> object:
        try:
            return super().invoke(ctx)
        except ModuleNotFoundError as error:
            extra = _extra_with(error.name, ctx.invoked_subcommand)
            if extra is None:
                raise
            raise MissingExtra(
                f"this command needs {error.name}, which comes with an extra: "
                f"pip install '.[{extra}]' in a clone of meshconv3d"
            ) from None
        except BrokenPipeError:
            # Here, since click would make it exit code 1.
            _drop_output()
            ctx.exit(0)


class _Once(logging.Filter):
    """Lets each message through once: folders are walked several times, to count them, too."""

    def __init__(self) -> None:
        super().__init__()
        self._said: set[str] = set()

    def filter(self, record: logging.LogRecord) -> bool:
        message = record.getMessage()
        new = message not in self._said
        self._said.add(message)
        return new


def _extra_with(module: str | None, command: str | None) -> str | None:
    """The extra that installs a module, named as in `import`, if one does.

    Pillow is in several: then it is the one that is named like the command, or the first.
    """
    package = (module or "").partition(".")[0]
    extras = [extra for extra, packages in EXTRAS.items() if package in packages]
    return command if command in extras else next(iter(extras), None)


def _print_version(ctx: click.Context, _: click.Parameter, wanted: bool) -> None:
    if wanted:
        click.echo(f"meshconv3d {importlib.metadata.version('meshconv3d')}")
        ctx.exit()


@click.group(cls=Commands, context_settings={"help_option_names": ["-h", "--help"]})
@click.option(
    "--version",
    is_flag=True,
    expose_value=False,
    is_eager=True,
    callback=_print_version,
    help="Print the version.",
)
def commands() -> None:
    """What is this 3D mesh? MeshConv3D classifies raw triangle meshes."""
    handler = logging.StreamHandler()
    handler.addFilter(_Once())
    logging.basicConfig(
        format="%(levelname)s %(message)s", level=logging.WARNING, handlers=[handler]
    )


def main() -> None:
    """Run the command line; a reader that closes the pipe early is no failure."""
    # Python has None in place of a stream that the caller closed.
    sys.stdin = sys.stdin or open(os.devnull)  # noqa: SIM115 (open until exit)
    sys.stdout = sys.stdout or open(os.devnull, "w")  # noqa: SIM115
    codecs.register_error("ascii-like", _ascii_like)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="ascii-like")
    run: Callable[..., object] = commands
    try:
        status = run(standalone_mode=False)
        sys.stdout.flush()
    except (click.exceptions.Abort, SystemError) as error:
        if isinstance(error, SystemError) and not _comes_from_interrupt(error):
            raise
        click.echo("interrupted", err=True)
        sys.exit(130)
    except click.ClickException as error:
        error.show()
        sys.exit(error.exit_code)
    except MemoryError:
        click.echo("Error: not enough memory; raise the limit of it (ulimit -v)", err=True)
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


def _ascii_like(error: UnicodeError) -> tuple[str, int]:
    """Error handler of the standard streams: what a terminal's encoding lacks, in ASCII."""
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
    """Send what is left to nowhere: Python flushes stdout at exit, and would complain then."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
