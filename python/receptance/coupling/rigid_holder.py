"""Rigid holders on springs, and their springs from natural frequencies and damping ratios (Xu et al. 2012, corrected).

With A_j = 1/m + z_j^2 / I and B = (z1 - z2)^2 / (m I), two undamped natural frequencies give

A1 K1 + A2 K2 = w1^2 + w2^2  and  B K1 K2 = w1^2 w2^2,

which is quadratic, so two joints have the same two frequencies (figure 6 of the paper).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from receptance import _checks
from receptance.fit.covariance import confidence_multiplier
from receptance.model.beams import Part


@dataclass(frozen=True, eq=False)
class RigidModes:
    """Modes of a rigid holder, in ascending frequency."""

    frequency_hz: NDArray[np.float64]
    """`(n,)` natural frequencies |lambda| / (2 pi) in Hz."""
    damping_ratio: NDArray[np.float64]
    """`(n,)` -Re(lambda) / |lambda|."""
    shapes: NDArray[np.complex128]
    """`(2, n)` displacement of the centre of gravity in m and rotation in rad of each mode, complex if damping couples
    the modes."""

    def ratio(self, first: float, second: float) -> NDArray[np.complex128]:
        """Ratio `(n,)` of the motions at two points, given as z in m."""
        values = self.shapes[0] + np.array([[first], [second]]) * self.shapes[1]
        return np.asarray(values[0] / values[1])


@dataclass(frozen=True, kw_only=True)
class RadialJoint:
    """A rigid holder on radial springs and dashpots at the big and the small end of its taper.

    z is measured from the centre of gravity towards the tip: L1 at the big end and -L2 at the small end in the notation
    of the paper. With v = (1, z), each spring adds K v v^T, so

    K = [[K1 + K2, K1 z1 + K2 z2], [K1 z1 + K2 z2, K1 z1^2 + K2 z2^2]], and C has the same form.

    The paper prints K1 L1 - K2 L2 below the diagonal only and K1 L1^2 - K2 L2^2 on it (eqs. 1, 3, 4), which violates
    reciprocity.

    Parameters
    ----------
    body : Body
        The holder.
    z1, z2 : float
        Positions of the springs in m.
    k_x1, k_x2 : float
        Stiffnesses K_X1 and K_X2 in N/m.
    c_x1, c_x2 : float, optional
        Dampings C_X1 and C_X2 in N s/m.

    Raises
    ------
    ValueError, TypeError
        Springs at the same position, or a stiffness that is not positive.

    Examples
    --------
    >>> from receptance.coupling import Body, RadialJoint
    >>> body = Body(mass=4.5, inertia=0.01)
    >>> joint = RadialJoint(body=body, z1=0.02, z2=-0.08, k_x1=1e9, k_x2=5e8, c_x1=900.0, c_x2=500.0)
    >>> joint.modes().frequency_hz.round(1)
    array([2523.7, 3345.6])
    """

    body: Body
    z1: float
    z2: float
    k_x1: float
    k_x2: float
    c_x1: float = 0.0
    c_x2: float = 0.0

    def __post_init__(self) -> None:
        for check, names, unit in (
            (_checks.number, ("z1", "z2"), "m"),
            (_checks.number, ("c_x1", "c_x2"), "N s/m"),
            (_checks.positive, ("k_x1", "k_x2"), "N/m"),
        ):
            values = {name: check("RadialJoint", name, getattr(self, name), unit=unit) for name in names}
            _checks.set_fields(self, values)
        if self.z1 == self.z2:
            raise ValueError(f"RadialJoint: z1 and z2 are both {self.z1:g} m, expected two positions")

    def matrices(self) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Return mass, damping and stiffness over (X_c, theta): eqs. 2 to 4, corrected."""
        mass = np.diag([self.body.mass, self.body.inertia])
        return mass, self._spring_matrix(self.c_x1, self.c_x2), self._spring_matrix(self.k_x1, self.k_x2)

    def _spring_matrix(self, first: float, second: float) -> NDArray[np.float64]:
        coupling = first * self.z1 + second * self.z2
        return np.array([[first + second, coupling], [coupling, first * self.z1**2 + second * self.z2**2]])

    def modes(self) -> RigidModes:
        """Return both damped modes, from the state matrix.

        Raises
        ------
        ValueError
            A mode that does not oscillate.
        """
        mass, damping, stiffness = self.matrices()
        inverse = np.linalg.inv(mass)
        # u' = A u with u = (X_c, theta, X_c', theta'): eq. 11 with the corrected matrices.
        state = np.block([[np.zeros((2, 2)), np.eye(2)], [-inverse @ stiffness, -inverse @ damping]])
        values, vectors = np.linalg.eig(state)
        upper = np.flatnonzero(values.imag > 0.0)
        if upper.size != 2:
            raise ValueError(f"{self!r}: a mode is overdamped, expected two oscillating modes")
        order = upper[np.argsort(np.abs(values[upper]))]
        poles = values[order]
        return RigidModes(np.abs(poles) / (2.0 * np.pi), -poles.real / np.abs(poles), vectors[:2, order])

    def undamped_modes(self) -> RigidModes:
        """Return both undamped modes; shapes are real and mass-normalised."""
        mass, _, stiffness = self.matrices()
        root = np.sqrt(np.diag(mass))
        squares, vectors = np.linalg.eigh(stiffness / np.outer(root, root))
        # The smaller square would be a difference of large numbers; the determinant is a product.
        determinant = self.k_x1 * self.k_x2 * (self.z1 - self.z2) ** 2 / (self.body.mass * self.body.inertia)
        squares[0] = determinant / squares[1]
        shapes = (vectors / root[:, None]).astype(np.complex128)
        return RigidModes(np.sqrt(squares) / (2.0 * np.pi), np.zeros(2), shapes)


_RIGID = 1e9
"""Factor of Young's modulus for rigid parts; assemblies then agree with a rigid body to nine digits."""


@dataclass(frozen=True, kw_only=True)
class Body:
    """A rigid body of revolution.

    Parameters
    ----------
    mass : float
        Mass in kg.
    inertia : float
        Moment of inertia in kg m2 about a transverse axis through the centre of gravity.
    centre : float, optional
        Distance of the centre of gravity in m from the tip-side end of the part.

    Raises
    ------
    ValueError, TypeError
        A mass or an inertia that is not positive.

    Examples
    --------
    >>> from receptance.coupling import Body
    >>> Body(mass=4.5, inertia=0.01, centre=0.5).position(0.25)
    0.25
    """

    mass: float
    inertia: float
    centre: float = 0.0

    def __post_init__(self) -> None:
        mass = _checks.positive("Body", "mass", self.mass, unit="kg")
        inertia = _checks.positive("Body", "inertia", self.inertia, unit="kg m2")
        centre = _checks.number("Body", "centre", self.centre, unit="m")
        _checks.set_fields(self, {"mass": mass, "inertia": inertia, "centre": centre})

    def position(self, x: float) -> float:
        """Distance z in m from the centre of gravity towards the tip of a point x m from the tip-side end."""
        return self.centre - x


def as_rigid(part: Part) -> Part:
    """Return a part of the same mass that is rigid to nine digits.

    Examples
    --------
    >>> from receptance import STEEL, Part, Segment
    >>> from receptance.coupling import as_rigid
    >>> rod = as_rigid(Part([Segment(length=0.2, outer_diameter=0.02, material=STEEL)], name="rod"))
    >>> rod.segments[0].material.youngs_modulus / STEEL.youngs_modulus
    1000000000.0
    """
    stiff = [
        replace(
            segment,
            material=replace(segment.material, youngs_modulus=_RIGID * segment.material.youngs_modulus),
            core=segment.core and replace(segment.core, youngs_modulus=_RIGID * segment.core.youngs_modulus),
        )
        for segment in part.segments
    ]
    return Part(stiff, name=part.name)


_NODES, _HALVES = np.polynomial.legendre.leggauss(3)
_SHARES, _WEIGHTS = (0.5 + 0.5 * _NODES).tolist(), (0.5 * _HALVES).tolist()
"""Points and weights of the quadrature over a segment, as shares of its length."""


def body_of(part: Part) -> Body:
    """Return mass, centre of gravity and moment of inertia of a rigid part.

    With the mass per length m'(x) and the radius of gyration r(x) of the sections the inertia is the integral of
    m' (r^2 + (x - centre)^2). Diameters are linear along a segment, so the integrands are polynomials of at most the
    fourth degree, which Gauss-Legendre quadrature with three points integrates exactly. Cores are included, and a
    section that is not a circle is that in the plane y.

    Examples
    --------
    >>> from receptance import STEEL, Part, Segment
    >>> from receptance.coupling import body_of
    >>> rod = Part([Segment(length=0.2, outer_diameter=0.02, material=STEEL)])
    >>> round(body_of(rod).centre, 9)
    0.1
    """
    masses, places, inertias = [], [], []
    start = 0.0
    for segment in part.segments:
        core = segment.core.density if segment.core else 0.0
        ring = segment.material.density
        area, second_moment = 1.0, 1.0
        if segment.shape is not None:
            factors = segment.shape.factors("y", segment.shear)
            area, second_moment = factors[0], factors[2]
        for share, weight in zip(_SHARES, _WEIGHTS, strict=True):
            outer, inner = (diameter**2 for diameter in segment.at(share))
            length = weight * segment.length
            masses.append(length * np.pi / 4.0 * (ring * (area * outer - inner) + core * inner))
            inertias.append(length * np.pi / 64.0 * (ring * (second_moment * outer**2 - inner**2) + core * inner**2))
            places.append(start + share * segment.length)
        start += segment.length
    mass = float(sum(masses))
    centre = float(np.dot(masses, places)) / mass
    inertia = float(sum(inertias) + np.dot(masses, np.subtract(places, centre) ** 2))
    return Body(mass=mass, inertia=inertia, centre=centre)


Interval = tuple[float, float]


@dataclass(frozen=True, kw_only=True)
class RadialSolution:
    """A joint with the two given frequencies."""

    joint: RadialJoint
    """Stiffnesses from the undamped equations; dampings from phi^T C phi = 2 zeta w m, to first order in zeta."""
    exact: RadialJoint | None
    """Stiffnesses and dampings from the complex eigenvalues; None if Newton's method from `joint` does not converge."""
    intervals: dict[str, Interval]
    """Intervals of k_x1 and k_x2 (and of c_x1 and c_x2, to first order) if standard errors are given."""
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class RadialSolutions:
    """Solutions for the stiffnesses of two springs from two natural frequencies."""

    solutions: tuple[RadialSolution, ...]
    """Two solutions; one if a mode shape decides; none if no real joint has these frequencies."""
    discriminant: float
    """Discriminant of the quadratic over (w1^2 + w2^2)^2, negative if no real joint has these frequencies."""
    discriminant_standard_error: float
    """NaN without standard errors of the frequencies."""
    within_noise: dict[str, Interval]
    """Without a solution: ranges of the stiffnesses of joints whose frequencies are within the noise."""
    nearest: int | None
    """Index of the solution whose mode shape is nearest to the measured one, even if the choice is uncertain; None
    without a solution, or with two solutions and no shape."""
    statement: str
    """The result in a sentence."""
    of_neither: bool = False
    """Whether the measured mode shape agrees with neither solution."""


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
        Positions of the springs, in m from the centre of gravity towards the tip.
    frequency_hz, damping_ratio : array_like
        `(2,)` natural frequencies in Hz, ascending, and damping ratios of the two modes.
    frequency_standard_error_hz, damping_standard_error : array_like, optional
        `(2,)` independent standard errors, from which the intervals follow.
    shape : Shape, optional
        Ratio of the motions at two points, which distinguishes the two joints.
    level : float, optional
        Confidence level of the intervals.

    Returns
    -------
    RadialSolutions
        Intervals of stiffness contain all joints whose frequencies lie within the ellipse around the given ones that
        has this level for any single quantity. They account for the double root of the quadratic: if the ellipse
        reaches it, both solutions have the same interval.

    Raises
    ------
    ValueError, TypeError
        Frequencies that are not two ascending numbers, or springs at the same position.

    References
    ----------
    Xu et al., Dynamic modeling and parameters identification of a spindle-holder taper joint, Springer 2012,
    figure 6 and eqs. 1 to 11.

    Examples
    --------
    >>> from receptance.coupling import Body, RadialJoint, radial_from_modes
    >>> body = Body(mass=4.5, inertia=0.01)
    >>> true = RadialJoint(body=body, z1=0.02, z2=-0.08, k_x1=1e9, k_x2=5e8)
    >>> solutions = radial_from_modes(body, 0.02, -0.08, true.undamped_modes().frequency_hz)
    >>> [f"{s.joint.k_x1:.3g} and {s.joint.k_x2:.3g} N/m" for s in solutions.solutions]
    ['1.64e+09 and 3.04e+08 N/m', '1e+09 and 5e+08 N/m']
    """
    f = _pair("frequency_hz", frequency_hz, positive=True)
    zeta = _pair("damping_ratio", damping_ratio)
    f_error, zeta_error = (
        None if values is None else _pair(name, values)
        for name, values in (
            ("frequency_standard_error_hz", frequency_standard_error_hz),
            ("damping_standard_error", damping_standard_error),
        )
    )
    if not f[0] < f[1]:
        raise ValueError(f"radial_from_modes: frequency_hz is {f.tolist()}, expected two ascending frequencies")
    owner = "radial_from_modes"
    equations = _Equations(body, _checks.number(owner, "z1", z1, unit="m"), _checks.number(owner, "z2", z2, unit="m"))
    multiplier = confidence_multiplier(level, None)
    discriminant, slope = equations.discriminant(f)
    error = float("nan") if f_error is None else float(np.hypot(*(slope * f_error)))
    ellipse = None if f_error is None else equations.stiffnesses_in_ellipse(f, multiplier * f_error)
    solutions: list[RadialSolution] = []
    within_noise: dict[str, Interval] = {}
    for branch, (k1, k2) in enumerate(equations.stiffnesses(f) if discriminant >= 0.0 else ()):
        joint, notes = equations.damped(k1, k2, f, zeta)
        intervals: dict[str, Interval] = {}
        if ellipse is not None:
            # If the noise reaches the double root, the two solutions are connected there.
            connected = np.isnan(ellipse).any()
            intervals = _stiffness_ranges(ellipse.reshape(-1, 2) if connected else ellipse[branch])
        if f_error is not None and zeta_error is not None:
            intervals |= equations.damping_intervals(branch, f, zeta, multiplier * f_error, multiplier * zeta_error)
        exact = equations.exact(joint, f, zeta)
        solutions.append(RadialSolution(joint=joint, exact=exact, intervals=intervals, notes=notes))
    nearest, of_neither = None, False
    text = "2 joints have these frequencies; measure a mode shape at two points to choose between them"
    if discriminant < 0.0:
        within_noise, text = _without_solution(ellipse, level)
    elif discriminant == 0.0:
        solutions, nearest = solutions[:1], 0
        text = "one joint has these frequencies: the quadratic has a double root"
    elif shape is not None:
        nearest, selected, of_neither, text = _compare_shapes([solution.joint for solution in solutions], shape)
        if selected:
            solutions, nearest = [solutions[nearest]], 0
    return RadialSolutions(
        solutions=tuple(solutions),
        discriminant=discriminant,
        discriminant_standard_error=error,
        within_noise=within_noise,
        nearest=nearest,
        statement=text,
        of_neither=of_neither,
    )


def _pair(name: str, values: ArrayLike, *, positive: bool = False) -> NDArray[np.float64]:
    pair = _checks.unmasked("radial_from_modes", name, values, np.float64)
    if pair.shape != (2,) or not np.isfinite(pair).all() or (positive and np.any(pair <= 0.0)):
        kind = "positive " if positive else ""
        raise ValueError(f"radial_from_modes: {name} is {values!r}, expected two {kind}finite numbers")
    return pair


def _stiffness_ranges(stiffnesses: NDArray[np.float64]) -> dict[str, Interval]:
    low, high = np.nanmin(stiffnesses, axis=0), np.nanmax(stiffnesses, axis=0)
    return {name: (float(low[i]), float(high[i])) for i, name in enumerate(("k_x1", "k_x2"))}


def _without_solution(ellipse: NDArray[np.float64] | None, level: float) -> tuple[dict[str, Interval], str]:
    """Return the ranges of stiffness within the noise, if there are any, and the result in a sentence."""
    if ellipse is None:
        return {}, "no real joint has these frequencies; give their standard errors to see whether noise explains this"
    if np.isnan(ellipse).all():
        return {}, (
            f"no real joint has these frequencies, not even within their noise at {100 * level:g} %: the holder is not "
            "rigid, or its mass, its inertia or the positions of the springs are wrong"
        )
    within_noise = _stiffness_ranges(ellipse.reshape(-1, 2))
    ranges = ", ".join(f"{name} from {low:.3g} to {high:.3g} N/m" for name, (low, high) in within_noise.items())
    return within_noise, f"no real joint has exactly these frequencies; joints within the noise have {ranges}"


class _Equations:
    """Equations between springs and modes for a body and two positions."""

    def __init__(self, body: Body, z1: float, z2: float) -> None:
        if z1 == z2:
            raise ValueError(f"radial_from_modes: z1 and z2 are both {z1:g} m, expected two positions")
        self.body, self.z1, self.z2 = body, z1, z2
        self.a = np.array([1.0 / body.mass + z * z / body.inertia for z in (z1, z2)])
        self.b = (z1 - z2) ** 2 / (body.mass * body.inertia)
        # a1 a2 / b - 1, written as a square to avoid a difference of nearly equal numbers.
        gyration = np.sqrt(body.inertia / body.mass)
        self.excess = ((gyration + z1 * z2 / gyration) / (z1 - z2)) ** 2

    def discriminant(self, f: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        """Return the relative discriminant and its derivatives with respect to the frequencies."""
        x, y = f[0] ** 2, f[1] ** 2
        value = ((y - x) ** 2 - 4.0 * self.excess * x * y) / (x + y) ** 2
        # d/dx of (y - x)^2 - 4 g x y over (x + y)^2; the ratio is of degree zero, so x d/dx = -y d/dy.
        log_slope = -4.0 * (1.0 + self.excess) * x * y * (y - x) / (x + y) ** 3
        return float(value), np.array([2.0 * log_slope / f[0], -2.0 * log_slope / f[1]])

    def stiffnesses(self, f: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the stiffnesses `(2 solutions, ..., 2)` for frequencies `(2, ...)`; NaN without a solution."""
        x, y = (2.0 * np.pi * f[0]) ** 2, (2.0 * np.pi * f[1]) ** 2
        radicand = (y - x) ** 2 - 4.0 * self.excess * x * y
        with np.errstate(invalid="ignore"):
            large = 0.5 * (x + y + np.sqrt(radicand))
        small = (1.0 + self.excess) * x * y / large
        roots = ((large, small), (small, large))
        return np.array([np.stack([first / self.a[0], second / self.a[1]], -1) for first, second in roots])

    def stiffnesses_in_ellipse(self, f: NDArray[np.float64], half_axes: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the stiffnesses `(2, n, 2)` for frequencies in the ellipse with these half axes."""
        radius, angle = np.meshgrid(np.linspace(0.0, 1.0, 41), np.linspace(0.0, 2.0 * np.pi, 241))
        circle = np.stack([(radius * np.cos(angle)).ravel(), (radius * np.sin(angle)).ravel()])
        return self.stiffnesses(f[:, None] + half_axes[:, None] * circle)

    def damped(
        self, k1: float, k2: float, f: NDArray[np.float64], zeta: NDArray[np.float64]
    ) -> tuple[RadialJoint, tuple[str, ...]]:
        """Return the joint with dampings from phi^T C phi = 2 zeta w m, to first order, and notes."""
        joint = RadialJoint(body=self.body, z1=self.z1, z2=self.z2, k_x1=float(k1), k_x2=float(k2))
        shapes = joint.undamped_modes().shapes.real
        motion = shapes[0][:, None] + shapes[1][:, None] * np.array([self.z1, self.z2])
        c1, c2 = np.linalg.solve(motion**2, 4.0 * np.pi * zeta * f)
        negative = [name for name, value in (("c_x1", c1), ("c_x2", c2)) if value < 0.0]
        notes = tuple(
            f"{name} is negative: with these springs no dashpots give these damping ratios" for name in negative
        )
        return replace(joint, c_x1=float(c1), c_x2=float(c2)), notes

    def exact(self, start: RadialJoint, f: NDArray[np.float64], zeta: NDArray[np.float64]) -> RadialJoint | None:
        """Return the joint whose complex eigenvalues are those of the two modes, by Newton's method, or None.

        The coefficients of the characteristic polynomial are A C, A K + B C1 C2, B (K1 C2 + K2 C1) and B K1 K2.
        """
        unit = 2.0 * np.pi * float(np.sqrt(f[0] * f[1]))
        w = 2.0 * np.pi * f / unit
        target = np.array(
            [
                2.0 * (zeta @ w),
                w @ w + 4.0 * zeta[0] * zeta[1] * w[0] * w[1],
                2.0 * w[0] * w[1] * (zeta[0] * w[1] + zeta[1] * w[0]),
                (w[0] * w[1]) ** 2,
            ]
        )
        # Units of stiffness and damping in which A is one.
        b = self.b / (self.a[0] * self.a[1])
        scale = np.concatenate([unit**2 / self.a, unit / self.a])
        x = np.array([start.k_x1, start.k_x2, start.c_x1, start.c_x2]) / scale
        for _ in range(50):
            k1, k2, c1, c2 = x
            residual = np.array([c1 + c2, k1 + k2 + b * c1 * c2, b * (k1 * c2 + k2 * c1), b * k1 * k2]) - target
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
            # Rounding may prevent full convergence; a larger step means that there is no solution.
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
        f_half_width: NDArray[np.float64],
        zeta_half_width: NDArray[np.float64],
    ) -> dict[str, Interval]:
        """Return intervals of the dampings, to first order in all four errors."""

        def dampings(change: NDArray[np.float64]) -> NDArray[np.float64]:
            frequency_hz = f + change[:2]
            k1, k2 = self.stiffnesses(frequency_hz)[branch]
            if not np.isfinite(k1 + k2):
                return np.full(2, np.nan)
            joint, _ = self.damped(k1, k2, frequency_hz, zeta + change[2:])
            return np.array([joint.c_x1, joint.c_x2])

        steps = 1e-3 * np.concatenate([f_half_width, zeta_half_width])
        slopes = [(dampings(e * steps) - dampings(-e * steps)) / 2e-3 for e in np.eye(4)]
        half_width = np.sqrt(np.sum(np.square(slopes), axis=0))
        if not np.isfinite(half_width).all():
            return {}
        value = dampings(np.zeros(4))
        low, high = (value - half_width).tolist(), (value + half_width).tolist()
        return {"c_x1": (low[0], high[0]), "c_x2": (low[1], high[1])}


_CLEAR = 10.83
"""Difference of the squared distances in standard errors from which one joint is selected: p = 0.001."""
_IMPOSSIBLE = 27.6
"""Squared distance of two angles from which the shape contradicts a joint: p = 1e-6."""


@dataclass(frozen=True, kw_only=True)
class Shape:
    """Ratio of the motions at two points of the holder in both modes.

    Parameters
    ----------
    first, second : float
        Positions z of the points in m from the centre of gravity towards the tip.
    ratio : tuple of complex
        Ratio of the modal constants at the first and at the second point of each mode, for the same hit.
    standard_error : tuple of float, optional
        Standard error of the real and of the imaginary part of each ratio.

    Raises
    ------
    ValueError
        The points are equal, so the ratio is 1 for every joint.
    """

    first: float
    second: float
    ratio: tuple[complex, complex]
    standard_error: tuple[float, float] | None = None

    def __post_init__(self) -> None:
        if self.first == self.second:
            raise ValueError(f"Shape: first and second are both {self.first:g} m, expected two points")


def _compare_shapes(joints: Sequence[RadialJoint], shape: Shape) -> tuple[int, bool, bool, str]:
    """Return the index of the joint with the nearer shape, whether it is selected or both are rejected, and the reason.

    Shapes are compared by the angle atan(ratio), which is regular for a node at either point.
    """
    measured = np.array(shape.ratio)
    ratios = [joint.undamped_modes().ratio(shape.first, shape.second).real for joint in joints]
    angles = np.arctan(measured.real) - np.arctan(ratios)
    errors = np.ones(2) if shape.standard_error is None else np.array(shape.standard_error) / (1.0 + measured.real**2)
    distances = np.sum(((np.mod(angles + 0.5 * np.pi, np.pi) - 0.5 * np.pi) / errors) ** 2, axis=1)
    best = int(np.argmin(distances))
    first, *calculated = (", ".join(f"{value:.2f}" for value in ratio) for ratio in (measured.real, *ratios))
    subject, both = f"the mode shape ({first})", f"({calculated[0]} and {calculated[1]})"
    if shape.standard_error is not None and distances[1 - best] - distances[best] < _CLEAR:
        return best, False, False, f"{subject} does not decide between the joints {both}"
    if shape.standard_error is not None and distances[best] > _IMPOSSIBLE:
        text = (
            f"{subject} contradicts both joints {both}, by at least {np.sqrt(distances[best]):.0f} standard errors: "
            "this is not a rigid holder on two springs"
        )
        return best, False, True, text
    return best, True, False, f"{subject} selects the joint with {calculated[best]}, not {calculated[1 - best]}"


@dataclass(frozen=True, kw_only=True)
class AxialSolution:
    """Axial stiffness in N/m and damping in N s/m of the taper, with intervals if standard errors are given."""

    k_z1: float
    c_z1: float
    intervals: dict[str, Interval]


def axial_from_mode(
    body: Body,
    frequency_hz: float,
    damping_ratio: float = 0.0,
    *,
    frequency_standard_error_hz: float | None = None,
    damping_standard_error: float | None = None,
    level: float = 0.95,
) -> AxialSolution:
    """Return stiffness and damping of a rigid holder along its axis: K = m (2 pi f)^2, C = 4 pi m f zeta (eqs. 14, 15).

    Raises
    ------
    ValueError
        A frequency that is not positive; a damping ratio below 0 or not below 1.

    Examples
    --------
    >>> from receptance.coupling import Body, axial_from_mode
    >>> joint = axial_from_mode(Body(mass=4.5, inertia=0.01), 5250.0, 0.005)
    >>> f"{joint.k_z1:.4g} N/m, {joint.c_z1:.0f} N s/m"
    '4.897e+09 N/m, 1484 N s/m'
    """
    f = _checks.positive("axial_from_mode", "frequency_hz", frequency_hz, unit="Hz")
    zeta = _checks.not_negative("axial_from_mode", "damping_ratio", damping_ratio)
    if zeta >= 1.0:
        raise ValueError(f"axial_from_mode: damping_ratio is {zeta:g}, expected less than 1")
    w = 2.0 * np.pi * f
    k, c = body.mass * w**2, 2.0 * body.mass * w * zeta
    intervals: dict[str, Interval] = {}
    multiplier = confidence_multiplier(level, None)
    if frequency_standard_error_hz is not None:
        share = multiplier * frequency_standard_error_hz / f
        intervals["k_z1"] = (k * (1.0 - share) ** 2, k * (1.0 + share) ** 2)
        if damping_standard_error is not None:
            half_width = float(np.hypot(c * share, 2.0 * body.mass * w * multiplier * damping_standard_error))
            intervals["c_z1"] = (c - half_width, c + half_width)
    return AxialSolution(k_z1=k, c_z1=c, intervals=intervals)
