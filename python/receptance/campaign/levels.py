"""Levels of joints in micro-slip, as measurements state them."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from receptance import units
from receptance._text import shown
from receptance.microslip import MicroslipJoint
from receptance.units import parse

if TYPE_CHECKING:
    from receptance.assembly import Assembly
    from receptance.campaign.builder import Builder
    from receptance.campaign.format import CampaignTable
    from receptance.campaign.lines import Path

__all__ = ["at_level", "parse_level"]


def parse_level(written: Any) -> tuple[float, bool]:
    """Return a level, and whether it is a force in N.

    Examples
    --------
    >>> from receptance.campaign.levels import parse_level
    >>> parse_level("50 N"), parse_level(2.0)
    ((50.0, True), (2.0, False))
    """
    if isinstance(written, bool) or not isinstance(written, (str, int, float)):
        raise ValueError(f'is {shown(written)}, expected a number, or a force such as "50 N"')
    if isinstance(written, str):
        return parse(written, units.FORCE), True
    if not 0.0 <= written < float("inf"):
        raise ValueError(f'is {shown(written)}, expected a number from 0 on, or a force such as "50 N"')
    return float(written), False


def at_level(
    path: Path, level: tuple[float, bool] | None, assembly: Assembly, campaign: CampaignTable, builder: Builder
) -> Assembly | None:
    """Return the assembly with its joints in micro-slip at a measurement's level, or None after mistakes are added."""
    if level is None:
        return assembly
    here = (*path, "level")
    amount, is_force = level
    levels: dict[str, float] = {}
    for name in (name for name, of in assembly.elements.items() if isinstance(of, MicroslipJoint)):
        reference = getattr(campaign.joints[name], "reference_force", None)
        if is_force and reference is None:
            text = f'is the force "{amount:g} N", but the joint "{name}" has no `reference_force`; expected one there'
            builder.problems.add(here, text)
            return None
        if f"{name}.level" in campaign.unknowns:
            builder.problems.add(here, f"is given and {name}.level is among the unknowns, expected one of the two")
            return None
        levels[f"{name}.level"] = amount / reference if is_force and reference is not None else amount
    if not levels:
        builder.problems.add(here, 'is given, but no joint of the assembly is of the kind "micro-slip"')
        return None
    return builder.make(here, assembly.replace, levels)
