"""Transfers of a campaign on the terminal."""

from __future__ import annotations

from typing import TYPE_CHECKING

from receptance.cli._tables import head, print_sentences, table
from receptance.identification.spread import SAYS_NOTHING

if TYPE_CHECKING:
    from rich.console import Console, Group

    from receptance.campaign.transfer import CampaignTransfer
    from receptance.identification import Transfer, TransferredMode

__all__ = ["mode_table", "print_transfer"]


def print_transfer(console: Console, found: CampaignTransfer) -> None:
    """Print predictions beside measurements, what was identified on the way, and notes."""
    head(console, f"{found.campaign.title}: every assembly from the others")
    result = found.found
    if result.modes:
        console.print(mode_table(result))
    if result.frfs:
        console.print(_frfs(result))
    if result.identified:
        console.print(_identified(result))
    sentences = [_verdict(result)] if result.modes else []
    sentences += [f"Not predicted: {reason}." for reason in result.not_predicted]
    sentences += [f"note: {note}" for note in (*result.notes, *found.notes)]
    versions = ", ".join(f"{name} {value}" for name, value in found.versions.items())
    print_sentences(console, [*sentences, f"seed {result.seed}; {versions}"])


def mode_table(found: Transfer) -> Group:
    """Return predicted natural frequencies beside measured ones."""
    rows = [_mode(mode) for mode in found.modes]
    columns = ("<held out", "mode", "measured\n[Hz]", "predicted\n[Hz]", "error\n[%]", "interval\n[Hz]", "inside")
    title = f"Natural frequencies of what was held out, {100.0 * found.level:g} % intervals"
    return table(title, columns, rows)


def _mode(mode: TransferredMode) -> tuple[str, ...]:
    ends = mode.interval_hz
    return (
        mode.label or mode.configuration,
        "-" if mode.mode is None else str(mode.mode),
        f"{mode.measured_hz:.1f}",
        "none" if mode.predicted_hz is None else f"{mode.predicted_hz:.1f}",
        "" if mode.error_percent is None else f"{mode.error_percent:+.2f}",
        "" if ends is None else SAYS_NOTHING if mode.says_nothing else f"{ends[0]:.1f} to {ends[1]:.1f}",
        {True: "yes", False: "no", None: ""}[mode.inside],
    )


def _frfs(found: Transfer) -> Group:
    rows = [
        (frf.label or frf.configuration, f"{frf.distance_decibel:.2f}", f"{100.0 * frf.share_inside:.0f}")
        for frf in found.frfs
    ]
    columns = ("<held out", "log-spectral\ndistance [dB]", "lines in\nthe band [%]")
    return table("Frequency responses of what was held out", columns, rows)


def _identified(found: Transfer) -> Group:
    rows = []
    for name, values in found.identified.items():
        known = sorted(value for value in values if value is not None)
        spread = 100.0 * (known[-1] / known[0] - 1.0) if known[0] > 0.0 else None
        percent = "" if spread is None else f"{spread:.2g}"
        rows.append((name, str(len(known)), f"{known[0]:.4g}", f"{known[-1]:.4g}", percent))
    columns = ("<parameter", "splits", "least", "most", "apart [%]")
    return table("Identified over the splits", columns, rows)


def _verdict(found: Transfer) -> str:
    hits, count = found.inside
    rms, bias = found.rms_percent, found.bias_percent
    errors = "" if rms is None or bias is None else f"{rms:.2f} % rms, {bias:+.2f} % on average; "
    rest = len(found.modes) - count
    wide = f" {rest} have no interval, or one too wide to say anything." if rest else ""
    level = f"{100.0 * found.level:g} %"
    return f"{errors}{hits} of {count} measured natural frequencies are in their {level} intervals.{wide}"
