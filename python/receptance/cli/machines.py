"""The case studies on two machines on the terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from receptance.cli._tables import head, print_sentences, table
from receptance.studies.machines.findings import findings

if TYPE_CHECKING:
    from rich.console import Console, Group

    from receptance.studies.machines.study import MachineCase, MachinesStudy

__all__ = ["print_machines"]


def print_machines(console: Console, study: MachinesStudy) -> None:
    """Print the tables and what follows from them."""
    said: dict[str, list[str]] = {}
    for about, text in findings(study):
        said.setdefault(about, []).append(text)
    head(console, "Two machines (VIRTUAL: spindles and measurements are simulated)")
    print_sentences(console, said["virtual"])
    head(console, "Spindles from blanks")
    print_sentences(console, said["spindle"])
    head(console, "Medium and long tools")
    for case in study.cases:
        console.print(_tools(case))
    print_sentences(console, said["tools"])
    head(console, "Short tools")
    for case in study.cases:
        console.print(_reach(case))
    print_sentences(console, said["short"])
    head(console, "Two modes close together")
    console.print(_close(study))
    print_sentences(console, said["close"])
    versions = ", ".join(f"{name} {value}" for name, value in study.versions.items())
    print_sentences(console, [f"seed {study.settings.seed}; {versions}"])


def _tools(case: MachineCase) -> Group:
    rows = []
    for tip in case.tips:
        for number, peak in enumerate(tip.peaks):
            name = tip.tool.name if number == 0 else ""
            spread = float(tip.deviation[np.argmin(np.abs(tip.lines - peak.true_hz))])
            values = (peak.frequency_percent, peak.magnitude_percent)
            rows.append((name, f"{peak.true_hz:.0f}", *(_signed(value) for value in values), f"{100.0 * spread:.1f}"))
    columns = ("<tool", "peak [Hz]", "frequency\noff [%]", "height\noff [%]", "stated sd of\nthe height [%]")
    return table(f"{case.machine.name}, VIRTUAL: predicted against the virtual truth", columns, rows)


def _signed(value: float) -> str:
    return f"{value + 0.0:+.2f}" if np.isfinite(value) else "none"


def _reach(case: MachineCase) -> Group:
    rows = [
        (f"{one.low_hz:.0f} to {one.high_hz:.0f}", f"{100.0 * one.usable:.0f}", f"{100.0 * one.deviation:.1f}")
        for one in case.reach
    ]
    columns = ("<band [Hz]", "usable [%]", "median sd [%]")
    return table(f"{case.machine.name}, VIRTUAL: how well the spindle is known", columns, rows)


def _close(study: MachinesStudy) -> Group:
    rows = [
        (
            one.tool.name,
            f"{one.true_hz:.0f}",
            f"{one.apart_percent:+.0f}",
            _signed(one.frequency_percent),
            _signed(one.magnitude_percent),
        )
        for one in sorted(study.displaced, key=lambda one: abs(one.apart_percent))
    ]
    columns = ("<tool", "peak [Hz]", "from the spindle's\nmode [%]", "frequency\noff [%]", "height\noff [%]")
    return table("VIRTUAL: one mode of the spindle is not where it was identified", columns, rows)
