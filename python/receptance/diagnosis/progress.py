"""Progress of a diagnosis: steps done, their estimated number, the remaining time, and the leading explanation."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from time import perf_counter
from typing import TypeVar

from receptance import _core

_EXPECTED = {"base": 1, "causes": 60, "together": 18, "alternatives": 25, "held out": 0}
"""Steps of each stage until their number is known."""
_RECENT = 15
"""Number of the last steps from which the remaining time is estimated."""
_FEWEST = 3
"""Fewest steps after which the remaining time is reported."""

_T = TypeVar("_T")


def in_parallel(fits: Sequence[Callable[[], _T]], workers: int) -> Iterator[_T]:
    """Yield the results of fits in their order; `workers` of them run at the same time."""
    if workers == 1 or len(fits) < 2:
        yield from (fit() for fit in fits)
        return
    halt = _core.Halt()
    pool = ThreadPoolExecutor(workers, initializer=halt.join)
    try:
        yield from (future.result() for future in [pool.submit(fit) for fit in fits])
    finally:
        # After a KeyboardInterrupt running fits end at once, because the answer needs the processors.
        halt.set()
        pool.shutdown(wait=False, cancel_futures=True)


class Progress:
    """Counter of the steps of a diagnosis, which reports each of them at its start as a line of text."""

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

    def run(self, stage: str, steps: Sequence[str], fits: Sequence[Callable[[], _T]], workers: int) -> Iterator[_T]:
        """Yield the results of fits in their order, after a report of each; `workers` run at the same time."""
        self.plan(stage, len(fits))
        results = in_parallel(fits, workers)
        for step in steps:
            self(stage, step)
            yield next(results)

    def __call__(self, stage: str, step: str) -> None:
        """Report the start of a step of a stage."""
        counts = self._stages[stage]
        counts[0] += 1
        counts[1] = max(counts)
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
