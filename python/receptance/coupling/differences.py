"""Rotational receptances of a tip by finite differences of translations, with their truncation errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import NDArray

from receptance.coupling.blanks import blank_equations, check_blanks, plane_of
from receptance.coupling.common_lines import check_observations, common_lines
from receptance.coupling.line_equations import linear_solution
from receptance.fit.observation import Observation
from receptance.model.coordinates import Coordinate
from receptance.report.table import percent

_TERMS = ("y/F", "theta/F", "theta/M")
_SAME = 1e-6
"""Largest relative difference of two equal distances."""


def rotations(observations: Sequence[Observation], *, truncation: bool = True) -> tuple[Observation, ...]:
    """Return y/F, theta/F and theta/M at the tip of a blank by finite differences of translations.

    The slope at the tip is (y_2 - y_1)/s with two points (first order) and (-3 y_1 + 4 y_2 - y_3)/(2 s) with three
    (second order; Sattinger 1980; Duarte and Ewins 2000). A moment is the same combination of forces. Noise grows with
    1/s and 1/s^2. The truncation error is calculated from the model of the blank in the spindle that these responses
    give. It does not vanish as fast as the order suggests: that of theta/M falls with the first power of s only,
    because the response to a force has a kink in its slope at the force. The slope of y also contains the shear of the
    blank, which the rotation of the section does not, so in a short thick blank the error of theta/M grows with 1/s for
    small s. The returned standard deviations contain both kinds of error.

    `identify_spindle` does not need rotations; it uses the translations directly. It takes the errors of the three
    receptances as independent, which they are not, so its variance is approximate if it is given rotations.

    Parameters
    ----------
    observations : sequence of Observation
        Receptances between all pairs of two or three evenly spaced points of one blank, with standard deviations; of
        two reciprocal pairs one is sufficient. The rotations are those at the point nearest to the tip.
    truncation : bool, optional
        Whether the standard deviations include the truncation error.

    Returns
    -------
    tuple of Observation
        y/F, theta/F and theta/M at the first point, with a note on the size of both errors.

    Raises
    ------
    TypeError, ValueError
        Observations of several blanks, a missing pair, or points that are not evenly spaced.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance import STEEL, Assembly, Coordinate, Observation, ModalPart, Mode, Part, Segment
    >>> from receptance.coupling import rotations
    >>> bar = Part([Segment(length=0.1, outer_diameter=0.04, material=STEEL)], name="bar")
    >>> mode = Mode(frequency_hz=900.0, damping_ratio=0.03, y=0.2, theta=1.0)
    >>> machine = Assembly([bar, ModalPart(modes=[mode], residual_y=5e-9, residual_theta=5e-7)])
    >>> lines, points = np.linspace(100.0, 2000.0, 50), (Coordinate("bar", 0.0), Coordinate("bar", 0.03))
    >>> measured = [
    ...     Observation(assembly=Assembly([bar]), frequency_hz=lines, standard_deviation=1e-3, response=a, excitation=b,
    ...         receptance=machine.receptance(lines, response=a, excitation=b))
    ...     for a, b in [(points[0], points[0]), (points[1], points[0]), (points[1], points[1])]
    ... ]
    >>> [rotation.label for rotation in rotations(measured)]
    ['y/F by differences', 'theta/F by differences', 'theta/M by differences']
    """
    observed = check_observations(tuple(observations))
    if any(observation.assembly != observed[0].assembly for observation in observed):
        raise ValueError("the observations have different assemblies, expected one blank")
    points = sorted({point for o in observed for point in (o.response, o.excitation)}, key=lambda p: p.position)
    weights = _weights(points)
    observed, lines, rows, _ = common_lines(observed)
    pairs = _pairs(observed, rows, points)
    # Weights of H_ij, for points i and j, in y/F, theta/F and theta/M.
    y = np.eye(len(points))[0]
    combinations = (np.outer(y, y), np.outer(weights, y), np.outer(weights, weights))
    tip = replace(points[0], direction="y"), replace(points[0], direction="theta")
    sides = ((tip[0], tip[0]), (tip[1], tip[0]), (tip[1], tip[1]))
    errors = _truncation(observed, rows, lines, points, weights) if truncation else np.zeros((3, lines.size))
    result = []
    for name, combination, error, (response, excitation) in zip(_TERMS, combinations, errors, sides, strict=True):
        value, variance = np.asarray(0.0), np.asarray(0.0)
        for (i, j), (pair_value, pair_variance) in pairs.items():
            share = combination[i, j] if i == j else combination[i, j] + combination[j, i]
            value, variance = value + share * pair_value, variance + share**2 * pair_variance
        noise, error = np.sqrt(variance) / np.abs(value), error / np.abs(value)
        result.append(
            Observation(
                assembly=observed[0].assembly,
                frequency_hz=lines,
                receptance=value,
                response=response,
                excitation=excitation,
                standard_deviation=np.hypot(noise, error),
                label=f"{name} by differences",
                notes=(
                    f"{name} by differences: noise {percent(float(np.median(noise)))}, truncation "
                    f"{percent(float(np.median(error)))} (medians over the lines)",
                ),
            )
        )
    return tuple(result)


def _truncation(
    observed: tuple[Observation, ...],
    rows: list[NDArray[np.intp]],
    lines: NDArray[np.inexact],
    points: Sequence[Coordinate],
    weights: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return the truncation errors of y/F, theta/F and theta/M in the model, `(3, n)`, SI units.

    H_ij = H_free,ij - r_i^T X r_j with X = (G + Y)^-1 gives the translations and the exact rotations.
    """
    check_blanks(observed)
    equations = blank_equations(observed, lines, rows, None)
    g = equations.stiffness(linear_solution(equations))
    x = np.linalg.inv(g + equations.surroundings[:, 0])
    coordinates = [*plane_of(observed[0].assembly), replace(points[0], direction="theta"), *points]
    h = observed[0].assembly.receptance(lines, response=coordinates, excitation=coordinates)
    coupled = h[:, 2:, 2:] - np.einsum("nip,npq,nqj->nij", h[:, 2:, :2], x, h[:, :2, 2:])
    slope, translations = coupled[:, 0], coupled[:, 1:, 1:]
    differences = np.einsum("i,nij->nj", weights, translations)
    errors = [0.0 * slope[:, 0], differences[:, 0] - slope[:, 1], differences @ weights - slope[:, 0]]
    return np.asarray(np.abs(errors))


def _weights(points: Sequence[Coordinate]) -> NDArray[np.float64]:
    """Return the weights of the translations in the slope at the first point, in 1/m."""
    if len({point.part for point in points}) > 1 or any(point.direction != "y" for point in points):
        raise ValueError(f"the coordinates are {', '.join(map(repr, points))}, expected translations along one part")
    if len(points) not in (2, 3) or any(point.position == "end" for point in points):
        raise ValueError(f"there are {len(points)} points, expected two or three, each with its distance from the tip")
    x = np.array([point.position for point in points], dtype=np.float64)
    spacing = np.diff(x)
    if abs(spacing[-1] - spacing[0]) > _SAME * spacing[0]:
        raise ValueError(f"the points are {spacing[0]:g} and {spacing[1]:g} m apart, expected equal distances")
    slope = [-1.0, 1.0] if len(x) == 2 else [-1.5, 2.0, -0.5]
    return np.array(slope) / float(spacing[0])


Pair = tuple["NDArray[np.complex128]", "NDArray[np.float64]"]


def _pairs(
    observed: tuple[Observation, ...], rows: list[NDArray[np.intp]], points: Sequence[Coordinate]
) -> dict[tuple[int, int], Pair]:
    """Return values and variances of the pairs i <= j; reciprocal pairs are averaged."""
    measured: dict[tuple[int, int], list[Pair]] = {}
    for observation, row in zip(observed, rows, strict=True):
        first, second = sorted((points.index(observation.response), points.index(observation.excitation)))
        value = observation.receptance[row]
        variance = (np.asarray(observation.standard_deviation)[row] * np.abs(value)) ** 2
        measured.setdefault((first, second), []).append((value, variance))
    result = {}
    for i, j in combinations_with_replacement(range(len(points)), 2):
        if (i, j) not in measured:
            raise ValueError(f"there is no observation between {points[i]!r} and {points[j]!r}, expected all pairs")
        values, variances = zip(*measured[i, j], strict=True)
        result[i, j] = sum(values) / len(values), sum(variances) / len(variances) ** 2
    return result
