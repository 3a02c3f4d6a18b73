"""The joints of a campaign line by line, by inverse coupling."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from receptance.campaign.plain import plain
from receptance.campaign.problems import CampaignError
from receptance.campaign.tolerances import tolerances_of_measurements
from receptance.identification import InverseCoupling, MeasuredFRF, invert_coupling
from receptance.identification.line_solutions import TERMS
from receptance.joints import PointJoint
from receptance.modal_parts import ModalPart

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from receptance.campaign.campaign import Campaign
    from receptance.campaign.observations import Measurement

__all__ = ["CampaignInversion", "invert_campaign"]

_ORDER = ("k_theta", "k_y", "k_ytheta")
"""Which terms are solved for first where there are fewer FRFs than terms."""


@dataclass(frozen=True, kw_only=True)
class CampaignInversion:
    """The joints of a campaign line by line.

    Attributes
    ----------
    campaign : Campaign
        What was inverted.
    joints : dict of str to InverseCoupling
        By joint; by joint and assembly, `joint @ assembly`, where the unknowns change from assembly to assembly.
    notes : tuple of str
        What a person should know.
    versions : dict of str to str
        What is needed to do it again.
    """

    campaign: Campaign
    joints: dict[str, InverseCoupling]
    notes: tuple[str, ...]
    versions: dict[str, str]

    def as_dict(self) -> dict[str, Any]:
        """Return the result as what JSON holds."""
        result: dict[str, Any] = plain(
            {
                "campaign": self.campaign.title,
                "file": self.campaign.file.name,
                "joints": {name: found.as_dict() for name, found in self.joints.items()},
                "notes": self.notes,
                "versions": self.versions,
            }
        )
        return result

    def plot(self, name: str | None = None) -> Figure:
        """Draw one of the joints; by default the first."""
        from receptance.plot.inverse_coupling import draw_inverse_coupling

        name = next(iter(self.joints)) if name is None else name
        found = self.joints[name]
        return draw_inverse_coupling(found, f"{name} line by line, from {', '.join(found.labels)}")


def invert_campaign(
    campaign: Campaign,
    *,
    joint: str | None = None,
    limit: float = 0.2,
    threads: int | None = None,
    progress: Callable[[str], None] | None = None,
) -> CampaignInversion:
    """Solve for the joints of a campaign on each line; see `Campaign.invert`."""
    from receptance.studies._provenance import versions

    say = progress or (lambda _: None)
    groups = _groups(campaign, joint)
    found: dict[str, InverseCoupling] = {}
    notes: list[str] = []
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
            found[name] = invert_coupling(
                seen,
                joint=owner,
                terms=[term for term in TERMS if term in terms],
                tolerances=tolerances_of_measurements(measured),
                limit=limit,
                threads=threads,
            )
        except ValueError as error:
            raise CampaignError.about(campaign.file, f"{name}: {error}") from error
        notes += [f"{name}: {note}" for note in found[name].notes]
    return CampaignInversion(campaign=campaign, joints=found, notes=tuple(dict.fromkeys(notes)), versions=versions())


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
