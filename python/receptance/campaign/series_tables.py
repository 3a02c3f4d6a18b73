"""Tables of a campaign file that stand for one table at each level of a series."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from itertools import pairwise
from typing import TYPE_CHECKING, Any

from receptance._text import did_you_mean, shown
from receptance.campaign.quantities import parse_condition

if TYPE_CHECKING:
    from receptance.campaign.lines import Path
    from receptance.campaign.problems import Problems

__all__ = ["LEVEL", "Spelled", "spelled_out"]

LEVEL = "{level}"
"""What a level is put in the place of, as it is written."""
_VALUE = "{value}"
_SECTIONS = ("assemblies", "measurements")
_NUMBER = re.compile(r"\s*([-+]?[0-9.]+(?:[eE][-+]?[0-9]+)?)")


@dataclass(frozen=True)
class Spelled:
    """A file as if every table of a series had been written out.

    Attributes
    ----------
    data : dict
        The file.
    written : dict
        Section and name of each table, and those under which it stands in the file.
    unknown : frozenset of str
        Sections of which nothing can be known, because the series has a mistake.
    """

    data: dict[str, Any]
    written: dict[Path, Path] = field(default_factory=dict)
    unknown: frozenset[str] = frozenset()


def spelled_out(data: dict[str, Any], problems: Problems) -> Spelled:
    """Return a file with a table for each level in the place of those that stand for all levels.

    Each assembly gets its level as the condition that the series is over; what is measured at a level that is held out
    has that role.
    """
    templates = [
        (section, name)
        for section in _SECTIONS
        for name in _table(data, section)
        if isinstance(name, str) and LEVEL in name
    ]
    series = data.get("series")
    if series is None:
        for path in templates:
            problems.add(path, f"has {LEVEL} in its name, but the file has no `series`, expected one with `levels`")
        return _without(data, templates)
    levels = series.get("levels") if isinstance(series, dict) else None
    over = series.get("over") if isinstance(series, dict) else None
    if not isinstance(over, str) or not isinstance(levels, list) or not all(map(_is_level, levels)) or not levels:
        return _without(data, templates)  # what is wrong with it is said when it is checked
    names = [_name(level) for level in levels]
    if not templates and not _conditioned(data, over):
        text = f"is of nothing: no assembly and no measurement has {LEVEL} in its name, and no assembly the condition"
        problems.add(("series",), f"{text} {shown(over)}")
    for index, name in enumerate(names):
        if name in names[:index]:
            problems.add(("series", "levels", index), f"is {shown(levels[index])}, which is there already")
    _check_units(levels, problems)
    out = series.get("hold_out", [])
    held = [_name(level) for level in out if _is_level(level)] if isinstance(out, list) else []
    for index, name in enumerate(held):
        if name not in names:
            text = f"is {shown(name)}, which is none of the levels{did_you_mean(name, names)}"
            problems.add(("series", "hold_out", index), text)
    found = {key: dict(value) if key in _SECTIONS else value for key, value in data.items()}
    written: dict[Path, Path] = {}
    for section, template in templates:
        table = found[section].pop(template)
        for name in dict.fromkeys(names):
            own = _put(template, name)
            if own in found[section]:
                problems.add((section, template), f"becomes {shown(own)} at a level, and there is one of that name")
                continue
            found[section][own] = _at(section, table, name, over, name in held)
            written[section, own] = (section, template)
    return Spelled(found, written)


def _conditioned(data: Mapping[str, Any], over: str) -> bool:
    """Whether an assembly has the condition of its own, as where the tables of all levels are written out."""
    return any(
        over in _table(one, "conditions") for one in _table(data, "assemblies").values() if isinstance(one, dict)
    )


def _check_units(levels: list[Any], problems: Problems) -> None:
    """Add a mistake for the first level that is another quantity than the one before."""
    try:
        units = [parse_condition(level).unit for level in levels]
    except ValueError:
        return  # said where the level becomes a condition
    for index, (before, unit) in enumerate(pairwise(units), 1):
        if unit != before:
            text = (
                f"is {shown(levels[index])} after {shown(levels[index - 1])}, expected the same quantity at all levels"
            )
            problems.add(("series", "levels", index), text)
            return


def _at(section: str, table: Any, level: str, over: str, held: bool) -> Any:
    own = _filled(table, level)
    if not isinstance(own, dict):
        return own
    if section == "assemblies":
        conditions = own.get("conditions", {})
        if isinstance(conditions, dict):
            own["conditions"] = {over: level, **conditions}
    elif held:
        own.setdefault("role", "hold out")
    return own


def _filled(thing: Any, level: str) -> Any:
    """Return a copy with the level in its texts."""
    if isinstance(thing, str):
        return _put(thing, level)
    if isinstance(thing, list):
        return [_filled(one, level) for one in thing]
    if isinstance(thing, dict):
        return {key: _filled(value, level) for key, value in thing.items()}
    return thing


def _put(text: str, level: str) -> str:
    number = _NUMBER.match(level)
    return text.replace(LEVEL, level).replace(_VALUE, number[1] if number else level)


def _is_level(level: Any) -> bool:
    return isinstance(level, (str, int, float)) and not isinstance(level, bool)


def _name(level: Any) -> str:
    return level if isinstance(level, str) else f"{level:g}"


def _table(data: Mapping[str, Any], section: str) -> Mapping[str, Any]:
    table = data.get(section)
    return table if isinstance(table, dict) else {}


def _without(data: dict[str, Any], templates: list[tuple[str, str]]) -> Spelled:
    found = {key: dict(value) if key in _SECTIONS and isinstance(value, dict) else value for key, value in data.items()}
    for section, name in templates:
        del found[section][name]
    return Spelled(found, unknown=frozenset(section for section, _ in templates))
