"""The joints of a campaign line by line, by inverse coupling."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING

from receptance.campaign.problems import CampaignError
from receptance.campaign.tolerances import tolerances_of_measurements
from receptance.identification import InverseCoupling, InverseCouplings, MeasuredFRF, invert_coupling
from receptance.identification.line_solutions import TERMS
from receptance.joints import PointJoint
from receptance.modal_parts import ModalPart

if TYPE_CHECKING:
    from receptance.campaign.campaign import Campaign
    from receptance.campaign.observations import Measurement

__all__ = ["invert_campaign"]

_ORDER = ("k_theta", "k_y", "k_ytheta")
"""Which terms are solved for first where there are fewer FRFs than terms."""


def invert_campaign(
    campaign: Campaign,
    *,
    joint: str | None = None,
    limit: float = 0.2,
    threads: int | None = None,
    progress: Callable[[str], None] | None = None,
) -> InverseCouplings:
    """Solve for the joints of a campaign on each line; see `Campaign.invert`."""
    say = progress or (lambda _: None)
    groups = _groups(campaign, joint)
    found: dict[str, InverseCoupling] = {}
    notes: list[str] = []
    provenance = campaign.provenance()
    for name, (owner, measured) in groups.items():
        say(f"solving for {name}")
        wanted = [t for t in _ORDER if f"{owner}.{t}" in campaign.table.unknowns]
        terms = wanted[: len(measured)]
        if len(terms) < len(wanted):
            left = ", ".join(f"{owner}.{term}" for term in wanted[len(terms) :])
            notes.append(
                f"{name}: {len(measured)} FRF{'' if len(measured) == 1 else 's'} can give as many terms on each line; "
                f"{left} is held at its start"
            )
        seen = [one.observation for one in measured.values() if isinstance(one.observation, MeasuredFRF)]
        try:
            one = invert_coupling(
                seen,
                joint=owner,
                terms=[term for term in TERMS if term in terms],
                tolerances=tolerances_of_measurements(measured),
                limit=limit,
                threads=threads,
            )
        except ValueError as error:
            raise CampaignError.about(campaign.file, f"{name}: {error}") from error
        found[name] = replace(one, name=name, provenance=provenance)
        notes += [f"{name}: {note}" for note in one.notes]
    return InverseCouplings(found, provenance=provenance, notes=tuple(dict.fromkeys(notes)))


def _groups(campaign: Campaign, joint: str | None) -> dict[str, tuple[str, dict[str, Measurement]]]:
    """Return by name the joint and the FRFs that see it, of one assembly where it changes between them."""
    unknown = campaign.table.unknowns
    owners = list(dict.fromkeys(a.split(".", 1)[0] for a in unknown if a.split(".", 1)[-1] in TERMS))
    owners = [name for name in owners if joint is None or name == joint]
    groups: dict[str, tuple[str, dict[str, Measurement]]] = {}
    for owner in owners:
        own = [unknown[a] for a in unknown if a.startswith(f"{owner}.")]
        changing = any(one.free or one.power_of or one.individual for one in own)
        for name, one in campaign.to_identify.items():
            if not isinstance(one.observation, MeasuredFRF):
                continue
            if not isinstance(one.observation.assembly.elements.get(owner), PointJoint):
                continue
            ends = [name for name, end in one.observation.assembly.elements.items() if isinstance(end, ModalPart)]
            if any(address.startswith(f"{ends[0]}.") for u in campaign.unknowns for address in u.reached if ends):
                raise CampaignError.about(
                    campaign.file,
                    f"{ends[0]}, the modal part behind {owner}, has unknowns, and inverse coupling needs its "
                    "receptance; identify the campaign instead, or write the identified modes into the file "
                    "and leave them out of the unknowns",
                )
            title = f"{owner} @ {one.assembly}" if changing else owner
            groups.setdefault(title, (owner, {}))[1][name] = one
    if not groups:
        which = "point joint" if joint is None else f'joint "{joint}"'
        raise CampaignError.about(
            campaign.file, f"no {which} with unknown stiffnesses was measured with an FRF for identification"
        )
    return groups
