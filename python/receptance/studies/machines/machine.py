"""Two virtual machines with the published tools: spindles of our own, blanks in them hit with a hammer, tools.

VIRTUAL: the paper prints neither its spindles nor the measured responses, so both are simulated here. Tools, overhangs
and joints are those of its table 5; the holder of the first machine is the inferred one, that of the second is another
of the same kind, as in the paper.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from receptance.assembly import Assembly
from receptance.beams import Part, Segment
from receptance.coordinates import Coordinate
from receptance.identification import MeasuredFRF
from receptance.joints import GroundSpring, PointJoint
from receptance.materials import STEEL
from receptance.studies.er32.holder import load_holder
from receptance.studies.er32.tables import load

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.frf import FRF
    from receptance.modal_parts import ModalPart
    from receptance.terminals import MeasuredPart

__all__ = ["MACHINES", "Test", "Tool", "VirtualMachine", "tools"]

_LOSSY = replace(STEEL, loss_factor=0.002)
_JOINT_LOSS = 0.02
"""Loss factor of the tools' joints, assumed."""
_CARBIDE_LOSS = 0.001


@dataclass(frozen=True)
class Tool:
    """A blank of table 5 in a holder's collet."""

    diameter_mm: float
    overhang_mm: float
    length: str
    k_y: float
    k_theta: float

    @property
    def name(self) -> str:
        """As in the figures."""
        return f"{self.diameter_mm:g} mm, {self.length} ({self.overhang_mm:g} mm)"


def tools(*lengths: str) -> tuple[Tool, ...]:
    """Return the tools of some of the lengths "short" (tables 1 and 2), "medium" and "long" (table 5)."""
    published = load()
    found = []
    for row in published.machine:
        listed = [one.overhang_mm for one in published.transfers if one.diameter_mm == row.diameter_mm]
        shortest = min([*listed, published.mount(row.diameter_mm).overhang_mm])
        overhangs = {
            "short": shortest if shortest < 0.7 * row.overhang_medium_mm else None,
            "medium": row.overhang_medium_mm,
            "long": row.overhang_long_mm,
        }
        for length in lengths:
            overhang = overhangs[length]
            if overhang is not None:
                found.append(Tool(row.diameter_mm, overhang, length, row.k_y, row.k_theta))
    return tuple(found)


class Test(NamedTuple):
    """A hammer test: its FRF, and which response of it to which hit."""

    frf: FRF
    response: Coordinate
    excitation: Coordinate


@dataclass(frozen=True)
class VirtualMachine:
    """A spindle on two bearings, the part of a holder outside it, and a gauge blank.

    Attributes
    ----------
    name : str
        Of the machine that it stands for.
    shaft_mm : tuple of (float, float)
        Length and outer diameter of the shaft's sections.
    bearings : tuple of (float, float, float)
        Place in m, stiffness in N/m and damping in N s/m.
    taper : PointJoint
        Between spindle and what is clamped.
    holder_mm : tuple of (float, float), or None
        Length and diameter of the holder's sections outside; None for the inferred holder's.
    blank_mm, near_mm : float
        Length of the gauge blank of 50 mm, and where it is hit besides its tip.
    """

    name: str
    shaft_mm: tuple[tuple[float, float], ...]
    bearings: tuple[tuple[float, float, float], ...]
    taper: PointJoint
    holder_mm: tuple[tuple[float, float], ...] | None
    blank_mm: float = 100.0
    near_mm: float = 70.0

    @property
    def spindle(self) -> Assembly:
        """The true spindle from its plane on: what of the taper is inside, its joint, the shaft."""
        inside = Part([Segment(length=0.004, outer_diameter=0.06, material=_LOSSY)], name="inside")
        sections = [
            Segment(length=1e-3 * length, outer_diameter=1e-3 * outer, inner_diameter=0.03, material=_LOSSY)
            for length, outer in self.shaft_mm
        ]
        grounds = [
            GroundSpring(k_y=k, c_y=c, part="shaft", position=x, name=f"bearing_{number}")
            for number, (x, k, c) in enumerate(self.bearings)
        ]
        return Assembly([inside, replace(self.taper, name="taper"), Part(sections, name="shaft")], grounds)

    @property
    def blank(self) -> Assembly:
        """The gauge blank alone."""
        segment = Segment(length=1e-3 * self.blank_mm, outer_diameter=0.05, material=STEEL)
        return Assembly([Part([segment], name="blank")])

    @property
    def holder(self) -> Part:
        """The part of the holder outside the spindle."""
        if self.holder_mm is None:
            whole = load_holder().assembly(12.7, 62.3, 129.0, 1e8, 1e5).elements["holder"]
            assert isinstance(whole, Part)
            return Part([_lossy(segment) for segment in whole.segments[:3]], name="holder")
        return Part(
            [Segment(length=1e-3 * length, outer_diameter=1e-3 * d, material=_LOSSY) for length, d in self.holder_mm],
            name="holder",
        )

    def front(self, tool: Tool) -> list[Part | PointJoint]:
        """Return tool, joint and holder."""
        carbide = replace(load_holder().carbide, loss_factor=_CARBIDE_LOSS)
        segment = Segment(length=1e-3 * tool.overhang_mm, outer_diameter=1e-3 * tool.diameter_mm, material=carbide)
        joint = PointJoint(k_y=tool.k_y, k_theta=tool.k_theta, loss_factor=_JOINT_LOSS, name="joint")
        return [Part([segment], name="tool"), joint, self.holder]

    def true(self, tool: Tool) -> Assembly:
        """Return the whole machine with a tool, all of it as beams."""
        return self._in_spindle(self.front(tool))

    def predicted(self, tool: Tool, spindle: MeasuredPart | ModalPart) -> Assembly:
        """Return the tool in an identified spindle."""
        return Assembly([*self.front(tool), spindle])

    def matrix(self, lines: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return the true spindle's receptance at its plane, `(n, 2, 2)`."""
        plane = [Coordinate("inside", 0.0, "y"), Coordinate("inside", 0.0, "theta")]
        return self.spindle.receptance(lines, response=plane, excitation=plane)

    def hit(self, *, hits: int, seed: int) -> list[Test]:
        """Return what hammer tests of the blank in the spindle give: both drive points, and what is between them."""
        from receptance.measurement import estimate_frf, find_hits, simulate_hits

        machine = self._in_spindle(self.blank.elements.values())
        tip, near = Coordinate("blank", 0.0), Coordinate("blank", 1e-3 * self.near_mm)
        found = []
        for number, (excitation, responses) in enumerate(((tip, (tip, near)), (near, (near,)))):
            records = simulate_hits(
                machine,
                response=responses,
                excitation=excitation,
                hits=hits,
                seed=2 * seed + number,
                duration_s=0.2,
                contact_s=1.5e-4,
                peak=400.0,
            )
            frf = estimate_frf(find_hits(records))
            found += [Test(frf, response, excitation) for response in responses]
        return found

    def observed(self, tests: list[Test], low_hz: float, high_hz: float) -> list[MeasuredFRF]:
        """Return the tests of the blank as observations, in a band."""
        return [
            MeasuredFRF.from_frf(
                self.blank,
                one.frf,
                response=one.response,
                excitation=one.excitation,
                low_hz=low_hz,
                high_hz=high_hz,
                label=f"{_place(one.response)} from {_place(one.excitation)}",
            )
            for one in tests
        ]

    def _in_spindle(self, chain: Iterable[Any]) -> Assembly:
        spindle = self.spindle
        points = [replace(point, name=name) for name, point in spindle.attachments.items()]
        return Assembly([*chain, *spindle.elements.values()], points)


def _place(point: Coordinate) -> str:
    return "tip" if point.position == 0.0 else "near the spindle"


def _lossy(segment: Segment) -> Segment:
    return replace(segment, material=replace(segment.material, loss_factor=_LOSSY.loss_factor))


MACHINES = (
    VirtualMachine(
        name="Mori Seiki NT3150 DCG",
        shaft_mm=((60.0, 85.0), (300.0, 70.0)),
        bearings=((0.06, 3e8, 3e3), (0.09, 2e8, 2e3), (0.32, 2e8, 4e3)),
        taper=PointJoint(k_y=1.5e9, k_theta=2e6, loss_factor=0.02),
        holder_mm=None,
    ),
    VirtualMachine(
        name="Quaser UX600",
        shaft_mm=((70.0, 95.0), (260.0, 80.0)),
        bearings=((0.05, 4e8, 3e3), (0.27, 2.5e8, 5e3)),
        taper=PointJoint(k_y=2.5e9, k_theta=3.5e6, loss_factor=0.02),
        holder_mm=((16.0, 36.0), (30.0, 50.0), (24.0, 63.0)),
    ),
)
"""The paper's two machines, each with a spindle of our own: VIRTUAL."""
