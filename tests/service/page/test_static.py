"""The page without a server answers as the service does, asks nobody else, and works offline."""

import json
import threading
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import partial
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Browser, BrowserContext, Page, expect

from meshconv3d.model.samples import sample_paths
from meshconv3d.service.attribution import FORMS, explain
from meshconv3d.service.classifier import Classifier
from tests.commands import meshconv3d
from tests.processes import until
from tests.service.page.conftest import DESKTOP

SAMPLES = sample_paths()
MODELS = ("objects", "shrec11")
VIOLATIONS = """
    window.violations = [];
    document.addEventListener(
        "securitypolicyviolation", (event) => window.violations.push(event.blockedURI));
"""


@dataclass
class Host:
    """A web host of static files, with the build in a folder below."""

    root: Path
    asked: list[tuple[str, str]] = field(default_factory=list)
    down: bool = False
    server: ThreadingHTTPServer = field(init=False)

    def __post_init__(self) -> None:
        host = self

        class Handler(SimpleHTTPRequestHandler):
            def handle_one_request(self) -> None:
                super().handle_one_request()
                host.asked.append((self.command, self.path))

            def log_message(self, *_: object) -> None: ...

        self.server = ThreadingHTTPServer(
            ("127.0.0.1", 0), partial(Handler, directory=str(self.root))
        )
        threading.Thread(target=self.server.serve_forever, daemon=True).start()

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.server.server_port}/below/page/"

    def stop(self) -> None:
        self.server.shutdown()
        self.server.server_close()


@pytest.fixture(scope="module")
def library(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("library") / "samples.parquet"
    made = meshconv3d("embed", *SAMPLES.values(), "-o", path, "--model", "objects")
    assert made.returncode == 0, made.stderr
    return path


@pytest.fixture(scope="module")
def built(library: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A root with the build in below/page."""
    root = tmp_path_factory.mktemp("host")
    (root / "below").mkdir()
    options = [word for model in MODELS for word in ("--model", model)]
    made = meshconv3d("page", "--out", root / "below" / "page", *options, "--library", library)
    assert made.returncode == 0, made.stderr
    return root


@pytest.fixture(scope="module")
def host(built: Path) -> Iterator[Host]:
    host = Host(built)
    yield host
    host.stop()


@pytest.fixture(scope="module")
def context(browser: Browser) -> Iterator[BrowserContext]:
    context = browser.new_context(reduced_motion="reduce", **DESKTOP)  # type: ignore[arg-type]
    context.set_default_timeout(90_000)
    context.add_init_script(VIOLATIONS)
    yield context
    context.close()


@dataclass
class Static:
    """The page of the build, and what went wrong on it."""

    page: Page
    faults: list[str] = field(default_factory=list)
    asked: list[tuple[str, str]] = field(default_factory=list)

    def at(self, selector: str):
        return self.page.locator(selector)

    def give(self, *files: Path | dict) -> None:
        self.at("#files").set_input_files(list(files))  # type: ignore[arg-type]

    def saved(self, button: str) -> bytes:
        with self.page.expect_download() as download:
            self.at(".downloads").get_by_role("button", name=button).click()
        return download.value.path().read_bytes()


def opened(context: BrowserContext, url: str) -> Static:
    visit = Static(context.new_page())
    visit.page.on("pageerror", lambda error: visit.faults.append(str(error)))
    visit.page.on(
        "console", lambda line: visit.faults.append(line.text) if line.type == "error" else None
    )
    visit.page.on("request", lambda request: visit.asked.append((request.method, request.url)))
    visit.page.goto(url)
    expect(visit.at("#models button").first).to_be_attached()
    return visit


@pytest.fixture(scope="module")
def visit(context: BrowserContext, host: Host) -> Static:
    """The first visit."""
    return opened(context, host.url)


@pytest.fixture(scope="module")
def classifier() -> Classifier:
    return Classifier.load("objects")


def test_sizes_are_told_before_anything_large_is_loaded(visit: Static, host: Host) -> None:
    expect(visit.at("#about")).to_have_text(
        "Runs in this browser; nothing is uploaded. "
        "Your first file loads 3.5 MB runtime and 3.7 MB model, once."
    )
    expect(visit.at("#sample-list .card")).to_have_count(len(sample_paths()))
    expect(visit.at("#over-http")).to_be_hidden()
    until(lambda: visit.page.evaluate("Boolean(navigator.serviceWorker.controller)"))
    assert not [path for _, path in host.asked if "onnx" in path]


@pytest.fixture(scope="module")
def gallery(visit: Static) -> Static:
    visit.give(*SAMPLES.values())
    expect(visit.at("#entries .card.done")).to_have_count(len(SAMPLES))
    return visit


@pytest.mark.parametrize("name", SAMPLES)
def test_a_sample_is_answered_as_by_the_service(
    gallery: Static, classifier: Classifier, name: str
) -> None:
    """Verdict, probabilities, what was done to the mesh, and the evidence of each face."""
    path = SAMPLES[name]
    explained = explain(classifier, path)
    expected = json.loads(FORMS["json"].write(path.name, explained))
    gallery.at("#entries .card").filter(has_text=path.name).click()
    expect(gallery.at(".file-name")).to_have_text(path.name)
    title = "Unknown" if expected["unknown"] else expected["class"].replace("_", " ")
    expect(gallery.at(".verdict")).to_contain_text(title)
    found = json.loads(gallery.saved("JSON"))
    for same in ("file", "class", "unknown", "mesh"):
        assert found[same] == expected[same]
    by_class = [{s["class"]: s for s in answer["scores"]} for answer in (found, expected)]
    for label, score in by_class[1].items():
        assert by_class[0][label]["score"] == pytest.approx(score["score"], abs=2e-3)
        assert by_class[0][label]["probability"] == pytest.approx(score["probability"], abs=1e-3)
    ours, theirs = found["evidence"], expected["evidence"]
    assert ours["colours"] == theirs["colours"]
    for number in ("score", "bias", "limit"):
        assert ours[number] == pytest.approx(theirs[number], abs=2e-3)
    np.testing.assert_allclose(ours["contributions"], theirs["contributions"], atol=1e-4)
