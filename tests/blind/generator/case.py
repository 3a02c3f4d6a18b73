"""Cases: the input of the diagnosis and, separate from it, the truth, which only scoring uses."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import rig
from .effects import CATALOGUE, MEASUREMENT, OUTSIDE, Effect, Where, draw_effect
from .geometry import GEOMETRY_STREAM, draw_geometry
from .knowledge import CHANGES, ERRORS, INSIDE, TOLERANCE, Known, known_of
from .records import SPACING, Estimate, Setup, like, measure

UPPER_HZ = 9000.0
"""Natural frequencies of new tools are compared up to here."""
KINDS = ("nothing_exact", "nothing", "single", "outside", "pair", "one_configuration", "misleading")
NEIGHBOUR = "neighbour"
"""The kind of cases whose error `blind.neighbours` adds; they are no part of the mixture of `KINDS`."""
WORDS = ("blank", "bar", "setup", "clamping", "run", "test", "series", "probe")


@dataclass(frozen=True, kw_only=True)
class Stated:
    """A stated tolerance: one error of one thing, as shares where `relative`."""

    name: str
    moves: Mapping[str, float]
    relative: bool
    configuration: str | None = None


@dataclass(frozen=True, kw_only=True)
class Configuration:
    """A clamping: its name, the overhang that was written down, and the torque of the nut where it was noted."""

    name: str
    overhang: float
    torque: float = 0.0


@dataclass(frozen=True, kw_only=True)
class Record:
    """One measured FRF with its metadata."""

    label: str
    configuration: str
    level: float
    plane: int
    form: str
    estimate: Estimate
    notes: tuple[str, ...] = ()
    place: str = "tip"
    """Where it is hit and where the sensor sits: at the tool's tip or at the holder's nose."""


@dataclass(frozen=True, kw_only=True)
class Nominal:
    """The nominal model: numbers of all configurations, tolerances, and how much a clamping scatters."""

    numbers: Mapping[str, float]
    configurations: tuple[Configuration, ...]
    tolerances: tuple[Stated, ...]
    joint_scatter: float
    damping_scatter: float
    layer: bool
    """Whether the joint is described as a layer along the insertion."""
    geometry: str = ""
    """How cones and flutes are described, one of `geometry.GEOMETRIES`; empty where there are none."""


@dataclass(frozen=True, kw_only=True)
class Case:
    """The input of the diagnosis."""

    name: str
    nominal: Nominal
    records: tuple[Record, ...]
    new_tools: tuple[Configuration, ...]
    """Tools that were not measured and whose predictions are scored."""
    knowledge: str = ""
    """A level of `knowledge.LEVELS`; empty for the ordinary tolerances of a holder."""
    known: Known | None = None
    """What was measured of the holder; then its numbers in `nominal` are not for the diagnosis."""


@dataclass(frozen=True, kw_only=True)
class Truth:
    """The truth; not part of the input of the diagnosis."""

    seed: tuple[int, ...]
    kind: str
    effects: tuple[Effect, ...]
    joint: Mapping[str, float]
    errors: Mapping[str, float]
    """In standard deviations: of tolerances by name, of joint numbers by `joint.k_y @ configuration`."""
    numbers: Mapping[tuple[str, float, int], Mapping[str, float]]
    """By configuration, force level and plane."""
    references: tuple[float, float, float]
    """Overhang, force level and torque at which laws have their reference."""
    layer_points: int
    new_numbers: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    setups: Mapping[float, Setup] = field(default_factory=dict)
    within: tuple[str, ...] = ()
    """Effects that the measurement of the holder contains."""

    def frequencies(self, name: str) -> NDArray[np.float64]:
        """Return the natural frequencies of a new tool, without effects of the measurement."""
        return rig.natural_frequencies(self.new_numbers[name], UPPER_HZ)


@dataclass(frozen=True, kw_only=True)
class Bench:
    """What is measured, before any record is taken: the description, the truth, and the form of the files."""

    nominal: Nominal
    truth: Truth
    new_tools: tuple[Configuration, ...]
    planes: tuple[int, ...]
    form: str
    notes: tuple[str, ...]

    def series(self) -> Iterator[tuple[Configuration, int, float]]:
        """Yield configuration, plane and force level of the records, in the order in which they are taken."""
        for configuration in self.nominal.configurations:
            for plane in self.planes:
                for level in self.truth.setups:
                    yield configuration, plane, level


JOINT = ("joint.k_y", "joint.k_theta", "joint.c_y", "joint.c_theta")


def _ordinary(rng: np.random.Generator, layer: bool) -> dict[str, float]:
    """Return the numbers of a holder with its tool as they are written down."""
    diameter = float(rng.choice([0.012, 0.014, 0.016, 0.018, 0.020]))
    p = {
        "tool.diameter": diameter,
        "tool.modulus": rng.uniform(550e9, 630e9),
        "tool.density": rng.uniform(13900.0, 14900.0),
        "tool.poisson": 0.22,
        "tool.loss": 0.001,
        "holder.modulus": rng.uniform(203e9, 212e9),
        "holder.density": rng.uniform(7750.0, 7900.0),
        "holder.poisson": 0.3,
        "holder.loss": 0.002,
        "shear.hutchinson": float(layer),
    }
    lengths = np.array([rng.uniform(0.034, 0.044), rng.uniform(0.022, 0.03), rng.uniform(0.064, 0.074)])
    lengths *= rng.uniform(0.134, 0.142) / lengths.sum()
    outer = (diameter + rng.uniform(0.016, 0.022), rng.uniform(0.048, 0.063), rng.uniform(0.034, 0.044))
    inner = (diameter, rng.uniform(0.010, 0.016), rng.uniform(0.010, 0.017))
    for i in range(3):
        dimensions = {"length": lengths[i], "outer": outer[i], "inner": inner[i]}
        p |= {f"holder.{i}.{name}": round(float(value), 4) for name, value in dimensions.items()}
    p["joint.k_ytheta"] = p["joint.c_ytheta"] = p["joint.loss"] = 0.0
    if rng.random() < 0.25:
        p["torques"] = 1.0
    if rng.random() < 0.3:
        p["sensor.mass"] = round(rng.uniform(3e-4, 1.5e-3), 5)
    return {name: float(value) for name, value in p.items()}


def _draw_joint(rng: np.random.Generator, diameter: float) -> dict[str, float]:
    k_y = 10.0 ** rng.uniform(7.5, 8.6)
    k_theta = 10.0 ** rng.uniform(4.3, 5.2) * (diameter / 0.016) ** 2
    at = 2.0 * np.pi * 2000.0
    c_y, c_theta = (k * 10.0 ** rng.uniform(-1.8, -1.1) / at for k in (k_y, k_theta))
    return dict(zip(JOINT, map(float, (k_y, k_theta, c_y, c_theta)), strict=True))


def _tolerances(
    configurations: tuple[Configuration, ...], exact_holder: bool, drawing: bool = False
) -> tuple[Stated, ...]:
    """Return ordinary tolerances; an exact holder has none, and every number of a drawing 1 %."""
    shares = {"tool.diameter": 5e-4, "tool.density": 3e-3, "tool.modulus": 5e-3}
    if not exact_holder:
        shares |= {"holder.density": 3e-3, "holder.modulus": 5e-3}
        shares |= {f"holder.{i}.outer": 1e-3 for i in range(3)} | {f"holder.{i}.inner": 3e-3 for i in (1, 2)}
    if drawing:
        materials = [f"holder.{name}" for name in ("density", "modulus", "poisson", "loss")]
        dimensions = [f"holder.{i}.{name}" for i in range(3) for name in ("length", "outer", "inner")]
        # The bore of the first section has the diameter of the shank.
        shares |= dict.fromkeys([*materials, *(name for name in dimensions if name != "holder.0.inner")], TOLERANCE)
    stated = [Stated(name=name, moves={name: share}, relative=True) for name, share in shares.items()]
    if not exact_holder:
        names = [f"holder.{i}.length" for i in range(3)]
        stated += [Stated(name=name, moves={name: 1e-4}, relative=False) for name in names]
    for one in configurations:
        moves = {"tool.overhang": 5e-5}
        stated.append(Stated(name=f"overhang {one.name}", moves=moves, relative=False, configuration=one.name))
    return tuple(stated)


def numbers_of(
    nominal: Nominal, joint: Mapping[str, float], errors: Mapping[str, float], where: Where
) -> dict[str, float]:
    """Return the numbers of a configuration with errors, before any effect."""
    p = {**nominal.numbers, **joint, "tool.overhang": where.overhang}
    for stated in nominal.tolerances:
        if stated.configuration in (None, where.configuration):
            z = errors.get(stated.name, 0.0)
            for name, deviation in stated.moves.items():
                p[name] = p[name] * np.exp(deviation * z) if stated.relative else p[name] + deviation * z
    for name in JOINT:
        scatter = nominal.joint_scatter if name.startswith("joint.k") else nominal.damping_scatter
        p[name] *= np.exp(scatter * errors.get(f"{name} @ {where.configuration}", 0.0))
    # The shank fills its bore.
    p["holder.0.inner"] = p["tool.diameter"]
    return {name: float(value) for name, value in p.items()}


def with_layer(p: dict[str, float], points: int) -> dict[str, float]:
    """Return the numbers with a joint spread along the whole insertion."""
    return {**p, "spread.length": p["holder.0.length"], "spread.points": float(points), "spread.loose": 1.0}


def true_numbers(
    nominal: Nominal, truth: Truth, joint: Mapping[str, float], errors: Mapping[str, float],
    effects: tuple[tuple[Effect, Mapping[str, float] | None], ...], where: Where,
) -> dict[str, float]:  # fmt: skip
    """Return the numbers of a configuration with errors and effects, these perhaps with other sizes."""
    p = numbers_of(nominal, joint, errors, where)
    if nominal.layer:
        p = with_layer(p, truth.layer_points)
    for effect, sizes in effects:
        p = effect.apply(p, where, sizes)
    return p


def where_of(truth: Truth, configuration: Configuration, level: float, plane: int) -> Where:
    """Return where a record belongs."""
    overhang, reference, torque = truth.references
    return Where(
        configuration.name, configuration.overhang, level, plane, overhang, reference, configuration.torque or torque,
        torque,
    )  # fmt: skip


def all_numbers(nominal: Nominal, truth: Truth, where: Where) -> dict[str, float]:
    """Return the numbers of a configuration as they are."""
    return true_numbers(nominal, truth, truth.joint, truth.errors, tuple((one, None) for one in truth.effects), where)


def at_place(nominal: Nominal, p: dict[str, float], place: str) -> dict[str, float]:
    """Return numbers with hit and sensor at the tip or the nose; of a layer, that is where the holder goes on alone."""
    if place == "tip":
        return p
    return p | {"nose.place": p["holder.0.length"] if nominal.layer else 0.0}


def recorded(
    rng: np.random.Generator, nominal: Nominal, truth: Truth, c: Configuration, level: float, plane: int,
    *, place: str = "tip", **given: Any,
) -> Record:  # fmt: skip
    """Return one record, measured."""
    p = at_place(nominal, all_numbers(nominal, truth, where_of(truth, c, level, plane)), place)
    estimate = measure(rng, p, truth.setups[level])
    return Record(configuration=c.name, level=level, plane=plane, place=place, estimate=estimate, **given)


def draw_case(
    seed: int, index: int, kind: str, effects: tuple[str, ...] = (), *, u: float | None = None, quick: bool = False,
    knowledge: str = "", geometry: str = "",
) -> tuple[Case, Truth]:  # fmt: skip
    """Return a case and its truth, drawn anew from seed and index.

    Parameters
    ----------
    seed, index : int
        Seed and number of the case.
    kind : str
        One of `KINDS`.
    effects : tuple of str, optional
        Which effects; drawn where none is given and the kind has some.
    u : float, optional
        Size of the effects from 0, barely visible, to 1, large; drawn where not given.
    quick : bool, optional
        Three overhangs, a narrower band and fewer lines, for tests.
    knowledge : str, optional
        What is known of the holder, one of `knowledge.LEVELS`; by default its dimensions with ordinary tolerances.
    geometry : str, optional
        How cones and flutes are described, one of `geometry.GEOMETRIES`; records and truth do not depend on it. By
        default there are none.
    """
    rng = np.random.default_rng([seed, index, KINDS.index(kind)])
    bench = draw_bench(rng, (seed, index), kind, effects, u=u, quick=quick, knowledge=knowledge,
                       geometry=geometry)  # fmt: skip
    nominal, truth = bench.nominal, bench.truth
    records = []
    for c, plane, level in bench.series():
        given: dict[str, Any] = {"form": bench.form, "notes": bench.notes, "label": f"{c.name} {len(records)}"}
        records.append(recorded(rng, nominal, truth, c, level, plane, **given))
        where = where_of(truth, c, level, plane)
        truth.numbers[c.name, level, plane] = all_numbers(nominal, truth, where)  # type: ignore[index]
    # Predictions are of the machine in operation: without an undeclared sensor and without a rope.
    lasting = tuple((effect, None) for effect in truth.effects if effect.id not in MEASUREMENT)
    for c in bench.new_tools:
        where = where_of(truth, c, truth.references[1], 1)
        truth.new_numbers[c.name] = true_numbers(nominal, truth, truth.joint, truth.errors, lasting, where)  # type: ignore[index]
    known = None
    if knowledge not in ("", "drawing"):
        own = tuple((effect, None) for effect in truth.effects if effect.id not in (*CHANGES, *INSIDE))
        first, *_, last = truth.setups
        where = where_of(truth, nominal.configurations[0], first, 1)
        p = true_numbers(nominal, truth, truth.joint, truth.errors, own, where)
        known = known_of(np.random.default_rng([seed, index, 80]), knowledge, p, truth.setups[last])
    case = Case(
        name=f"case {seed}-{index}", nominal=nominal, records=tuple(records), new_tools=bench.new_tools,
        knowledge=knowledge, known=known,
    )  # fmt: skip
    return case, truth


def draw_bench(
    rng: np.random.Generator, seed: tuple[int, int], kind: str, effects: tuple[str, ...] = (),
    *, u: float | None = None, quick: bool = False, knowledge: str = "", geometry: str = "",
) -> Bench:  # fmt: skip
    """Return what a case measures; `seed` and number of the case are noted in the truth. See `draw_case`."""
    chosen = effects or _choose(rng, kind)
    layer = kind in ("nothing_exact", "nothing", "single") and rng.random() < 0.12 and not (quick and effects)
    layer = layer and not {"joint_cross_term", "joint_spread", "collet_mass"} & set(chosen)
    data = knowledge not in ("", "drawing")
    # A layer lies along the bore, which data at the mouth do not describe.
    layer = layer and not data and not geometry
    numbers = _ordinary(rng, layer)
    if geometry:
        numbers |= draw_geometry(np.random.default_rng([*seed, GEOMETRY_STREAM]), numbers)
    drawn = []
    for id in chosen:
        # Two at once are scored where both are large enough, which two small ones rarely are.
        least = 0.3 if kind == "pair" else 0.0
        size = float(rng.uniform(least, 1.0)) if u is None else u
        drawn.append(draw_effect(rng, id, size, numbers))
        numbers |= drawn[-1].believed
    overhangs = _overhangs(rng, numbers["tool.diameter"], 3 if quick else int(rng.integers(3, 5)))
    names = _names(rng, overhangs.size)
    between = _between(rng, overhangs)
    torques = _torques(rng, len(names) + between.size) if "torques" in numbers else [0.0] * 8
    configurations = tuple(
        Configuration(name=name, overhang=float(x), torque=torque)
        for name, x, torque in zip(names, overhangs, torques, strict=False)
    )
    if kind == "one_configuration":
        at = names[int(rng.integers(len(names)))]
        drawn = [Effect(e.id, e.sizes, e.fixed, e.believed, at, e.u) for e in drawn]
    within = tuple(e.id for e in drawn if data and e.id in ERRORS)
    if data:
        anywhere = Where("", float(overhangs[0]), 0.0)
        for effect in (e for e in drawn if e.id in within):
            numbers = effect.apply(numbers, anywhere)
        drawn = [e for e in drawn if e.id not in within]
    # Cones are stated as exact, as a user states them.
    exact = kind == "nothing_exact" or knowledge != "" or geometry != ""
    new = tuple(
        Configuration(name=f"new {i}", overhang=float(x), torque=torques[len(names) + i]) for i, x in enumerate(between)
    )
    nominal = Nominal(
        numbers=numbers,
        configurations=configurations,
        tolerances=_tolerances((*configurations, *new), exact, knowledge == "drawing"),
        joint_scatter=round(rng.uniform(0.004, 0.015), 4),
        damping_scatter=0.03,
        layer=layer,
        geometry=geometry,
    )
    errors = {stated.name: float(rng.standard_normal()) for stated in nominal.tolerances}
    errors |= {f"{name} @ {c.name}": float(rng.standard_normal()) for name in JOINT for c in (*configurations, *new)}
    levels = (100.0, 100.0 * round(rng.uniform(2.5, 4.0), 1))
    setup = Setup(
        level=levels[0],
        hits=int(rng.integers(8, 13)),
        low_hz=rng.uniform(140.0, 220.0),
        high_hz=rng.uniform(4200.0, 4800.0) if quick else rng.uniform(5500.0, 7000.0),
        pulse=rng.uniform(1.0e-4, 1.3e-4),
        noise=0.01 * rng.uniform(0.7, 1.3),
        hammer_noise=0.001,
        decay_rate=rng.uniform(3.0, 10.0) if rng.random() < 0.2 else 0.0,
        spacing=10.0 if quick else SPACING,
    )
    truth = Truth(
        seed=seed,
        kind=kind,
        effects=tuple(drawn),
        joint=_draw_joint(rng, numbers["tool.diameter"]),
        errors=errors,
        numbers={},
        references=(float(np.exp(np.mean(np.log(overhangs)))), float(np.sqrt(levels[0] * levels[1])), TORQUE),
        layer_points=LAYER if layer else 0,
        new_numbers={},
        setups={level: like(setup, level) for level in levels},
        within=within,
    )
    mixed = kind in ("nothing", NEIGHBOUR) and rng.random() < 0.15
    planes = (1, 2) if "xy_asymmetry" in chosen or mixed else (1,)
    form = str(rng.choice(["accelerance", "accelerance", "mobility", "receptance"]))
    hints = _hints(rng, drawn) if kind == "misleading" else ()
    return Bench(nominal=nominal, truth=truth, new_tools=new, planes=planes, form=form, notes=hints)


LAYER = rig.LAYER_POINTS
TORQUE = 40.0
"""Nominal torque of the nut in Nm."""


def _choose(rng: np.random.Generator, kind: str) -> tuple[str, ...]:
    if kind in ("single", "misleading"):
        return (str(rng.choice(CATALOGUE)),)
    if kind == "outside":
        return (str(rng.choice(OUTSIDE)),)
    if kind == "one_configuration":
        local = ["overhang_error", "calibration_gain", "time_delay", "sensor_mass", "exponential_window"]
        return (str(rng.choice(local)),)
    if kind == "pair":
        clumsy = (
            "wrong_quantity",
            "coarse_resolution",
            "joint_spread",
            "xy_asymmetry",
            "flexible_body",
            "tool_material",
        )
        pool = [id for id in CATALOGUE if id not in clumsy]
        return tuple(map(str, rng.choice(pool, 2, replace=False)))
    return ()


def _overhangs(rng: np.random.Generator, diameter: float, count: int) -> NDArray[np.float64]:
    usual = np.array([0.060, 0.075, 0.090, 0.105, 0.120])
    inner = rng.choice([0.075, 0.090, 0.105], count - 2, replace=False)
    found = np.sort(np.concatenate([usual[[0, -1]], inner]))
    return np.round(found * (0.7 + 0.3 * diameter / 0.016) + rng.uniform(-0.003, 0.003, count), 4)


def _between(rng: np.random.Generator, overhangs: NDArray[np.float64]) -> NDArray[np.float64]:
    gaps = np.argsort(np.diff(overhangs))[::-1][:2]
    return np.round([overhangs[g] + rng.uniform(0.35, 0.65) * (overhangs[g + 1] - overhangs[g]) for g in gaps], 4)


def _torques(rng: np.random.Generator, count: int) -> list[float]:
    """Return torques of the nut in Nm, varied on purpose and in no order of the overhangs."""
    found = TORQUE * np.exp(np.linspace(-0.45, 0.45, count) + rng.uniform(-0.05, 0.05, count))
    return [float(round(x, 1)) for x in rng.permutation(found)]


def _names(rng: np.random.Generator, count: int) -> list[str]:
    """Return uninformative names in random order."""
    word = str(rng.choice(WORDS))
    letters = rng.choice(list("ABCDEFGHJKLMNPQRSTUVWXYZ"), count, replace=False)
    return [f"{word} {letter}{rng.integers(10, 99)}" for letter in letters]


def _hints(rng: np.random.Generator, drawn: list[Effect]) -> tuple[str, ...]:
    """Return misleading remarks."""
    remarks = {
        "sensor_mass": "sensor heavier than usual, check its mass",
        "tool_modulus": "carbide grade uncertain, modulus from the catalogue",
        "hammer_offset": "hit not quite at the tip",
        "exponential_window": "exponential window was perhaps on",
        "overhang_error": "overhang read off in a hurry",
    }
    others = [text for id, text in remarks.items() if id not in [effect.id for effect in drawn]]
    return (str(rng.choice(others)),)
