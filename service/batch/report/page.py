"""A report as one HTML file that loads nothing, and in which names are only text."""

import base64
import hashlib
from datetime import datetime
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from meshconv3d.service.batch.journals import errors_naming
from meshconv3d.service.batch.report.collecting import BINS, Report
from meshconv3d.service.batch.report.gallery import Shown

TEMPLATES = Path(__file__).parent

# Entries of the page that are written at once.
BUFFERED = 200


def write_page(report: Report, path: Path, seconds: float) -> None:
    """Write the page of a report, whole or not at all. seconds: how long the batch took.

    Raises OSError where it cannot be written.
    """
    style, script = _source("style.css"), _source("script.js")
    files = report.gallery.least_certain_first()
    stream = (
        _environment()
        .get_template("page.html")
        .stream(
            report=report,
            seconds=seconds,
            written=datetime.now().astimezone(),
            bins=BINS,
            files=map(_entry, files),
            without_picture=sum(file.picture is None for file in files),
            style=Markup(style),
            script=Markup(script),
            policy=_policy(style, script),
        )
    )
    stream.enable_buffering(BUFFERED)
    new = path.with_name(f".{path.name}.part")
    try:
        with errors_naming(path), new.open("wb") as file:
            stream.dump(file, "utf-8")
        new.replace(path)
    except BaseException:
        new.unlink(missing_ok=True)
        raise


def _environment() -> Environment:
    environment = Environment(
        loader=FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters.update(count=_count, duration=_duration)
    return environment


def _entry(file: Shown) -> dict[str, object]:
    """A file as the page's script reads it."""
    return {
        "file": file.file,
        "unknown": file.unknown,
        "likeliest": file.likeliest,
        "faces": file.faces,
        "milliseconds": file.milliseconds,
        "picture": file.picture and base64.b64encode(file.picture).decode(),
    }


def _source(name: str) -> str:
    return (TEMPLATES / name).read_text("utf-8")


def _policy(style: str, script: str) -> str:
    """A Content-Security-Policy: this style, this script, pictures in the page, and no more."""
    return "; ".join(
        (
            "default-src 'none'",
            f"script-src {_digest(script)}",
            f"style-src {_digest(style)}",
            "img-src data:",
            "base-uri 'none'",
            "form-action 'none'",
        )
    )


def _digest(source: str) -> str:
    return f"'sha256-{base64.b64encode(hashlib.sha256(source.encode()).digest()).decode()}'"


def _count(number: int) -> str:
    """With a narrow space between thousands."""
    return f"{number:,}".replace(",", "\u202f")


def _duration(seconds: float) -> str:
    """As people say it: 4.2 s, 3 min 20 s, 2 h 5 min."""
    if seconds < 60:
        return f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    if minutes < 60:
        return f"{minutes} min {rest} s"
    return f"{minutes // 60} h {minutes % 60} min"
