"""A headless Chromium, driven through its debugging pipe: pages at any width, light and dark, and on paper."""

from __future__ import annotations

import base64
import fcntl
import json
import os
import shutil
import subprocess
from pathlib import Path
from typing import Any, Self

import pytest

_NAMES = ("chromium", "chromium-browser", "google-chrome", "chrome")
PAPER = {"a4": (8.27, 11.69), "letter": (8.5, 11.0)}
"""Width and height in inches."""

_MEASURE = """(() => {
  const width = document.documentElement.clientWidth, found = [];
  const texts = [...document.querySelectorAll('p, b, span, td, th, dt, dd, h1, h2, li, pre, summary, caption, text')];
  const inside = (element) => {
    const box = element.getBoundingClientRect();
    return box.width && box.height ? box : null;
  };
  for (const element of texts) {
    const box = inside(element);
    if (!box) continue;
    const name = element.tagName + ': ' + element.textContent.slice(0, 60);
    const scrolls = element.closest('.wide') && getComputedStyle(element.closest('.wide')).overflowX === 'auto';
    if (!scrolls && (box.right > width + 1 || box.left < -1)) found.push('outside: ' + name);
    const svg = element.closest('svg'), frame = svg && svg.getBoundingClientRect();
    if (frame && (box.right > frame.right + 1 || box.left < frame.left - 1 || box.bottom > frame.bottom + 1))
      found.push('outside of its figure: ' + name);
    if (element.scrollWidth > element.clientWidth + 1 && getComputedStyle(element).overflowX !== 'visible')
      found.push('cut: ' + name);
  }
  const sizes = texts.filter(inside).filter((element) => element.textContent.trim()).map((element) => {
    const own = parseFloat(getComputedStyle(element).fontSize), svg = element.closest('svg');
    return svg ? own * svg.getBoundingClientRect().width / svg.viewBox.baseVal.width : own;
  });
  const colour = (name) => getComputedStyle(document.body)[name];
  return { found, page: document.documentElement.scrollWidth, width, smallest: Math.min(...sizes),
    ink: colour('color'), paper: colour('backgroundColor'), figures: document.querySelectorAll('svg.figure').length,
    closed: [...document.querySelectorAll('details:not([open])')].length };
})()"""


def find_browser() -> str:
    """Return the path of a browser; skip the test where none is installed."""
    found = next((path for name in _NAMES if (path := shutil.which(name))), None)
    if found is None:
        pytest.skip(f"none of {', '.join(_NAMES)} is installed, so the page was not opened")
    return found


class Browser:
    """A browser with one page; use it as a context."""

    def __init__(self, folder: Path) -> None:
        command = [find_browser(), "--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage",
                   "--remote-debugging-pipe", f"--user-data-dir={folder / 'profile'}", "about:blank"]  # fmt: skip
        (there, self._write), (self._read, back) = os.pipe(), os.pipe()
        # The browser reads from file 3 and writes to file 4; the copies are out of their way.
        high = [fcntl.fcntl(end, fcntl.F_DUPFD, 20) for end in (there, back)]

        def connect() -> None:
            os.dup2(high[0], 3)
            os.dup2(high[1], 4)

        self._process = subprocess.Popen(
            command, pass_fds=(3, 4), preexec_fn=connect, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        for end in (there, back, *high):
            os.close(end)
        self._number, self._buffer, self.errors = 0, b"", []
        (target,) = [one for one in self._call("Target.getTargets")["targetInfos"] if one["type"] == "page"][:1]
        attached = self._call("Target.attachToTarget", targetId=target["targetId"], flatten=True)
        self._session = attached["sessionId"]
        for domain in ("Page", "Runtime", "Log", "Network"):
            self.call(f"{domain}.enable")

    _session = ""

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.wait()
        os.close(self._write)
        os.close(self._read)

    def _message(self) -> dict[str, Any]:
        while b"\0" not in self._buffer:
            read = os.read(self._read, 1 << 20)
            if not read:
                raise RuntimeError("the browser has ended")
            self._buffer += read
        text, _, self._buffer = self._buffer.partition(b"\0")
        return json.loads(text)

    def _call(self, method: str, **parameters: Any) -> dict[str, Any]:
        self._number += 1
        sent = {"id": self._number, "method": method, "params": parameters}
        if self._session:
            sent["sessionId"] = self._session
        os.write(self._write, json.dumps(sent).encode() + b"\0")
        while True:
            message = self._message()
            if message.get("method") in ("Runtime.exceptionThrown", "Log.entryAdded", "Network.requestWillBeSent"):
                self.errors.append(message)
            if message.get("id") == self._number:
                if "error" in message:
                    raise RuntimeError(f"{method}: {message['error']}")
                return message["result"]

    call = _call

    def open(self, file: Path) -> None:
        """Open a page, and wait until it is there."""
        self.errors.clear()
        self.call("Page.navigate", url=file.as_uri())
        while self.evaluate("document.readyState") != "complete" or not self.evaluate("location.href").startswith(
            "file"
        ):
            pass

    def evaluate(self, script: str) -> Any:
        """Return the value of a script."""
        return self.call("Runtime.evaluate", expression=script, returnByValue=True)["result"].get("value")

    def show(self, width: int, *, dark: bool = False, media: str = "screen") -> dict[str, Any]:
        """Show the page at a width, and return what is cut, sizes and colours."""
        self.call("Emulation.setDeviceMetricsOverride", width=width, height=900, deviceScaleFactor=1, mobile=False)
        scheme = {"name": "prefers-color-scheme", "value": "dark" if dark else "light"}
        self.call("Emulation.setEmulatedMedia", media=media, features=[scheme])
        return self.evaluate(_MEASURE)

    def picture(self, file: Path) -> None:
        """Save a picture of the whole page."""
        size = self.call("Page.getLayoutMetrics")["cssContentSize"]
        clip = {**size, "scale": 1}
        found = self.call("Page.captureScreenshot", captureBeyondViewport=True, clip=clip)
        file.write_bytes(base64.b64decode(found["data"]))

    def printed(self, paper: str) -> bytes:
        """Return the page as PDF on paper of a name in `PAPER`."""
        width, height = PAPER[paper]
        found = self.call("Page.printToPDF", paperWidth=width, paperHeight=height, printBackground=False)
        return base64.b64decode(found["data"])
