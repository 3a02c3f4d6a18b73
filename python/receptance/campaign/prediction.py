"""Predictions of a campaign: of what was held out, compared with it, and of what was not measured at all."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from receptance.campaign.comparison import Peak, PredictedFrequencies, PredictedFRF, Prediction
from receptance.campaign.problems import CampaignError
from receptance.campaign.tolerances import tolerances_of
from receptance.identification import MeasuredFRF
from receptance.identification.mapping import Place
from receptance.identification.peaks import match_peaks
from receptance.identification.prediction import Forecast
from receptance.identification.unknowns import covered

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.assembly import Assembly
    from receptance.campaign.campaign import Campaign
    from receptance.campaign.tolerances import Effects
    from receptance.identification import Identification, MeasuredFrequencies

__all__ = ["forecast_of", "predict_campaign", "prediction_lines"]

_LINES = 2000
_MOST_LINES = 1_000_000
_WIDE = 0.5
"""A standard deviation of the logarithm beyond which a linear band is only a hint."""


def predict_campaign(
    campaign: Campaign,
    identified: Identification | None,
    *,
    threads: int | None = None,
    progress: Callable[[str], None] | None = None,
) -> Prediction:
    """Predict what a campaign holds out or did not measure; see `Campaign.predict`."""
    say = progress or (lambda _: None)
    held_out, unmeasured = campaign.held_out, campaign.unmeasured
    if not held_out and not unmeasured:
        text = 'there is nothing to predict, expected a measurement with the role "hold out" or an assembly without any'
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
        place = Place(seen.assembly, seen.configuration, "", seen.conditions)
        try:
            forecast = forecast_of(campaign, identified, place, measured.effects, name, notes)
        except CampaignError as error:
            lost[name] = error.problems[0].text
            continue
        if isinstance(seen, MeasuredFRF):
            frfs.append(_held_out_frf(name, measured.assembly, seen, forecast))
        else:
            frequencies.append(_held_out_frequencies(name, measured.assembly, seen, forecast))
    for name in unmeasured:
        say(f"predicting {name}")
        try:
            forecast = forecast_of(
                campaign, identified, campaign.place_of(name), campaign.effects.get(name, {}), name, notes
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
            f"the bands of {', '.join(wide)} are wide at peaks: they are linear in the errors, so where a peak may "
            "move by more than its width they are only a hint; the intervals of the natural frequencies hold"
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
    campaign: Campaign, identified: Identification | None, place: Place, effects: Effects, name: str, notes: list[str]
) -> Forecast:
    """Return the forecast of an assembly, and add to the notes which identified parameters are missing from it."""
    try:
        found = Forecast(identified, place, tolerances_of(effects))
    except ValueError as error:
        if identified is None:
            raise
        raise CampaignError.about(campaign.file, f"{name} cannot be predicted: {error}") from None
    if identified is None:
        return found
    wanted = {address for unknown in identified.task.parameters.wanted for address in unknown.reached}
    if not any(covered(address, place.assembly) for address in wanted):
        notes.append(f"{name}: none of the identified parameters is in it")
    asked = [address for unknown in campaign.unknowns for address in unknown.reached]
    rest = [address for address in asked if address not in wanted and covered(address, place.assembly)]
    if rest:
        notes.append(
            f"{name}: {', '.join(rest)} {'was' if len(rest) == 1 else 'were'} not identified and stays at its start"
        )
    return found


def _held_out_frequencies(
    name: str, assembly: str, seen: MeasuredFrequencies, forecast: Forecast
) -> PredictedFrequencies:
    found, scatter = forecast.modes(seen.modes, float(seen.frequency_hz[-1]))
    return PredictedFrequencies(
        name=name,
        assembly=assembly,
        modes=seen.modes,
        predicted_hz=found,
        scatter=scatter,
        measured_hz=seen.frequency_hz,
        measured_deviation_hz=seen.standard_deviation_hz,
    )


def _held_out_frf(name: str, assembly: str, seen: MeasuredFRF, forecast: Forecast) -> PredictedFRF:
    found = forecast.observed(seen)
    peaks = match_peaks(seen.frequency_hz, seen.receptance, found.receptance, seen.standard_deviation)
    deviations = _peak_deviations(peaks, forecast)
    return PredictedFRF(
        name=name,
        assembly=assembly,
        response=seen.response,
        excitation=seen.excitation,
        frequency_hz=seen.frequency_hz,
        receptance=found.receptance,
        scatter=found.scatter,
        phase_scatter=found.phase_scatter,
        measured=seen.receptance,
        measured_deviation=seen.standard_deviation,
        peaks=tuple(peak.with_deviation(one) for peak, one in zip(peaks, deviations, strict=True)),
    )


def _peak_deviations(peaks: list[Peak], forecast: Forecast) -> list[float | None]:
    """Return the standard deviations of predicted peaks, from the nearest natural frequency of the assembly."""
    places = [peak.predicted_hz for peak in peaks if peak.predicted_hz is not None]
    if not places or not forecast.assembly.countable:
        return [None] * len(peaks)
    modes, scatter = forecast.natural_frequencies(1.1 * max(places))
    if not modes.size:
        return [None] * len(peaks)
    return [
        None if p.predicted_hz is None else float(scatter.total[np.abs(modes - p.predicted_hz).argmin()]) for p in peaks
    ]


def _unmeasured(
    name: str, campaign: Campaign, forecast: Forecast, notes: list[str]
) -> tuple[PredictedFrequencies | None, PredictedFRF]:
    assembly = forecast.assembly
    lines = prediction_lines(campaign, assembly)
    frequencies = None
    if not assembly.countable:
        notes.append(f"{name}: ends with a spindle as modes, so only its FRF is predicted, not its natural frequencies")
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
    return frequencies, PredictedFRF(
        name=name,
        assembly=name,
        response=response,
        excitation=excitation,
        frequency_hz=lines,
        receptance=found.receptance,
        scatter=found.scatter,
        phase_scatter=found.phase_scatter,
    )


def _counted(assembly: Assembly, upper: float) -> NDArray[np.float64]:
    """Return the natural frequencies up to a limit; none where they cannot be counted."""
    return assembly.natural_frequencies(upper) if assembly.countable else np.empty(0)


def prediction_lines(campaign: Campaign, assembly: Assembly) -> NDArray[np.float64]:
    """Return the lines on which an assembly that was not measured is predicted."""
    asked = campaign.table.prediction
    seen = [float(measured.observation.frequency_hz[-1].real) for measured in campaign.measurements.values()]
    upper = asked.upper if asked.upper is not None else max(seen, default=None)
    if upper is None:
        text = "nothing says up to which frequency to predict, expected `prediction.upper`"
        raise CampaignError.about(campaign.file, text)
    modes = _counted(assembly, upper)
    lower = asked.lower if asked.lower is not None else 0.1 * float(modes[0] if modes.size else upper)
    if lower >= upper:
        text = f"the prediction goes from {lower:g} to {upper:g} Hz, expected `lower` below `upper` in `prediction`"
        raise CampaignError.about(campaign.file, text)
    step = asked.step if asked.step is not None else (upper - lower) / _LINES
    count = int((upper - lower) / step * (1.0 + 1e-12)) + 1
    if count > _MOST_LINES:
        text = f"{count} lines are too many to predict, expected at most {_MOST_LINES}; give a larger `prediction.step`"
        raise CampaignError.about(campaign.file, text)
    return lower + step * np.arange(count, dtype=np.float64)
