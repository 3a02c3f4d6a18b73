"""All measurements of a campaign, each assembly predicted from the others."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

from receptance.campaign.identification import fit_options, weighable_tolerances
from receptance.campaign.plain import plain
from receptance.campaign.problems import CampaignError
from receptance.identification import Transfer, transfer

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from receptance.campaign.campaign import Campaign

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
    from receptance.studies._provenance import versions

    if not campaign.unknowns:
        raise CampaignError.about(campaign.file, "there is nothing to identify, expected `unknowns`")
    if len({one.assembly for one in campaign.measurements.values()}) < 2:
        text = "fewer than two assemblies were measured, expected two or more to predict one from the others"
        raise CampaignError.about(campaign.file, text)
    notes = list(campaign.notes)
    if any(one.held_out for one in campaign.measurements.values()):
        notes.append('measurements with the role "hold out" are used like the others: each assembly is held out once')
    measured, settings = campaign.measurements, campaign.table.settings
    tolerances = weighable_tolerances(campaign, measured)
    observations = [one.observation.configured(one.assembly, one.observation.conditions) for one in measured.values()]
    say = progress or (lambda _: None)
    _, unknowns, options = fit_options(campaign, observations, campaign.unknowns, threads=threads, say=say)
    try:
        found = transfer(
            observations,
            unknowns,
            tolerances=tolerances,
            splits=splits,
            level=campaign.table.prediction.level,
            draws=draws,
            seed=settings.seed,
            progress=progress,
            **options,
        )
    except ValueError as error:
        raise CampaignError.about(campaign.file, str(error)) from error
    return CampaignTransfer(campaign=campaign, found=found, notes=tuple(dict.fromkeys(notes)), versions=versions())
