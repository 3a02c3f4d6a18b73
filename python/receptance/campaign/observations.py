"""From the measurements of a campaign to observations that a fit or a comparison takes."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path as FilePath
from typing import TYPE_CHECKING

from receptance.campaign.builder import carrying, with_sensor
from receptance.campaign.frequencies import damping_of, deviations_of, frequencies_of
from receptance.campaign.quantities import Condition
from receptance.identification import MeasuredFrequencies, MeasuredFRF

if TYPE_CHECKING:
    from receptance.assembly import Assembly
    from receptance.campaign.builder import Builder, Built
    from receptance.campaign.format import CampaignTable, FrequenciesTable, FRFTable, HammerTable
    from receptance.campaign.lines import Path
    from receptance.campaign.tolerances import Effects
    from receptance.coordinates import Coordinate
    from receptance.frf import FRF

__all__ = ["Measurement", "build_measurement"]

Observation = MeasuredFRF | MeasuredFrequencies


@dataclass(frozen=True, kw_only=True)
class Measurement:
    """A measurement of a campaign.

    Attributes
    ----------
    name : str
        Its name in the file.
    assembly : str
        Name of the assembly that was measured.
    role : {"identify", "hold out"}
        Whether the fit sees it.
    observation : MeasuredFRF or MeasuredFrequencies
        What was measured, of the assembly with the sensor on it.
    sensor : str or None
        Name of the sensor that sat at the response coordinate.
    files : tuple of str
        Names of the data files.
    conditions : dict of str to Condition
        What describes the measurement.
    effects : dict
        Errors by the campaign's tolerances, by error and address: standard deviation in SI units.
    notes : tuple of str
        What was changed in the data or is suspicious.
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
        """Whether the fit does not see it."""
        return self.role == "hold out"


class _Reader:
    """Reads one measurement; every mistake is added at its place."""

    def __init__(self, name: str, campaign: CampaignTable, built: Built, folder: FilePath, builder: Builder) -> None:
        self.name = name
        self.campaign = campaign
        self.table = campaign.measurements[name]
        self.path: Path = ("measurements", name)
        self.built = built
        self.folder = folder
        self.builder = builder

    def observation(self) -> Observation | None:
        """Return the observation, or None after its mistakes are added."""
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
            assembly = self.builder.make((*self.path, "attachments"), carrying, assembly, *points)
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
        source: Path = (*path, "frequencies" if table.file is None else "file")
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
        from receptance.campaign import frf_files

        make, path = self.builder.make, self.path
        floor = make((*path, "floor"), frf_files.deviation_share, table.floor)
        found = self._hammer(table) if table.kind == "hammer records" else self._from_file(table)
        if found is None or self.builder.problems.at((*path, "floor")):
            return None
        for note in found.notes:
            self.builder.note(path, note)
        at = make(path, frf_files.placed, found, table, response, excitation, self.name)
        if at is None:
            return None
        place: Path = path if table.bands is None else (*path, "bands")
        seen: MeasuredFRF | None = make(
            place, frf_files.observe, at, table, assembly, response, excitation, floor or 0.0
        )
        for note in () if seen is None else seen.notes:
            if note not in found.notes:
                self.builder.note(path, note)
        return seen

    def _from_file(self, table: FRFTable) -> FRF | None:
        from receptance.campaign import frf_files

        make, path = self.builder.make, self.path
        share = make((*path, "standard_deviation"), frf_files.deviation_share, table.standard_deviation)
        found = make((*path, "file"), frf_files.read, table, self.folder)
        if found is None or self.builder.problems.at((*path, "standard_deviation")):
            return None
        return frf_files.weighed(found, share)

    def _hammer(self, table: HammerTable) -> FRF | None:
        from receptance.campaign import hammer_files

        make, path = self.builder.make, self.path
        window = make((*path, "force_window"), hammer_files.window_of, table.force_window)
        records = make((*path, "file"), hammer_files.read, table, self.folder)
        if records is None or window is None:
            return None
        return make(path, hammer_files.estimate, records, table, window)


def _files(written: str | list[str] | None) -> tuple[str, ...]:
    return (written,) if isinstance(written, str) else tuple(written or ())


def build_measurement(
    name: str,
    campaign: CampaignTable,
    built: Built,
    effects: tuple[dict[str, Effects], dict[str, Effects]],
    folder: FilePath,
    builder: Builder,
    of_assemblies: Mapping[str, Mapping[str, Condition]],
) -> Measurement | None:
    """Return a measurement with its data read, or None after its mistakes are added.

    `effects` are the errors of assemblies, and of what sits on them only while measured, by their names;
    `of_assemblies` are the conditions of assemblies.
    """
    table = campaign.measurements[name]
    before = len(builder.notes)
    observation = _Reader(name, campaign, built, folder, builder).observation()
    if observation is None:
        return None
    described = {key: one.value for key, one in {**of_assemblies.get(table.assembly, {}), **table.conditions}.items()}
    observation = observation.configured(table.assembly, described)
    own = dict(effects[0].get(table.assembly, {}))
    for beside in (table.sensor or "", *table.attachments):
        for error, moved in effects[1].get(beside, {}).items():
            own[error] = {**own.get(error, {}), **moved}
    return Measurement(
        name=name,
        assembly=table.assembly,
        role=table.role,
        observation=observation,
        sensor=table.sensor,
        files=_files(table.file) + _files(table.coherence if table.kind == "frf" else None),
        conditions=table.conditions,
        effects=own,
        notes=tuple(builder.notes[before:]),
    )
