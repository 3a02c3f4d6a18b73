"""Elastic and rigid holders on the springs of the taper, as assemblies."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

from receptance import _checks
from receptance.model.assembly import Assembly
from receptance.model.beams import Part
from receptance.model.joints import GroundSpring
from receptance.taper.rigid import Body, as_rigid, body_of

BodyModel = Literal["elastic", "rigid"]
Contact = Literal["spread", "fading", "ends"]

_BONDED = 1e16
"""Stiffness in N/m of a bonded taper, far above that of any section of a holder."""
_POINTS = 12
"""Number of points of the springs along the taper."""
_FADING = tuple(
    tuple(((i + 0.5) / _POINTS) ** 2 for i in order) for order in (range(_POINTS - 1, -1, -1), range(_POINTS))
)


@dataclass(frozen=True, kw_only=True)
class Holder:
    """A holder and the position of its taper.

    Parameters
    ----------
    part : Part
        The holder from the tip to the pull stud.
    big_end, small_end : float
        Ends of the taper, in m from the tip.

    Raises
    ------
    ValueError, TypeError
        Ends outside the part or in the wrong order.

    Examples
    --------
    >>> from receptance import STEEL, Part, Segment
    >>> from receptance.taper import Holder
    >>> flange = Segment(length=0.04, outer_diameter=0.1, material=STEEL)
    >>> taper = Segment(length=0.1, outer_diameter=0.055, material=STEEL)
    >>> holder = Holder(part=Part([flange, taper], name="holder"), big_end=0.04, small_end=0.14)
    >>> springs = {"k_z1": 5e9, "c_z1": 1500.0}
    >>> [holder.axial(**springs, body=body).natural_frequencies(1e4).round() for body in ("elastic", "rigid")]
    [array([5091.]), array([5408.])]
    """

    part: Part
    big_end: float
    small_end: float

    def __post_init__(self) -> None:
        if not isinstance(self.part, Part):
            raise TypeError(f"Holder: part is {self.part!r}, expected a Part")
        big = _checks.not_negative("Holder", "big_end", self.big_end, unit="m")
        small = _checks.positive("Holder", "small_end", self.small_end, unit="m")
        if not big < small <= self.part.length * (1.0 + 1e-9):
            raise ValueError(
                f"Holder: big_end is {big:g} m and small_end {small:g} m, expected 0 <= big_end < small_end <= "
                f"{self.part.length:g} m, the length of the part"
            )

    @cached_property
    def body(self) -> Body:
        """Mass, centre of gravity and moment of inertia."""
        return body_of(self.part)

    @property
    def z1(self) -> float:
        """Distance in m of the big end from the centre of gravity towards the tip: L1 of the paper."""
        return self.body.position(self.big_end)

    @property
    def z2(self) -> float:
        """Distance in m of the small end from the centre of gravity towards the tip: -L2 of the paper."""
        return self.body.position(self.small_end)

    def axial(
        self, k_z1: float, c_z1: float = 0.0, *, body: BodyModel = "elastic", contact: Contact = "spread"
    ) -> Assembly:
        """Return the holder on the axial spring `taper`, in axial motion.

        Parameters
        ----------
        k_z1, c_z1 : float
            Stiffness in N/m and damping in N s/m of the whole taper.
        body : {"elastic", "rigid"}, optional
            Elastic rods, or rigid ones as in the paper.
        contact : {"spread", "fading", "ends"}, optional
            Uniform along the taper; concentrated at both ends, as the paper infers from wear; or at the big end only,
            as in figure 3 of the paper.
        """
        _checks.one_of("Holder", "contact", contact, Contact)
        length = 0.0 if contact == "ends" else self.small_end - self.big_end
        weights = [1.0] * _POINTS if contact != "fading" else [a + b for a, b in zip(*_FADING, strict=True)]
        spring = GroundSpring(
            k_y=k_z1,
            c_y=c_z1,
            part=self._name,
            position=self.big_end,
            length=length,
            weights=tuple(weights),
            name="taper",
        )
        return Assembly([self._part(body)], [spring], motion="axial")

    def radial(
        self,
        k_x1: float,
        k_x2: float,
        c_x1: float = 0.0,
        c_x2: float = 0.0,
        *,
        body: BodyModel = "elastic",
        contact: Contact = "spread",
    ) -> Assembly:
        """Return the holder on the radial springs `big_end` and `small_end`, in bending.

        Parameters
        ----------
        k_x1, k_x2 : float
            Stiffnesses in N/m, at the big and at the small end.
        c_x1, c_x2 : float, optional
            Dampings in N s/m.
        body : {"elastic", "rigid"}, optional
            Elastic beams, or rigid ones as in the paper.
        contact : {"spread", "fading", "ends"}, optional
            Each spring uniform over its half of the taper, as in figure 15 of the paper; over the whole taper, weighted
            with the square of the distance from the other end; or at the end only.
        """
        _checks.one_of("Holder", "contact", contact, Contact)
        share = {"spread": 0.5, "fading": 1.0, "ends": 0.0}[contact]
        length = share * (self.small_end - self.big_end)
        # Fading springs share their points; the other two divide the points between them.
        count = _POINTS if contact == "fading" else _POINTS // 2
        weights = _FADING if contact == "fading" else [(1.0,) * count] * 2
        springs = [
            GroundSpring(k_y=k, c_y=c, part=self._name, position=start, length=length, weights=shares, name=name)
            for name, k, c, start, shares in (
                ("big_end", k_x1, c_x1, self.big_end, weights[0]),
                ("small_end", k_x2, c_x2, self.small_end - length, weights[1]),
            )
        ]
        return Assembly([self._part(body)], springs)

    def bonded(self, motion: Literal["axial", "bending"]) -> Assembly:
        """Return the limit of stiff springs, in which the taper is bonded to a rigid spindle."""
        if motion == "axial":
            return self.axial(_BONDED)
        return self.radial(_BONDED, _BONDED)

    @property
    def _name(self) -> str:
        return self.part.name or "holder"

    def _part(self, body: BodyModel) -> Part:
        named = Part(self.part.segments, name=self._name)
        _checks.one_of("Holder", "body", body, BodyModel)
        return as_rigid(named) if body == "rigid" else named
