"""The remaining time of long work, from its messages of progress."""

from __future__ import annotations

import re
from time import perf_counter

_COUNT = re.compile(r"\b(\d+) of (\d+)$")
"""Number of the step and of all steps at the end of a message of progress."""


class Remaining:
    """Adds the remaining time to messages that end with a count, such as "reading short, 2 of 5"."""

    def __init__(self) -> None:
        self._kind, self._first, self._began = "", 0, 0.0

    def __call__(self, text: str) -> str:
        match = _COUNT.search(text)
        if match is None:
            return text
        done, count = int(match[1]), int(match[2])
        kind, now = f"{text.split(' ')[0]} {count}", perf_counter()
        if kind != self._kind or done <= self._first:
            self._kind, self._first, self._began = kind, done, now
            return text
        left = (now - self._began) / (done - self._first) * (count - done + 1)
        return f"{text}, about {left:.0f} s left"
