"""The page of a service that asks for a key: it opens, asks for one, and shows it from then on."""

from collections.abc import Callable, Iterator

import pytest
from playwright.sync_api import Browser, expect

from meshconv3d.model import samples
from tests.articulated import sample_paths
from tests.service.conftest import Service
from tests.service.page.conftest import Visitor
from tests.service.page.test_accessibility import faults

KEY, OTHER = "the-key-of-this-page-1", "no-key-of-this-page-22"
SAMPLES = sample_paths()
SHOWN = samples.sample_paths()  # on the page


@pytest.fixture(scope="module")
def guarded(start: Callable[..., Service]) -> Service:
    return start("--workers", "1", "--model", "shrec11", "--api-key", KEY, alone=True)


@pytest.fixture(scope="module")
def window(browser: Browser, guarded: Service) -> Iterator[Visitor]:
    context = browser.new_context(reduced_motion="reduce")
    visitor = Visitor(context.new_page(), guarded)
    visitor.page.on("pageerror", lambda error: visitor.errors.append(str(error)))
    visitor.page.goto(guarded.url)
    yield visitor
    context.close()
    assert visitor.errors == []


@pytest.fixture
def stranger(window: Visitor) -> Visitor:
    """Somebody who has just opened the page, and has shown no key."""
    window.page.evaluate("sessionStorage.clear()")
    window.page.reload()
    return window


def show(visitor: Visitor, key: str) -> None:
    visitor.at("#key-field").fill(key)
    visitor.page.keyboard.press("Enter")


def test_a_key_opens_the_page(stranger: Visitor) -> None:
    expect(stranger.at("#key")).to_be_visible()
    expect(stranger.at("#key-reason")).to_contain_text("The service asks for a key")
    expect(stranger.at("#key-field")).to_be_focused()
    expect(stranger.at("#samples-hint")).to_be_hidden()  # nothing is promised that is not there
    assert faults(stranger) == []
    show(stranger, KEY)
    expect(stranger.at("#key")).to_be_hidden()
    expect(stranger.at("#samples-hint")).to_be_visible()
    expect(stranger.at("#sample-list img")).to_have_count(len(SHOWN))
    stranger.give(SAMPLES["spiders"])
    expect(stranger.at("#view")).to_have_attribute("data-shows", "spiders")
    stranger.page.reload()
    expect(stranger.at("#models button").first).to_be_attached()
    expect(stranger.at("#key")).to_be_hidden()


@pytest.mark.parametrize(
    ("wrong", "words"), [(OTHER, "This key is wrong"), ("kéy of ünicode", "This is no key")]
)
def test_a_wrong_key_is_told(stranger: Visitor, wrong: str, words: str) -> None:
    expect(stranger.at("#key")).to_be_visible()
    show(stranger, wrong)
    expect(stranger.at("#key-reason")).to_contain_text(words)
    expect(stranger.at("#key")).to_be_visible()
    show(stranger, KEY)
    expect(stranger.at("#key")).to_be_hidden()
    expect(stranger.at("#models button")).to_have_count(1)


def test_a_key_that_is_taken_back_is_asked_for_anew(stranger: Visitor) -> None:
    """What failed for want of it is asked again."""
    show(stranger, KEY)
    expect(stranger.at("#models button").first).to_be_attached()
    stranger.page.evaluate("key => sessionStorage.setItem('meshconv3d-key', key)", OTHER)
    stranger.give(SAMPLES["ants"])
    expect(stranger.at("#key-reason")).to_contain_text("This key is wrong")
    show(stranger, KEY)
    stranger.classified()
    expect(stranger.at("#key")).to_be_hidden()
