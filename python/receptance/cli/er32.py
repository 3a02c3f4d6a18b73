"""The ER32 study on the terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from receptance.cli._tables import ends, head, print_sentences, table
from receptance.studies.er32.findings import findings
from receptance.studies.er32.tables import SOURCE

if TYPE_CHECKING:
    from rich.console import Console, Group

    from receptance.studies.er32.study import ER32Study
    from receptance.studies.er32.trends import Step

__all__ = ["print_er32"]

_CAUSES = 6


def print_er32(console: Console, study: ER32Study) -> None:
    """Print the tables and what follows from them."""
    said: dict[str, list[str]] = {}
    for about, text in findings(study):
        said.setdefault(about, []).append(text)
    head(console, "ER32 collet holder: the joint from printed natural frequencies")
    print_sentences(console, [SOURCE + "."])
    parts = (
        ("holder", "The holder, inferred", _holder),
        ("joint", "The joint of every tool at every torque (table 4)", _joints),
        ("transfer", "Other overhangs (table 2)", _transfers),
        ("parameter sets", "Four joints that match the machine's tip FRF (table 3)", _sets),
        ("trends", "Stiffness over torque and diameter", _trends),
        ("bias", "The first mode of the long tools", _bias),
    )
    for about, title, make in parts:
        head(console, title)
        for item in make(study):
            console.print(item)
        print_sentences(console, said[about])
    head(console, "The paper's own numbers")
    print_sentences(console, said["paper"])
    head(console, "In short")
    print_sentences(console, _summary(study))


def _summary(study: ER32Study) -> list[str]:
    k_y = max(abs(j.k_y_difference_percent) for j in study.identified)
    k_theta = max(abs(j.k_theta_difference_percent) for j in study.identified)
    betrayed = [verdict.name for verdict in study.parameter_sets if verdict.betrayed_by]
    found = ", ".join(f"{name} {value}" for name, value in study.versions.items())
    return [
        f"published predictions: {study.published_predictions_rms_percent:.2f} % rms; measured transfers: "
        f"{study.transfer_rms_percent:.2f} % rms (paper {study.published_transfer_rms_percent:.2f} %)",
        f"identified joints against the paper's: k_y within {k_y:.1f} %, k_theta within {k_theta:.1f} %",
        f"parameter sets betrayed by some mode: {', '.join(betrayed) or 'none'}",
        f"long tools' first mode: {study.bias.mean_percent:+.2f} % on average, p = {study.bias.p_value:.2g} under the "
        "stated chance",
        f"seed {study.settings.seed}; {found}",
    ]


def _holder(study: ER32Study) -> list[Group]:
    consistency = study.consistency
    rows = [
        (
            q.name,
            f"{q.value:.5g} {q.unit}",
            f"{q.standard_error_percent:.3g}",
            "at a bound of the fit" if q.at_bound else "",
        )
        for q in consistency.quantities
    ]
    title = (
        f"Inferred from {consistency.frequencies} frequencies, with the standard errors that these alone would leave"
    )
    return [table(title, ("<quantity", "value", "standard error [%]", "<"), rows)]


def _joints(study: ER32Study) -> list[Group]:
    rows = [
        (
            f"{j.diameter_mm:g}",
            f"{j.torque_nm:g}",
            f"{j.k_y:.3e}",
            ends(j.k_y_interval, ".3e"),
            f"{j.published_k_y:.2e}",
            f"{j.k_y_difference_percent:+.1f}",
            f"{j.k_theta:.3e}",
            ends(j.k_theta_interval, ".3e"),
            f"{j.published_k_theta:.2e}",
            f"{j.k_theta_difference_percent:+.1f}",
        )
        for j in study.identified
    ]
    columns = (
        "d\n[mm]",
        "torque\n[N m]",
        "k_y\n[N/m]",
        "interval",
        "paper",
        "[%]",
        "k_theta\n[N m/rad]",
        "interval",
        "paper",
        "[%]",
    )
    return [table("Identified from two natural frequencies each; percent against the paper", columns, rows)]


def _transfers(study: ER32Study) -> list[Group]:
    rows = [
        (
            f"{ours.diameter_mm:g}",
            f"{ours.overhang_mm:g}",
            str(ours.mode),
            f"{ours.measured_hz:.0f}",
            f"{ours.published_hz:.0f}",
            f"{ours.published_error_percent:+.2f}",
            f"{ours.predicted_hz:.1f}",
            f"{ours.error_percent:+.2f}",
            f"{theirs.predicted_hz:.1f}",
            f"{theirs.against_published_percent:+.2f}",
        )
        for ours, theirs in zip(study.transfers, study.published_predictions, strict=True)
    ]
    columns = (
        "d\n[mm]",
        "overhang\n[mm]",
        "mode",
        "measured\n[Hz]",
        "paper\n[Hz]",
        "error\n[%]",
        "ours\n[Hz]",
        "error\n[%]",
        "with the paper's\njoint [Hz]",
        "against its\nprediction [%]",
    )
    return [table("Natural frequencies, free assembly", columns, rows)]


def _sets(study: ER32Study) -> list[Group]:
    sets = study.parameter_sets
    rows = []
    for i, first in enumerate(sets[0].errors):
        cells = [f"{first.overhang_mm:g}", str(first.mode), f"{first.measured_hz:.0f}"]
        for verdict in sets:
            error = verdict.errors[i]
            cells += [
                f"{error.predicted_hz:.0f}",
                f"{error.percent:+.1f}{'*' if error in verdict.betrayed_by else ' '}",
            ]
        rows.append(cells)
    columns = ["overhang\n[mm]", "mode", "measured\n[Hz]"]
    for verdict in sets:
        columns += [f"{verdict.name}\n[Hz]", "error\n[%] "]
    return [table("Predicted with each set; * betrays it", columns, rows)]


def _trends(study: ER32Study) -> list[Group]:
    low, high = study.trends.torque_range_nm
    torque = [
        (
            t.quantity,
            f"{t.diameter_mm:g}",
            f"{t.change_percent:+.1f}",
            ends(t.interval, "+.1f"),
            "yes" if t.exceeds else "no",
            f"{t.end_values.percent:+.1f}",
            *(_step(step) for step in t.steps),
        )
        for t in study.trends.torque
    ]
    steps = [f"{step.start:g} to {step.end:g}\n[%] " for step in study.trends.torque[0].steps]
    columns = ("<", "d\n[mm]", "fitted\nline [%]", "interval", "exceeds it", "end values\n[%]", *steps)
    diameter = [
        (
            law.quantity,
            f"{law.exponent:.2f}",
            ends(law.interval, ".2f"),
            ends(law.scatter_interval, ".2f"),
            "yes" if law.exceeds else "no",
            *(_step(step) for step in law.steps),
        )
        for law in study.trends.diameter
    ]
    steps = [f"{step.start:g} to\n{step.end:g} [%] " for step in study.trends.diameter[0].steps]
    laws = ("<", "exponent", "from the\nresolution", "95 %, from\nthe scatter", "exceeds\nboth", *steps)
    return [
        table(
            f"From {low:g} to {high:g} N m: line fitted to the values at all torques, change between the end values; "
            "intervals from the resolution alone; a step marked ~ is within it",
            columns,
            torque,
        ),
        table("Over diameter [mm], as a power law", laws, diameter),
    ]


def _step(step: Step) -> str:
    return f"{step.percent:+.1f}{' ' if step.exceeds else '~'}"


def _bias(study: ER32Study) -> list[Group]:
    bias = study.bias
    rows = [
        (f"{d:g}", f"{overhang:g}", f"{ours:+.2f}", f"{paper:+.2f}", f"{spread:.2f}")
        for d, overhang, ours, paper, spread in zip(
            bias.diameter_mm,
            bias.overhang_mm,
            bias.percent,
            bias.published_percent,
            bias.tool_deviation_percent,
            strict=True,
        )
    ]
    mean = float(np.mean(bias.published_percent))
    rows.append(("mean", "", f"{bias.mean_percent:+.2f}", f"{mean:+.2f}", f"{bias.mean_deviation_percent:.2f}"))
    columns = ("d\n[mm]", "overhang\n[mm]", "ours\n[%]", "paper\n[%]", "chance, standard\ndeviation [%]")
    causes = [
        (
            cause.name,
            f"{cause.change:+.3g} {cause.unit}",
            "-" if cause.deviations is None else f"{cause.deviations:.1f}",
            "-" if cause.rms_percent is None else f"{cause.rms_percent:.2f}",
        )
        for cause in (*study.causes[:_CAUSES], *(c for c in study.causes[_CAUSES:] if c.deviations is None))
    ]
    title = (
        f"Single causes that would remove the mean bias, the {_CAUSES} least unlikely and the joint "
        f"(table 2's rms is now {study.transfer_rms_percent:.2f} %)"
    )
    return [
        table("100 (predicted / measured - 1) of mode 1", columns, rows),
        table(title, ("<cause", "change", "in standard\ndeviations", "table 2's rms\nwith it [%]"), causes),
    ]
