"""A report in a real browser, from its file: filters, order, keyboard, hostile names."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import Browser, Page, expect

from meshconv3d.service.batch.report import Report, write_page
from meshconv3d.service.picture import picture
from tests.meshes import cube, icosphere, torus
from tests.service.batch.records import MODEL, answer, refusal

EVIL = "<img src=x onerror=document.title='owned'><script>document.title='owned'</script>"
PHONE = {"viewport": {"width": 390, "height": 844}, "has_touch": True, "is_mobile": True}
FILES = 600


@pytest.fixture(scope="module")
def report_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """600 balls, rings and boxes, ever surer; twenty unknown files, refused ones, evil names."""
    report = Report(MODEL, f"toys {EVIL}")
    kinds = {"ball": picture(icosphere(2)), "ring": picture(torus()), "box": picture(cube())}
    labels = list(kinds)
    for i in range(FILES):
        label = labels[i % 3]
        report.add(answer(f"toys/{i}.obj", label, 0.4 + 0.6 * i / FILES, False, i), kinds[label])
    for i in range(20):
        report.add(answer(f"strange/{i}.obj", "ring", 0.9, unknown=True), kinds["ring"])
    report.add(answer(f"{EVIL}.obj", EVIL, 0.31))
    report.add(refusal(f"{EVIL}.stl", "no-faces", f"it holds none {EVIL}"))
    report.add(refusal("cut.stl", "truncated", "it ends after 10 bytes"))
    path = tmp_path_factory.mktemp("report") / "report.html"
    write_page(report, path, 12.0)
    return path


@contextmanager
def opened(browser: Browser, report_file: Path, **options: Any) -> Iterator[Page]:
    """The report in a window of its own. At the end, nothing went wrong on it, and it asked nobody
    anything."""
    asked: list[str] = []
    errors: list[str] = []
    page = browser.new_context(**options).new_page()
    page.on("request", lambda request: asked.append(request.url))
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.on("console", lambda message: errors.append(message.text))
    page.goto(report_file.as_uri())
    yield page
    assert page.title() != "owned"
    page.context.close()
    assert errors == []
    assert [url for url in asked if not url.startswith(("data:", report_file.as_uri()))] == []


@pytest.fixture(scope="module")
def window(browser: Browser, report_file: Path) -> Iterator[Page]:
    with opened(browser, report_file, viewport={"width": 1280, "height": 900}) as page:
        yield page


@pytest.fixture
def page(window: Page) -> Page:
    """The report, just opened: loading it anew takes less than another window."""
    window.reload()
    return window


def found(page: Page, count: int) -> None:
    expect(page.locator("#found")).to_have_text(f"{count} files")


def shares(page: Page) -> list[float]:
    """The probabilities on the tiles, in per cent."""
    texts = page.locator("#tiles .share").all_text_contents()
    return [float(text.rstrip("\u00a0 %")) for text in texts]


def titles(page: Page) -> set[str]:
    return set(page.locator("#tiles .title").all_text_contents())


def test_the_least_certain_come_first_with_their_pictures(page: Page) -> None:
    found(page, FILES + 1)
    first = shares(page)
    assert first == sorted(first)
    assert page.locator("#tiles .title").first.text_content() == EVIL
    image = page.locator("#tiles img").nth(1)
    expect(image).to_be_visible()
    assert image.evaluate("image => image.decode().then(() => image.naturalWidth)") == 96


def test_more_come_as_one_scrolls(page: Page) -> None:
    before = page.locator("#tiles li").count()
    assert before < FILES
    for _ in range(10):
        page.locator("#tiles li").last.scroll_into_view_if_needed()
        page.wait_for_timeout(50)
    expect(page.locator("#tiles li")).to_have_count(FILES + 1)
    expect(page.locator("#more")).to_be_hidden()


def test_a_class_is_chosen_by_its_bar_and_left_again(page: Page) -> None:
    bar = page.locator('[data-class="ring"]')
    expect(bar).to_contain_text("200")
    bar.click()
    found(page, 200)
    assert titles(page) == {"ring"}
    expect(bar).to_have_attribute("aria-pressed", "true")
    expect(page.locator("select[name=class]")).to_have_value("ring")
    bar.click()
    found(page, FILES + 1)


def test_unknown_files_are_apart(page: Page) -> None:
    assert "unknown" not in titles(page)
    page.locator("[data-unknown]").click()
    found(page, 20)
    assert titles(page) == {"unknown"}
    page.get_by_label("Show").select_option("all")
    found(page, FILES + 21)


def test_the_histogram_chooses_a_range(page: Page) -> None:
    bins = page.locator(".histogram button")
    expect(bins).to_have_count(20)
    expect(bins.nth(0)).to_be_disabled()
    bins.nth(12).click()
    found(page, 50)
    assert all(60 <= share <= 65 for share in shares(page))
    page.get_by_label("Probability to, %").fill("70")
    found(page, 100)
    page.get_by_role("button", name="Reset").click()
    found(page, FILES + 1)


def test_search_and_order(page: Page) -> None:
    page.get_by_label("Search").fill("toys/59")
    found(page, 11)
    page.get_by_label("Order").select_option("file")
    names = page.locator("#tiles .file").all_text_contents()
    assert names == ["59.obj", *(f"{i}.obj" for i in range(590, 600))]
    page.get_by_label("Order").select_option("slow")
    assert page.locator("#tiles .file").first.text_content() == "599.obj"
    page.get_by_label("Search").fill("BALL")
    page.get_by_label("Order").select_option("certain")
    found(page, 200)
    assert titles(page) == {"ball"}
    assert shares(page) == sorted(shares(page), reverse=True)


def test_files_are_walked_through_by_keyboard(page: Page) -> None:
    page.locator("body").press("Tab")
    page.keyboard.press("Enter")  # the link to the files
    page.get_by_label("Search").press("Tab")
    tile = page.locator("#tiles button").nth(1)
    tile.focus()
    page.keyboard.press("Enter")
    dialog = page.get_by_role("dialog")
    expect(dialog).to_contain_text("toys/0.obj")
    page.keyboard.press("ArrowRight")
    expect(dialog).to_contain_text("toys/1.obj")
    expect(dialog).to_contain_text("1200 faces")
    expect(dialog).to_contain_text("something else")
    page.keyboard.press("ArrowLeft")
    page.keyboard.press("ArrowLeft")
    expect(dialog).to_contain_text(f"{EVIL}.obj")
    expect(dialog.get_by_role("button", name="Previous")).to_be_disabled()
    page.keyboard.press("Escape")
    expect(dialog).to_be_hidden()
    expect(page.locator("#tiles button").first).to_be_focused()


def test_refused_files_are_named_with_their_reason(page: Page) -> None:
    page.locator("summary").filter(has_text="truncated").click()
    expect(page.get_by_text("it ends after 10 bytes")).to_be_visible()
    page.locator("summary").filter(has_text="no-faces").click()
    expect(page.get_by_text(f"it holds none {EVIL}")).to_be_visible()


@pytest.mark.parametrize("options", [{"color_scheme": "light"}, PHONE], ids=["wide", "phone"])
def test_axe_finds_no_serious_fault(browser: Browser, report_file: Path, options: dict) -> None:
    # axe is a script of ours, which the page's policy keeps out.
    page = browser.new_context(bypass_csp=True, **options).new_page()
    page.goto(report_file.as_uri())
    for summary in page.locator("summary").all():
        summary.click()
    assert _faults(page) == []
    page.locator("[data-unknown]").click()
    page.locator("#tiles button").first.click()
    assert _faults(page) == []
    if options != PHONE:
        page.emulate_media(color_scheme="dark")
        assert _faults(page, "color-contrast") == []
        page.keyboard.press("Escape")
        assert _faults(page, "color-contrast") == []
    page.context.close()


def _faults(page: Page, *rules: str) -> list[str]:
    options = {"runOnly": list(rules)} if rules else None
    found = Axe().run(page, options=options).response["violations"]
    return [
        f"{fault['id']}: {node['html']}"
        for fault in found
        if fault["impact"] in ("serious", "critical")
        for node in fault["nodes"]
    ]


def test_a_phone_shows_all_without_scrolling_sideways(browser: Browser, report_file: Path) -> None:
    with opened(browser, report_file, **PHONE) as page:
        assert page.evaluate("document.documentElement.scrollWidth") <= 390
        page.locator("#tiles button").first.tap()
        expect(page.get_by_role("dialog")).to_be_visible()
        assert page.evaluate("document.documentElement.scrollWidth") <= 390


def test_a_script_that_got_in_would_not_run(browser: Browser, report_file: Path) -> None:
    page = browser.new_page()
    page.goto(report_file.as_uri())
    page.evaluate("() => { window.refused = [] }")
    page.evaluate("""() => document.addEventListener('securitypolicyviolation', (event) =>
        window.refused.push(event.effectiveDirective))""")
    page.evaluate("""() => {
        const script = document.createElement('script');
        script.textContent = "document.title = 'owned'";
        document.body.append(script);
        new Image().src = 'https://example.org/x.png';
    }""")
    page.wait_for_function("window.refused.length === 2")
    assert set(page.evaluate("window.refused")) == {"script-src-elem", "img-src"}
    assert page.title() != "owned"
    page.context.close()
