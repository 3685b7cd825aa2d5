"""The examples of the README and of docs are run as they stand, and print what they say; the links
of all pages lead somewhere."""

import os
import re
import shlex
import socket
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.commands import read_terminal

ROOT = Path(__file__).parents[1]
README = (ROOT / "README.md").read_text(encoding="utf-8")
HTTP = (ROOT / "docs" / "http.md").read_text(encoding="utf-8")
CONSOLE = re.findall(r"```console\n(.*?)```", README + HTTP, re.DOTALL)
REFERENCE, ONNX_FILE = (
    (ROOT / "docs" / name).read_text(encoding="utf-8") for name in ("python.md", "onnx-file.md")
)
PYTHON = re.findall(r"```python\n(.*?)```", README + REFERENCE + ONNX_FILE, re.DOTALL)
PAGES = [*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")]
NUMBER = re.compile(r"\d+(?:\.\d+)?(?:e[-+]\d+)?")


ENVIRONMENT = os.environ | {
    "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",
    "TERM": "dumb",
}


@pytest.fixture(scope="module")
def port() -> Iterator[str]:
    """The port at which the service of the examples runs: all of them start it alike."""
    (command,) = {line for line in "".join(CONSOLE).splitlines() if line.endswith("&")}
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = str(probe.getsockname()[1])
    words = shlex.split(command.removeprefix("$ ").removesuffix("&").replace("8000", port))
    with subprocess.Popen(words, cwd=ROOT, env=ENVIRONMENT) as service:
        yield port
        service.terminate()


def run_at_terminal(commands: list[str], folder: Path) -> list[list[str]]:
    """Run commands in one shell whose output is a terminal; the lines that each one printed."""
    script = "".join(f"echo @@@\n{command}\n" for command in commands)
    terminal, device = os.openpty()
    with (folder / "stderr").open("w") as errors:
        shell = subprocess.Popen(
            ["bash", "-c", script],
            cwd=ROOT,
            env=ENVIRONMENT,
            stdin=device,
            stdout=device,
            stderr=errors,
        )
        os.close(device)
        printed = read_terminal(terminal)
        shell.wait(timeout=60)
    parts = printed.decode().replace("\r", "").split("@@@\n")[1:]
    return [part.splitlines() for part in parts]


def examples(block: str) -> list[tuple[str, list[str]]]:
    """The commands of a console block, each with the lines that it should print."""
    found: list[tuple[str, list[str]]] = []
    for line in block.splitlines():
        if line.startswith("$ "):
            found.append((line[2:], []))
        else:
            found[-1][1].append(line)
    return found


def assert_same(printed: list[str], expected: list[str]) -> None:
    """Alike but for spacing and the last digits of numbers, which differ between processors."""
    ours, theirs = " ".join(printed), " ".join(expected)
    assert NUMBER.sub("#", ours).split() == NUMBER.sub("#", theirs).split()
    values = [[float(number) for number in NUMBER.findall(text)] for text in (ours, theirs)]
    for our, their in zip(*values, strict=True):
        if 0 < their < 1e-5:  # of what differs so little, all is last digits
            assert 0 < our < 5 * their
        else:
            assert our == pytest.approx(their, rel=0.02, abs=0.002 if their > 0.01 else None)


@pytest.mark.parametrize("block", CONSOLE, ids=lambda block: block.split("\n")[0][2:50])
def test_console_examples_print_what_they_show(
    block: str, tmp_path: Path, request: pytest.FixtureRequest
):
    # The port and the folder for files are the test's own; all else is as it stands.
    if "&\n" in block:
        block = block.replace("8000", request.getfixturevalue("port"))
    pairs = [
        pair for pair in examples(block.replace("/tmp/", f"{tmp_path}/")) if pair[0][-1] != "&"
    ]
    printed = run_at_terminal([command for command, _ in pairs], tmp_path)
    for lines, (command, expected) in zip(printed, pairs, strict=True):
        assert expected, f"no output is shown of: {command}"
        assert_same(lines, expected)


@pytest.mark.parametrize("code", PYTHON)
def test_python_examples_print_what_their_comments_say(code: str):
    expected = re.findall(r"print\(.*\)  # (.*)", code)
    assert expected
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert done.stdout.splitlines() == expected


@pytest.mark.parametrize("path", PAGES, ids=lambda path: path.name)
def test_links_lead_to_files_and_headings(path: Path):
    for target in re.findall(r"\]\((?!https?:)([^)]+)\)", path.read_text(encoding="utf-8")):
        file, _, heading = target.partition("#")
        linked = path.parent / file if file else path
        assert linked.exists(), target
        if heading:
            assert heading in headings(linked), target


def headings(path: Path) -> set[str]:
    """What links call the headings of a page."""
    titles = re.findall(r"^#+ (.+)$", path.read_text(encoding="utf-8"), re.MULTILINE)
    return {re.sub(r"[^\w -]", "", title.lower()).replace(" ", "-") for title in titles}
