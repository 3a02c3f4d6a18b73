"""Stiffness and damping of the taper from natural frequencies and damping ratios, as the paper does it (its figure 6).

With A_j = 1/m + z_j^2 / I and B = (z1 - z2)^2 / (m I), two undamped natural frequencies say

A1 K1 + A2 K2 = w1^2 + w2^2  and  B K1 K2 = w1^2 w2^2,

which is quadratic, so that two joints have the same two frequencies.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from receptance import _checks
from receptance.taper.body import Body
from receptance.taper.choice import Shape, choose
from receptance.taper.rigid import RadialJoint

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["RadialSolution", "RadialSolutions", "radial_from_modes"]

Interval = tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class RadialSolution:
    """One joint that has the two frequencies.

    Attributes
    ----------
    joint : RadialJoint
        Stiffnesses from the undamped equations; dampings from phi^T C phi = 2 zeta w m, right to first order in zeta.
    exact : RadialJoint or None
        All four from the complex eigenvalues; None where these lead to none near the other.
    intervals : dict of str to (float, float)
        Of k_x1 and k_x2 (and of c_x1 and c_x2, to first order), where standard errors were given.
    notes : tuple of str
        What a person should know.
    """

    joint: RadialJoint
    exact: RadialJoint | None
    intervals: dict[str, Interval]
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class RadialSolutions:
    """What two natural frequencies say about two springs.

    Attributes
    ----------
    solutions : tuple of RadialSolution
        Two; one where a mode shape chose; none where no real joint has these frequencies.
    discriminant, discriminant_standard_error : float
        Of the quadratic, over (w1^2 + w2^2)^2; negative where no real joint has these frequencies. The error is NaN
        where none was given.
    within_noise : dict of str to (float, float)
        Where there is no solution: stiffnesses of the joints whose frequencies are within the noise of those given.
    nearest : int or None
        Number of the solution whose mode shape is nearest to the measured one, whether it can be called the one or not;
        None where there is no solution, or two and no shape.
    statement : str
        What was found, in words.
    of_neither : bool
        Whether the measured mode shape is that of neither solution.
    """

    solutions: tuple[RadialSolution, ...]
    discriminant: float
    discriminant_standard_error: float
    within_noise: dict[str, Interval]
    nearest: int | None
    statement: str
    of_neither: bool = False


def radial_from_modes(
    body: Body,
    z1: float,
    z2: float,
    frequency_hz: ArrayLike,
    damping_ratio: ArrayLike = (0.0, 0.0),
    *,
    frequency_standard_error_hz: ArrayLike | None = None,
    damping_standard_error: ArrayLike | None = None,
    shape: Shape | None = None,
    level: float = 0.95,
) -> RadialSolutions:
    """Return the radial joints that have two natural frequencies and damping ratios.

    Parameters
    ----------
    body : Body
        The holder.
    z1, z2 : float
        Where the springs act, in m from the centre of gravity towards the tip.
    frequency_hz, damping_ratio : array_like
        `(2,)` of the two modes, ascending in frequency.
    frequency_standard_error_hz, damping_standard_error : array_like, optional
        `(2,)` their standard errors, independent of each other; intervals come from them.
    shape : Shape, optional
        Motion at one point over that at another, which tells the two joints apart.
    level : float, optional
        Level of the intervals.

    Returns
    -------
    RadialSolutions
        Intervals of stiffness hold all joints whose frequencies lie within the ellipse of the given ones that has
        this level for any one quantity, so they know that the quadratic has no root beyond its double one; where the
        ellipse reaches that, both solutions have one interval.

    Raises
    ------
    ValueError, TypeError
        Numbers that are not two ascending frequencies, or springs at the same place.

    References
    ----------
    Xu et al., Dynamic modeling and parameters identification of a spindle-holder taper joint, Springer 2012,
    figure 6 and eqs. 1 to 11.

    Examples
    --------
    >>> from receptance.taper import Body, RadialJoint, radial_from_modes
    >>> body = Body(mass=4.5, inertia=0.01)
    >>> true = RadialJoint(body=body, z1=0.02, z2=-0.08, k_x1=1e9, k_x2=5e8)
    >>> found = radial_from_modes(body, 0.02, -0.08, true.undamped_modes().frequency_hz)
    >>> [f"{s.joint.k_x1:.3g} and {s.joint.k_x2:.3g} N/m" for s in found.solutions]
    ['1.64e+09 and 3.04e+08 N/m', '1e+09 and 5e+08 N/m']
    """
    f = _pair("frequency_hz", frequency_hz, positive=True)
    zeta = _pair("damping_ratio", damping_ratio)
    of_f = (
        None
        if frequency_standard_error_hz is None
        else _pair("frequency_standard_error_hz", frequency_standard_error_hz)
    )
    of_zeta = None if damping_standard_error is None else _pair("damping_standard_error", damping_standard_error)
    if not f[0] < f[1]:
        raise ValueError(f"radial_from_modes: frequency_hz is {f.tolist()}, expected two ascending frequencies")
    frame = _Frame(body, _checks.number("z1", "z1", z1, unit="m"), _checks.number("z2", "z2", z2, unit="m"))
    from receptance.identification.spread import quantile

    reach = quantile(level, None)
    discriminant, slope = frame.discriminant(f)
    error = float(np.hypot(*(slope * of_f))) if of_f is not None else float("nan")
    around = frame.around(f, of_f * reach) if of_f is not None else None
    if discriminant < 0.0:
        return _none(discriminant, error, around, level)
    found = []
    for branch, (k1, k2) in enumerate(frame.stiffnesses(f)):
        joint, notes = frame.damped(k1, k2, f, zeta)
        # Where the noise reaches the double root, the two solutions run into each other there.
        joined = around is not None and np.isnan(around).any()
        intervals = {} if around is None else _ends(around.reshape(-1, 2) if joined else around[branch])
        if of_f is not None and of_zeta is not None:
            intervals |= frame.damping_intervals(branch, f, zeta, reach * of_f, reach * of_zeta)
        found.append(RadialSolution(joint=joint, exact=frame.exact(joint, f, zeta), intervals=intervals, notes=notes))
    if discriminant == 0.0:
        found = found[:1]
    text = f"{len(found)} joints have these frequencies: a mode shape, measured at two points, would choose"
    if len(found) == 1:
        text = "one joint has these frequencies: the quadratic has a double root"
    nearest, of_neither = 0 if len(found) == 1 else None, False
    if shape is not None and len(found) == 2:
        nearest, choice, text = choose([one.joint for one in found], shape)
        of_neither = choice == "neither"
        if choice == "clear":
            found, nearest = [found[nearest]], 0
    return RadialSolutions(
        solutions=tuple(found),
        discriminant=discriminant,
        discriminant_standard_error=error,
        within_noise={},
        nearest=nearest,
        statement=text,
        of_neither=of_neither,
    )


def _pair(name: str, values: ArrayLike, *, positive: bool = False) -> NDArray[np.float64]:
    found = _checks.unmasked("radial_from_modes", name, values, np.float64)
    if found.shape != (2,) or not np.isfinite(found).all() or (positive and np.any(found <= 0.0)):
        kind = "positive " if positive else ""
        raise ValueError(f"radial_from_modes: {name} is {values!r}, expected two {kind}finite numbers")
    return found


def _ends(stiffnesses: NDArray[np.float64]) -> dict[str, Interval]:
    low, high = np.nanmin(stiffnesses, axis=0), np.nanmax(stiffnesses, axis=0)
    return {name: (float(low[i]), float(high[i])) for i, name in enumerate(("k_x1", "k_x2"))}


def _none(discriminant: float, error: float, around: NDArray[np.float64] | None, level: float) -> RadialSolutions:
    within: dict[str, Interval] = {}
    if around is None:
        text = "no real joint has these frequencies; give their standard errors to learn whether that is noise"
    elif np.isnan(around).all():
        text = (
            f"no real joint has these frequencies, nor any within their noise at {100 * level:g} %: the holder is not "
            "rigid, or its mass, inertia or springs' places are others"
        )
    else:
        within = _ends(around.reshape(-1, 2))
        spans = ", ".join(f"{name} from {low:.3g} to {high:.3g} N/m" for name, (low, high) in within.items())
        text = f"no real joint within the noise: the frequencies miss the double root; within the noise lie {spans}"
    return RadialSolutions(
        solutions=(),
        discriminant=discriminant,
        discriminant_standard_error=error,
        within_noise=within,
        nearest=None,
        statement=text,
    )


class _Frame:
    """A body, two places, and the equations between springs and modes."""

    def __init__(self, body: Body, z1: float, z2: float) -> None:
        if z1 == z2:
            raise ValueError(f"radial_from_modes: z1 and z2 are both {z1:g} m, expected two places")
        self.body, self.z1, self.z2 = body, z1, z2
        self.a = np.array([1.0 / body.mass + z * z / body.inertia for z in (z1, z2)])
        self.b = (z1 - z2) ** 2 / (body.mass * body.inertia)
        # a1 a2 / b - 1 as the square that it is: no difference of nearly equal numbers.
        root = np.sqrt(body.inertia / body.mass)
        self.excess = ((root + z1 * z2 / root) / (z1 - z2)) ** 2

    def discriminant(self, f: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        """Relative discriminant, and its slope by each frequency."""
        x, y = f[0] ** 2, f[1] ** 2
        value = ((y - x) ** 2 - 4.0 * self.excess * x * y) / (x + y) ** 2
        # d/dx of (y - x)^2 - 4 g x y over (x + y)^2; the ratio is of degree zero, so x d/dx = -y d/dy.
        by_log_x = -4.0 * (1.0 + self.excess) * x * y * (y - x) / (x + y) ** 3
        return float(value), np.array([2.0 * by_log_x / f[0], -2.0 * by_log_x / f[1]])

    def stiffnesses(self, f: NDArray[np.float64]) -> NDArray[np.float64]:
        """`(2 solutions, ..., 2)` stiffnesses of frequencies `(2, ...)`; NaN where there is none."""
        x, y = (2.0 * np.pi * f[0]) ** 2, (2.0 * np.pi * f[1]) ** 2
        inside = (y - x) ** 2 - 4.0 * self.excess * x * y
        with np.errstate(invalid="ignore"):
            large = 0.5 * (x + y + np.sqrt(inside))
        small = (1.0 + self.excess) * x * y / large
        return np.array(
            [np.stack([one / self.a[0], other / self.a[1]], -1) for one, other in ((large, small), (small, large))]
        )

    def around(self, f: NDArray[np.float64], reach: NDArray[np.float64]) -> NDArray[np.float64]:
        """`(2, n, 2)` stiffnesses of frequencies in the ellipse with these half axes."""
        radius, angle = np.meshgrid(np.linspace(0.0, 1.0, 41), np.linspace(0.0, 2.0 * np.pi, 241))
        circle = np.stack([(radius * np.cos(angle)).ravel(), (radius * np.sin(angle)).ravel()])
        return self.stiffnesses(f[:, None] + reach[:, None] * circle)

    def damped(
        self, k1: float, k2: float, f: NDArray[np.float64], zeta: NDArray[np.float64]
    ) -> tuple[RadialJoint, tuple[str, ...]]:
        """Add dampings from phi^T C phi = 2 zeta w m, to first order."""
        joint = RadialJoint(body=self.body, z1=self.z1, z2=self.z2, k_x1=float(k1), k_x2=float(k2))
        shapes = joint.undamped_modes().shapes.real
        motion = shapes[0][:, None] + shapes[1][:, None] * np.array([self.z1, self.z2])
        c1, c2 = np.linalg.solve(motion**2, 4.0 * np.pi * zeta * f)
        negative = [name for name, value in (("c_x1", c1), ("c_x2", c2)) if value < 0.0]
        notes = tuple(
            f"{name} is negative: no such dashpot gives these damping ratios with these springs" for name in negative
        )
        return replace(joint, c_x1=float(c1), c_x2=float(c2)), notes

    def exact(self, start: RadialJoint, f: NDArray[np.float64], zeta: NDArray[np.float64]) -> RadialJoint | None:
        """Stiffnesses and dampings whose complex eigenvalues are those of the two modes, by Newton's method.

        The coefficients of the characteristic polynomial are A C, A K + B C1 C2, B (K1 C2 + K2 C1) and B K1 K2.
        """
        unit = 2.0 * np.pi * float(np.sqrt(f[0] * f[1]))
        w = 2.0 * np.pi * f / unit
        wanted = np.array(
            [
                2.0 * (zeta @ w),
                w @ w + 4.0 * zeta[0] * zeta[1] * w[0] * w[1],
                2.0 * w[0] * w[1] * (zeta[0] * w[1] + zeta[1] * w[0]),
                (w[0] * w[1]) ** 2,
            ]
        )
        # Each stiffness and damping in the unit that makes its A one.
        b = self.b / (self.a[0] * self.a[1])
        scale = np.concatenate([unit**2 / self.a, unit / self.a])
        x = np.array([start.k_x1, start.k_x2, start.c_x1, start.c_x2]) / scale
        for _ in range(50):
            k1, k2, c1, c2 = x
            residual = np.array([c1 + c2, k1 + k2 + b * c1 * c2, b * (k1 * c2 + k2 * c1), b * k1 * k2]) - wanted
            slope = np.array(
                [[0, 0, 1, 1], [1, 1, b * c2, b * c1], [b * c2, b * c1, b * k2, b * k1], [b * k2, b * k1, 0, 0]]
            )
            try:
                step = np.linalg.solve(slope, -residual)
            except np.linalg.LinAlgError:
                return None
            x = x + step
            if np.abs(step).max() < 1e-14 * np.abs(x).max():
                break
        else:
            # The last digits may go to and fro; more than these is no solution.
            if np.abs(step).max() > 1e-11 * np.abs(x).max():
                return None
        if np.any(x[:2] <= 0.0):
            return None
        k1, k2, c1, c2 = (x * scale).tolist()
        return replace(start, k_x1=k1, k_x2=k2, c_x1=c1, c_x2=c2)

    def damping_intervals(
        self,
        branch: int,
        f: NDArray[np.float64],
        zeta: NDArray[np.float64],
        reach_f: NDArray[np.float64],
        reach_zeta: NDArray[np.float64],
    ) -> dict[str, Interval]:
        """To first order in all four errors."""

        def dampings(change: NDArray[np.float64]) -> NDArray[np.float64]:
            moved = f + change[:2]
            k1, k2 = self.stiffnesses(moved)[branch]
            if not np.isfinite(k1 + k2):
                return np.full(2, np.nan)
            joint, _ = self.damped(k1, k2, moved, zeta + change[2:])
            return np.array([joint.c_x1, joint.c_x2])

        steps = 1e-3 * np.concatenate([reach_f, reach_zeta])
        slopes = [(dampings(e * steps) - dampings(-e * steps)) / 2e-3 for e in np.eye(4)]
        half = np.sqrt(np.sum(np.square(slopes), axis=0))
        middle = dampings(np.zeros(4))
        if not np.isfinite(half).all():
            return {}
        return {
            name: (float(middle[i] - half[i]), float(middle[i] + half[i])) for i, name in enumerate(("c_x1", "c_x2"))
        }
