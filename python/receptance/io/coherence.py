"""A coherence that stands alone in a file, and what to say of bad ones."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from receptance import _checks
from receptance.io.errors import FileFormatError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["Coherence", "describe_low", "refuse_above_one"]

_ROUNDING = 1e-4
"""Coherences of analysers are exported with four digits or more."""
_LOW = 0.5
"""Below, more of the response is unexplained than explained."""


@dataclass(frozen=True, init=False, eq=False, repr=False)
class Coherence:
    """Ordinary coherence between excitations and responses, without its FRF.

    Parameters
    ----------
    frequency_hz : array_like
        `(n,)` lines in Hz.
    values : array_like
        `(n,)` or `(n, n_out, n_in)`, from 0 to 1.
    labels : pair of sequences of str, optional
        Names of the responses and of the excitations.
    label, source : str, optional
        For people.
    notes : sequence of str, optional
        What was changed or is suspicious.

    Raises
    ------
    FileFormatError
        A coherence above one or below zero, with what that means.
    TypeError, ValueError
        Arrays that do not fit each other.

    Examples
    --------
    >>> from receptance.io import Coherence
    >>> Coherence(frequency_hz=[1.0, 2.0, 3.0], values=[0.4, 0.98, 0.99])
    Coherence(3 lines from 1 to 3 Hz, median 0.98)
    """

    frequency_hz: NDArray[np.float64]
    values: NDArray[np.float64]
    labels: tuple[tuple[str, ...], tuple[str, ...]] | None
    label: str
    source: str
    notes: tuple[str, ...]

    def __init__(
        self,
        *,
        frequency_hz: ArrayLike,
        values: ArrayLike,
        labels: tuple[Sequence[str], Sequence[str]] | None = None,
        label: str = "",
        source: str = "",
        notes: Sequence[str] = (),
    ) -> None:
        lines = _checks.unmasked("Coherence", "frequency_hz", frequency_hz, np.float64).copy()
        array = _checks.unmasked("Coherence", "values", values, np.float64).copy()
        if array.ndim == 1:
            array = array[:, None, None]
        if lines.ndim != 1 or array.ndim != 3 or array.shape[0] != lines.size or 0 in array.shape:
            raise ValueError(
                f"Coherence: frequency_hz has shape {lines.shape} and values {array.shape}, "
                "expected (n,) and (n,) or (n, n_out, n_in)"
            )
        if not (np.all(np.isfinite(lines)) and np.all(np.diff(lines) > 0.0) and lines[0] >= 0.0):
            raise ValueError("Coherence: frequency_hz must be finite, ascending and not negative")
        names = None if labels is None else (tuple(map(str, labels[0])), tuple(map(str, labels[1])))
        if names is not None and (len(names[0]), len(names[1])) != array.shape[1:]:
            raise ValueError(
                f"Coherence: there are {len(names[0])} and {len(names[1])} labels for values of shape {array.shape}"
            )
        array = refuse_above_one(lines, array)
        for part in (lines, array):
            part.setflags(write=False)
        object.__setattr__(self, "frequency_hz", lines)
        object.__setattr__(self, "values", array)
        object.__setattr__(self, "labels", names)
        object.__setattr__(self, "label", str(label))
        object.__setattr__(self, "source", str(source))
        object.__setattr__(self, "notes", tuple(map(str, notes)))

    def __len__(self) -> int:
        return int(self.frequency_hz.size)

    def __repr__(self) -> str:
        title = f"{self.label!r}, " if self.label else ""
        low, high = self.frequency_hz[[0, -1]]
        return f"Coherence({title}{len(self)} lines from {low:g} to {high:g} Hz, median {np.median(self.values):.2g})"


def refuse_above_one(frequency_hz: NDArray[np.float64], coherence: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a coherence within 0 to 1, or raise a FileFormatError in words for a test engineer.

    What lies outside by less than 0.0001 is rounding and moved to the limit.
    """
    flat = coherence.reshape(frequency_hz.size, -1)
    wrong = ~((flat >= -_ROUNDING) & (flat <= 1.0 + _ROUNDING))
    if wrong.any():
        line = int(np.flatnonzero(wrong.any(axis=1))[0])
        value = float(flat[line][wrong[line]][0])
        median = float(np.median(flat))
        others = int(wrong.any(axis=1).sum()) - 1
        raise FileFormatError(
            f"the coherence is {value:.4g} at {frequency_hz[line]:g} Hz"
            + (f" (and wrong on {others} more lines)" if others else "")
            + ". Coherence is the share of the response that the force explains, so it lies between 0 and 1. A value "
            "outside means that it and its spectra are not averages of the same hits: the analyser averaged them "
            "differently, a record was overwritten, or the column is something else. Until that is explained the "
            "quality of the FRF cannot be judged"
            + (f" (the median coherence, {median:.2f}, is poor as well)" if median < _LOW else "")
            + ". Export the measurement again, or read the FRF without its coherence: ignore_coherence=True (on the "
            "command line --ignore-coherence)"
        )
    limited: NDArray[np.float64] = np.clip(coherence, 0.0, 1.0)
    return limited


def describe_low(coherence: NDArray[np.float64]) -> str | None:
    """Return what should be said of a coherence with a median under one half, or None.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance.io.coherence import describe_low
    >>> describe_low(np.full(100, 0.31))[:34]
    'the median coherence is 0.31 over '
    """
    median = float(np.median(coherence))
    if median >= _LOW:
        return None
    below = float(np.mean(coherence < _LOW))
    return (
        f"the median coherence is {median:.2f} over {coherence.shape[0]} lines, and below {_LOW} on {below:.0%} of "
        f"them: on half of the lines the force explains less than {median:.0%} of the response, the rest is noise, a "
        "second source, leakage or a structure that does not repeat. Such an FRF does not determine a joint: measure "
        "again (another hammer tip, more averages, sensor range, cables), or use only lines of high coherence"
    )
