"""How far a diagnosis has come: steps done of how many, the time that is left, and what leads."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from time import perf_counter

__all__ = ["Steps"]

_GUESS = {"base": 1, "causes": 60, "together": 18, "rivals": 25}
"""Steps of each stage before it is known."""
_RECENT = 15
"""The time that is left is estimated from so many of the last steps."""
_FEWEST = 3
"""With fewer steps done nothing is said of the time."""


class Steps:
    """The steps of a diagnosis, told to whoever asked for its progress.

    Parameters
    ----------
    tell : callable, optional
        Gets one line of text at the beginning of each step.
    selections : int, optional
        How often causes are selected: once, and once for each fold that is held out.
    """

    def __init__(self, tell: Callable[[str], None] | None = None, selections: int = 1) -> None:
        self.tell = tell or (lambda text: None)
        self.leading = ""
        self.holding_out = ""
        self._stages = {stage: [0, count] for stage, count in _GUESS.items()}
        self._before = 0
        self._left = selections
        self._began = perf_counter()
        self._times: deque[float] = deque([self._began], maxlen=_RECENT + 1)

    @property
    def done(self) -> int:
        """Steps that have begun."""
        return self._before + sum(done for done, _ in self._stages.values())

    @property
    def total(self) -> int:
        """Steps that there are expected to be."""
        return self._before + self._left * sum(planned for _, planned in self._stages.values())

    @property
    def seconds(self) -> float:
        """Time since the beginning."""
        return perf_counter() - self._began

    @property
    def how_far(self) -> dict[str, float]:
        """The step that has begun, of about how many, and the time since the beginning."""
        return {"step": self.done, "of_about": self.total, "seconds": round(self.seconds, 1)}

    def plan(self, stage: str, more: int) -> None:
        """Say how many more steps a stage has: none ends it."""
        self._stages[stage][1] = self._stages[stage][0] + more

    def __call__(self, stage: str, what: str) -> None:
        """Begin a step."""
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
        without = f"held out: {self.holding_out}: " if self.holding_out else ""
        self.tell(f"{text}; {without}{what}")

    def again(self) -> None:
        """End a selection of causes; the next one is expected to have as many steps."""
        sizes = {stage: done for stage, (done, _) in self._stages.items()}
        self._before = self.done
        self._left = max(self._left - 1, 1)
        self._stages = {stage: [0, count] for stage, count in sizes.items()}
        self.leading = ""


def _duration(seconds: float) -> str:
    if seconds < 90.0:
        return f"{seconds:.0f} s"
    return f"{seconds / 60.0:.0f} min" if seconds < 5400.0 else f"{seconds / 3600.0:.1f} h"
