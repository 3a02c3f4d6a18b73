"""Code blocks of the Markdown documents, and the comparison of their output with the text below them."""

from __future__ import annotations

import itertools
import math
import re
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
DOCUMENTS = [
    ROOT / "README.md",
    ROOT / "CONTRIBUTING.md",
    ROOT / "CHANGELOG.md",
    *sorted((ROOT / "docs").rglob("*.md")),
]

_FENCE = re.compile(r"^```(?P<language>\w*)\n(?P<body>.*?)^```$", re.MULTILINE | re.DOTALL)
_NUMBER = re.compile(r"(?<![\w.])[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?")
_LINK = re.compile(r"\]\((?P<target>[^)\s]+)\)")


@dataclass(frozen=True)
class Block:
    """A fenced block."""

    language: str
    body: str
    line: int
    """Line of the document on which the body begins, counted from 1."""
    shown: str | None
    """Body of a `text` block that follows with only blank lines between: the output, or lines of it."""


def blocks(document: Path) -> list[Block]:
    """Return the fenced blocks of a document in order."""
    text = document.read_text(encoding="utf-8")
    matches = list(_FENCE.finditer(text))
    found = []
    for match, after in itertools.zip_longest(matches, matches[1:]):
        shown = None
        if after is not None and after["language"] == "text" and not text[match.end() : after.start()].strip():
            shown = after["body"]
        line = text.count("\n", 0, match.start("body")) + 1
        found.append(Block(match["language"], match["body"], line, shown))
    return found


def commands(block: Block) -> list[str]:
    """Return the shell lines of a block that begin with `receptance`, a prompt or not before it."""
    if block.language not in ("bash", "console", "sh"):
        return []
    lines = (line.removeprefix("$ ").partition("  #")[0].strip() for line in block.body.splitlines())
    return [line for line in lines if line.split(" ", 1)[0] == "receptance"]


def links(document: Path) -> list[str]:
    """Return the targets of links and pictures that are files of the project."""
    prose = _FENCE.sub("", document.read_text(encoding="utf-8"))
    targets = (match["target"].partition("#")[0] for match in _LINK.finditer(prose))
    return [target for target in targets if target and "://" not in target and not target.startswith("mailto:")]


def difference(printed: str, shown: str) -> str | None:
    """Return the first difference of the printed output, or None.

    Words must agree, spaces do not matter, and a number with a decimal point or an exponent may differ by one
    in the last digit that the document shows: rounding may fall either way between instruction sets.
    """
    words = ["".join(_NUMBER.sub("#", text).split()) for text in (printed, shown)]
    if words[0] != words[1]:
        return f"printed:\n{printed}\nshown:\n{shown}"
    for mine, theirs in zip(_NUMBER.findall(printed), _NUMBER.findall(shown), strict=True):
        mantissa, _, exponent = theirs.lower().partition("e")
        decimals = len(mantissa.partition(".")[2])
        unit = 10.0 ** (int(exponent or 0) - decimals) if "." in mantissa or exponent else 0.0
        if not math.isclose(float(mine), float(theirs), rel_tol=1e-12, abs_tol=1.001 * unit):
            return f"printed {mine} where {theirs} is shown, in:\n{printed}"
    return None
