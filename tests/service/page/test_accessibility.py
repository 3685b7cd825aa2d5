"""The page for everybody: by keyboard, by ear, on a phone."""

from collections.abc import Callable

from axe_playwright_python.sync_playwright import Axe
from playwright.sync_api import expect

from meshconv3d.model import samples
from tests.articulated import sample_paths
from tests.processes import until
from tests.service.page.conftest import DESKTOP, Visitor
from tests.service.page.pixels import changed, pixels

SAMPLES = sample_paths()
SHOWN = samples.sample_paths()  # on the page
PHONE = {"viewport": {"width": 390, "height": 844}, "has_touch": True, "is_mobile": True}
POINTS = {"name": "points.obj", "mimeType": "", "buffer": b"v 0 0 0\nv 1 0 0\n"}


def faults(visitor: Visitor, *rules: str) -> list[str]:
    """What axe-core finds that keeps people out, or nearly; of some of its rules alone, if any."""
    options = {"runOnly": list(rules)} if rules else None
    found = Axe().run(visitor.page, options=options).response["violations"]
    return [
        f"{fault['id']}: {node['html']}"
        for fault in found
        if fault["impact"] in ("serious", "critical")
        for node in fault["nodes"]
    ]


def faults_of_both_schemes(visitor: Visitor) -> list[str]:
    """Those on a light ground, and of the colours on a dark one."""
    found = faults(visitor)
    visitor.page.emulate_media(color_scheme="dark", reduced_motion="reduce")
    found += faults(visitor, "color-contrast")
    visitor.page.emulate_media(color_scheme="light", reduced_motion="reduce")
    return found


def test_axe_finds_no_serious_fault(visit: Callable[..., Visitor]) -> None:
    visitor = visit(color_scheme="light")
    expect(visitor.at("#sample-list img")).to_have_count(len(SHOWN))
    assert faults_of_both_schemes(visitor) == []
    visitor.give(SAMPLES["octopus"], SAMPLES["ants"])
    expect(visitor.at("#entries .card.done")).to_have_count(2)
    visitor.explain("octopus")
    assert faults_of_both_schemes(visitor) == []
    visitor.give(POINTS)
    expect(visitor.at(".verdict.failed")).to_be_visible()
    assert faults_of_both_schemes(visitor) == []


def press_until(visitor: Visitor, selector: str) -> None:
    """Tab on until an element has the focus."""
    target = visitor.at(selector)
    for _ in range(60):
        visitor.page.keyboard.press("Tab")
        if target.evaluate("element => element === document.activeElement"):
            return
    raise AssertionError(f"Tab does not lead to {selector}")


def test_everything_by_keyboard(visit: Callable[..., Visitor]) -> None:
    visitor = visit(**DESKTOP)
    expect(visitor.at("#sample-list img")).to_have_count(len(SHOWN))
    press_until(visitor, "#sample-list li:nth-child(4) button")
    visitor.page.keyboard.press("Enter")
    visitor.classified()
    visitor.drawn()
    visitor.page.keyboard.press("Home")
    visitor.at(".brand").focus()
    press_until(visitor, "#view")
    view = visitor.at("#view")
    before = pixels(view)
    for key in ("ArrowRight", "ArrowRight", "ArrowUp", "+"):
        visitor.page.keyboard.press(key)
    until(lambda: changed(before, pixels(view)) > 0.02)
    visitor.page.keyboard.press("Home")
    until(lambda: changed(before, pixels(view)) < 0.002)
    press_until(visitor, ".bars li:first-child button")
    label = visitor.at(".bars li:first-child button").get_attribute("data-class")
    assert label
    visitor.page.keyboard.press("Space")
    expect(view).to_have_attribute("data-shows", label)
    # What had the focus, was made anew and has it again.
    focused = visitor.page.evaluate("document.activeElement.dataset.class")
    assert focused == label
    expect(visitor.at(f'button[data-class="{label}"]')).to_have_attribute("aria-pressed", "true")


def test_the_skip_link_leads_to_the_result(visitor: Visitor) -> None:
    visitor.give(SAMPLES["lamp"])
    visitor.classified()
    visitor.at(".skip").focus()
    visitor.page.keyboard.press("Enter")
    assert visitor.page.evaluate("document.activeElement.id") == "result"


def test_what_happens_is_announced(visitor: Visitor) -> None:
    visitor.give(SAMPLES["hand"])
    expect(visitor.at("#status")).to_contain_text("hand.stl: hand, ")
    expect(visitor.at("#view")).to_have_attribute("aria-label", "hand.stl in 3D, in grey")
    visitor.explain("hand")
    expect(visitor.at("#status")).to_have_text("The surface shows the evidence for hand")
    label = "hand.stl in 3D, evidence for hand in colours"
    expect(visitor.at("#view")).to_have_attribute("aria-label", label)


def test_a_phone_shows_all_without_scrolling_sideways_or_fault(
    visit: Callable[..., Visitor],
) -> None:
    visitor = visit(**PHONE)
    expect(visitor.at("#sample-list img")).to_have_count(len(SHOWN))
    width = "document.documentElement.scrollWidth"
    assert visitor.page.evaluate(width) <= 390
    visitor.at("#sample-list button").first.tap()
    visitor.classified()
    visitor.drawn()
    visitor.at(".bars button").first.tap()
    expect(visitor.at("#legend")).to_be_visible()
    assert visitor.page.evaluate(width) <= 390
    header = visitor.at("header").bounding_box()
    assert header
    assert header["height"] < 80  # one row
    assert faults(visitor) == []
