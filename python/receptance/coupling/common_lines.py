"""Receptances on common lines, as solutions line by line need them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from receptance.fit.observation import Observation, altered, as_observations
from receptance.frf.resampling import curvature_warning, interpolate
from receptance.model.terminals import EQUAL_LINES, nearest_lines

_GAP = 1.5
"""Times the median spacing of lines: nothing is interpolated across a wider gap."""
_SPLINE_LINES = 4
"""Least number of lines of a cubic spline."""
_FEW = 0.5
"""Resample if the common lines are fewer than this share of the lines, and of the lines after resampling."""


def check_observations(observations: Observation | Sequence[Observation]) -> tuple[Observation, ...]:
    """Return the observations as a tuple; raise unless all are receptances with standard deviations."""
    receptances = as_observations(observations)
    for observation in receptances:
        if not observation.is_receptance:
            raise TypeError(f"{observation!r} is of natural frequencies, expected a receptance")
        if not observation.weighted:
            raise ValueError(
                f"{observation!r} has no standard deviation, which the uncertainty of the result needs; give it one"
            )
    return receptances


def common_lines(
    observed: tuple[Observation, ...],
) -> tuple[tuple[Observation, ...], NDArray[np.inexact], list[NDArray[np.intp]], int]:
    """Return observations, their common lines in Hz, rows of these in each, and the number of lines not common.

    If few lines are common, because the records had different lengths, all are resampled first.
    """
    lines = _shared(observed)
    if lines.size < _FEW * min(observation.frequency_hz.size for observation in observed):
        other = _resampled(observed)
        if other and other[0].frequency_hz.size * _FEW > lines.size:
            observed, lines = other, other[0].frequency_hz
    if not lines.size:
        raise ValueError(
            f"there is no line that all of {', '.join(map(repr, observed))} have, and no band that all of them cover "
            "with the same exponential window; all receptances are needed on each line"
        )
    rows = [nearest_lines(observation.frequency_hz, lines)[0] for observation in observed]
    return observed, lines, rows, sum(o.frequency_hz.size - lines.size for o in observed)


def _shared(observed: tuple[Observation, ...]) -> NDArray[np.inexact]:
    lines: NDArray[np.inexact] = observed[0].frequency_hz
    for observation in observed[1:]:
        lines = lines[nearest_lines(observation.frequency_hz, lines)[1]]
    return lines


def _resampled(observed: tuple[Observation, ...]) -> tuple[Observation, ...]:
    """Return observations on the lines of the one with the widest spacing that all cover; empty if there are none."""
    widest = max(observed, key=_spacing)
    lines = widest.frequency_hz
    kept = np.ones(lines.size, dtype=np.bool_)
    for observation in observed:
        kept &= _covered(lines, observation)
    return tuple(_resample(observation, lines[kept], widest) for observation in observed) if kept.any() else ()


def _spacing(observation: Observation) -> float:
    return float(np.median(np.diff(observation.frequency_hz.real))) if observation.frequency_hz.size > 1 else np.inf


def _covered(lines: NDArray[np.inexact], observation: Observation) -> NDArray[np.bool_]:
    """Return which lines an observation covers, gaps and other exponential windows excluded."""
    measured = observation.frequency_hz
    nearest, same = nearest_lines(measured, lines)
    if measured.size < _SPLINE_LINES:
        return same
    after = np.clip(np.searchsorted(measured.real, lines.real), 1, measured.size - 1)
    inside = (lines.real >= measured.real[0]) & (lines.real <= measured.real[-1])
    dense = measured.real[after] - measured.real[after - 1] <= _GAP * _spacing(observation)
    window = np.abs(lines.imag - measured.imag[nearest]) <= EQUAL_LINES * np.abs(lines)
    return np.asarray(same | (inside & dense & window))


def _resample(observation: Observation, lines: NDArray[np.inexact], widest: Observation) -> Observation:
    if observation is widest:
        return observation.select(np.isin(observation.frequency_hz, lines))
    owner = repr(observation)
    measured = observation.frequency_hz.real
    # Lines on the edge of the band may lie outside by rounding.
    grid = interpolate(measured, np.clip(lines.real, measured[0], measured[-1]), owner)
    values, bend = grid.spline(observation.receptance)
    deviation = observation.standard_deviation
    arrays = {name: getattr(observation, name) for name in ("standard_deviation", "correlated_lines", "force")}
    fields = {name: grid.linear(array) for name, array in arrays.items() if array is not None}
    fields |= {"frequency_hz": lines, "receptance": values}
    notes = [
        *observation.notes,
        f"{observation.label or owner}: resampled to the {lines.size} lines of {widest.label or repr(widest)}",
    ]
    sharp = curvature_warning(grid, values, bend, None if deviation is None else grid.linear(deviation**2))
    notes += [f"{observation.label or owner}: {sharp}"] if sharp else []
    return altered(observation, **fields, notes=tuple(notes))
