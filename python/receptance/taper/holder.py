"""The elastic holder in its taper: the same springs in the one forward model."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal, get_args

from receptance import _checks
from receptance.assembly import Assembly
from receptance.beams import Part
from receptance.joints import GroundSpring
from receptance.taper.body import Body, as_rigid, body_of

__all__ = ["BodyModel", "Contact", "Holder"]

BodyModel = Literal["elastic", "rigid"]
Contact = Literal["spread", "fading", "ends"]

_BONDED = 1e16
"""N/m, of the whole taper: far above what any section of a holder has."""
_POINTS = 12
_FADING = tuple(
    tuple(((i + 0.5) / _POINTS) ** 2 for i in order) for order in (range(_POINTS - 1, -1, -1), range(_POINTS))
)


@dataclass(frozen=True, kw_only=True)
class Holder:
    """A holder and the part of it that lies in the spindle's taper.

    Parameters
    ----------
    part : Part
        From the tip to the pull stud.
    big_end, small_end : float
        Where the taper begins and ends, in m from the tip.

    Raises
    ------
    ValueError, TypeError
        Ends that are not on the part, or in the wrong order.

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
                f"Holder: big_end is {big:g} m and small_end {small:g} m, expected two places along the part of "
                f"{self.part.length:g} m, the big end nearer to the tip"
            )

    @cached_property
    def body(self) -> Body:
        """Mass, centre of gravity and inertia."""
        return body_of(self.part)

    @property
    def z1(self) -> float:
        """Place of the big end from the centre of gravity towards the tip, in m: L1 of the paper."""
        return self.body.position(self.big_end)

    @property
    def z2(self) -> float:
        """Place of the small end: -L2 of the paper."""
        return self.body.position(self.small_end)

    def axial(
        self, k_z1: float, c_z1: float = 0.0, *, body: BodyModel = "elastic", contact: Contact = "spread"
    ) -> Assembly:
        """Return the holder on its axial spring `taper`, in axial motion.

        Parameters
        ----------
        k_z1, c_z1 : float
            Stiffness in N/m and damping in N s/m of the whole taper.
        body : {"elastic", "rigid"}, optional
            Rods of the holder's material, or as good as rigid ones: the model of the paper.
        contact : {"spread", "fading", "ends"}, optional
            Evenly along the taper; more at its ends, as the paper argues from wear; or at its big end alone, as in the
            paper's figure 3.
        """
        length = 0.0 if _known("contact", contact, Contact) == "ends" else self.small_end - self.big_end
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
        """Return the holder on its radial springs `big_end` and `small_end`, in bending.

        Parameters
        ----------
        k_x1, k_x2 : float
            Stiffnesses in N/m, at the big and at the small end.
        c_x1, c_x2 : float, optional
            Dampings in N s/m.
        body : {"elastic", "rigid"}, optional
            Beams of the holder's material, or as good as rigid ones: the model of the paper.
        contact : {"spread", "fading", "ends"}, optional
            Each spring evenly over the half of the taper at its end, as in the paper's figure 15; over the whole taper,
            fading with the square of the distance from the other end; or at the very end.
        """
        whole = self.small_end - self.big_end
        part = {"spread": 0.5, "fading": 1.0, "ends": 0.0}[_known("contact", contact, Contact)]
        places = (self.big_end, self.small_end - part * whole)
        # The fading springs share their points, so that these are no finer than those of the other two.
        count = _POINTS if contact == "fading" else _POINTS // 2
        weights = _FADING if contact == "fading" else [(1.0,) * count] * 2
        stiffness, damping = (k_x1, k_x2), (c_x1, c_x2)
        springs = [
            GroundSpring(
                k_y=stiffness[i],
                c_y=damping[i],
                part=self._name,
                position=places[i],
                length=part * whole,
                weights=weights[i],
                name=name,
            )
            for i, name in enumerate(("big_end", "small_end"))
        ]
        return Assembly([self._part(body)], springs)

    def bonded(self, motion: Literal["axial", "bending"]) -> Assembly:
        """Return the limit of stiff springs: the taper as one piece with a rigid spindle."""
        if motion == "axial":
            return self.axial(_BONDED)
        return self.radial(_BONDED, _BONDED)

    @property
    def _name(self) -> str:
        return self.part.name or "holder"

    def _part(self, body: BodyModel) -> Part:
        named = Part(self.part.segments, name=self._name)
        return as_rigid(named) if _known("body", body, BodyModel) == "rigid" else named


def _known(name: str, value: str, kinds: object) -> str:
    if value not in get_args(kinds):
        raise ValueError(f"Holder: {name} is {value!r}, expected one of {', '.join(get_args(kinds))}")
    return value
