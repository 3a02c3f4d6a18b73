"""Shapes of cross-sections that are not circular, and what the core needs of them.

A shape is dimensionless apart from the diameter of its reference circle, the smallest circle about the centroid that
contains the outline. A segment with a shape has this diameter as its `outer_diameter`, so that a tolerance of the
diameter, or a cone, scales the shape. Factors are relative to the solid circle of that diameter.

The plane "x" is that of a deflection in the direction x of the outline, with the second moment of area int x^2 dA; the
plane "y" accordingly. The shear coefficient kappa is a polynomial of s = nu / (1 + nu), 1/kappa = p0 + p1 s + p2 s^2,
exactly so for the coefficients of Cowper (The shear coefficient in Timoshenko's beam theory, J. Appl. Mech. 33, 1966,
335) and Hutchinson (Shear coefficients for Timoshenko beam theory, J. Appl. Mech. 68, 2001, 87).
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, field, replace
from typing import Any, Literal, NamedTuple, get_args

import numpy as np

from receptance import _checks
from receptance.errors import warn_user
from receptance.model.flutes import MOST_CORE, checked_flutes, fluted_outline, smallest_core
from receptance.model.outlines import Outline, checked_outline
from receptance.model.section_solutions import solution_of
from receptance.model.warping import Flexibility, mean_of_planes

Plane = Literal["x", "y", "mean"]
"""Plane of the deflection, or the average of both."""
Shear = Literal["cowper", "hutchinson"]
"""Shear coefficient."""
Pair = tuple[float, float]
Point = tuple[float, float]

CIRCLE: dict[Shear, Flexibility] = {"cowper": (7 / 6, -1 / 6, 0.0), "hutchinson": (7 / 6, -1 / 3, -1 / 6)}
"""Polynomials of the solid circle."""
_RECTANGLE_COWPER: Flexibility = (6 / 5, -1 / 10, 0.0)
_RECTANGLE_TERMS = 4000
"""Terms of the series of the rectangle: the remainders fall with the fourth power of their number, and it is large so
that slender strips are exact as well."""
_LARGEST = 2.0
"""Largest usual diameter in m; a larger one is probably in mm."""
_CORE_STEP = 0.03
"""Relative step of the core diameter for exponents."""
_COUPLED = 1e-3
"""Product of inertia over the mean second moment up to which the planes x and y are taken as principal ones."""


class Factors(NamedTuple):
    """What the core gets of a shape for one plane, relative to the solid circle with the reference diameter D.

    `area` is relative to pi D^2 / 4, `moment` (for stiffness) and `inertia` (for rotary inertia) to pi D^4 / 64,
    `torsion` to pi D^4 / 32; 1/kappa = p0 + p1 s + p2 s^2 with s = nu / (1 + nu).
    """

    area: float
    moment: float
    inertia: float
    torsion: float
    p0: float
    p1: float
    p2: float


@dataclass(frozen=True, kw_only=True)
class SectionShape:
    """The shape of a cross-section; made by its constructors, such as `SectionShape.rectangle`.

    Shapes are equal if their mechanical properties are.

    Parameters
    ----------
    diameter : float
        Diameter of the reference circle as drawn, in m.
    area, torsion : float
        Area and torsion constant, relative to those of the circle.
    moment, inertia : tuple of 2 floats
        Second moments of area for stiffness and for rotary inertia in the planes of the principal axes, relative to
        that of the circle. They differ where a helix is averaged.
    cowper, hutchinson : tuple of 2 tuples of 3 floats
        Shear flexibilities p0, p1, p2 in both planes.
    angle : float, default 0
        Angle in rad from the axis x of the outline to the first principal axis.
    outline : tuple of points, optional
        Points of the outline about the centroid, divided by the diameter, for figures.
    holes : tuple of tuples of points, optional
        Outlines of the holes.
    name : str, optional
        What the shape is, for reports.
    recipe : tuple of tuples, optional
        Arguments of the constructor by name, with which files state the shape.

    Examples
    --------
    >>> from receptance import SectionShape
    >>> strip = SectionShape.rectangle(0.05, 0.002)
    >>> f"{1e3 * strip.diameter:.2f} mm, {1e6 * strip.area_m2:.0f} mm^2"
    '50.04 mm, 100 mm^2'
    >>> stiff, soft = strip.second_moments_m4
    >>> round(stiff / soft)
    625
    """

    diameter: float
    area: float
    moment: Pair
    inertia: Pair
    torsion: float
    cowper: tuple[Flexibility, Flexibility]
    hutchinson: tuple[Flexibility, Flexibility]
    angle: float = 0.0
    outline: tuple[Point, ...] = field(default=(), compare=False, repr=False)
    holes: tuple[tuple[Point, ...], ...] = field(default=(), compare=False, repr=False)
    name: str = field(default="", compare=False)
    recipe: tuple[tuple[str, int | float | str], ...] = field(default=(), compare=False, repr=False)

    def __post_init__(self) -> None:
        owner = "SectionShape"
        numbers = {"diameter": self.diameter, "area": self.area, "torsion": self.torsion}
        for quantity in ("moment", "inertia"):
            numbers |= {f"{quantity}[{index}]": value for index, value in enumerate(getattr(self, quantity))}
        for quantity, value in numbers.items():
            if _checks.number(owner, quantity, value) <= 0.0:
                raise ValueError(f"{owner}: {quantity} is {value:g}, expected a positive number")
        if self.diameter > _LARGEST:
            warn_user(f"{owner}: diameter is {self.diameter:g} m; give lengths in metres, not in millimetres")

    @classmethod
    def rectangle(cls, width: float, height: float) -> SectionShape:
        """Return a solid rectangle.

        The coefficient of Cowper is 1/kappa = 6/5 - s/10 for all rectangles, that of Hutchinson is a series;
        the torsion constant is the series of Saint-Venant (Timoshenko and Goodier, Theory of Elasticity, 1970).

        Parameters
        ----------
        width, height : float
            Sides in m, along x and y.

        Examples
        --------
        >>> from receptance import SectionShape
        >>> square = SectionShape.rectangle(0.01, 0.01)
        >>> round(square.torsion_constant_m4 / 0.01**4, 4)
        0.1406
        """
        owner = "SectionShape.rectangle"
        width, height = (
            _positive(owner, quantity, value, "m") for quantity, value in (("width", width), ("height", height))
        )
        diameter = math.hypot(width, height)
        circle = _circle(diameter)
        pair = (width**3 * height / 12.0 / circle.moment, height**3 * width / 12.0 / circle.moment)
        x, y = width / diameter / 2.0, height / diameter / 2.0
        return cls(
            diameter=diameter,
            area=width * height / circle.area,
            moment=pair,
            inertia=pair,
            torsion=_rectangle_torsion(width, height) / circle.torsion,
            cowper=(_RECTANGLE_COWPER, _RECTANGLE_COWPER),
            hutchinson=(_rectangle_hutchinson(width, height), _rectangle_hutchinson(height, width)),
            outline=((-x, -y), (x, -y), (x, y), (-x, y)),
            name=f"rectangle {1e3 * width:g} x {1e3 * height:g} mm",
            recipe=(("width", width), ("height", height)),
        )

    @classmethod
    def from_properties(
        cls,
        *,
        diameter: float,
        area: float,
        second_moment: float | Pair,
        torsion_constant: float | None = None,
        shear_coefficient: float | Pair | None = None,
        name: str = "",
    ) -> SectionShape:
        """Return a shape of known properties, for example from a CAD program.

        Parameters
        ----------
        diameter : float
            Diameter in m of the smallest circle about the centroid that contains the section.
        area : float
            Area in m^2.
        second_moment : float or tuple of 2 floats
            Second moment of area in m^4, int x^2 dA and int y^2 dA about the principal axes; one number for both.
        torsion_constant : float, optional
            Torsion constant in m^4; by default Saint-Venant's approximation for solid sections, A^4 / (40 I_p), which
            is 1.3 % too small for the circle and 6.7 % too large for the square.
        shear_coefficient : float or tuple of 2 floats, optional
            Shear coefficient kappa in both planes, of your material; by default that of Cowper for a rectangle.
        name : str, optional
            What the shape is, for reports.

        Raises
        ------
        ValueError
            Values that no section can have: the circle has the smallest sum of the second moments for its area,
            A^2 / (2 pi), and a section does not leave its reference circle.

        Examples
        --------
        >>> from receptance import SectionShape
        >>> shape = SectionShape.from_properties(diameter=0.012, area=66e-6, second_moment=3.7e-10)
        >>> round(shape.factors("x").moment, 3)
        0.364
        """
        owner = "SectionShape.from_properties"
        diameter = _positive(owner, "diameter", diameter, "m")
        area = _positive(owner, "area", area, "m^2")
        moments = _pair(owner, "second_moment", second_moment, "m^4")
        polar = moments[0] + moments[1]
        circle = _circle(diameter)
        if area > circle.area * (1.0 + 1e-9):
            raise ValueError(
                f"{owner}: area is {area:g} m^2, more than the {circle.area:g} m^2 of the circle with the diameter "
                f"{diameter:g} m; check the units, 1 mm^2 is 1e-6 m^2"
            )
        least = area**2 / (2.0 * math.pi)
        if polar < least * (1.0 - 1e-9):
            raise ValueError(
                f"{owner}: second_moment has the sum {polar:g} m^4, but a section with the area {area:g} m^2 has at "
                f"least {least:g} m^4, that of a circle; check the units, 1 mm^4 is 1e-12 m^4"
            )
        most = area * diameter**2 / 4.0
        if polar > most * (1.0 + 1e-9):
            raise ValueError(
                f"{owner}: second_moment has the sum {polar:g} m^4, but a section with the area {area:g} m^2 within a "
                f"circle of {diameter:g} m has at most {most:g} m^4; check the units, 1 mm^4 is 1e-12 m^4"
            )
        if torsion_constant is None:
            torsion = area**4 / (40.0 * polar)
        else:
            torsion = _positive(owner, "torsion_constant", torsion_constant, "m^4")
            if torsion > polar * (1.0 + 1e-9):
                raise ValueError(
                    f"{owner}: torsion_constant is {torsion:g} m^4, expected at most the sum of the second moments "
                    f"{polar:g} m^4"
                )
        shear = (_RECTANGLE_COWPER, _RECTANGLE_COWPER)
        if shear_coefficient is not None:
            x, y = _pair(owner, "shear_coefficient", shear_coefficient, "")
            for value in (x, y):
                if value > 2.0:
                    raise ValueError(f"{owner}: shear_coefficient is {value:g}, expected a number such as 0.85")
            shear = ((1.0 / x, 0.0, 0.0), (1.0 / y, 0.0, 0.0))
        pair = (moments[0] / circle.moment, moments[1] / circle.moment)
        return cls(
            diameter=diameter,
            area=area / circle.area,
            moment=pair,
            inertia=pair,
            torsion=torsion / circle.torsion,
            cowper=shear,
            hutchinson=shear,
            name=name,
        )

    @classmethod
    def polygon(cls, points: Any, holes: Any = (), *, unit: str = "m", name: str = "") -> SectionShape:
        """Return the shape of a polygon, with holes or without.

        The centroid is on the axis of the beam. Area and second moments are exact; torsion constant and shear
        coefficients are from finite elements for the warping functions, to better than 0.5 %.

        Parameters
        ----------
        points : array_like
            `(n, 2)` corners in order, in either direction, at most 2000.
        holes : sequence of array_like, optional
            Corners of holes.
        unit : str, default "m"
            Unit of length of the points.
        name : str, optional
            What the shape is, for reports.

        Raises
        ------
        ValueError, TypeError
            Crossing or touching edges, repeated points, holes outside, too many points, or a size that suggests another
            unit; the message names the point and its coordinates in the unit.

        Examples
        --------
        >>> from receptance import SectionShape
        >>> angle = SectionShape.polygon([(0, 0), (30, 0), (30, 4), (4, 4), (4, 30), (0, 30)], unit="mm")
        >>> f"{1e6 * angle.area_m2:.0f} mm^2, principal axes at {57.29578 * angle.angle:.0f} deg"
        '224 mm^2, principal axes at 45 deg'
        """
        outline = checked_outline("SectionShape.polygon", points, holes, unit=unit)
        return cls._of(outline, name=name or f"polygon with {len(outline.points)} corners")

    @classmethod
    def fluted(
        cls, number: int, *, diameter: float, core_diameter: float, straight: bool = False, name: str = ""
    ) -> SectionShape:
        """Return the section of an end mill with flutes, after Kivanc and Budak (2004); see `receptance.model.flutes`.

        Sections with three and more flutes bend equally in all directions. With two flutes the helix turns the
        principal axes along the tool, so that over a pitch the bending compliance is the average: the shape has the
        harmonic mean of the principal second moments for stiffness, the arithmetic mean for rotary inertia and that of
        the shear flexibilities. That is the mean of all directions; in a single one the tip yields more or less, by an
        amount that falls only slowly with the length of the flutes (see `receptance.model.flutes.spread_of_directions`
        and the section "Flutes" of the documentation). With `straight` the principal values
        are kept.

        Parameters
        ----------
        number : int
            Number of flutes, 2 to 20.
        diameter : float
            Diameter over the cutting edges, in m.
        core_diameter : float
            Diameter of the core, the largest circle within the section, in m; 0.5 to 0.7 of the diameter is usual.
        straight : bool, default False
            Whether the flutes are straight, so that two of them do not average.
        name : str, optional
            What the shape is, for reports.

        Raises
        ------
        ValueError, TypeError
            Another number of flutes, or a core that is too thin or too thick for it.

        Examples
        --------
        >>> from receptance import SectionShape
        >>> mill = SectionShape.fluted(4, diameter=0.012, core_diameter=0.0068)
        >>> round(mill.bending_diameter / mill.diameter, 2)
        0.81
        """
        core = checked_flutes("SectionShape.fluted", number, diameter, core_diameter)
        # Of diameter 1, so that other sizes of the same shape need no new solution; two straight flutes are turned to
        # the axes x and y.
        outline = Outline(fluted_outline(number, core), ())
        outline = outline.turned(-solution_of(outline).angle)
        shape = replace(
            cls._of(outline, diameter=1.0),
            diameter=float(diameter),
            name=name or f"{number} flutes, core {1e3 * core_diameter:.4g} of {1e3 * diameter:.4g} mm",
        )
        twisted = shape if straight or number > 2 else shape.averaged()
        recipe = (("flutes", int(number)), ("core_diameter", float(core_diameter)))
        return replace(twisted, recipe=(*recipe, ("straight", True)) if straight else recipe)

    @classmethod
    def _of(cls, outline: Outline, *, name: str = "", diameter: float | None = None) -> SectionShape:
        """Return the shape of a checked outline; by default the smallest circle about the centroid is the reference."""
        solution = solution_of(outline)
        rings = [ring - solution.centroid for ring in outline.rings]
        reference = diameter or 2.0 * float(np.max(np.hypot(*rings[0].T)))
        circle = _circle(reference)
        pair = (solution.moments[0] / circle.moment, solution.moments[1] / circle.moment)
        outer, *inner = (tuple((float(x), float(y)) for x, y in ring / reference) for ring in rings)
        return cls(
            diameter=reference,
            area=solution.area / circle.area,
            moment=pair,
            inertia=pair,
            torsion=solution.torsion / circle.torsion,
            cowper=solution.cowper,
            hutchinson=solution.hutchinson,
            angle=solution.angle,
            outline=outer,
            holes=tuple(inner),
            name=name,
        )

    def averaged(self) -> SectionShape:
        """Return the shape with the averages of both planes, as of a section that turns along a helix; see `factors`.

        Examples
        --------
        >>> from receptance import SectionShape
        >>> twisted = SectionShape.rectangle(0.02, 0.01).averaged()
        >>> [round(twisted.factors("x").moment, 3), round(twisted.factors("x").inertia, 3)]
        [0.217, 0.34]
        """
        moment = 2.0 / (1.0 / self.moment[0] + 1.0 / self.moment[1])
        inertia = 0.5 * (self.inertia[0] + self.inertia[1])
        return replace(
            self,
            moment=(moment, moment),
            inertia=(inertia, inertia),
            cowper=mean_of_planes(self.cowper),
            hutchinson=mean_of_planes(self.hutchinson),
            angle=0.0,
            recipe=self._recipe_in("mean"),
        )

    @property
    def bending_diameter(self) -> float:
        """Diameter in m of the solid cylinder with the same bending stiffness, the mean of both planes."""
        return float(self.diameter * self.averaged().moment[0] ** 0.25)

    @property
    def core_ratio(self) -> float | None:
        """Core diameter of flutes over the diameter; None for other shapes.

        Examples
        --------
        >>> from receptance import SectionShape
        >>> SectionShape.fluted(4, diameter=0.012, core_diameter=0.006).core_ratio
        0.5
        """
        core = dict(self.recipe).get("core_diameter")
        return None if core is None else float(core) / self.diameter

    @property
    def core_limits(self) -> Pair:
        """Smallest and largest `core_ratio` of a section with as many flutes."""
        return smallest_core(int(dict(self.recipe)["flutes"])), MOST_CORE

    def core_exponents(self) -> tuple[float, float, float]:
        """Return d log / d log core diameter of area, and of second moments for stiffness and for rotary inertia.

        These are differences over some percent of the core diameter of flutes, in the plane y.

        Examples
        --------
        >>> from receptance import SectionShape
        >>> mill = SectionShape.fluted(4, diameter=0.012, core_diameter=0.0072)
        >>> [round(exponent, 2) for exponent in mill.core_exponents()]
        [0.94, 1.45, 1.45]
        """
        arguments, (least, most) = dict(self.recipe), self.core_limits
        plane: Plane = "x" if self._plane == "x" else "mean" if self._plane == "mean" else "y"
        ratio = float(arguments["core_diameter"]) / self.diameter
        ends = max(ratio * math.exp(-_CORE_STEP), least), min(ratio * math.exp(_CORE_STEP), most)
        thin, thick = (
            SectionShape.fluted(
                int(arguments["flutes"]),
                diameter=self.diameter,
                core_diameter=end * self.diameter,
                straight="straight" in arguments,
            ).factors(plane)
            for end in ends
        )
        area, moment, inertia = (
            math.log(getattr(thick, name) / getattr(thin, name)) / math.log(ends[1] / ends[0])
            for name in ("area", "moment", "inertia")
        )
        return area, moment, inertia

    @property
    def area_m2(self) -> float:
        """Area in m^2, as drawn."""
        return self.area * _circle(self.diameter).area

    @property
    def second_moments_m4(self) -> Pair:
        """Second moments of area for stiffness in m^4, as drawn, in the planes of the principal axes."""
        unit = _circle(self.diameter).moment
        return (self.moment[0] * unit, self.moment[1] * unit)

    @property
    def torsion_constant_m4(self) -> float:
        """Torsion constant in m^4, as drawn."""
        return self.torsion * _circle(self.diameter).torsion

    @property
    def is_isotropic(self) -> bool:
        """Whether both planes have the same bending, to 1e-9."""
        return all(math.isclose(*pair, rel_tol=1e-9) for pair in (self.moment, self.inertia)) and all(
            np.allclose(*pair, rtol=0.0, atol=1e-6) for pair in (self.cowper, self.hutchinson)
        )

    def factors(self, plane: Plane = "mean", shear: Shear = "cowper") -> Factors:
        """Return what the core gets of the shape.

        With "mean" the compliances of both planes are averaged, as for a section of unknown or turning orientation:
        the harmonic mean of the second moments for stiffness, the arithmetic mean of the shear flexibilities and of the
        second moments for rotary inertia.

        Parameters
        ----------
        plane : {"x", "y", "mean"}
            Direction of the deflection.
        shear : {"cowper", "hutchinson"}
            Shear coefficient.

        Raises
        ------
        ValueError
            The plane is not that of a principal axis, so that x and y are coupled; or the coefficient of Hutchinson is
            negative, as for flat sections bent about their flat side.

        Examples
        --------
        >>> from receptance import SectionShape
        >>> bar = SectionShape.rectangle(0.02, 0.01)
        >>> [round(bar.factors(plane).moment, 3) for plane in ("x", "y", "mean")]
        [0.543, 0.136, 0.217]
        """
        _checks.one_of("SectionShape.factors", "plane", plane, Plane)
        _checks.one_of("SectionShape.factors", "shear", shear, Shear)
        flexibilities = self.cowper if shear == "cowper" else self.hutchinson
        if plane == "mean":
            average = self.averaged()
            moment, inertia, (p0, p1, p2) = average.moment[0], average.inertia[0], mean_of_planes(flexibilities)[0]
        else:
            axis = self._axis(plane)
            moment, inertia, (p0, p1, p2) = self.moment[axis], self.inertia[axis], flexibilities[axis]
        if min(p0, p0 + p1 / 3.0 + p2 / 9.0) <= 0.0:
            raise ValueError(
                f"SectionShape: the shear coefficient of Hutchinson is negative in the plane {plane}, as for flat "
                'sections; give shear="cowper"'
            )
        return Factors(self.area, moment, inertia, self.torsion, p0, p1, p2)

    def turned(self) -> SectionShape:
        """Return the shape turned by 90 degrees, for a deflection in the other plane.

        Examples
        --------
        >>> from receptance import SectionShape
        >>> bar = SectionShape.rectangle(0.02, 0.01)
        >>> bar.turned().moment == bar.moment[::-1]
        True
        """
        around = tuple(tuple((-y, x) for x, y in line) for line in (self.outline, *self.holes))
        return replace(
            self,
            moment=self.moment[::-1],
            inertia=self.inertia[::-1],
            cowper=self.cowper[::-1],
            hutchinson=self.hutchinson[::-1],
            outline=around[0],
            holes=around[1:],
            # Without other arguments the outline itself is turned.
            recipe=self._recipe_in("y" if self._plane == "x" else "x") if self.recipe[:1] else (),
        )

    @property
    def _plane(self) -> int | float | str:
        """The plane of the recipe."""
        return dict(self.recipe).get("plane", "y")

    def _recipe_in(self, plane: Plane) -> tuple[tuple[str, int | float | str], ...]:
        """Return the recipe with another plane; the mean of both is that of a turned shape as well."""
        others = tuple(item for item in self.recipe if item[0] != "plane")
        plane = "mean" if self._plane == "mean" else plane
        return others if plane == "y" else (*others, ("plane", plane))

    def _axis(self, plane: Plane) -> int:
        """Return the index of the principal axis of a plane."""
        index = get_args(Plane).index(plane)
        # The product of inertia of the axes x and y over the mean second moment.
        first, second = self.moment
        if abs((first - second) / (first + second) * math.sin(2.0 * self.angle)) < _COUPLED:
            return index if abs(math.sin(self.angle)) < abs(math.cos(self.angle)) else 1 - index
        degrees = math.degrees(self.angle)
        raise ValueError(
            f"SectionShape: the principal axes are at {degrees:.4g} deg to the axes of the outline, so a load in "
            f"{plane} deflects in both directions; turn the points by {-degrees:.4g} deg, or take the average of both "
            'planes, shape.averaged(), in a campaign plane = "mean"'
        )


class _Circle(NamedTuple):
    area: float
    moment: float
    torsion: float


def _circle(diameter: float) -> _Circle:
    """Return the properties of the solid circle of a diameter in m."""
    moment = math.pi * diameter**4 / 64.0
    return _Circle(math.pi * diameter**2 / 4.0, moment, 2.0 * moment)


def _positive(owner: str, quantity: str, value: Any, unit: str) -> float:
    number = _checks.number(owner, quantity, value, unit=unit)
    if number <= 0.0:
        raise ValueError(f"{owner}: {quantity} is {number:g} {unit}".rstrip() + ", expected a positive number")
    return number


def _pair(owner: str, quantity: str, value: Any, unit: str) -> Pair:
    """Return two positive numbers, equal ones if a single number is stated."""
    values = value if isinstance(value, (tuple, list)) else (value, value)
    if len(values) != 2:
        raise ValueError(f"{owner}: {quantity} has {len(values)} numbers, expected one number, or two for x and y")
    return (_positive(owner, quantity, values[0], unit), _positive(owner, quantity, values[1], unit))


@functools.lru_cache(maxsize=64)
def _rectangle_torsion(width: float, height: float) -> float:
    """Return the torsion constant of a rectangle in m^4."""
    long, short = max(width, height), min(width, height)
    odd = np.arange(1.0, _RECTANGLE_TERMS, 2.0)
    series = np.sum(np.tanh(odd * np.pi * long / (2.0 * short)) / odd**5)
    return float(long * short**3 * (1.0 / 3.0 - 64.0 / np.pi**5 * short / long * series))


@functools.lru_cache(maxsize=64)
def _rectangle_hutchinson(depth: float, width: float) -> Flexibility:
    """Return the polynomial of a rectangle that deflects in the direction of its depth.

    With depth 2 a and width 2 b, Hutchinson's coefficient (2001) is
    1/kappa = 6/5 - s/5 - 18 s^2 b^4 / a^5 sum_n (n pi a - b tanh(n pi a / b)) / (n pi)^5.
    """
    ratio = depth / width
    n = np.pi * np.arange(1.0, _RECTANGLE_TERMS)
    series = np.sum((n * ratio - np.tanh(n * ratio)) / n**5)
    return (6.0 / 5.0, -1.0 / 5.0, float(-18.0 * series / ratio**5))
