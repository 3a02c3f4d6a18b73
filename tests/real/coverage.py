"""Coverage of predictions: how often the 95 % intervals hold natural frequencies and lines that were not fitted.

Each way of holding out is one that a user meets: another place of the hit, another known mass, modes above the measured
band, another overhang, another level. The measured structures are those of `structures`, and two of which natural
frequencies alone were measured:

cantilever strip (`strip`)
    An aluminium strip of 50 x 2 mm in a vice, two modes at four free lengths, with a board of 5 g at the tip;
    github.com/EnesDemirkaya/Vibration-Tester-ADXL357-FFT, MIT. The alloy, the exact thickness and the clamp are not
    documented. It is modelled as a round strip of the same bending stiffness and mass per length.
clamped rods (`rods`)
    First modes of three rods of Al 7075 in one clamp, read from figures to 5 Hz; github.com/leekunhwee/Dynamics.
"""

from __future__ import annotations

import csv
import warnings
from collections import defaultdict
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from real.bridge import observations_of, tolerances_of, unknowns_of
from real.cases import HIGHEST_HZ, KNOWN_MASSES, Case, Setup, level_record, modelab_case
from real.exact import shifted_mode
from real.structures import HIT_PLACES, MEASURED, brake_reuss, modelab
from receptance import Assembly, Material, Observation, Part, PointJoint, PointMass, Segment, Unknown
from receptance.diagnosis import diagnose
from receptance.fit import Tolerance
from receptance.fit.observation import altered
from receptance.fit.peaks import PredictedMode, match_peaks
from receptance.model.joints import GroundSpring
from receptance.predict import transfer
from receptance.predict.transfers import Splits

LEVEL = 0.95
STRIP_READING = 0.005
"""Relative standard deviation of a mean of repeated readings of the strip, which scatter by 1.5 %."""
SAME_MODE = 0.02
"""Relative distance of a peak from a natural frequency up to which it is its peak."""
SETUPS = 4
"""Random choices of hits and masses of the ModeLAB beam."""


@dataclass(frozen=True)
class Trial:
    """One way of holding out on one structure."""

    name: str
    observations: tuple[Observation, ...]
    unknowns: tuple[Unknown, ...]
    tolerances: tuple[Tolerance, ...]
    splits: Splits | tuple[tuple[str, ...], ...] = "leave-one-out"
    above_hz: float = 0.0
    """Natural frequencies up to here are not counted: they were fitted."""
    modes_hz: Mapping[str, Sequence[float]] = field(default_factory=dict)
    """Natural frequencies of configurations from the drive point. Other peaks are not counted: between antiresonances a
    record has summits that are no natural frequencies."""
    untested: str = ""
    """Why the fitted data cannot show that the model is wrong; then nothing is claimed of its intervals."""
    diagnosed: bool = False
    """Whether the predictions of verdicts are measured as well; a diagnosis takes seconds."""

    def counts(self, mode: PredictedMode) -> bool:
        """Return whether a held-out mode is a natural frequency that was not fitted."""
        measured = mode.measured_hz or 0.0
        structural = self.modes_hz.get(mode.configuration, (measured,))
        return measured > self.above_hz and min(abs(measured / hz - 1.0) for hz in structural) < SAME_MODE


@dataclass(frozen=True)
class Coverage:
    """How many natural frequencies and lines are in the intervals of one way of holding out."""

    name: str
    inside: int
    modes: int
    lines_inside: int
    lines: int
    deviations: tuple[float, ...]
    """Errors in standard deviations of prediction and reading."""
    widths: tuple[float, ...]
    """Half widths of the intervals of natural frequencies, relative."""
    untested: str = ""
    """As in `Trial`."""


def measure(trial: Trial, *, draws: int = 200, seed: int = 0) -> Coverage:
    """Return the coverage of one way of holding out by `transfer`."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        predictions = transfer(
            trial.observations,
            trial.unknowns,
            tolerances=trial.tolerances,
            splits=trial.splits,
            level=LEVEL,
            draws=draws,
            seed=seed,
            starts=2,
            threads=1,
        )
    lines_inside = lines = 0
    for frf in predictions.frfs:
        assert frf.measured is not None
        low, high = frf.band(LEVEL, 0.0 if frf.measured_deviation is None else frf.measured_deviation)
        counted = frf.frequency_hz.real > trial.above_hz
        size = np.abs(frf.measured)
        lines_inside += int(np.sum((low <= size) & (size <= high) & counted))
        lines += int(np.sum(counted))
    modes = [mode for mode in predictions.modes if trial.counts(mode)]
    return replace(of_modes(trial, modes), lines_inside=lines_inside, lines=lines)


def measure_verdicts(trial: Trial, *, seed: int = 0) -> Coverage:
    """Return the coverage by the verdict of a diagnosis of the fitted configurations, one held out in turn."""
    modes: list[PredictedMode] = []
    for name in dict.fromkeys(observation.configuration for observation in trial.observations):
        fitted = [observation for observation in trial.observations if observation.configuration != name]
        held_out = [observation for observation in trial.observations if observation.configuration == name]
        present = {text for observation in fitted for text in (observation.label, observation.configuration)}
        tolerances = [
            tolerance
            for tolerance in trial.tolerances
            if present & set(tolerance.configurations or tolerance.labels or present)
        ]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            verdict = diagnose(fitted, trial.unknowns, tolerances=tolerances, seed=seed, threads=1)
            predicted = verdict.at(held_out[0].assembly, configuration=name, tolerances=trial.tolerances)
            measured = [mode for observation in held_out for mode in _measured(observation) if trial.counts(mode)]
            upper_hz = 1.2 * max(mode.measured_hz or 0.0 for mode in measured)
            several = predicted.natural_frequencies(upper_hz).modes
        for mode in measured:
            near = min(several, key=lambda other: abs((other.predicted_hz or 0.0) - (mode.measured_hz or 0.0)))
            deviation_hz = mode.measured_deviation_hz
            modes.append(
                replace(near, configuration=name, measured_hz=mode.measured_hz, measured_deviation_hz=deviation_hz)
            )
    return of_modes(replace(trial, name=f"{trial.name}: diagnosis"), modes)


def _measured(observation: Observation) -> list[PredictedMode]:
    """Return the natural frequencies of an observation, or the peaks of its receptance, without predictions."""
    if observation.is_receptance:
        peaks = match_peaks(
            observation.frequency_hz, observation.receptance, observation.receptance, observation.standard_deviation
        )
    else:
        deviations = np.asarray(observation.standard_deviation).tolist()
        pairs = zip(observation.frequency_hz.tolist(), deviations, strict=True)
        peaks = [PredictedMode(measured_hz=hz, measured_deviation_hz=deviation) for hz, deviation in pairs]
    return [replace(peak, configuration=observation.configuration) for peak in peaks if peak.measured_hz is not None]


def of_modes(trial: Trial, modes: Sequence[PredictedMode]) -> Coverage:
    """Return the coverage of natural frequencies; one without a prediction or an interval is not in it."""
    inside, deviations, widths = 0, [], []
    for mode in modes:
        interval = mode.interval_hz(LEVEL, mode.measured_deviation_hz)
        if interval is None or mode.predicted_hz is None or mode.deviation_hz is None or mode.measured_hz is None:
            continue
        inside += interval[0] <= mode.measured_hz <= interval[1]
        spread = float(np.hypot(mode.deviation_hz, mode.measured_deviation_hz))
        deviations.append((mode.predicted_hz - mode.measured_hz) / spread)
        widths.append(0.5 * (interval[1] - interval[0]) / mode.measured_hz)
    return Coverage(trial.name, inside, len(modes), 0, 0, tuple(deviations), tuple(widths), trial.untested)


def trials() -> Iterator[Trial]:
    """Yield the ways of holding out on the structures whose files are there."""
    yield from _modelab()
    yield from _brake_reuss()
    yield from _strip()
    yield from _rods()


def _modelab() -> Iterator[Trial]:
    beam = modelab()
    if beam is None:
        return
    hits = tuple((hit, 0.0) for hit in range(len(HIT_PLACES)))
    every = modelab_case(beam, Setup(hits, HIGHEST_HZ[-1]), None)
    yield _trial("modelab, one hit held out", every, by_record=True)
    yield _trial("modelab, one hit fitted", every, by_record=True, splits="one-for-all")
    for highest in HIGHEST_HZ[:-1]:
        low = _trial("", modelab_case(beam, Setup(hits, highest), None))
        whole = _trial(f"modelab, modes above {highest:.0f} Hz", every)
        renamed = [altered(one, configuration="whole", label=f"{one.label}, whole") for one in whole.observations]
        tolerances = tuple(_with_whole(one) for one in whole.tolerances)
        observations = (*low.observations, *renamed)
        yield replace(
            whole,
            observations=observations,
            tolerances=tolerances,
            splits=(("whole",),),
            above_hz=1.02 * highest,
            modes_hz={"whole": whole.modes_hz["bare"]},
        )
    for seed in range(SETUPS):
        rng = np.random.default_rng(seed)
        chosen = rng.permutation(len(HIT_PLACES))[:6].tolist()
        masses = [KNOWN_MASSES[i // 2] for i in range(6)]
        case = modelab_case(beam, Setup(tuple(zip(chosen, masses, strict=True)), HIGHEST_HZ[-1]), None)
        yield replace(_trial("modelab, one known mass held out", case), diagnosed=True)


def _with_whole(tolerance: Tolerance) -> Tolerance:
    labels = tolerance.labels
    if labels is None:
        return tolerance
    labels = (labels,) if isinstance(labels, str) else labels
    return replace(tolerance, labels=(*labels, *(f"{label}, whole" for label in labels)))


def _trial(name: str, case: Case, *, by_record: bool = False, splits: Splits = "leave-one-out") -> Trial:
    observations = observations_of(case)
    if by_record:
        observations = [altered(one, configuration=one.label) for one in observations]
    modes = {}
    if (beam := modelab()) is not None and case.structure == "modelab":
        masses = {one.configuration: record.known_mass for one, record in zip(observations, case.records, strict=True)}
        modes = {name: [shifted_mode(mode, mass)[1] for mode in beam.modes] for name, mass in masses.items()}
    return Trial(
        name, tuple(observations), tuple(unknowns_of(case)), tuple(tolerances_of(case)), splits, modes_hz=modes
    )


def _brake_reuss() -> Iterator[Trial]:
    levels = brake_reuss()
    if levels is not None:
        case = Case("brake_reuss", tuple(map(level_record, levels)))
        yield _trial("brake_reuss, one level held out", case)
        reason = "the modulus is unknown, and follows from the only natural frequency"
        yield replace(_trial("brake_reuss, one level fitted", case, splits="one-for-all"), untested=reason)


def _strip() -> Iterator[Trial]:
    path = MEASURED / "cantilever_tip_mass" / "frequencies.csv"
    if not path.is_file():
        return
    readings: dict[float, dict[int, float]] = defaultdict(dict)
    with path.open() as file:
        for length, mode, frequency in list(csv.reader(file))[1:]:
            readings[1e-3 * float(length)][int(mode)] = float(frequency)
    width, thickness, modulus, density = 0.05, 0.002, 70e9, 2700.0
    # A round strip of this diameter has the ratio of bending stiffness and mass of the flat one.
    diameter = 2.0 * thickness / np.sqrt(3.0)
    scale = width * thickness / (np.pi * diameter**2 / 4.0)
    metal = Material(youngs_modulus=scale * modulus, density=scale * density, poisson_ratio=0.33)
    vice = Material(youngs_modulus=210e9, density=7850.0, poisson_ratio=0.3)

    def assembly(length: float, *masses: PointMass) -> Assembly:
        strip = Part([Segment(length=length, outer_diameter=diameter, material=metal)], name="strip")
        block = Part([Segment(length=0.1, outer_diameter=0.12, material=vice)], name="vice")
        bench = GroundSpring(k_y=1e9, k_theta=1e7, part="vice", position=0.05, name="bench")
        clamp = PointJoint(k_y=1e8, k_theta=1e3, name="clamp")
        return Assembly([strip, clamp, block], [bench, *masses])

    tolerances = (
        Tolerance(name="modulus", moves={"strip.segment[0].youngs_modulus": 0.02}, relative=True),
        Tolerance(name="density", moves={"strip.segment[0].density": 0.01}, relative=True),
        Tolerance(name="thickness", moves={"strip.segment[0].outer_diameter": 0.01}, relative=True),
        *(
            Tolerance(name=f"length {name}", moves={"strip.segment[0].length": 1e-3}, configurations=(name,))
            for name in map(_name_of, readings)
        ),
    )
    unknown = Unknown(address="clamp.k_theta", lower=1.0, upper=1e6)
    for name, masses in (("board stated", [PointMass(mass=5e-3, part="strip", name="board")]), ("board forgotten", [])):
        observations = tuple(
            Observation.from_modes(
                assembly=assembly(length, *masses),
                frequency_hz=np.array(list(modes.values())),
                modes=tuple(modes),
                standard_deviation_hz=STRIP_READING * np.array(list(modes.values())),
                configuration=_name_of(length),
            )
            for length, modes in readings.items()
        )
        yield Trial(f"strip, {name}, one length held out", observations, (unknown,), tolerances, diagnosed=True)
        yield Trial(f"strip, {name}, one length fitted", observations, (unknown,), tolerances, "one-for-all")


def _name_of(length: float) -> str:
    return f"{1e3 * length:.0f} mm"


def _rods() -> Iterator[Trial]:
    metal = Material(youngs_modulus=72e9, density=2810.0, poisson_ratio=0.33)
    base = Material(youngs_modulus=210e9, density=7850.0, poisson_ratio=0.3)
    # Lengths and diameters from the clamp, in m, and first natural frequencies in Hz.
    rods = {
        "b": (((0.19, 0.016),), 293.0),
        "c": (((0.14, 0.016),), 521.0),
        "d": (((0.14, 0.016), (0.05, 0.010)), 398.0),
    }
    observations = []
    for name, (sections, frequency) in rods.items():
        segments = [Segment(length=length, outer_diameter=d, material=metal) for length, d in reversed(sections)]
        block = Part([Segment(length=0.2, outer_diameter=0.3, material=base)], name="block")
        ground = GroundSpring(k_y=1e10, k_theta=1e9, part="block", position=0.1, name="bench")
        clamp = PointJoint(k_y=1e9, k_theta=1e5, name="clamp")
        observations.append(
            Observation.from_modes(
                assembly=Assembly([Part(segments, name="rod"), clamp, block], [ground]),
                frequency_hz=np.array([frequency]),
                standard_deviation_hz=2.5,
                configuration=name,
            )
        )
    tolerances = (Tolerance(name="modulus", moves={"rod.segment[*].youngs_modulus": 0.01}, relative=True),)
    unknown = Unknown(address="clamp.k_theta", lower=1e2, upper=1e7)
    yield Trial("rods, one rod held out", tuple(observations), (unknown,), tolerances)
    yield Trial(
        "rods, one rod fitted",
        tuple(observations),
        (unknown,),
        tolerances,
        "one-for-all",
        untested="the clamp is unknown, and follows from the only natural frequency",
    )


def table(coverages: Sequence[Coverage]) -> str:
    """Return the coverage by way of holding out, and of all ways in which the data can test the model."""
    rows = [f"{'held out':<46} {'frequencies':>13} {'half width':>10} {'lines':>17}  largest errors, deviations"]
    for coverage in coverages:
        worst = ", ".join(f"{value:+.1f}" for value in sorted(coverage.deviations, key=abs, reverse=True)[:3])
        lines = f"{100.0 * coverage.lines_inside / coverage.lines:.1f} % of {coverage.lines}" if coverage.lines else ""
        width = 100.0 * float(np.median(coverage.widths)) if coverage.widths else float("nan")
        rows.append(
            f"{coverage.name:<46} {coverage.inside:>5} of {coverage.modes:<4} {width:>8.2f} % {lines:>17}  {worst}"
        )
        rows += [f"   not counted: {coverage.untested}"] if coverage.untested else []
    counted = [coverage for coverage in coverages if not coverage.untested]
    inside, modes = sum(coverage.inside for coverage in counted), sum(coverage.modes for coverage in counted)
    lines_inside, count = (
        sum(coverage.lines_inside for coverage in counted),
        sum(coverage.lines for coverage in counted),
    )
    rows.append(
        f"counted: {inside} of {modes} natural frequencies ({100.0 * inside / max(modes, 1):.1f} %), "
        f"{lines_inside} of {count} lines ({100.0 * lines_inside / max(count, 1):.1f} %)"
    )
    return "\n".join(rows)
