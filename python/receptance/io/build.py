"""Making FRFs and sample rates of what a reader found, in one way for all formats."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance.coordinates import Coordinate
from receptance.errors import ReceptanceWarning
from receptance.frf import FRF
from receptance.io.coherence import describe_low, refuse_above_one
from receptance.io.errors import FileFormatError
from receptance.io.options import ReadOptions

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.units import Form

__all__ = ["in_si", "joined", "make_frf", "outside", "sampled", "without_phase"]

_RATE_TOLERANCE = 1e-4
"""Between a sample rate that is given and one from a file, whose time step has six digits."""
_JITTER = 0.05
"""Of a step: how far times may be from even ones."""
_UNSTEADY = 1e-3
"""Of a step: how far steps may be from their mean."""


def make_frf(
    *,
    frequency_hz: NDArray[np.float64],
    values: NDArray[Any],
    form: Form,
    directions: tuple[Sequence[str], Sequence[str]],
    options: ReadOptions,
    coherence: NDArray[np.float64] | None = None,
    notes: Sequence[str] = (),
    **known: Any,
) -> FRF:
    """Return an FRF of values in SI, with what is known otherwise and the coordinates that were given.

    A coherence above one is refused, a poor one is warned of and noted.

    Raises
    ------
    FileFormatError
        What does not make an FRF, in the words of `FRF` or of `refuse_above_one`.
    """
    told = list(notes)
    if coherence is not None and options.ignore_coherence:
        coherence = None
        told.append("the coherence in the file was left out, as asked for")
    if coherence is not None:
        coherence = refuse_above_one(frequency_hz, coherence)
        poor = describe_low(coherence)
        if poor:
            told.append(poor)
            warnings.warn(poor, ReceptanceWarning, stacklevel=outside())
    for name, given, side in (
        ("responses", options.responses, directions[0]),
        ("excitations", options.excitations, directions[1]),
    ):
        if given is not None:
            known[name] = _placed(name, given, side)
        elif name not in known:
            known[name] = tuple(side)
    try:
        return FRF(frequency_hz=frequency_hz, values=values, form=form, coherence=coherence, notes=tuple(told), **known)
    except (TypeError, ValueError) as error:
        raise FileFormatError(str(error)) from None


def joined(real_part: NDArray[Any], imaginary: NDArray[Any]) -> NDArray[np.complex128]:
    """Return complex numbers of their parts, bit for bit (a sum with 1j times the one loses the sign of zeros)."""
    values = np.empty(real_part.shape, dtype=np.complex128)
    values.real, values.imag = real_part, imaginary
    return values


def without_phase(values: NDArray[Any]) -> list[str]:
    """Return what to note of real values where an FRF should be, after warning of it; nothing of complex ones."""
    if np.iscomplexobj(values):
        return []
    note = "the values are real: without a phase this is a magnitude, or one part of the FRF"
    warnings.warn(note, ReceptanceWarning, stacklevel=outside())
    return [note]


def in_si(values: NDArray[Any], factor: float) -> NDArray[Any]:
    """Return values in SI; bit for bit where they are (a product with one loses the sign of complex zeros)."""
    return values if factor == 1.0 else values * factor


def outside() -> int:
    """Return the stack level, as seen by the caller, of the first frame that is not of this package."""
    import sys

    level, frame = 1, sys._getframe(1)
    while frame is not None and frame.f_globals.get("__name__", "").startswith("receptance.io"):
        level, frame = level + 1, frame.f_back  # type: ignore[assignment]
    return level


def _placed(name: str, given: tuple[Coordinate, ...], side: Sequence[str]) -> tuple[Coordinate, ...]:
    if len(given) != len(side):
        raise FileFormatError(f"{len(given)} {name} were given, the file has {len(side)}")
    for place, direction in zip(given, side, strict=True):
        if place.direction != direction:
            motion = "rotation" if direction == "theta" else "translation"
            raise FileFormatError(f"{name} holds {place}, but what the file has there is a {motion}")
    return given


def sampled(seconds: NDArray[np.float64], options: ReadOptions, *, step: float | None = None) -> tuple[float, float]:
    """Return sample rate and start of sample times, which must be even.

    Parameters
    ----------
    seconds : ndarray
        `(n,)` in s.
    options : ReadOptions
        A given sample rate is taken where it agrees.
    step : float, optional
        The time step that the file says, more exact than what follows from the times.

    Raises
    ------
    FileFormatError
        Times that are not even, or a given sample rate that is another one.
    """
    start, count = float(seconds[0]), seconds.size
    if step is None:
        if count < 2:
            if options.sample_rate_hz is None:
                raise FileFormatError("there is one sample and no sample rate; give it: sample_rate_hz=51200")
            return options.sample_rate_hz, start
        step = float(seconds[-1] - seconds[0]) / (count - 1)
        rounding = 1e-6 * float(np.max(np.abs(seconds)))
        away = np.abs(seconds - (start + step * np.arange(count)))
        worst = int(np.argmax(away))
        # Rounded times are off by little from even ones; times that were summed up drift, with steps that are even.
        steady = float(np.max(np.abs(np.diff(seconds) - step))) <= _UNSTEADY * step
        if not (step > 0.0 and (steady or away[worst] <= _JITTER * step + rounding)):
            raise FileFormatError(
                f"the samples are not evenly spaced in time: sample {worst + 1} is at {seconds[worst]:.9g} s, "
                f"expected {start + step * worst:.9g} s; resample the record before reading it"
            )
    if not (step > 0.0 and np.isfinite(1.0 / step) and np.isfinite(start)):
        raise FileFormatError(f"the time step is {step:g} s, expected more than zero")
    rate = 1.0 / step
    if options.sample_rate_hz is None:
        return rate, start
    if abs(options.sample_rate_hz / rate - 1.0) > _RATE_TOLERANCE:
        raise FileFormatError(
            f"sample_rate_hz is {options.sample_rate_hz:g}, but the file has {rate:.7g} samples per second"
        )
    return options.sample_rate_hz, start
