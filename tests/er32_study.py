"""Cached results of the ER32 study, for tests of other parts of the program."""

from __future__ import annotations

import functools
from typing import Any

from receptance.studies import er32

_once = functools.cache(er32.run)


def results(settings: er32.ER32Settings, progress: object = None) -> dict[str, Any]:
    """Return the results of `er32.run`, which runs once for equal settings."""
    return _once(settings)
