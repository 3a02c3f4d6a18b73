"""Joints distributed along the insertion, with shank and bore as two parallel beams."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated

from receptance import units
from receptance.model.beams import Section
from receptance.model.fields import Count, Element, Field, Member, Number

if TYPE_CHECKING:
    from receptance.model.tables import Flat

__all__ = ["SpreadJoint"]

_LARGEST_FIT = 1.02
"""Largest ratio of the diameters of shank and bore, beyond that of any interference fit."""


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
    name: Annotated[
        str, Field("first word of the addresses of its parameters, as in `joint.k_y` or `joint.shank.outer_diameter`")
    ] = field(default="", compare=False)

    role = "joint"

    def __post_init__(self) -> None:
        self.check()
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

    def add_to(self, flat: Flat, name: str, node: int) -> int:
        """Add the row of the two beams and the layer."""
        far = flat.new_node()
        columns = {f"{name}.{address}": column for address, column in self.places().items()}
        flat.titles["overlap", flat.add("overlaps", (node, far), self.columns(), columns)] = name
        return far
