"""The machines and the tools of `machines.py`, and simulated hammer tests of a blank in a machine. VIRTUAL."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

import er32_tables
import receptance as rc
from receptance.hammer import estimate_frf, find_hits, simulate_hits

STEEL = replace(rc.STEEL, loss_factor=0.002)
CARBIDE_LOSS, JOINT_LOSS = 0.001, 0.02
BAND_HZ = (150.0, 5000.0)
"""Band in which the spindles are fitted and the tools predicted."""


@dataclass(frozen=True)
class Tool:
    """A blank of table 5 in a collet."""

    diameter_mm: float
    overhang_mm: float
    length: str
    k_y: float
    k_theta: float

    def __str__(self) -> str:
        return f"{self.diameter_mm:g} mm, {self.length} ({self.overhang_mm:g} mm)"


@dataclass(frozen=True)
class Machine:
    """A spindle on bearings, the part of a holder outside it, and a gauge blank.

    `shaft_mm` holds length and diameter by section, `bearings` position in m, stiffness in N/m and damping in N s/m,
    `holder_mm` length and diameter by section, None for the inferred holder.
    """

    name: str
    shaft_mm: Sequence[tuple[float, float]]
    bearings: Sequence[tuple[float, float, float]]
    taper: rc.PointJoint
    holder_mm: Sequence[tuple[float, float]] | None
    blank_mm: float = 100.0
    second_hit_mm: float = 70.0

    @property
    def spindle(self) -> rc.Assembly:
        """The true spindle: the inner part of the taper, its joint, the shaft."""
        inside = rc.Part([rc.Segment(length=0.004, outer_diameter=0.06, material=STEEL)], name="inside")
        grounds = [
            rc.GroundSpring(k_y=k, c_y=c, part="shaft", position=x, name=f"bearing_{i}")
            for i, (x, k, c) in enumerate(self.bearings)
        ]
        return rc.Assembly([inside, self.taper, part("shaft", self.shaft_mm, bore=0.03)], grounds)

    @property
    def blank(self) -> rc.Part:
        """The gauge blank."""
        segment = rc.Segment(length=1e-3 * self.blank_mm, outer_diameter=0.05, material=rc.STEEL)
        return rc.Part([segment], name="blank")

    def front(self, tool: Tool) -> list[Any]:
        """Return tool, joint and holder."""
        blank, joint, whole = er32_tables.assembly(
            tool.diameter_mm, tool.overhang_mm, tool.k_y, tool.k_theta
        ).elements.values()
        assert isinstance(blank, rc.Part)
        assert isinstance(joint, rc.PointJoint)
        assert isinstance(whole, rc.Part)
        holder = (
            part("holder", self.holder_mm or ())
            if self.holder_mm
            else lossy(rc.Part(whole.segments[:3], name="holder"))
        )
        return [lossy(blank, CARBIDE_LOSS), replace(joint, loss_factor=JOINT_LOSS), holder]

    def in_spindle(self, chain: Sequence[Any]) -> rc.Assembly:
        """Return parts in the true spindle."""
        spindle = self.spindle
        return rc.Assembly([*chain, *spindle.elements.values()], spindle.attachments.values())

    def matrix(self, lines: np.ndarray) -> np.ndarray:
        """Return the true receptance matrix of the spindle at its plane, `(n, 2, 2)`."""
        plane = [rc.Coordinate("inside", 0.0, "y"), rc.Coordinate("inside", 0.0, "theta")]
        return self.spindle.receptance(lines, response=plane, excitation=plane)

    def measure(self, hits: int, seed: int, high_hz: float) -> list[rc.Observation]:
        """Simulate hammer tests of the blank in the spindle: both drive points and the response between them."""
        tip, near = rc.Coordinate("blank", 0.0), rc.Coordinate("blank", 1e-3 * self.second_hit_mm)
        names = {tip: "tip", near: "near the spindle"}
        found = []
        for number, (excitation, responses) in enumerate(((tip, (tip, near)), (near, (near,)))):
            records = simulate_hits(
                self.in_spindle([self.blank]),
                response=responses,
                excitation=excitation,
                hits=hits,
                seed=2 * seed + number,
                duration_s=0.2,
                contact_s=1.5e-4,
                peak=400.0,
            )
            frf = estimate_frf(find_hits(records))
            found += [
                rc.Observation.from_frf(
                    rc.Assembly([self.blank]),
                    frf,
                    response=response,
                    excitation=excitation,
                    low_hz=BAND_HZ[0],
                    high_hz=high_hz,
                    label=f"{names[response]} from {names[excitation]}",
                )
                for response in responses
            ]
        return found


def part(name: str, sections_mm: Sequence[tuple[float, float]], bore: float = 0.0) -> rc.Part:
    """Return a part of steel from lengths and diameters in mm."""
    return rc.Part(
        [
            rc.Segment(length=1e-3 * length, outer_diameter=1e-3 * outer, inner_diameter=bore, material=STEEL)
            for length, outer in sections_mm
        ],
        name=name,
    )


def lossy(own: rc.Part, loss_factor: float = STEEL.loss_factor) -> rc.Part:
    """Return a part with a loss factor of its materials."""
    segments = [replace(s, material=replace(s.material, loss_factor=loss_factor)) for s in own.segments]
    return rc.Part(segments, name=own.name)


MACHINES = (
    Machine(
        name="Mori Seiki NT3150 DCG",
        shaft_mm=((60.0, 85.0), (300.0, 70.0)),
        bearings=((0.06, 3e8, 3e3), (0.09, 2e8, 2e3), (0.32, 2e8, 4e3)),
        taper=rc.PointJoint(k_y=1.5e9, k_theta=2e6, loss_factor=0.02, name="taper"),
        holder_mm=None,
    ),
    Machine(
        name="Quaser UX600",
        shaft_mm=((70.0, 95.0), (260.0, 80.0)),
        bearings=((0.05, 4e8, 3e3), (0.27, 2.5e8, 5e3)),
        taper=rc.PointJoint(k_y=2.5e9, k_theta=3.5e6, loss_factor=0.02, name="taper"),
        holder_mm=((16.0, 36.0), (30.0, 50.0), (24.0, 63.0)),
    ),
)


def tools(*lengths: str) -> list[Tool]:
    """Return the tools of the lengths "short" (tables 1 and 2), "medium" and "long" (table 5)."""
    published = er32_tables.load()
    found = []
    for row in published.setups:
        listed = [t.overhang_mm for t in published.transfers if t.diameter_mm == row.diameter_mm]
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
    return found
