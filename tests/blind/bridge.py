"""From a case to objects of the package, and from its verdict to plain values: the only place that imports it,
with `bridge_geometry` for cones and flutes.

It passes the content of a campaign file: nominal dimensions, stated tolerances, the joint as
unknown, and the FRFs with their metadata. It does not use the truth.
"""

from __future__ import annotations

import tempfile
import time
import warnings
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from blind.bridge_geometry import geometry_addresses, holder_segments, tool_segments
from blind.generator import Blank, Case, Configuration, Modes, Nominal, Record, Table
from blind.generator.records import Estimate
from receptance import (
    FRF,
    Assembly,
    Coordinate,
    Material,
    MeasuredPart,
    ModalPart,
    Mode,
    Observation,
    Part,
    PointJoint,
    PointMass,
    Section,
    Segment,
    SpreadJoint,
)
from receptance.fit import Floor, Law, Tolerance

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
    notes: tuple[str, ...] = ()
    error: str = ""
    variants: tuple[str, ...] = ()
    """In which way each reported cause acts."""


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


@dataclass(frozen=True)
class Holder:
    """A holder as data: the end of the assemblies, and the tolerances of its numbers."""

    end: MeasuredPart | ModalPart
    tolerances: tuple[Tolerance, ...] = ()


def holder_of(case: Case) -> Holder | None:
    """Return the holder as the program reads it or finds it; None where beams describe it."""
    if isinstance(case.known, Table):
        return Holder(_read_table(case.known))
    if isinstance(case.known, Modes):
        return _stated_modes(case.known)
    return Holder(_from_blank(case.known)) if isinstance(case.known, Blank) else None


def _read_table(table: Table) -> MeasuredPart:
    """Return a table by way of a file, as an engineer would."""
    from receptance.coupling import read_spindle
    from receptance.io import write

    frf = FRF(
        frequency_hz=table.frequency_hz,
        values=table.matrix,
        responses=["y", "theta"],
        excitations=["y", "theta"],
        decay_rate=table.decay_rate,
        log_variance=table.log_variance,
    )
    with tempfile.TemporaryDirectory() as folder:
        write(Path(folder) / "holder.npz", frf)
        return read_spindle(Path(folder) / "holder.npz", name="holder")


def _stated_modes(known: Modes) -> Holder:
    from receptance.coupling import mode_tolerances

    modes = [Mode(frequency_hz=f, damping_ratio=z, y=y, theta=t) for f, z, y, t in known.rows.tolist()]
    names = ("residual_y", "residual_theta", "residual_ytheta")
    end = ModalPart(modes=modes, **dict(zip(names, known.residuals.tolist(), strict=True)), name="holder")
    # The rows have four numbers of each mode; its shape is real.
    stated = [
        f"mode[{i}].{name}" for i in range(len(modes)) for name in ("frequency_hz", "damping_ratio", "y", "theta")
    ]
    places = [end.addresses.index(address) for address in (*stated, *names)]
    covariance = np.zeros((len(end.addresses), len(end.addresses)))
    covariance[np.ix_(places, places)] = known.covariance
    return Holder(end, mode_tolerances(end, covariance))


def _from_blank(known: Blank) -> MeasuredPart:
    """Return what the program finds of the holder from the hits on the reference blank."""
    from receptance.coupling import identify_spindle

    p = known.numbers
    material = Material(
        youngs_modulus=p["tool.modulus"],
        density=p["tool.density"],
        poisson_ratio=p["tool.poisson"],
        loss_factor=p["tool.loss"],
    )
    shear = "hutchinson" if p["shear.hutchinson"] else "cowper"
    cylinder = Segment(length=known.length, outer_diameter=p["tool.diameter"], material=material, shear=shear)
    blank = Assembly([Part([cylinder], name="blank")])
    observed = [
        Observation.from_frf(
            blank,
            _frf(estimate, f"blank {i}"),
            response=Coordinate("blank", response),
            excitation=Coordinate("blank", excitation),
            floor=Floor(),
        )
        for i, ((response, excitation), estimate) in enumerate(zip(known.places, known.estimates, strict=True))
    ]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return identify_spindle(observed).part(name="holder")


def assembly_of(nominal: Nominal, configuration: Configuration, holder: Holder | None = None) -> Assembly:
    """Return the nominal assembly, with a holder of beams or of data."""
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
    if nominal.geometry:
        tool = tool_segments(nominal, configuration.overhang, material["tool"], shear)
        sections = holder_segments(nominal, material, shear)
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
    if holder is not None:
        return Assembly([Part(tool, name="tool"), link, holder.end], points)
    return Assembly([Part(tool, name="tool"), link, Part(sections, name="holder")], points)


def _addresses(nominal: Nominal, number: str) -> list[str]:
    """Return the addresses that a number of the laboratory has in the assemblies."""
    if nominal.geometry:
        return geometry_addresses(nominal, number)
    kind, *rest = number.split(".")
    fields = {
        "modulus": "youngs_modulus",
        "poisson": "poisson_ratio",
        "loss": "loss_factor",
        "outer": "outer_diameter",
        "inner": "inner_diameter",
    }
    field_ = fields.get(rest[-1], rest[-1])
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


def tolerances_of(nominal: Nominal, holder: Holder | None = None) -> list[Tolerance]:
    """Return the stated tolerances, and then those of a holder of data."""

    def moved(number: str) -> list[str]:
        found = _addresses(nominal, number)
        # The shank in the bore is part of the data.
        return found if holder is None else [address for address in found if address.startswith("tool.")]

    stated = [
        Tolerance(
            name=stated.name,
            moves={a: deviation for name, deviation in stated.moves.items() for a in moved(name)},
            relative=stated.relative,
            configurations=stated.configuration,
        )
        for stated in nominal.tolerances
    ]
    return [*stated, *(holder.tolerances if holder else ())]


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
    return _frf(record.estimate, record.label, record.notes).to(record.form)  # type: ignore[arg-type]


def _frf(e: Estimate, label: str, notes: Sequence[str] = ()) -> FRF:
    with warnings.catch_warnings():
        # The package may warn of a wrong quantity; only the verdict is scored.
        warnings.simplefilter("ignore")
        return FRF(
            frequency_hz=e.frequency_hz,
            values=e.receptance,
            decay_rate=e.decay_rate,
            coherence=e.coherence,
            averages=e.averages,
            log_variance=e.log_variance,
            degrees_of_freedom=e.degrees_of_freedom,
            correlated_lines=e.correlated_lines,
            label=label,
            notes=notes,
        )


def _conditions(configuration: Configuration, level: float) -> dict[str, float]:
    noted = {"torque": configuration.torque} if configuration.torque else {}
    return {"force": level, **noted}


_PLACES = {"tip": Coordinate("tool", 0.0), "nose": Coordinate("holder", 0.0)}


def _at_nose(assembly: Assembly) -> Assembly:
    """Return an assembly with the sensor at the nose, where there is one."""
    moved = [PointMass(mass=assembly.get("sensor.mass"), part="holder", name="sensor")] if assembly.attachments else []
    return Assembly(assembly.elements.values(), moved)


def observations_of(case: Case, holder: Holder | None = None) -> list[Observation]:
    """Return all records as observations of the nominal assemblies, on the lines that a holder of data has."""
    configurations = {c.name: c for c in case.nominal.configurations}
    by_name = {name: assembly_of(case.nominal, c, holder) for name, c in configurations.items()}
    several = len({record.plane for record in case.records}) > 1
    found = []
    for record in case.records:
        conditions = _conditions(configurations[record.configuration], record.level)
        conditions |= {"plane": float(record.plane)} if several else {}
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            frf = frf_of(record)
            if holder is not None and isinstance(holder.end, MeasuredPart):
                frf = frf.with_(usable=holder.end.covers(frf.frequency_hz))
            found.append(
                Observation.from_frf(
                    by_name[record.configuration] if record.place == "tip" else _at_nose(by_name[record.configuration]),
                    frf,
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
    try:
        holder = holder_of(case)
        every = tolerances_of(case.nominal, holder)
        stated = [one for one in every if one.configurations is None or measured.issuperset(one.configurations)]
        verdict = diagnose(
            observations_of(case, holder),
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
    # Natural frequencies of an assembly that ends with data are not counted.
    for tool in case.new_tools if holder is None else ():
        assembly = assembly_of(case.nominal, tool)
        level = float(np.sqrt(np.prod(sorted({r.level for r in case.records}))))
        conditions = _conditions(tool, level) | {"plane": 1.0}
        where: dict[str, Any] = {"configuration": tool.name, "conditions": conditions, "tolerances": every}
        try:
            predictions[tool.name] = _lists(verdict.at(assembly, **where))
            before[tool.name] = _lists(verdict.base.at(assembly, **where))
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
        notes=tuple(verdict.notes),
        error=error,
        variants=tuple(c.variant for c in verdict.causes),
    )


def nameable() -> list[str]:
    """Return the ids of all causes that a diagnosis may report."""
    from receptance.diagnosis import CATALOGUE

    return list(CATALOGUE)


def advisable() -> list[str]:
    """Return all that a diagnosis may advise to measure."""
    from receptance.diagnosis.advice import MENU

    return [choice.action for choice in MENU]


def _lists(there: Any) -> tuple[list[float], list[float]]:
    predicted = there.natural_frequencies(UPPER_HZ)
    return predicted.predicted_hz.tolist(), predicted.standard_error_hz.tolist()


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
