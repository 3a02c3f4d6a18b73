"""Inverse coupling of a campaign: the joints and FRFs that it allows, and their solutions."""

from __future__ import annotations

from dataclasses import replace

from receptance.campaign.data import CampaignData
from receptance.campaign.problems import CampaignError, errors_about
from receptance.coupling import InverseCoupling, InverseCouplings, invert_coupling
from receptance.coupling.line_equations import TERMS
from receptance.fit.observation import Observation
from receptance.model.joints import PointJoint
from receptance.model.terminals import ModalPart

_ORDER = ("k_theta", "k_y", "k_ytheta")
"""Terms of a joint in the order in which they are solved for if there are fewer FRFs than terms."""


def invert_campaign(campaign: CampaignData, joint: str | None, limit: float) -> InverseCouplings:
    """Solve for the stiffness of joints on each frequency line; see `Campaign.invert`."""
    groups = joints_to_invert(campaign, joint)
    found: dict[str, InverseCoupling] = {}
    notes: list[str] = []
    provenance = campaign.provenance()
    for name, (owner, measured) in groups.items():
        campaign.progress(f"solving for {name}, {len(found) + 1} of {len(groups)}")
        unknown = [t for t in _ORDER if f"{owner}.{t}" in campaign.table.unknowns]
        terms = unknown[: len(measured)]
        if len(terms) < len(unknown):
            left = ", ".join(f"{owner}.{term}" for term in unknown[len(terms) :])
            count = f"{len(measured)} FRF{'' if len(measured) == 1 else 's'}"
            notes.append(
                f"{name}: {count} can determine as many terms on each line; {left} is fixed at its start value"
            )
        with errors_about(campaign.file, f"{name}: "):
            one = invert_coupling(
                list(measured.values()),
                joint=owner,
                terms=[term for term in TERMS if term in terms],
                tolerances=campaign.errors_of(measured),
                limit=limit,
                threads=campaign.threads,
            )
        found[name] = replace(one, name=name, provenance=provenance)
        notes += [f"{name}: {note}" for note in one.notes]
    return InverseCouplings(found, provenance=provenance, notes=tuple(dict.fromkeys(notes)))


def joints_to_invert(campaign: CampaignData, joint: str | None = None) -> dict[str, tuple[str, dict[str, Observation]]]:
    """Return by name a joint and its FRFs; joints that differ between assemblies are listed for each assembly."""
    unknown = campaign.table.unknowns
    owners = list(dict.fromkeys(a.split(".", 1)[0] for a in unknown if a.split(".", 1)[-1] in TERMS))
    owners = [name for name in owners if joint is None or name == joint]
    groups: dict[str, tuple[str, dict[str, Observation]]] = {}
    for owner in owners:
        own = [unknown[a] for a in unknown if a.startswith(f"{owner}.")]
        changing = any(one.free or one.power_of or one.individual for one in own)
        for name, one in campaign.to_identify.items():
            if not one.is_receptance or not isinstance(one.assembly.elements.get(owner), PointJoint):
                continue
            ends = [name for name, end in one.assembly.elements.items() if isinstance(end, ModalPart)]
            if any(address.startswith(f"{ends[0]}.") for u in campaign.unknowns for address in u.addresses if ends):
                raise CampaignError.about(
                    campaign.file,
                    f"{ends[0]}, the modal part behind {owner}, has unknowns, but inverse coupling needs its "
                    "receptance; identify the campaign instead, or write the identified modes into the file "
                    "and remove them from the unknowns",
                )
            title = f"{owner} @ {one.configuration}" if changing else owner
            groups.setdefault(title, (owner, {}))[1][name] = one
    if not groups:
        which = "point joint" if joint is None else f'joint "{joint}"'
        raise CampaignError.about(
            campaign.file, f"no {which} with unknown stiffnesses was measured with an FRF for identification"
        )
    return groups
