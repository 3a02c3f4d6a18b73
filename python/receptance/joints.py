"""Joints between parts and point elements on them."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from receptance import _checks, units
from receptance.fields import Count, Element, Field, Number

__all__ = ["GroundSpring", "PointJoint", "PointMass", "Resonator"]

Position = float | Literal["end"]


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
        self.check()
        for kind, part in (("k", "real"), ("c", "imaginary")):
            limit = math.sqrt(getattr(self, f"{kind}_y") * getattr(self, f"{kind}_theta"))
            value = getattr(self, f"{kind}_ytheta")
            if abs(value) > limit * (1.0 + 1e-12):
                raise ValueError(
                    f"{self.owner}: {kind}_ytheta is {value:g}, expected a size of at most sqrt({kind}_y {kind}_theta) "
                    f"= {limit:g}: the {part} part of the stiffness must be positive semidefinite"
                )

    def stiffness(self, frequency_hz: ArrayLike) -> NDArray[np.complex128]:
        """Dynamic stiffness K = (1 + i loss_factor) k + i w c, shape `(n, 2, 2)` over (y, theta)."""
        w = 2.0 * np.pi * _checks.frequencies(frequency_hz)
        k = np.array([[self.k_y, self.k_ytheta], [self.k_ytheta, self.k_theta]])
        c = np.array([[self.c_y, self.c_ytheta], [self.c_ytheta, self.c_theta]])
        result: NDArray[np.complex128] = (1.0 + 1j * self.loss_factor) * k + 1j * w[:, None, None] * c
        return result


@dataclass(frozen=True, kw_only=True)
class PointJoint(_Spring):
    """A joint at a point: full, symmetric, complex stiffness between two facing ends.

    The stiffness is K(w) = (1 + i loss_factor) [[k_y, k_ytheta], [k_ytheta, k_theta]]
    + i w [[c_y, c_ytheta], [c_ytheta, c_theta]]; it enters receptance coupling as K^-1 in series with the two
    ends (Matthias et al. 2016, eqs. 2 and 3, where the off-diagonal terms are zero). A joint that sits a distance
    e further along x has k_ytheta = k_y e and k_theta + k_y e^2.

    Parameters
    ----------
    {fields}

    Raises
    ------
    ValueError
        A negative or not finite value, an indefinite matrix, or a joint that resists nothing at all.

    Examples
    --------
    >>> from receptance import PointJoint
    >>> joint = PointJoint(k_y=3.5e8, k_theta=4.0e4, c_theta=0.01)
    >>> joint.stiffness([1000.0]).shape
    (1, 2, 2)
    """

    name: Annotated[str, Field("first word of the addresses of its parameters")] = field(default="", compare=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        for y, kind in (("y", "translation"), ("theta", "rotation")):
            if getattr(self, f"k_{y}") == 0.0 and getattr(self, f"c_{y}") == 0.0:
                raise ValueError(
                    f"{self.owner}: k_{y} and c_{y} are both zero, so nothing holds the {kind} and the interface "
                    f"is singular; give k_{y} or c_{y}"
                )

    def moved(self, distance: float) -> PointJoint:
        """Return the same joint acting `distance` (m) further along x, seen from its old place.

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
    """A spring and dashpot from a point, or a stretch, of a part to ground.

    Parameters
    ----------
    {fields}

    Raises
    ------
    ValueError
        As `PointJoint`; a length at the part's end, and weights that are negative or all zero.

    Examples
    --------
    >>> from receptance import GroundSpring
    >>> GroundSpring(k_y=1e7, part="holder", position="end").k_y
    10000000.0
    """

    part: Annotated[str, Field("name of the part that carries it; by default the first part")] = ""
    position: Annotated[Position, Field("distance in m from the part's tip-side end, or its far end")] = 0.0
    length: Annotated[
        float,
        Number(
            units.LENGTH_OR_ZERO,
            "length over which the spring, whose values are those of the whole, is shared out; 0 for a point",
            parameter=False,
        ),
    ] = 0.0
    points: Annotated[int, Count("number of points, each in the middle of an equal part of the length")] = 8
    weights: Annotated[
        tuple[float, ...], Field("shares of the points, in proportion, from the tip on; by default all the same")
    ] = ()
    name: Annotated[str, Field("first word of the addresses of its parameters")] = field(default="", compare=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.length > 0.0 and self.position == "end":
            raise ValueError(f"{self.owner}: it begins at the part's end and has a length of {self.length:g} m")
        given = enumerate(self.weights)
        weights = tuple(_checks.not_negative(self.owner, f"weights[{i}]", value) for i, value in given)
        if weights and sum(weights) == 0.0:
            raise ValueError(f"{self.owner}: weights are all zero, so it acts nowhere")
        object.__setattr__(self, "weights", weights)
        object.__setattr__(self, "points", len(weights) or self.points)

    @property
    def offsets(self) -> tuple[float, ...]:
        """Distances in m from the position to the points at which it acts."""
        if self.length == 0.0:
            return (0.0,)
        return tuple(self.length * (i + 0.5) / self.points for i in range(self.points))

    @property
    def shares(self) -> tuple[float, ...]:
        """What each of the points carries of the whole."""
        if self.length == 0.0:
            return (1.0,)
        weights = self.weights or (1.0,) * self.points
        return tuple(weight / sum(weights) for weight in weights)


@dataclass(frozen=True, kw_only=True)
class PointMass(Element):
    """A rigid mass on a point of a part.

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
    part: Annotated[str, Field("name of the part that carries it; by default the first part")] = ""
    position: Annotated[Position, Field("distance in m from the part's tip-side end, or its far end")] = 0.0
    name: Annotated[str, Field("first word of the addresses of its parameters")] = field(default="", compare=False)

    offsets: ClassVar[tuple[float, ...]] = (0.0,)
    shares: ClassVar[tuple[float, ...]] = (1.0,)

    def __post_init__(self) -> None:
        self.check()


@dataclass(frozen=True, kw_only=True)
class Resonator(Element):
    """A mass on a spring and a dashpot at a point of a part.

    It stands for one mode of a structure that is not modelled, or for a vibration absorber. It acts on the translation
    of its point, with the dynamic stiffness -w^2 mass k / (k - w^2 mass), k = k_y + i w c_y (Den Hartog, Mechanical
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
    part: Annotated[str, Field("name of the part that carries it; by default the first part")] = ""
    position: Annotated[Position, Field("distance in m from the part's tip-side end, or its far end")] = 0.0
    name: Annotated[str, Field("first word of the addresses of its parameters")] = field(default="", compare=False)

    offsets: ClassVar[tuple[float, ...]] = (0.0,)

    def __post_init__(self) -> None:
        self.check()


WIDTHS = tuple(nodes + len(kind.layout) for nodes, kind in ((2, PointJoint), (1, PointMass), (1, GroundSpring)))
"""Columns of the core's tables of joints, masses and ground springs: nodes, then the columns of the element."""
