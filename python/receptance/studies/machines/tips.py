"""Tip responses: predicted with an identified spindle against the virtual truth, peak by peak."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.spindle import SpindleModes, SpindleReceptance
    from receptance.studies.machines.machine import Tool, VirtualMachine

__all__ = ["Peak", "Tip", "peaks_of", "predict", "predict_line_by_line"]

STEP_HZ = 2.0
_PROMINENCE = 1.3
"""A peak stands out of what is around it by this factor."""
_NEAR = 0.1
_SHARE = 0.2
"""Peaks lower than this share of the highest are not counted."""


@dataclass(frozen=True)
class Peak:
    """A peak of the true tip response, and where and how high it was predicted.

    Attributes
    ----------
    true_hz, predicted_hz : float
        Places; not a number where no peak is predicted within 10 %.
    magnitude_percent : float
        Predicted over true height, less 100 %.
    """

    true_hz: float
    predicted_hz: float
    magnitude_percent: float

    @property
    def frequency_percent(self) -> float:
        """Error of its frequency."""
        return 100.0 * (self.predicted_hz / self.true_hz - 1.0)


@dataclass(frozen=True, eq=False)
class Tip:
    """A tool's tip response, predicted and true.

    Attributes
    ----------
    tool : Tool
        Which.
    lines : ndarray
        `(n,)` in Hz.
    true, predicted : ndarray
        `(n,)` complex, m/N.
    deviation : ndarray
        `(n,)` stated standard deviation of the logarithm of the prediction.
    peaks : tuple of Peak
        Those of the truth, ascending.
    """

    tool: Tool
    lines: NDArray[np.float64]
    true: NDArray[np.complex128]
    predicted: NDArray[np.complex128]
    deviation: NDArray[np.float64]
    peaks: tuple[Peak, ...]

    @property
    def dominant(self) -> Peak | None:
        """The highest peak, None where there is none in the band."""
        if not self.peaks:
            return None
        heights = [abs(self.true[np.argmin(np.abs(self.lines - peak.true_hz))]) for peak in self.peaks]
        return self.peaks[int(np.argmax(heights))]


def predict(machine: VirtualMachine, tool: Tool, spindle: SpindleModes) -> Tip:
    """Predict with the spindle's modes, on fine lines over their band."""
    low, high = spindle.part.band_hz or (100.0, 5000.0)
    lines = np.arange(np.ceil(low), high, STEP_HZ)
    assembly = machine.predicted(tool, spindle.part)
    h = assembly.receptance(lines)
    return _tip(machine, tool, lines, h, spindle.standard_deviation(assembly, lines))


def predict_line_by_line(machine: VirtualMachine, tool: Tool, found: SpindleReceptance) -> Tip:
    """Predict with the spindle line by line, on its usable lines, and carry the covariance through."""
    part = found.part()
    lines = part.frequency_hz
    names = [f"spindle.residual_{entry}" for entry in ("y", "theta", "ytheta")]
    h, slope = machine.predicted(tool, part).derivatives(lines, names)
    assert part.covariance is not None
    variance = np.einsum("ni,nij,nj->n", slope, part.covariance, slope.conj()).real
    return _tip(machine, tool, lines, h, np.sqrt(np.maximum(variance, 0.0)) / np.abs(h))


def _tip(
    machine: VirtualMachine,
    tool: Tool,
    lines: NDArray[np.float64],
    h: NDArray[np.complex128],
    deviation: NDArray[np.float64],
) -> Tip:
    true = machine.true(tool).receptance(lines)
    own, other = peaks_of(np.abs(true)), peaks_of(np.abs(h))
    peaks = []
    for index in own:
        near = other[np.abs(lines[other] / lines[index] - 1.0) < _NEAR]
        at = near[np.argmax(np.abs(h[near]))] if near.size else None
        peaks.append(
            Peak(
                float(lines[index]),
                float("nan") if at is None else float(lines[at]),
                float("nan") if at is None else 100.0 * float(abs(h[at]) / abs(true[index]) - 1.0),
            )
        )
    return Tip(tool, lines, true, h, deviation, tuple(peaks))


def peaks_of(size: NDArray[Any]) -> NDArray[np.intp]:
    """Return the peaks that stand out and are not far below the highest."""
    from scipy.signal import find_peaks

    found, _ = find_peaks(np.log(size), prominence=np.log(_PROMINENCE))
    result: NDArray[np.intp] = found[size[found] > _SHARE * size[found].max(initial=0.0)]
    return result
