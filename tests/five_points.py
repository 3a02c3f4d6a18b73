"""A machine as users have it: a sensor at the tip, hits at five points of tool and holder, a spindle never measured.

`simulated` is a machine of finite elements that shares no physics with the package: shaft, bearings with masses and
dashpots, and a housing. `measured` reads a real one where its files are present. Both are written as one campaign, in
which the second and the fourth point are held out.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from blind.generator.elements import Ring, Structure, hutchinson
from receptance import FRF, campaign, io

MEASURED = Path(__file__).resolve().parents[2] / "shared" / "measured" / "tool_in_spindle"
"""Five files `Point_1_Channel_1_CH1.txt` ...: frequency in Hz, real and imaginary part of the receptance in m/N."""
HELD_OUT = (1, 3)
BAND_HZ = (300.0, 3300.0)
_STEEL = {"modulus": 210e9, "density": 7850.0, "poisson": 0.3, "loss": 0.003}
_CARBIDE = {"modulus": 580e9, "density": 14400.0, "poisson": 0.22, "loss": 0.002}


@dataclass(frozen=True)
class Machine:
    """Five FRFs of a machine, response at the tip, and what an engineer knows of it."""

    frequency_hz: NDArray[np.float64]
    receptance: NDArray[np.complex128]
    """`(5, n)`, m/N."""
    deviation: NDArray[np.float64]
    """`(5, n)` standard deviation of the logarithm."""
    tool: tuple[tuple[float, float], ...]
    """Length and diameter of each segment in m."""
    holder: tuple[tuple[float, float], ...]
    places: tuple[tuple[str, float], ...]
    """Part, and distance from its tip-side end in m."""
    joint: dict[str, float] | None = None
    """True values, of a simulation."""

    @property
    def positions(self) -> NDArray[np.float64]:
        """Distances of the points from the tip in m."""
        overhang = sum(length for length, _ in self.tool)
        return np.array([x if part == "tool" else overhang + x for part, x in self.places])

    def interpolated(self) -> dict[str, float]:
        """Return the error in dB rms of the parabola through the other three points, of each held-out point."""
        z, used = self.positions, [i for i in range(5) if i not in HELD_OUT]
        found = {}
        for held in HELD_OUT:
            weights = [np.prod([(z[held] - z[b]) / (z[a] - z[b]) for b in used if b != a]) for a in used]
            ratio = np.abs(np.array(weights) @ self.receptance[used] / self.receptance[held])
            found[f"point {held + 1}"] = float(np.sqrt(np.mean((20.0 * np.log10(ratio)) ** 2)))
        return found

    def write(self, folder: Path, modes: int | str, *, tolerances: bool = True, further: str = "") -> campaign.Campaign:
        """Write campaign and data files into a folder and load them; `modes` is a number or "auto"."""
        text = f"{_materials(tolerances)}\n"
        for part, material in (("tool", "carbide"), ("holder", "steel")):
            for length, diameter in getattr(self, part):
                text += f'[[parts.{part}.segments]]\nlength = "{1e3 * length:.9g} mm"\n'
                text += f'outer_diameter = "{1e3 * diameter:.9g} mm"\nmaterial = "{material}"\n'
                if tolerances:
                    text += 'tolerance = { length = "0.1 mm", outer_diameter = "0.1 %" }\n'
        text += _REST.format(modes=json.dumps(modes)) + further
        for number, (part, x) in enumerate(self.places):
            h, deviation = self.receptance[number], self.deviation[number]
            frf = FRF(frequency_hz=self.frequency_hz, values=h, log_variance=deviation**2)
            io.write(folder / f"point_{number + 1}.npz", frf)
            role = "hold out" if number in HELD_OUT else "identify"
            text += f'\n[measurements."point {number + 1}"]\nkind = "frf"\nassembly = "machine"\nrole = "{role}"\n'
            text += f'file = "point_{number + 1}.npz"\nresponse = {{ part = "tool", position = "0 mm" }}\n'
            text += f'excitation = {{ part = "{part}", position = "{1e3 * x:.9g} mm" }}\n'
        (folder / "campaign.toml").write_text(text, encoding="utf-8")
        return campaign.load(folder)


_REST = """
[joints.joint]

[modal_parts.spindle]
identify = true
modes = {modes}

[assemblies.machine]
chain = ["tool", "joint", "holder", "spindle"]

[settings]
profiles = false

[unknowns]
"joint.k_y" = {{ lower = "1e7 N/m", upper = "1e10 N/m" }}
"joint.k_theta" = {{ lower = "5e3 N m/rad", upper = "5e6 N m/rad" }}
"joint.loss_factor" = {{ lower = 0.001, upper = 0.5 }}
"""


def _materials(tolerances: bool) -> str:
    text = ""
    for name, of in (("carbide", _CARBIDE), ("steel", _STEEL)):
        text += f'[materials.{name}]\nyoungs_modulus = "{1e-9 * of["modulus"]:g} GPa"\n'
        text += f'density = "{of["density"]:g} kg/m^3"\npoisson_ratio = {of["poisson"]}\nloss_factor = {of["loss"]}\n'
        if tolerances:
            text += 'tolerance = { youngs_modulus = "1 %", density = "0.5 %" }\n'
    return text


def measured(folder: Path = MEASURED, *, deviation: float = 0.05, step_hz: float = 5.0) -> Machine | None:
    """Return the real machine; None where its files are absent.

    github.com/leekunhwee/Vibration-Signal-Processing, ExperimentalModalAnalysis (commit d9edffe), without a licence: an
    end mill in a collet holder in a machine, hits at 0, 55, 90, 130 and 165 mm from the tip ("approximate"), 1 Hz
    lines, neither coherence nor repeats. Dimensions are not stated. Those here are from the photograph beside the
    data, scaled by the points: overhang 74 mm, of which 53 mm are flutes, shank 20 mm; nut 24 mm long, 50 mm wide; body
    52 mm, 46 mm; flange 25 mm, 63 mm. The flutes have 0.8 times the diameter of the shank, the usual estimate. The
    sensor's mass and the material are not stated either; carbide, because no steel tool is as stiff.
    """
    files = [folder / f"Point_{number}_Channel_1_CH1.txt" for number in range(1, 6)]
    if not all(file.is_file() for file in files):
        return None
    lines = np.arange(BAND_HZ[0], BAND_HZ[1] + 1.0, step_hz)
    rows = []
    for file in files:
        table = np.loadtxt(file)
        rows.append((table[:, 1] + 1j * table[:, 2])[np.isin(table[:, 0], lines)])
    return Machine(
        frequency_hz=lines,
        receptance=np.array(rows),
        deviation=np.full((5, lines.size), deviation),
        tool=((0.053, 0.016), (0.021, 0.020)),
        holder=((0.024, 0.050), (0.052, 0.046), (0.025, 0.063)),
        places=(("tool", 0.0), ("tool", 0.055), ("holder", 0.016), ("holder", 0.056), ("holder", 0.091)),
    )


def _ring(outer: float, inner: float = 0.0, *, of: dict[str, float] = _STEEL, stiffer: float = 1.0) -> list[Ring]:
    shear = hutchinson(outer, inner, of["poisson"])
    return [Ring(outer, inner, of["modulus"] * stiffer, of["density"], of["poisson"], of["loss"], shear)]


def simulated(
    seed: int,
    *,
    noise: float = 0.02,
    sensor: float = 0.0,
    tool_modulus: float = 1.0,
    delay: float = 0.0,
    gain: float = 0.0,
) -> Machine:
    """Return a random machine of finite elements, with noise and an effect that its description does not contain.

    Parameters
    ----------
    seed : int
        Of dimensions, joint, spindle and noise.
    noise : float, optional
        Standard deviation of an FRF relative to itself, and of a floor relative to its median: few hits.
    sensor : float, optional
        Mass in kg at the tip.
    tool_modulus : float, optional
        True over stated Young's modulus of the tool.
    delay : float, optional
        Delay of the sensor's channel in s.
    gain : float, optional
        Logarithm of measured over true magnitude.
    """
    rng = np.random.default_rng(seed)
    u = rng.uniform
    diameter = u(0.012, 0.02)
    overhang = u(3.5, 4.5) * diameter
    holder = ((u(0.022, 0.028), u(0.045, 0.052)), (u(0.04, 0.06), u(0.04, 0.048)), (0.025, 0.063))
    joint = {"k_y": 10 ** u(8.2, 8.9), "k_theta": 10 ** u(4.7, 5.5), "loss_factor": u(0.02, 0.06)}
    s = Structure()
    tip = s.station()
    if sensor:
        s.mass(tip, sensor)
    tool = _ring(diameter, of=_CARBIDE, stiffer=tool_modulus)
    middle = s.beam(tip, 0.6 * overhang, tool)
    end = s.beam(middle, 0.4 * overhang, tool)
    at = s.station()
    s.spring(end, at, np.diag([joint["k_y"], joint["k_theta"]]) * (1.0 + 1j * joint["loss_factor"]))
    stations, places, begin = [tip, middle], [("tool", 0.0), ("tool", 0.6 * overhang)], 0.0
    for (length, outer), share in zip(holder, (0.5, 0.6, 0.4), strict=True):
        stations.append(s.beam(at, share * length, _ring(outer)))
        places.append(("holder", begin + share * length))
        at = s.beam(stations[-1], (1.0 - share) * length, _ring(outer))
        begin += length
    _spindle(s, at, rng)
    lines = np.arange(BAND_HZ[0], BAND_HZ[1] + 1.0, 10.0)
    stiffness, inertia, damping = s.matrices()
    rows = [2 * station for station in stations]
    load = np.eye(s.size)[:, 0]
    solved = [np.linalg.solve(stiffness + 1j * w * damping - w * w * inertia, load)[rows] for w in 2.0 * np.pi * lines]
    h = np.array(solved).T * np.exp(gain - 2j * np.pi * lines * delay)
    deviation = noise * np.sqrt(0.5 + 0.5 * (np.median(np.abs(h), axis=1)[:, None] / np.abs(h)) ** 2)
    scatter = deviation * (rng.normal(size=h.shape) + 1j * rng.normal(size=h.shape))
    return Machine(
        frequency_hz=lines,
        receptance=h * np.exp(scatter),
        deviation=deviation,
        tool=((overhang, diameter),),
        holder=holder,
        places=tuple(places),
        joint=joint,
    )


def _spindle(s: Structure, plane: int, rng: np.random.Generator) -> None:
    """Add taper, shaft, two bearings with masses and dashpots, and a housing."""
    u = rng.uniform
    nose = s.station()
    s.spring(plane, nose, np.diag([10 ** u(9.0, 9.5), 10 ** u(6.0, 6.5)]) * (1.0 + 0.03j))
    front = s.beam(nose, 0.05, _ring(0.09, 0.03))
    rear = s.beam(front, u(0.2, 0.3), _ring(0.07, 0.03))
    s.beam(rear, 0.06, _ring(0.06, 0.03))
    housing = s.station()
    s.mass(housing, u(40.0, 90.0), u(1.0, 3.0))
    for at, k in ((front, u(2e8, 5e8)), (rear, u(1e8, 3e8))):
        ring, mass = s.station(), u(3.0, 8.0)
        s.mass(ring, mass, 0.002 * mass)
        bearing = np.diag([k, u(5e4, 2e5)]).astype(np.complex128)
        s.spring(at, ring, bearing, np.diag([u(1e3, 4e3), 5.0]))
        fit = np.diag([u(2e8, 8e8), 1e6]).astype(np.complex128)
        s.spring(ring, housing, fit, np.diag([u(2e3, 6e3), 20.0]))
    ground = np.diag([u(4e7, 1.5e8), u(1e7, 4e7)]).astype(np.complex128)
    s.spring(housing, None, ground, np.diag([2e4, 1e3]))
