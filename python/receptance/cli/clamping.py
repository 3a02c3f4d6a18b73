"""The clamping studies on the terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from receptance.cli._tables import ends, head, print_sentences, table
from receptance.studies.clamping.findings import findings
from receptance.studies.er32.tables import SOURCE

if TYPE_CHECKING:
    from rich.console import Console, Group

    from receptance.studies.clamping.study import ClampingStudy

__all__ = ["print_clamping"]


def print_clamping(console: Console, study: ClampingStudy) -> None:
    """Print claims, tables and what follows from them."""
    said: dict[str, list[str]] = {}
    for about, text in findings(study):
        said.setdefault(about, []).append(text)
    head(console, "Clamping: insertion, material, damping (VIRTUAL), torque and diameter (published)")
    print_sentences(console, [SOURCE + ". Claims are quoted from it; no value is read off a figure."])
    parts = (
        ("insertion", "VIRTUAL: insertion 40, 30, 20 mm with two springs in series (eq. 15)", _insertion),
        ("material", "VIRTUAL: high-speed steel against carbide", _material),
        ("damping", "VIRTUAL: may damping at the interface be neglected?", _damping),
        ("torque", "Published: k_y over clamping torque (table 4)", _torque),
        ("diameter", "Published: stiffness over diameter (tables 1, 4, 5)", _diameter),
    )
    for about, title, make in parts:
        head(console, title)
        print_sentences(console, [f'claim ({c.where}): "{c.text}"' for c in study.claims if c.about == about])
        console.print(make(study))
        print_sentences(console, said[about])
    versions = ", ".join(f"{name} {value}" for name, value in study.versions.items())
    print_sentences(console, [f"seed {study.settings.seed}; {versions}"])


def _insertion(study: ClampingStudy) -> Group:
    rows = []
    for case in study.insertion.cases:
        best = case.hypotheses[0].log_evidence
        for one in case.hypotheses:
            behind = best - one.log_evidence
            evidence = "best" if behind == 0.0 else (f"{behind:.0f} less" if np.isfinite(behind) else "no peak")
            ratio = f"{case.ratio:g}" if one is case.hypotheses[0] else ""
            adequate = "yes" if one.adequate else "no"
            rows.append((ratio, one.name, evidence, f"{one.fit.rms:.2f}", adequate))
    columns = ("k2 / k1", "<law of the joint over the insertion", "log evidence", "rms", "explains\nthe noise")
    return table("Laws fitted to all three insertions together", columns, rows)


def _material(study: ClampingStudy) -> Group:
    slips = list(dict.fromkeys(one.slip for one in study.material.changes))
    tools = list(dict.fromkeys(one.diameter_mm for one in study.material.changes))
    rows = []
    for slip in slips:
        own = {one.diameter_mm: one for one in study.material.changes if one.slip == slip}
        rows.append((slip, *(f"{own[d].k_y_percent:+.1f} / {own[d].k_theta_percent:+.1f}" for d in tools)))
    columns = ("<slip in the model of the steel blank", *(f"{d:g} mm" for d in tools))
    return table("Apparent change of k_y / k_theta in percent, the joint being the same", columns, rows)


def _damping(study: ClampingStudy) -> Group:
    tests = list(study.damping.allowed)
    factors = list(dict.fromkeys(case.factor for case in study.damping.cases))
    rows = []
    for test in tests:
        own = {case.factor: case for case in study.damping.cases if case.test == test}
        allowed = study.damping.allowed[test]
        limit = f"{allowed:.2g}" if np.isfinite(allowed) else "> 1000"
        rows.append((test, *(f"{own[f].real_percent:+.1f}" for f in factors), limit))
    columns = ("<test", *(f"x {f:g}" for f in factors), "10 % at\nx")
    return table(
        "Least real part too large by, in percent, where a damping of x times table 3's is neglected", columns, rows
    )


def _torque(study: ClampingStudy) -> Group:
    low, high = study.trends.torque_range_nm
    rows = []
    for one in study.torque:
        change, least, most = one.law.change_percent(low, high)
        rows.append(
            (
                f"{one.diameter_mm:g}",
                f"{one.trend.end_values.percent:+.1f}",
                f"{one.trend.change_percent:+.1f}",
                ends(one.trend.interval, "+.1f"),
                "yes" if one.trend.exceeds else "no",
                f"{one.law.exponent:.2f}",
                f"{change:+.1f} ({least:+.1f} to {most:+.1f})",
                f"{one.law.log_evidence:+.1f}",
                "yes" if one.law.told else "no",
                "yes" if one.reclamped.told else "no",
            )
        )
    columns = (
        "d\n[mm]",
        "end values\n[%]",
        "fitted\nline [%]",
        "by the\nresolution",
        "more than\nthat",
        "exponent",
        "power law\n[%]",
        "log\nevidence",
        "more than\nscatter",
        "if clamped\nanew",
    )
    return table(f"Growth of k_y from {low:g} to {high:g} N m", columns, rows)


def _diameter(study: ClampingStudy) -> Group:
    rows = [
        (
            law.quantity,
            f"{law.exponent:.2f}",
            ends(law.interval, ".2f"),
            f"{law.scatter_percent:.0f}",
            f"{law.log_evidence:+.1f}",
            "yes" if law.told else "no",
        )
        for law in study.diameter
    ]
    columns = ("<", "exponent", "95 %", "scatter\n[%]", "log\nevidence", "more than\nscatter")
    return table("Power laws of the diameter against constants", columns, rows)
