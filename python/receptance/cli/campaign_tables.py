"""Campaigns on the terminal."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from rich.padding import Padding
from rich.text import Text

from receptance.campaign.problems import path_text
from receptance.cli._tables import head, print_sentences, table
from receptance.identification.spread import SAYS_NOTHING, says_nothing
from receptance.report.terminal import print_table

if TYPE_CHECKING:
    from rich.console import Console, Group

    from receptance.campaign import Campaign, CampaignPrediction

__all__ = ["print_prediction"]

_ABOUT_DATA = "measurements."


def print_prediction(console: Console, found: CampaignPrediction) -> None:
    """Print predictions beside measurements, and what is predicted of assemblies that were not measured."""
    _heading(console, found.campaign, "predicted")
    if found.identified is not None:
        print_sentences(console, found.identified.sentences())
        for table in found.identified.tables():
            print_table(console, table)
    for item in [*_compared_frequencies(found), *_compared_frfs(found), *_unmeasured(found)]:
        console.print(item)
    if found.rms_percent is not None:
        console.print(Text(f"{_verdict(found)}\n"))
    advice = [] if found.identified is None else found.identified.advice
    _list(console, "Advice", advice)
    about_data = [note for note in found.notes if note.startswith(_ABOUT_DATA)]
    rest = [note for note in found.notes if note not in about_data]
    if about_data and found.identified is not None:
        rest.append(f"what was noted of the data ({len(about_data)} notes) is printed by identify, and is in the JSON")
        about_data = []
    _notes(console, found.campaign, [*about_data, *rest])
    console.print(_provenance(found.campaign.table.settings.seed, found.versions))


def _heading(console: Console, campaign: Campaign, what: str) -> None:
    head(console, f"{campaign.title}: {what}")
    if campaign.table.description:
        print_sentences(console, [campaign.table.description.strip()])


def _verdict(found: CampaignPrediction) -> str:
    """Return in a line how the predictions of natural frequencies and peaks did."""
    told = [one for one in found.frequencies if one.measured_hz is not None]
    inside = [bool(yes) for one in told for yes in one.within(found.reach)[~one.says_nothing(found.reach)]]
    inside += [yes for frf in found.frfs for peak in frf.peaks if (yes := peak.within(found.reach)) is not None]
    rest = len(found.errors_percent) - len(inside)
    wide = f"; {rest} intervals are too wide to say anything" if rest else ""
    return (
        f"Held out: {len(found.errors_percent)} natural frequencies and peaks, predicted {found.rms_percent:.2f} % rms "
        f"off; {sum(inside)} of {len(inside)} within the {100.0 * found.level:g} % intervals{wide}"
    )


def _compared_frequencies(found: CampaignPrediction) -> Iterable[Group]:
    rows = []
    for one in found.frequencies:
        if one.measured_hz is None:
            continue
        low, high = one.interval_hz(found.reach)
        inside, nothing = one.within(found.reach), one.says_nothing(found.reach)
        for i, mode in enumerate(one.modes):
            rows.append(
                (
                    one.name if i == 0 else "",
                    str(mode),
                    f"{one.measured_hz[i]:.1f}",
                    f"{one.predicted_hz[i]:.1f}",
                    SAYS_NOTHING if nothing[i] else f"{low[i]:.1f} to {high[i]:.1f}",
                    f"{one.errors_percent[i]:+.2f}",
                    "" if nothing[i] else "yes" if inside[i] else "no",
                    _largest({name: change[i] for name, change in one.scatter.errors.items()}, one.scatter.fit[i]),
                )
            )
    columns = (
        "<measurement",
        "mode",
        "measured\n[Hz]",
        "predicted\n[Hz]",
        _level(found),
        "error\n[%]",
        "within",
        "<mostly from",
    )
    if rows:
        yield table("Natural frequencies held out", columns, rows)


def _compared_frfs(found: CampaignPrediction) -> Iterable[Group]:
    held_out = [frf for frf in found.frfs if frf.measured is not None]
    peaks = [
        (
            frf.name if i == 0 else "",
            "none" if peak.measured_hz is None else f"{peak.measured_hz:.1f}",
            "none" if peak.predicted_hz is None else f"{peak.predicted_hz:.1f}",
            _peak_interval(peak.predicted_hz, peak.deviation_hz, found.reach),
            f"{peak.error_percent:+.2f}" if peak.matched else "",
            {True: "yes", False: "no", None: ""}[peak.within(found.reach)],
        )
        for frf in held_out
        for i, peak in enumerate(frf.peaks)
    ]
    if peaks:
        columns: tuple[str, ...] = (
            "<measurement",
            "measured\n[Hz]",
            "predicted\n[Hz]",
            _level(found),
            "error\n[%]",
            "within",
        )
        yield table("Peaks of FRFs held out", columns, peaks)
    rows = [
        (
            frf.name,
            str(frf.frequency_hz.size),
            f"{frf.rms_decibel:.2f}",
            SAYS_NOTHING if (share := frf.share_within(found.reach)) is None else f"{100.0 * share:.1f}",
            f"{100.0 * float(np.mean(frf.says_nothing(found.reach))):.1f}",
        )
        for frf in held_out
    ]
    if rows:
        columns = (
            "<measurement",
            "lines",
            "magnitude off\n[dB rms]",
            f"lines within {100.0 * found.level:g} %\nof band and noise [%]",
            "lines where the band\nsays nothing [%]",
        )
        count = len(columns) if any(row[-1] != "0.0" for row in rows) else len(columns) - 1
        yield table("FRFs held out", columns[:count], [row[:count] for row in rows])


def _unmeasured(found: CampaignPrediction) -> Iterable[Group]:
    rows = []
    for one in found.frequencies:
        if one.measured_hz is not None:
            continue
        low, high = one.interval_hz(found.reach)
        nothing = one.says_nothing(found.reach)
        for i, mode in enumerate(one.modes):
            cause = _largest({name: change[i] for name, change in one.scatter.errors.items()}, one.scatter.fit[i])
            rows.append(
                (
                    one.name if i == 0 else "",
                    str(mode),
                    f"{one.predicted_hz[i]:.1f}",
                    SAYS_NOTHING if nothing[i] else f"{low[i]:.1f} to {high[i]:.1f}",
                    cause,
                )
            )
    if rows:
        columns = ("<assembly", "mode", "predicted\n[Hz]", _level(found), "<mostly from")
        yield table("Assemblies that were not measured", columns, rows)


def _level(found: CampaignPrediction) -> str:
    return f"{100.0 * found.level:g} % interval\n[Hz]"


def _peak_interval(predicted_hz: float | None, deviation_hz: float | None, reach: float) -> str:
    if predicted_hz is None or deviation_hz is None:
        return ""
    if says_nothing(predicted_hz, reach * deviation_hz):
        return SAYS_NOTHING
    return f"{predicted_hz - reach * deviation_hz:.1f} to {predicted_hz + reach * deviation_hz:.1f}"


def _largest(errors: dict[str, float], of_fit: float) -> str:
    """Return what most of a variance comes from and its share, in short words of the file."""
    squares = {name: change**2 for name, change in errors.items()} | {"scatter of the data": float(of_fit) ** 2}
    whole = sum(squares.values())
    if not np.isfinite(whole) or whole == 0.0:
        return "not determined" if whole else ""
    name = max(squares, key=lambda one: squares[one])
    # Of a place in the file what follows the section is enough here; the JSON has it in full.
    words = re.sub(r"^(materials|parts|joints|sensors|attachments)\.", "", name)
    words = re.sub(r"^assemblies\.(.+?)\.(set|tolerance)\.", r"\1: ", words).replace('"', "")
    return f"{words} {100.0 * squares[name] / whole:.0f} %"


def _list(console: Console, title: str, texts: Sequence[str]) -> None:
    if not texts:
        return
    console.print(Text(title, style="bold"))
    for text in texts:
        console.print(Padding(Text(text), (0, 0, 0, 2), expand=False))
    console.print()


def _notes(console: Console, campaign: Campaign, notes: Sequence[str]) -> None:
    """Print notes, those of a measurement together under its name."""
    if not notes:
        return
    console.print(Text("Notes", style="bold"))
    rest = list(notes)
    shown: set[str] = set()
    for name in campaign.measurements:
        place = f"{path_text(('measurements', name))}: "
        own = [note.removeprefix(place) for note in rest if note.startswith(place)]
        rest = [note for note in rest if not note.startswith(place)]
        template = campaign.templates.get(name)
        if template in shown or not own:
            continue
        shown |= {template} if template is not None else set()
        more = "" if template is None else f"; those at the other levels of {template} are in the JSON"
        console.print(Text(f"  of the measurement {name}{more}"))
        for note in own:
            console.print(Padding(Text(note), (0, 0, 0, 4), expand=False))
    for note in rest:
        console.print(Padding(Text(note), (0, 0, 0, 2), expand=False))
    console.print()


def _provenance(seed: int, versions: dict[str, str]) -> Text:
    return Text(f"seed {seed}; " + ", ".join(f"{name} {value}" for name, value in versions.items()))
