"""Outlines of the fluted section of end mills from number of flutes, diameter and core diameter.

The outline is built of arcs, after E. B. Kivanc and E. Budak, Int. J. Mach. Tools Manuf. 44, 2004, 1151: with the
radius R = D / 2, the radius R_c of the core and the depth f = R - R_c of the flutes, each of N equal sectors has

- the back of the tooth, an arc of radius r about a point at the distance a = R - r from the axis on the line to the
  cutting edge, from the core at the start of the sector to the cutting edge at its end, at the distance
  a sin(theta) + sqrt(r^2 - a^2 cos^2(theta)) from the axis where the edge is at theta = 90 deg;
- the flute, half a circle of diameter f on the line from the core to the cutting edge, cut into the sector.

The paper was not at hand: the arc is that of its tool with four flutes as it is cited elsewhere; the half circle of the
flute and the centre of the arc for other numbers of flutes are ours. The back begins on the core if
a = (R^2 - R_c^2) / (2 (R - R_c cos(2 pi / N))). Tools with a land, a second relief or a web of other form have other
sections; state them by points or by properties.
"""

from __future__ import annotations

import functools
import math

import numpy as np

from receptance import _checks
from receptance.model.outlines import Points

LEAST_FLUTES, MOST_FLUTES = 2, 20
MOST_CORE = 0.98
"""Largest ratio of core diameter and diameter."""
_STOUTEST = 1.25
"""Smallest ratio of the radii of back and flute."""
_BACK_POINTS, _FLUTE_POINTS = 200, 120
"""Number of points on all backs and in all flutes."""
_QUADRATURE = 100
"""Points of Gauss's rule along the flutes, enough for 30 half pitches."""
_FEWEST = 12
"""Smallest number of points of an arc."""


def fluted_outline(number: int, core: float) -> Points:
    """Return the points of a fluted section of diameter 1, counter-clockwise, `(n, 2)`.

    Points within an arc are slightly off it so that the polygon has its area.

    Parameters
    ----------
    number : int
        Number of flutes.
    core : float
        Core diameter divided by the diameter.

    Examples
    --------
    >>> from receptance.model.flutes import fluted_outline
    >>> points = fluted_outline(4, 0.6)
    >>> float((points**2).sum(axis=1).min() ** 0.5).__round__(3)
    0.3
    """
    outer, inner = 0.5, 0.5 * core
    depth, sector = outer - inner, 2.0 * math.pi / number
    r = _back_radius(number, core)
    a = outer - r
    # In axes with the cutting edge on x: the back from the start of the sector, then the flute from edge to core.
    start = np.array([inner * math.cos(-sector) - a, inner * math.sin(-sector)])
    first = math.atan2(start[1], start[0])
    first -= 2.0 * math.pi if first > 0.0 else 0.0
    # Both arcs touch at the edge. The back has the smaller steps, so that their chords do not cross.
    flute_count = max(_FEWEST, round(_FLUTE_POINTS / number))
    back_count = max(round(_BACK_POINTS / number), math.ceil(1.25 * flute_count * -first / math.pi))
    back = _arc((a, 0.0), r, first, 0.0, back_count)
    flute = _arc((outer - 0.5 * depth, 0.0), 0.5 * depth, 0.0, -math.pi, flute_count)
    tooth = np.concatenate([back, flute])
    turns = sector * np.arange(number)
    cosine, sine = np.cos(turns)[:, None], np.sin(turns)[:, None]
    x, y = tooth.T
    return np.stack([cosine * x - sine * y, sine * x + cosine * y], axis=-1).reshape(-1, 2)


@functools.lru_cache
def smallest_core(number: int) -> float:
    """Return the smallest ratio of core diameter and diameter of a section with a number of flutes.

    Below it teeth are slivers, with backs of less than 1.25 times the radius of the flutes, or the half circle of a
    flute cuts the line from the axis to the edge before it.

    Examples
    --------
    >>> from receptance.model.flutes import smallest_core
    >>> [round(smallest_core(number), 2) for number in (2, 4, 8, 16)]
    [0.11, 0.17, 0.33, 0.53]
    """
    sine = math.sin(2.0 * math.pi / number)
    reaching = (1.0 - sine) / (1.0 + sine) if number > 4 else 0.0
    ratios = np.linspace(0.05, MOST_CORE, 500)
    slivers = [ratio for ratio in ratios if _back_radius(number, ratio) < _STOUTEST * 0.25 * (1.0 - ratio)]
    return float(max(0.05, reaching, *slivers))


def _back_radius(number: int, core: float) -> float:
    """Return the radius of the backs of the teeth of a section of diameter 1."""
    outer, inner = 0.5, 0.5 * core
    return outer - (outer**2 - inner**2) / (2.0 * (outer - inner * math.cos(2.0 * math.pi / number)))


def spread_of_directions(
    moments: tuple[float, float], length: float, turns: float, shank: tuple[float, float]
) -> float:
    """Return how much the tip of a clamped tool with two flutes yields more in its softest direction than in the mean.

    In the stiffest direction it yields as much less. In bending alone the compliance in the direction alpha is the
    integral of x^2 [1/I_1 + 1/I_2 + (1/I_1 - 1/I_2) cos 2 (theta(x) - alpha)] / (2 E) over the distance x from the tip,
    with the principal second moments I_1 and I_2 and the angle theta by which the helix has turned them; the part with
    alpha is largest where alpha has the phase of the integral of x^2 exp(2 i theta).

    Parameters
    ----------
    moments : tuple of 2 floats
        Principal second moments of the section.
    length : float
        Length of the flutes from the tip in m.
    turns : float
        Number of half pitches, by which the section turns by 180 degrees, in this length; 0 for straight flutes.
    shank : tuple of 2 floats
        Length in m of the cylinder between the flutes and the clamped end, and its second moment in the unit of
        `moments`.

    Examples
    --------
    >>> from receptance.model.flutes import spread_of_directions
    >>> [round(spread_of_directions((1.0, 2.0), 0.03, turns, (0.0, 1.0)), 2) for turns in (0.0, 1.0, 4.0)]
    [0.33, 0.17, 0.04]
    """
    points, weights = np.polynomial.legendre.leggauss(_QUADRATURE)
    share = 0.5 * (1.0 + points)
    turned = abs(np.sum(0.5 * weights * share**2 * np.exp(2j * math.pi * turns * share)))
    compliances = [1.0 / moment for moment in moments]
    rest, shank_moment = shank
    mean = sum(compliances) / 6.0 + ((1.0 + rest / length) ** 3 - 1.0) / (3.0 * shank_moment)
    return float(0.5 * abs(compliances[0] - compliances[1]) * turned / mean)


def checked_flutes(owner: str, number: int, diameter: float, core_diameter: float) -> float:
    """Return the core ratio, or raise where a section of that kind does not exist."""
    if isinstance(number, bool) or not isinstance(number, (int, np.integer)):
        raise TypeError(f"{owner}: number is {number!r}, expected a whole number of flutes")
    if not LEAST_FLUTES <= number <= MOST_FLUTES:
        advice = (
            "the centroid of a section with one flute is off the axis, which this model does not have"
            if number < LEAST_FLUTES
            else "with more the section is nearly that of a cylinder with the diameter between core and edges"
        )
        raise ValueError(
            f"{owner}: number is {number}, expected {LEAST_FLUTES} to {MOST_FLUTES} flutes; {advice}; state other "
            "sections by points or properties"
        )
    for quantity, value in (("diameter", diameter), ("core_diameter", core_diameter)):
        if _checks.number(owner, quantity, value, unit="m") <= 0.0:
            raise ValueError(f"{owner}: {quantity} is {1e3 * value:g} mm, expected a positive length in m")
    if core_diameter >= diameter:
        raise ValueError(
            f"{owner}: core_diameter is {1e3 * core_diameter:g} mm, expected less than the diameter "
            f"{1e3 * diameter:g} mm"
        )
    core, least, most = core_diameter / diameter, smallest_core(int(number)), MOST_CORE
    if not least <= core <= most:
        raise ValueError(
            f"{owner}: core_diameter is {1e3 * core_diameter:g} mm, {core:.3g} of the diameter; with {number} flutes "
            f"expected {least:.3g} to {most:g} of it, {1e3 * least * diameter:.4g} to {1e3 * most * diameter:.4g} mm; "
            "usual are 0.5 to 0.7, and more with many flutes"
        )
    return core


def _arc(centre: tuple[float, float], radius: float, start: float, end: float, count: int) -> Points:
    """Return the points of an arc without the last."""
    step = (end - start) / count
    angles = start + step * np.arange(count)
    # The sectors of the polygon have the area of those of the arc: (k r)^2 sin(step) = r^2 step.
    stretch = np.where(np.arange(count) > 0, math.sqrt(abs(step) / math.sin(abs(step))), 1.0)
    return np.column_stack(
        [centre[0] + stretch * radius * np.cos(angles), centre[1] + stretch * radius * np.sin(angles)]
    )
