"""A headless Chromium for tests of pages: it reports errors and refuses the network."""

import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Literal
from urllib.parse import urlsplit

import pytest
from playwright.sync_api import (
    BrowserContext,
    ConsoleMessage,
    Dialog,
    Page,
    Route,
    expect,
    sync_playwright,
)

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser")

needs_chromium = pytest.mark.skipif(
    CHROMIUM is None, reason="no Chromium: install the package 'chromium' to test pages"
)

DESKTOP, PHONE = (1280, 900), (390, 844)
"""Widths and heights of a window, in CSS pixels."""

PATIENCE = 120_000
"""Milliseconds until a page that does not come is given up: machines may be busy."""

_FLAGS = [
    *("--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run", "--disable-sync"),
    *("--disable-background-networking", "--disable-component-update"),
]
_LOOPBACK = {"localhost", "127.0.0.1", "::1"}


@dataclass
class BrowserPage:
    """An open page and what went wrong on it."""

    page: Page
    errors: list[str] = field(default_factory=list)
    """Of the console and of scripts."""
    refused: list[str] = field(default_factory=list)
    """Addresses asked for that are neither on the disk nor on this machine."""


@contextmanager
def browser(color_scheme: Literal["light", "dark"] = "light") -> Iterator[BrowserContext]:
    """Start a browser, in which windows share what they fetched.

    Args:
        color_scheme: that the person prefers.
    """
    with sync_playwright() as playwright:
        chromium = playwright.chromium.launch(executable_path=CHROMIUM, headless=True, args=_FLAGS)
        try:
            yield chromium.new_context(color_scheme=color_scheme, reduced_motion="reduce")
        finally:
            chromium.close()


@contextmanager
def window(context: BrowserContext, width: int, height: int) -> Iterator[BrowserPage]:
    """Open a window; whatever happens in it is recorded.

    Args:
        context: of :func:`browser`.
        width: of the window in CSS pixels.
        height: of the window in CSS pixels.
    """
    opened = BrowserPage(context.new_page())
    opened.page.set_viewport_size({"width": width, "height": height})
    opened.page.set_default_timeout(PATIENCE)
    expect.set_options(timeout=PATIENCE)
    _watch(opened)
    try:
        yield opened
    finally:
        opened.page.close()


def _watch(opened: BrowserPage) -> None:
    def answer(route: Route) -> None:
        address = urlsplit(route.request.url)
        local = address.scheme in {"file", "data", "blob"} or address.hostname in _LOOPBACK
        if local:
            route.continue_()
            return
        opened.refused.append(route.request.url)
        route.abort()

    def read(message: ConsoleMessage) -> None:
        if message.type == "error":
            opened.errors.append(message.text)

    def dismiss(dialog: Dialog) -> None:
        opened.errors.append(f"dialog: {dialog.message}")
        dialog.dismiss()

    page = opened.page
    page.route("**/*", answer)
    page.on("console", read)
    page.on("pageerror", lambda error: opened.errors.append(str(error)))
    page.on("dialog", dismiss)
