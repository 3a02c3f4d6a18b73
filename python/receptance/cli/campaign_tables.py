"""Campaigns on the terminal."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

import numpy as np
from rich.padding import Padding
from rich.text import Text

from receptance.campaign.problems import path_text
from receptance.cli._tables import ends, head, print_sentences, table
from receptance.cli.series_tables import left_over_levels, measured_over_levels, series_of, tied_over_levels
from receptance.identification import MeasuredFRF
from receptance.identification.spread import SAYS_NOTHING, says_nothing

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from rich.console import Console, Group

    from receptance.campaign import Campaign, CampaignIdentification, CampaignPrediction, Measurement
    from receptance.identification import Scatter

__all__ = ["print_identification", "print_prediction"]

_TIED = 0.9
_ABOUT_DATA = "measurements."
_NOTHING = 1e-3
_MANY = 1e3
"""Standard errors of more times the value are not printed."""


def print_identification(console: Console, found: CampaignIdentification) -> None:
    """Print what was fitted, the parameters, what is left, advice and notes."""
    _heading(console, found.campaign, "identified")
    for item in (*_measurements(found.campaign), *_parameters(found)):
        console.print(item)
    _list(console, "Advice", found.fit.advice)
    _notes(console, found.campaign, found.notes)
    console.print(_provenance(found.fit.seed, found.versions))


def print_prediction(console: Console, found: CampaignPrediction) -> None:
    """Print predictions beside measurements, and what is predicted of assemblies that were not measured."""
    _heading(console, found.campaign, "predicted")
    if found.identified is not None:
        for item in _parameters(found.identified):
            console.print(item)
    for item in [*_compared_frequencies(found), *_compared_frfs(found), *_unmeasured(found)]:
        console.print(item)
    if found.rms_percent is not None:
        console.print(Text(f"{_verdict(found)}\n"))
    advice = [] if found.identified is None else found.identified.fit.advice
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


def _measurements(campaign: Campaign) -> Iterable[Group]:
    """Yield what was measured; a column that says nothing new is left out."""
    if campaign.templates:
        yield measured_over_levels(campaign, _content)
    measured = [one for name, one in campaign.measurements.items() if name not in campaign.templates]
    if not measured:
        return
    columns = {
        "<name": [one.name for one in measured],
        "<assembly": [one.assembly for one in measured],
        "<what": [_content(one) for one in measured],
        "<sensor": [one.sensor or "-" for one in measured],
        "<role": [one.role for one in measured],
    }
    if columns["<assembly"] == columns["<name"]:
        del columns["<assembly"]
    if not any(one.sensor for one in measured):
        del columns["<sensor"]
    yield table("Measurements", tuple(columns), list(zip(*columns.values(), strict=True)))


def _content(measured: Measurement) -> str:
    seen = measured.observation
    lines = seen.frequency_hz.real
    if isinstance(seen, MeasuredFRF):
        return f"FRF, {lines.size} lines from {lines[0]:g} to {lines[-1]:g} Hz"
    modes = ", ".join(map(str, seen.modes))
    return f"natural frequenc{'y' if lines.size == 1 else 'ies'} of mode{'' if lines.size == 1 else 's'} {modes}"


def _parameters(found: CampaignIdentification) -> Iterable[Group | Text]:
    fit = found.fit
    data = fit.data_errors
    rows = []
    for address, value in fit.values.items():
        if address in fit.errors or address.split(" @ ")[0] in found.series:
            continue
        cells = [address, _number(value, 5), _error(data[address], value)]
        cells += [_error(fit.standard_errors[address], value)] if fit.errors else []
        rows.append([*cells, _within_bounds(found, address)])
    columns = ["<parameter", "value", "standard error\nfrom the data", "95 % interval"]
    if fit.errors:
        columns[3:] = ["with\ntolerances", "95 % interval\nwith tolerances"]
    if rows:
        yield table("Identified, SI units", columns, rows)
    yield from series_of(found)
    if found.profiles:
        rows = [[name, _ends(one.lower, one.upper), one.statement] for name, one in found.profiles.items()]
        yield table("What the data say", ("<parameter", "95 % profile interval", "<that is"), rows)
    if fit.errors:
        rows = [[name, f"{fit.values[name]:+.2f}", f"{fit.standard_errors[name]:.2f}"] for name in fit.errors]
        yield table("Errors, in their standard deviations", ("<error", "found", "standard error"), rows)
    yield Text(f"{fit.summary().splitlines()[0]}\n")
    left = [
        (name, residual, unit)
        for name, residual, unit in zip(found.measurements, fit.residuals, fit.units, strict=True)
    ]
    of_series = [row for row in left if row[0] in found.campaign.templates]
    rows = [[name, str(r.size), _rms(r), unit] for name, r, unit in left if name not in found.campaign.templates]
    if rows:
        yield table("What is left", ("<measurement", "residuals", "rms", "<unit"), rows)
    if of_series:
        yield left_over_levels(found.campaign.templates, of_series)
    tied = [
        f"{fit.addresses[j]} and {fit.addresses[i]}: {fit.correlation[i, j]:+.3f}"
        for i in range(len(fit.addresses))
        for j in range(i)
        if abs(fit.correlation[i, j]) > _TIED and fit.addresses[i].split(" @ ")[0] not in found.series
    ]
    tied += tied_over_levels(found, _TIED)
    if tied:
        yield Text(f"Correlated beyond {_TIED:g}: {'; '.join(tied)}\n")


def _within_bounds(found: CampaignIdentification, address: str) -> str:
    """Return an interval as text; an end beyond the bounds of the unknown is open, for it was not looked for there."""
    unknown = found.fit.unknowns[found.fit.addresses.index(address)]
    low, high = found.interval(address)
    if not found.determined(address):
        return "not determined"
    if high >= unknown.upper or not np.isfinite(high):
        return f"{low:.4g} on"
    return f"up to {high:.4g}" if low <= unknown.lower else ends((low, high), ".4g")


def _ends(lower: float, upper: float) -> str:
    """Return an interval as text, open sides in words."""
    if np.isinf(upper):
        return "open" if lower in (0.0, -np.inf) else f"{lower:.4g} on"
    return f"up to {upper:.4g}" if lower in (0.0, -np.inf) else f"{lower:.4g} to {upper:.4g}"


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
                    _largest(one.scatter, i),
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
            cause = _largest(one.scatter, i)
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


def _largest(scatter: Scatter, index: int) -> str:
    """Return the error, or the noise, that has the largest share of a variance, and its share."""
    total = float(scatter.total[index])
    if not np.isfinite(total) or total == 0.0:
        return "not determined" if total else ""
    shares = {name: float(own[index]) for name, own in scatter.shares.items()}
    shares["scatter of the data"] = float(scatter.data[index] / total) ** 2
    name = max(shares, key=lambda one: shares[one])
    # Of a place in the file what follows the section is enough here; the JSON has it in full.
    words = re.sub(r"^(materials|parts|joints|sensors|attachments)\.", "", name)
    words = re.sub(r"^assemblies\.(.+?)\.(set|tolerance)\.", r"\1: ", words).replace('"', "")
    return f"{words} {100.0 * shares[name]:.0f} %"


def _rms(residual: NDArray[np.float64]) -> str:
    rms = float(np.sqrt(np.mean(residual**2)))
    return f"{rms:.3g}" if rms >= _NOTHING else f"under {_NOTHING:g}"


def _number(value: float, digits: int) -> str:
    return f"{value:.{digits}g}" if np.isfinite(value) else "not determined"


def _error(error: float, value: float) -> str:
    """Return a standard error; one of many times the value says no more than that nothing is known."""
    return "not determined" if abs(error) >= _MANY * abs(value) > 0.0 else _number(error, 2)


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
