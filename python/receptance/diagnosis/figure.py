"""Figures of a diagnosis, and of its report."""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Sequence
from typing import Any, TypeAlias

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import NullFormatter
from numpy.typing import NDArray

from receptance.diagnosis.by_mode import Curve, curves
from receptance.diagnosis.thresholds import MARGIN
from receptance.diagnosis.verdict import Verdict
from receptance.frf.figure import PHASE_FROM
from receptance.report.colours import COLOURS, PALE
from receptance.report.figure import add_legend, finished, new_figure, panels, phase_line, set_up, surface, title_left

Pair: TypeAlias = tuple[Curve, Curve | None]
"""A curve before, and after the causes are part of the model; None without a cause."""

_CANDIDATES = 14
"""Causes in the figure of the evidence."""
_LEADING = 8
"""Causes in a panel, which has room for so many names of two lines."""
_NAME = 26
"""Characters in a line of the name of a cause."""
_DECADES = 8.0
"""Largest power of ten of odds that is drawn; an arrow marks smaller odds."""
_SIZE = (4.5, 4.0)
"""Size of a figure of the report in inches: its text is legible on a page of 400 pixels and in a column of a print."""
_RECEPTANCES = 5
"""Receptances that are drawn, those with the largest residuals; the report has all of them."""
_COLUMNS = 3
_AROUND = 0.05
"""Half width of the lines around a peak, relative to its frequency."""
_GAP = 4.0
"""Ratio of the distance of two lines to those around it from which lines are left out between them."""


def draw_diagnosis(verdict: Verdict, ax: Axes | None = None) -> Figure:
    """Draw measurements, before and after, and the evidence of the candidates.

    The measurements are natural frequencies and the five receptances with the largest residuals before.
    """
    receptances, frequencies = fitted_curves(verdict, _RECEPTANCES)
    count = len(receptances) + bool(frequencies) + bool(verdict.candidates)
    columns = min(count, _COLUMNS)
    figure = surface(ax, 0.8 + 4.6 * columns, 3.6 * -(-count // columns) + 0.7)
    title_left(figure, f"{verdict.title}: {verdict.verdict}")
    axes = iter(panels(figure, count, columns))
    for number, (before, after) in enumerate(receptances):
        panel = next(axes)
        _draw_receptance(panel, before, after)
        # One legend below all panels: in a panel it would lie on a curve.
        if number == 0:
            add_legend(figure, *panel.get_legend_handles_labels(), ncols=3)
        if legend := panel.get_legend():
            legend.remove()
    if frequencies:
        _draw_frequencies(next(axes), frequencies)
    if verdict.candidates:
        _draw_evidence(next(axes), verdict, _LEADING, "Odds of the leading causes to the best")
    return finished(figure)


def fitted_curves(verdict: Verdict, most: int) -> tuple[list[Pair], list[Pair]]:
    """Return the receptances with the largest residuals, and all natural frequencies, in their order."""
    before = curves(verdict.base_fit)
    after = [None] * len(before) if verdict.explanation is None else curves(verdict.explanation.fit)
    receptances: list[Pair] = []
    frequencies: list[Pair] = []
    for pair in zip(before, after, strict=True):
        (receptances if np.iscomplexobj(pair[0].measured) else frequencies).append(pair)
    largest = sorted(receptances, key=lambda pair: -float(np.mean(np.square(pair[0].residual))))[:most]
    return [pair for pair in receptances if pair in largest], frequencies


def curve_figure(before: Curve, after: Curve | None) -> Figure:
    """Return one receptance, measured and modelled, and below it the ratio of model and measurement in decibels."""
    figure = new_figure(*_SIZE)
    upper, lower = figure.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    _draw_receptance(upper, before, after)
    upper.set_xlabel("")
    _draw_ratio(lower, before, after)
    return finished(figure)


def prediction_figure(before: Curve, after: Curve | None) -> Figure:
    """Return magnitude, phase and error of a predicted receptance, on all lines and around its highest peak."""
    figure = new_figure(9.0, 6.2)
    axes = figure.subplots(3, 2, sharex="col", height_ratios=(3, 2, 2), width_ratios=(3, 2))
    lines, peak = before.frequency_hz, float(before.frequency_hz[np.argmax(np.abs(before.measured))])
    for column, chosen in zip(axes.T, (lines > 0.0, np.abs(lines / peak - 1.0) < _AROUND), strict=True):
        pair = before.on(chosen), None if after is None else after.on(chosen)
        for panel, draw in zip(column, (_draw_receptance, _draw_phase, _draw_ratio), strict=True):
            draw(panel, *pair)
        for upper in column[:2]:
            upper.set_xlabel("")
    set_up(axes[0, 1], f"around {peak:.0f} Hz")
    axes[0, 1].get_legend().remove()
    axes[0, 1].yaxis.set_minor_formatter(NullFormatter())
    for panel in axes[1:, 1]:
        panel.set_ylabel("")
    return finished(figure)


def frequencies_figure(pairs: Sequence[Pair]) -> Figure:
    """Return the errors of natural frequencies, before and after."""
    figure = new_figure(_SIZE[0], 3.0)
    _draw_frequencies(figure.subplots(), pairs)
    return finished(figure)


def evidence_figure(verdict: Verdict) -> Figure:
    """Return how far each cause is behind the best."""
    figure = new_figure(_SIZE[0], 1.0 + 0.28 * min(len(verdict.candidates) + 1, _CANDIDATES))
    _draw_evidence(figure.subplots(), verdict, _CANDIDATES)
    return finished(figure)


def _modelled(before: Curve, after: Curve | None) -> Iterator[tuple[Curve, dict[str, Any]]]:
    """Yield the curves of the models, before and after, and their line styles."""
    yield before, {"color": COLOURS[1], "lw": 1.0, "ls": "--", "label": "model" if after is None else "model before"}
    if after is not None:
        yield after, {"color": COLOURS[2], "lw": 1.0, "label": "model after"}


def _draw_receptance(axes: Axes, before: Curve, after: Curve | None) -> None:
    set_up(axes, before.label or before.configuration, "frequency (Hz)", "receptance (m/N)")
    axes.plot(*_with_gaps(before.frequency_hz, np.abs(before.measured)), color=PALE, lw=3.0, label="measured")
    for curve, style in _modelled(before, after):
        axes.plot(*_with_gaps(curve.frequency_hz, np.abs(curve.modelled)), **style)
    axes.set_yscale("log")
    add_legend(axes)


def _draw_phase(axes: Axes, before: Curve, after: Curve | None) -> None:
    set_up(axes, "", "", "phase (°)")
    lowest = PHASE_FROM["receptance"]
    axes.plot(*phase_line(before.frequency_hz, before.measured, lowest), color=PALE, lw=3.0)
    for curve, style in _modelled(before, after):
        axes.plot(*phase_line(curve.frequency_hz, curve.modelled, lowest), **style)
    axes.set_yticks([-180, -90, 0, 90])


def _draw_ratio(axes: Axes, before: Curve, after: Curve | None) -> None:
    """Draw the ratio of model and measurement in decibels."""
    set_up(axes, "", "frequency (Hz)", "model over\nmeasured (dB)")
    for curve, style in _modelled(before, after):
        ratio = 20.0 * np.log10(np.abs(curve.modelled / curve.measured))
        axes.plot(*_with_gaps(curve.frequency_hz, ratio), **style)
    axes.axhline(0.0, color=PALE, lw=0.8)


def _with_gaps(lines: NDArray[np.float64], values: NDArray[np.float64]) -> tuple[NDArray[np.float64], ...]:
    """Return lines and values; NaN where lines are left out, so that no curve is drawn there."""
    spacing = np.diff(lines)
    around = np.maximum(np.append(spacing[:1], spacing[:-1]), np.append(spacing[1:], spacing[-1:]))
    gaps = np.flatnonzero(spacing > _GAP * around) + 1
    return np.insert(lines, gaps, np.nan), np.insert(values, gaps, np.nan)


def _draw_frequencies(axes: Axes, pairs: Sequence[Pair]) -> None:
    set_up(axes, "Natural frequencies", "measured (Hz)", "modelled less measured (%)")
    before, after = [pair[0] for pair in pairs], [curve for _, curve in pairs if curve is not None]
    for shown, colour, marker, label in (
        (before, COLOURS[1], "o", "before" if after else "model"),
        (after, COLOURS[2], "s", "after"),
    ):
        if shown:
            measured, modelled = (
                np.concatenate([values.real for values in each])
                for each in ([curve.measured for curve in shown], [curve.modelled for curve in shown])
            )
            axes.plot(measured, 100.0 * (modelled / measured - 1.0), marker, color=colour, ms=4.0, label=label)
    axes.axhline(0.0, color=PALE, lw=0.9)
    add_legend(axes)


def _draw_evidence(axes: Axes, verdict: Verdict, most: int, title: str = "") -> None:
    """Draw the odds of each cause to the best in powers of ten; a dashed line marks the margin of evidence."""
    reported, best = {cause.id for cause in verdict.causes}, verdict.best_evidence
    bars = [(best - cause.evidence, cause.title, cause.id in reported) for cause in verdict.candidates]
    bars = sorted([(best, "the model as it is", False), *bars], key=lambda bar: bar[0])[:most]
    set_up(axes, title, "n, where the odds are 1 : 10^n", "", grid="x")
    for place, (behind, _, is_cause) in enumerate(bars):
        decades, colour = min(0.5 * behind / np.log(10.0), _DECADES), COLOURS[2] if is_cause else PALE
        axes.hlines(place, 0.0, decades, color=colour, lw=2.0)
        marker = ">" if decades == _DECADES else "o"
        axes.plot([decades], [place], marker, color=colour, ms=6.0, clip_on=False)
    axes.axvline(0.5 * MARGIN / np.log(10.0), color=COLOURS[1], lw=1.0, ls="--")
    axes.set_yticks(range(len(bars)), [textwrap.fill(name, _NAME) for _, name, _ in bars], fontsize=9)
    axes.set_ylim(len(bars) - 0.4, -0.6)
    axes.set_xlim(0.0, _DECADES)
