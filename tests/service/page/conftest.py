"""A browser, and a page that a real service gives it."""

import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
from playwright.sync_api import Browser, Locator, Page, Playwright, expect, sync_playwright

from meshconv3d.model.samples import sample_paths
from tests import articulated
from tests.commands import meshconv3d
from tests.meshes import torus
from tests.service.conftest import Service, services

# WebGL in software: machines that test have no graphics card.
SOFTWARE = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-sandbox"]
NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
MOST_BYTES = 16 * 2**20  # of an upload
DESKTOP = {"viewport": {"width": 1280, "height": 860}}
FORGET = """() => {
    document.querySelector("#result").replaceChildren();
    document.querySelector("#status").textContent = "";
    document.querySelector("#view").dataset.shows = "nothing";
}"""
expect.set_options(timeout=60_000)


# Not for the whole session: while Playwright runs, no other event loop can, in this thread.
def require_page_packages(page: Path) -> None:
    """Skip a test that runs Node.js on the page's sources where that, or a package, is missing."""
    if shutil.which("node") is None:
        pytest.skip("needs node")
    if not (page / "node_modules").is_dir():
        reason = "needs the page's packages: npm ci --prefix page"
        if os.environ.get("CI"):
            pytest.fail(reason)
        pytest.skip(reason)


@pytest.fixture(scope="module")
def chromium() -> Iterator[tuple[Playwright, str]]:
    """Playwright, and the program of a Chromium: the system's, or one that Playwright installed."""
    with sync_playwright() as playwright:
        found = next(filter(None, map(shutil.which, NAMES)), playwright.chromium.executable_path)
        if Path(found).exists():
            yield playwright, found
            return
    reason = "no Chromium: apt-get install chromium, or playwright install --with-deps chromium"
    if os.environ.get("CI"):
        pytest.fail(reason)
    pytest.skip(reason)


@pytest.fixture(scope="module")
def browser(chromium: tuple[Playwright, str]) -> Iterator[Browser]:
    playwright, program = chromium
    running = playwright.chromium.launch(executable_path=program, args=SOFTWARE)
    yield running
    running.close()


@pytest.fixture(scope="session")
def site(
    model_file: Path, learned_file: Path, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Service]:
    """A service with three models, of which shrec11 is the default, and the samples as library."""
    library = tmp_path_factory.mktemp("library") / "samples.parquet"
    made = meshconv3d(
        "embed", *articulated.sample_paths().values(), "-o", library, "--model", "shrec11"
    )
    assert made.returncode == 0, made.stderr
    models = ("shrec11", str(model_file), str(learned_file))
    options = [word for model in models for word in ("--model", model)]
    with services(model_file, tmp_path_factory) as start:
        options += ["--workers", "1", "--max-upload-bytes", str(MOST_BYTES)]
        yield start(*options, "--library", str(library), alone=True)


@dataclass
class Visitor:
    """Somebody on the page."""

    page: Page
    site: Service
    asked: list[str] = field(default_factory=list)
    errors: list[str] = field(default_factory=list)

    def at(self, selector: str) -> Locator:
        return self.page.locator(selector)

    def give(self, *files: Path | dict) -> None:
        """Choose files, as in the dialog. Nothing is left in view of what was given before."""
        self.forget()
        self.at("#files").set_input_files(list(files))  # type: ignore[arg-type]

    def forget(self) -> None:
        """Take away the result in view, lest one waits for another and finds this one."""
        self.page.evaluate(FORGET)

    def drawn(self) -> None:
        """Wait until the mesh is in view, in grey or in colours."""
        expect(self.at("#view")).not_to_have_attribute("data-shows", "nothing")

    def show_evidence(self) -> None:
        """Switch the evidence on, where a test before has switched it off."""
        self.at("#evidence").evaluate("e => e.dataset.does === 'show' && e.click()")

    def bare(self) -> None:
        """Switch the evidence off, and wait until the mesh itself is in view."""
        self.classified()
        self.drawn()
        control = self.at("#evidence")
        if control.is_visible() and control.get_attribute("data-does") == "hide":
            control.click()
        expect(self.at("#view")).to_have_attribute("data-shows", "mesh")

    def ask(self, model: str) -> None:
        """Choose a model from the menu."""
        self.at("#model").click()
        self.at(f'#models button[data-model="{model}"]').click()

    def classified(self) -> None:
        expect(self.at(".bars")).to_be_visible()

    def explain(self, label: str) -> None:
        self.at(f'button[data-class="{label}"]').click()
        expect(self.at("#view")).to_have_attribute("data-shows", label)


@contextmanager
def visits(browser: Browser, site: Service) -> Iterator[Callable[..., Visitor]]:
    """Opens the page, at rest, in a window of its own. At the end, nothing went wrong on it, and
    it asked nobody but its service."""
    visitors: list[Visitor] = []

    def open_page(**options: object) -> Visitor:
        context = browser.new_context(reduced_motion="reduce", **options)  # type: ignore[arg-type]
        context.set_default_timeout(90_000)  # other tests run beside it
        page = context.new_page()
        visitor = Visitor(page, site)
        page.on("request", lambda request: visitor.asked.append(request.url))
        page.on("pageerror", lambda error: visitor.errors.append(str(error)))
        page.goto(site.url)
        expect(page.locator("#models button").first).to_be_attached()
        visitors.append(visitor)
        return visitor

    yield open_page
    for visitor in visitors:
        visitor.page.context.close()
        assert visitor.errors == []
        strangers = [u for u in visitor.asked if not u.startswith((site.url, "data:", "blob:"))]
        assert strangers == []


@pytest.fixture
def visit(browser: Browser, site: Service) -> Iterator[Callable[..., Visitor]]:
    """`visits` of one test."""
    with visits(browser, site) as visit:
        yield visit


@pytest.fixture(scope="module")
def visitor(browser: Browser, site: Service) -> Iterator[Visitor]:
    """One for all tests of a module that leave the page ready for more: opening it, in software,
    takes longer than most of them."""
    with visits(browser, site) as visit:
        visitor = visit(**DESKTOP)
        expect(visitor.at("#sample-list img")).to_have_count(len(sample_paths()))
        yield visitor


@pytest.fixture(scope="session")
def large_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A ring of 200 000 faces as binary STL, 10 MB."""
    mesh = torus(1000, 100)
    path = tmp_path_factory.mktemp("large") / "ring.stl"
    path.write_bytes(stl(mesh.vertices[mesh.faces]))
    return path


def stl(corners: np.ndarray) -> bytes:
    """Triangles, N x 3 x 3, as binary STL."""
    facets = np.zeros(len(corners), [("numbers", "<f4", 12), ("attribute", "<u2")])
    facets["numbers"][:, 3:] = corners.reshape(-1, 9)
    return bytes(80) + len(corners).to_bytes(4, "little") + facets.tobytes()
