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
    """What axe-core finds; by some of its rules alone, if any."""
    options = {"runOnly": list(rules)} if rules else None
    found = Axe().run(visitor.page, options=options).response["violations"]
    return [f"{fault['id']}: {node['html']}" for fault in found for node in fault["nodes"]]


def faults_of_both_schemes(visitor: Visitor) -> list[str]:
    """Those on a light ground, and of the colours on a dark one."""
    found = faults(visitor)
    visitor.page.emulate_media(color_scheme="dark", reduced_motion="reduce")
    found += faults(visitor, "color-contrast")
    visitor.page.emulate_media(color_scheme="light", reduced_motion="reduce")
    return found


def test_axe_finds_no_fault(visit: Callable[..., Visitor]) -> None:
    visitor = visit(color_scheme="light")
    expect(visitor.at("#sample-list img")).to_have_count(len(SHOWN))
    assert faults_of_both_schemes(visitor) == []
    visitor.give(SAMPLES["octopus"], SAMPLES["ants"])
    expect(visitor.at("#entries .card.done")).to_have_count(2)
    expect(visitor.at("#view")).to_have_attribute("data-shows", "octopus")
    visitor.at("#model").click()
    assert faults_of_both_schemes(visitor) == []
    visitor.page.keyboard.press("Escape")
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
    visitor.bare()
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
    press_until(visitor, ".bars li:nth-child(2) button")
    label = visitor.at(".bars li:nth-child(2) button").get_attribute("data-class")
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
    visitor.show_evidence()
    visitor.give(SAMPLES["hand"])
    expect(visitor.at("#status")).to_have_text("The surface shows the evidence for hand")
    label = "hand.stl in 3D, evidence for hand in colours"
    expect(visitor.at("#view")).to_have_attribute("aria-label", label)
    visitor.bare()
    expect(visitor.at("#view")).to_have_attribute("aria-label", "hand.stl in 3D, in grey")


def test_a_phone_keeps_the_mesh_in_view(visit: Callable[..., Visitor]) -> None:
    """Nothing scrolls sideways, and the classes scroll below the mesh."""
    visitor = visit(**PHONE)
    expect(visitor.at("#sample-list img")).to_have_count(len(SHOWN))
    expect(visitor.at("#empty h2")).to_have_text("Choose a mesh", use_inner_text=True)
    width = "document.documentElement.scrollWidth"
    assert visitor.page.evaluate(width) <= 390
    header = visitor.at("header").bounding_box()
    assert header
    assert header["height"] < 80  # one row
    visitor.at("#sample-list button").first.tap()
    expect(visitor.at("#legend")).to_be_visible()
    visitor.at(".more").tap()
    last = visitor.at(".bars button").last
    last.tap()
    expect(visitor.at("#view")).to_have_attribute(
        "data-shows", str(last.get_attribute("data-class"))
    )
    expect(visitor.at("#legend")).to_be_in_viewport()
    expect(visitor.at("#view")).to_be_in_viewport(ratio=1)
    expect(last).to_be_in_viewport()
    # A touch leaves no hover: a row that was touched before looks like the others.
    ground = "element => getComputedStyle(element).backgroundColor"
    visitor.at(".bars button").nth(-2).tap()
    expect(last).to_have_attribute("aria-pressed", "false")
    other = visitor.at(".bars button").nth(-3)
    until(lambda: last.evaluate(ground) == other.evaluate(ground) != "")
    assert visitor.page.evaluate(width) <= 390
    assert faults(visitor) == []
