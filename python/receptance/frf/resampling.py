"""Values between measured lines, without inventing resolution."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.frf.frf import FRF

__all__ = ["Between", "between", "resampled", "too_sharp"]

_SAME = 1e-9
"""Of the spacing: a line this near to a measured one is that line."""
_BEND = 0.05
"""Of the magnitude, between spline and straight line. With 5, 4, 3, 2 lines in the half-power band of a single mode
it is 0.035, 0.05, 0.07, 0.12, and the spline's own error 0.004, 0.01, 0.03, 0.11."""
_NOISE = 4.0
"""Standard deviations of noise that are not taken for a bend."""
_ROUNDING = 1e-6
"""Of the spacing: what the frequencies of a file may be rounded by."""


@dataclass(frozen=True)
class Between:
    """Where new lines lie among the measured ones: between `left` and `left + 1`, `share` of the way, `(n_new,)`."""

    measured_hz: NDArray[np.float64]
    frequency_hz: NDArray[np.float64]
    left: NDArray[np.intp]
    share: NDArray[np.float64]

    @property
    def exact(self) -> NDArray[np.bool_]:
        """Which new lines are measured ones."""
        found: NDArray[np.bool_] = (self.share == 0.0) | (self.share == 1.0)
        return found

    @property
    def steps(self) -> NDArray[np.float64]:
        """How many measured lines a new one stands from its neighbours, `(n_new,)`, at least 1."""
        apart = np.diff(self.left + self.share)
        return np.ones(self.left.size) if not apart.size else np.minimum(np.append(apart, np.inf), np.r_[np.inf, apart])

    def straight(self, array: NDArray[Any]) -> NDArray[Any]:
        """Return `(n_new, ...)` on straight lines between neighbours; measured lines keep their numbers."""
        share = self.share.reshape(-1, *(1,) * (array.ndim - 1))
        left, right = array[self.left], array[np.minimum(self.left + 1, len(array) - 1)]
        with np.errstate(invalid="ignore"):
            mixed = left + share * (right - left)
        # An infinite variance on either side is infinite between, and not on the other line.
        mixed = np.where(np.isnan(mixed), np.inf, mixed) if array.dtype.kind == "f" else mixed
        return np.where(share == 0.0, left, np.where(share == 1.0, right, mixed))

    def both(self, array: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Return True where all lines that a new one is made of are."""
        right = np.minimum(self.left + 1, len(array) - 1)
        chosen: NDArray[np.bool_] = (array[self.left] | (self.share == 1.0)) & (array[right] | (self.share == 0.0))
        return chosen

    def smooth(self, array: NDArray[np.complex128]) -> tuple[NDArray[np.complex128], NDArray[np.float64]]:
        """Return `(n_new, ...)` on a cubic spline, and how far it is from straight lines, relative to the magnitude."""
        from scipy.interpolate import CubicSpline  # slow to import

        straight = self.straight(array)
        if self.exact.all() or len(array) < 4:
            return straight, np.zeros(straight.shape)
        curve = CubicSpline(self.measured_hz, array)(self.frequency_hz)
        found = np.where(self.exact.reshape(-1, *(1,) * (array.ndim - 1)), straight, curve)
        size = np.maximum(np.abs(found), np.abs(straight))
        return found, np.abs(found - straight) / np.where(size > 0.0, size, 1.0)


def between(measured_hz: NDArray[np.float64], frequency_hz: NDArray[np.float64], owner: str) -> Between:
    """Return where new lines lie, or raise for those outside or too close together."""
    spacing = np.diff(measured_hz) if measured_hz.size > 1 else measured_hz * 0.0 + 1.0
    slack = _ROUNDING * float(spacing.min())
    outside = (frequency_hz < measured_hz[0] - slack) | (frequency_hz > measured_hz[-1] + slack)
    if outside.any():
        first = frequency_hz[outside][0]
        raise ValueError(
            f"{owner}: cannot be resampled at {first:g} Hz, outside the lines measured "
            f"({measured_hz[0]:g} to {measured_hz[-1]:g} Hz)"
        )
    left = np.clip(np.searchsorted(measured_hz, frequency_hz, side="right") - 1, 0, max(0, measured_hz.size - 2))
    share = (frequency_hz - measured_hz[left]) / spacing[left]
    share = np.where(np.abs(share) <= _SAME, 0.0, np.where(np.abs(share - 1.0) <= _SAME, 1.0, share))
    place = Between(measured_hz, frequency_hz, left, share)
    _check_spacing(place, owner)
    return place


def _check_spacing(place: Between, owner: str) -> None:
    """Raise where new lines stand closer than the measured ones around them: by less than one line's number."""
    steps = np.diff(place.left + place.share)
    close = np.flatnonzero(steps < 1.0 - _ROUNDING)
    if close.size:
        low, high = place.frequency_hz[close[0] : close[0] + 2]
        raise ValueError(
            f"{owner}: cannot be resampled to {low:g} and {high:g} Hz, {high - low:g} Hz apart where it was measured "
            f"every {(high - low) / steps[close[0]]:g} Hz: such lines would look measured without being so; measure "
            "longer records for a finer resolution, or fit a model"
        )


def too_sharp(
    place: Between,
    values: NDArray[np.complex128],
    bend: NDArray[np.float64],
    log_variance: NDArray[np.float64] | None,
) -> str:
    """Return what is to be said where the curve bends too sharply between its lines; empty where it does not.

    Only large values count, half of all: what is lost beside an antiresonance is small, and mostly noise.
    """
    size = np.abs(values)
    limit = np.full(bend.shape, _BEND)
    if log_variance is not None:
        limit = np.maximum(limit, _NOISE * np.sqrt(log_variance))
    sharp = np.where((bend > limit) & (size >= np.median(size, axis=0)), bend, 0.0)
    if not sharp.any():
        return ""
    worst = np.unravel_index(int((sharp * size).argmax()), sharp.shape)
    return (
        f"around {place.frequency_hz[worst[0]]:g} Hz the curve bends too sharply between its lines (about "
        f"{100.0 * sharp[worst]:.2g} % from one to the next): values between them are uncertain by 1 % and more"
    )


def resampled(frf: FRF, frequency_hz: NDArray[np.float64]) -> tuple[dict[str, Any], str]:
    """Return the fields that change on other lines, and what should be said aloud; see `FRF.resample`."""
    place = between(frf.frequency_hz, frequency_hz, repr(frf))
    values, bend = place.smooth(frf.values)
    quality = {name: getattr(frf, name) for name in ("coherence", "log_variance", "degrees_of_freedom")}
    changes: dict[str, Any] = {name: place.straight(array) for name, array in quality.items() if array is not None}
    if frf.usable is not None:
        changes["usable"] = place.both(frf.usable)
    # What n lines shared, fewer share of lines that stand further apart.
    changes["correlated_lines"] = np.maximum(1.0, place.straight(frf.correlated_lines) / place.steps)
    notes = list(frf.notes)
    if not place.exact.all():
        notes.append(f"resampled: {np.count_nonzero(~place.exact)} lines are between measured ones")
    sharp = too_sharp(place, values, bend, changes.get("log_variance"))
    notes += [sharp] if sharp else []
    return {"frequency_hz": frequency_hz, "values": values, "notes": tuple(notes), **changes}, sharp
