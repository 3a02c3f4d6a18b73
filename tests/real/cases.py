"""Cases: which records of a measured structure, which effect is hidden in them, and how large it is.

Everything is drawn from a seed and the number of the case. A case holds what the engineer has: records with the stated
quantity and window, noise, known masses. Its truth is an `Effect` beside it.

How large an effect is counts in `ratio`, which the scoring uses:

- effects that move modes (a mass, a spring, the frequency axis): the shifts s_k of the natural frequencies in the band,
  from local fits to the drive point, against the discrepancy d of the plain model, the rms error of the same natural
  frequencies after its fit to the same records without an effect. Tolerances absorb a shift common to all modes, with
  the standard deviation tau of the frequency by modulus, density and diameter, so
  ratio^2 = min_t [sum_k (s_k - t)^2 / d^2 + t^2 / tau^2] / modes;
- effects that move no mode: the rms change of the logarithm over all lines, divided by the rms residual of that plain
  fit, both in the standard deviations of the lines.

Whether the data can support a claim at all counts in `support`. The size of the discrepancy is unknown, and estimated
from the same n values that show the effect: natural frequencies of all configurations where the effect moves modes,
levels of the modes in all records elsewhere. Without the effect their variance is that of the discrepancy times
1 + ratio^2, so twice the logarithm of the likelihood rises by about n ln(1 + ratio^2), of which the size of the effect
costs ln n.

Sizes end where the effect would no longer be called by its name (`BOUNDS`).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from real import exact
from real.exact import Lines, Values
from real.structures import (
    DECAY_RATE,
    HIT_PLACES,
    MODE_BANDS,
    SENSOR_PLACE,
    STEP,
    TOLERANCES,
    Beam,
    Level,
    brake_reuss,
    modelab,
)

DRIVE = HIT_PLACES.index(SENSOR_PLACE)
HIGHEST_HZ = (400.0, 700.0, 987.0)
"""Two, three or four modes of the ModeLAB beam."""
KNOWN_MASSES = (0.0, 0.4, 1.0)
"""In kg, at the sensor: configurations of the ModeLAB beam. All but the first are made of the measured one, exactly."""
AIMS = (1.0, 4.0, 10.0, 30.0)
"""Ratios that the sizes of effects aim at."""
CLEAR = 3.0
"""Ratio above which an effect is reported apart."""
LEAST_SUPPORT = 2.0 * np.log(1000.0)
"""Support from which the data can show an effect: odds of a thousand to one. It is less than the price of a search."""
STEPPED_SINE_NOISE = 0.02
"""Relative standard deviation that the engineer states for the Brake-Reuss levels, which have no repeats."""
BRAKE_REUSS_LEVELS = 3


@dataclass(frozen=True)
class Effect:
    """What is hidden: id, size by name, and an aim for the ratio."""

    id: str
    sizes: Mapping[str, float] = field(default_factory=dict)
    aim: float | None = None


ANSWERS: dict[str, tuple[str, ...]] = {
    "sensor_mass": ("sensor_mass",),
    "suspension": ("suspension", "ground_spring"),
    "calibration_gain": ("calibration_gain",),
    "time_delay": ("time_delay",),
    "exponential_window": ("exponential_window",),
    "coarse_resolution": ("coarse_resolution",),
    "wrong_quantity": ("wrong_quantity",),
    "reversed_polarity": ("reversed_polarity", "polarity"),
    "frequency_scale": ("frequency_scale", "frequency_axis", "time_base"),
}
"""Ids of causes that name an effect. Those that the catalogue does not have yet are answers as soon as it has them."""

LOOK_ALIKES: dict[tuple[str, str], tuple[str, ...]] = {
    # One free beam: all its frequencies scale with the wave speed, and damping is negligible beside the window.
    ("modelab", "frequency_scale"): ("tool_modulus",),
    # The band is 2 Hz wide: twice differentiated is a sign and a factor, which the model's unknown mass takes.
    ("brake_reuss", "reversed_polarity"): ("wrong_quantity",),
}
"""Declared look-alikes by structure and effect."""

PLAN: tuple[tuple[str, str], ...] = (
    ("modelab", "sensor_mass"),
    ("modelab", ""),
    ("modelab", "calibration_gain"),
    ("modelab", "suspension"),
    ("modelab", ""),
    ("modelab", "frequency_scale"),
    ("modelab", "time_delay"),
    ("brake_reuss", ""),
    ("modelab", "sensor_mass"),
    ("modelab", "exponential_window"),
    ("modelab", ""),
    ("modelab", "wrong_quantity"),
    ("modelab", "suspension"),
    ("brake_reuss", "wrong_quantity"),
    ("modelab", ""),
    ("modelab", "coarse_resolution"),
    ("modelab", "calibration_gain"),
    ("modelab", "reversed_polarity"),
    ("modelab", ""),
    ("brake_reuss", "reversed_polarity"),
)
"""Structures and effects in turn: any beginning of it is a fair mixture."""

BOUNDS: dict[str, tuple[str, float, float]] = {
    "sensor_mass": ("mass", 1e-3, 0.3),
    "suspension": ("stiffness", 1e2, 1e8),
    "calibration_gain": ("gain", 2e-3, 9.0),
    "time_delay": ("delay", 1e-7, 5e-4),
    "exponential_window": ("rate", 0.1, 60.0),
    "frequency_scale": ("share", 1e-5, 0.02),
}
"""Name and range of the sizes that aim at a ratio. A body of more than a twentieth of the beam is no forgotten sensor,
and a clock is not wrong by more than two per cent."""
ENDS_S = (0.14, 0.18, 0.24)
"""Ends of truncated records, of a period of 0.4 s."""


@dataclass(frozen=True)
class Record:
    """One record as the engineer has it."""

    label: str
    configuration: str
    frequency_hz: Lines
    accelerance: Values
    """What the file calls so."""
    noise: Lines
    """Standard deviation of the logarithm of a line, by noise alone."""
    hit_place: float = 0.0
    known_mass: float = 0.0
    decay_rate: float = 0.0
    correlated_lines: float = 1.0
    conditions: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class Case:
    """What the engineer has, of one structure."""

    structure: str
    records: tuple[Record, ...]


@dataclass(frozen=True)
class Draw:
    """A case, its truth, and the same records with nothing hidden."""

    case: Case
    plain: Case
    effect: Effect | None
    modes_hz: tuple[float, ...] = ()
    """Natural frequencies of the bare structure in the band; empty where the model's mass is unknown."""
    shifts: tuple[float, ...] = ()
    """Their relative shifts by the effect."""
    ratio: float = 0.0
    discrepancy: float = float("nan")
    """Rms relative error of these natural frequencies of the plain model."""
    support: float = 0.0
    """Evidence that can be expected: twice the logarithm of the likelihood, less the price of the size; see above."""


@dataclass(frozen=True)
class Plain:
    """The fit of the engineer's model to records without an effect, from the bridge."""

    frequencies_hz: tuple[float, ...]
    deviations: tuple[Lines, ...]
    """Standard deviations of each record's lines."""
    residuals: tuple[Lines, ...]
    """Standardised residuals of each record, real parts first."""
    misfit: float


Fit = Callable[[Case], Plain]


def available(structure: str) -> bool:
    """Return whether the measured files are there."""
    return (modelab if structure == "modelab" else brake_reuss)() is not None


def plan(cases: int, only: Sequence[str] = ()) -> list[tuple[int, str, str]]:
    """Return number, structure and effect of each case; `only` keeps some structures and effects ("nothing")."""
    found = []
    for index in range(cases if not only else 1000 * cases):
        structure, effect = PLAN[index % len(PLAN)]
        if not only or structure in only or (effect or "nothing") in only:
            found.append((index, structure, effect))
        if len(found) == cases:
            break
    return found


def draw(seed: int, index: int, structure: str, effect: str, fit: Fit, aim: float | None = None) -> Draw:
    """Return a case; `fit` gives the discrepancy of the plain model, which sizes are relative to."""
    rng = np.random.default_rng([seed, index])
    if structure == "brake_reuss":
        return _draw_levels(rng, effect)
    beam = modelab()
    if beam is None:
        raise FileNotFoundError("the ModeLAB beam is not in the folder of measured files")
    setup = _setup(rng)
    plain = modelab_case(beam, setup, None)
    aim = float(rng.choice(AIMS)) if aim is None else aim
    sign = float(rng.choice([-1.0, 1.0]))
    place = int(rng.integers(3))
    if not effect:
        return Draw(plain, plain, None)
    known = fit(plain)
    modes = [mode for mode, (_, high) in zip(beam.modes, MODE_BANDS, strict=True) if high < setup.highest_hz]
    hz = tuple(exact.shifted_mode(mode)[0] for mode in modes)
    discrepancy = float(np.sqrt(np.mean((np.array(known.frequencies_hz[: len(hz)]) / np.array(hz) - 1.0) ** 2)))

    def ratio_of(one: Effect, case: Case | None = None) -> float:
        shifts = mode_shifts(modes, one)
        if shifts.any():
            return shift_ratio(shifts, discrepancy)
        return contrast(plain, case or modelab_case(beam, setup, one), known)

    def sized(size: float) -> Effect:
        name = BOUNDS[effect][0]
        if effect == "calibration_gain":
            return Effect(effect, {name: float(np.expm1(sign * np.log1p(size)))}, aim)
        both_ways = effect in ("time_delay", "frequency_scale")
        return Effect(effect, {name: sign * size if both_ways else size}, aim)

    if effect in BOUNDS:
        one = sized(solve(lambda size: ratio_of(sized(size)), aim, *BOUNDS[effect][1:]))
    elif effect == "coarse_resolution":
        one = Effect(effect, {"end": ENDS_S[place]})
    elif effect == "wrong_quantity":
        one = Effect(effect, {"order": (1.0, 2.0, -1.0)[place]})
    else:
        one = Effect(effect)
    case = modelab_case(beam, setup, one)
    shifts = tuple(mode_shifts(modes, one).tolist())
    ratio = ratio_of(one, case)
    places = {record.configuration for record in case.records} if any(shifts) else case.records
    return Draw(case, plain, one, hz, shifts, ratio, discrepancy, support(ratio, len(hz) * len(places)))


def support(ratio: float, values: int) -> float:
    """Return the evidence that can be expected of an effect that some values show."""
    return float(values * np.log1p(ratio**2) - np.log(values))


def solve(ratio: Callable[[float], float], aim: float, low: float, high: float) -> float:
    """Return the size with a ratio, by bisection of its logarithm; a bound where the ratio lies beyond it."""
    a, b = np.log(low), np.log(high)
    for _ in range(14):
        middle = 0.5 * (a + b)
        a, b = (middle, b) if ratio(float(np.exp(middle))) < aim else (a, middle)
    return float(np.exp(0.5 * (a + b)))


def mode_shifts(modes: Sequence[Values], effect: Effect) -> Lines:
    """Return the relative shifts of natural frequencies; zeros where an effect moves none."""
    if effect.id == "frequency_scale":
        return np.full(len(modes), effect.sizes["share"])
    mass = effect.sizes["mass"] if effect.id == "sensor_mass" else 0.0
    stiffness = effect.sizes["stiffness"] if effect.id == "suspension" else 0.0
    if not mass and not stiffness:
        return np.zeros(len(modes))
    pairs = [exact.shifted_mode(mode, mass, stiffness) for mode in modes]
    return np.array([after / before - 1.0 for before, after in pairs])


def shift_ratio(shifts: Lines, discrepancy: float, absorbed: float | None = None) -> float:
    """Return how large shifts are beside the discrepancy, and beside what tolerances absorb; see above."""
    if absorbed is None:
        absorbed = float(np.hypot(0.5 * TOLERANCES["youngs_modulus"], 0.5 * TOLERANCES["density"]))
        absorbed = float(np.hypot(absorbed, TOLERANCES["outer_diameter"]))
    count = shifts.size
    common = float(np.sum(shifts)) / (count + (discrepancy / absorbed) ** 2)
    left = np.sum((shifts - common) ** 2) / discrepancy**2 + (common / absorbed) ** 2
    return float(np.sqrt(left / count))


def contrast(plain: Case, case: Case, known: Plain) -> float:
    """Return the rms change of the records by the rms residual of the plain fit, in standard deviations."""
    change, residual = [], []
    for before, after, deviation, own in zip(
        plain.records, case.records, known.deviations, known.residuals, strict=True
    ):
        change.append(np.abs(np.log(after.accelerance / before.accelerance)) ** 2 / deviation**2)
        residual.append(own**2)
    return float(np.sqrt(np.mean(np.concatenate(change)) / 2.0 / np.mean(np.concatenate(residual))))


@dataclass(frozen=True)
class Setup:
    """Which ModeLAB records a case has: hits by number and known mass, up to which frequency."""

    hits: tuple[tuple[int, float], ...]
    highest_hz: float


def _setup(rng: np.random.Generator) -> Setup:
    configurations = int(rng.integers(1, 4))
    hits = [int(i) for i in rng.permutation([i for i in range(len(HIT_PLACES)) if i != DRIVE])]
    highest = float(rng.choice(HIGHEST_HZ))
    if rng.random() < 0.5:
        hits.insert(0, DRIVE)
    bare = 3 if configurations == 1 else 2
    loaded = zip(hits[bare:], KNOWN_MASSES[1:configurations], strict=False)
    return Setup((*((hit, 0.0) for hit in hits[:bare]), *loaded), highest)


def configuration_name(known_mass: float) -> str:
    """Return the name of a configuration of the ModeLAB beam."""
    return f"with {known_mass:g} kg" if known_mass else "bare"


def modelab_case(beam: Beam, setup: Setup, effect: Effect | None) -> Case:
    """Return the records of a setup with an effect."""
    sizes = {} if effect is None else effect.sizes
    id = "" if effect is None else effect.id
    rate = DECAY_RATE + (sizes["rate"] if id == "exponential_window" else 0.0)
    end = sizes["end"] if id == "coarse_resolution" else None
    lines = beam.lines(setup.highest_hz)
    hz = beam.frequency_hz[lines]
    # With a hidden window the records are those at another s than the one stated.
    s = exact.laplace(hz, rate)
    hits = sorted({DRIVE, *(hit for hit, _ in setup.hits)})
    # Bodies change the structure before a record is cut.
    whole = dict(zip(hits, exact.windowed(beam.accelerance[hits], beam.spacing_hz, rate), strict=True))
    drive = beam.drive_gain * whole[DRIVE]
    records = []
    for hit, known_mass in setup.hits:
        mass = known_mass + (sizes["mass"] if id == "sensor_mass" else 0.0)
        stiffness = sizes["stiffness"] if id == "suspension" else 0.0
        values = exact.with_body(whole[hit], drive, exact.laplace(beam.frequency_hz, rate), mass, stiffness)
        if end is not None:
            values = exact.windowed(values, beam.spacing_hz, 0.0, end)
        values = values[lines]
        noise = beam.noise[hit][lines] / np.sqrt(2.0 * DECAY_RATE / beam.spacing_hz) / np.abs(values)
        if id == "calibration_gain":
            values = exact.with_gain(values, sizes["gain"])
        elif id == "time_delay":
            values = exact.with_delay(values, sizes["delay"], s)
        elif id == "reversed_polarity":
            values = exact.reversed_polarity(values)
        elif id == "wrong_quantity":
            values = exact.as_quantity(values, int(sizes["order"]), s)
        axis = exact.on_wrong_axis(hz, sizes["share"]) if id == "frequency_scale" else hz
        name = configuration_name(known_mass)
        records.append(
            Record(
                label=f"{name}, hit at {HIT_PLACES[hit]:g} m",
                configuration=name,
                frequency_hz=axis,
                accelerance=values,
                noise=noise,
                hit_place=HIT_PLACES[hit],
                known_mass=known_mass,
                # The rate is in samples: on a wrong axis the stated one is wrong as well.
                decay_rate=DECAY_RATE * (1.0 + sizes["share"]) if id == "frequency_scale" else DECAY_RATE,
                correlated_lines=max(DECAY_RATE / (STEP * beam.spacing_hz), 1.0),
            )
        )
    return Case("modelab", tuple(records))


def _draw_levels(rng: np.random.Generator, effect: str) -> Draw:
    levels = brake_reuss()
    if levels is None:
        raise FileNotFoundError("the Brake-Reuss beam is not in the folder of measured files")
    chosen = [levels[int(i)] for i in sorted(rng.permutation(len(levels))[:BRAKE_REUSS_LEVELS])]
    order = (1, 2, -1)[int(rng.integers(3))]
    plain = Case("brake_reuss", tuple(map(level_record, chosen)))
    if not effect:
        return Draw(plain, plain, None)
    one = Effect(effect, {"order": float(order)} if effect == "wrong_quantity" else {})

    def change(record: Record) -> Record:
        if effect == "wrong_quantity":
            return replace(
                record, accelerance=exact.as_quantity(record.accelerance, order, exact.laplace(record.frequency_hz))
            )
        return replace(record, accelerance=exact.reversed_polarity(record.accelerance))

    # A sign, or a factor of 500 with a quarter of a turn, beside a misfit of some per cent.
    case = Case("brake_reuss", tuple(map(change, plain.records)))
    return Draw(case, plain, one, ratio=float("inf"), support=float("inf"))


def level_record(level: Level) -> Record:
    """Return one stepped sine of the Brake-Reuss beam as a record."""
    return Record(
        label=level.label,
        configuration=level.label,
        frequency_hz=level.frequency_hz,
        accelerance=level.accelerance,
        noise=np.full(level.frequency_hz.size, STEPPED_SINE_NOISE),
        conditions={"force": float(np.mean(level.force))},
    )
