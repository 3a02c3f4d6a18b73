"""Predictions of held-out measurements, with comparison, and of assemblies without measurements."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from receptance.campaign.data import CampaignData
from receptance.campaign.identification import identify_campaign, parts_to_start
from receptance.campaign.problems import CampaignError, errors_about
from receptance.fit import Identification, PredictedMode, Scatter, Tolerance
from receptance.fit.covariance import UNINFORMATIVE, confidence_multiplier
from receptance.fit.parameters import Site
from receptance.fit.prediction import PredictedFrequencies, PredictedFRF
from receptance.fit.predictor import PredictedAssembly, Predictor
from receptance.fit.unknowns import covered
from receptance.model.assembly import Assembly
from receptance.model.terminals import EQUAL_LINES, MeasuredPart, Terminal
from receptance.report import ACCEPTED, Column, Provenance, Rejection, Result, Table
from receptance.report.table import Cell


@dataclass(frozen=True, kw_only=True)
class Prediction(Result):
    """Predictions of a campaign with their intervals."""

    identified: Identification | None
    """The fit; None without unknowns."""
    frequencies: tuple[PredictedFrequencies, ...]
    """Natural frequencies; those of held-out measurements first."""
    frfs: tuple[PredictedFRF, ...]
    """Frequency responses; those of held-out measurements first."""
    level: float
    """Level of the intervals."""
    not_predicted: dict[str, str]
    """Reasons why measurements or assemblies could not be predicted, by name."""
    notes: tuple[str, ...]
    provenance: Provenance = field(default_factory=Provenance, repr=False)

    heading = "Prediction"
    plotted_by = "receptance.campaign.figure:draw_prediction"

    @property
    def reach(self) -> float:
        """Half width of the intervals in standard deviations."""
        if self.identified is None:
            return confidence_multiplier(self.level, None)
        return self.identified.confidence_multiplier(self.level)

    @property
    def modes(self) -> list[PredictedMode]:
        """Natural frequencies, and peaks of held-out FRFs."""
        peaks = [peak for frf in self.frfs for peak in frf.peaks]
        return [mode for frequency in self.frequencies for mode in frequency.modes] + peaks

    @property
    def errors_percent(self) -> list[float]:
        """Errors of the predictions of held-out natural frequencies and peaks in percent."""
        return [error for mode in self.modes if (error := mode.error_percent) is not None]

    @property
    def rms_percent(self) -> float | None:
        """Root mean square of `errors_percent`; None without measurements."""
        errors = self.errors_percent
        return float(np.sqrt(np.mean(np.square(errors)))) if errors else None

    def tables(self) -> list[Table]:
        """Return predictions with measurements, predictions of other assemblies, and parameters."""
        held_out = [frequency for frequency in self.frequencies if frequency.measured_hz is not None]
        unmeasured = [frequency for frequency in self.frequencies if frequency.measured_hz is None]
        tables = [
            self._frequency_table("Natural frequencies held out", held_out),
            self._peak_table(),
            self._frf_table(),
            self._frequency_table("Assemblies that were not measured", unmeasured),
            *(self.identified.tables() if self.identified is not None else ()),
        ]
        return [table for table in tables if table.rows]

    def sentences(self) -> list[str]:
        """Return the errors of held-out natural frequencies and peaks, and how the fit ended."""
        fit = [] if self.identified is None else self.identified.sentences()
        if self.rms_percent is None:
            return fit
        inside = [yes for mode in self.modes if (yes := mode.within(self.level)) is not None]
        rest = sum(mode.error_percent is not None and mode.uninformative(self.level) for mode in self.modes)
        wide = f"; {rest} intervals are too wide to be useful" if rest else ""
        # Peaks of assemblies that end with a modal part have no intervals.
        within = (
            f"; {sum(inside)} of {len(inside)} within the {100.0 * self.level:g} % intervals" if inside or rest else ""
        )
        return [
            f"held out: {len(self.errors_percent)} natural frequencies and peaks, predicted {self.rms_percent:.2f} % "
            f"rms off{within}{wide}.",
            *fit,
        ]

    @property
    def rejection(self) -> Rejection:
        """Why the fit is rejected; false if it is accepted or there is none."""
        return ACCEPTED if self.identified is None else self.identified.rejection

    def warnings(self) -> list[str]:
        """Return the most important advice of the fit; the fit itself has the rest."""
        advice = [] if self.identified is None else self.identified.warnings()
        rest = len(advice) - 1
        return advice if rest < 1 else [advice[0], f"{rest} more on the fit: `receptance identify` prints them"]

    def data(self) -> dict[str, Any]:
        """Return all predictions with their measurements, and the fit."""
        return {
            "level": self.level,
            "rms_percent": self.rms_percent,
            "natural_frequencies": [frequency.data(self.level) for frequency in self.frequencies],
            "frfs": [frf.data(self.level) for frf in self.frfs],
            "not_predicted": self.not_predicted,
            "identified": None if self.identified is None else self.identified.to_dict(),
        }

    def __repr__(self) -> str:
        counts = f"{len(self.frequencies)} sets of natural frequencies, {len(self.frfs)} FRFs"
        rms = "" if self.rms_percent is None else f", rms {self.rms_percent:.3g} %"
        return f"Prediction({self.provenance.title!r}, {counts}{rms})"

    def _columns(self, *first: Column | str) -> tuple[Column | str, ...]:
        """Return the columns of tables of natural frequencies or peaks."""
        return (
            *first,
            Column("measured", "Hz", ".1f"),
            Column("predicted", "Hz", ".1f"),
            Column(f"{100.0 * self.level:g} % interval", "Hz", ".1f"),
            Column("error", "%", "+.2f"),
            Column("within"),
        )

    def _compared(self, mode: PredictedMode) -> list[Cell]:
        """Return the cells of interval, error and within."""
        interval = UNINFORMATIVE if mode.uninformative(self.level) else mode.interval_hz(self.level)
        return [interval, mode.error_percent, mode.within(self.level)]

    def _frequency_table(self, title: str, several: list[PredictedFrequencies]) -> Table:
        rows: list[list[Cell]] = [
            [
                frequencies.name if i == 0 else None,
                mode.mode,
                mode.measured_hz,
                mode.predicted_hz,
                *self._compared(mode),
                _largest(frequencies.scatter, i),
            ]
            for frequencies in several
            for i, mode in enumerate(frequencies.modes)
        ]
        columns = (*self._columns("name", Column("mode", form="d")), "mostly from")
        return Table(title, columns, rows).without_empty()

    def _peak_table(self) -> Table:
        rows: list[list[Cell]] = [
            [
                frf.name if i == 0 else None,
                "none" if peak.measured_hz is None else peak.measured_hz,
                "none" if peak.predicted_hz is None else peak.predicted_hz,
                *self._compared(peak),
            ]
            for frf in self.frfs
            if frf.measured is not None
            for i, peak in enumerate(frf.peaks)
        ]
        return Table("Peaks of FRFs held out", self._columns("measurement"), rows)

    def _frf_table(self) -> Table:
        columns = (
            "measurement",
            Column("lines", form="d"),
            Column("magnitude off", "dB rms", ".2f"),
            Column(f"lines within {100.0 * self.level:g} %\nof band and noise", "%", ".1f"),
            Column("lines without a\nuseful band", "%", ".1f"),
        )
        rows: list[list[Cell]] = []
        for frf in self.frfs:
            if frf.measured is None:
                continue
            share, nothing = frf.share_within(self.level), float(np.mean(frf.uninformative(self.level)))
            rows.append(
                [
                    frf.name,
                    frf.frequency_hz.size,
                    frf.rms_decibel,
                    UNINFORMATIVE if share is None else 100.0 * share,
                    100.0 * nothing if nothing else None,
                ]
            )
        return Table("FRFs held out", columns, rows).without_empty()


def _largest(scatter: Scatter, index: int) -> str:
    """Return the error with the largest share of a variance, or the noise of the data, and its share."""
    total = float(scatter.total[index])
    if not np.isfinite(total) or total == 0.0:
        return "not determined" if total else ""
    shares = {name: float(share[index]) for name, share in scatter.shares.items()}
    shares["scatter of the data"] = float(scatter.data[index] / total) ** 2
    name = max(shares, key=lambda one: shares[one])
    # The section of the campaign file is left out; `to_dict` has the whole name.
    words = re.sub(r"^(materials|parts|joints|sensors|attachments)\.", "", name)
    words = re.sub(r"^assemblies\.(.+?)\.(set|tolerance)\.", r"\1: ", words).replace('"', "")
    return f"{words} {100.0 * shares[name]:.0f} %"


_LINES = 2000
_MOST_LINES = 1_000_000
_WIDE = 0.5
"""Standard deviation of the logarithm from which on a first-order band is only approximate."""


def predict_campaign(campaign: CampaignData, identified: Identification | None) -> Prediction:
    """Predict held-out measurements and assemblies without measurements; see `Campaign.predict`."""
    held_out, unmeasured = campaign.held_out, campaign.unmeasured
    if not held_out and not unmeasured:
        raise campaign.error(
            'there is nothing to predict, expected a measurement with the role "hold out" or an assembly without one'
        )
    if identified is None and campaign.unknowns:
        identified = identify_campaign(campaign)
    notes = list(campaign.notes if identified is None else identified.notes)
    frequencies: list[PredictedFrequencies] = []
    frfs: list[PredictedFRF] = []
    reasons: dict[str, str] = {}
    count = len(held_out) + len(unmeasured)
    for number, (name, measured) in enumerate([*held_out.items(), *((name, None) for name in unmeasured)], start=1):
        campaign.progress(f"predicting {name}, {number} of {count}")
        if measured is None:
            site, tolerances = campaign.site(name), campaign.tolerances.get(name, ())
        else:
            site = Site(measured.assembly, measured.configuration, "", measured.conditions)
            tolerances = campaign.errors[name]
        try:
            predicted = predict_assembly(campaign, identified, site, tolerances, name, notes)
        except CampaignError as error:
            reasons[name] = error.problems[0].text
            continue
        with errors_about(campaign.file, f"{name}: "):
            if measured is None:
                modes, frf = _unmeasured(name, campaign, predicted, notes)
                frequencies += [] if modes is None else [modes]
                frfs.append(frf)
            elif measured.is_receptance:
                frf = replace(predicted.observed(measured), name=name, assembly=measured.configuration)
                frfs.append(frf)
                lost = [f"{peak.predicted_hz:.0f}" for peak in frf.peaks if peak.predicted_hz and not peak.deviation_hz]
                if lost and identified is not None:
                    notes.append(
                        f"{name}: the peaks predicted at {', '.join(lost)} Hz have no interval, because no mode can be "
                        "fitted to their lines"
                    )
            else:
                modes = predicted.observed_modes(measured)
                frequencies.append(replace(modes, name=name, assembly=measured.configuration))
    if not frequencies and not frfs:
        raise campaign.error("; ".join(reasons.values()))
    notes += [f"not predicted: {reason}" for reason in reasons.values()]
    wide = [frf.name for frf in frfs if np.nanmax(frf.scatter.total) > _WIDE]
    if wide:
        notes.append(
            f"the bands of {', '.join(wide)} are wide at peaks; they are of first order in the errors, and only "
            "approximate where a peak may move by more than its width; intervals of natural frequencies remain valid"
        )
    return Prediction(
        identified=identified,
        frequencies=tuple(frequencies),
        frfs=tuple(frfs),
        level=campaign.table.prediction.level,
        not_predicted=reasons,
        notes=tuple(dict.fromkeys(notes)),
        provenance=campaign.provenance(),
    )


def predict_assembly(
    campaign: CampaignData,
    identified: Identification | None,
    site: Site,
    tolerances: Sequence[Tolerance],
    name: str,
    notes: list[str],
    threads: int | None = None,
) -> PredictedAssembly:
    """Return the predictions of an assembly, and add to `notes` parameters that are not identified or not in it.

    Without unknowns `identified` is None. The assembly, with its configuration and conditions, and its errors are those
    of `site` and `tolerances`; `name` is that of the prediction in notes and messages.

    Raises
    ------
    CampaignError
        The prediction is not possible, for example without the condition of a law.
    """
    if identified is None:
        return Predictor().at(site, tolerances, threads)
    try:
        predicted = identified.predictor.at(site, tolerances, threads)
    except ValueError as error:
        raise campaign.error(f"{name} cannot be predicted: {error}") from None
    identifiable = {address for unknown in identified.task.parameters.given for address in unknown.addresses}
    if not any(covered(address, site.assembly) for address in identifiable):
        notes.append(f"{name}: the assembly has none of the identified parameters")
    # Modes that the records do not show are left out of the fit, and have no effect.
    by_mode = tuple(f"{part}." for part in parts_to_start(campaign))
    by_mode = tuple(part for part in by_mode if any(address.startswith(part) for address in identifiable))
    rest = [
        address
        for unknown in campaign.unknowns
        for address in unknown.addresses
        if address not in identifiable and covered(address, site.assembly) and not address.startswith(by_mode)
    ]
    if rest:
        notes.append(f"{name}: not identified and at start values: {', '.join(rest)}")
    return predicted


def _unmeasured(
    name: str, campaign: CampaignData, predicted: PredictedAssembly, notes: list[str]
) -> tuple[PredictedFrequencies | None, PredictedFRF]:
    assembly = predicted.assembly
    lines = prediction_lines(campaign, assembly)
    *_, end = assembly.elements.values()
    notes += beyond_spindle(campaign, end) if isinstance(end, Terminal) else []
    if isinstance(end, MeasuredPart) and end.gaps_hz:
        widest = max(end.gaps_hz, key=lambda gap: gap[1] - gap[0])
        text = f"{name}: the spindle {source_of(end)} is not known in {len(end.gaps_hz)} gaps of its lines, the widest"
        notes.append(f"{text} from {widest[0]:g} to {widest[1]:g} Hz; a peak in one of them is not predicted")
    if assembly.countable:
        frequencies = predicted.natural_frequencies(float(lines[-1]))
    else:
        frequencies = predicted.peak_frequencies(lines, predicted.linear(lines))
        notes.append(
            f"{name}: {next(reversed(assembly.elements))} is known by modes or by a table, so natural frequencies are "
            "those of the distinct peaks of the FRF of the tip"
        )
    if not frequencies.modes:
        which = "natural frequency" if assembly.countable else "distinct peak of the tip"
        notes.append(f"{name}: there is no {which} below {lines[-1]:g} Hz")
    response, excitation = campaign.places[name]
    amplitude = campaign.table.prediction.force
    force = None if amplitude is None else np.full(lines.size, amplitude)
    frf = predicted.receptance(lines, response, excitation, force=force)
    named = replace(frequencies, name=name, assembly=name) if frequencies.modes else None
    return named, replace(frf, name=name, assembly=name)


def prediction_lines(campaign: CampaignData, assembly: Assembly) -> NDArray[np.float64]:
    """Return the lines in Hz on which an assembly without measurements is predicted."""
    settings = campaign.table.prediction
    *_, end = assembly.elements.values()
    if isinstance(end, Terminal) and np.isfinite(end.edges_hz[1]):
        return spindle_lines(campaign, end, _LINES)
    upper = campaign.highest_frequency
    if upper is None:
        raise campaign.error("the highest frequency of predictions is not given, expected `prediction.upper`")
    try:
        modes = assembly.natural_frequencies(upper) if assembly.countable else np.empty(0)
    except ValueError as error:
        expected = f"expected one near those of the measurements, or other sizes of {', '.join(assembly.elements)}"
        text = f"is {upper:g} Hz for predictions: {error}; {expected}"
        raise campaign.error(text, "prediction", "upper") from None
    lower = settings.lower
    if lower is None and assembly.countable:
        lower = 0.1 * float(modes[0] if modes.size else upper)
    elif lower is None:
        # Modes of a spindle that were identified are known where they were measured.
        lower = upper / _LINES if campaign.measured_band is None else campaign.measured_band[0]
    return lines_between(campaign, lower, upper, _LINES)


def spindle_lines(campaign: CampaignData, spindle: Terminal, steps: int) -> NDArray[np.float64]:
    """Return the lines in Hz on which assemblies with a spindle are predicted, those within the limits of predictions.

    They are those of a table, or, with modes or a stated step, lines of the band in which the spindle is known.
    """
    settings, (low, high) = campaign.table.prediction, spindle.edges_hz
    lower, upper = max(settings.lower or 0.0, low or high / steps), min(settings.upper or high, high)
    if isinstance(spindle, MeasuredPart) and settings.step is None:
        lines = spindle.frequency_hz
        lines = lines[(lines >= lower * (1.0 - EQUAL_LINES)) & (lines <= upper * (1.0 + EQUAL_LINES))]
    elif lower < upper:
        lines = lines_between(campaign, lower, upper, steps)
        lines = lines[spindle.covers(lines)]
    else:
        lines = np.empty(0)
    if not lines.size:
        raise campaign.error(
            f"predictions are from {settings.lower or 0.0:g} to {settings.upper or high:g} Hz, and the spindle "
            f"{source_of(spindle)} is known from {low:g} to {high:g} Hz, on none of their lines; expected other "
            "limits, or no `step`, in `prediction`"
        )
    return lines


def beyond_spindle(campaign: CampaignData, spindle: Terminal) -> list[str]:
    """Return a note on limits of predictions beyond the lines on which a spindle is known; empty without such."""
    settings, (low, high) = campaign.table.prediction, spindle.edges_hz
    over = settings.upper is not None and settings.upper > high * (1.0 + EQUAL_LINES)
    under = settings.lower is not None and settings.lower < low * (1.0 - EQUAL_LINES)
    if not over and not under:
        return []
    return [
        f"predictions with the spindle {source_of(spindle)} are from {low:g} to {high:g} Hz, where it is known, "
        "although `prediction` has wider limits"
    ]


def source_of(spindle: Terminal) -> str:
    """Return the file of a table, else the name of the spindle, for messages."""
    return (isinstance(spindle, MeasuredPart) and spindle.source) or spindle.name


def lines_between(campaign: CampaignData, lower: float, upper: float, steps: int) -> NDArray[np.float64]:
    """Return the lines in Hz between two limits, `steps` steps without `prediction.step`."""
    settings = campaign.table.prediction
    if lower >= upper:
        raise campaign.error(
            f"predictions are from {lower:g} to {upper:g} Hz, expected `lower` below `upper` in `prediction`"
        )
    step = settings.step if settings.step is not None else (upper - lower) / steps
    count = int((upper - lower) / step * (1.0 + 1e-12)) + 1
    if count > _MOST_LINES:
        raise campaign.error(
            f"predictions have {count} lines, expected at most {_MOST_LINES}; give a larger `prediction.step`"
        )
    return lower + step * np.arange(count, dtype=np.float64)
