"""Joints between parts (point joints, collets, joints in micro-slip) and point elements on parts."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import Annotated, Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from receptance import _checks, _core, units
from receptance.model.fields import AttachedPart, AttachedPosition, Count, Element, Member, Name, Number, Numbers


@dataclass(frozen=True, kw_only=True)
class _Spring(Element):
    """A full symmetric complex spring with two degrees of freedom."""

    k_y: Annotated[float, Number(units.STIFFNESS, "translational stiffness")] = 0.0
    k_theta: Annotated[float, Number(units.ROTATIONAL_STIFFNESS, "rotational stiffness")] = 0.0
    k_ytheta: Annotated[float, Number(units.COUPLING_STIFFNESS, "coupling stiffness; k_ytheta^2 <= k_y k_theta")] = 0.0
    c_y: Annotated[float, Number(units.DAMPING, "translational viscous damping")] = 0.0
    c_theta: Annotated[float, Number(units.ROTATIONAL_DAMPING, "rotational viscous damping")] = 0.0
    c_ytheta: Annotated[float, Number(units.COUPLING_DAMPING, "coupling damping; c_ytheta^2 <= c_y c_theta")] = 0.0
    loss_factor: Annotated[float, Number(units.LOSS_FACTOR, "hysteretic loss factor of the stiffnesses")] = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        for kind, part in (("k", "real"), ("c", "imaginary")):
            limit = math.sqrt(getattr(self, f"{kind}_y") * getattr(self, f"{kind}_theta"))
            value = getattr(self, f"{kind}_ytheta")
            if abs(value) > limit * (1.0 + 1e-12):
                raise ValueError(
                    f"{self.owner}: {kind}_ytheta is {value:g}, expected a size of at most sqrt({kind}_y {kind}_theta) "
                    f"= {limit:g}: the {part} part of the stiffness must be positive semidefinite"
                )

    def stiffness(self, frequency_hz: ArrayLike) -> NDArray[np.complex128]:
        """Return the dynamic stiffness K = (1 + i loss_factor) k + i w c, `(n, 2, 2)` over (y, theta)."""
        lines = _core.Lines(_checks.frequencies(frequency_hz), math.tau)
        columns = np.array(self.columns[: len(_Spring.columns_of)])
        return _core.joint_stiffness(columns, lines)[:, [[0, 2], [2, 1]]]


@dataclass(frozen=True, kw_only=True)
class PointJoint(_Spring):
    """A joint at a point: full, symmetric, complex stiffness between two facing ends.

    The stiffness is K(w) = (1 + i loss_factor) [[k_y, k_ytheta], [k_ytheta, k_theta]]
    + i w [[c_y, c_ytheta], [c_ytheta, c_theta]]; it enters receptance coupling as K^-1 in series with the two
    ends (Matthias et al. 2016, eqs. 2 and 3, where the off-diagonal terms are zero). A joint at a distance e further
    along x has k_ytheta = k_y e and k_theta + k_y e^2.

    Parameters
    ----------
    {fields}

    Raises
    ------
    ValueError
        A negative or not finite value, an indefinite matrix, or no stiffness and damping along y. Assemblies in
        bending and collets also require those of the rotation; axial motion has none.

    Examples
    --------
    >>> from receptance import PointJoint
    >>> joint = PointJoint(k_y=3.5e8, k_theta=4.0e4, c_theta=0.01)
    >>> joint.stiffness([1000.0]).shape
    (1, 2, 2)
    """

    name: Name = field(default="", compare=False)

    role = "joint"

    def __post_init__(self) -> None:
        super().__post_init__()
        self._check_held("y", "translation")

    def check_motion(self, motion: str) -> None:
        """Raise if the joint leaves a direction free that a motion has; rods have no rotation."""
        if motion == "bending":
            self._check_held("theta", "rotation")

    def _check_held(self, direction: str, kind: str) -> None:
        if getattr(self, f"k_{direction}") == 0.0 and getattr(self, f"c_{direction}") == 0.0:
            raise ValueError(
                f"{self.owner}: k_{direction} and c_{direction} are both zero, so the {kind} is free and the interface "
                f"is singular; give k_{direction} or c_{direction}"
            )

    def moved(self, distance: float) -> PointJoint:
        """Return the joint that acts at a point `distance` (m) further along x, expressed at the present point.

        K' = T^T K T with T = [[1, e], [0, 1]], for stiffness and damping alike.
        """
        e = _checks.number(self.owner, "distance", distance, unit="m")
        changed: dict[str, Any] = {name: getattr(self, name) for name in self.columns_of}
        for kind in "kc":
            y, both = changed[f"{kind}_y"], changed[f"{kind}_ytheta"]
            changed[f"{kind}_theta"] += 2.0 * e * both + e * e * y
            changed[f"{kind}_ytheta"] = both + e * y
        return PointJoint(**changed, name=self.name)


@dataclass(frozen=True, kw_only=True)
class GroundSpring(_Spring):
    """A spring and dashpot from a point or a length of a part to ground.

    Parameters
    ----------
    {fields}

    Raises
    ------
    ValueError
        As `PointJoint`; a length at the end of the part, and weights that are negative or all zero.

    Examples
    --------
    >>> from receptance import GroundSpring
    >>> GroundSpring(k_y=1e7, part="holder", position="end").k_y
    10000000.0
    """

    part: AttachedPart = ""
    position: AttachedPosition = 0.0
    length: Annotated[
        float,
        Number(
            units.LENGTH_OR_ZERO,
            "length over which the total spring is distributed; 0 for a point",
            parameter=False,
        ),
    ] = 0.0
    points: Annotated[int, Count("number of points, in the middles of equal parts of the length")] = 8
    weights: Annotated[
        tuple[float, ...], Numbers("relative weights of the points, from the tip on; by default equal")
    ] = ()
    name: Name = field(default="", compare=False)

    role = "ground"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.length > 0.0 and self.position == "end":
            raise ValueError(
                f'{self.owner}: position is "end" and length {self.length:g} m, expected a position before the end'
            )
        numbered = enumerate(self.weights)
        weights = tuple(_checks.not_negative(self.owner, f"weights[{i}]", value) for i, value in numbered)
        if weights and sum(weights) == 0.0:
            raise ValueError(f"{self.owner}: weights are all zero, expected at least one above zero")
        _checks.set_fields(self, {"weights": weights, "points": len(weights) or self.points})

    @property
    def offsets(self) -> tuple[float, ...]:
        """Distances in m from the position to the points at which it acts."""
        if self.length == 0.0:
            return (0.0,)
        return tuple(self.length * (i + 0.5) / self.points for i in range(self.points))

    @property
    def shares(self) -> tuple[float, ...]:
        """Shares of the points in the total spring."""
        if self.length == 0.0:
            return (1.0,)
        weights = self.weights or (1.0,) * self.points
        return tuple(weight / sum(weights) for weight in weights)


@dataclass(frozen=True, kw_only=True)
class PointMass(Element):
    """A rigid mass at a point of a part.

    Parameters
    ----------
    {fields}

    Examples
    --------
    >>> from receptance import PointMass
    >>> sensor = PointMass(mass=0.6e-3, name="sensor")
    """

    mass: Annotated[float, Number(units.MASS, "mass")]
    inertia: Annotated[float, Number(units.INERTIA, "moment of inertia about its centre in the plane of bending")] = 0.0
    part: AttachedPart = ""
    position: AttachedPosition = 0.0
    name: Name = field(default="", compare=False)

    role = "mass"
    offsets: ClassVar[tuple[float, ...]] = (0.0,)


@dataclass(frozen=True, kw_only=True)
class Resonator(Element):
    """A mass on a spring and a dashpot at a point of a part.

    It represents one mode of a structure that is not modelled, or a vibration absorber. It acts on the translation of
    its point, with the dynamic stiffness -w^2 mass k / (k - w^2 mass), k = k_y + i w c_y (Den Hartog, Mechanical
    Vibrations, 4th edition 1956, section 3.3).

    Parameters
    ----------
    {fields}

    Examples
    --------
    >>> import numpy as np
    >>> from receptance import STEEL, Assembly, Part, Resonator, Segment
    >>> bar = Part([Segment(length=0.2, outer_diameter=0.02, material=STEEL)], name="bar")
    >>> absorber = Resonator(mass=0.02, k_y=0.02 * (2.0 * np.pi * 800.0) ** 2, c_y=1.0)
    >>> Assembly([bar], [absorber]).natural_frequencies(3e3).round(0)
    array([ 851., 2269.])
    """

    mass: Annotated[float, Number(units.MASS, "mass")]
    k_y: Annotated[float, Number(units.SPRING_STIFFNESS, "stiffness")]
    c_y: Annotated[float, Number(units.DAMPING, "viscous damping")] = 0.0
    part: AttachedPart = ""
    position: AttachedPosition = 0.0
    name: Name = field(default="", compare=False)

    role = "resonator"
    offsets: ClassVar[tuple[float, ...]] = (0.0,)


@dataclass(frozen=True, kw_only=True)
class ColletJoint(Element):
    """A collet: springs from tool to collet and from collet to holder, with the mass of the collet between them.

    Without mass the dynamic stiffnesses are in series, K = (K_inner^-1 + K_outer^-1)^-1, which for each of k_y and
    k_theta alone is k1 k2 / (k1 + k2) (Matthias et al. 2016, eq. 15). A single assembly then determines K only;
    assemblies in which one of the springs changes (by insertion length or tightening torque) determine both.

    Parameters
    ----------
    {fields}

    Raises
    ------
    TypeError, ValueError
        Springs that are not a `PointJoint`, a negative mass or inertia.

    Examples
    --------
    >>> from receptance import CARBIDE, STEEL, Assembly, ColletJoint, Part, PointJoint, Segment
    >>> tool = Part([Segment(length=0.0623, outer_diameter=0.0127, material=CARBIDE)], name="tool")
    >>> holder = Part([Segment(length=0.129, outer_diameter=0.045, material=STEEL)], name="holder")
    >>> collet = ColletJoint(
    ...     inner=PointJoint(k_y=9e8, k_theta=1.5e5), outer=PointJoint(k_y=2.1e9, k_theta=3e5), mass=0.15, name="collet"
    ... )
    >>> assembly = Assembly([tool, collet, holder])
    >>> assembly.natural_frequency_derivatives(8e3, ["collet.inner.k_y", "collet.mass"])[0].round(0)
    array([2560.])
    """

    inner: Annotated[
        PointJoint, Member(PointJoint, "spring between the part before it (the tool) and the collet", prefix="inner.")
    ]
    outer: Annotated[
        PointJoint, Member(PointJoint, "spring between the collet and the part behind it (the holder)", prefix="outer.")
    ]
    mass: Annotated[float, Number(units.MASS, "mass of the collet, a rigid body at a point")] = 0.0
    inertia: Annotated[float, Number(units.INERTIA, "moment of inertia about its centre in the plane of bending")] = 0.0
    name: Name = field(default="", compare=False)

    role = "joint"

    def __post_init__(self) -> None:
        super().__post_init__()
        for side in ("inner", "outer"):
            getattr(self, side).check_motion("bending")
        # Addresses use the name of the field.
        _checks.set_fields(self, {side: replace(getattr(self, side), name="") for side in ("inner", "outer")})

    def stiffness(self, frequency_hz: ArrayLike) -> NDArray[np.complex128]:
        """Return the dynamic stiffness `(n, 2, 2)` over (y, theta) of both springs in series, without the mass.

        Raises
        ------
        ValueError
            Unusable lines.
        """
        inner, outer = self.inner.stiffness(frequency_hz), self.outer.stiffness(frequency_hz)
        # K1 (K1 + K2)^-1 K2 is accurate if K1 or K2 is nearly singular.
        result: NDArray[np.complex128] = inner @ np.linalg.solve(inner + outer, outer)
        return result


def largest_share(exponent: float) -> float:
    """Return the share of the stiffness that is lost at the onset of gross slip.

    At this amplitude a the slope of the backbone f(u) = k u (1 - c u^p) is zero: c (1+p) a^p = 1.
    """
    return 8.0 / math.pi * _sine_integral(exponent) / (2.0 + exponent)


def loss_ratio(exponent: float) -> float:
    """Return the loss stiffness over the lost stiffness, p / (2 (1+p) I_p); 4 / (3 pi) for p = 1."""
    return exponent / (2.0 * (1.0 + exponent) * _sine_integral(exponent))


def _sine_integral(exponent: float) -> float:
    """Return I_p, the integral of sin^(2+2p) from 0 to pi/2."""
    return 0.5 * math.sqrt(math.pi) * math.exp(math.lgamma(exponent + 1.5) - math.lgamma(exponent + 2.0))


@dataclass(frozen=True, kw_only=True)
class MicroslipJoint(_Spring):
    """A joint in micro-slip: the sliding share of the interface grows with the amplitude.

    Each direction is an Iwan element of power-law distribution, whose loop follows Masing's rules from the backbone
    f(u) = k u (1 - c u^p) (Iwan 1966; Segalman 2005). Its first harmonic under a motion of amplitude a is the complex
    stiffness

        K(a) = k (1 + i loss_factor) - k s l^p (1 - i beta_p) + i w c,        l = a / a_ref

    so the number s determines both the loss of stiffness and the damping: beta_p is 4/(3 pi) for p = 1. The level l is
    either given (`level`, one value for a hammer record), or computed on each line from the force of a stepped sine;
    see `Assembly.receptance`.

    Parameters
    ----------
    {fields}

    Raises
    ------
    ValueError
        As `PointJoint`; an exponent out of range, or a level at gross slip (a lost share of 1/2 for p = 1), beyond
        which the model is not valid.

    Examples
    --------
    >>> from receptance import MicroslipJoint
    >>> joint = MicroslipJoint(k_y=5e8, k_theta=1e5, slip_theta=0.1, level=2.0)
    >>> joint.stiffness([1000.0])[0, 1, 1].round(1)
    np.complex128(80000+8488.3j)
    """

    slip_y: Annotated[float, Number(units.SHARE, "share s of k_y that is lost at the level 1")] = 0.0
    slip_theta: Annotated[float, Number(units.SHARE, "share s of k_theta that is lost at the level 1")] = 0.0
    exponent: Annotated[
        float,
        Number(
            units.EXPONENT,
            "exponent p of the lost share over the level; with 1 the loss per cycle grows with the third power of the "
            "amplitude, and most bolted and clamped joints have a smaller exponent",
        ),
    ] = 1.0
    level: Annotated[
        float,
        Number(
            units.LEVEL,
            "amplitude of the joint's motion over the reference, unless a force is given; 0 for small amplitudes",
        ),
    ] = 0.0
    reference_y: Annotated[
        float, Number(units.AMPLITUDE, "amplitude of the relative motion at the level 1; needed with a given force")
    ] = 0.0
    reference_theta: Annotated[
        float, Number(units.ANGLE, "amplitude of the relative rotation at the level 1; needed with a given force")
    ] = 0.0
    reference_force: Annotated[
        float | None,
        Number(
            units.FORCE,
            "force that is the level 1, where measurements give their `level` as a force",
            parameter=False,
        ),
    ] = None
    name: Name = field(default="", compare=False)

    role = "joint"
    amplitude_of: ClassVar[tuple[str, ...]]
    """Names of its parameters beyond those of a `PointJoint`."""

    def __post_init__(self) -> None:
        super().__post_init__()
        owner = self.owner
        most = largest_share(self.exponent)
        for direction, share in zip(("y", "theta"), self.shares, strict=True):
            if getattr(self, f"k_{direction}") == 0.0:
                raise ValueError(f"{owner}: k_{direction} is zero, expected a positive stiffness for slip")
            if share > most:
                raise ValueError(
                    f"{owner}: the level {self.level:g} reduces k_{direction} by a share of {share:.3g}, expected at "
                    f"most {most:.3g}, the onset of gross slip"
                )
        y, theta = (1.0 - share for share in self.shares)
        if self.k_ytheta**2 > self.k_y * y * self.k_theta * theta * (1.0 + 1e-12):
            raise ValueError(
                f"{owner}: k_ytheta is {self.k_ytheta:g}, expected at most sqrt(k_y k_theta) of the stiffnesses at the "
                f"level {self.level:g}, {math.sqrt(self.k_y * y * self.k_theta * theta):g}"
            )

    @property
    def shares(self) -> tuple[float, float]:
        """Shares of k_y and of k_theta that are lost at the stated level."""
        power = self.level**self.exponent
        return self.slip_y * power, self.slip_theta * power

    @property
    def added(self) -> NDArray[np.complex128]:
        """Change of the complex stiffness in y and in theta by slip at the stated level, `(2,)`."""
        factor = -(1.0 - 1j * loss_ratio(self.exponent))
        result: NDArray[np.complex128] = factor * np.array(self.shares) * np.array([self.k_y, self.k_theta])
        return result

    def stiffness(self, frequency_hz: ArrayLike) -> NDArray[np.complex128]:
        """Return the dynamic stiffness `(n, 2, 2)` over (y, theta) at the stated level."""
        result = super().stiffness(frequency_hz)
        result[:, [0, 1], [0, 1]] += self.added
        return result


MicroslipJoint.amplitude_of = MicroslipJoint.columns_of[len(PointJoint.columns_of) :]
