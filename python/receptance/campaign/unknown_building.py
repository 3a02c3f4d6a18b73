"""From the unknowns of a campaign to those of a fit: parameters, laws across assemblies, and what moves several."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from receptance.campaign.addresses import kind_of
from receptance.campaign.conditions import parse_condition
from receptance.campaign.joint_building import given
from receptance.campaign.priors import prior_of
from receptance.campaign.quantities import parse_share
from receptance.identification.laws import Law, Move, Power
from receptance.identification.unknowns import Unknown
from receptance.units import Quantity, parse

if TYPE_CHECKING:
    from receptance.campaign.lines import Path
    from receptance.campaign.measurement_models import CampaignTable, UnknownTable
    from receptance.campaign.workshop import Workshop

__all__ = ["addresses_of", "build_unknown"]

_PLAIN = Quantity("a number", "", "0.02")
_LAW = ("power_of", "free", "individual")


def addresses_of(unknown: Unknown) -> tuple[str, ...]:
    """Return the addresses whose value it is; what only moves them has none."""
    return () if isinstance(unknown, Move) else unknown.reached


def build_unknown(address: str, table: UnknownTable, campaign: CampaignTable, workshop: Workshop) -> Unknown | None:
    """Return an unknown, or None after its mistakes are added."""
    path: Path = ("unknowns", address)
    if workshop.problems.at(path):
        return None
    plain = bool(table.moves) or table.multiple is not None
    kind = _PLAIN if plain else workshop.make(path, kind_of, address)
    if kind is None:
        return None
    values: dict[str, float | None] = {}
    for key in ("lower", "upper", "start"):
        written = getattr(table, key)
        values[key] = None if written is None else workshop.make((*path, key), parse, written, kind)
    lower, upper, start = values["lower"], values["upper"], values["start"]
    if lower is None or upper is None or workshop.problems.at(path):
        return None
    if start is None and not plain:
        start = given(address, campaign)
        if start is not None and not lower <= start <= upper:
            workshop.problems.add(
                path,
                f"has bounds without the {start:g} that the joint is given, expected wider bounds or another start",
            )
            return None
    fields = {"address": address, "lower": lower, "upper": upper, "start": start, "scale": table.scale}
    fields |= {"name": table.name, "configurations": None if table.assemblies is None else tuple(table.assemblies)}
    if table.prior is not None:
        logarithmic = table.scale == "log" or (table.scale is None and lower > 0.0 and not table.moves)
        fields["prior"] = workshop.make((*path, "prior"), prior_of, kind, table.prior, logarithmic)
        if fields["prior"] is None:
            return None
    if table.moves:
        return _move(path, table, {**fields, "name": table.name or address}, workshop)
    fields |= {"multiple": 1.0 if table.multiple is None else table.multiple, "also": table.also}
    if table.relative:
        workshop.problems.add((*path, "relative"), "is given, but nothing that it `moves`")
        return None
    if table.along is not None and not table.free:
        workshop.problems.add((*path, "along"), "is given, but it is not `free`, expected `free = true` beside it")
        return None
    if not any(getattr(table, key) for key in _LAW):
        if table.reference is not None or table.exponent is not None:
            workshop.problems.add(path, "has a reference or an exponent, but no `power_of`")
            return None
        if table.follows:
            workshop.problems.add((*path, "follows"), "is given, but it has no `power_of` and no `individual` part")
            return None
        return workshop.make(path, Unknown, **fields)
    if table.free:
        fields["along"] = table.along or (campaign.series.over if campaign.series is not None else "")
    return _law(path, table, fields, workshop)


def _move(path: Path, table: UnknownTable, fields: dict[str, Any], workshop: Workshop) -> Move | None:
    wrong = [key for key in ("multiple", "also", "free", "individual", "follows", "exponent") if getattr(table, key)]
    if wrong:
        workshop.problems.add((*path, wrong[0]), "is given with `moves`, expected one of the two")
        return None
    reference = 1.0
    if table.power_of is not None:
        found = _reference(path, table, workshop)
        if found is None:
            return None
        reference = found
    return workshop.make(
        path, Move, **fields, moves=table.moves, relative=table.relative, of=table.power_of or "", reference=reference
    )


def _reference(path: Path, table: UnknownTable, workshop: Workshop) -> float | None:
    if table.reference is None:
        workshop.problems.add(path, "has a `power_of` but no `reference`, expected a value of that condition")
        return None
    found = workshop.make((*path, "reference"), parse_condition, table.reference)
    return None if found is None else found.value


def _law(path: Path, table: UnknownTable, fields: dict[str, Any], workshop: Workshop) -> Law | None:
    powers: tuple[Power, ...] = ()
    if table.power_of is not None:
        reference = _reference(path, table, workshop)
        if reference is None:
            return None
        lower, upper = table.exponent or (-4.0, 4.0)
        power = workshop.make(path, Power, of=table.power_of, reference=reference, lower=lower, upper=upper)
        if power is None:
            return None
        powers = (power,)
    individual = 0.0
    if table.individual is not None:
        share = workshop.make((*path, "individual"), parse_share, table.individual, 'a percentage such as "5 %"')
        if share is None:
            return None
        individual = share
    return workshop.make(
        path, Law, **fields, powers=powers, free=table.free, individual=individual, follows=table.follows
    )
