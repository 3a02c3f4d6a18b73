"""The study of table 3 on the terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from receptance.cli._tables import head, print_sentences, table
from receptance.studies.table3.candidates import half_width_percent
from receptance.studies.table3.findings import findings

if TYPE_CHECKING:
    from rich.console import Console, Group

    from receptance.identification.profiles import Profile
    from receptance.studies.table3.sets import SetVerdict
    from receptance.studies.table3.study import Table3Study

__all__ = ["print_table3"]


def print_table3(console: Console, study: Table3Study) -> None:
    """Print the tables and what follows from them."""
    said: dict[str, list[str]] = {}
    for about, text in findings(study):
        said.setdefault(about, []).append(text)
    head(console, "Table 3 found by the program (VIRTUAL: all measurements are simulated)")
    print_sentences(console, said["virtual"])
    head(console, "What one tip response in the machine says of the joint")
    console.print(_profiles(study, study.profiles, "From the response in the machine alone"))
    print_sentences(console, said["machine"])
    head(console, "The four sets")
    console.print(_sets(study.sets, "In the machine; errors of natural frequencies in percent, * shows as a peak"))
    console.print(_sets(study.free_sets, "Free, with both tests fitted"))
    print_sentences(console, said["sets"])
    head(console, "What to measure next")
    console.print(_expected(study))
    console.print(_profiles(study, study.both_profiles, f"With {study.chosen.name}"))
    print_sentences(console, said["next"])
    versions = ", ".join(f"{name} {value}" for name, value in study.versions.items())
    print_sentences(console, [f"seed {study.settings.seed}; {versions}"])


def _profiles(study: Table3Study, profiles: dict[str, Profile], title: str) -> Group:
    rows = []
    for name, one in profiles.items():
        low = "open" if one.lower_open else f"{one.lower:.3g}"
        high = "open" if one.upper_open else f"{one.upper:.3g}"
        truth = study.machine.truth[name]
        inside = "yes" if one.lower <= truth <= one.upper else "no"
        rows.append((name, f"{truth:.3g}", f"{one.value:.3g}", f"{low} to {high}", inside))
    percent = f"{100.0 * study.settings.level:g} %"
    columns = ("<parameter", "simulated", "found", f"{percent} profile\ninterval", "inside")
    return table(title, columns, rows)


def _sets(verdicts: tuple[SetVerdict, ...], title: str) -> Group:
    modes = verdicts[0].modes
    rows = []
    for one in verdicts:
        errors = [f"{m.percent + 0.0:+.2f}{'*' if m.peak else ' '}" for m in one.modes]
        held = one.held
        fit = ("", "") if held is None else (f"{held.rise:.3g}", "yes" if held.rejected() else "no")
        rows.append((one.name, f"{one.k_y:.3g}", f"{one.k_theta:.3g}", *errors, f"{one.reading_percent:.2f}", *fit))
    frequencies = [f"{mode.true_hz:.0f}\nHz " for mode in modes]
    columns = ("<set", "k_y", "k_theta", *frequencies, "passes by\nhand at [%]", "rise of\n-2 log L", "rejected")
    return table(title, columns, rows)


def _expected(study: Table3Study) -> Group:
    rows = []
    for one in study.expected:
        values = (*one.percent.values(), *one.at_fit.values())
        rows.append((one.candidate.name, *(_percent(value) for value in values)))
    now = [half_width_percent(study.profiles[name]) for name in study.expected[0].percent]
    rows.append(("(nothing more)", "", "", *(_percent(value) for value in now)))
    names = [f"{name}\n{where} [%]" for where in ("widest", "at the fit") for name in study.expected[0].percent]
    title = "Half-width of the interval that a test promises, the widest over three joints that the data allow"
    return table(title, ("<test", *names), rows)


def _percent(value: float) -> str:
    return f"{value:.2g}" if np.isfinite(value) else "open"
