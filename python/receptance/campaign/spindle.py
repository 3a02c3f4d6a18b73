"""Identification of a spindle from the blanks of a campaign: its table, its modes, and records that are held out."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from receptance._text import instead_of
from receptance.campaign.data import CampaignData
from receptance.campaign.problems import errors_about
from receptance.coupling import SpindleModes, SpindleReceptance, fit_spindle, identify_spindle
from receptance.coupling.line_bands import LineBand, bands_of
from receptance.coupling.spindle_files import TABLE
from receptance.coupling.spindle_modes import POOR
from receptance.errors import ReceptanceWarning
from receptance.fit import Observation, Tolerance
from receptance.fit.observation import altered
from receptance.fit.parameters import Site
from receptance.fit.prediction import DECIBEL
from receptance.fit.predictor import Predictor
from receptance.model.assembly import Assembly
from receptance.model.terminals import RESIDUALS, Mode
from receptance.report import ACCEPTED, Column, Provenance, Rejection, Result, Table
from receptance.report.table import Cell, percent

_NONE = """there are no blanks of a spindle; write them, such as
  [assemblies.gauge]
  chain = ["gauge", "spindle"]
  [spindles.spindle]
  blanks = ["gauge"]
  file = "spindle.npz"
where gauge is a part of this file, and three FRFs of the assembly are measured: both drive points of two places on it
and one between them"""
_REASONS = {
    "": "",
    "y/F": "y/F is not determined",
    "theta/M": "theta/M is not determined",
    "y/M": "y/M is not determined",
    "two solutions": "two spindles fit",
    "noise": "too much noise for an interval",
    "not determined": "no solution",
}
_FEW = 0.8
"""Share of usable lines below which there is advice."""
_HITS = (2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64)
"""Numbers of hits, relative to those that were made, that are tried."""
_OFF = 2.0
"""Root mean square of a held-out record, in standard deviations, from which on it contradicts the spindle."""


@dataclass(frozen=True)
class CheckedRecord:
    """A held-out record of a blank, compared with the identified spindle."""

    name: str
    lines: int
    """Lines on which the spindle is known."""
    decibel: float
    """Root mean square over the lines of measured over predicted magnitude in dB."""
    deviations: float
    """Root mean square of the complex logarithm of measured over predicted, in standard deviations of both."""


@dataclass(frozen=True, kw_only=True)
class SpindleIdentification(Result):
    """A spindle that was identified from the blanks of a campaign, see `Campaign.spindle`."""

    name: str
    """Name of the spindle."""
    table: SpindleReceptance
    """Its receptances line by line."""
    modes: SpindleModes | None
    """Its modes, if they were asked for."""
    bands: tuple[LineBand, ...]
    """Usable and other lines, in bands."""
    hits_for_half: int | None
    """Times the hits with which half of the other lines become usable; None if they are few, or more do not help."""
    not_common: tuple[tuple[str, int, float, float], ...]
    """Records with lines that others do not have: name, number of these lines, lowest and highest line."""
    checked: tuple[CheckedRecord, ...]
    """Held-out records."""
    notes: tuple[str, ...]
    provenance: Provenance = field(default_factory=Provenance, repr=False)

    heading = "Spindle"
    plotted_by = "receptance.campaign.figure:draw_spindle_identification"

    @property
    def identified(self) -> SpindleReceptance | SpindleModes:
        """What is written to a file: the modes if they were asked for, else the table."""
        return self.table if self.modes is None else self.modes

    def tables(self) -> list[Table]:
        """Return the terms, the bands of lines, the modes, and held-out records."""
        kind = "modes" if self.modes is not None else "table"
        columns = (
            Column("from, to", "Hz", "g"),
            Column("usable"),
            Column("condition", form=".3g"),
            Column("standard\ndeviation", "%", ".2g"),
            "why others are not",
        )
        rows: list[list[Cell]] = [
            [
                (band.low_hz, band.high_hz),
                f"{band.usable} of {band.lines}",
                band.condition,
                100.0 * band.deviation,
                _REASONS[band.reason],
            ]
            for band in self.bands
        ]
        note = (
            "Condition: amplification of a relative error of the records. Standard deviation: that of the least known "
            f"term, median of the band; a line is usable below {100.0 * self.table.limit:g} %."
        )
        checked = [(record.name, record.lines, record.decibel, record.deviations) for record in self.checked]
        against = (
            "record",
            Column("lines", form="d"),
            Column("off", "dB rms", ".2f"),
            Column("standard deviations", form=".2f"),
        )
        tables = [
            *self.table.tables(),
            Table("Lines", columns, rows, note=note),
            self._modes_table(),
            Table(f"Held-out records against the {kind}", against, checked),
        ]
        return [table for table in tables if table.rows]

    def _modes_table(self) -> Table:
        columns = (
            Column("mode", form="d"),
            Column("frequency", "Hz", ".1f"),
            Column("+-", "Hz", ".2g"),
            Column("damping", "%", ".2f"),
            Column("+-", "%", ".2g"),
            "",
        )
        rows: list[list[Cell]] = []
        if self.modes is not None:
            deviation = dict(zip(self.modes.part.addresses, np.sqrt(np.diag(self.modes.covariance)), strict=True))
            highest = self.modes.part.edges_hz[1]
            for index, mode in enumerate(self.modes.part.modes):
                own = f"mode[{index}]"
                spread = [float(deviation[f"{own}.{name}"]) for name in ("frequency_hz", "damping_ratio")]
                above = "stands for the modes above the band" if mode.frequency_hz > highest else ""
                damping = 100.0 * mode.damping_ratio
                rows.append([index, mode.frequency_hz, spread[0], damping, 100.0 * spread[1], above])
        return Table("Modes", columns, rows).without_empty()

    def sentences(self) -> list[str]:
        """Return the number of usable lines, and the quality of the fit of modes."""
        found = [f"{self.name}: {text}" for text in self.table.sentences()]
        if self.modes is not None and self.modes.identification is not None:
            fit, part = self.modes.identification, self.modes.part
            rest = f"; what they cannot represent is {percent(part.discrepancy)} of a term" if part.discrepancy else ""
            found.append(
                f"{len(part.modes)} modes, fitted to all lines of each record, leave {fit.rms:.2f} standard "
                f"deviations rms{rest}."
            )
        for name, count, low, high in self.not_common:
            found.append(
                f"{name}: {count} lines from {low:g} to {high:g} Hz are not used, because other records lack them."
            )
        return found

    @property
    def rejection(self) -> Rejection:
        """Why the modes must not be used; none without modes."""
        fit = None if self.modes is None else self.modes.identification
        is_poor = fit is not None and (not fit.converged or fit.rms > POOR)
        return fit.rejection if fit is not None and is_poor else ACCEPTED

    def warnings(self) -> list[str]:
        """Return what limits the result, and what to do."""
        found = []
        share = float(np.mean(self.table.usable))
        if share < _FEW and self.modes is None:
            found.append(self._limit_of_noise(share))
        off = [record for record in self.checked if record.deviations > _OFF]
        if off:
            names = ", ".join(f"{record.name} ({record.deviations:.1f})" for record in off)
            found.append(
                f"held-out records are off by more than noise and spindle explain, in standard deviations: {names}. "
                "The blank differs from its description, or the spindle has changed, warm and cold for example"
            )
        if np.isnan(self.table.rms) and not self.checked:
            found.append(
                "three records leave nothing to test the description of the blank: a wrong length is not detected. "
                'Measure a fourth, at another place or of another blank, and state `role = "hold out"`, or fit it too'
            )
        return found

    def _limit_of_noise(self, share: float) -> str:
        poor = [band for band in self.bands if band.usable < band.lines]
        worst = max(poor, key=lambda band: band.lines - band.usable)
        text = (
            f"{percent(share)} of the lines are usable. From {worst.low_hz:g} to {worst.high_hz:g} Hz "
            f"{worst.lines - worst.usable} lines are not: {_REASONS[worst.reason]}, where relative errors are "
            f"amplified {worst.condition:.3g} times. Modes use all lines and are known where single lines are not: "
            "`--modes auto`"
        )
        if self.hits_for_half is None:
            return text
        return f"{text}. With {self.hits_for_half} times the hits half of the other lines become usable"

    def data(self) -> dict[str, Any]:
        """Return the table, the bands, the modes with their covariance, and held-out records."""
        values: dict[str, Any] = {"spindle": self.name, "table": self.table.data(), "bands": self.bands}
        values["hits_for_half"] = self.hits_for_half
        if self.modes is not None:
            part = self.modes.part
            residuals = [getattr(part, key) for key in RESIDUALS]
            values["modes"] = {
                "addresses": self.modes.addresses,
                "values": [*(getattr(mode, key) for mode in part.modes for key in Mode.columns_of), *residuals],
                "covariance": self.modes.covariance,
                "discrepancy": part.discrepancy,
                "band_hz": part.band_hz,
                "rms": None if self.modes.identification is None else self.modes.identification.rms,
            }
        values["held_out"] = self.checked
        return values

    def __repr__(self) -> str:
        return f"SpindleIdentification({self.name!r}, {self.identified!r})"


def spindle_of_campaign(
    campaign: CampaignData, name: str | None, modes: int | Sequence[float] | None, *, as_modes: bool, limit: float
) -> SpindleIdentification:
    """Identify a spindle from the blanks of a campaign; see `Campaign.spindle`."""
    title = chosen_spindle(campaign, name)
    table = campaign.table.spindles[title]
    records = {
        measurement: record
        for measurement, record in campaign.on_blanks.items()
        if record.configuration in table.blanks and record.is_receptance
    }
    held_out = {m: record for m, record in records.items() if campaign.table.measurements[m].role == "hold out"}
    used = {m: record for m, record in records.items() if m not in held_out}
    if not used:
        raise campaign.error(
            f"has blanks without an FRF for identification: measure {', '.join(table.blanks)}", "spindles", title
        )
    errors = campaign.errors_of(used)
    campaign.progress(f"solving for {title} line by line")
    with errors_about(campaign.file, f"spindles.{title}: "):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ReceptanceWarning)
            receptances = identify_spindle(
                list(used.values()), limit=limit, tolerances=errors, allow_mismatch=True, threads=campaign.threads
            )
        if receptances.mismatch:
            raise ValueError(receptances.mismatch)
        fitted = None
        if as_modes:
            campaign.progress(f"fitting modes of {title}")
            fitted = fit_spindle(
                list(used.values()), modes=modes, name=title, tolerances=errors, threads=campaign.threads
            )
        checked = tuple(_check(campaign, m, record, receptances, fitted) for m, record in held_out.items())
    notes_of_fits = [
        *receptances.notes,
        *(() if fitted is None or fitted.identification is None else fitted.identification.notes),
    ]
    fresh = (note for note in notes_of_fits if not any(text.endswith(note) for text in campaign.notes))
    notes = [*campaign.notes, *fresh]
    return SpindleIdentification(
        name=title,
        table=receptances,
        modes=fitted,
        bands=tuple(bands_of(receptances)),
        hits_for_half=_hits_for_half(campaign, list(used.values()), receptances, errors),
        not_common=tuple(_not_common(used, receptances)),
        checked=tuple(record for record in checked if record is not None),
        notes=tuple(dict.fromkeys(notes)),
        provenance=campaign.provenance(),
    )


def _hits_for_half(
    campaign: CampaignData, observed: Sequence[Observation], table: SpindleReceptance, errors: Sequence[Tolerance]
) -> int | None:
    """Return times the hits with which half of the lines that are not usable become so; None if few are not.

    The lines are solved again with the same records and the standard deviations of more hits.
    """
    others = ~table.usable
    if np.mean(others) <= 1.0 - _FEW:
        return None
    campaign.progress("solving for more hits")
    for hits in _HITS:
        quieter = [altered(o, standard_deviation=np.asarray(o.standard_deviation) / np.sqrt(hits)) for o in observed]
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ReceptanceWarning)
            spindle = identify_spindle(
                quieter, limit=table.limit, tolerances=errors, allow_mismatch=True, threads=campaign.threads
            )
        if np.mean(spindle.usable[others]) >= 0.5:
            return hits
    return None


def chosen_spindle(campaign: CampaignData, name: str | None) -> str:
    """Return the name of the spindle to identify: the given one, or the only one with blanks."""
    having = [title for title, table in campaign.table.spindles.items() if table.blanks]
    if not having:
        raise campaign.error(_NONE)
    if name is None and len(having) > 1:
        raise campaign.error(f"there are blanks of {', '.join(having)}; name one of them, `--name {having[0]}`")
    if name is not None and name not in having:
        raise campaign.error(f'there is no spindle "{name}" with blanks{instead_of(name, having)}')
    return name or having[0]


def _check(
    campaign: CampaignData, name: str, record: Observation, table: SpindleReceptance, modes: SpindleModes | None
) -> CheckedRecord | None:
    """Compare a held-out record with the prediction by the spindle on the lines that the spindle covers."""
    part = table.part() if modes is None else modes.part
    errors: list[Tolerance] = [*campaign.errors_of([name]), *(() if modes is None else modes.tolerances)]
    covered = record.select(part.covers(record.frequency_hz.real))
    if not covered.frequency_hz.size:
        return None
    blank = covered.assembly
    machine = Assembly([*blank.elements.values(), part], blank.attachments.values())
    predicted = Predictor(threads=campaign.threads).at(Site(machine, covered.configuration, name), errors)
    frf = predicted.receptance(covered.frequency_hz, covered.response, covered.excitation)
    ratio = np.log(covered.receptance / frf.receptance)
    assert frf.phase_scatter is not None
    noise = np.asarray(covered.standard_deviation) if covered.weighted else np.zeros(ratio.size)
    off = np.stack(
        [ratio.real / np.hypot(frf.scatter.total, noise), ratio.imag / np.hypot(frf.phase_scatter.total, noise)]
    )
    return CheckedRecord(
        name=name,
        lines=ratio.size,
        decibel=float(DECIBEL * np.sqrt(np.mean(ratio.real**2))),
        deviations=float(np.sqrt(np.mean(off**2))),
    )


def _not_common(records: Mapping[str, Observation], table: SpindleReceptance) -> list[tuple[str, int, float, float]]:
    """Return the records with lines that the table does not have, with the ends of these lines."""
    lines = np.asarray(table.frequency_hz).real
    found = []
    for name, record in records.items():
        own = record.frequency_hz.real
        if own.size > lines.size:
            rest = own[(own < lines[0]) | (own > lines[-1])]
            ends = rest if rest.size else own
            found.append((name, int(own.size - lines.size), float(ends[0]), float(ends[-1])))
    return found


def target_of(campaign: CampaignData, name: str, output: Path | None) -> Path:
    """Return the file to which a spindle is written: that of the command, else that of the campaign."""
    named = campaign.table.spindles[name].file
    if output is None and named is None:
        text = f'has no file: name one with `--output`, or write `file = "{name}{TABLE}"`'
        raise campaign.error(text, "spindles", name)
    return output or campaign.file.parent / str(named)
