"""Interpolation of an FRF to other lines that are no closer together than the measured ones."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy
from numpy.typing import NDArray

from receptance.frf.data import PER_ENTRY, FRFData
from receptance.report.table import percent

_SAME_LINE = 1e-9
"""Distance, relative to the spacing, within which a line equals a measured one."""
_MAX_CURVATURE = 0.05
"""Largest difference of spline and linear interpolation, relative to the magnitude. With 5, 4, 3, 2 lines in the
half-power band of a mode it is 0.035, 0.05, 0.07, 0.12, and the error of the spline 0.004, 0.01, 0.03, 0.11."""
_NOISE_DEVIATIONS = 4.0
"""Standard deviations of noise up to which a difference does not count as curvature."""
_ROUNDING = 1e-6
"""Rounding of the frequencies of a file, relative to the spacing."""


@dataclass(frozen=True)
class Interpolation:
    """Positions `(n_new,)` of new lines: at `share` of the distance from the measured line `left` to `left + 1`."""

    measured_hz: NDArray[np.float64]
    frequency_hz: NDArray[np.float64]
    left: NDArray[np.intp]
    share: NDArray[np.float64]

    @property
    def exact(self) -> NDArray[np.bool_]:
        """New lines that are measured lines."""
        return np.asarray((self.share == 0.0) | (self.share == 1.0))

    @property
    def steps(self) -> NDArray[np.float64]:
        """Distance of each new line to its nearer neighbour, `(n_new,)` in measured lines, at least 1."""
        steps = np.diff(self.left + self.share)
        return np.ones(self.left.size) if not steps.size else np.minimum(np.append(steps, np.inf), np.r_[np.inf, steps])

    def linear(self, array: NDArray[Any]) -> NDArray[Any]:
        """Return `(n_new, ...)` by linear interpolation; measured lines keep their values exactly."""
        share = self.share.reshape(-1, *(1,) * (array.ndim - 1))
        left, right = array[self.left], array[np.minimum(self.left + 1, len(array) - 1)]
        with np.errstate(invalid="ignore"):
            interpolated = left + share * (right - left)
        # Infinite variance on one side gives infinite variance between the lines, but not on the other line.
        interpolated = (
            np.where(np.isnan(interpolated), np.inf, interpolated) if array.dtype.kind == "f" else interpolated
        )
        return np.where(share == 0.0, left, np.where(share == 1.0, right, interpolated))

    def both(self, array: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Return True where all lines contributing to a new line are True."""
        right = np.minimum(self.left + 1, len(array) - 1)
        return np.asarray((array[self.left] | (self.share == 1.0)) & (array[right] | (self.share == 0.0)))

    def spline(self, array: NDArray[np.complex128]) -> tuple[NDArray[np.complex128], NDArray[np.float64]]:
        """Return `(n_new, ...)` by a cubic spline, and its relative difference from linear interpolation."""
        linear = self.linear(array)
        if self.exact.all() or len(array) < 4:
            return linear, np.zeros(linear.shape)
        curve = scipy.interpolate.CubicSpline(self.measured_hz, array)(self.frequency_hz)
        values = np.where(self.exact.reshape(-1, *(1,) * (array.ndim - 1)), linear, curve)
        size = np.maximum(np.abs(values), np.abs(linear))
        return values, np.abs(values - linear) / np.where(size > 0.0, size, 1.0)


def interpolate(measured_hz: NDArray[np.float64], frequency_hz: NDArray[np.float64], owner: str) -> Interpolation:
    """Return the positions of new lines, or raise if they are outside or too close together."""
    spacing = np.diff(measured_hz) if measured_hz.size > 1 else measured_hz * 0.0 + 1.0
    rounding = _ROUNDING * float(spacing.min())
    outside = (frequency_hz < measured_hz[0] - rounding) | (frequency_hz > measured_hz[-1] + rounding)
    if outside.any():
        first = frequency_hz[outside][0]
        raise ValueError(
            f"{owner}: cannot be resampled at {first:g} Hz, outside the measured band "
            f"({measured_hz[0]:g} to {measured_hz[-1]:g} Hz)"
        )
    left = np.clip(np.searchsorted(measured_hz, frequency_hz, side="right") - 1, 0, max(0, measured_hz.size - 2))
    share = (frequency_hz - measured_hz[left]) / spacing[left]
    share = np.where(np.abs(share) <= _SAME_LINE, 0.0, np.where(np.abs(share - 1.0) <= _SAME_LINE, 1.0, share))
    positions = Interpolation(measured_hz, frequency_hz, left, share)
    _check_spacing(positions, owner)
    return positions


def _check_spacing(positions: Interpolation, owner: str) -> None:
    """Raise if new lines are closer together than the measured lines around them."""
    steps = np.diff(positions.left + positions.share)
    close = np.flatnonzero(steps < 1.0 - _ROUNDING)
    if close.size:
        low, high = positions.frequency_hz[close[0] : close[0] + 2]
        raise ValueError(
            f"{owner}: cannot be resampled to {low:g} and {high:g} Hz, {high - low:g} Hz apart where the measured "
            f"lines are {(high - low) / steps[close[0]]:g} Hz apart: interpolation adds no resolution; measure longer "
            "records, or fit a model"
        )


def curvature_warning(
    positions: Interpolation,
    values: NDArray[np.complex128],
    curvature: NDArray[np.float64],
    log_variance: NDArray[np.float64] | None,
) -> str:
    """Return a warning if the curvature between lines is too large for interpolation, else an empty text.

    Only the upper half of the magnitudes is checked: errors near an antiresonance are small and mostly noise.
    """
    size = np.abs(values)
    limit = np.full(curvature.shape, _MAX_CURVATURE)
    if log_variance is not None:
        limit = np.maximum(limit, _NOISE_DEVIATIONS * np.sqrt(log_variance))
    sharp = np.where((curvature > limit) & (size >= np.median(size, axis=0)), curvature, 0.0)
    if not sharp.any():
        return ""
    worst = np.unravel_index(int((sharp * size).argmax()), sharp.shape)
    return (
        f"around {positions.frequency_hz[worst[0]]:g} Hz the lines are too far apart for interpolation (spline and "
        f"linear interpolation differ by {percent(sharp[worst])}): values between them are uncertain by over 1 %"
    )


def resample(frf: FRFData, frequency_hz: NDArray[np.float64]) -> tuple[dict[str, Any], str]:
    """Return the fields that change on other lines, and a warning or an empty text; see `FRF.resample`."""
    positions = interpolate(frf.frequency_hz, frequency_hz, repr(frf))
    values, curvature = positions.spline(frf.values)
    arrays = {name: getattr(frf, name) for name in PER_ENTRY if name != "values"}
    changes: dict[str, Any] = {name: positions.linear(array) for name, array in arrays.items() if array is not None}
    if frf.usable is not None:
        changes["usable"] = positions.both(frf.usable)
    # Lines further apart are less correlated.
    changes["correlated_lines"] = np.maximum(1.0, positions.linear(frf.correlated_lines) / positions.steps)
    notes = list(frf.notes)
    if not positions.exact.all():
        notes.append(f"resampled: {np.count_nonzero(~positions.exact)} lines are interpolated")
    warning = curvature_warning(positions, values, curvature, changes.get("log_variance"))
    notes += [warning] if warning else []
    return {"frequency_hz": frequency_hz, "values": values, "notes": tuple(notes), **changes}, warning
