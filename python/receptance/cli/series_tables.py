"""Parameters over levels on the terminal."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np
from rich.text import Text

from receptance.campaign.addresses import kind_of
from receptance.campaign.series import level_unit
from receptance.cli._tables import ends, table

if TYPE_CHECKING:
    from numpy.typing import NDArray
    from rich.console import Group

    from receptance.campaign import Campaign, CampaignIdentification, Measurement
    from receptance.taper import ForceSeries

__all__ = ["left_over_levels", "measured_over_levels", "series_of", "tied_over_levels", "trends"]


def series_of(found: CampaignIdentification) -> Iterator[Group | Text]:
    """Yield the values at each level, what they do over the levels, and the same in sentences."""
    over = found.campaign.table.series
    if over is None or not found.series:
        return
    unit = level_unit(over)[0]
    groups: dict[tuple[str, tuple[float, ...]], list[ForceSeries]] = {}
    for name, series in found.series.items():
        groups.setdefault((name.partition(".")[0], tuple(series.force)), []).append(series)
    for (owner, levels), own in groups.items():
        columns = [f"{over.over}\n[{unit}]"]
        for one in own:
            columns += [f"{one.name.partition('.')[2]}\n[{kind_of(one.name).unit}]", "95 % interval"]
        rows = [[f"{level:g}", *(cell for one in own for cell in _cells(one, i))] for i, level in enumerate(levels)]
        yield table(f"{owner} over {over.over}", columns, rows)
    yield trends(found.series)
    for series in found.series.values():
        yield Text(f"{series.sentence()}.")
    yield Text("")


def _cells(series: ForceSeries, index: int) -> tuple[str, str]:
    value, half = float(series.values[index]), 1.96 * float(series.standard_errors[index])
    return f"{value:.5g}", ends((value - half, value + half), ".5g")


def trends(series: Mapping[str, ForceSeries]) -> Group:
    """Return what parameters do over the levels, with the evidence."""
    rows = []
    for name, one in series.items():
        whole, slope = one.trend(), one.slope_trend()
        low, high = one.exponent_interval
        rows.append(
            (
                name,
                whole.direction,
                f"{whole.p_value:.1g}",
                slope.direction,
                f"{slope.p_value:.1g}",
                one.law.name,
                f"{one.laws[2].exponent:.2f}",
                ends((low, high), ".2f"),
                f"{one.scatter:.1f}",
            )
        )
    columns = ("<", "<with force", "p", "<its slope", "p", "<best law", "n in K0 + a F^n", "interval", "scatter")
    return table("Trends with their evidence; scatter about the law over what the errors explain", columns, rows)


def measured_over_levels(campaign: Campaign, content: Callable[[Measurement], str]) -> Group:
    """Return what was measured at the levels of a series, a line for each kind of measurement."""
    rows = []
    for template in dict.fromkeys(campaign.templates.values()):
        own = [one for name, one in campaign.measurements.items() if campaign.templates.get(name) == template]
        contents = dict.fromkeys(content(one) for one in own)
        what = next(iter(contents)) + (", and others" if len(contents) > 1 else "")
        rows.append((template, str(len(own)), str(sum(one.held_out for one in own)), what))
    return table("Measurements at levels", ("<name", "levels", "held out", "<what"), rows)


def left_over_levels(templates: Mapping[str, str], rows: Sequence[tuple[str, NDArray[np.float64], str]]) -> Group:
    """Return what is left at the levels of a series, a line for each kind of measurement."""
    groups: dict[tuple[str, str], list[tuple[float, str]]] = {}
    for name, residual, unit in rows:
        groups.setdefault((templates[name], unit), []).append((float(np.sqrt(np.mean(residual**2))), name))
    cells = []
    for (template, unit), own in groups.items():
        sizes = [rms for rms, _ in own]
        cells.append((template, f"{min(sizes):.3g}", f"{np.median(sizes):.3g}", f"{max(sizes):.3g}", max(own)[1], unit))
    columns = ("<measurement", "least", "median rms", "most", "<of", "<unit")
    return table("What is left", columns, cells)


def tied_over_levels(found: CampaignIdentification, limit: float) -> list[str]:
    """Return which parameters of a level are correlated beyond a limit, and from where to where over the levels."""
    fit = found.fit
    pairs: dict[str, list[float]] = {}
    for i, second in enumerate(fit.addresses):
        for j, first in enumerate(fit.addresses[:i]):
            if abs(fit.correlation[i, j]) > limit and second.split(" @ ")[0] in found.series:
                names = f"{first.split(' @ ')[0]} and {second.split(' @ ')[0]}"
                pairs.setdefault(names, []).append(float(fit.correlation[i, j]))
    return [f"{names} at {len(own)} levels: {min(own):+.3f} to {max(own):+.3f}" for names, own in pairs.items()]
