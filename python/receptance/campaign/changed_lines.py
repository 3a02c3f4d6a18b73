"""Lines that add the explanation of a diagnosis to a campaign file."""

from __future__ import annotations

import re
import warnings
from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from receptance.campaign.write import extended_data
from receptance.errors import ReceptanceWarning

if TYPE_CHECKING:
    from receptance.campaign.run import Campaign
    from receptance.diagnosis import Verdict

__all__ = ["changed_lines", "with_campaign_lines"]

_OWN = ("title", "description", "settings")
"""Keys that every extended campaign has of its own."""
_LONG = re.compile(r"^(-?\d[\d.]*(?:e[-+]?\d+)?)(?= |$)")


def with_campaign_lines(campaign: Campaign, verdict: Verdict) -> Verdict:
    """Return the verdict with the lines that add its explanation to the file; without them if there are none."""
    if verdict.explanation is None or not verdict.final:
        return verdict
    with warnings.catch_warnings():
        # Warnings on the data were given when they were read.
        warnings.simplefilter("ignore", ReceptanceWarning)
        try:
            return replace(verdict, campaign_lines=changed_lines(campaign, verdict))
        except ValueError:
            return verdict


def changed_lines(campaign: Campaign, verdict: Verdict) -> tuple[str, ...]:
    """Return the lines in which the extended model of a diagnosis differs from the campaign file.

    They are what `extended_text` writes without roles and start values of the unknowns that the campaign has. Numbers
    have six digits. Measurements with the same lines share them.

    Parameters
    ----------
    campaign : Campaign
        The campaign.
    verdict : Verdict
        Result of its diagnosis.

    Raises
    ------
    ValueError
        There is no extended model, or a campaign file cannot describe it.
    """
    import tomli_w

    before = {key: value for key, value in campaign.contents.items() if key not in _OWN}
    after = {
        key: value for key, value in extended_data(campaign, verdict, campaign.file.parent).items() if key not in _OWN
    }
    for name, table in after["measurements"].items():
        given = before["measurements"][name]
        table.pop("role", None)
        if "role" in given:
            table["role"] = given["role"]
    for name, table in after.get("unknowns", {}).items():
        if "start" in table and (given := before.get("unknowns", {}).get(name)) is not None:
            table.pop("start")
            table |= {"start": given["start"]} if "start" in given else {}
    changed = _shortened(_changes(before, after))
    lines: list[str] = []
    for name, others in _alike(changed.get("measurements", {})).items():
        own = tomli_w.dumps({"measurements": {name: changed["measurements"].pop(name)}}).splitlines()
        for other in others:
            del changed["measurements"][other]
        lines += [*own[:1], *([f"# the same for {', '.join(others)}"] if others else []), *own[1:]]
    return (*(line for line in tomli_w.dumps({k: v for k, v in changed.items() if v}).splitlines() if line), *lines)


def _changes(before: Mapping[str, Any], after: Mapping[str, Any]) -> dict[str, Any]:
    """Return the keys whose values are new or different, tables key by key."""
    found: dict[str, Any] = {}
    for key, value in after.items():
        old = before.get(key)
        if isinstance(value, dict) and isinstance(old, dict):
            inner = _changes(old, value)
            if inner:
                found[key] = inner
        elif value != old:
            found[key] = value
    return found


def _alike(tables: Mapping[str, Any]) -> dict[str, list[str]]:
    """Return the names of the tables with the same contents, by the first of them."""
    found: dict[str, list[str]] = {}
    for name, table in tables.items():
        first = next((one for one in found if tables[one] == table), None)
        if first is None:
            found[name] = []
        else:
            found[first].append(name)
    return found


def _shortened(value: Any) -> Any:
    """Return values with numbers of six digits, those in texts included."""
    if isinstance(value, dict):
        return {key: _shortened(one) for key, one in value.items()}
    if isinstance(value, list):
        return [_shortened(one) for one in value]
    if isinstance(value, float):
        return float(f"{value:.6g}")
    if isinstance(value, str):
        return _LONG.sub(lambda match: f"{float(match[1]):.6g}", value)
    return value
