"""Texts from files and from people, as they may be shown."""

from __future__ import annotations

import re

__all__ = ["printable"]

_CONTROL = re.compile(r"[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]")
"""All that moves the cursor, changes colours or the direction of writing, but for ends of lines and tabs."""


def printable(text: str) -> str:
    r"""Return a text in which control characters are written out, so that they do nothing to a terminal.

    Examples
    --------
    >>> from receptance._text import printable
    >>> print(printable("tip" + chr(27) + "[2J"))
    tip\x1b[2J
    """
    return _CONTROL.sub(lambda found: ascii(found[0])[1:-1], text)
