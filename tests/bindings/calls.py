"""The handles of the extension as functions of all their arrays, for tests that change one array at a time."""

from __future__ import annotations

from typing import Any

from receptance import _core

TABLES = ("segments", "joints", "masses", "grounds")


def model(motion: int, **tables: Any) -> Any:
    """Return a model."""
    return _core.Model(motion, **tables)


def receptance(
    angular_frequency: Any, motion: Any, excitations: Any, responses: Any, parameters: Any, threads: Any,
    scale: float = 1.0, **tables: Any,
) -> Any:  # fmt: skip
    """Return receptances and derivatives."""
    lines = _core.Lines(angular_frequency, scale)
    return model(motion, **tables).receptance(lines, excitations, responses, parameters, threads)


def natural_frequencies(upper: Any, most: Any, motion: Any, parameters: Any, **tables: Any) -> Any:
    """Return natural angular frequencies and derivatives."""
    return model(motion, **tables).natural_frequencies(upper, most, parameters)
