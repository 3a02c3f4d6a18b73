"""The page of a folder in Chromium: `receptance open` as a process, and a browser that loads nothing from elsewhere."""

from __future__ import annotations

import os
import re
import shutil
import signal
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

WAIT_MS = 60_000
"""Longest time that a test waits for what it expects; only a failing test waits so long."""
_NAMES = ("chromium", "chromium-browser", "google-chrome")


def browser_program() -> str:
    """Return the Chromium of the system, or skip the test."""
    program = next(filter(None, map(shutil.which, _NAMES)), None)
    if program is None:
        pytest.skip("needs Chromium on the PATH, such as Debian's package chromium")
    return program


class Served:
    """A running `receptance open`."""

    def __init__(self, folder: Path, *options: str) -> None:
        self.folder = folder
        command = [sys.executable, "-m", "receptance", "open", str(folder), "--no-browser", *options]
        environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1", "RECEPTANCE_THREADS": "1"}
        self.process = subprocess.Popen(
            command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        assert self.process.stdout is not None
        self.address = self.process.stdout.readline().strip()
        if not self.address.startswith("http"):
            raise RuntimeError(f"receptance open printed no address: {self.address}{self.end()}")

    @property
    def base(self) -> str:
        """The address without the token."""
        return self.address.rsplit("/", 2)[0]

    def interrupt(self) -> None:
        """Press Ctrl-C."""
        self.process.send_signal(signal.SIGINT)

    def code(self, seconds: float) -> int:
        """Return the exit code, once the process has ended by itself."""
        return self.process.wait(seconds)

    def end(self) -> str:
        """End the process, and return what it has printed as errors."""
        self.process.kill()
        return self.process.communicate()[1]


@contextmanager
def served(folder: Path, *options: str) -> Iterator[Served]:
    """Serve a folder during a test; a traceback of the server fails it."""
    server = Served(folder, *options)
    try:
        yield server
    finally:
        errors = server.end()
    assert "Traceback" not in errors, errors


@contextmanager
def browser() -> Iterator[Any]:
    """Start Chromium."""
    playwright = pytest.importorskip("playwright.sync_api", reason="needs playwright: pip install playwright")
    with playwright.sync_playwright() as started:
        program = started.chromium.launch(executable_path=browser_program(), args=["--no-sandbox"])
        yield program
        program.close()


class Tabs:
    """Tabs of one browser window, with all that they have asked for, and what their consoles say."""

    def __init__(self, program: Any, width: int = 1280) -> None:
        self.context = program.new_context(viewport={"width": width, "height": 900}, accept_downloads=True)
        self.context.set_default_timeout(WAIT_MS)
        self.requests: list[str] = []
        self.console: list[str] = []
        self.context.route("**/*", self._route)

    def _route(self, route: Any) -> None:
        # What is not from this machine is not loaded, as without a network.
        self.requests.append(route.request.url)
        if is_own(route.request.url):
            route.continue_()
        else:
            route.abort()

    def open(self, address: str) -> Any:
        """Open a tab, and wait until it shows the page."""
        page = self.context.new_page()
        page.on("console", lambda message: self.console.append(message.text) if message.type == "error" else None)
        page.on("pageerror", lambda error: self.console.append(str(error)))
        page.goto(address)
        page.get_by_role("tab").first.wait_for()
        return page

    def close(self) -> None:
        """Close the window."""
        self.context.close()


def is_own(address: str) -> bool:
    """Return whether a request stays on this machine."""
    return address.startswith(("http://127.0.0.1:", "ws://127.0.0.1:", "data:", "blob:"))


def views(page: Any) -> Any:
    """Return the tabs of the views; views may have tabs of their own."""
    return page.get_by_role("tablist").first.get_by_role("tab")


def go_to(page: Any, name: str) -> None:
    """Open a view by its name."""
    views(page).filter(has_text=re.compile(f"^{name}$")).click()


_DEEP = """
const deep = root => [...root.querySelectorAll('*')].flatMap(e => [e, ...(e.shadowRoot ? deep(e.shadowRoot) : [])]);
const active = () => {
  let e = document.activeElement;
  while (e?.shadowRoot?.activeElement) e = e.shadowRoot.activeElement;
  return e; };
"""
_OPERABLE = f"""() => {{ {_DEEP}
  const kinds = 'button, input, select, textarea, a[href], summary, [role=slider], [role=tab], [role=button]';
  return deep(document).filter(e => e.matches(kinds) && !e.disabled && e.tabIndex != -1 &&
    e.checkVisibility({{visibilityProperty: true}}) && e.getClientRects().length && !e.was_focused)
    .map(e => e.outerHTML.slice(0, 200)); }}"""
_FORGET = f"() => {{ {_DEEP} deep(document).forEach(e => delete e.was_focused); }}"
_FOCUSED = f"""() => {{ {_DEEP}
  const e = active(), again = e.was_focused ?? false;
  if (e == document.body) return [again, 'body'];
  e.was_focused = true;
  return [again, [e.getAttribute('role') || e.tagName.toLowerCase(),
          e.getAttribute('aria-label') || e.labels?.[0]?.textContent || e.textContent].join(' ').trim()]; }}"""


def tab_through(page: Any) -> list[str]:
    """Press the tab key until the focus is where it has been, and return the role and name of all that had it."""
    names: list[str] = []
    page.evaluate(_FORGET)
    while True:
        page.keyboard.press("Tab")
        again, name = page.evaluate(_FOCUSED)
        if again:
            return names
        if name != "body":  # between the last control and the first
            names.append(name)


def not_focused(page: Any) -> list[str]:
    """Return the controls that are shown and have not had the focus, as HTML."""
    found: list[str] = page.evaluate(_OPERABLE)
    return found
