"""All measurements of a campaign, each assembly predicted from the others."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from receptance.campaign.identification import band_width_percent
from receptance.campaign.prediction import what_can_be_predicted
from receptance.campaign.problems import CampaignError
from receptance.campaign.propagation import tolerances_of
from receptance.identification import (
    PredictedReceptance,
    Split,
    Transfer,
    TransferredFRF,
    TransferredMode,
    transfer,
)
from receptance.identification.spread import quantile
from receptance.identification.transfer import groups_of
from receptance.identification.unknowns import covered
from receptance.report.plain import plain

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from receptance.campaign.campaign import Campaign
    from receptance.campaign.comparison import PredictedFrequencies, PredictedFRF

__all__ = ["CampaignTransfer", "transfer_campaign"]

Splits = Literal["leave-one-out", "one-for-all"]


@dataclass(frozen=True, kw_only=True)
class CampaignTransfer:
    """Predictions of every assembly of a campaign from the others.

    Attributes
    ----------
    campaign : Campaign
        What was measured.
    found : Transfer
        Predictions beside measurements, by split; configurations are the assemblies of the campaign.
    notes : tuple of str
        What a person should know.
    versions : dict of str to str
        What is needed to do it again.
    """

    campaign: Campaign
    found: Transfer
    notes: tuple[str, ...]
    versions: dict[str, str]

    def as_dict(self) -> dict[str, Any]:
        """Return the result as what JSON holds."""
        found: dict[str, Any] = plain(
            {
                "campaign": self.campaign.title,
                "file": self.campaign.file.name,
                **self.found.as_dict(),
                "notes": self.notes,
                "settings": self.campaign.table.settings.model_dump(),
                "versions": self.versions,
            }
        )
        return found

    def plot(self) -> Figure:
        """Draw errors of the natural frequencies with their intervals, and receptances with their bands."""
        return self.found.plot(self.campaign.title)

    def __repr__(self) -> str:
        return f"CampaignTransfer({self.campaign.title!r}, {self.found!r})"


def transfer_campaign(
    campaign: Campaign,
    *,
    splits: Splits = "leave-one-out",
    draws: int = 200,
    threads: int | None = None,
    progress: Callable[[str], None] | None = None,
) -> CampaignTransfer:
    """Predict every measured assembly from the others; see `Campaign.transfer`."""
    from receptance.provenance import versions

    if not campaign.unknowns:
        raise CampaignError.about(campaign.file, "there is nothing to identify, expected `unknowns`")
    if len({one.assembly for one in campaign.measurements.values()}) < 2:
        text = "fewer than two assemblies were measured, expected two or more to predict one from the others"
        raise CampaignError.about(campaign.file, text)
    notes = list(campaign.notes)
    if any(one.held_out for one in campaign.measurements.values()):
        notes.append('measurements with the role "hold out" are used like the others: each assembly is held out once')
    say = progress or (lambda _: None)
    try:
        if campaign.table.settings.tolerances == "fit":
            found = _fitted(campaign, splits, draws, threads, say)
        else:
            found = _propagated(campaign, splits, threads, say)
    except CampaignError:
        raise
    except ValueError as error:
        raise CampaignError.about(campaign.file, str(error)) from error
    return CampaignTransfer(campaign=campaign, found=found, notes=tuple(dict.fromkeys(notes)), versions=versions())


def _fitted(
    campaign: Campaign, splits: Splits, draws: int, threads: int | None, say: Callable[[str], None]
) -> Transfer:
    """Fit errors of dimensions and materials along, with the tolerances as their priors."""
    measured, settings = campaign.measurements, campaign.table.settings
    return transfer(
        [one.observation.configured(one.assembly, one.observation.conditions) for one in measured.values()],
        campaign.unknowns,
        tolerances=[error for name, one in measured.items() for error in tolerances_of(one.effects, name)],
        splits=splits,
        level=campaign.table.prediction.level,
        draws=draws,
        seed=settings.seed,
        progress=say,
        objective=settings.objective,
        band_width_percent=band_width_percent(settings),
        starts=settings.starts,
        max_evaluations=settings.max_evaluations,
        threads=threads,
        strategy=settings.strategy,
    )


def _propagated(campaign: Campaign, splits: Splits, threads: int | None, say: Callable[[str], None]) -> Transfer:
    """Fit dimensions and materials as exact, and let the tolerances widen the intervals, in every split."""
    names = tuple(dict.fromkeys(one.assembly for one in campaign.measurements.values()))
    # Assemblies that were not measured, and profiles, have no part in it.
    settings = campaign.table.settings.model_copy(update={"profiles": False})
    bare = replace(
        campaign,
        table=campaign.table.model_copy(update={"settings": settings}),
        assemblies={name: campaign.assemblies[name] for name in names},
    )
    found = []
    for group in groups_of(splits, names):
        say(f"holding out {', '.join(group)}")
        found.append(_predicted(bare, group, threads))
    return Transfer(splits=tuple(found), level=campaign.table.prediction.level, seed=settings.seed, propagated=True)


def _predicted(campaign: Campaign, group: tuple[str, ...], threads: int | None) -> Split:
    measured = campaign.measurements
    kept = [one.observation.assembly for one in measured.values() if one.assembly not in group]
    lost = [u.address for u in campaign.unknowns if not any(covered(u.address, assembly) for assembly in kept)]
    reasons, roles = [], {}
    for name, one in measured.items():
        missing = [address for address in lost if covered(address, one.observation.assembly)]
        if one.assembly in group and missing:
            reasons.append(f"{name}: {', '.join(missing)} in no assembly that is left")
            continue
        roles[name] = replace(one, role="hold out" if one.assembly in group else "identify")
    own = replace(
        campaign,
        measurements=roles,
        assemblies={one.assembly: campaign.assemblies[one.assembly] for one in roles.values()},
    )
    fit, modes, frfs = None, [], []
    if own.held_out:
        prediction = what_can_be_predicted(own, own.identify(threads=threads), threads=threads)
        fit = prediction.identified
        reasons += prediction.not_predicted.values()
        freedom = None if fit is None or fit.known_scatter else fit.degrees_of_freedom
        reach = quantile(prediction.level, freedom)
        for listed in prediction.frequencies:
            modes += _modes(listed, reach)
        for frf in prediction.frfs:
            frfs.append(_frf(frf, prediction.level))
            modes += _peaks(frf, reach)
    return Split(
        held_out=group,
        fitted=tuple(dict.fromkeys(one.assembly for one in own.to_identify.values())),
        identified=fit,
        modes=tuple(modes),
        frfs=tuple(frfs),
        not_predicted=tuple(reasons),
    )


def _modes(one: PredictedFrequencies, reach: float) -> list[TransferredMode]:
    if one.measured_hz is None:
        return []
    reading = np.zeros(len(one.modes)) if one.measured_deviation_hz is None else one.measured_deviation_hz
    columns = (one.modes, one.measured_hz, one.predicted_hz, one.scatter.total, reading)
    return [
        TransferredMode(
            configuration=one.assembly,
            label=one.name,
            mode=mode,
            measured_hz=float(measured),
            predicted_hz=float(predicted),
            deviation_hz=float(deviation),
            reading_hz=float(spread),
            reach=reach,
        )
        for mode, measured, predicted, deviation, spread in zip(*columns, strict=True)
    ]


def _frf(one: PredictedFRF, level: float) -> TransferredFRF:
    assert one.measured is not None
    lines = one.frequency_hz
    return TransferredFRF(
        configuration=one.assembly,
        label=one.name,
        measured=one.measured,
        noise=np.zeros(lines.size) if one.measured_deviation is None else one.measured_deviation,
        predicted=PredictedReceptance(
            frequency_hz=lines,
            receptance=one.receptance,
            deviation=one.scatter.total,
            phase_deviation=one.phase_scatter.total,
            drawn=np.empty((0, lines.size)),
        ),
        level=level,
    )


def _peaks(one: PredictedFRF, reach: float) -> list[TransferredMode]:
    return [
        TransferredMode(
            configuration=one.assembly,
            label=one.name,
            mode=None,
            measured_hz=peak.measured_hz,
            predicted_hz=peak.predicted_hz,
            deviation_hz=peak.deviation_hz,
            reading_hz=peak.measured_deviation_hz,
            reach=reach,
        )
        for peak in one.peaks
        if peak.measured_hz is not None
    ]
