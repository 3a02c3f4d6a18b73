"""From a case to objects of the package, and from its verdict to plain values: the only place that imports it.

It passes the content of a campaign file: nominal dimensions, stated tolerances, the joint as
unknown, and the FRFs with their metadata. It does not use the truth.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blind.generator import Case, Configuration, Nominal, Record
from receptance import (
    FRF,
    Assembly,
    Coordinate,
    Material,
    MeasuredFRF,
    Part,
    PointJoint,
    PointMass,
    Section,
    Segment,
    SpreadJoint,
)
from receptance.identification import Floor, Law, Tolerance

JOINT_BOUNDS = {
    "joint.k_y": (1e6, 1e10),
    "joint.k_theta": (1e3, 1e7),
    "joint.c_y": (1e-1, 1e5),
    "joint.c_theta": (1e-4, 1e2),
}
START = {"joint.k_y": 1e8, "joint.k_theta": 5e4, "joint.c_y": 300.0, "joint.c_theta": 0.2}
UPPER_HZ = 9000.0


@dataclass(frozen=True)
class Answer:
    """A verdict as plain values."""

    verdict: str
    reported: tuple[str, ...]
    """Ids of all reported causes: named, suspected, or those between which it is ambiguous."""
    together: tuple[str, ...]
    """Ids that the best explanation holds together."""
    sizes: dict[str, dict[str, tuple[float, float, float]]]
    converged: bool
    misfit: float
    misfit_after: float
    seconds: float
    predictions: dict[str, tuple[list[float], list[float]]]
    before: dict[str, tuple[list[float], list[float]]]
    next_measurement: str = ""
    candidates: list[tuple[str, float, float]] = field(default_factory=list)
    error: str = ""


def _materials(nominal: Nominal) -> dict[str, Material]:
    p = nominal.numbers
    return {
        kind: Material(
            youngs_modulus=p[f"{kind}.modulus"],
            density=p[f"{kind}.density"],
            poisson_ratio=p[f"{kind}.poisson"],
            loss_factor=p[f"{kind}.loss"],
        )
        for kind in ("tool", "holder")
    }


def assembly_of(nominal: Nominal, configuration: Configuration) -> Assembly:
    """Return the nominal assembly."""
    p, material = nominal.numbers, _materials(nominal)
    shear = "hutchinson" if p["shear.hutchinson"] else "cowper"
    tool = []
    rest = configuration.overhang
    if "flute.length" in p:
        diameter = p["tool.diameter"] * p["flute.ratio"]
        tool.append(Segment(length=p["flute.length"], outer_diameter=diameter, material=material["tool"], shear=shear))
        rest -= p["flute.length"]
    tool.append(Segment(length=rest, outer_diameter=p["tool.diameter"], material=material["tool"], shear=shear))
    sections = []
    for i in range(3):
        steel = material["holder"]
        if i == 2 and "holder.stiffer" in p:
            # A body that is taken as rigid.
            steel = Material(
                youngs_modulus=steel.youngs_modulus * 10.0 ** p["holder.stiffer"],
                density=steel.density,
                poisson_ratio=steel.poisson_ratio,
                loss_factor=steel.loss_factor,
            )
        sections.append(
            Segment(
                length=p[f"holder.{i}.length"],
                outer_diameter=p[f"holder.{i}.outer"],
                inner_diameter=p[f"holder.{i}.inner"],
                material=steel,
                core=material["tool"] if i == 0 else None,
                shear=shear,
            )
        )
    joint = {name.split(".")[1]: value for name, value in START.items()}
    link: PointJoint | SpreadJoint = PointJoint(**joint, name="joint")
    if nominal.layer:
        mouth = sections.pop(0)
        link = SpreadJoint(
            length=mouth.length,
            shank=Section(outer_diameter=p["tool.diameter"], material=material["tool"], shear=shear),
            sleeve=Section(
                outer_diameter=mouth.outer_diameter,
                inner_diameter=p["tool.diameter"],
                material=material["holder"],
                shear=shear,
            ),
            **joint,
            name="joint",
        )
    points = [PointMass(mass=p["sensor.mass"], part="tool", name="sensor")] if "sensor.mass" in p else []
    return Assembly([Part(tool, name="tool"), link, Part(sections, name="holder")], points)


def _addresses(nominal: Nominal, number: str) -> list[str]:
    """Return the addresses that a number of the laboratory has in the assemblies."""
    kind, *rest = number.split(".")
    field_ = {"modulus": "youngs_modulus", "outer": "outer_diameter", "inner": "inner_diameter"}.get(rest[-1], rest[-1])
    layer = nominal.layer
    if number == "tool.overhang":
        return [f"tool.segment[{int('flute.length' in nominal.numbers)}].length"]
    if number == "tool.diameter":
        # The shank fills the bore.
        inside = ["joint.shank.outer_diameter", "joint.sleeve.inner_diameter"]
        return ["tool.segment[*].outer_diameter", *(inside if layer else ["holder.segment[0].inner_diameter"])]
    if kind == "tool":
        return [f"tool.segment[*].{field_}", f"joint.shank.{field_}" if layer else f"holder.segment[0].core.{field_}"]
    if len(rest) == 1:
        return [f"holder.segment[*].{field_}", *([f"joint.sleeve.{field_}"] if layer else [])]
    section = int(rest[0]) - layer
    if section < 0:
        return ["joint.length" if field_ == "length" else f"joint.sleeve.{field_}"]
    return [f"holder.segment[{section}].{field_}"]


def tolerances_of(nominal: Nominal) -> list[Tolerance]:
    """Return the stated tolerances."""
    return [
        Tolerance(
            name=stated.name,
            moves={a: deviation for name, deviation in stated.moves.items() for a in _addresses(nominal, name)},
            relative=stated.relative,
            configurations=stated.configuration,
        )
        for stated in nominal.tolerances
    ]


def unknowns_of(nominal: Nominal) -> list[Law]:
    """Return the unknowns of the joint, with those that differ between clampings."""
    return [
        Law(
            address=address,
            lower=lower,
            upper=upper,
            individual=nominal.joint_scatter if address.startswith("joint.k") else nominal.damping_scatter,
        )
        for address, (lower, upper) in JOINT_BOUNDS.items()
    ]


def frf_of(record: Record) -> FRF:
    """Return the FRF in the form of the analyser."""
    e = record.estimate
    with warnings.catch_warnings():
        # The package may warn of a wrong quantity; only the verdict is scored.
        warnings.simplefilter("ignore")
        frf = FRF(
            frequency_hz=e.frequency_hz,
            values=e.receptance,
            decay_rate=e.decay_rate,
            coherence=e.coherence,
            averages=e.averages,
            log_variance=e.log_variance,
            degrees_of_freedom=e.degrees_of_freedom,
            correlated_lines=e.correlated_lines,
            label=record.label,
            notes=record.notes,
        )
        return frf.to(record.form)  # type: ignore[arg-type]


def _conditions(configuration: Configuration, level: float) -> dict[str, float]:
    noted = {"torque": configuration.torque} if configuration.torque else {}
    return {"force": level, **noted}


_PLACES = {"tip": Coordinate("tool", 0.0), "nose": Coordinate("holder", 0.0)}


def _at_nose(assembly: Assembly) -> Assembly:
    """Return an assembly with the sensor at the nose, where there is one."""
    moved = [PointMass(mass=assembly.get("sensor.mass"), part="holder", name="sensor")] if assembly.attachments else []
    return Assembly(assembly.elements.values(), moved)


def observations_of(case: Case) -> list[MeasuredFRF]:
    """Return all records as observations of the nominal assemblies."""
    configurations = {c.name: c for c in case.nominal.configurations}
    by_name = {name: assembly_of(case.nominal, c) for name, c in configurations.items()}
    several = len({record.plane for record in case.records}) > 1
    found = []
    for record in case.records:
        conditions = _conditions(configurations[record.configuration], record.level)
        conditions |= {"plane": float(record.plane)} if several else {}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            found.append(
                MeasuredFRF.from_frf(
                    by_name[record.configuration] if record.place == "tip" else _at_nose(by_name[record.configuration]),
                    frf_of(record),
                    response=_PLACES[record.place],
                    excitation=_PLACES[record.place],
                    floor=Floor(),
                    label=record.label,
                    configuration=record.configuration,
                    conditions=conditions,
                )
            )
    return found


def ask(
    case: Case,
    *,
    threads: int | None = 1,
    seed: int = 0,
    causes: Sequence[str] | None = None,
    without: Sequence[str] = (),
) -> Answer:
    """Return the verdict of the package on a case, perhaps from some causes only, or without some."""
    from receptance.diagnosis import CATALOGUE, diagnose

    if without:
        causes = [id for id in causes or CATALOGUE if id not in without]

    begun = time.perf_counter()
    measured = {c.name for c in case.nominal.configurations}
    every = tolerances_of(case.nominal)
    stated = [
        one
        for one, tolerance in zip(every, case.nominal.tolerances, strict=True)
        if tolerance.configuration is None or tolerance.configuration in measured
    ]
    try:
        verdict = diagnose(
            observations_of(case),
            unknowns_of(case.nominal),
            tolerances=stated,
            causes=causes,
            seed=seed,
            threads=threads,
        )
    except Exception as error:  # a failed diagnosis counts as a wrong answer
        return failed(f"{type(error).__name__}: {error}", time.perf_counter() - begun)
    seconds = time.perf_counter() - begun
    predictions, before = {}, {}
    problem = ""
    for tool in case.new_tools:
        assembly = assembly_of(case.nominal, tool)
        level = float(np.sqrt(np.prod(sorted({r.level for r in case.records}))))
        conditions = _conditions(tool, level) | {"plane": 1.0}
        where: dict[str, Any] = {"configuration": tool.name, "conditions": conditions, "tolerances": every}
        try:
            predictions[tool.name] = _lists(verdict.predict_natural_frequencies(assembly, UPPER_HZ, **where))
            before[tool.name] = _lists(verdict.base.predict_natural_frequencies(assembly, UPPER_HZ, **where))
        except Exception as error:  # the table counts it as a missing prediction
            problem = f"prediction: {type(error).__name__}: {error}"
    return answer_from(verdict, seconds, predictions, before, problem)


def answer_from(
    verdict: Any,
    seconds: float,
    predictions: dict[str, tuple[list[float], list[float]]] | None = None,
    before: dict[str, tuple[list[float], list[float]]] | None = None,
    error: str = "",
) -> Answer:
    """Return a verdict of the package as plain values."""
    after = verdict.adequacy_after
    return Answer(
        verdict=verdict.verdict,
        reported=tuple(dict.fromkeys([*(c.id for c in verdict.causes), *verdict.ambiguous_between])),
        together=tuple(c.id for c in verdict.causes if c.together_with),
        sizes={c.id: dict(c.parameters) for c in verdict.causes},
        converged=all(c.converged for c in verdict.causes),
        misfit=float(verdict.adequacy.misfit),
        misfit_after=float(after.misfit) if after is not None else float("nan"),
        seconds=seconds,
        predictions=predictions or {},
        before=before or {},
        next_measurement="" if verdict.next_measurement is None else str(verdict.next_measurement.action),
        candidates=[(c.id, round(c.evidence, 2), round(c.misfit, 4)) for c in verdict.candidates[:6]],
        error=error,
    )


def advisable() -> list[str]:
    """Return all that a diagnosis may advise to measure."""
    from receptance.diagnosis.advice import MENU

    return [choice.action for choice in MENU]


def _lists(found: tuple[NDArray[np.float64], NDArray[np.float64]]) -> tuple[list[float], list[float]]:
    return found[0].tolist(), found[1].tolist()


def failed(error: str, seconds: float) -> Answer:
    """Return the answer of a diagnosis that ended with an error."""
    nan = float("nan")
    return Answer("failed", (), (), {}, False, nan, nan, seconds, {}, {}, error=error)


def simulated(case: Case, numbers: dict[str, Any], record: Record) -> NDArray[np.complex128]:
    """Return the package's receptance with the joint of some numbers, to compare the two physics in a test."""
    configuration = next(c for c in case.nominal.configurations if c.name == record.configuration)
    assembly = assembly_of(case.nominal, configuration).replace({name: numbers[name] for name in JOINT_BOUNDS})
    assembly = assembly if record.place == "tip" else _at_nose(assembly)
    e = record.estimate
    lines = e.frequency_hz - 1j * e.decay_rate / (2.0 * np.pi) if e.decay_rate else e.frequency_hz
    return assembly.receptance(lines, response=_PLACES[record.place], excitation=_PLACES[record.place])
