"""The page without a server answers as the service does, asks nobody else, and works offline."""

import json
import re
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
from meshconv3d.service.library import Library
from tests.commands import meshconv3d
from tests.model.loading.loading_builders import archive
from tests.processes import until
from tests.service.page.conftest import DESKTOP
from tests.service.page.pixels import orange, pixels
from tests.service.page.test_accessibility import faults

SAMPLES = sample_paths()
VIOLATIONS = """
    window.violations = [];
    document.addEventListener(
        "securitypolicyviolation", (event) => window.violations.push(event.blockedURI));
"""


@dataclass
class Host:
    """A web host of static files, with the build in a folder below."""

    root: Path
    asked: list[str] = field(default_factory=list)
    missing: list[str] = field(default_factory=list)
    server: ThreadingHTTPServer = field(init=False)

    def __post_init__(self) -> None:
        host = self

        class Handler(SimpleHTTPRequestHandler):
            def do_GET(self) -> None:
                host.asked.append(self.path)
                if any(part in self.path for part in host.missing):
                    self.send_error(404)
                else:
                    super().do_GET()

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
def built(library: Path, learned_file: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A root with the build in below/page, of two models, the second with learned pooling."""
    root = tmp_path_factory.mktemp("host")
    (root / "below").mkdir()
    options = ["--model", "objects", "--model", learned_file, "--library", library]
    made = meshconv3d("page", "--out", root / "below" / "page", *options)
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
    visit.page.clock.install()  # it goes on as ever, but can be put forward
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
        re.compile(
            r"Runs in this browser; nothing is uploaded. Your first file loads 7.6.MB, once; "
            r"a doubtful answer loads the other models, too \(\d+.kB\)."
        )
    )
    expect(visit.at("#sample-list .card")).to_have_count(len(sample_paths()))
    expect(visit.at("#over-http")).to_be_hidden()
    until(lambda: visit.page.evaluate("Boolean(navigator.serviceWorker.controller)"))
    assert not [path for path in host.asked if "onnx" in path]


def test_what_cannot_be_loaded_is_said_and_loaded_later(visit: Static, host: Host) -> None:
    host.missing.append("objects.onnx")
    visit.give(SAMPLES["chair"])
    expect(visit.at(".verdict.failed")).to_have_text("This page lacks what it needs")
    expect(visit.at("#result .reason")).to_contain_text("answers 404 for models/objects.onnx")
    host.missing.clear()
    visit.at("#result button").filter(has_text="Try again").click()
    expect(visit.at(".verdict")).to_have_text("chair")
    visit.at("#entries .remove").evaluate("button => button.click()")  # hidden: it is alone
    visit.faults.clear()  # the browser's own line about the 404


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


def arrays_of(glb: bytes) -> tuple[dict, np.ndarray, np.ndarray]:
    """The legend, the positions, and the colours of a coloured mesh."""
    length = int.from_bytes(glb[12:16], "little")
    document = json.loads(glb[20 : 20 + length])
    binary = glb[28 + length :]
    split = document["bufferViews"][1]["byteOffset"]
    positions = np.frombuffer(binary[:split], "<f4")
    return document["nodes"][0]["extras"], positions, np.frombuffer(binary[split:], "<u2")


def test_coloured_meshes_are_those_of_the_service(gallery: Static, classifier: Classifier) -> None:
    gallery.at("#entries .card").filter(has_text="wolf.stl").click()
    expect(gallery.at("#view")).to_have_attribute("data-shows", "quadruped")
    until(lambda: orange(pixels(gallery.at("#view"))) > 0.005)
    explained = explain(classifier, SAMPLES["wolf"])
    found = arrays_of(gallery.saved("Coloured mesh (GLB)"))
    expected = arrays_of(FORMS["glb"].write("wolf.stl", explained))
    assert found[0]["colours"] == expected[0]["colours"]
    np.testing.assert_allclose(found[1], expected[1], rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(found[2], expected[2].astype(float), atol=65)
    ply = gallery.saved("PLY"), FORMS["ply"].write("wolf.stl", explained)
    (head, body), (_, theirs) = (content.split(b"end_header\n", 1) for content in ply)
    assert b"property double density" in head
    assert len(body) == len(theirs)


def test_a_class_of_choice_is_explained(gallery: Static) -> None:
    gallery.at(".bars button").nth(2).click()
    label = str(gallery.at(".bars button").nth(2).get_attribute("data-class"))
    expect(gallery.at("#view")).to_have_attribute("data-shows", label)


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (b"PK\3\4damaged", "no whole zip archive"),
        (
            archive({"read me.txt": b"text"}),
            "holds no file of a format that is read in the browser",
        ),
        (archive({"a.zip": b"text"}), "archives within it are not opened"),
    ],
)
def test_an_archive_without_meshes_says_so(gallery: Static, content: bytes, reason: str) -> None:
    gallery.give({"name": "none.zip", "mimeType": "", "buffer": content})
    expect(gallery.at("#result .reason")).to_contain_text(reason)
    gallery.at("#entries li").last.locator(".remove").click()


def test_a_search_that_fails_says_why(gallery: Static, host: Host) -> None:
    host.missing.append("embeddings.bin")
    gallery.at("#entries .card").filter(has_text=SAMPLES["wolf"].name).click()
    section = gallery.at("#result section").filter(has_text="More like this")
    section.get_by_role("button", name="Search the library").click()
    expect(section).to_contain_text("answers 404 for library/embeddings.bin")
    host.missing.clear()
    section.get_by_role("button", name="Try again").click()
    expect(section.locator("li")).to_have_count(10)
    expect(section).not_to_contain_text("404")
    gallery.faults.clear()  # the browser's own line about the 404


def test_meshes_alike_are_those_of_the_service(
    gallery: Static, classifier: Classifier, library: Path
) -> None:
    searched = Library.read(library, [classifier.model.card])
    for name in ("chair", "train"):
        gallery.at("#entries .card").filter(has_text=SAMPLES[name].name).click()
        gallery.at("#result").get_by_role("button", name="Search the library").click()
        hits = gallery.at(".alike li")
        expect(hits).to_have_count(10)
        matches = searched.nearest(classifier.classify(SAMPLES[name]).embedding, 10)
        files = [Path(searched.value("file", match.row)).name for match in matches]
        assert hits.locator(".card-name").all_text_contents() == files
        expect(gallery.at(".alike img")).to_have_count(10)


def test_the_times_of_the_page_go_on_while_a_large_file_is_read(
    gallery: Static, large_file: Path
) -> None:
    """The view is not held up by the classification."""
    frames = """() => new Promise(done => {
        let last = performance.now(), longest = 0, left = 30;
        const next = now => {
            longest = Math.max(longest, now - last);
            last = now;
            left-- ? requestAnimationFrame(next) : done(longest);
        };
        requestAnimationFrame(next);
    })"""
    gallery.give(large_file)
    assert gallery.page.evaluate(frames) < 5000
    expect(gallery.at("#result")).to_contain_text("200\u202f000 faces, simplified to 500")


def test_the_gallery_is_a_table(gallery: Static) -> None:
    with gallery.page.expect_download() as download:
        gallery.at("#csv").click()
    lines = download.value.path().read_text().splitlines()
    assert [line.split(",")[0] for line in lines[1:13]] == [path.name for path in SAMPLES.values()]


def test_axe_finds_no_fault_in_it(gallery: Static) -> None:
    assert faults(gallery) == []  # type: ignore[arg-type]


def test_nobody_else_was_asked_and_nothing_was_sent(gallery: Static, host: Host) -> None:
    origin = host.url.removesuffix("below/page/")
    assert {method for method, _ in gallery.asked} == {"GET"}
    own = (origin, "data:", f"blob:{origin}")
    assert [url for _, url in gallery.asked if not url.startswith(own)] == []
    assert gallery.page.evaluate("window.violations") == []
    assert gallery.faults == []


def test_a_mesh_that_takes_too_long_is_given_up(
    gallery: Static, context: BrowserContext, host: Host, large_file: Path
) -> None:
    """The next one has a new worker. A model with learned pooling explains nothing."""
    visit = opened(context, host.url)
    visit.give(large_file)
    expect(visit.at(".verdict.waiting")).to_contain_text("Looking at it")
    while visit.at(".verdict.waiting").count():  # whichever step it has come to
        visit.page.clock.fast_forward(61_000)
    expect(visit.at(".verdict.failed")).to_have_text("This mesh takes too long")
    visit.at("#sample-list .card").filter(has_text="chair").click()
    expect(visit.at(".verdict")).to_have_text("chair")
    visit.at("#entries .remove").first.click()
    visit.at("#model").click()
    visit.at('#models button[data-model="learned"]').click()
    expect(visit.at(".bars")).to_be_visible()
    expect(visit.at("#result")).to_contain_text("cannot show its evidence")
    expect(visit.at(".downloads button")).to_have_text(["JSON"])
    assert visit.faults == []


def test_it_works_without_a_network(gallery: Static, context: BrowserContext, host: Host) -> None:
    """Once it was opened, and with what was loaded then."""
    host.stop()
    offline = opened(context, host.url)
    expect(offline.at("#about")).to_contain_text("nothing is uploaded")
    offline.at("#sample-list .card").filter(has_text="spoon").click()
    expect(offline.at(".bars")).to_be_visible()
    expect(offline.at("#view")).not_to_have_attribute("data-shows", "nothing")
    assert offline.page.evaluate("window.violations") == []
