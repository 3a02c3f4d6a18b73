"""Rankings of candidates on the terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from rich.padding import Padding
from rich.text import Text

from receptance.cli._tables import head, table

if TYPE_CHECKING:
    from rich.console import Console

    from receptance.campaign import CampaignNext
    from receptance.identification import Expectation

__all__ = ["print_next"]


def print_next(console: Console, found: CampaignNext) -> None:
    """Print the ranking, and for each target the interval now and with each candidate."""
    head(console, f"{found.campaign.title}: which measurement next")
    ranking = found.found.ranking
    priced = len({one.candidate.cost for one in ranking}) > 1
    rows = [
        [str(place), one.label, one.candidate.configuration, f"{100.0 * one.shrink:.3g}", f"{one.candidate.cost:g}"]
        for place, one in enumerate(ranking, start=1)
    ]
    columns = ["", "<candidate", "<assembly", "deviations expected\n[% of now]", "cost"]
    count = len(columns) if priced else len(columns) - 1
    console.print(table("The best first", columns[:count], [row[:count] for row in rows]))
    level = f"{100.0 * found.found.level:g} % interval"
    rows = []
    for name in found.found.targets:
        first = ranking[0].expected[name]
        rows.append([name, "now", _ends(first, first.now), "", ""])
        for one in ranking:
            e = one.expected[name]
            half = f"{e.percent:.2g}" if e.value != 0.0 else f"{100.0 * e.deviation:.2g}"
            open_ = f"{100.0 * e.stays_open:.0f}" if e.stays_open else ""
            rows.append(["", f"with {one.label}", _ends(e, (e.lower, e.upper)), half, open_])
    columns = ["<target", "<", f"{level}, SI units", "half of it\n[%]", "chance that it\nstays open [%]"]
    if not any(row[4] for row in rows):
        columns, rows = columns[:4], [row[:4] for row in rows]
    console.print(table("Intervals now and as expected, about the value of now", columns, rows))
    _notes(console, found.found.notes)
    console.print(_versions(found.versions))


def _ends(e: Expectation, ends: tuple[float, float]) -> str:
    low, high = ends
    form = ".1f" if e.name.endswith("[Hz]") else ".4g"
    if np.isinf(high):
        return "open" if low in (0.0, -np.inf) else f"{low:{form}} on"
    if e.scale == "log" and low == 0.0:
        return f"up to {high:{form}}"
    return f"{low:{form}} to {high:{form}}"


def _notes(console: Console, notes: tuple[str, ...]) -> None:
    if not notes:
        return
    console.print(Text("Notes", style="bold"))
    for note in notes:
        console.print(Padding(Text(note), (0, 0, 0, 2), expand=False))
    console.print()


def _versions(versions: dict[str, str]) -> Text:
    return Text(", ".join(f"{name} {value}" for name, value in versions.items()))
