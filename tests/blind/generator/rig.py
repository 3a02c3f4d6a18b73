"""From numbers to a structure: holder, tool and joint as finite elements, and the response that would be recorded.

All numbers of one measured configuration stand in one mapping with dotted names; whatever is optional (a collet, a
fixture, a crack) is there when its names are. Two things may occur any number of times, each with a name N of its own,
on the tool (`part` 0, places from the tip on) or on the holder (`part` 1, places from the mouth on):

point.N.*
    A body at `place`, in m: `mass`, `inertia`, a spring `k` and a dashpot `c` to the ground. With `hz` and `zeta` the
    mass is on a damped spring.
patch.N.*
    Another section from `start` to `end`, in m: factors `outer`, `modulus` and `density` of beams without the shank in
    them, `bore` in m in place of their inner diameter. `core` 0 takes the shank away.

Cones and flutes have the names that `geometry` describes.
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from .elements import ComplexArray, Matrices, Poles, Ring, Structure, cowper, hutchinson
from .geometry import ends_of, fluted, is_conical, varying

Numbers = Mapping[str, float]

LAYER_POINTS = 40
"""Springs that stand for a continuous layer."""
MEASURING = ("torques", "gain", "delay", "window", "quantity", "record", "mount.hz", "mount.zeta")
"""Names of numbers that do not change the structure."""


def sections(p: Numbers) -> int:
    """Return how many sections the holder has."""
    return sum(name.startswith("holder.") and name.endswith(".outer") for name in p)


def _rings(p: Numbers, kind: str, outer: float, inner: float) -> list[Ring]:
    modulus, density, nu, loss = (p[f"{kind}.{name}"] for name in ("modulus", "density", "poisson", "loss"))
    coefficient = hutchinson if p["shear.hutchinson"] else cowper
    return [Ring(outer, inner, modulus, density, nu, loss, coefficient(outer, inner, nu) * p.get("shear.scale", 1.0))]


def _named(p: Numbers, kind: str, part: float | None = None) -> list[dict[str, float]]:
    """Return the numbers of each point or patch, perhaps of those on one part."""
    groups: dict[str, dict[str, float]] = {}
    for address in p:
        if address.startswith(f"{kind}."):
            _, name, field = address.split(".")
            groups.setdefault(name, {})[field] = p[address]
    return [group for group in groups.values() if part is None or group["part"] == part]


def _patched(p: Numbers, rings: list[Ring], patch: Numbers) -> list[Ring]:
    first, *core = rings
    coefficient = hutchinson if p["shear.hutchinson"] else cowper
    outer, inner = first.outer * patch.get("outer", 1.0), patch.get("bore", first.inner)
    shear = coefficient(outer, inner, first.poisson) / coefficient(first.outer, first.inner, first.poisson)
    changed = replace(
        first, outer=outer, inner=inner, modulus=first.modulus * patch.get("modulus", 1.0),
        density=first.density * patch.get("density", 1.0), shear=first.shear * shear,
    )  # fmt: skip
    return [changed, *(core if patch.get("core", 1.0) else [])]


class Row:
    """Beams in a row, divided at attachments; `section` returns the rings at a place from those of a beam."""

    def __init__(
        self,
        structure: Structure,
        cuts: Sequence[float],
        section: Callable[[float, list[Ring]], list[Ring]] = lambda place, rings: rings,
    ) -> None:
        self.structure = structure
        self.section = section
        self.cuts = sorted(set(cuts))
        self.x = 0.0
        self.at = structure.station()
        self.stations = {0.0: self.at}

    def go(self, length: float, rings: list[Ring] | Callable[[float], list[Ring]]) -> None:
        """Add a beam at the end, of rings that may depend on the place behind its start."""
        begin, end = self.x, self.x + length
        for cut in [*(c for c in self.cuts if self.x + 1e-9 < c < end - 1e-9), end]:
            middle, first = 0.5 * (self.x + cut), self.x
            if callable(rings):
                changing = functools.partial(self._changing, rings, middle, first - begin)
                self.at = varying(self.structure, self.at, cut - self.x, changing)
            else:
                self.at = self.structure.beam(self.at, cut - self.x, self.section(middle, rings))
            self.x = cut
            self.stations[cut] = self.at

    def _changing(self, rings: Callable[[float], list[Ring]], middle: float, before: float, place: float) -> list[Ring]:
        return self.section(middle, rings(before + place))

    def __getitem__(self, place: float) -> int:
        return self.stations[min(self.stations, key=lambda x: abs(x - place))]


def _joint(p: Numbers) -> tuple[ComplexArray, NDArray[np.float64]]:
    k = np.array([[p["joint.k_y"], p["joint.k_ytheta"]], [p["joint.k_ytheta"], p["joint.k_theta"]]])
    c = np.array([[p["joint.c_y"], p["joint.c_ytheta"]], [p["joint.c_ytheta"], p["joint.c_theta"]]])
    return k * (1.0 + 1j * p["joint.loss"]), c


def _row(s: Structure, p: Numbers, part: float, cuts: Sequence[float]) -> Row:
    """Return the row of a part with its points and patches."""
    patches = _named(p, "patch", part)

    def section(place: float, rings: list[Ring]) -> list[Ring]:
        for patch in patches:
            if patch["start"] < place < patch["end"]:
                rings = _patched(p, rings, patch)
        return rings

    ends = [patch[end] for patch in patches for end in ("start", "end")]
    return Row(s, [*cuts, *(point["place"] for point in _named(p, "point", part)), *ends], section)


def build(p: Numbers, refinement: float = 1.0) -> tuple[Structure, int, int]:
    """Return the structure, the station of the sensor (the tip) and that of the hit."""
    s = Structure(refinement)
    cells = int(p.get("spread.points", 0))
    edges = np.linspace(0.0, p.get("spread.length", 0.0), cells + 1)
    middles = 0.5 * (edges[1:] + edges[:-1])
    tool = _tool(s, p, middles)
    mouth = tool.at
    holder = _holder(s, p, middles)
    if cells:
        _layer(s, p, tool, holder, middles)
    else:
        _link(s, p, mouth, holder[0.0])
    _attach(s, p, tool, holder)
    if "wax.hz" in p:
        seen = resonator(s, tool[0.0], p["sensor.mass"], p["wax.hz"], p["wax.zeta"])
        return s, seen, tool[p.get("hit.offset", 0.0)]
    if "nose.place" in p:
        nose = holder[p["nose.place"]]
        return s, nose, nose
    if "both.offset" in p:
        both = tool[p["both.offset"]]
        return s, both, both
    return s, tool[0.0], tool[p.get("hit.offset", 0.0)]


def _tool(s: Structure, p: Numbers, middles: NDArray[np.float64]) -> Row:
    """Build the tool up to the mouth of the holder, with flutes, cone and crack."""
    overhang = p["tool.overhang"]
    crack = p.get("crack.place", 0.0) * overhang
    places = [p.get("hit.offset", 0.0), p.get("both.offset", 0.0), p.get("middle.place", 0.0) * overhang]
    tool = _row(s, p, 0.0, [*places, *(overhang + middles)])
    pieces = [(p["flute.length"], p["flute.ratio"])] if "flute.length" in p else []
    pieces.append((overhang - sum(length for length, _ in pieces), 1.0))
    if "tool.taper" in p:
        # A cone in steps: thicker towards the tip, by the taper over the whole overhang.
        length, ratio = pieces.pop()
        steps = 8
        pieces += [(length / steps, ratio * (1.0 + p["tool.taper"] * (0.5 - (i + 0.5) / steps))) for i in range(steps)]
    for length, ratio in pieces:
        rings = _rings(p, "tool", ratio * p["tool.diameter"], p.get("tool.bore", 0.0))
        if "flute.number" in p and tool.x < p["flute.length"] - 1e-9:
            rings = [fluted(ring, p) for ring in rings]
        if crack and tool.x < crack < tool.x + length:
            first = crack - tool.x
            tool.go(first, rings)
            before = tool.at
            tool.at = s.station()
            s.spring(before, tool.at, np.diag([1e11, p["crack.k"]]).astype(np.complex128))
            length -= first
        tool.go(length, rings)
    return tool


def _holder(s: Structure, p: Numbers, middles: NDArray[np.float64]) -> Row:
    """Build the holder, the shank in its mouth as a core unless the joint is spread there, perhaps screwed together."""
    total = _holder_length(p)
    spread = p.get("spread.length", 0.0) if middles.size else 0.0
    holder = _row(s, p, 1.0, [*middles, *(p[name] * total for name in ("ground.place", "rope.place") if name in p)])
    core = _rings(p, "tool", p["tool.diameter"], p.get("tool.bore", 0.0))
    for i in range(sections(p)):
        length = p[f"holder.{i}.length"]
        if i == p.get("screw.section", 0.0) > 0.0:
            before = holder.at
            holder.at = s.station()
            s.spring(before, holder.at, np.diag([1e11, p["screw.k"]]).astype(np.complex128))
        bare = i == 0 and spread
        if bare:
            holder.go(spread, _holder_rings(p, i, 0.0, ()))
            length -= spread
        inside = core if i == 0 and not (bare and "spread.loose" in p) else []
        if length > 1e-9:
            holder.go(length, _holder_rings(p, i, spread if bare else 0.0, inside))
    return holder


def _holder_rings(p: Numbers, i: int, begin: float, core: Sequence[Ring]) -> list[Ring] | Callable[[float], list[Ring]]:
    """Return the rings of a section of the holder from a place in it on; of a cone, by the place behind that."""
    (near, far), (bore, end_of_bore) = ends_of(p, i)
    if i == 0:
        # The shank fills the bore.
        bore = end_of_bore = p["tool.diameter"]
    stiffer = 10.0 ** p["holder.stiffer"] if i == sections(p) - 1 and "holder.stiffer" in p else 1.0

    def rings_at(place: float) -> list[Ring]:
        share = (begin + place) / p[f"holder.{i}.length"]
        rings = _rings(p, "holder", near + share * (far - near), bore + share * (end_of_bore - bore))
        return [*(replace(ring, modulus=ring.modulus * stiffer) for ring in rings), *core]

    return rings_at if is_conical(p, i) else rings_at(0.0)


def _holder_length(p: Numbers) -> float:
    return sum(p[f"holder.{i}.length"] for i in range(sections(p)))


def holder_alone(s: Structure, p: Numbers) -> None:
    """Build the holder with the shank in its mouth and nothing attached; station 0 is at the mouth."""
    _holder(s, {name: p[name] for name in p if name.split(".")[0] in ("holder", "tool", "shear")}, np.empty(0))


def _layer(s: Structure, p: Numbers, tool: Row, holder: Row, middles: NDArray[np.float64]) -> None:
    """Continue the tool as shank beside the bore, and hold the two together at points."""
    k, c = _joint(p)
    spread = p["spread.length"]
    weights = 1.0 + p.get("spread.slope", 0.0) * (2.0 * middles / spread - 1.0)
    weights = weights / weights.sum()
    shank = p["holder.0.length"] if "spread.loose" in p else spread
    tool.go(shank, _rings(p, "tool", p["tool.diameter"], p.get("tool.bore", 0.0)))
    for x, share in zip(middles, weights, strict=True):
        s.spring(tool[p["tool.overhang"] + x], holder[x], k * share, c * share)


def _link(s: Structure, p: Numbers, tool_end: int, mouth: int) -> None:
    """Put the joint at a point, perhaps with a collet's mass within it."""
    k, c = _joint(p)
    if "collet.mass" not in p:
        s.spring(tool_end, mouth, k, c)
        return
    collet, split = s.station(), p["collet.split"]
    s.mass(collet, p["collet.mass"], p["collet.mass"] * p["collet.radius"] ** 2)
    s.spring(tool_end, collet, k / split, c / split)
    s.spring(collet, mouth, k / (1.0 - split), c / (1.0 - split))


def _attach(s: Structure, p: Numbers, tool: Row, holder: Row) -> None:
    """Add masses, springs to ground and resonators."""
    total = _holder_length(p)
    masses = (
        ("sensor.mass", holder[p["nose.place"]] if "nose.place" in p else tool[0.0], 0.0),
        ("middle.mass", tool[p.get("middle.place", 0.0) * p["tool.overhang"]], 0.0),
        ("holder.ring", holder[total], 2e-4),
        ("nose.ring", holder[p["holder.0.length"]], 2e-4),
    )
    for name, station, inertia in masses:
        if p.get(name, 0.0) and not (name == "sensor.mass" and "wax.hz" in p):
            s.mass(station, p[name], p[name] * inertia, p.get("sensor.arm", 0.0) if name == "sensor.mass" else 0.0)
    for point in _named(p, "point"):
        station = (holder if point["part"] else tool)[point["place"]]
        if "hz" in point:
            resonator(s, station, point["mass"], point["hz"], point["zeta"])
        else:
            s.mass(station, point.get("mass", 0.0), point.get("inertia", 0.0))
            s.spring(station, None, np.diag([point.get("k", 0.0), 0.0]), np.diag([point.get("c", 0.0), 0.0]))
    if "ground.k" in p:
        at = holder[p["ground.place"] * total]
        s.spring(at, None, np.diag([p["ground.k"], 0.0]), np.diag([p["ground.c"], 0.0]))
    if "rope.k" in p:
        w = np.sqrt(p["rope.k"] / 1.5)
        rope = np.diag([p["rope.k"], 0.0]), np.diag([2.0 * p["rope.zeta"] * p["rope.k"] / w, 0.0])
        s.spring(holder[p["rope.place"] * total], None, *rope)
    for name, station in (("fixture", holder[total]), ("absorber", tool[0.0])):
        if f"{name}.mass" in p:
            resonator(s, station, p[f"{name}.mass"], p[f"{name}.hz"], p[f"{name}.zeta"])


def resonator(s: Structure, station: int, mass: float, hz: float, zeta: float) -> int:
    """Add a mass on a damped spring to a station, and return the station of the mass."""
    own, w = s.station(), 2.0 * np.pi * hz
    # The rotating mass is negligible, and its support so stiff that its modes are above the band.
    inertia = mass * 0.0005**2
    s.mass(own, mass, inertia)
    turning = inertia * (2.0 * np.pi * 40e3) ** 2
    s.spring(station, own, np.diag([mass * w**2, turning]), np.diag([2.0 * zeta * w * mass, 0.0]))
    return own


@lru_cache(maxsize=256)
def _poles(items: tuple[tuple[str, float], ...], refinement: float) -> Poles:
    p = dict(items)
    s, tip, hit = build(p, refinement)
    unit = np.eye(s.size)
    # A sensor on a rigid arm along the tool moves with the slope as well.
    response = s.poles(unit[:, [2 * hit]], unit[:, [2 * tip]] + p.get("sensor.arm", 0.0) * unit[:, [2 * tip + 1]])
    return _lossy(response, int(p["lossy.mode"]), p["lossy.zeta"]) if "lossy.mode" in p else response


def _lossy(response: Poles, mode: int, zeta: float) -> Poles:
    """Return poles of which one mode, counted from 0 at the lowest elastic one, has a larger damping ratio."""
    angular = response.rates.imag
    rate = np.sort(angular[angular > 2.0 * np.pi * 100.0])[mode]
    # With losses in materials the rate of negative frequency is not quite the conjugate.
    pair = [int(np.argmin(np.abs(angular - side * rate))) for side in (-1.0, 1.0)]
    rates = response.rates.copy()
    rates[pair] -= zeta * np.abs(rates[pair])
    return replace(response, rates=rates)


def poles(p: Numbers, refinement: float = 1.0) -> Poles:
    """Return the poles of y at the tip over force at the hit."""
    return _poles(tuple((n, v) for n, v in sorted(p.items()) if n not in MEASURING), refinement)


def log_slopes(
    p: Numbers, steps: Sequence[Numbers], frequency_hz: NDArray[np.float64], decay_rate: float = 0.0,
    pulse_duration: float = 1.15e-4,
) -> ComplexArray:  # fmt: skip
    """Return the change of the logarithm of the recorded response by small steps of some numbers, column by column.

    Where a step changes matrices only, the differences are those of the matrices; the response follows to first order.
    """
    found = poles(p)
    lines = frequency_hz + (decay_rate + p.get("window", 0.0)) / (2j * np.pi)
    structure, *stations = build(p)
    here = structure.matrices()
    result = np.zeros((lines.size, len(steps)), dtype=np.complex128)
    changes: dict[int, Matrices] = {}
    for j, step in enumerate(steps):
        moved = {**p, **{name: p[name] + change for name, change in step.items()}}
        if not set(step) & set(MEASURING) and not p.get("record", 0.0):
            other, *places = build(moved)
            if other.size == structure.size and places == stations:
                k, m, c = (b - a for a, b in zip(here, other.matrices(), strict=True))
                changes[j] = k, m, c
                continue
        near, far = (recorded(one, frequency_hz, decay_rate, pulse_duration) for one in (p, moved))
        result[:, j] = np.log(far / near)
    result[:, list(changes)] = found.slopes(lines, list(changes.values())) / found.receptance(lines)[:, None]
    return result


def natural_frequencies(p: Numbers, upper_hz: float) -> NDArray[np.float64]:
    """Return the undamped natural frequencies."""
    return build(p)[0].natural_frequencies(upper_hz)


def chain(p: Numbers, s: ComplexArray) -> ComplexArray:
    """Return the receptance at s after the measuring chain: gain, delay, mounting of the sensor, quantity."""
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
    """Return the receptance that a noise-free measurement reports, on lines and with a stated window.

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
    # The chain records what happens at s; the evaluation divides by the known lines.
    return values * chain(p, s) * (s / stated) ** 2
