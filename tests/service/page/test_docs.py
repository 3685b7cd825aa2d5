"""The API as a page: everything is there, and runs from there."""

from playwright.sync_api import Browser, expect

from tests.service.conftest import Service


def test_the_api_is_shown_and_tried(browser: Browser, site: Service) -> None:
    page = browser.new_page()
    asked: list[str] = []
    faults: list[str] = []
    page.on("request", lambda request: asked.append(request.url))
    page.on("pageerror", lambda error: faults.append(str(error)))
    page.on("console", lambda line: faults.append(line.text) if line.type == "error" else None)
    page.goto(f"{site.url}/docs")
    for heading in ("Meshes", "What is served", "Open Inference Protocol", "Operation"):
        expect(page.locator(".opblock-tag", has_text=heading)).to_be_visible()
    operation = page.locator("#operations-What_is_served-getLimits")
    operation.locator(".opblock-summary-control").click()
    operation.get_by_role("button", name="Try it out").click()
    operation.get_by_role("button", name="Execute").click()
    answer = operation.locator(".live-responses-table tbody .response-col_status").first
    expect(answer).to_contain_text("200")
    assert all(url.startswith((f"{site.url}/", "data:")) for url in asked), asked
    assert not faults
    page.close()
