"""From a case to objects of the package and back: the only place here that imports it."""

from __future__ import annotations

import time
import warnings
from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from blind.bridge import Answer, answer_from, failed
from real.cases import Case, Plain, Record
from real.structures import DECAY_RATE, KNOWN_MASS_TOLERANCE, LENGTH, NOMINAL, PLACE_M, SENSOR_PLACE, TOLERANCES
from receptance import FRF, Assembly, Coordinate, Material, Observation, Part, PointMass, Segment, Unknown, identify
from receptance.fit import Floor, Tolerance

UPPER_HZ = 1200.0
SENSOR = Coordinate("beam", SENSOR_PLACE)
BRAKE_REUSS_LENGTH = 0.72
"""In m, of the usual Brake-Reuss beam; modulus and density are unknown, so any length gives the same mode."""


def edges_of(case: Case) -> list[float]:
    """Return the places on the ModeLAB beam where its segments meet: sensor and hits."""
    return sorted({SENSOR_PLACE, *(record.hit_place for record in case.records)})


def modelab_assembly(case: Case, known_mass: float = 0.0) -> Assembly:
    """Return the engineer's model of the free beam, divided where it was hit."""
    material = Material(
        youngs_modulus=NOMINAL["youngs_modulus"],
        density=NOMINAL["density"],
        poisson_ratio=NOMINAL["poisson_ratio"],
        loss_factor=2e-4,
    )
    segments = [
        Segment(
            length=high - low,
            outer_diameter=NOMINAL["outer_diameter"],
            inner_diameter=NOMINAL["inner_diameter"],
            material=material,
        )
        for low, high in pairwise([0.0, *edges_of(case), LENGTH])
    ]
    masses = [PointMass(mass=known_mass, part="beam", position=SENSOR_PLACE, name="load")] if known_mass else []
    return Assembly([Part(segments, name="beam")], masses)


def tolerances_of(case: Case) -> list[Tolerance]:
    """Return the stated tolerances: of the ModeLAB beam; the other one has none."""
    if case.structure != "modelab":
        return []
    found = [
        Tolerance(name=name, moves={f"beam.segment[*].{name}": deviation}, relative=True)
        for name, deviation in TOLERANCES.items()
    ]
    edges = edges_of(case)
    for record in case.records:
        if record.hit_place != SENSOR_PLACE:
            moves = _moved(edges.index(record.hit_place))
            found.append(Tolerance(name=f"place of {record.label}", moves=moves, labels=record.label))
    if any(record.known_mass for record in case.records):
        found.append(Tolerance(name="known masses", moves={"load.mass": KNOWN_MASS_TOLERANCE}, relative=True))
    return [*found, Tolerance(name="place of the sensor", moves=_moved(edges.index(SENSOR_PLACE)))]


def _moved(edge: int) -> dict[str, float]:
    return {f"beam.segment[{edge}].length": PLACE_M, f"beam.segment[{edge + 1}].length": -PLACE_M}


def unknowns_of(case: Case) -> list[Unknown]:
    """Return the unknowns of the engineer's model."""
    loss = Unknown(address="beam.segment[*].loss_factor", lower=1e-6, upper=0.3)
    if case.structure == "modelab":
        return [loss]
    return [
        loss,
        Unknown(address="beam.segment[*].youngs_modulus", lower=1e8, upper=1e13),
        Unknown(address="beam.segment[*].density", lower=1e2, upper=1e6),
    ]


def brake_reuss_assembly() -> Assembly:
    """Return a beam with one free mode, whose frequency and mass are unknown."""
    material = Material(youngs_modulus=2e10, density=7850.0, poisson_ratio=0.3, loss_factor=4e-3)
    return Assembly([Part([Segment(length=BRAKE_REUSS_LENGTH, outer_diameter=0.03, material=material)], name="beam")])


def observations_of(case: Case) -> list[Observation]:
    """Return the records as observations of the engineer's model."""
    masses = {record.known_mass for record in case.records}
    if case.structure == "modelab":
        assemblies = {mass: modelab_assembly(case, mass) for mass in masses}
    else:
        assemblies = {0.0: brake_reuss_assembly()}
    return [_observation(case, record, assemblies[record.known_mass]) for record in case.records]


def _observation(case: Case, record: Record, assembly: Assembly) -> Observation:
    free = case.structure == "modelab"
    with warnings.catch_warnings():
        # The package may warn of a wrong quantity or sign; only the verdict is scored.
        warnings.simplefilter("ignore")
        frf = FRF(
            frequency_hz=record.frequency_hz,
            values=record.accelerance,
            form="accelerance",
            decay_rate=record.decay_rate,
            log_variance=record.noise**2,
            correlated_lines=record.correlated_lines,
            label=record.label,
        )
        return Observation.from_frf(
            assembly,
            frf,
            response=SENSOR if free else Coordinate("beam", 0.0),
            excitation=Coordinate("beam", record.hit_place) if free else Coordinate("beam", 0.0),
            floor=Floor(),
            label=record.label,
            configuration=record.configuration,
            conditions=record.conditions,
        )


def fit(case: Case) -> Plain:
    """Return the fit of the engineer's model to records without an effect."""
    observations = observations_of(case)
    # An engineer raises the noise to what the model leaves, the same on all lines.
    options = {"tolerances": tolerances_of(case), "starts": 2, "threads": 1, "noise": "stated"}
    factor = 1.0
    for _ in range(4):
        found = identify([one.noisier(factor) for one in observations], unknowns_of(case), **options)
        chi_square = 2.0 * min(start.cost for start in found.starts)
        factor = max(factor * (chi_square / found.task.independent_values) ** 0.5, 1.0)
    frequencies: Sequence[float] = ()
    if case.structure == "modelab":
        bare = found.at(modelab_assembly(case), configuration="bare").assembly
        frequencies = bare.natural_frequencies(UPPER_HZ).tolist()
    residuals = [
        factor * own[: 2 * one.frequency_hz.size] for own, one in zip(found.residuals, observations, strict=True)
    ]
    return Plain(
        frequencies_hz=tuple(frequencies),
        deviations=tuple(np.asarray(one.standard_deviation) for one in observations),
        residuals=tuple(residuals),
        misfit=float(np.mean(np.concatenate(residuals) ** 2)),
    )


def ask(case: Case, *, threads: int | None = 1, seed: int = 0, causes: Sequence[str] | None = None) -> Answer:
    """Return the verdict of the package on a case, from its whole catalogue or from some causes."""
    from receptance.diagnosis import diagnose

    begun = time.perf_counter()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            verdict = diagnose(
                observations_of(case),
                unknowns_of(case),
                tolerances=tolerances_of(case),
                causes=causes,
                seed=seed,
                threads=threads,
            )
    except Exception as error:  # a failed diagnosis counts as a wrong answer
        return failed(f"{type(error).__name__}: {error}", time.perf_counter() - begun)
    return answer_from(verdict, time.perf_counter() - begun)


def simulated(case: Case, record: Record) -> np.ndarray:
    """Return the engineer's accelerance on the lines of a ModeLAB record, before any fit."""
    s = DECAY_RATE + 2j * np.pi * record.frequency_hz
    own = modelab_assembly(case, record.known_mass)
    hit = Coordinate("beam", record.hit_place)
    return s**2 * own.receptance(s / 2j / np.pi, response=SENSOR, excitation=hit)
