"""Beams: materials, sections, uniform segments, parts composed of segments, and joints of two parallel beams."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from typing import Annotated, ClassVar, Literal, get_args

import numpy as np

from receptance import _checks, units
from receptance.errors import warn_user
from receptance.model.contour import TOLERANCE, Contour, Points
from receptance.model.fields import Choice, Count, Element, Field, Member, Name, Number
from receptance.model.sections import Factors, Plane, SectionShape

_SOFTEST = 1e5
"""Young's modulus in Pa below which a wrong unit is suspected."""
_LARGEST_FIT = 1.02
"""Largest ratio of the diameters of shank and bore, beyond that of any interference fit."""


@dataclass(frozen=True, kw_only=True)
class Material(Element):
    """A linear isotropic material with hysteretic damping.

    Parameters
    ----------
    {fields}

    Raises
    ------
    ValueError, TypeError
        A value out of its bounds; the message names it.

    Examples
    --------
    >>> from receptance import Material
    >>> carbide = Material(youngs_modulus=580e9, density=14500.0, poisson_ratio=0.22, loss_factor=0.002)
    >>> round(carbide.shear_modulus / 1e9, 1)
    237.7
    """

    youngs_modulus: Annotated[
        float, Number(units.MODULUS, "Young's modulus; with a loss factor it is E (1 + i loss_factor)")
    ]
    density: Annotated[float, Number(units.DENSITY, "mass density")]
    poisson_ratio: Annotated[
        float, Number(units.POISSON_RATIO, "Poisson's ratio; the shear modulus is E / (2 (1 + nu))")
    ]
    loss_factor: Annotated[float, Number(units.LOSS_FACTOR, "hysteretic loss factor of both moduli")] = 0.0
    name: Annotated[str, Field("name in reports and files")] = field(default="", compare=False)

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.youngs_modulus < _SOFTEST:
            warn_user(
                f"{self.owner}: youngs_modulus is {self.youngs_modulus:g} Pa, softer than rubber; give it in Pa, "
                "not in GPa"
            )

    @property
    def shear_modulus(self) -> float:
        """Shear modulus G in Pa."""
        return self.youngs_modulus / (2.0 * (1.0 + self.poisson_ratio))


STEEL = Material(youngs_modulus=210e9, density=7850.0, poisson_ratio=0.3, name="steel")
"""Steel with textbook values, without damping."""

CARBIDE = Material(youngs_modulus=580e9, density=14500.0, poisson_ratio=0.22, name="carbide")
"""Cemented carbide: E 550-630 GPa and density 13 800-15 000 kg/m3 are common, so measure your blanks."""


ShearModel = Literal["cowper", "hutchinson"]
_COMMON = {"length": 10.0, "outer_diameter": 2.0}
"""Largest usual dimensions in m; larger ones are probably in mm."""


@dataclass(frozen=True, kw_only=True)
class _CircularSection(Element):
    """A circular cross-section."""

    outer_diameter: Annotated[float, Number(units.LENGTH, "outer diameter")]
    inner_diameter: Annotated[float, Number(units.LENGTH_OR_ZERO, "diameter of the bore; 0 for a solid section")] = 0.0
    material: Annotated[Material, Member(Material, "material of the ring, or of the solid section", prefix="")]
    core: Annotated[
        Material | None,
        Member(
            Material,
            "material that fills the bore and is bonded to it, such as an inserted shank; stiffness and inertia add",
            prefix="core.",
        ),
    ] = None
    shear: Annotated[
        ShearModel,
        Choice(
            "shear coefficient, of Cowper (J. Appl. Mech. 33, 1966, 335) or Hutchinson (J. Appl. Mech. 68, 2001, 87)",
            get_args(ShearModel),
        ),
    ] = "cowper"

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.inner_diameter >= self.outer_diameter:
            raise ValueError(
                f"{self.owner}: inner_diameter is {self.inner_diameter:g} m, expected less than the outer diameter "
                f"{self.outer_diameter:g} m"
            )
        if self.core is not None and self.inner_diameter == 0.0:
            raise ValueError(f"{self.owner}: core is given and inner_diameter is 0, expected a bore for the core")
        for quantity, common in _COMMON.items():
            if (value := getattr(self, quantity, 0.0)) > common:
                warn_user(f"{self.owner}: {quantity} is {value:g} m; give lengths in metres, not in millimetres")


@dataclass(frozen=True, kw_only=True)
class _Length(Element):
    length: Annotated[float, Number(units.LENGTH, "length")]


@dataclass(frozen=True, kw_only=True)
class Section(_CircularSection):
    """A circular section without a length: solid, hollow, or hollow and filled.

    Parameters
    ----------
    {fields}

    Examples
    --------
    >>> from receptance import STEEL, Section
    >>> Section(outer_diameter=0.04, inner_diameter=0.012, material=STEEL).shear
    'cowper'
    """


@dataclass(frozen=True, kw_only=True)
class Segment(_CircularSection, _Length):
    """A Timoshenko beam: a cylinder or a cone, solid, hollow, or hollow and filled; or one with a shape of its own.

    Parameters
    ----------
    {fields}

    Raises
    ------
    ValueError, TypeError
        A value out of its bounds; the message names it.

    Notes
    -----
    Between the ends of a cone the diameters are linear in x, and the beam in each place has the section there; see
    "Conical segments" in the theory.

    Examples
    --------
    >>> from receptance import STEEL, Segment
    >>> tube = Segment(length=0.1, outer_diameter=0.05, inner_diameter=0.02, material=STEEL)
    >>> round(tube.mass, 3)
    1.295
    >>> cone = Segment(length=0.06, outer_diameter=0.03, end_outer_diameter=0.06, material=STEEL)
    >>> round(cone.mass, 3)
    0.777

    A strip that deflects about its flat side:

    >>> from receptance import SectionShape
    >>> shape = SectionShape.rectangle(width=0.05, height=0.002)
    >>> strip = Segment(length=0.3, outer_diameter=shape.diameter, shape=shape, material=STEEL)
    >>> round(strip.mass, 4)
    0.2355
    """

    end_outer_diameter: Annotated[
        float | None, Number(units.LENGTH, "outer diameter at the end of larger x; by default that of the other end")
    ] = None
    end_inner_diameter: Annotated[
        float | None, Number(units.LENGTH_OR_ZERO, "bore at the end of larger x; by default that of the other end")
    ] = None
    shape: Annotated[
        SectionShape | None,
        Field(
            "shape of the section, scaled so that its reference circle has the outer diameter; a bending motion is in "
            "its plane y; by default a circle or ring"
        ),
    ] = None

    def __post_init__(self) -> None:
        super().__post_init__()
        if self.shape is not None:
            if not isinstance(self.shape, SectionShape):
                raise TypeError(f"{self.owner}: shape is {self.shape!r}, expected a SectionShape or None")
            if self.inner_diameter or self.end_inner_diameter or self.core is not None:
                raise ValueError(
                    f"{self.owner}: a shape is given beside a bore or a core, expected the holes in the shape itself, "
                    "such as the holes of a polygon"
                )
            self.shape.factors("y", self.shear)
        outer, inner = self.ends[1]
        if inner >= outer:
            raise ValueError(
                f"{self.owner}: the bore at the far end is {inner:g} m (end_inner_diameter), expected less than the "
                f"outer diameter {outer:g} m there (end_outer_diameter)"
            )
        if self.core is not None and inner == 0.0:
            raise ValueError(f"{self.owner}: core is given and end_inner_diameter is 0, expected a bore for the core")

    @property
    def is_circular(self) -> bool:
        """Whether the section is a circle or a ring."""
        return self.shape is None

    def shape_columns(self, plane: Plane) -> tuple[float, ...]:
        """Return the columns of the shape in the core's table of segments: zeros for a circle or ring."""
        return (0.0,) * len(Factors._fields) if self.shape is None else self.shape.factors(plane, self.shear)

    @property
    def is_conical(self) -> bool:
        """Whether a diameter at the far end is stated."""
        return self.end_outer_diameter is not None or self.end_inner_diameter is not None

    @property
    def ends(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Outer and inner diameter in m at the end of smaller and at that of larger x."""
        outer, inner = self.end_outer_diameter, self.end_inner_diameter
        end = (self.outer_diameter if outer is None else outer, self.inner_diameter if inner is None else inner)
        return (self.outer_diameter, self.inner_diameter), end

    def at(self, share: float) -> tuple[float, float]:
        """Return outer and inner diameter in m at a share of the length, 0 at the end of smaller x."""
        near, far = self.ends
        outer, inner = ((1.0 - share) * start + share * end for start, end in zip(near, far, strict=True))
        return outer, inner

    def between(self, start: float, end: float) -> Segment:
        """Return the piece between two shares of the length, 0 being the end of smaller x.

        Examples
        --------
        >>> from receptance import STEEL, Segment
        >>> cone = Segment(length=0.06, outer_diameter=0.03, end_outer_diameter=0.06, material=STEEL)
        >>> nose = cone.between(0.0, 0.5)
        >>> f"{nose.length:g} m, {nose.outer_diameter:g} to {nose.end_outer_diameter:g} m"
        '0.03 m, 0.03 to 0.045 m'
        """
        (outer, inner), (end_outer, end_inner) = self.at(start), self.at(end)
        changes: dict[str, float | None] = {"length": (end - start) * self.length}
        if self.is_conical:
            changes.update(outer_diameter=outer, inner_diameter=inner)
            changes["end_outer_diameter"] = None if self.end_outer_diameter is None else end_outer
            changes["end_inner_diameter"] = None if self.end_inner_diameter is None else end_inner
        return replace(self, **changes)  # type: ignore[arg-type]

    @property
    def mass(self) -> float:
        """Mass in kg."""
        outer, inner = zip(*self.ends, strict=True)
        bore = _mean_square(inner)
        core = self.core.density * bore if self.core else 0.0
        area = 1.0 if self.shape is None else self.shape.area
        ring = self.material.density * (area * _mean_square(outer) - bore)
        return float(self.length * np.pi / 4.0 * (ring + core))


def _mean_square(diameters: tuple[float, float]) -> float:
    """Return the mean of the square of a linear diameter."""
    near, far = diameters
    return (near * near + near * far + far * far) / 3.0


def _end(near: float, far: float) -> float | None:
    """Return the diameter at the far end of a piece; None if it is that of the near end."""
    return None if far == near else far


@dataclass(frozen=True)
class Part:
    """A part: rigidly connected segments along x, from the tip-side end to the far end.

    Parameters
    ----------
    segments : iterable of Segment
        At least one segment, in the order of x.
    name : str, optional
        First word of the addresses of its parameters, as in `tool.segment[0].outer_diameter`.

    Examples
    --------
    >>> from receptance import STEEL, Part, Segment
    >>> bar = Part([Segment(length=0.125, outer_diameter=0.01, material=STEEL)], name="bar")
    >>> f"{bar.length:g} m, {1e3 * bar.mass:.1f} g"
    '0.125 m, 77.1 g'
    """

    segments: tuple[Segment, ...]
    name: str = field(default="", compare=False)

    role: ClassVar[str] = "part"

    def __init__(self, segments: Iterable[Segment], *, name: str = "") -> None:
        owner = f"Part {name!r}" if name else "Part"
        segments = _checks.items(f"{owner}: segments", segments, Segment)
        _checks.set_fields(self, {"segments": segments, "name": name})

    @classmethod
    def from_contour(
        cls,
        outer: Contour | Points,
        bores: Iterable[Points] = (),
        *,
        material: Material,
        name: str = "",
        radii: bool = False,
        tolerance: float = TOLERANCE,
    ) -> Part:
        """Return the part of a contour: cylinders and cones, divided where the profile or a bore changes.

        Parameters
        ----------
        outer : Contour or sequence of points
            A contour, or its outer profile: points (x, diameter) in m, see `receptance.model.contour.Contour`.
        bores : sequence of sequences of points, optional
            The profiles of the bores, if `outer` is not a contour.
        material : Material
            Material of all segments.
        name : str, optional
            First word of the addresses of its parameters.
        radii : bool, optional
            Whether the points are (x, radius).
        tolerance : float, optional
            Largest distance in m between an arc and the cones that replace it.

        Raises
        ------
        ValueError, TypeError
            As of `Contour`; the message names the place.

        Examples
        --------
        >>> from receptance import STEEL, Part
        >>> nose = Part.from_contour(
        ...     [(0.0, 0.02), (0.05, 0.03)], bores=[[(0.0, 0.01), (0.04, 0.01)]], material=STEEL
        ... )
        >>> [f"{1e3 * segment.length:g} mm" for segment in nose.segments]
        ['40 mm', '10 mm']
        """
        owner = f"Part {name!r}" if name else "Part"
        contour = outer
        if not isinstance(contour, Contour):
            contour = Contour(contour, bores, radii=radii, tolerance=tolerance, owner=owner)
        segments = (
            Segment(
                length=piece.length,
                outer_diameter=piece.outer_diameter,
                inner_diameter=piece.inner_diameter,
                end_outer_diameter=_end(piece.outer_diameter, piece.end_outer_diameter),
                end_inner_diameter=_end(piece.inner_diameter, piece.end_inner_diameter),
                material=material,
            )
            for piece in contour.pieces
        )
        return cls(segments, name=name)

    @property
    def length(self) -> float:
        """Length in m."""
        return sum(segment.length for segment in self.segments)

    @property
    def mass(self) -> float:
        """Mass in kg."""
        return sum(segment.mass for segment in self.segments)


@dataclass(frozen=True, kw_only=True)
class SpreadJoint(Element):
    """A joint along an insertion: shank and sleeve are two beams, connected by an elastic layer or at points.

    It replaces a `PointJoint` between two parts of an assembly. The part before it continues as the shank, which
    ends at the end of the insertion; the sleeve begins at the mouth of the holder and continues as the part after
    it. The length is that of the insertion, which neither part contains. Stiffness and damping are those of the
    whole insertion, K(w) = (1 + i loss_factor) k + i w c, uniformly distributed or, at points, with a slope. In the
    limit of zero length it becomes the point joint with the same k_y and k_theta, in the limit of a stiff layer a
    bonded section (`Segment.core`).

    Parameters
    ----------
    {fields}

    Raises
    ------
    ValueError, TypeError
        A value out of its bounds, a shank that is larger than the bore, or a joint that leaves a motion free.

    Examples
    --------
    >>> from receptance import CARBIDE, STEEL, Assembly, Part, Section, Segment, SpreadJoint
    >>> joint = SpreadJoint(
    ...     length=0.04,
    ...     shank=Section(outer_diameter=0.012, material=CARBIDE),
    ...     sleeve=Section(outer_diameter=0.04, inner_diameter=0.012, material=STEEL),
    ...     k_y=5e8,
    ...     k_theta=2e4,
    ... )
    >>> tool = Part([Segment(length=0.05, outer_diameter=0.012, material=CARBIDE)], name="tool")
    >>> holder = Part([Segment(length=0.08, outer_diameter=0.05, material=STEEL)], name="holder")
    >>> Assembly([tool, joint, holder]).natural_frequencies(14e3).round(0)
    array([ 2392., 10090., 12848.])
    """

    length: Annotated[float, Number(units.LENGTH, "length of the insertion")]
    shank: Annotated[Section, Member(Section, "section of the tool in the insertion", prefix="shank.")]
    sleeve: Annotated[
        Section,
        Member(Section, "section of the holder in the insertion; its bore contains the shank", prefix="sleeve."),
    ]
    k_y: Annotated[float, Number(units.STIFFNESS, "translational stiffness of the whole insertion")] = 0.0
    k_theta: Annotated[
        float,
        Number(
            units.ROTATIONAL_STIFFNESS,
            "stiffness of the whole insertion against relative rotation; k_y adds k_y length^2 / 12",
        ),
    ] = 0.0
    c_y: Annotated[float, Number(units.DAMPING, "translational viscous damping")] = 0.0
    c_theta: Annotated[float, Number(units.ROTATIONAL_DAMPING, "rotational viscous damping")] = 0.0
    loss_factor: Annotated[float, Number(units.LOSS_FACTOR, "hysteretic loss factor of both stiffnesses")] = 0.0
    slope: Annotated[
        float,
        Number(
            units.SLOPE,
            "slope of the shares of the points: the one at x has (1 + slope (2 x / length - 1)) / points of the "
            "stiffness and damping, x from the mouth; a negative slope makes the mouth stiffer; only with `points`",
        ),
    ] = 0.0
    points: Annotated[
        int | None,
        Count(
            "number of springs, in the middles of equal parts of the insertion; by default a continuous layer",
            column=True,
        ),
    ] = None
    name: Name = field(default="", compare=False)

    role = "joint"

    def __post_init__(self) -> None:
        super().__post_init__()
        owner, points = self.owner, self.points
        if self.sleeve.core is not None:
            raise ValueError(f"{owner}: sleeve has a core, expected an open bore for the shank")
        if self.shank.outer_diameter > _LARGEST_FIT * self.sleeve.inner_diameter:
            raise ValueError(
                f"{owner}: shank.outer_diameter is {self.shank.outer_diameter:g} m, expected at most the sleeve's bore "
                f"of {self.sleeve.inner_diameter:g} m plus 2 % for an interference fit"
            )
        if self.k_y == 0.0 and self.c_y == 0.0:
            raise ValueError(f"{owner}: k_y and c_y are both zero, so the translation is free; give k_y or c_y")
        if self.slope != 0.0 and points is None:
            raise ValueError(
                f"{owner}: slope is {self.slope:g} and points is None, but the stiffness of a layer is uniform; "
                "give points, for example points = 12"
            )
        if points == 1 and self.k_theta == 0.0 and self.c_theta == 0.0:
            raise ValueError(
                f"{owner}: k_theta and c_theta are both zero, so the rotation about the one point is free; "
                "give k_theta or c_theta, or more points"
            )
