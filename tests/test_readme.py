"""The examples of the README and of docs are run as they stand, and print what they say; the links
of all pages lead somewhere."""

import os
import re
import shlex
import shutil
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
SERVE = "meshconv3d serve --port 8000"
[HTTPX] = re.findall(r"```python\n(import json\n\nimport httpx.*?)```", HTTP, re.DOTALL)
[FETCH] = re.findall(r"```js\n(.*?)```", HTTP, re.DOTALL)
NUMBER = re.compile(r"\d+(?:\.\d+)?(?:e[-+]\d+)?")


ENVIRONMENT = os.environ | {
    "PATH": f"{Path(sys.executable).parent}:{os.environ['PATH']}",
    "TERM": "dumb",
}


@pytest.fixture(scope="module")
def port(tmp_path_factory: pytest.TempPathFactory) -> Iterator[str]:
    """The port at which the service of the examples runs, with the library that some need."""
    assert {line for line in "".join(CONSOLE).splitlines() if line.endswith("&")} == {
        f"$ {SERVE} &"
    }
    (embed, serve) = re.findall(r"```sh\n(meshconv3d embed .*)\n(meshconv3d serve .*)\n```", HTTP)[
        0
    ]
    assert serve.startswith(SERVE)
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = str(probe.getsockname()[1])
    library = str(tmp_path_factory.mktemp("library") / "library.parquet")
    embed, serve = (line.replace("library.parquet", library) for line in (embed, serve))
    subprocess.run(shlex.split(embed), cwd=ROOT, env=ENVIRONMENT, check=True)
    words = shlex.split(serve.replace("8000", port))
    with subprocess.Popen(words, cwd=ROOT, env=ENVIRONMENT) as service:
        until_ready(port)
        yield port
        service.terminate()


def until_ready(port: str) -> None:
    wait = f"curl -s --retry 60 --retry-delay 1 --retry-connrefused http://127.0.0.1:{port}/readyz"
    subprocess.run(shlex.split(wait), check=True, capture_output=True)


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
    if ":8000" in block:
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


def test_the_routes_answer_httpx_as_its_comments_say(port: str) -> None:
    code = HTTPX.replace("8000", port)
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    )
    assert done.stdout.splitlines() == re.findall(r"print\(.*\)  # (.*)", code)


@pytest.mark.skipif(not shutil.which("node"), reason="no node")
def test_the_routes_answer_fetch_as_its_comments_say(port: str) -> None:
    code = FETCH.replace("8000", port)
    done = subprocess.run(
        ["node", "--input-type=module", "--eval", code],
        cwd=ROOT,
        capture_output=True,
        text=True,
        check=True,
    )
    assert done.stdout.splitlines() == re.findall(r"console\.log\(.*\); // (.*)", code)


@pytest.mark.parametrize("language", ["console", "python", "js"])
def test_every_route_has_an_example(language: str) -> None:
    code = "".join(re.findall(rf"```{language}\n(.*?)```", HTTP, re.DOTALL))
    table = re.findall(r"^\| (?:`(?:GET|POST) )?`?(/v1/[a-z/]+)", HTTP, re.MULTILINE)
    assert len(table) == 10
    for path in (*table, "/v2/models/objects/infer", "/readyz"):
        assert path in code, path


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
