"""Rotations of a blank's tip from translations at two or three places: finite differences, and what they are off by."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance.identification.inversion_input import check_observations, common_lines
from receptance.identification.line_solutions import linear_solution
from receptance.identification.observations import MeasuredFRF
from receptance.spindle.blanks import Blanks, check_blanks, plane_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.coordinates import Coordinate

__all__ = ["rotations"]

_NAMES = ("y/F", "theta/F", "theta/M")
_EVEN = 1e-6
"""Relative difference of two distances that are taken to be the same."""


def rotations(observations: Sequence[MeasuredFRF], *, truncation: bool = True) -> tuple[MeasuredFRF, ...]:
    """Make a blank's receptances y/F, theta/F and theta/M at its tip of translations at two or three places.

    The slope at the tip is (y_2 - y_1)/s with two places, of first order, and (-3 y_1 + 4 y_2 - y_3)/(2 s) with three,
    of second order (Sattinger 1980; Duarte and Ewins 2000); a moment is the same combination of forces. Noise grows
    with 1/s and 1/s^2. What the differences are off by is known from the model of the blank in the spindle that these
    responses give, and it does not always fall with s: theta/M only with its first power, whatever the order, as the
    response to a force bends at the force; and the slope of y has the shear of the blank in it, which the rotation of
    its section has not, so that in a short thick blank the error of theta/M grows with 1/s in the end. Both kinds of
    error are in the standard deviations that are returned.

    `identify_spindle` needs none of this: it takes the places as they are. Errors of the three receptances are not
    independent, which it does not know: its variance is then approximate.

    Parameters
    ----------
    observations : sequence of MeasuredFRF
        All pairs of two or three evenly spaced places of one blank, of pairs that are the same by reciprocity one or
        both, with standard deviations. The first place is nearest to the tip, and the rotations are those there.
    truncation : bool, optional
        Whether the truncation error goes into the standard deviations.

    Returns
    -------
    tuple of MeasuredFRF
        y/F, theta/F and theta/M at the first place, with a note of the sizes of both errors.

    Raises
    ------
    TypeError, ValueError
        Observations of several blanks, a pair that is missing, or places that are not evenly spaced.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance import STEEL, Assembly, Coordinate, MeasuredFRF, ModalPart, Mode, Part, Segment
    >>> from receptance.spindle import rotations
    >>> bar = Part([Segment(length=0.1, outer_diameter=0.04, material=STEEL)], name="bar")
    >>> mode = Mode(frequency_hz=900.0, damping_ratio=0.03, y=0.2, theta=1.0)
    >>> machine = Assembly([bar, ModalPart(modes=[mode], residual_y=5e-9, residual_theta=5e-7)])
    >>> lines, places = np.linspace(100.0, 2000.0, 50), (Coordinate("bar", 0.0), Coordinate("bar", 0.03))
    >>> measured = [
    ...     MeasuredFRF(assembly=Assembly([bar]), frequency_hz=lines, standard_deviation=1e-3, response=a, excitation=b,
    ...         receptance=machine.receptance(lines, response=a, excitation=b))
    ...     for a, b in [(places[0], places[0]), (places[1], places[0]), (places[1], places[1])]
    ... ]
    >>> [one.label for one in rotations(measured)]
    ['y/F by differences', 'theta/F by differences', 'theta/M by differences']
    """
    observed = check_observations(tuple(observations))
    if any(one.assembly != observed[0].assembly for one in observed):
        raise ValueError("rotations are made of one blank's responses, and these are of several")
    places = sorted({point for one in observed for point in (one.response, one.excitation)}, key=lambda p: p.position)
    weights = _weights(places)
    observed, lines, rows, _ = common_lines(observed)
    pairs = _pairs(observed, rows, places)
    # How much of H_ij, i and j places, is in y/F, theta/F and theta/M.
    y = np.eye(len(places))[0]
    combinations = (np.outer(y, y), np.outer(weights, y), np.outer(weights, weights))
    tip = replace(places[0], direction="y"), replace(places[0], direction="theta")
    sides = ((tip[0], tip[0]), (tip[1], tip[0]), (tip[1], tip[1]))
    free = observed[0].assembly
    cut = _truncation(observed, rows, lines, places, weights) if truncation else np.zeros((3, lines.size))
    result = []
    for name, combination, off, (response, excitation) in zip(_NAMES, combinations, cut, sides, strict=True):
        value, variance = _combined(combination, pairs)
        noise, off = np.sqrt(variance) / np.abs(value), off / np.abs(value)
        spread = np.hypot(noise, off)
        result.append(
            MeasuredFRF(
                assembly=free,
                frequency_hz=lines,
                receptance=value,
                response=response,
                excitation=excitation,
                standard_deviation=spread,
                label=f"{name} by differences",
                notes=(
                    f"{name} by differences: noise {100.0 * float(np.median(noise)):.2g} %, truncation "
                    f"{100.0 * float(np.median(off)):.2g} % (medians over the lines)",
                ),
            )
        )
    return tuple(result)


def _truncation(
    observed: tuple[MeasuredFRF, ...],
    rows: list[NDArray[np.intp]],
    lines: NDArray[Any],
    places: Sequence[Coordinate],
    weights: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return how far the differences of y/F, theta/F and theta/M are off in the model, `(3, n)`.

    H_ij = H_free,ij - r_i^T X r_j, X = (G + Y)^-1: both are known at the places and, exactly, for the rotation.
    """
    check_blanks(observed)
    equations = Blanks.of(observed, lines, None).equations(observed, rows)
    g = equations.stiffness(linear_solution(equations))
    x = np.linalg.inv(g + equations.surroundings[:, 0])
    points = [*plane_of(observed[0].assembly), replace(places[0], direction="theta"), *places]
    h = observed[0].assembly.receptance(lines, response=points, excitation=points)
    coupled = h[:, 2:, 2:] - np.einsum("nip,npq,nqj->nij", h[:, 2:, :2], x, h[:, :2, 2:])
    slope, at = coupled[:, 0], coupled[:, 1:, 1:]
    turned = np.einsum("i,nij->nj", weights, at)
    off = [0.0 * slope[:, 0], turned[:, 0] - slope[:, 1], turned @ weights - slope[:, 0]]
    result: NDArray[np.float64] = np.abs(np.array(off))
    return result


def _weights(places: Sequence[Coordinate]) -> NDArray[np.float64]:
    """Return what of each place's translation is in the slope at the first."""
    if len({place.part for place in places}) > 1 or any(place.direction != "y" for place in places):
        raise ValueError(f"the places are {', '.join(map(repr, places))}, expected translations along one part")
    if len(places) not in (2, 3) or any(place.position == "end" for place in places):
        raise ValueError(f"there are {len(places)} places, expected two or three, each with its distance from the tip")
    x = np.array([place.position for place in places], dtype=np.float64)
    spacing = np.diff(x)
    if abs(spacing[-1] - spacing[0]) > _EVEN * spacing[0]:
        raise ValueError(f"the places are {spacing[0]:g} and {spacing[1]:g} m apart, expected evenly spaced ones")
    slope = [-1.0, 1.0] if len(x) == 2 else [-1.5, 2.0, -0.5]
    return np.array(slope) / float(spacing[0])


Pair = tuple["NDArray[np.complex128]", "NDArray[np.float64]"]


def _pairs(
    observed: tuple[MeasuredFRF, ...], rows: list[NDArray[np.intp]], places: Sequence[Coordinate]
) -> dict[tuple[int, int], Pair]:
    """Return values and variances of the pairs i <= j, means where both of a pair were measured."""
    found: dict[tuple[int, int], list[Pair]] = {}
    for one, row in zip(observed, rows, strict=True):
        first, second = sorted((places.index(one.response), places.index(one.excitation)))
        value = one.receptance[row]
        variance = (np.asarray(one.standard_deviation)[row] * np.abs(value)) ** 2
        found.setdefault((first, second), []).append((value, variance))
    result = {}
    for i, j in product(range(len(places)), repeat=2):
        if i > j:
            continue
        if (i, j) not in found:
            raise ValueError(f"nothing was measured between {places[i]!r} and {places[j]!r}, expected all pairs")
        values, variances = zip(*found[i, j], strict=True)
        result[i, j] = sum(values) / len(values), sum(variances) / len(variances) ** 2
    return result


def _combined(combination: NDArray[np.float64], pairs: dict[tuple[int, int], Pair]) -> Pair:
    """Return a combination of the receptances and its variance."""
    value, variance = np.asarray(0.0), np.asarray(0.0)
    for (i, j), (own, spread) in pairs.items():
        share = combination[i, j] if i == j else combination[i, j] + combination[j, i]
        value, variance = value + share * own, variance + share**2 * spread
    return value, variance
