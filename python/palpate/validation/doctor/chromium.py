"""A page in a Chromium without a screen, which draws in software."""

from __future__ import annotations

import contextlib
import importlib.util
import shutil
from collections.abc import AsyncIterator
from typing import Any

# A graphics processor is not asked for: what is measured must not depend on a screen being there.
CHROMIUM_FLAGS = ("--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader")


@contextlib.asynccontextmanager
async def browser_page(address: str) -> AsyncIterator[Any]:
    """Give a page of Chromium at an address; None without Chromium or Playwright."""
    executable = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
    if executable is None or importlib.util.find_spec("playwright") is None:
        yield None
        return
    from playwright.async_api import async_playwright

    async with async_playwright() as driver:
        browser = await driver.chromium.launch(executable_path=executable, args=list(CHROMIUM_FLAGS))
        try:
            page = await browser.new_page(viewport={"width": 1280, "height": 720})
            await page.goto(address)
            yield page
        finally:
            await browser.close()
