"""Records that determine the joint and a spindle that is unknown."""

from __future__ import annotations

from collections.abc import Iterator

from receptance.campaign.data import CampaignData
from receptance.fit.observation import Observation
from receptance.model.anatomy import Anatomy, anatomy_of


def missing_records(campaign: CampaignData) -> tuple[str, ...]:
    """Return the records that the fit lacks where joint and spindle are both unknown, with the keys to write.

    Records at the tip alone show what joint and spindle do together: a softer spindle looks like a softer joint. A
    record across the joint, hit on one side and measured on the other, shows the motion of both sides of it, and one
    with hit and response on the holder the spindle without the joint.
    """
    unknown = [unknown.address for unknown in campaign.unknowns]
    shapes = {address.partition(".")[0] for address in unknown if address.endswith(".y")}
    joints = {address.partition(".")[0] for address in unknown} - shapes
    records: dict[tuple[str, str], list[tuple[Anatomy, Observation]]] = {}
    for observation in campaign.to_identify.values():
        anatomy = anatomy_of(observation.assembly, unknown)
        if anatomy.holder and anatomy.joint in joints and anatomy.end in shapes:
            records.setdefault((anatomy.joint, anatomy.end), []).append((anatomy, observation))
    return tuple(text for (joint, end), found in records.items() for text in _missing(joint, end, found))


def _missing(joint: str, end: str, records: list[tuple[Anatomy, Observation]]) -> Iterator[str]:
    sides = [
        {_is_on_holder(anatomy, place.part) for place in (observation.response, observation.excitation)}
        for anatomy, observation in records
        if observation.is_receptance
    ]
    tool, holder = records[0][0].tool[0], records[0][0].holder[0]
    unknown = f"{joint} and {end} are both unknown"
    if {True, False} not in sides:
        yield (
            f"{unknown}, and no record is across {joint}: leave the sensor at the tip and hit the holder, "
            f'`response = {{ part = "{tool}" }}` and `excitation = {{ part = "{holder}", position = "4 mm" }}`; for '
            f"`new` this is --response '{tool}@0 mm' --hit '{holder}@4 mm'"
        )
    if {True} not in sides:
        at = f'{{ part = "{holder}", position = "4 mm" }}'
        yield (
            f"{unknown}, and no record has hit and sensor on {holder}, which shows {end} without {joint}: "
            f"`response = {at}` and `excitation = {at}`; for `new` this is --response '{holder}@4 mm' "
            f"--hit '{holder}@4 mm'"
        )


def _is_on_holder(anatomy: Anatomy, part: str) -> bool:
    return part in anatomy.holder
