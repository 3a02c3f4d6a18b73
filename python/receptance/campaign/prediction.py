"""Predictions of held-out measurements, with comparison, and of assemblies without measurements."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance.campaign.problems import CampaignError
from receptance.campaign.tolerances import tolerances_of
from receptance.identification import MeasuredFRF
from receptance.identification.covariance import UNINFORMATIVE, confidence_multiplier, is_uninformative
from receptance.identification.mapping import Site
from receptance.identification.prediction import Forecast, PredictedFRF
from receptance.identification.unknowns import covered
from receptance.report import Column, Provenance, Result, Table

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from receptance.campaign.campaign import Campaign
    from receptance.campaign.tolerances import Effects
    from receptance.identification import Identification, MeasuredFrequencies
    from receptance.identification.peaks import Peak
    from receptance.identification.prediction import PredictedFRF, Scatter
    from receptance.model.assembly import Assembly
    from receptance.report.table import Cell

__all__ = ["PredictedFrequencies", "Prediction", "forecast_of", "predict_campaign", "prediction_lines"]


@dataclass(frozen=True, kw_only=True)
class PredictedFrequencies:
    """Predicted natural frequencies of an assembly, with measured ones if there are any.

    Attributes
    ----------
    name : str
        Name of the held-out measurement, or of the assembly without measurements.
    assembly : str
        Name of the assembly.
    modes : tuple of int
        Elastic modes from 1.
    predicted_hz : ndarray
        `(m,)`.
    scatter : Scatter
        Uncertainty of the predictions in Hz.
    measured_hz, measured_deviation_hz : ndarray or None
        Measured values and their standard deviations.
    """

    name: str
    assembly: str
    modes: tuple[int, ...]
    predicted_hz: NDArray[np.float64]
    scatter: Scatter
    measured_hz: NDArray[np.float64] | None = None
    measured_deviation_hz: NDArray[np.float64] | None = None

    @property
    def errors_percent(self) -> NDArray[np.float64]:
        """Errors of the predictions in percent, `(m,)`; empty without measurements."""
        return np.empty(0) if self.measured_hz is None else 100.0 * (self.predicted_hz / self.measured_hz - 1.0)

    def interval_hz(self, reach: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return lower and upper ends of intervals of `reach` standard deviations to either side."""
        half = reach * self.scatter.total
        return np.maximum(self.predicted_hz - half, 0.0), self.predicted_hz + half

    def uninformative(self, reach: float) -> NDArray[np.bool_]:
        """Return which intervals are too wide to be useful, `(m,)`."""
        return is_uninformative(self.predicted_hz, reach * self.scatter.total)

    def within(self, reach: float) -> NDArray[np.bool_]:
        """Return whether measured values agree with the intervals and their own errors; empty without measurements.

        Not meaningful where `uninformative` is true.
        """
        if self.measured_hz is None:
            return np.empty(0, dtype=np.bool_)
        reading = 0.0 if self.measured_deviation_hz is None else self.measured_deviation_hz
        far: NDArray[np.bool_] = np.abs(self.predicted_hz - self.measured_hz) <= reach * np.hypot(
            self.scatter.total, reading
        )
        return far

    def data(self, reach: float) -> dict[str, Any]:
        """Return the numbers by name, with intervals of `reach` standard deviations to either side."""
        low, high = self.interval_hz(reach)
        nothing = self.uninformative(reach)
        found: dict[str, Any] = {
            "name": self.name,
            "assembly": self.assembly,
            "modes": self.modes,
            "predicted_hz": self.predicted_hz,
            "interval_hz": [low, high],
            "interval_uninformative": nothing,
            "standard_error_hz": self.scatter.total,
            "standard_error_of_fit_hz": self.scatter.data,
            "change_for_one_deviation_hz": self.scatter.errors,
        }
        if self.measured_hz is not None:
            found |= {
                "measured_hz": self.measured_hz,
                "measured_deviation_hz": self.measured_deviation_hz,
                "error_percent": self.errors_percent,
                "within": [None if wide else bool(yes) for wide, yes in zip(nothing, self.within(reach), strict=True)],
            }
        return found


@dataclass(frozen=True, kw_only=True)
class Prediction(Result):
    """Predictions of a campaign with their intervals.

    Attributes
    ----------
    identified : Identification or None
        The fit; None without unknowns.
    frequencies : tuple of PredictedFrequencies
        Natural frequencies; those of held-out measurements first.
    frfs : tuple of PredictedFRF
        Frequency responses; those of held-out measurements first.
    level : float
        Level of the intervals.
    not_predicted : dict of str to str
        Reasons why measurements or assemblies could not be predicted, by name.
    notes : tuple of str
        Notes for the user.
    provenance : Provenance
        Campaign and versions of the software.
    """

    identified: Identification | None
    frequencies: tuple[PredictedFrequencies, ...]
    frfs: tuple[PredictedFRF, ...]
    level: float
    not_predicted: dict[str, str]
    notes: tuple[str, ...]
    provenance: Provenance = field(default_factory=Provenance, repr=False)

    heading = "Prediction"

    @property
    def reach(self) -> float:
        """Half width of the intervals in standard deviations."""
        if self.identified is None:
            return confidence_multiplier(self.level, None)
        return self.identified.confidence_multiplier(self.level)

    @property
    def errors_percent(self) -> list[float]:
        """Errors of the predictions of held-out natural frequencies and peaks in percent."""
        listed = [float(e) for p in self.frequencies if p.measured_hz is not None for e in p.errors_percent]
        return listed + [peak.error_percent for frf in self.frfs for peak in frf.peaks if peak.matched]

    @property
    def rms_percent(self) -> float | None:
        """Root mean square of `errors_percent`; None without measurements."""
        errors = self.errors_percent
        return float(np.sqrt(np.mean(np.square(errors)))) if errors else None

    def tables(self) -> list[Table]:
        """Return predictions with measurements, predictions of other assemblies, and parameters."""
        held_out = [one for one in self.frequencies if one.measured_hz is not None]
        unmeasured = [one for one in self.frequencies if one.measured_hz is None]
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
        inside = [
            bool(yes)
            for one in self.frequencies
            if one.measured_hz is not None
            for yes in one.within(self.reach)[~one.uninformative(self.reach)]
        ]
        inside += [yes for frf in self.frfs for peak in frf.peaks if (yes := peak.within(self.reach)) is not None]
        rest = len(self.errors_percent) - len(inside)
        wide = f"; {rest} intervals are too wide to be useful" if rest else ""
        return [
            f"held out: {len(self.errors_percent)} natural frequencies and peaks, predicted {self.rms_percent:.2f} % "
            f"rms off; {sum(inside)} of {len(inside)} within the {100.0 * self.level:g} % intervals{wide}.",
            *fit,
        ]

    def warnings(self) -> list[str]:
        """Return the advice of the fit."""
        return [] if self.identified is None else self.identified.warnings()

    def data(self) -> dict[str, Any]:
        """Return all predictions with their measurements, and the fit."""
        return {
            "level": self.level,
            "rms_percent": self.rms_percent,
            "natural_frequencies": [one.data(self.reach) for one in self.frequencies],
            "frfs": [one.data(self.level) for one in self.frfs],
            "not_predicted": self.not_predicted,
            "identified": None if self.identified is None else self.identified.to_dict(),
        }

    def plot(self, ax: Axes | None = None) -> Figure:
        """Draw predictions with their intervals, over the measurements; see `Result.plot`."""
        from receptance.identification.figures.fit import draw_prediction

        return draw_prediction(self, ax)

    def __repr__(self) -> str:
        counts = f"{len(self.frequencies)} sets of natural frequencies, {len(self.frfs)} FRFs"
        rms = "" if self.rms_percent is None else f", rms {self.rms_percent:.3g} %"
        return f"Prediction({self.provenance.title!r}, {counts}{rms})"

    def _interval(self) -> Column:
        return Column(f"{100.0 * self.level:g} % interval", "Hz", ".1f")

    def _frequency_table(self, title: str, several: list[PredictedFrequencies]) -> Table:
        columns = (
            "name",
            Column("mode", form="d"),
            Column("measured", "Hz", ".1f"),
            Column("predicted", "Hz", ".1f"),
            self._interval(),
            Column("error", "%", "+.2f"),
            Column("within"),
            "mostly from",
        )
        rows: list[list[Cell]] = []
        for one in several:
            low, high = one.interval_hz(self.reach)
            inside, nothing = one.within(self.reach), one.uninformative(self.reach)
            for i, mode in enumerate(one.modes):
                measured = None if one.measured_hz is None else float(one.measured_hz[i])
                known = measured is not None and not nothing[i]
                rows.append(
                    [
                        one.name if i == 0 else None,
                        mode,
                        measured,
                        float(one.predicted_hz[i]),
                        UNINFORMATIVE if nothing[i] else (float(low[i]), float(high[i])),
                        None if measured is None else float(one.errors_percent[i]),
                        bool(inside[i]) if known else None,
                        _largest(one.scatter, i),
                    ]
                )
        return Table(title, columns, rows).without_empty()

    def _peak_table(self) -> Table:
        columns = (
            "measurement",
            Column("measured", "Hz", ".1f"),
            Column("predicted", "Hz", ".1f"),
            self._interval(),
            Column("error", "%", "+.2f"),
            Column("within"),
        )
        rows: list[list[Cell]] = [
            [
                frf.name if i == 0 else None,
                "none" if peak.measured_hz is None else peak.measured_hz,
                "none" if peak.predicted_hz is None else peak.predicted_hz,
                self._peak_interval(peak),
                peak.error_percent if peak.matched else None,
                peak.within(self.reach),
            ]
            for frf in self.frfs
            if frf.measured is not None
            for i, peak in enumerate(frf.peaks)
        ]
        return Table("Peaks of FRFs held out", columns, rows)

    def _peak_interval(self, peak: Peak) -> Cell:
        if peak.predicted_hz is None or peak.deviation_hz is None:
            return None
        half = self.reach * peak.deviation_hz
        wide = is_uninformative(peak.predicted_hz, half)
        return UNINFORMATIVE if wide else (peak.predicted_hz - half, peak.predicted_hz + half)

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
    shares = {name: float(own[index]) for name, own in scatter.shares.items()}
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


def predict_campaign(
    campaign: Campaign,
    identified: Identification | None,
    *,
    threads: int | None = None,
    progress: Callable[[str], None] | None = None,
) -> Prediction:
    """Predict held-out measurements and assemblies without measurements; see `Campaign.predict`."""
    say = progress or (lambda _: None)
    held_out, unmeasured = campaign.held_out, campaign.unmeasured
    if not held_out and not unmeasured:
        text = 'there is nothing to predict, expected a measurement with the role "hold out" or an assembly without one'
        raise CampaignError.about(campaign.file, text)
    if identified is None and campaign.unknowns:
        identified = campaign.identify(threads=threads, progress=progress)
    notes = list(campaign.notes if identified is None else identified.notes)
    frequencies: list[PredictedFrequencies] = []
    frfs: list[PredictedFRF] = []
    lost: dict[str, str] = {}
    for name, measured in held_out.items():
        say(f"predicting {name}")
        seen = measured.observation
        place = Site(seen.assembly, seen.configuration, "", seen.conditions)
        try:
            forecast = forecast_of(campaign, identified, place, measured.effects, name, notes)
        except CampaignError as error:
            lost[name] = error.problems[0].text
            continue
        if isinstance(seen, MeasuredFRF):
            frfs.append(replace(forecast.observed(seen), name=name, assembly=measured.assembly))
        else:
            frequencies.append(_held_out_frequencies(name, measured.assembly, seen, forecast))
    for name in unmeasured:
        say(f"predicting {name}")
        try:
            forecast = forecast_of(
                campaign, identified, campaign.site(name), campaign.effects.get(name, {}), name, notes
            )
        except CampaignError as error:
            lost[name] = error.problems[0].text
            continue
        found = _unmeasured(name, campaign, forecast, notes)
        frequencies += [found[0]] if found[0] is not None else []
        frfs.append(found[1])
    if not frequencies and not frfs:
        raise CampaignError.about(campaign.file, "; ".join(lost.values()))
    notes += [f"not predicted: {reason}" for reason in lost.values()]
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
        not_predicted=lost,
        notes=tuple(dict.fromkeys(notes)),
        provenance=campaign.provenance(),
    )


def forecast_of(
    campaign: Campaign, identified: Identification | None, place: Site, effects: Effects, name: str, notes: list[str]
) -> Forecast:
    """Return the forecast of an assembly, and add notes on parameters that are not identified or not in it.

    Parameters
    ----------
    campaign : Campaign
        The campaign.
    identified : Identification or None
        The fit; None without unknowns.
    place : Site
        The assembly with its configuration and conditions.
    effects : dict
        Errors: by name and address the standard deviation in SI units.
    name : str
        Name of the prediction in notes and messages.
    notes : list of str
        List to which notes are added.

    Raises
    ------
    CampaignError
        The prediction is not possible, for example without the condition of a law.
    """
    try:
        found = Forecast(identified, place, tolerances_of(effects))
    except ValueError as error:
        if identified is None:
            raise
        raise CampaignError.about(campaign.file, f"{name} cannot be predicted: {error}") from None
    if identified is None:
        return found
    wanted = {address for unknown in identified.task.parameters.given for address in unknown.addresses}
    if not any(covered(address, place.assembly) for address in wanted):
        notes.append(f"{name}: the assembly has none of the identified parameters")
    asked = [address for unknown in campaign.unknowns for address in unknown.addresses]
    rest = [address for address in asked if address not in wanted and covered(address, place.assembly)]
    if rest:
        notes.append(f"{name}: not identified and at start values: {', '.join(rest)}")
    return found


def _held_out_frequencies(
    name: str, assembly: str, seen: MeasuredFrequencies, forecast: Forecast
) -> PredictedFrequencies:
    found, scatter = forecast.modes(seen.modes)
    return PredictedFrequencies(
        name=name,
        assembly=assembly,
        modes=seen.modes,
        predicted_hz=found,
        scatter=scatter,
        measured_hz=seen.frequency_hz,
        measured_deviation_hz=seen.standard_deviation_hz,
    )


def _unmeasured(
    name: str, campaign: Campaign, forecast: Forecast, notes: list[str]
) -> tuple[PredictedFrequencies | None, PredictedFRF]:
    assembly = forecast.assembly
    lines = prediction_lines(campaign, assembly)
    frequencies = None
    if not assembly.countable:
        notes.append(f"{name}: the spindle is a modal part, so natural frequencies are not predicted, only the FRF")
    else:
        modes, scatter = forecast.natural_frequencies(float(lines[-1]))
        if modes.size:
            numbers = tuple(range(1, modes.size + 1))
            frequencies = PredictedFrequencies(
                name=name, assembly=name, modes=numbers, predicted_hz=modes, scatter=scatter
            )
        else:
            notes.append(f"{name}: there is no natural frequency below {lines[-1]:g} Hz")
    response, excitation = campaign.places[name]
    asked = campaign.table.prediction.force
    force = None if asked is None else np.full(lines.size, asked)
    found = forecast.receptance(lines, response, excitation, force=force)
    return frequencies, replace(found, name=name, assembly=name)


def _counted(assembly: Assembly, upper: float) -> NDArray[np.float64]:
    """Return the natural frequencies up to a limit; an empty array if they cannot be counted."""
    return assembly.natural_frequencies(upper) if assembly.countable else np.empty(0)


def prediction_lines(campaign: Campaign, assembly: Assembly) -> NDArray[np.float64]:
    """Return the lines in Hz on which an assembly without measurements is predicted."""
    asked = campaign.table.prediction
    upper = campaign.highest_frequency
    if upper is None:
        raise CampaignError.about(
            campaign.file, "the highest frequency of predictions is not given, expected `prediction.upper`"
        )
    modes = _counted(assembly, upper)
    lower = asked.lower if asked.lower is not None else 0.1 * float(modes[0] if modes.size else upper)
    if lower >= upper:
        text = f"predictions are from {lower:g} to {upper:g} Hz, expected `lower` below `upper` in `prediction`"
        raise CampaignError.about(campaign.file, text)
    step = asked.step if asked.step is not None else (upper - lower) / _LINES
    count = int((upper - lower) / step * (1.0 + 1e-12)) + 1
    if count > _MOST_LINES:
        text = f"predictions have {count} lines, expected at most {_MOST_LINES}; give a larger `prediction.step`"
        raise CampaignError.about(campaign.file, text)
    return lower + step * np.arange(count, dtype=np.float64)
