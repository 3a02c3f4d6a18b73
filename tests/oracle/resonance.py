"""Frequencies where a lossless segment alone is singular, found in high precision and rounded to float64."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal

from numpy.typing import NDArray

from . import stiffness
from .arithmetic import DEFAULT, Arithmetic, Scalar
from .elements import wave_number_bound

Ends = Literal["free-free", "clamped-free", "clamped-clamped"]
ENDS: tuple[Ends, ...] = ("free-free", "clamped-free", "clamped-clamped")
DIGITS = 50
PHASE_STEP = 0.1
RELATIVE_STEP = 0.01


def resonance_above(row: NDArray, w: float, ends: Ends, highest: float, *, ar: Arithmetic = DEFAULT) -> float | None:
    """Return the resonance of a segment that follows a frequency, as the nearest float64.

    Parameters
    ----------
    row : ndarray, shape (14,)
        A row of the segment table; its loss factors are ignored.
    w : float
        Angular frequency to start from [rad/s].
    ends : {'free-free', 'clamped-free', 'clamped-clamped'}
        The supports.
    highest : float
        Angular frequency to stop at [rad/s].
    ar : arithmetic, optional
        The arithmetic to use.

    Returns
    -------
    float or None
        Angular frequency [rad/s]; None if there is none below `highest`. Two resonances of one symmetry
        within a hundredth of each other, or a tenth of a radian of the shorter wave, can be missed together.
    """
    lossless = row.copy()
    lossless[[8, 12]] = 0.0
    with ar.precision(DIGITS):
        values = [ar.real(x) for x in lossless.tolist()]
        section = stiffness.section(values, row[13], row[10] != 0.0, ar)

        def determinants(x: Scalar) -> list[Scalar]:
            even, odd = stiffness.halves(section, values[2], ar.complex(x * x, 0 * x), ar, standing=True)
            return [value.real for value in _determinants(even, odd, ends)]

        left = ar.real(w)
        at_left = determinants(left)
        while left < highest:
            step = PHASE_STEP / (wave_number_bound(row, float(left)) * row[2])
            right = left * (1 + ar.real(min(step, RELATIVE_STEP)))
            at_right = determinants(right)
            roots = [
                _illinois(lambda x, i=i: determinants(x)[i], left, right, *signs)
                for i, signs in enumerate(zip(at_left, at_right, strict=True))
                if signs[0] * signs[1] <= 0
            ]
            if roots:
                root = float(min(roots))
                return root if root < highest else None
            left, at_left = right, at_right
    return None


def cutoff(row: NDArray, *, ar: Arithmetic = DEFAULT) -> float:
    """Return the cut-off sqrt(S/r) of a segment without its losses, as the nearest float64 [rad/s]."""
    lossless = row.copy()
    lossless[[8, 12]] = 0.0
    with ar.precision(DIGITS):
        values = [ar.real(x) for x in lossless.tolist()]
        section = stiffness.section(values, row[13], row[10] != 0.0, ar)
        return float(ar.sqrt(section.shear / section.rotary).real)


def _minor(a: tuple[Scalar, Scalar], b: tuple[Scalar, Scalar]) -> Scalar:
    return a[0] * b[1] - a[1] * b[0]


def _determinants(even: stiffness.Half, odd: stiffness.Half, ends: Ends) -> list[Scalar]:
    """Return entire functions of the frequency, one of which vanishes at each resonance."""
    if ends == "free-free":
        return [_minor(even.force, even.moment), _minor(odd.force, odd.moment)]
    if ends == "clamped-clamped":
        return [_minor(even.y, even.theta), _minor(odd.y, odd.theta)]
    # the stiffness of one end with the other held is the mean of the halves' stiffnesses: its determinant,
    # multiplied out to avoid division by the clamped-clamped determinants
    mixed = (
        _minor(even.force, even.theta) * _minor(odd.y, odd.moment)
        + _minor(even.y, even.moment) * _minor(odd.force, odd.theta)
        + _minor(even.force, even.y) * _minor(odd.moment, odd.theta)
        + _minor(even.moment, even.theta) * _minor(odd.force, odd.y)
    )
    return [
        _minor(even.force, even.moment) * _minor(odd.y, odd.theta)
        + _minor(odd.force, odd.moment) * _minor(even.y, even.theta)
        + mixed
    ]


def _illinois(
    function: Callable[[Scalar], Scalar], left: Scalar, right: Scalar, at_left: Scalar, at_right: Scalar
) -> Scalar:
    """Return the root between two points of opposite sign to about 30 digits."""
    for _ in range(200):
        if at_left == at_right or abs(right - left) <= 1e-30 * abs(right):
            break
        middle = (left * at_right - right * at_left) / (at_right - at_left)
        at_middle = function(middle)
        if at_middle * at_right <= 0:
            left, at_left = right, at_right
        else:
            at_left = at_left / 2
        right, at_right = middle, at_middle
        if at_right == 0:
            break
    return right
