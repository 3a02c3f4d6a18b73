"""Which of the two joints it is, from the motion at two points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from receptance.taper.rigid import RadialJoint

__all__ = ["Choice", "Shape", "choose"]

Choice = Literal["clear", "open", "neither"]

_CLEAR = 10.83
"""Difference of the squared distances, in standard errors, from which on one joint is called the one: p = 0.001."""
_IMPOSSIBLE = 27.6
"""Squared distance of two angles from which on the shape is not that of a joint: p = 1e-6."""


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

    Raises
    ------
    ValueError
        Both points are the same: the ratio is then 1 for every joint.
    """

    first: float
    second: float
    ratio: tuple[complex, complex]
    standard_error: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        if self.first == self.second:
            raise ValueError(f"Shape: first and second are both {self.first:g} m, expected two points")


def choose(joints: Sequence[RadialJoint], shape: Shape) -> tuple[int, Choice, str]:
    """Return which joint's shape is nearer, what that says, and the evidence in words.

    Two motions are an angle, atan of their ratio, in which a point that happens to stand still is nothing special.
    """
    measured = np.array(shape.ratio)
    angle = np.arctan(measured.real)
    own = [joint.undamped_modes().ratio(shape.first, shape.second).real for joint in joints]
    apart = [np.mod(angle - np.arctan(one) + 0.5 * np.pi, np.pi) - 0.5 * np.pi for one in own]
    texts = [", ".join(f"{value:.2f}" for value in one) for one in (measured.real, *own)]
    if shape.standard_error is None:
        distances = [float(np.sum(one**2)) for one in apart]
        best = int(np.argmin(distances))
        other = 1 - best
        return (
            best,
            "clear",
            f"the mode shape ({texts[0]}) chooses the joint with {texts[1 + best]}, not {texts[1 + other]}",
        )
    errors = np.array(shape.standard_error) / (1.0 + measured.real**2)
    distances = [float(np.sum((one / errors) ** 2)) for one in apart]
    best = int(np.argmin(distances))
    other = 1 - best
    if distances[other] - distances[best] < _CLEAR:
        return best, "open", f"the mode shape ({texts[0]}) does not tell the joints ({texts[1]} and {texts[2]}) apart"
    if distances[best] > _IMPOSSIBLE:
        return (
            best,
            "neither",
            (
                f"the mode shape ({texts[0]}) is that of neither joint ({texts[1]} and {texts[2]}), by "
                f"{np.sqrt(distances[best]):.0f} standard errors at least: this is not a rigid holder on two springs"
            ),
        )
    return (
        best,
        "clear",
        f"the mode shape ({texts[0]}) chooses the joint with {texts[1 + best]}, not {texts[1 + other]}",
    )
