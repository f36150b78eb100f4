"""The browser that the tests of the page drive; without one they are skipped, unless LINKJAX_REQUIRE_BROWSER=1."""

from __future__ import annotations

import importlib.util
import os
import shutil
from collections.abc import Iterator

import pytest

NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
FLAGS = ("--disable-gpu", "--disable-background-networking")


def chromium() -> str | None:
    """The browser named by LINKJAX_BROWSER, or the first one found."""
    return os.environ.get("LINKJAX_BROWSER") or next(filter(None, map(shutil.which, NAMES)), None)


@pytest.fixture(scope="module")
def browser() -> Iterator:
    """Chromium without a window, driven by playwright."""
    missing = "" if chromium() else f"none of {', '.join(NAMES)} found; LINKJAX_BROWSER may name one"
    if importlib.util.find_spec("playwright") is None:
        missing = "playwright is not installed"
    if missing:
        (pytest.fail if os.environ.get("LINKJAX_REQUIRE_BROWSER") == "1" else pytest.skip)(f"no browser: {missing}")
    from playwright.sync_api import sync_playwright

    root = ["--no-sandbox"] if hasattr(os, "geteuid") and os.geteuid() == 0 else []
    with sync_playwright() as playwright:
        found = playwright.chromium.launch(executable_path=chromium(), args=[*FLAGS, *root])
        yield found
        found.close()
