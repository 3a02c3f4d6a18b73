"""Measurements of a campaign: FRFs, records of hammer hits and natural frequencies, and candidates for the next one."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated, Any, cast

import numpy as np
from numpy.typing import NDArray

from receptance import hammer, io, units
from receptance._reading import ReadingOptions, campaign_keys
from receptance.campaign.build import Builder
from receptance.campaign.csv_rows import read_rows
from receptance.campaign.problems import CampaignError, Issue, KeyPath
from receptance.campaign.schema import (
    CampaignTable,
    CandidateFrequenciesTable,
    CandidateFRFTable,
    CandidateTable,
    FileFields,
    FrequenciesTable,
    FRFTable,
    HammerTable,
    MeasurementTable,
)
from receptance.campaign.tolerances import with_attachments
from receptance.campaign.values import Deviation
from receptance.fit import Observation, Tolerance
from receptance.fit.observation import altered
from receptance.frf import FRF
from receptance.hammer import HammerRecords
from receptance.model.assembly import Assembly
from receptance.model.coordinates import Coordinate
from receptance.model.terminals import MeasuredPart, Terminal
from receptance.predict import Candidate
from receptance.units import FORMS

_MOST_LINES = 100_000
"""Largest number of lines of a candidate."""


class MeasurementReader:
    """Makes measurements, with their data, and candidates from their tables; mistakes are added to the builder."""

    def __init__(
        self,
        campaign: CampaignTable,
        builder: Builder,
        folder: Path,
        tolerances: Mapping[str, tuple[Tolerance, ...]],
    ) -> None:
        self.campaign, self.builder, self.folder = campaign, builder, folder
        self._tolerances = tolerances
        self.frfs: dict[str, FRF] = {}
        """FRFs of the measurements that were read, on all their lines."""

    def measurement(self, name: str) -> Observation:
        """Return a measurement."""
        table = self.campaign.measurements[name]
        path: KeyPath = ("measurements", name)
        if table.kind == "frf" and table.force is not None and table.level is not None:
            text = "is given with a force, which determines it, expected one of the two"
            self.builder.problems.add((*path, "level"), text)
        assembly, response = self.builder.measured(path, table, self.campaign, table.attachments, table.level)
        if table.kind == "natural frequencies":
            return self._frequencies(path, table, assembly)
        return self._frf(path, table, assembly, response)

    def errors(self, name: str) -> tuple[Tolerance, ...]:
        """Return the errors of the assembly of a measurement and of what is attached to it."""
        table = self.campaign.measurements[name]
        return self._errors(table.assembly, table.sensor, *table.attachments)

    def candidate(self, name: str) -> Candidate:
        """Return a candidate."""
        table, path = self.campaign.candidates[name], ("candidates", name)
        make = self.builder.make
        assembly, response = self.builder.measured(path, table, self.campaign)
        common = {
            "label": name,
            "assembly": assembly,
            "configuration": table.assembly,
            "conditions": self._conditions(table),
        }
        if table.kind == "natural frequencies":
            spread = make((*path, "standard_deviation"), _deviations, table, assembly)
            observation = make(path, Observation.from_modes, modes=table.modes, standard_deviation_hz=spread, **common)
        else:
            excitation, lines = self.builder.together(
                (
                    partial(self.builder.place, (*path, "excitation"), table.excitation, assembly),
                    partial(make, path, _lines, table),
                )
            )
            lines = self._known_lines(path, lines, assembly)
            observation = make(
                path,
                Observation,
                frequency_hz=lines,
                response=response,
                excitation=excitation,
                standard_deviation=table.standard_deviation,
                floor=table.floor or 0.0,
                **common,
            )
        errors = self._errors(table.assembly, table.sensor)
        return make(path, Candidate, observation=observation, tolerances=errors, cost=table.cost)

    def _known_lines(self, path: KeyPath, lines: NDArray[np.float64], assembly: Assembly) -> NDArray[np.float64]:
        """Return the lines of a candidate on which the spindle of its assembly is known."""
        *_, end = assembly.elements.values()
        if not isinstance(end, Terminal):
            return lines
        known = end.covers(lines)
        if not known.any():
            low, high = end.edges_hz
            self.builder.fail(
                path, f"has no line on which {end.name} is known, expected some from {low:g} to {high:g} Hz"
            )
        if not known.all():
            text = f"{np.count_nonzero(known)} of {lines.size} lines are used; on the others {end.name} is not known"
            self.builder.note(path, text)
        return lines[known]

    def _conditions(self, table: MeasurementTable | CandidateTable) -> dict[str, float]:
        """Return the conditions of an assembly with those of a measurement."""
        return {**self.campaign.assemblies[table.assembly].conditions, **table.conditions}

    def _errors(self, assembly: str, *points: str | None) -> tuple[Tolerance, ...]:
        """Return the errors of an assembly with those of sensors and attachments."""
        known = self._tolerances.get(assembly, ())
        return with_attachments(known, filter(None, points), self.campaign, self.builder.built)

    def _frequencies(self, path: KeyPath, table: FrequenciesTable, assembly: Assembly) -> Observation:
        make, fail = self.builder.make, self.builder.fail
        if (table.file is None) == (table.frequencies is None):
            what = "neither frequencies nor a file" if table.file is None else "frequencies and a file"
            fail(path, f"has {what}, expected one of the two")
        if table.file is not None:
            source = (*path, "file")
            self.builder.require(source)
            rows = make(source, read_frequencies, self.folder / table.file)
            if table.damping_ratios is not None and rows["damping_ratios"] is not None:
                fail((*path, "damping_ratios"), "has damping ratios and so has the file, expected one of the two")
            stated = {key: getattr(table, key) for key in rows}
            table = table.with_(**rows | {key: value for key, value in stated.items() if value is not None})
        frequencies, ratios = table.frequencies or [], table.damping_ratios
        if ratios is None and table.damping_deviation is not None:
            fail((*path, "damping_ratios"), "has a damping_deviation, but no damping_ratios")
        spread, of_ratios = self.builder.together(
            partial(make, (*path, key), deviations_of, getattr(table, key), values)
            for key, values in (("standard_deviation", frequencies), ("damping_deviation", ratios or []))
        )
        return make(
            path if table.modes is None else (*path, "modes"),
            Observation.from_modes,
            assembly=assembly,
            frequency_hz=frequencies,
            modes=table.modes,
            standard_deviation_hz=spread,
            damping_ratio=ratios,
            standard_deviation_damping=of_ratios,
            label=path[-1],
            configuration=table.assembly,
            conditions=self._conditions(table),
        )

    def _frf(
        self, path: KeyPath, table: FRFTable | HammerTable, assembly: Assembly, response: Coordinate
    ) -> Observation:
        make = self.builder.make
        excitation = self.builder.place((*path, "excitation"), table.excitation, assembly)
        self.builder.require((*path, "file"), (*path, "coherence"))
        if table.kind == "hammer records":
            records = make((*path, "file"), read_records, table, self.folder)
            frf = make(path, estimate_hammer_frf, records, table)
        else:
            frf = make((*path, "file"), read_entry, table, self.folder)
        frf = self.frfs[str(path[-1])] = make(path, with_places, frf, table, response, excitation, str(path[-1]))
        observation = make(path if table.bands is None else (*path, "bands"), self._observed, frf, table, assembly)
        for note in observation.notes:
            self.builder.note(path, note)
        return observation

    def _observed(self, frf: FRF, table: FRFTable | HammerTable, assembly: Assembly) -> Observation:
        """Return the observation of an FRF on the lines inside the bands of the campaign, with its weights."""
        force = table.force if table.kind == "frf" else None
        if force is not None and table.ends is not None:
            raise ValueError(
                "has `force`, a key of stepped sines, and `ends`, a key of hammer hits; expected one of them"
            )
        chosen = frf if table.bands is None else restrict_to_bands(frf, table.bands)
        observation = Observation.from_frf(
            assembly,
            restrict_to_spindle(chosen, assembly),
            floor=table.floor or 0.0,
            configuration=table.assembly,
            conditions=self._conditions(table),
            force=force,
            ends=table.ends,
        )
        # `notes` needs the weights, whose mistakes are those of this table.
        return integrate_motion(altered(observation, notes=observation.notes), table.integrate)


def note_repeated(measurements: Mapping[str, Observation], campaign: CampaignTable, builder: Builder) -> None:
    """Add a note on each FRF whose data and places are exactly those of an earlier one, of any assembly."""
    data = {
        name: (frf.frequency_hz.tobytes(), frf.receptance.tobytes(), frf.response, frf.excitation)
        for name, frf in measurements.items()
        if frf.is_receptance
    }
    for first, second in equal_pairs(data):
        pair = (campaign.measurements[name] for name in (first, second))
        files = ", ".join(dict.fromkeys(file for table in pair for file in data_files(table)))
        builder.note(
            ("measurements", second),
            f"its data are exactly those of measurements.{first} ({files}), so that they count twice; remove one of "
            "the two, or name the file that belongs to it",
        )
        builder.warnings.append(builder.notes[-1])


def equal_pairs(data: Mapping[str, Any]) -> list[tuple[str, str]]:
    """Return the names of equal data, each with the first one of the same data."""
    first: dict[Any, str] = {}
    return [(first[value], name) for name, value in data.items() if first.setdefault(value, name) != name]


def data_files(table: MeasurementTable) -> tuple[str, ...]:
    """Return the names of the data files of a measurement."""
    written = [table.file, table.coherence if table.kind == "frf" else None]
    return tuple(name for names in written if names for name in ([names] if isinstance(names, str) else names))


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


# FRFs from data files -------------------------------------------------------------------------------------------------

_USED_SHARE = 0.9
"""Share of usable lines in a band below which a note is made; a few lines at antiresonances are never usable."""


def read_entry(table: FileFields, folder: Path) -> FRF:
    """Return the FRF of a measurement, selected by `entry` if the file holds several."""
    given = _reading(table, folder, records=False)
    if table.entry.number is None:
        found = io.read_frf(folder / table.file, **given)
    else:
        found = _entry(io.read_all(folder / table.file, **given), table.entry.number)
    found = found.select(responses=table.entry.response, excitations=table.entry.excitation)
    _, n_out, n_in = found.shape
    if (n_out, n_in) != (1, 1):
        names = found.labels or ((), ())
        known = "; ".join(
            f"{what} {', '.join(side) if any(side) else f'0 to {count - 1}'}"
            for what, side, count in (("responses", names[0], n_out), ("excitations", names[1], n_in))
        )
        raise ValueError(
            f"holds {n_out} responses and {n_in} excitations, expected `entry` to select one of each, such as "
            f"`entry = {{ response = 0, excitation = 0 }}`; there are {known}"
        )
    return _with_stated_properties(found, table)


def _reading(table: FileFields | HammerTable, folder: Path, *, records: bool) -> ReadingOptions:
    """Return the keywords of `read_all` that a table gives."""
    keys = {name: getattr(table, key) for name, key in campaign_keys(records=records).items()}
    if keys.get("coherence") is not None:
        keys["coherence"] = folder / keys["coherence"]
    return cast(ReadingOptions, {name: value for name, value in keys.items() if value})


def _entry(things: Sequence[object], number: int) -> FRF:
    frfs = [thing for thing in things if isinstance(thing, FRF)]
    if number >= len(frfs):
        listed = "; ".join(f"{index}: {frf!r}" for index, frf in enumerate(frfs[:6])) or "none"
        raise ValueError(f"holds {len(frfs)} FRFs, expected `entry.number` to be one of their numbers: {listed}")
    return frfs[number]


def _with_stated_properties(frf: FRF, table: FileFields) -> FRF:
    """Return the FRF with the properties that the campaign states and the file does not."""
    changes: dict[str, Any] = {}
    for key, stated, own in (
        ("averages", table.averages, frf.averages),
        ("decay_rate", table.decay_rate, frf.decay_rate or None),
    ):
        if stated is None:
            continue
        if own is not None and not np.isclose(stated, own, rtol=1e-9):
            raise ValueError(
                f"states {key} {own:g} and the campaign {stated:g}, expected equal values; delete it in the campaign"
            )
        changes[key] = stated
    if table.standard_deviation is not None:
        changes |= {"log_variance": table.standard_deviation**2, "degrees_of_freedom": None}
    return frf.with_(**changes) if changes else frf


def with_places(
    frf: FRF, table: FRFTable | HammerTable, response: Coordinate, excitation: Coordinate, name: str
) -> FRF:
    """Return the FRF with the coordinates and signs that the campaign gives its channels."""
    if table.response.direction[0] != table.excitation.direction[0]:
        frf = frf.flipped()
    return frf.with_(label=name, responses=response, excitations=excitation)


def restrict_to_bands(frf: FRF, bands: Sequence[Sequence[float]]) -> FRF:
    """Return the FRF with only the lines inside the bands usable, and a note on bands with few usable lines."""
    lines = frf.frequency_hz
    usable = np.ones(lines.size, dtype=np.bool_) if frf.usable is None else frf.usable
    chosen = np.zeros_like(usable)
    notes = []
    for low, high in bands:
        if low >= high:
            raise ValueError(f"has a band from {low:g} to {high:g} Hz, expected the lower end first")
        inside = (lines >= low) & (lines <= high)
        used = usable & inside
        if not used.any():
            first, last = lines[usable][[0, -1]] if usable.any() else lines[[0, -1]]
            raise ValueError(
                f"has a band from {low:g} to {high:g} Hz without a usable line, expected one within {first:g} to "
                f"{last:g} Hz"
            )
        count, of = np.count_nonzero(used), np.count_nonzero(inside)
        if count < _USED_SHARE * of:
            first, last = lines[used][[0, -1]]
            notes.append(
                f"of the band from {low:g} to {high:g} Hz {count} of {of} lines are used, from {first:g} to {last:g} "
                "Hz; the others are not usable"
            )
        chosen |= used
    return frf.with_(usable=chosen, notes=(*frf.notes, *notes))


def restrict_to_spindle(frf: FRF, assembly: Assembly) -> FRF:
    """Return the FRF with only those lines usable on which the spindle of its assembly is known, and a note."""
    *_, end = assembly.elements.values()
    if not isinstance(end, Terminal):
        return frf
    source = (isinstance(end, MeasuredPart) and end.source) or end.name
    if isinstance(end, MeasuredPart) and not np.isclose(end.decay_rate, frf.decay_rate, rtol=1e-9):
        raise ValueError(
            f"has a decay rate of {frf.decay_rate:g} 1/s of its exponential window, and the table of the spindle "
            f"{source} one of {end.decay_rate:g} 1/s; expected equal ones, or modes of the spindle, which have no "
            "window: `receptance spindle CAMPAIGN --modes auto`"
        )
    usable = np.ones(frf.frequency_hz.size, dtype=np.bool_) if frf.usable is None else frf.usable
    known = np.zeros_like(usable)
    positive = frf.frequency_hz > 0.0
    known[positive] = end.covers(frf.frequency_hz[positive])
    used = usable & known
    count, of = np.count_nonzero(used), np.count_nonzero(usable)
    if count == of:
        return frf
    measured = frf.frequency_hz[usable]
    edges = end.edges_hz
    if not count:
        raise ValueError(
            f"has {of} usable lines from {measured[0]:g} to {measured[-1]:g} Hz, and the spindle {source} is known on "
            f"none of them, from {edges[0]:g} to {edges[1]:g} Hz; expected records of blank and tool on the same "
            "lines, or modes of the spindle in this band: `receptance spindle CAMPAIGN --modes auto`"
        )
    note = f"{count} of {of} usable lines are used; on the others the spindle {source} is not known"
    return frf.with_(usable=used, notes=(*frf.notes, note))


def integrate_motion(observation: Observation, times: int) -> Observation:
    """Return an FRF with its motion integrated so many times, or differentiated if `times` is negative."""
    if not times:
        return observation
    index = FORMS.index(observation.form) + times
    form = FORMS[index] if 0 <= index < len(FORMS) else observation.form
    return altered(
        observation, receptance=observation.receptance / (2j * np.pi * observation.frequency_hz) ** times, form=form
    )


def read_records(table: HammerTable, folder: Path) -> list[HammerRecords]:
    """Return the time records of all files of a measurement; a file may hold several, one for each hit."""
    given = _reading(table, folder, records=True)
    given.pop("reverse", None)  # of the FRF that is estimated
    names = [table.file] if isinstance(table.file, str) else table.file
    if not names:
        raise ValueError("is an empty list, expected at least one file")
    repeated = [name for name, count in Counter(names).items() if count > 1]
    series: dict[str, io.TimeSeries] = {}
    for name in names:
        measurements = io.read_all(folder / name, **given)
        records = [record for record in measurements if isinstance(record, io.TimeSeries)]
        if not records:
            raise io.FileFormatError(f"the file holds no time series, but {measurements[0]!r}", file=name)
        series |= {f"{name}, record {k}" if len(records) > 1 else name: record for k, record in enumerate(records, 1)}
    equal = equal_pairs({label: (record.values.tobytes(),) for label, record in series.items()})
    repeated += [f"{first} and {second}" for first, second in equal]
    if repeated:
        raise ValueError(f"has the same record more than once: {'; '.join(repeated)}; expected each record once")
    return [
        HammerRecords.from_series(
            record,
            force=table.force,
            responses=table.motion,
            excitation=_unsigned(table.excitation.direction),
            at=_unsigned(table.response.direction),
            full_scale_force=table.full_scale_force,
            response_decay_rate=table.response_decay_rate,
            label=name,
        )
        for name, record in series.items()
    ]


def estimate_hammer_frf(records: list[HammerRecords], table: HammerTable) -> FRF:
    """Return the FRF that is estimated from the hits in time records."""
    options: dict[str, Any] = {
        "trigger": table.trigger,
        "duration_s": table.duration,
        "pre_trigger_s": table.pre_trigger,
        "double_hit_loss_db": table.double_hit_loss_db,
        "deviating_hits": table.deviating_hits,
        "separation_s": table.separation,
    }
    hits = hammer.find_hits(records, **{key: value for key, value in options.items() if value is not None})
    if table.drop_hits:
        hits = hits.without(*table.drop_hits, reason="dropped by the campaign")
    frf = hammer.estimate_frf(
        hits,
        estimator=table.estimator,
        decay_rate=table.decay_rate,
        force_drop_db=table.force_drop_db,
        force_window_s=None if table.force_window == "none" else table.force_window,
    )
    return frf.flipped() if table.reverse else frf


def _unsigned(written: str) -> str:
    return written.removeprefix("+").removeprefix("-")


# Natural frequencies --------------------------------------------------------------------------------------------------


@dataclass(frozen=True, kw_only=True)
class _ModeRow:
    """A row of a CSV file of natural frequencies."""

    line: int
    frequency: Annotated[float, units.FREQUENCY]
    mode: int | None = None
    standard_deviation: Annotated[float | None, units.FREQUENCY] = None
    damping_ratio: Annotated[float | None, units.DAMPING_RATIO] = None
    damping_deviation: Annotated[float | None, units.SHARE] = None


def read_frequencies(path: Path) -> dict[str, Any]:
    """Return the keys of a table of natural frequencies from a CSV file.

    The first line names the columns: `frequency [Hz]` (or another unit of frequency), and optionally `mode`,
    `standard_deviation [Hz]`, `damping_ratio [%]` and `damping_deviation [%]` of the ratio. It may raise a
    CampaignError, with all mistakes, or an OSError.
    """
    rows = read_rows(path, _ModeRow, number_last=True)

    def column(name: str, *, empty: bool = False) -> list[Any] | None:
        cells = [getattr(row, name) for row in rows]
        if all(cell is None for cell in cells):
            return None
        for row, cell in zip(rows, cells, strict=True):
            if cell is None and not empty:
                raise CampaignError(path, [Issue((name.replace("_", " "),), "is empty", row.line)])
        return [math.nan if cell is None else cell for cell in cells]

    deviations, spread = column("standard_deviation"), column("damping_deviation", empty=True)
    return {
        "frequencies": [row.frequency for row in rows],
        "modes": column("mode"),
        "standard_deviation": deviations and [Deviation(deviation, False) for deviation in deviations],
        "damping_ratios": column("damping_ratio", empty=True),
        "damping_deviation": spread and [Deviation(deviation, True) for deviation in spread],
    }


def deviations_of(deviations: Deviation | list[Deviation] | None, values: Sequence[float]) -> list[float] | None:
    """Return the standard deviations of values in their unit; one may stand for all of them."""
    if deviations is None:
        return None
    several = deviations if isinstance(deviations, list) else [deviations] * len(values)
    if len(several) != len(values):
        raise ValueError(f"is a list of {len(several)}, expected one for all or {len(values)}, one for each")
    # An unknown value has a deviation without effect.
    return [1.0 if math.isnan(value) else deviation.of(value) for deviation, value in zip(several, values, strict=True)]
