"""Observations from the measurements of a campaign, and the candidates for the next one."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from receptance.campaign.build import with_attached, with_sensor
from receptance.campaign.data_files import (
    estimate_hammer_frf,
    observed_frf,
    parse_deviation_share,
    parse_force_window,
    read_entry,
    read_records,
    with_coordinates,
    with_stated_variance,
)
from receptance.campaign.frequencies import damping_of, deviations_of, frequencies_of
from receptance.campaign.tolerances import tolerances_of
from receptance.campaign.values import Condition
from receptance.identification import Candidate, MeasuredFrequencies, MeasuredFRF

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.campaign.build import Builder, Built
    from receptance.campaign.problems import KeyPath
    from receptance.campaign.schema import (
        CampaignTable,
        CandidateFrequenciesTable,
        CandidateFRFTable,
        FrequenciesTable,
        FRFTable,
        HammerTable,
    )
    from receptance.campaign.tolerances import Effects
    from receptance.frf import FRF
    from receptance.model.assembly import Assembly
    from receptance.model.coordinates import Coordinate

__all__ = ["Measurement", "build_candidate", "build_measurement"]

Observation = MeasuredFRF | MeasuredFrequencies


@dataclass(frozen=True, kw_only=True)
class Measurement:
    """A measurement of a campaign.

    Attributes
    ----------
    name : str
        Name in the file.
    assembly : str
        Name of the assembly that was measured.
    role : {"identify", "hold out"}
        Whether it is used in the fit or compared with predictions.
    observation : MeasuredFRF or MeasuredFrequencies
        The data, with the assembly including the sensor.
    sensor : str or None
        Name of the sensor at the response coordinate.
    files : tuple of str
        Names of the data files.
    conditions : dict of str to Condition
        Conditions of the measurement.
    effects : dict
        Errors: by error and address the standard deviation in SI units.
    notes : tuple of str
        Notes on the data.
    """

    name: str
    assembly: str
    role: str
    observation: Observation
    sensor: str | None
    files: tuple[str, ...]
    conditions: dict[str, Condition] = field(default_factory=dict)
    effects: Effects = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    @property
    def held_out(self) -> bool:
        """Whether it is not used in the fit."""
        return self.role == "hold out"


class _Reader:
    """Reads the data of one measurement; mistakes are added to the builder."""

    def __init__(self, name: str, campaign: CampaignTable, built: Built, folder: Path, builder: Builder) -> None:
        self.name = name
        self.campaign = campaign
        self.table = campaign.measurements[name]
        self.path: KeyPath = ("measurements", name)
        self.built = built
        self.folder = folder
        self.builder = builder

    def observation(self) -> Observation | None:
        """Return the observation, or None after its mistakes are added."""
        if self.table.kind == "frf" and self.table.force is not None and self.table.level is not None:
            text = "is given with a force, which determines it, expected one of the two"
            self.builder.problems.add((*self.path, "level"), text)
        there = not any(self.builder.problems.at((*self.path, key)) for key in ("file", "coherence"))
        assembly = self.built.assemblies.get(self.table.assembly)
        if assembly is not None:
            assembly = self.builder.at_level(self.path, self.table.level, assembly, self.campaign)
        sensor = None if self.table.sensor is None else self.built.sensors.get(self.table.sensor)
        if assembly is None or (self.table.sensor is not None and sensor is None):
            return None
        if self.table.attachments:
            if not self.built.attachments.keys() >= set(self.table.attachments):
                return None
            points = [self.built.attachments[name] for name in self.table.attachments]
            assembly = self.builder.make((*self.path, "attachments"), with_attached, assembly, *points)
            if assembly is None:
                return None
        at = self.builder.place((*self.path, "response"), self.table.response, assembly)
        if self.table.kind != "natural frequencies":
            excited = self.builder.place((*self.path, "excitation"), self.table.excitation, assembly)
            if at is None or excited is None or not there:
                return None
            return self._frf(self.table, with_sensor(assembly, sensor, at), at, excited)
        if at is None or not there:
            return None
        return self._frequencies(self.table, with_sensor(assembly, sensor, at))

    def _frequencies(self, table: FrequenciesTable, assembly: Assembly) -> MeasuredFrequencies | None:
        make, path = self.builder.make, self.path
        if (table.file is None) == (table.frequencies is None):
            what = "neither frequencies nor a file" if table.file is None else "frequencies and a file"
            self.builder.problems.add(path, f"has {what}, expected one of the two")
            return None
        source: KeyPath = (*path, "frequencies" if table.file is None else "file")
        found = make(source, frequencies_of, table, self.folder)
        if found is None:
            return None
        given = make((*path, "standard_deviation"), deviations_of, table.standard_deviation, found.frequency_hz)
        damping = make((*path, "damping_ratios"), damping_of, table, found)
        if self.builder.problems.at((*path, "standard_deviation")) or damping is None:
            return None
        return make(
            path if table.modes is None else (*path, "modes"),
            MeasuredFrequencies,
            assembly=assembly,
            frequency_hz=found.frequency_hz,
            modes=found.modes,
            standard_deviation_hz=given or found.deviation_hz,
            damping_ratio=damping[0],
            standard_deviation_damping=damping[1],
            label=self.name,
        )

    def _frf(
        self, table: FRFTable | HammerTable, assembly: Assembly, response: Coordinate, excitation: Coordinate
    ) -> MeasuredFRF | None:
        make, path = self.builder.make, self.path
        floor = make((*path, "floor"), parse_deviation_share, table.floor)
        found = self._hammer(table) if table.kind == "hammer records" else self._from_file(table)
        if found is None or self.builder.problems.at((*path, "floor")):
            return None
        for note in found.notes:
            self.builder.note(path, note)
        at = make(path, with_coordinates, found, table, response, excitation, self.name)
        if at is None:
            return None
        place: KeyPath = path if table.bands is None else (*path, "bands")
        seen: MeasuredFRF | None = make(place, observed_frf, at, table, assembly, response, excitation, floor or 0.0)
        for note in () if seen is None else seen.notes:
            if note not in found.notes:
                self.builder.note(path, note)
        return seen

    def _from_file(self, table: FRFTable) -> FRF | None:
        make, path = self.builder.make, self.path
        share = make((*path, "standard_deviation"), parse_deviation_share, table.standard_deviation)
        found = make((*path, "file"), read_entry, table, self.folder)
        if found is None or self.builder.problems.at((*path, "standard_deviation")):
            return None
        return with_stated_variance(found, share)

    def _hammer(self, table: HammerTable) -> FRF | None:
        make, path = self.builder.make, self.path
        window = make((*path, "force_window"), parse_force_window, table.force_window)
        records = make((*path, "file"), read_records, table, self.folder)
        if records is None or window is None:
            return None
        return make(path, estimate_hammer_frf, records, table, window)


def _files(written: str | list[str] | None) -> tuple[str, ...]:
    return (written,) if isinstance(written, str) else tuple(written or ())


def build_measurement(
    name: str,
    campaign: CampaignTable,
    built: Built,
    effects: tuple[dict[str, Effects], dict[str, Effects]],
    folder: Path,
    builder: Builder,
    of_assemblies: Mapping[str, Mapping[str, Condition]],
) -> Measurement | None:
    """Return a measurement with its data, or None after its mistakes are added.

    Parameters
    ----------
    name : str
        Name of the measurement.
    campaign : CampaignTable
        The file.
    built : Built
        Objects of the file.
    effects : tuple of dict
        Errors of assemblies, and of sensors and attachments, by their names.
    folder : Path
        Folder of the data files.
    builder : Builder
        Builder to which mistakes are added.
    of_assemblies : mapping
        Conditions of assemblies.
    """
    table = campaign.measurements[name]
    before = len(builder.notes)
    observation = _Reader(name, campaign, built, folder, builder).observation()
    if observation is None:
        return None
    described = {key: one.value for key, one in {**of_assemblies.get(table.assembly, {}), **table.conditions}.items()}
    observation = observation.configured(table.assembly, described)
    return Measurement(
        name=name,
        assembly=table.assembly,
        role=table.role,
        observation=observation,
        sensor=table.sensor,
        files=_files(table.file) + _files(table.coherence if table.kind == "frf" else None),
        conditions=table.conditions,
        effects=_with_attached(effects, table.assembly, table.sensor or "", *table.attachments),
        notes=tuple(builder.notes[before:]),
    )


_MOST_LINES = 100_000
"""Largest number of lines of a candidate."""


def build_candidate(
    name: str,
    campaign: CampaignTable,
    built: Built,
    effects: tuple[dict[str, Effects], dict[str, Effects]],
    builder: Builder,
    of_assemblies: Mapping[str, Mapping[str, Condition]],
) -> Candidate | None:
    """Return a candidate, or None after its mistakes are added; see `build_measurement` for the parameters."""
    table, path = campaign.candidates[name], ("candidates", name)
    make = builder.make
    assembly = built.assemblies.get(table.assembly)
    sensor = None if table.sensor is None else built.sensors.get(table.sensor)
    if assembly is None or (table.sensor is not None and sensor is None):
        return None
    response = builder.place((*path, "response"), table.response, assembly)
    if response is None:
        return None
    errors = _with_attached(effects, table.assembly, table.sensor or "")
    known = {key: one.value for key, one in of_assemblies.get(table.assembly, {}).items()}
    common = {
        "label": name,
        "assembly": with_sensor(assembly, sensor, response),
        "tolerances": tuple(tolerances_of(errors)),
        "configuration": table.assembly,
        "conditions": {**known, **{key: one.value for key, one in table.conditions.items()}},
        "cost": table.cost,
    }
    if table.kind == "natural frequencies":
        spread = make((*path, "standard_deviation"), _deviations, table, common["assembly"])
        if spread is None:
            return None
        return make(path, Candidate, modes=tuple(table.modes), standard_deviation_hz=spread, **common)
    excitation = builder.place((*path, "excitation"), table.excitation, assembly)
    lines = make(path, _lines, table)
    share = make((*path, "standard_deviation"), parse_deviation_share, table.standard_deviation)
    floor = make((*path, "floor"), parse_deviation_share, table.floor)
    if excitation is None or lines is None or share is None or builder.problems.at((*path, "floor")):
        return None
    return make(
        path,
        Candidate,
        frequency_hz=lines,
        response=response,
        excitation=excitation,
        standard_deviation=share,
        floor=floor or 0.0,
        **common,
    )


def _with_attached(effects: tuple[dict[str, Effects], dict[str, Effects]], assembly: str, *names: str) -> Effects:
    """Return the errors of an assembly with those of sensors and attachments."""
    found = dict(effects[0].get(assembly, {}))
    for name in names:
        for error, moved in effects[1].get(name, {}).items():
            found[error] = {**found.get(error, {}), **moved}
    return found


def _lines(table: CandidateFRFTable) -> NDArray[np.float64]:
    lower = table.step if table.lower is None else table.lower
    if lower >= table.upper:
        raise ValueError(f"has lines from {lower:g} to {table.upper:g} Hz, expected `lower` below `upper`")
    count = int((table.upper - lower) / table.step * (1.0 + 1e-12)) + 1
    if count > _MOST_LINES:
        raise ValueError(f"has {count} lines, expected at most {_MOST_LINES}; give a larger `step`")
    return lower + table.step * np.arange(count, dtype=np.float64)


def _deviations(table: CandidateFrequenciesTable, assembly: Assembly) -> list[float]:
    """Return standard deviations in Hz; percentages refer to the model with its start values."""
    frequencies, _ = assembly.lowest_natural_frequencies(max(table.modes))
    return deviations_of(table.standard_deviation, frequencies[np.array(table.modes) - 1].tolist()) or []
