"""Long calculations of a page: one at a time in a thread, with progress, and ended with the answer so far."""

from __future__ import annotations

import threading
from collections.abc import Callable
from dataclasses import replace
from time import monotonic
from typing import Any

from receptance._remaining import Remaining
from receptance.campaign import Campaign


class Work:
    """A calculation with a campaign in a thread of its own.

    `analysis` gets the campaign with a report of progress and returns a result. `stop` ends it before its next step,
    as Ctrl-C does on the command line: a diagnosis then returns the answer so far, other analyses none.
    """

    def __init__(self, name: str, campaign: Campaign, analysis: Callable[[Campaign], Any]) -> None:
        self.name = name
        self.progress = ""
        """The last line of progress, with the remaining time."""
        self.result: Any = None
        self.error: Exception | None = None
        self.stopped = False
        """Whether it was stopped."""
        self._is_to_stop, self._began, self._remaining = False, monotonic(), Remaining()
        self._thread = threading.Thread(target=self._run, args=(campaign, analysis), name=name, daemon=True)
        self._thread.start()

    def _run(self, campaign: Campaign, analysis: Callable[[Campaign], Any]) -> None:
        try:
            self.result = analysis(replace(campaign, progress=self._report))
        except KeyboardInterrupt:
            pass  # it has no answer yet
        except Exception as error:  # a page shows whatever an analysis raises
            self.error = error

    def _report(self, text: str) -> None:
        self.progress = self._remaining(text)
        if self._is_to_stop:
            self._is_to_stop = False  # the steps of the answer so far go on
            raise KeyboardInterrupt

    @property
    def runs(self) -> bool:
        """Whether it goes on."""
        return self._thread.is_alive()

    @property
    def seconds(self) -> float:
        """Time since it began in s."""
        return monotonic() - self._began

    def stop(self) -> None:
        """End it before its next step."""
        self.stopped = self._is_to_stop = True

    def wait(self, seconds: float | None = None) -> None:
        """Wait for its end."""
        self._thread.join(seconds)
