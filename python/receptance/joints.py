"""Joints between parts and point elements on them."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any, ClassVar, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from receptance import _checks

__all__ = ["GroundSpring", "PointJoint", "PointMass", "Resonator"]

_SPRING_UNITS = {
    "k_y": "N/m",
    "k_theta": "N m/rad",
    "k_ytheta": "N/rad",
    "c_y": "N s/m",
    "c_theta": "N m s/rad",
    "c_ytheta": "N s/rad",
    "loss_factor": "",
}


@dataclass(frozen=True, kw_only=True)
class _Spring:
    """A full symmetric complex spring with two degrees of freedom."""

    k_y: float = 0.0
    k_theta: float = 0.0
    k_ytheta: float = 0.0
    c_y: float = 0.0
    c_theta: float = 0.0
    c_ytheta: float = 0.0
    loss_factor: float = 0.0

    columns_of: ClassVar[tuple[str, ...]] = tuple(_SPRING_UNITS)

    def __post_init__(self) -> None:
        owner = self._owner()
        for quantity, unit in _SPRING_UNITS.items():
            check = _checks.number if quantity.endswith("ytheta") else _checks.not_negative
            object.__setattr__(self, quantity, check(owner, quantity, getattr(self, quantity), unit=unit))
        for kind, part in (("k", "real"), ("c", "imaginary")):
            limit = math.sqrt(getattr(self, f"{kind}_y") * getattr(self, f"{kind}_theta"))
            value = getattr(self, f"{kind}_ytheta")
            if abs(value) > limit * (1.0 + 1e-12):
                raise ValueError(
                    f"{owner}: {kind}_ytheta is {value:g}, but its size may be at most sqrt({kind}_y {kind}_theta) = "
                    f"{limit:g}: the {part} part of the stiffness must be positive semidefinite"
                )

    def _owner(self) -> str:
        name = getattr(self, "name", "")
        return f"{type(self).__name__} {name!r}" if name else type(self).__name__

    def stiffness(self, frequency_hz: ArrayLike) -> NDArray[np.complex128]:
        """Dynamic stiffness K = (1 + i loss_factor) k + i w c, shape `(n, 2, 2)` over (y, theta)."""
        w = 2.0 * np.pi * _checks.frequencies(frequency_hz)
        k = np.array([[self.k_y, self.k_ytheta], [self.k_ytheta, self.k_theta]])
        c = np.array([[self.c_y, self.c_ytheta], [self.c_ytheta, self.c_theta]])
        result: NDArray[np.complex128] = (1.0 + 1j * self.loss_factor) * k + 1j * w[:, None, None] * c
        return result

    def columns(self) -> tuple[float, ...]:
        """Return the seven columns of the joint and ground tables."""
        return tuple(getattr(self, quantity) for quantity in self.columns_of)


@dataclass(frozen=True, kw_only=True)
class PointJoint(_Spring):
    """A joint at a point: full, symmetric, complex stiffness between two facing ends.

    The stiffness is K(w) = (1 + i loss_factor) [[k_y, k_ytheta], [k_ytheta, k_theta]]
    + i w [[c_y, c_ytheta], [c_ytheta, c_theta]]; it enters receptance coupling as K^-1 in series with the two
    ends (Matthias et al. 2016, eqs. 2 and 3, where the off-diagonal terms are zero). A joint that sits a distance
    e further along x has k_ytheta = k_y e and k_theta + k_y e^2.

    Parameters
    ----------
    k_y : float
        Translational stiffness in N/m.
    k_theta : float
        Rotational stiffness in N m/rad.
    k_ytheta : float
        Coupling stiffness in N/rad, k_ytheta^2 <= k_y k_theta.
    c_y, c_theta, c_ytheta : float
        Viscous damping in N s/m, N m s/rad and N s/rad, c_ytheta^2 <= c_y c_theta.
    loss_factor : float
        Hysteretic loss factor of all three stiffnesses.
    name : str, optional
        First word of the addresses of its parameters, as in `joint.k_theta`.

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

    name: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        for y, kind in (("y", "translation"), ("theta", "rotation")):
            if getattr(self, f"k_{y}") == 0.0 and getattr(self, f"c_{y}") == 0.0:
                raise ValueError(
                    f"{self._owner()}: k_{y} and c_{y} are both zero, so nothing holds the {kind} and the interface "
                    f"is singular; give k_{y} or c_{y}"
                )

    def moved(self, distance: float) -> PointJoint:
        """Return the same joint acting `distance` (m) further along x, seen from its old place.

        K' = T^T K T with T = [[1, e], [0, 1]], for stiffness and damping alike.
        """
        e = _checks.number(self._owner(), "distance", distance, unit="m")
        changed: dict[str, Any] = {name: getattr(self, name) for name in self.columns_of}
        for kind in "kc":
            y, both = changed[f"{kind}_y"], changed[f"{kind}_ytheta"]
            changed[f"{kind}_theta"] += 2.0 * e * both + e * e * y
            changed[f"{kind}_ytheta"] = both + e * y
        return PointJoint(**changed, name=self.name)


@dataclass(frozen=True, kw_only=True)
class GroundSpring(_Spring):
    """A spring and dashpot from a point, or a stretch, of a part to ground; parameters as in `PointJoint`.

    Parameters
    ----------
    part : str, optional
        Name of the part that carries it; empty for the first part.
    position : float or "end"
        Distance in m from the part's tip-side end, or its far end.
    length : float, optional
        In m, from the position on: the spring, whose values are those of the whole, is shared out evenly over it.
    points : int, optional
        At how many points, each in the middle of an equal part of the length.
    weights : sequence of float, optional
        What the points carry, in proportion; they are then as many as the weights.
    name : str, optional
        First word of the addresses of its parameters.

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

    part: str = ""
    position: float | Literal["end"] = 0.0
    length: float = 0.0
    points: int = 8
    weights: tuple[float, ...] = ()
    name: str = field(default="", compare=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "length", _checks.not_negative(self._owner(), "length", self.length, unit="m"))
        if isinstance(self.points, bool) or not isinstance(self.points, int) or not 1 <= self.points <= 1000:
            raise ValueError(f"{self._owner()}: points is {self.points!r}, expected a whole number from 1 to 1000")
        if self.length > 0.0 and self.position == "end":
            raise ValueError(f"{self._owner()}: it begins at the part's end and has a length of {self.length:g} m")
        given = enumerate(self.weights)
        weights = tuple(_checks.not_negative(self._owner(), f"weights[{i}]", value) for i, value in given)
        if weights and sum(weights) == 0.0:
            raise ValueError(f"{self._owner()}: weights are all zero, so it acts nowhere")
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
class PointMass:
    """A rigid mass on a point of a part.

    Parameters
    ----------
    mass : float
        Mass in kg.
    inertia : float
        Moment of inertia about its own centre, in the plane of bending, in kg m2.
    part : str, optional
        Name of the part that carries it; empty for the first part.
    position : float or "end"
        Distance in m from the part's tip-side end, or its far end.
    name : str, optional
        First word of the addresses of its parameters.

    Examples
    --------
    >>> from receptance import PointMass
    >>> sensor = PointMass(mass=0.6e-3, name="sensor")
    """

    mass: float
    inertia: float = 0.0
    part: str = ""
    position: float | Literal["end"] = 0.0
    name: str = field(default="", compare=False)

    columns_of: ClassVar[tuple[str, ...]] = ("mass", "inertia")
    offsets: ClassVar[tuple[float, ...]] = (0.0,)
    shares: ClassVar[tuple[float, ...]] = (1.0,)

    def __post_init__(self) -> None:
        owner = f"PointMass {self.name!r}" if self.name else "PointMass"
        object.__setattr__(self, "mass", _checks.not_negative(owner, "mass", self.mass, unit="kg"))
        object.__setattr__(self, "inertia", _checks.not_negative(owner, "inertia", self.inertia, unit="kg m2"))

    def columns(self) -> tuple[float, ...]:
        """Return mass and inertia."""
        return (self.mass, self.inertia)


@dataclass(frozen=True, kw_only=True)
class Resonator:
    """A mass on a spring and a dashpot at a point of a part.

    It stands for one mode of a structure that is not modelled, or for a vibration absorber. It acts on the translation
    of its point, with the dynamic stiffness -w^2 mass k / (k - w^2 mass), k = k_y + i w c_y (Den Hartog, Mechanical
    Vibrations, 4th edition 1956, section 3.3).

    Parameters
    ----------
    mass : float
        Mass in kg.
    k_y : float
        Stiffness in N/m; above zero.
    c_y : float
        Viscous damping in N s/m.
    part : str, optional
        Name of the part that carries it; empty for the first part.
    position : float or "end"
        Distance in m from the part's tip-side end, or its far end.
    name : str, optional
        First word of the addresses of its parameters.

    Raises
    ------
    ValueError
        A negative mass or damping, or a stiffness that is not above zero.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance import STEEL, Assembly, Part, Resonator, Segment
    >>> bar = Part([Segment(length=0.2, outer_diameter=0.02, material=STEEL)], name="bar")
    >>> absorber = Resonator(mass=0.02, k_y=0.02 * (2.0 * np.pi * 800.0) ** 2, c_y=1.0)
    >>> Assembly([bar], [absorber]).natural_frequencies(3e3).round(0)
    array([ 851., 2269.])
    """

    mass: float
    k_y: float
    c_y: float = 0.0
    part: str = ""
    position: float | Literal["end"] = 0.0
    name: str = field(default="", compare=False)

    columns_of: ClassVar[tuple[str, ...]] = ("mass", "k_y", "c_y")
    offsets: ClassVar[tuple[float, ...]] = (0.0,)

    def __post_init__(self) -> None:
        owner = f"Resonator {self.name!r}" if self.name else "Resonator"
        object.__setattr__(self, "mass", _checks.not_negative(owner, "mass", self.mass, unit="kg"))
        object.__setattr__(self, "k_y", _checks.positive(owner, "k_y", self.k_y, unit="N/m"))
        object.__setattr__(self, "c_y", _checks.not_negative(owner, "c_y", self.c_y, unit="N s/m"))
