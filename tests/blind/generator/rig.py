"""From numbers to a structure: holder, tool and joint as finite elements, and the response that would be recorded.

All numbers of one measured configuration stand in one mapping with dotted names; whatever is optional (a collet, a
fixture, a crack) is there when its names are.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from .elements import ComplexArray, Poles, Ring, Structure, cowper, hutchinson

Numbers = Mapping[str, float]

LAYER_POINTS = 40
"""Springs that stand for a continuous layer."""
MEASURING = ("gain", "delay", "window", "quantity", "record", "mount.hz", "mount.zeta")
"""Names of numbers that do not change the structure."""


def sections(p: Numbers) -> int:
    """Return how many sections the holder has."""
    return sum(name.startswith("holder.") and name.endswith(".outer") for name in p)


def _rings(p: Numbers, kind: str, outer: float, inner: float) -> list[Ring]:
    modulus, density, nu, loss = (p[f"{kind}.{name}"] for name in ("modulus", "density", "poisson", "loss"))
    coefficient = hutchinson if p["shear.hutchinson"] else cowper
    return [Ring(outer, inner, modulus, density, nu, loss, coefficient(outer, inner, nu) * p.get("shear.scale", 1.0))]


class _Row:
    """Beams in a row, cut where something acts."""

    def __init__(self, structure: Structure, cuts: Sequence[float]) -> None:
        self.structure = structure
        self.cuts = sorted(set(cuts))
        self.x = 0.0
        self.at = structure.station()
        self.stations = {0.0: self.at}

    def go(self, length: float, rings: list[Ring]) -> None:
        end = self.x + length
        for cut in [c for c in self.cuts if self.x + 1e-9 < c < end - 1e-9]:
            self.at = self.structure.beam(self.at, cut - self.x, rings)
            self.x = cut
            self.stations[cut] = self.at
        self.at = self.structure.beam(self.at, end - self.x, rings)
        self.x = end
        self.stations[end] = self.at

    def __getitem__(self, place: float) -> int:
        return self.stations[min(self.stations, key=lambda x: abs(x - place))]


def _joint(p: Numbers) -> tuple[ComplexArray, NDArray[np.float64]]:
    k = np.array([[p["joint.k_y"], p["joint.k_ytheta"]], [p["joint.k_ytheta"], p["joint.k_theta"]]])
    c = np.array([[p["joint.c_y"], p["joint.c_ytheta"]], [p["joint.c_ytheta"], p["joint.c_theta"]]])
    return k * (1.0 + 1j * p["joint.loss"]), c


def build(p: Numbers, refinement: float = 1.0) -> tuple[Structure, int, int]:
    """Return the structure, the station of the sensor (the tip) and that of the hit."""
    s = Structure(refinement)
    overhang, insertion = p["tool.overhang"], p["holder.0.length"]
    spread = p.get("spread.length", 0.0)
    cells = int(p.get("spread.points", 0))
    edges = np.linspace(0.0, spread, cells + 1)
    middles = 0.5 * (edges[1:] + edges[:-1]) if cells else np.zeros(0)
    weights = 1.0 + p.get("spread.slope", 0.0) * (2.0 * middles / spread - 1.0) if cells else middles
    weights = weights / weights.sum() if cells else weights

    offset = p.get("hit.offset", 0.0)
    crack, middle = p.get("crack.place", 0.0) * overhang, p.get("middle.place", 0.0) * overhang
    tool = _Row(s, [offset, middle, *(overhang + middles)])
    lengths = [(p["flute.length"], p["flute.ratio"])] if "flute.length" in p else []
    lengths.append((overhang - sum(length for length, _ in lengths), 1.0))
    if "tool.taper" in p:
        # A cone in steps: thicker towards the tip, by the taper over the whole overhang.
        length, ratio = lengths.pop()
        steps = 8
        lengths += [(length / steps, ratio * (1.0 + p["tool.taper"] * (0.5 - (i + 0.5) / steps))) for i in range(steps)]
    for length, ratio in lengths:
        diameter = ratio * p["tool.diameter"]
        if crack and tool.x < crack < tool.x + length:
            first = crack - tool.x
            tool.go(first, _rings(p, "tool", diameter, 0.0))
            before = tool.at
            tool.at = s.station()
            s.spring(before, tool.at, np.diag([1e11, p["crack.k"]]).astype(complex))
            length -= first
        tool.go(length, _rings(p, "tool", diameter, 0.0))
    mouth_of_tool = tool.at

    at_flange = p["holder.0.length"]
    total = sum(p[f"holder.{i}.length"] for i in range(sections(p)))
    places = {name: p[name] * total for name in ("ground.place", "rope.place") if name in p}
    holder = _Row(s, [*middles, *places.values()])
    core = _rings(p, "tool", p["tool.diameter"], 0.0)
    for i in range(sections(p)):
        outer, inner, length = (p[f"holder.{i}.{name}"] for name in ("outer", "inner", "length"))
        rings = _rings(p, "holder", outer, p["tool.diameter"] if i == 0 else inner)
        if i == sections(p) - 1 and "holder.stiffer" in p:
            factor = 10.0 ** p["holder.stiffer"]
            rings = [Ring(r.outer, r.inner, r.modulus * factor, r.density, r.poisson, r.loss, r.shear) for r in rings]
        if i == 0 and cells:
            holder.go(spread, rings)
            if length - spread > 1e-9:
                holder.go(length - spread, rings if "spread.loose" in p else rings + core)
        else:
            holder.go(length, rings + core if i == 0 else rings)

    k, c = _joint(p)
    if cells:
        end = insertion if "spread.loose" in p else spread
        tool.go(end, core)
        for x, share in zip(middles, weights, strict=True):
            s.spring(tool[overhang + x], holder[x], k * share, c * share)
    elif "collet.mass" in p:
        collet, split = s.station(), p["collet.split"]
        s.mass(collet, p["collet.mass"], p["collet.mass"] * p["collet.radius"] ** 2)
        s.spring(mouth_of_tool, collet, k / split, c / split)
        s.spring(collet, holder[0.0], k / (1.0 - split), c / (1.0 - split))
    else:
        s.spring(mouth_of_tool, holder[0.0], k, c)

    if p.get("sensor.mass", 0.0):
        s.mass(tool[0.0], p["sensor.mass"])
    if "middle.mass" in p:
        s.mass(tool[middle], p["middle.mass"])
    if "holder.ring" in p:
        s.mass(holder[total], p["holder.ring"], p["holder.ring"] * 2e-4)
    if "nose.ring" in p:
        s.mass(holder[at_flange], p["nose.ring"], p["nose.ring"] * 2e-4)
    if "ground.k" in p:
        s.spring(holder[places["ground.place"]], None, np.diag([p["ground.k"], 0.0]), np.diag([p["ground.c"], 0.0]))
    if "rope.k" in p:
        w = np.sqrt(p["rope.k"] / 1.5)
        rope = np.diag([p["rope.k"], 0.0]), np.diag([2.0 * p["rope.zeta"] * p["rope.k"] / w, 0.0])
        s.spring(holder[places["rope.place"]], None, *rope)
    for name, station in (("fixture", holder[total]), ("absorber", tool[0.0])):
        if f"{name}.mass" in p:
            _resonator(s, station, p[f"{name}.mass"], p[f"{name}.hz"], p[f"{name}.zeta"])
    return s, tool[0.0], tool[offset]


def _resonator(s: Structure, station: int, mass: float, hz: float, zeta: float) -> None:
    own, w = s.station(), 2.0 * np.pi * hz
    inertia = mass * 0.005**2
    s.mass(own, mass, inertia)
    # Rotation is held so firmly that it stays out of the band.
    turning = inertia * (2.0 * np.pi * 40e3) ** 2
    s.spring(station, own, np.diag([mass * w**2, turning]), np.diag([2.0 * zeta * w * mass, 0.0]))


@lru_cache(maxsize=256)
def _poles(items: tuple[tuple[str, float], ...], refinement: float) -> Poles:
    s, tip, hit = build(dict(items), refinement)
    unit = np.eye(s.size)
    return s.poles(unit[:, [2 * hit]], unit[:, [2 * tip]])


def poles(p: Numbers, refinement: float = 1.0) -> Poles:
    """Return the poles of y at the tip over force at the hit."""
    return _poles(tuple((n, v) for n, v in sorted(p.items()) if n not in MEASURING), refinement)


def natural_frequencies(p: Numbers, upper_hz: float) -> NDArray[np.float64]:
    """Return the undamped natural frequencies."""
    return build(p)[0].natural_frequencies(upper_hz)


def chain(p: Numbers, s: ComplexArray) -> ComplexArray:
    """Return what the measuring chain makes of a receptance at s: gain, delay, a sensor's mounting, the quantity."""
    factor = np.full(s.shape, 1.0 + p.get("gain", 0.0), dtype=np.complex128)
    factor *= np.exp(-s * p.get("delay", 0.0))
    if "mount.hz" in p:
        w = 2.0 * np.pi * p["mount.hz"]
        factor *= w**2 / (w**2 + 2.0 * p["mount.zeta"] * w * s + s**2)
    return factor * s ** p.get("quantity", 0.0)


HIT = 0.01
"""Time of the hit in the record, in s."""


def pulse(s: ComplexArray, duration: float) -> ComplexArray:
    """Return the spectrum of a smooth pulse of one newton that begins at the hit."""
    turn = 2.0 * np.pi / duration
    return -np.expm1(-s * duration) / (2.0 * s) * turn**2 / (s**2 + turn**2) * np.exp(-s * HIT)


def recorded(
    p: Numbers, frequency_hz: NDArray[np.float64], decay_rate: float = 0.0, pulse_duration: float = 1.15e-4
) -> ComplexArray:
    """Return what a measurement without noise would report as receptance, on lines and with a stated window.

    The pulse matters only where the record ends too early.
    """
    found = poles(p)
    stated = 2j * np.pi * frequency_hz + decay_rate
    s = stated + p.get("window", 0.0)
    values = found.receptance(s / 2j / np.pi)
    if p.get("record", 0.0):
        # The record ends before the structure is at rest: what acceleration would still have come is missing. A real
        # signal has every ringing with its conjugate.
        ringing = (found.rates.imag > 50.0) & (np.abs(found.rates) < 2e5)
        rates = found.rates[ringing]
        residues = (found.seen[0] * found.excited[:, 0])[ringing] * rates**2 * pulse(rates, pulse_duration)
        rates, residues = (np.concatenate([one, one.conj()]) for one in (rates, residues))
        late = np.exp((rates[None, :] - s[:, None]) * p["record"]) / (s[:, None] - rates)
        values = values - late @ residues / s**2 / pulse(s, pulse_duration)
    # The chain records what happens at s; the analyst divides by the lines that he knows of.
    return values * chain(p, s) * (s / stated) ** 2
