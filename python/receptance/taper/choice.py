"""Which of the two joints it is, from the motion at two points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from receptance.taper.rigid import RadialJoint

__all__ = ["Shape", "choose"]

_CLEAR = 10.83
"""Difference of the squared distances, in standard errors, from which on one joint is called the one: p = 0.001."""


@dataclass(frozen=True, kw_only=True)
class Shape:
    """Motion at one point of the holder over that at another, in both modes.

    Parameters
    ----------
    first, second : float
        The points, as z in m from the centre of gravity towards the tip.
    ratio : tuple of complex
        Modal constant at the first over that at the second, of both modes, for one and the same hit.
    standard_error : tuple of float, optional
        Of the real and of the imaginary part of each ratio.
    """

    first: float
    second: float
    ratio: tuple[complex, complex]
    standard_error: tuple[float, float] | None = None


def choose(joints: Sequence[RadialJoint], shape: Shape) -> tuple[int | None, str]:
    """Return which joint has the measured shape, None where that is not clear, and the evidence in words."""
    measured = np.array(shape.ratio)
    distances = []
    for joint in joints:
        # Points that move opposite ways by any amounts: compared as angles of (first, second), which never overflow.
        own = joint.undamped_modes().ratio(shape.first, shape.second).real
        if shape.standard_error is None:
            distances.append(float(np.sum((np.arctan(measured.real) - np.arctan(own)) ** 2)))
        else:
            distances.append(float(np.sum((np.abs(measured - own) / np.array(shape.standard_error)) ** 2)))
    best, other = np.argsort(distances)[:2]
    found = ", ".join(f"{value:.2f}" for value in measured.real)
    ratios = [joints[i].undamped_modes().ratio(shape.first, shape.second).real for i in (best, other)]
    texts = [", ".join(f"{value:.2f}" for value in one) for one in ratios]
    if shape.standard_error is not None and distances[other] - distances[best] < _CLEAR:
        return None, f"the mode shape ({found}) does not tell the two joints ({texts[0]} and {texts[1]}) apart"
    return int(best), f"the mode shape ({found}) chooses the joint with {texts[0]} over that with {texts[1]}"
