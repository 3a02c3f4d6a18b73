"""Whether the blanks can be those that were measured: a spindle takes energy, and answers to all blanks alike."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.identification.line_solutions import Equations
    from receptance.spindle.receptance import SpindleReceptance

__all__ = ["active", "gained", "mismatch"]

_UNSUITED = 3.0
"""Root mean square of what several blanks disagree by, in standard deviations, that noise does not make."""
_SIGNIFICANT = 4.0
_FEW = 0.02
"""Share of the usable lines on which a spindle may come out as a source of energy before it is no accident."""


def active(found: SpindleReceptance) -> NDArray[np.bool_]:
    """Return the lines on which the spindle would feed energy into the blank, by more than its uncertainty explains."""
    result = np.zeros(len(found.frequency_hz), dtype=np.bool_)
    rows = np.flatnonzero(found.usable)
    if not rows.size:
        return result
    energy, deviation = gained(found.matrix[rows], found.covariance[rows])
    result[rows] = energy > _SIGNIFICANT * deviation + 1e-9
    return result


def gained(
    matrix: NDArray[np.complex128], covariance: NDArray[np.complex128]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the largest relative gain of energy over all loads, negative for a passive spindle, and its deviation."""
    root = np.sqrt(np.abs(np.einsum("nii->ni", matrix)))
    _, shapes = np.linalg.eigh(matrix.imag / (root[:, :, None] * root[:, None, :]))
    shape = shapes[:, :, -1] / root
    weights = np.stack([shape[:, 0] ** 2, shape[:, 1] ** 2, 2.0 * shape[:, 0] * shape[:, 1]], axis=1)
    entries = np.stack([matrix[:, 0, 0], matrix[:, 1, 1], matrix[:, 0, 1]], axis=1)
    energy = np.einsum("ni,ni->n", weights, entries.imag)
    variance = np.einsum("ni,nij,nj->n", weights, covariance, weights).real
    return energy, np.sqrt(np.maximum(variance, 0.0))


def mismatch(found: SpindleReceptance, equations: Equations) -> str:
    """Return why the blanks do not match their responses; empty where nothing speaks against them."""
    if found.rms > _UNSUITED:
        x = np.stack([found.matrix[:, 0, 0], found.matrix[:, 1, 1], found.matrix[:, 0, 1]], axis=1)[found.usable]
        some = equations.on(found.usable)
        off = np.abs(some.evaluate(x)[0] / some.measured - 1.0) / some.deviation
        worst = int(np.argmax(np.median(off, axis=0))) if x.size else 0
        return (
            f"no spindle answers to all blanks as they were measured: the rms is {found.rms:.3g} standard deviations, "
            f"most of it in {found.labels[worst]!r}; a blank's dimensions, places or quantity are not as stated, the "
            "spindle changed between them, or the standard deviations are too small"
        )
    if np.iscomplexobj(found.frequency_hz):
        return ""
    wrong = active(found)
    share = float(wrong.sum()) / max(int(found.usable.sum()), 1)
    if share > _FEW:
        lines = np.asarray(found.frequency_hz)[wrong]
        return (
            f"the spindle would have to feed energy into the blank on {int(wrong.sum())} of {int(found.usable.sum())} "
            f"usable lines, the first at {lines[0]:g} Hz: the blank does not match its responses (its length, diameter "
            "or material, the places, the sign or the quantity of a channel)"
        )
    return ""
