"""Pictures of every view of the page: `python docs/generator/page_pictures.py [FOLDER]`.

They are written to docs/images/page as VIEW-WIDTH-THEME.webp, in both themes and two widths, with the example
`forgotten-sensor` after its diagnosis, and the view "Use" with the cuts of the example `machine`. Needs Chromium.
"""

from __future__ import annotations

import io
import re
import sys
import tempfile
from pathlib import Path
from typing import Any

from PIL import Image

# Server and browser are those of the tests.
sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "tests"))

from browser_page import Tabs, browser, served
from receptance import examples

TARGET = Path(__file__).resolve().parents[1] / "images" / "page"
WIDTHS, THEMES = (1280, 1920), ("light", "dark")
VIEWS = {"start": "forgotten-sensor", "model": "forgotten-sensor", "ask": "forgotten-sensor", "use": "machine",
         "file": "forgotten-sensor"}  # fmt: skip
BUTTONS = {"ask": "Diagnose", "use": "Lobes"}
"""What is pressed before a picture is taken."""
_QUALITY = 60
_SETTLE_MS = 3000
_LONGEST_MS = 600_000


def _picture(page: Any, view: str) -> Image.Image:
    if view in BUTTONS:
        page.get_by_role("button", name=BUTTONS[view]).click()
        page.get_by_text(re.compile("done in")).wait_for(timeout=_LONGEST_MS)
    page.wait_for_timeout(_SETTLE_MS)
    return Image.open(io.BytesIO(page.screenshot())).convert("RGB")


def write(target: Path) -> list[Path]:
    """Write all pictures; return their files."""
    target.mkdir(parents=True, exist_ok=True)
    written = []
    with tempfile.TemporaryDirectory() as name, browser() as program:
        for view, example in VIEWS.items():
            folder = Path(name) / example
            if not folder.exists():
                examples.write(example, folder)
            for width in WIDTHS:
                tabs = Tabs(program, width)
                for theme in THEMES:
                    with served(folder) as running:
                        page = tabs.open(f"{running.address}?view={view}&theme={theme}")
                        file = target / f"{view}-{width}-{theme}.webp"
                        _picture(page, view).save(file, quality=_QUALITY, method=6)
                        written.append(file)
                tabs.close()
    return written


if __name__ == "__main__":
    for file in write(Path(sys.argv[1]) if len(sys.argv) > 1 else TARGET):
        print(f"{file} {file.stat().st_size / 1024:.0f} kB")
