"""A real headless Chromium, driven by a test; its network requests and complaints are recorded."""

from __future__ import annotations

import os
import shutil
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

CI = "CROWDSIM_CI"
"""Environment variable: a missing browser fails the test instead of skipping it."""

NPM_CI = "CROWDSIM_CI_NPM"
"""Environment variable: npm and its registry must be there."""

_NAMES = ("chromium", "chromium-browser", "google-chrome", "google-chrome-stable")
_FLAGS = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]


def missing(what: str, switch: str = CI) -> None:
    """Skip the test, or fail it if the environment variable ``switch`` says that this must be installed."""
    if os.environ.get(switch):
        pytest.fail(f"{what}; this machine has to have it ({switch} is set)")
    pytest.skip(what)


class Visit:
    """An open page, with its network ``requests`` and what it ``complained`` of."""

    def __init__(self, browser: Any, file: Path | str, link: str = "", **options: Any) -> None:
        self.page = browser.new_page(**options)
        self.requests: list[str] = []
        self.complained: list[str] = []
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.on("pageerror", lambda error: self.complained.append(str(error)))
        self.page.on("console", self._listen)
        self.page.goto((file.as_uri() if isinstance(file, Path) else file) + link)

    def _listen(self, message: Any) -> None:
        if message.type in ("error", "warning") and "GPU stall" not in message.text:
            self.complained.append(message.text)

    def ready(self) -> Visit:
        """Wait until the page plays."""
        return self.wait("window.crowdsim !== undefined")

    def wait(self, condition: str, seconds: float = 60.0) -> Visit:
        """Wait until an expression is true. Playwright's own wait evaluates text, which the page's policy forbids."""
        ends = time.monotonic() + seconds
        while not self.page.evaluate(condition):
            assert time.monotonic() < ends, f"not in {seconds:g} s: {condition}; {self.complained}"
            self.page.wait_for_timeout(20)
        return self

    def ask(self, script: str, argument: Any = None) -> Any:
        """Return the value of a script in the page."""
        return self.page.evaluate(script, argument)


@contextmanager
def chromium() -> Iterator[Any]:
    """Yield a browser; skip, or fail in CI, if there is none."""
    found = next((path for path in map(shutil.which, _NAMES) if path), None)
    if found is None:
        missing("no Chromium is installed: apt-get install chromium")
    try:
        from playwright.sync_api import sync_playwright
    except ImportError:
        missing("playwright is not installed: pip install playwright")
    with sync_playwright() as playwright:
        browser = playwright.chromium.launch(executable_path=found, args=_FLAGS)
        try:
            yield browser
        finally:
            browser.close()
