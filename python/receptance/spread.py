"""A joint spread along the insertion: the tool's shank and the holder's bore side by side as two beams."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import ClassVar

from receptance import _checks
from receptance.beams import Section

__all__ = ["SpreadJoint"]

_LAYER_UNITS = {"k_y": "N/m", "k_theta": "N m/rad", "c_y": "N s/m", "c_theta": "N m s/rad", "loss_factor": ""}
_MOST_POINTS = 1000
_LARGEST_FIT = 1.02
"""An interference fit makes a shank larger than its bore by far less than this."""


@dataclass(frozen=True, kw_only=True)
class SpreadJoint:
    """A joint along an insertion: shank and sleeve are two beams, held together by a layer or by points.

    Between two parts of an assembly it takes the place of a `PointJoint`. The part before it goes on as the shank,
    which ends where the insertion does; the sleeve begins at the mouth of the holder and goes on as the part behind.
    The length is that of the insertion, and neither part contains it. Stiffness and damping are those of the whole
    insertion, K(w) = (1 + i loss_factor) k + i w c, spread evenly; with the totals held, a length that goes to zero
    leaves the point joint of the same k_y and k_theta, and a stiff layer a bonded section (`Segment.core`).

    Parameters
    ----------
    length : float
        Length of the insertion in m.
    shank, sleeve : Section
        Sections of the tool and of the holder within it; a sleeve's bore is where the shank lies.
    k_y : float
        Translational stiffness of the whole insertion in N/m.
    k_theta : float
        Its stiffness against a relative rotation at each place, in N m/rad; what k_y resists a turn by, k_y
        length^2 / 12, comes on top of it.
    c_y, c_theta : float
        Viscous damping in N s/m and N m s/rad.
    loss_factor : float
        Hysteretic loss factor of both stiffnesses.
    points : int, optional
        Springs in the middles of so many equal parts of the insertion instead of a layer, which is the limit of many.
    name : str, optional
        First word of the addresses of its parameters, as in `joint.k_y` or `joint.shank.outer_diameter`.

    Raises
    ------
    ValueError, TypeError
        A quantity without meaning, a shank that is larger than the bore, or a joint that leaves a motion free.

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

    length: float
    shank: Section
    sleeve: Section
    k_y: float = 0.0
    k_theta: float = 0.0
    c_y: float = 0.0
    c_theta: float = 0.0
    loss_factor: float = 0.0
    points: int | None = None
    name: str = field(default="", compare=False)

    columns_of: ClassVar[tuple[str, ...]] = ("length", *_LAYER_UNITS)

    def __post_init__(self) -> None:
        owner = f"SpreadJoint {self.name!r}" if self.name else "SpreadJoint"
        object.__setattr__(self, "length", _checks.positive(owner, "length", self.length, unit="m"))
        for quantity in ("shank", "sleeve"):
            if not isinstance(getattr(self, quantity), Section):
                raise TypeError(f"{owner}: {quantity} is {getattr(self, quantity)!r}, expected a Section")
        for quantity, unit in _LAYER_UNITS.items():
            value = _checks.not_negative(owner, quantity, getattr(self, quantity), unit=unit)
            object.__setattr__(self, quantity, value)
        if self.sleeve.core is not None:
            raise ValueError(f"{owner}: sleeve has a core, expected an open bore in which the shank lies")
        if self.shank.outer_diameter > _LARGEST_FIT * self.sleeve.inner_diameter:
            raise ValueError(
                f"{owner}: shank.outer_diameter is {self.shank.outer_diameter:g} m, expected at most the sleeve's bore "
                f"of {self.sleeve.inner_diameter:g} m (and 2 % for an interference fit)"
            )
        points = self.points
        if points is not None and (isinstance(points, bool) or not isinstance(points, int)):
            raise TypeError(f"{owner}: points is {points!r}, expected None (a layer) or a whole number")
        if points is not None and not 1 <= points <= _MOST_POINTS:
            raise ValueError(f"{owner}: points is {points}, expected 1 to {_MOST_POINTS}, or None for a layer")
        if self.k_y == 0.0 and self.c_y == 0.0:
            raise ValueError(f"{owner}: k_y and c_y are both zero, so nothing holds the translation; give k_y or c_y")
        if points == 1 and self.k_theta == 0.0 and self.c_theta == 0.0:
            raise ValueError(
                f"{owner}: k_theta and c_theta are both zero, so one point alone leaves the rotation free; give "
                "k_theta or c_theta, or more points"
            )

    def columns(self) -> tuple[float, ...]:
        """Return the columns of the overlap table that follow the two nodes."""
        layer = (self.k_y, self.k_theta, self.c_y, self.c_theta, self.loss_factor)
        return (self.length, *self.shank.columns(), *self.sleeve.columns(), *layer, float(self.points or 0))
