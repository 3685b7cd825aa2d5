"""The pictures of the README: `python page/screenshots.py URL`, of a service that runs there.

Needs the extra `dev` and a Chromium. Writes to docs/images/.
"""

import shutil
import sys
from pathlib import Path

from playwright.sync_api import Browser, Page, expect, sync_playwright

IMAGES = Path(__file__).parents[1] / "docs" / "images"
SOFTWARE = ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--no-sandbox"]
DESKTOP = {"viewport": {"width": 1440, "height": 900}}
PHONE = {"viewport": {"width": 390, "height": 780}, "has_touch": True, "is_mobile": True}


def main() -> None:
    url = sys.argv[1]
    IMAGES.mkdir(exist_ok=True)
    with sync_playwright() as playwright:
        program = shutil.which("chromium") or playwright.chromium.executable_path
        browser = playwright.chromium.launch(executable_path=program, args=SOFTWARE)
        for name, sample, options in (
            ("page-light", "car", DESKTOP | {"color_scheme": "light"}),
            ("page-dark", "chair", DESKTOP | {"color_scheme": "dark"}),
            ("page-phone", "train", PHONE),
        ):
            page = explained(browser, url, sample, options)
            page.screenshot(path=IMAGES / f"{name}.png")
        for sample in ("train", "key", "wolf"):
            page = explained(browser, url, sample, {"viewport": {"width": 480, "height": 900}})
            page.locator("#tools").evaluate("tools => { tools.hidden = true }")
            page.locator("#stage").screenshot(path=IMAGES / f"evidence-{sample}.png")
        browser.close()


def explained(browser: Browser, url: str, sample: str, options: dict) -> Page:
    """The page with the evidence for a sample's likeliest class."""
    page = browser.new_context(reduced_motion="reduce", **options).new_page()
    page.goto(url)
    expect(page.locator("#sample-list img")).to_have_count(12, timeout=60_000)
    page.locator("#sample-list .card").filter(has_text=sample).click()
    expect(page.locator("#legend")).to_be_visible(timeout=60_000)
    page.mouse.move(1, 1)
    page.wait_for_timeout(800)
    return page


if __name__ == "__main__":
    main()
