"""Predictions of a campaign: of what was held out, compared with it, and of what was not measured at all."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance.campaign.comparison import Peak, PredictedFrequencies, PredictedFRF
from receptance.campaign.identification import propagation_of
from receptance.campaign.problems import CampaignError
from receptance.campaign.propagation import Propagation, Where, tolerances_of
from receptance.identification import Identification, MeasuredFRF
from receptance.identification.factors import FACTORS
from receptance.identification.mapping import Addresses
from receptance.identification.peaks import match_peaks
from receptance.identification.residuals import FRFResidual
from receptance.identification.spread import quantile
from receptance.identification.stepped_place import SteppedPlace
from receptance.identification.task import place_of
from receptance.identification.unknowns import covered
from receptance.report.plain import plain

if TYPE_CHECKING:
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from receptance.assembly import Assembly
    from receptance.campaign.campaign import Campaign
    from receptance.campaign.observations import Measurement
    from receptance.campaign.tolerances import Effects

__all__ = ["CampaignPrediction", "applied", "predict_campaign", "prediction_lines", "recorded", "what_can_be_predicted"]

_LINES = 2000
_MOST_LINES = 1_000_000
_WIDE = 0.5
"""A standard deviation of the logarithm beyond which a linear band is only a hint."""


@dataclass(frozen=True, kw_only=True)
class CampaignPrediction:
    """Predictions of a campaign with their intervals.

    Attributes
    ----------
    campaign : Campaign
        What was predicted.
    identified : Identification or None
        The fit that the predictions rest on; None where nothing is unknown.
    frequencies : tuple of PredictedFrequencies
        Natural frequencies, of held-out measurements first.
    frfs : tuple of PredictedFRF
        Frequency responses, of held-out measurements first.
    level : float
        Level of the intervals.
    not_predicted : dict of str to str
        What could not be predicted, by name of the measurement or assembly, and why.
    notes : tuple of str
        What a person should know.
    versions : dict of str to str
        What is needed to do it again.
    """

    campaign: Campaign
    identified: Identification | None
    frequencies: tuple[PredictedFrequencies, ...]
    frfs: tuple[PredictedFRF, ...]
    level: float
    not_predicted: dict[str, str]
    notes: tuple[str, ...]
    versions: dict[str, str]

    @property
    def reach(self) -> float:
        """How many standard deviations an interval reaches to either side."""
        return quantile(self.level, None)

    @property
    def errors_percent(self) -> list[float]:
        """Predicted against measured, of every held-out natural frequency and peak, in percent."""
        listed = [float(e) for p in self.frequencies if p.measured_hz is not None for e in p.errors_percent]
        return listed + [peak.error_percent for frf in self.frfs for peak in frf.peaks if peak.matched]

    @property
    def rms_percent(self) -> float | None:
        """Root mean square of `errors_percent`; None where nothing is compared."""
        errors = self.errors_percent
        return float(np.sqrt(np.mean(np.square(errors)))) if errors else None

    def as_dict(self) -> dict[str, Any]:
        """Return the result as what JSON holds: an infinite number is None, a complex one a pair."""
        found: dict[str, Any] = plain(
            {
                "campaign": self.campaign.title,
                "file": self.campaign.file.name,
                "level": self.level,
                "rms_percent": self.rms_percent,
                "natural_frequencies": [one.as_dict(self.reach) for one in self.frequencies],
                "frfs": [one.as_dict(self.reach) for one in self.frfs],
                "not_predicted": self.not_predicted,
                "identified": None if self.identified is None else self.identified.to_dict(),
                "notes": self.notes,
                "versions": self.versions,
            }
        )
        return found

    def plot(self) -> Figure:
        """Draw predictions with their intervals, over what was measured."""
        from receptance.plot.campaign import draw_prediction

        return draw_prediction(self)

    def __repr__(self) -> str:
        counts = f"{len(self.frequencies)} sets of natural frequencies, {len(self.frfs)} FRFs"
        rms = "" if self.rms_percent is None else f", rms {self.rms_percent:.3g} %"
        return f"CampaignPrediction({self.campaign.title!r}, {counts}{rms})"


def predict_campaign(
    campaign: Campaign,
    identified: Identification | None,
    *,
    threads: int | None = None,
    progress: Callable[[str], None] | None = None,
) -> CampaignPrediction:
    """Predict what a campaign holds out or did not measure; see `Campaign.predict`."""
    found = what_can_be_predicted(campaign, identified, threads=threads, progress=progress)
    if not found.frequencies and not found.frfs:
        raise CampaignError.about(campaign.file, "; ".join(found.not_predicted.values()))
    return found


def what_can_be_predicted(
    campaign: Campaign,
    identified: Identification | None,
    *,
    threads: int | None = None,
    progress: Callable[[str], None] | None = None,
) -> CampaignPrediction:
    """Predict what a campaign holds out or did not measure, as far as it can be, and say why the rest cannot."""
    from receptance.provenance import versions

    say = progress or (lambda _: None)
    held_out, unmeasured = campaign.held_out, campaign.unmeasured
    if not held_out and not unmeasured:
        text = 'there is nothing to predict, expected a measurement with the role "hold out" or an assembly without any'
        raise CampaignError.about(campaign.file, text)
    if identified is None and campaign.unknowns:
        identified = campaign.identify(threads=threads, progress=progress)
    propagation = propagation_of(identified)
    notes = list(campaign.notes if identified is None else identified.notes)
    frequencies: list[PredictedFrequencies] = []
    frfs: list[PredictedFRF] = []
    lost: dict[str, str] = {}
    for name, measured in held_out.items():
        say(f"predicting {name}")
        seen = measured.observation
        at = Where(seen.configuration, seen.conditions)
        try:
            assembly = applied(campaign, identified, seen.assembly, name, notes, measured.effects, at)
        except CampaignError as error:
            lost[name] = error.problems[0].text
            continue
        if isinstance(measured.observation, MeasuredFRF):
            frfs.append(_held_out_frf(name, measured, assembly, propagation, at, identified))
        else:
            frequencies.append(_held_out_frequencies(name, measured, assembly, propagation, at))
    for name, assembly in unmeasured.items():
        say(f"predicting {name}")
        at = Where(name, {key: one.value for key, one in campaign.conditions.get(name, {}).items()})
        try:
            assembly = applied(campaign, identified, assembly, name, notes, campaign.effects.get(name, {}), at)
        except CampaignError as error:
            lost[name] = error.problems[0].text
            continue
        found = _unmeasured(name, campaign, assembly, propagation, notes, at)
        frequencies += [found[0]] if found[0] is not None else []
        frfs.append(found[1])
    notes += [f"not predicted: {reason}" for reason in lost.values()]
    wide = [frf.name for frf in frfs if np.nanmax(frf.scatter.total) > _WIDE]
    if wide:
        notes.append(
            f"the bands of {', '.join(wide)} are wide at peaks: they are linear in the errors, so where a peak may "
            "move by more than its width they are only a hint; the intervals of the natural frequencies hold"
        )
    return CampaignPrediction(
        campaign=campaign,
        identified=identified,
        frequencies=tuple(frequencies),
        frfs=tuple(frfs),
        level=campaign.table.prediction.level,
        not_predicted=lost,
        notes=tuple(dict.fromkeys(notes)),
        versions=versions(),
    )


def applied(
    campaign: Campaign,
    identified: Identification | None,
    assembly: Assembly,
    name: str,
    notes: list[str],
    effects: Effects,
    at: Where,
) -> Assembly:
    """Return the assembly with the identified values of the parameters that it has."""
    if identified is None:
        return assembly
    wanted = {address for unknown in identified.task.parameters.wanted for address in unknown.reached}
    tolerances = tolerances_of(effects)
    if any(covered(address, assembly) for address in wanted):
        try:
            assembly = identified.apply(
                assembly, configuration=at.configuration, conditions=at.conditions, tolerances=tolerances
            )
        except ValueError as error:
            raise CampaignError.about(campaign.file, f"{name} cannot be predicted: {error}") from None
    else:
        notes.append(f"{name}: none of the identified parameters is in it")
    asked = [address for unknown in campaign.unknowns for address in unknown.reached]
    rest = [address for address in asked if address not in wanted and covered(address, assembly)]
    if rest:
        notes.append(
            f"{name}: {', '.join(rest)} {'was' if len(rest) == 1 else 'were'} not identified and stays at its start"
        )
    return assembly


def _held_out_frequencies(
    name: str, measured: Measurement, assembly: Assembly, propagation: Propagation, at: Where
) -> PredictedFrequencies:
    seen = measured.observation
    assert not isinstance(seen, MeasuredFRF)
    found, scatter = propagation.frequencies(assembly, seen.modes, float(seen.frequency_hz[-1]), measured.effects, at)
    return PredictedFrequencies(
        name=name,
        assembly=measured.assembly,
        modes=seen.modes,
        predicted_hz=found,
        scatter=scatter,
        measured_hz=seen.frequency_hz,
        measured_deviation_hz=seen.standard_deviation_hz,
    )


def _held_out_frf(
    name: str,
    measured: Measurement,
    assembly: Assembly,
    propagation: Propagation,
    at: Where,
    identified: Identification | None,
) -> PredictedFRF:
    seen = measured.observation
    assert isinstance(seen, MeasuredFRF)
    response, excitation = (SteppedPlace(seen.assembly, one).on(assembly) for one in (seen.response, seen.excitation))
    found, real, imaginary = propagation.receptance(
        assembly, seen.frequency_hz, response, excitation, measured.effects, at, seen.force
    )
    if identified is not None and any(unknown.address in FACTORS for unknown in identified.task.parameters.wanted):
        found = recorded(seen, identified, measured.effects)
    peaks = match_peaks(seen.frequency_hz, seen.receptance, found, seen.standard_deviation)
    deviations = _peak_deviations(peaks, assembly, propagation, measured, at)
    return PredictedFRF(
        name=name,
        assembly=measured.assembly,
        response=seen.response,
        excitation=seen.excitation,
        frequency_hz=seen.frequency_hz,
        receptance=found,
        scatter=real,
        phase_scatter=imaginary,
        measured=seen.receptance,
        measured_deviation=seen.standard_deviation,
        peaks=tuple(peak.with_deviation(one) for peak, one in zip(peaks, deviations, strict=True)),
    )


def recorded(seen: MeasuredFRF, identified: Identification, effects: Effects) -> NDArray[np.complex128]:
    """Return the predicted FRF as the chain would record it that the fit has found: with its gain, delay and window."""
    fresh: list[str] = []
    placed = identified.task.parameters.at(place_of(seen, 0), tolerances_of(effects), fresh)
    values = np.append(np.array(list(identified.values.values())), np.zeros(len(fresh)))
    residual = FRFResidual(seen, Addresses(placed.addresses), "logarithm", None, None).value(placed.values(values))
    real, imaginary = residual.reshape(2, -1)
    found: NDArray[np.complex128] = seen.receptance * np.exp(-real - 1j * imaginary)
    return found


def _peak_deviations(
    peaks: list[Peak], assembly: Assembly, propagation: Propagation, measured: Measurement, at: Where
) -> list[float | None]:
    """Return the standard deviations of predicted peaks, from the nearest natural frequency of the assembly."""
    places = [peak.predicted_hz for peak in peaks if peak.predicted_hz is not None]
    if not places:
        return [None] * len(peaks)
    modes = _counted(assembly, 1.1 * max(places))
    if not modes.size:
        return [None] * len(peaks)
    numbers = tuple(range(1, modes.size + 1))
    _, scatter = propagation.frequencies(assembly, numbers, float(modes[-1]), measured.effects, at)
    return [
        None if p.predicted_hz is None else float(scatter.total[np.abs(modes - p.predicted_hz).argmin()]) for p in peaks
    ]


def _unmeasured(
    name: str, campaign: Campaign, assembly: Assembly, propagation: Propagation, notes: list[str], at: Where
) -> tuple[PredictedFrequencies | None, PredictedFRF]:
    effects = campaign.effects.get(name, {})
    lines = prediction_lines(campaign, assembly)
    modes = _counted(assembly, float(lines[-1]))
    frequencies = None
    if modes.size:
        numbers = tuple(range(1, modes.size + 1))
        found, scatter = propagation.frequencies(assembly, numbers, float(modes[-1]), effects, at)
        frequencies = PredictedFrequencies(name=name, assembly=name, modes=numbers, predicted_hz=found, scatter=scatter)
    elif not assembly.countable:
        notes.append(f"{name}: ends with a spindle as modes, so only its FRF is predicted, not its natural frequencies")
    else:
        notes.append(f"{name}: there is no natural frequency below {lines[-1]:g} Hz")
    places = campaign.places[name]
    asked = campaign.table.prediction.force
    force = None if asked is None else np.full(lines.size, asked)
    receptance, real, imaginary = propagation.receptance(assembly, lines, places[0], places[1], effects, at, force)
    return frequencies, PredictedFRF(
        name=name,
        assembly=name,
        response=places[0],
        excitation=places[1],
        frequency_hz=lines,
        receptance=receptance,
        scatter=real,
        phase_scatter=imaginary,
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
