"""A browser, shared with the tests of the service's page."""

from tests.service.page.conftest import browser, chromium

__all__ = ["browser", "chromium"]
