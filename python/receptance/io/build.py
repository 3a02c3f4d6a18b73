"""Construction of FRFs, coherences and sample rates from the contents of a file, common to all formats."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from receptance.errors import warn_user
from receptance.frf import FRF
from receptance.frf.validation import check_coherence
from receptance.io.errors import FileFormatError
from receptance.io.measurements import Measurement, low_coherence_notes
from receptance.io.options import ReadOptions
from receptance.model.coordinates import Coordinate

if TYPE_CHECKING:
    from receptance.units import Form

_Measurement = TypeVar("_Measurement", bound=Measurement)

_RATE_TOLERANCE = 1e-4
"""Largest relative difference of a given sample rate and that of a file, whose time step has six digits."""
_MAX_JITTER = 0.05
"""Largest deviation of a time from an even spacing, in time steps."""
_MAX_STEP_VARIATION = 1e-3
"""Largest deviation of a time step from the mean step, relative."""


def make_frf(
    *,
    frequency_hz: NDArray[np.float64],
    values: NDArray[Any],
    form: Form,
    directions: tuple[Sequence[str], Sequence[str]],
    options: ReadOptions,
    coherence: NDArray[np.float64] | None = None,
    notes: Sequence[str] = (),
    **fields: Any,
) -> FRF:
    """Return an FRF of SI values with the coordinates of the options and further fields.

    A low coherence is noted, with a warning.

    Raises
    ------
    FileFormatError
        Values that are not those of an FRF, or coordinates that contradict the directions of the file.
    """
    notes = list(notes)
    if coherence is not None and options.ignore_coherence:
        coherence = None
        notes.append("the coherence in the file was ignored on request")
    if coherence is not None:
        coherence = file_coherence(frequency_hz, coherence)
        notes += low_coherence_notes(coherence)
    for name, given, side in (
        ("responses", options.responses, directions[0]),
        ("excitations", options.excitations, directions[1]),
    ):
        if given is not None:
            _check_directions(name, given, side)
            fields[name] = given
        elif name not in fields:
            fields[name] = tuple(side)
    return make(
        FRF, frequency_hz=frequency_hz, values=values, form=form, coherence=coherence, notes=tuple(notes), **fields
    )


def make(kind: type[_Measurement], **fields: Any) -> _Measurement:
    """Return a measurement of a class, with a FileFormatError where its fields are invalid."""
    try:
        return kind(**fields)
    except (TypeError, ValueError) as error:
        raise FileFormatError(str(error)) from None


def file_coherence(frequency_hz: NDArray[np.float64], coherence: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the coherence `(n, ...)` of an FRF in a file, limited to 0 to 1.

    Raises
    ------
    FileFormatError
        A coherence outside 0 to 1, with the option that ignores it.
    """
    try:
        return check_coherence("FRF", coherence, frequency_hz)[0]
    except ValueError as error:
        raise FileFormatError(f"{error}: ignore_coherence=True (on the command line --ignore-coherence)") from None


def complex_values(real_part: NDArray[Any], imaginary: NDArray[Any]) -> NDArray[np.complex128]:
    """Return complex numbers with exactly these parts; real + 1j * imaginary would lose the sign of zeros."""
    values = np.empty(real_part.shape, dtype=np.complex128)
    values.real, values.imag = real_part, imaginary
    return values


def missing_phase_notes(values: NDArray[Any]) -> list[str]:
    """Warn of an FRF with real values, and return the note; an empty list for complex values."""
    if np.iscomplexobj(values):
        return []
    note = "the values are real: without a phase this is a magnitude, or one part of the FRF"
    warn_user(note)
    return [note]


def to_si(values: NDArray[Any], factor: float) -> NDArray[Any]:
    """Return values in SI; unchanged for a factor of 1, because a product loses the sign of complex zeros."""
    return values if factor == 1.0 else values * factor


def _check_directions(name: str, given: tuple[Coordinate, ...], side: Sequence[str]) -> None:
    if len(given) != len(side):
        raise FileFormatError(f"{len(given)} {name} were given, the file has {len(side)}")
    for coordinate, direction in zip(given, side, strict=True):
        if coordinate.direction != direction:
            motion = "rotation" if direction == "theta" else "translation"
            raise FileFormatError(f"{name} holds {coordinate}, but the file has a {motion} there")


def sampling(seconds: NDArray[np.float64], options: ReadOptions, *, step: float | None = None) -> tuple[float, float]:
    """Return sample rate and start of evenly spaced sample times.

    Parameters
    ----------
    seconds : ndarray
        `(n,)` in s.
    options : ReadOptions
        A given sample rate is used if it agrees with the file.
    step : float, optional
        Time step stated in the file, which is more exact than that of the times.

    Raises
    ------
    FileFormatError
        Uneven times, or a given sample rate that contradicts the file.
    """
    start, count = float(seconds[0]), seconds.size
    if step is None:
        if count < 2:
            if options.sample_rate_hz is None:
                raise FileFormatError("there is a single sample and no sample rate; give it: sample_rate_hz=51200")
            return options.sample_rate_hz, start
        step = float(seconds[-1] - seconds[0]) / (count - 1)
        rounding = 1e-6 * float(np.max(np.abs(seconds)))
        deviation = np.abs(seconds - (start + step * np.arange(count)))
        worst = int(np.argmax(deviation))
        # Rounded times deviate little from even ones; accumulated times drift, but their steps are equal.
        equal_steps = float(np.max(np.abs(np.diff(seconds) - step))) <= _MAX_STEP_VARIATION * step
        if not (step > 0.0 and (equal_steps or deviation[worst] <= _MAX_JITTER * step + rounding)):
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
