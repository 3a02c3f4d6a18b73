"""Progress of a diagnosis: steps done, their estimated number, the remaining time, and the leading explanation."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from time import perf_counter

_EXPECTED = {"base": 1, "causes": 60, "together": 18, "alternatives": 25, "held out": 0}
"""Steps of each stage until their number is known."""
_RECENT = 15
"""Number of the last steps from which the remaining time is estimated."""
_FEWEST = 3
"""Fewest steps after which the remaining time is reported."""


class Progress:
    """Counter of the steps of a diagnosis, which reports each of them.

    Parameters
    ----------
    report : callable, optional
        Called with one line of text at the start of each step.
    """

    def __init__(self, report: Callable[[str], None] | None = None) -> None:
        self._report = report or (lambda text: None)
        self.leading = ""
        self._stages = {stage: [0, count] for stage, count in _EXPECTED.items()}
        self._began = perf_counter()
        self._times: deque[float] = deque([self._began], maxlen=_RECENT + 1)

    @property
    def done(self) -> int:
        """Number of steps that have started."""
        return sum(done for done, _ in self._stages.values())

    @property
    def total(self) -> int:
        """Expected number of steps."""
        return sum(planned for _, planned in self._stages.values())

    @property
    def position(self) -> dict[str, float]:
        """Number of the current step, expected number of steps, and time since the start in s."""
        seconds = round(perf_counter() - self._began, 1)
        return {"step": self.done, "of_about": self.total, "seconds": seconds}

    def plan(self, stage: str, more: int) -> None:
        """Set the number of further steps of a stage; zero ends it."""
        self._stages[stage][1] = self._stages[stage][0] + more

    def __call__(self, stage: str, step: str) -> None:
        """Report the start of a step of a stage."""
        own = self._stages[stage]
        own[0] += 1
        own[1] = max(own[1], own[0])
        now = perf_counter()
        text = f"step {self.done} of about {self.total}"
        if self.done > _FEWEST:
            each = (now - self._times[0]) / len(self._times)
            text += f", about {_duration(each * (self.total - self.done + 1))} left"
        self._times.append(now)
        if self.leading:
            text += f", leading so far: {self.leading}"
        self._report(f"{text}; {step}")


def _duration(seconds: float) -> str:
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 5400.0 else f"{seconds / 3600.0:.1f} h"
