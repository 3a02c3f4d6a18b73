"""The BT50 study on the terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

from receptance.cli._tables import ends, head, print_sentences, table
from receptance.report import Results
from receptance.report.terminal import rendered
from receptance.studies.bt50 import findings
from receptance.studies.bt50.findings import PROVENANCE, SOURCE

if TYPE_CHECKING:
    from rich.console import Console, Group

    from receptance.studies.bt50 import BT50Study

__all__ = ["print_bt50"]


def print_bt50(console: Console, study: BT50Study) -> None:
    """Print the tables and what follows from them."""
    said: dict[str, list[str]] = {}
    for about, text in findings(study):
        said.setdefault(about, []).append(text)
    head(console, "BT50 taper over drawbar force: the paper's procedure on a virtual rig")
    print_sentences(console, [SOURCE + ".", PROVENANCE])
    parts = (
        ("axial", "Axial", _axial(study)),
        ("diagnosis", "What a diagnosis says of the rigid holder", None),
        ("damping", "Axial damping, half-power and circle", _damping(study)),
        ("radial", "Radial", _radial(study)),
        ("trends", "Over drawbar force", rendered(Results(study.series).tables()[0])),
        ("use", "What the elastic model is used for", None),
    )
    for about, title, printed in parts:
        head(console, title)
        if printed is not None:
            console.print(printed)
        print_sentences(console, said[about])
    console.print(
        f"seed {study.settings.seed}; " + ", ".join(f"{name} {value}" for name, value in study.versions.items())
    )


def _giga(interval: tuple[float, float], form: str) -> str:
    return ends((1e-9 * interval[0], 1e-9 * interval[1]), form)


def _axial(study: BT50Study) -> Group:
    rows = [
        (
            f"{level.force_kn:g}",
            f"{level.circle.frequency_hz:.1f}",
            f"{1e-9 * level.rigid.joint.k_z1:.4f}",
            f"{1e-9 * level.elastic.values['k_z1']:.4f}",
            _giga(level.elastic.intervals["k_z1"], ".4f"),
            f"{level.simulated_hz:.1f}",
            f"{100.0 * (level.simulated_hz / level.circle.frequency_hz - 1.0):+.2f}",
            f"{level.elastic_hz:.1f}",
            f"{100.0 * (level.elastic_hz / level.circle.frequency_hz - 1.0):+.3f}",
        )
        for level in study.axial
    ]
    columns = (
        "force\n[kN]",
        "experiment\n[Hz]",
        "K_Z1 rigid\n[GN/m]",
        "elastic\n[GN/m]",
        "interval",
        "simulated\n[Hz]",
        "error\n[%]",
        "elastic\n[Hz]",
        "error\n[%]",
    )
    title = "Virtual experiment; simulated: the elastic holder on the rigid holder's spring, as the paper does it"
    return table(title, columns, rows)


def _damping(study: BT50Study) -> Group:
    rows = [
        (
            f"{level.force_kn:g}",
            f"{level.half_power.lines_in_band:.1f}",
            f"{100.0 * level.half_power.damping_ratio:.3f}",
            f"{100.0 * level.circle.damping_ratio:.3f}",
            f"{100.0 * level.true_damping_ratio:.3f}",
            f"{level.rigid_half_power.joint.c_z1:.0f}",
            f"{level.rigid.joint.c_z1:.0f}",
            ends(level.rigid.intervals["c_z1"], ".0f"),
        )
        for level in study.axial
    ]
    columns = (
        "force\n[kN]",
        "lines in\nthe band",
        "half-power\n[%]",
        "circle\n[%]",
        "of the rig\n[%]",
        "C_Z1 half-power\n[N s/m]",
        "circle\n[N s/m]",
        "interval",
    )
    return table("Damping ratio, and the damping of eq. 15 from it", columns, rows)


def _radial(study: BT50Study) -> Group:
    rows = []
    for level in study.radial:
        cells = [f"{level.force_kn:g}", *(f"{f:.1f}" for f in level.modes.frequency_hz)]
        for name in ("k_x1", "k_x2"):
            cells += [f"{1e-9 * level.elastic.values[name]:.3f}"]
            cells += [_giga(level.elastic.intervals[name], ".3f")]
        cells += [f"{level.elastic.values[name]:.0f}" for name in ("c_x1", "c_x2")]
        cells += [f"{f:.1f}" for f in level.simulated_hz or (float("nan"),) * 2]
        rows.append(cells)
    columns = (
        "force\n[kN]",
        "mode 1\n[Hz]",
        "mode 2\n[Hz]",
        "K_X1\n[GN/m]",
        "interval",
        "K_X2\n[GN/m]",
        "interval",
        "C_X1\n[N s/m]",
        "C_X2\n[N s/m]",
        "simulated\n1 [Hz]",
        "simulated\n2 [Hz]",
    )
    return table("Elastic holder; simulated: on the rigid holder's springs", columns, rows)
