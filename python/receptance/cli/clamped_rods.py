"""The clamped rods on the terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

from receptance.cli._tables import ends, head, print_sentences, table
from receptance.studies.clamped_rods import SOURCE, UNITS, findings

if TYPE_CHECKING:
    from rich.console import Console

    from receptance.studies.clamped_rods import ClampedRods

__all__ = ["print_clamped_rods"]


def print_clamped_rods(console: Console, study: ClampedRods) -> None:
    """Print the tables and what follows from them."""
    head(console, "Clamped aluminium rods: the clamp from one rod, the others predicted")
    print_sentences(console, [SOURCE + "."])
    rods = [
        (rod.name, f"{rod.measured_hz:g}", f"{study.rigid_hz[rod.name]:.1f}", f"{rod.authors_prediction_hz:g}")
        for rod in study.rods
    ]
    title = f"First modes; readings +-{study.reading_error_hz:g} Hz"
    console.print(table(title, ("<rod", "measured [Hz]", "rigid clamp [Hz]", "authors [Hz]"), rods))
    clamps = [
        (
            clamp.assumption,
            clamp.rod,
            clamp.address.split(".")[1],
            "rigid" if clamp.value is None else f"{clamp.value:.3e}",
            ends(clamp.interval, ".2e"),
            UNITS[clamp.address],
        )
        for clamp in study.clamps
    ]
    found = ("<yields in", "<from rod", "<", "stiffness", "interval", "<unit")
    console.print(table("The clamp, one number from one frequency", found, clamps))
    predictions = [
        (
            p.assumption,
            p.identified_on,
            p.rod,
            f"{p.measured_hz:g}",
            f"{p.predicted_hz:.1f}",
            ends(p.interval_hz, ".1f"),
            f"{p.error_percent:+.1f}",
            "yes" if p.agrees else "no",
        )
        for p in study.predictions
    ]
    columns = (
        "<yields in",
        "<from rod",
        "<to rod",
        "measured [Hz]",
        "predicted [Hz]",
        "interval [Hz]",
        "error [%]",
        "agrees",
    )
    console.print(table("The other rods; agrees: the intervals of prediction and reading meet", columns, predictions))
    print_sentences(console, findings(study))
    console.print(f"seed {study.seed}; " + ", ".join(f"{name} {value}" for name, value in study.versions.items()))
