"""The simulated machine of the table 3 study: holder and blank of the published study in a spindle of our own.

VIRTUAL: the paper prints neither the spindle nor the measured response, so both are simulated. The blank, the holder
(inferred, not published) and the joint that is taken as true are those of the ER32 study.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from receptance.assembly import Assembly
from receptance.beams import Part, Segment
from receptance.identification import Floor, MeasuredFRF, Tolerance, Unknown
from receptance.identification.mapping import Parameters, Place
from receptance.identification.unknowns import covered
from receptance.joints import GroundSpring, PointJoint
from receptance.studies.er32.holder import HolderModel, load_holder
from receptance.studies.er32.tables import Published, load

if TYPE_CHECKING:
    from collections.abc import Mapping

__all__ = ["Measuring", "VirtualMachine", "damping_bounds"]

DIAMETER_MM = 9.53
"""The tool of table 3."""
_STEEL_LOSS = 0.002
_CARBIDE_LOSS = 0.001
_TRUE_C_Y = 200.0
"""N s/m. The paper prints c_theta for its curve-fitted set but no c_y; this is assumed."""
_MOST_LOSS = 0.12
"""Loss factor of the true stiffness at the tool's mode that no metallic interface exceeds: bounds the dampings."""
_TOOL_MODE_HZ = 720.0
_BOUNDS = {"joint.k_y": (1e6, 1e13), "joint.k_theta": (1e2, 1e13)}


def damping_bounds(k_y: float, k_theta: float) -> dict[str, tuple[float, float]]:
    """Return bounds of the dampings, from a thousandth of a per cent to what no metallic interface exceeds."""
    w = 2.0 * np.pi * _TOOL_MODE_HZ
    return {
        name: (1e-5 * stiffness / w, _MOST_LOSS * stiffness / w)
        for name, stiffness in (("joint.c_y", k_y), ("joint.c_theta", k_theta))
    }


@dataclass(frozen=True, kw_only=True)
class Measuring:
    """How responses are measured.

    Attributes
    ----------
    coherence, averages : float, int
        Of every line; sd of the log response sqrt((1 - g2) / (2 (n - 1) g2)).
    step_hz : float
        Distance of the lines.
    machine_hz, free_hz : tuple of float
        Band of the tests in the machine, and of the free ones.
    """

    coherence: float = 0.98
    averages: int = 10
    step_hz: float = 5.0
    machine_hz: tuple[float, float] = (100.0, 2000.0)
    free_hz: tuple[float, float] = (200.0, 12500.0)

    @property
    def noise(self) -> float:
        """Standard deviation of real and imaginary part of the log response, on every line."""
        return float(np.sqrt((1.0 - self.coherence) / (2.0 * (self.averages - 1) * self.coherence)))

    def lines(self, *, free: bool) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
        """Return the lines of a test."""
        low, high = self.free_hz if free else self.machine_hz
        return np.arange(low, high + 0.5 * self.step_hz, self.step_hz)


@dataclass(frozen=True, kw_only=True)
class VirtualMachine:
    """Blank, joint and holder, free or in a simulated spindle, with true values, tolerances and noise.

    Attributes
    ----------
    holder : HolderModel
        Inferred, not published.
    published : Published
        The tables.
    truth : dict of str to float
        The joint that is simulated: table 3's curve-fitted set.
    measuring : Measuring
        Noise and lines.
    """

    holder: HolderModel
    published: Published
    truth: dict[str, float]
    measuring: Measuring

    @classmethod
    def load(cls, measuring: Measuring | None = None) -> VirtualMachine:
        """Return the machine of the study."""
        holder, published = load_holder(), load()
        true = next(s for s in published.parameter_sets if s.name == "curve_fitted")
        damping = published_c_theta()
        return cls(
            holder=replace(
                holder,
                steel=replace(holder.steel, loss_factor=_STEEL_LOSS),
                carbide=replace(holder.carbide, loss_factor=_CARBIDE_LOSS),
            ),
            published=published,
            truth={
                "joint.k_y": true.k_y,
                "joint.k_theta": true.k_theta,
                "joint.c_y": _TRUE_C_Y,
                "joint.c_theta": damping,
            },
            measuring=measuring or Measuring(),
        )

    @property
    def long_mm(self) -> float:
        """Overhang of the test in the machine: the long tool."""
        return self.published.long_overhang(DIAMETER_MM)

    @property
    def shorter_mm(self) -> tuple[float, ...]:
        """The other overhangs of this tool in tables 1 and 2, the longer one first."""
        short = [t.overhang_mm for t in self.published.transfers if t.diameter_mm == DIAMETER_MM]
        listed = {*short, self.published.mount(DIAMETER_MM).overhang_mm} - {self.long_mm}
        return tuple(sorted(listed, reverse=True))

    def free(self, overhang_mm: float) -> Assembly:
        """Return the free assembly with the true joint."""
        length = self.published.mount(DIAMETER_MM).holder_length_mm
        stiffness = self.truth["joint.k_y"], self.truth["joint.k_theta"]
        return self.holder.assembly(DIAMETER_MM, overhang_mm, length, *stiffness).replace(self.truth)

    def mounted(self, overhang_mm: float) -> Assembly:
        """Return the assembly in the spindle with the true joint."""
        row = self.free(overhang_mm).elements
        steel = replace(self.holder.steel, loss_factor=_STEEL_LOSS)
        shaft = [
            Segment(length=length, outer_diameter=outer, inner_diameter=0.03, material=steel)
            for length, outer in ((0.08, 0.07), (0.25, 0.065))
        ]
        taper = PointJoint(k_y=1.5e9, k_theta=2e6, loss_factor=0.02, name="taper")
        bearings = [
            GroundSpring(k_y=3e8, k_theta=5e4, c_y=2e3, part="spindle", position=0.08, name="front"),
            GroundSpring(k_y=2e8, c_y=2e3, part="spindle", position=0.30, name="rear"),
        ]
        return Assembly([row["tool"], row["joint"], row["holder"], taper, Part(shaft, name="spindle")], bearings)

    def assembly(self, overhang_mm: float, *, free: bool) -> Assembly:
        """Return either."""
        return self.free(overhang_mm) if free else self.mounted(overhang_mm)

    @property
    def unknowns(self) -> list[Unknown]:
        """The joint, over as many decades as table 3 spans, its dampings within a physical bound."""
        bounds = _BOUNDS | damping_bounds(self.truth["joint.k_y"], self.truth["joint.k_theta"])
        return [Unknown(address=address, lower=low, upper=high) for address, (low, high) in bounds.items()]

    def tolerances(self, places: Mapping[str, Assembly]) -> list[Tolerance]:
        """Return the errors of the things that these configurations have; every clamping has its own overhang."""
        shared = (
            ("carbide E", {"tool.segment[0].youngs_modulus": 0.01}, True),
            ("carbide density", {"tool.segment[0].density": 0.005}, True),
            ("blank diameter", {"tool.segment[0].outer_diameter": 5e-6}, False),
            ("steel E", {"holder.segment[*].youngs_modulus": 0.01}, True),
            ("holder turned", {"holder.segment[*].outer_diameter": 1e-4}, False),
            ("taper k_y", {"taper.k_y": 0.1}, True),
            ("taper k_theta", {"taper.k_theta": 0.1}, True),
            ("front bearing", {"front.k_y": 0.1}, True),
            ("rear bearing", {"rear.k_y": 0.1}, True),
        )
        found = [Tolerance(name=name, moves=moves, relative=relative) for name, moves, relative in shared]
        found += [
            Tolerance(name=f"overhang, {name}", moves={"tool.segment[0].length": 1e-4}, configurations=(name,))
            for name in places
        ]
        return [t for t in found if any(covered(a, p) for a in t.moves for p in places.values())]

    def measure(
        self,
        name: str,
        overhang_mm: float,
        *,
        free: bool,
        values: Mapping[str, float],
        errors: Mapping[str, float],
        random: np.random.Generator | None = None,
    ) -> MeasuredFRF:
        """Return a tip response as it would be measured.

        Parameters
        ----------
        name : str
            Of the configuration.
        overhang_mm, free
            Which assembly.
        values : mapping of str to float
            The joint, by address.
        errors : mapping of str to float
            By name of the tolerance, in standard deviations; what is not in it is zero.
        random : Generator, optional
            Source of noise; without it there is none, but the standard deviations are the same.
        """
        nominal, lines = self.assembly(overhang_mm, free=free), self.measuring.lines(free=free)
        parameters = Parameters(self.unknowns, self.tolerances({name: nominal}), [Place(nominal, name)])
        vector = [values.get(u.name, errors.get(u.name, 0.0)) for u in parameters.unknowns]
        true = parameters.at(Place(nominal, name)).apply(nominal, np.array(vector))
        response = true.receptance(lines)
        spread = np.sqrt(self.measuring.noise**2 + Floor().variance(lines, response))
        if random is not None:
            scatter = random.standard_normal(lines.size) + 1j * random.standard_normal(lines.size)
            response = response * np.exp(spread * scatter)
        return MeasuredFRF(
            assembly=nominal,
            frequency_hz=lines,
            receptance=response,
            standard_deviation=spread,
            label=name,
            configuration=name,
        )


def published_c_theta() -> float:
    """Return the rotational damping of table 3's curve-fitted set, N m s/rad."""
    from receptance.studies._data import number, read_table

    rows = read_table("er32_table3_parameter_sets.csv")
    return number(next(row for row in rows if row["set"] == "curve_fitted"), "c_theta_nms_per_rad")
