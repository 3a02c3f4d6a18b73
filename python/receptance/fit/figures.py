"""Figures of fits, predictions, likelihoods, transfers and next measurements."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance import units
from receptance._text import printable
from receptance.fit.covariance import UNINFORMATIVE
from receptance.fit.prediction import DECIBEL
from receptance.report.figure import (
    BAD,
    BAND,
    COLOURS,
    INK,
    PALE,
    add_legend,
    finished,
    label_point,
    panels,
    plain_ticks,
    set_up,
    surface,
    title_left,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure
    from numpy.typing import NDArray

    from receptance.campaign import Prediction
    from receptance.fit.likelihood import Profile, Profiles
    from receptance.fit.prediction import PredictedFRF
    from receptance.fit.result import Identification
    from receptance.fit.sampling import Samples
    from receptance.model.coordinates import Coordinate
    from receptance.predict.ranking import Expectation, NextMeasurement
    from receptance.predict.transfers import Transfer

_MOST_FRFS = 12
"""Most receptances of a fit or a prediction that are drawn."""
_MOST_BESIDE = 8
"""Most parameters whose intervals are drawn in a panel beside the others."""
_STEPS = (0.0005, 0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5)
"""Distances of ticks on an axis of factors."""
_MAX_BAND = 3.0
"""Largest half width of the band of a ratio that is drawn, as natural logarithm."""
_WIDE = 20.0
"""Ranges over more than this factor have a logarithmic axis."""
_OPEN = 1e3
"""Factor to either side up to which the band of a transfer is drawn."""
_WIDEST = 1e4
"""An open side of a target is drawn up to this factor of the value, with an arrow head."""


def draw_identification(found: Identification, ax: Axes | None = None) -> Figure:
    """Draw measurements and fitted model, their ratio, and the intervals of the parameters."""
    everything = list(zip(found.labels, found.task.observed, found.assemblies, strict=True))
    frfs = [(label, observation, assembly) for label, observation, assembly in everything if observation.is_receptance]
    shown = frfs[:_MOST_FRFS]
    lists = [
        (label, observation, assembly) for label, observation, assembly in everything if not observation.is_receptance
    ]
    parameters = [name for name in found.values if name not in found.errors]
    # Many rows take the whole width below the other panels.
    below = 1.4 + 0.24 * len(parameters) if len(parameters) > _MOST_BESIDE else 0.0
    title = f"{found.title}{_left_out(frfs, shown)}"
    figure, cells = _grid(ax, len(shown) + bool(lists) + (not below), title, below)
    for (label, seen, assembly), cell in zip(shown, cells, strict=False):
        model = assembly.receptance(
            seen.frequency_hz, response=seen.response, excitation=seen.excitation, force=seen.force
        )
        top, bottom = _pair(cell)
        _magnitude(top, label, seen.response, seen.excitation)
        lines = seen.frequency_hz.real
        _curves(top, lines, seen.receptance, model, "fitted")
        low, high = top.get_ylim()
        top.set_ylim(low, 30.0 * high)
        # As stated: the fit may have used more, and predictions show the stated noise as well.
        noise = None if seen.standard_deviation is None else seen.standard_deviation / found.noise_factor
        _legend(top, noise)
        ratio = np.log(np.abs(seen.receptance / model))
        _ratio(bottom, "measured over\nfitted (dB)", lines, ratio, None, noise)
    if lists:
        axes = cells[len(shown)].subplots()
        rows = []
        for label, listed, assembly in lists:
            fitted = assembly.lowest_natural_frequencies(max(listed.modes))[0][[mode - 1 for mode in listed.modes]]
            rows.append((label, listed.modes, listed.frequency_hz, fitted, None, listed.standard_deviation))
        _frequencies(axes, "Natural frequencies, fitted against measured", "fitted", rows)
    _parameters(cells[-1], found, parameters)
    return finished(figure, found.rejection)


def draw_prediction(found: Prediction, ax: Axes | None = None) -> Figure:
    """Draw predictions with their intervals, and measurements."""
    frfs = found.frfs[:_MOST_FRFS]
    compared = [one for one in found.frequencies if one.measured_hz is not None]
    title = f"{found.title}{_left_out(found.frfs, frfs)}"
    figure, cells = _grid(ax, len(frfs) + bool(compared), title)
    for frf, cell in zip(frfs, cells, strict=False):
        _predicted_frf(cell, frf, found)
    if compared:
        rows = [
            (
                one.name,
                [mode.mode for mode in one.modes],
                one.measured_hz,
                one.predicted_hz,
                found.reach * one.scatter.total,
                np.array([mode.measured_deviation_hz for mode in one.modes]),
            )
            for one in compared
        ]
        title = f"Natural frequencies held out, with {100.0 * found.level:g} % intervals"
        _frequencies(cells[len(frfs)].subplots(), title, "predicted", rows)
    return finished(figure, found.rejection)


def _grid(ax: Axes | None, count: int, title: str, below: float = 0.0) -> tuple[Figure | SubFigure, list[SubFigure]]:
    """Return a figure and its cells; with a height `below` in inches, the last cell is a wide one below the others."""
    columns = min(count, 3 if count > 4 or count == 3 else 2)
    rows = -(-count // columns)
    figure = surface(ax, 5.6 * columns + (2.0 if columns == 1 else 0.0), 4.4 * rows + below + 0.6)
    grid = figure.add_gridspec(rows + bool(below), columns, height_ratios=[4.4] * rows + [below] * bool(below))
    cells = [figure.add_subfigure(grid[i // columns, i % columns]) for i in range(count)]
    cells += [figure.add_subfigure(grid[rows, :])] if below else []
    most = 64 * columns + 24
    text = title if len(title) < most else title[: most - 3] + "..."
    title_left(figure, text, 14.0 if len(text) < 32 * columns + 12 else 12.0)
    return figure, cells


def _left_out(all_of_them: Sequence[Any], *drawn: Sequence[Any]) -> str:
    rest = len(all_of_them) - sum(map(len, drawn))
    return f" ({rest} more responses are not drawn)" if rest > 0 else ""


def _pair(cell: SubFigure) -> tuple[Axes, Axes]:
    top, below = cell.subplots(2, 1, sharex=True, height_ratios=[2.6, 1.0])
    return top, below


def _magnitude(axes: Axes, title: str, response: Coordinate, excitation: Coordinate) -> None:
    unit = units.frf_unit(units.FRFKind("receptance", response.direction, excitation.direction))
    set_up(axes, title, y=f"|receptance| ({unit})")
    axes.set_yscale("log")


def _curves(
    axes: Axes,
    lines: NDArray[np.float64],
    measured: NDArray[np.complex128] | None,
    model: NDArray[np.complex128],
    label: str,
) -> None:
    """Draw the magnitudes of a measurement and of the model."""
    if measured is not None:
        axes.plot(lines, np.abs(measured), ".", color=PALE, markersize=2.5, label="measured")
    axes.plot(lines, np.abs(model), color=COLOURS[0], linewidth=1.3, label=label)


def _ratio(
    axes: Axes,
    label: str,
    lines: NDArray[np.float64],
    log_ratio: NDArray[np.float64] | None,
    band: NDArray[np.float64] | None,
    noise: NDArray[np.float64] | None,
) -> None:
    """Draw the ratio of magnitudes in dB, the band of the prediction and the noise of the lines."""
    set_up(axes, "", "frequency (Hz)", label)
    most = 0.5
    if band is not None:
        # The band is infinite if a relevant parameter is not determined.
        band = np.minimum(band, _MAX_BAND)
        axes.fill_between(lines, -DECIBEL * band, DECIBEL * band, color=BAND, linewidth=0)
        most = max(most, 1.5 * DECIBEL * float(np.percentile(band, 98)))
    if log_ratio is not None:
        axes.plot(lines, DECIBEL * log_ratio, ".", color=INK, markersize=1.8)
        most = max(most, 1.3 * DECIBEL * float(np.percentile(np.abs(log_ratio), 99)))
    if noise is not None:
        for sign in (-2.0, 2.0):
            axes.plot(lines, sign * DECIBEL * noise, color=BAD, linewidth=0.8, alpha=0.7)
        most = max(most, 3.0 * DECIBEL * float(np.median(noise)))
    axes.axhline(0.0, color=INK, linewidth=0.6)
    axes.set_ylim(-most, most)


def _legend(axes: Axes, noise: NDArray[np.float64] | None) -> None:
    if noise is not None:
        axes.plot([], [], color=BAD, linewidth=0.8, alpha=0.7, label="noise, two standard deviations (below)")
    add_legend(axes, loc="upper right", markerscale=4)


def _predicted_frf(cell: SubFigure, frf: PredictedFRF, found: Prediction) -> None:
    lines = frf.frequency_hz.real
    measured = frf.measured is not None
    top, below = _pair(cell)
    title = f"{frf.name}: {'held out' if measured else 'predicted, not measured'}"
    _magnitude(top, title, frf.response, frf.excitation)
    size = np.abs(frf.receptance)
    shown = size if frf.measured is None else np.concatenate([size, np.abs(frf.measured)])
    limits = float(shown.min()) / 2.0, float(shown.max()) * 30.0
    low, high = frf.band(found.level)
    low, high = np.clip(low, limits[0] / 10.0, None), np.clip(high, None, limits[1] * 10.0)
    top.fill_between(lines, low, high, color=BAND, linewidth=0, label=f"{100.0 * found.level:g} % band")
    _curves(top, lines, frf.measured, frf.receptance, "predicted")
    top.set_ylim(*limits)
    if not measured:
        for one in found.frequencies:
            if one.name == frf.name:
                _name_modes(top, one.predicted_hz, found.reach * one.scatter.total)
    _legend(top, frf.measured_deviation)
    label = "measured over\npredicted (dB)" if measured else "band (dB)"
    log_ratio = frf.log_ratio.real if measured else None
    _ratio(below, label, lines, log_ratio, found.reach * frf.scatter.total, frf.measured_deviation)


def _name_modes(axes: Axes, frequency_hz: NDArray[np.float64], half_hz: NDArray[np.float64]) -> None:
    """Annotate natural frequencies with their intervals."""
    for frequency, half in zip(frequency_hz, half_hz, strict=True):
        text = f"{frequency:.0f} ± {half:.0f} Hz" if np.isfinite(half) else f"{frequency:.0f} Hz, open"
        axes.axvline(frequency, color=PALE, linewidth=0.7, linestyle=":")
        axes.annotate(
            text, (frequency, 0.03), xycoords=("data", "axes fraction"), xytext=(-4, 0), textcoords="offset points",
            rotation=90, ha="right", va="bottom", fontsize=8, color=INK,
        )  # fmt: skip


def _frequencies(axes: Axes, title: str, series: str, rows: Sequence[tuple[Any, ...]]) -> None:
    """Draw errors of calculated natural frequencies in percent, grouped by measurement."""
    set_up(axes, title, "", "against measured (%)")
    place = 0.0
    ticks: list[tuple[float, str]] = []
    for name, modes, measured, calculated, half, deviation in rows:
        x = place + np.arange(len(modes))
        error = 100.0 * (calculated / measured - 1.0)
        if deviation is not None and deviation.any():
            label = None if place else "reading, two standard deviations"
            half_reading = 200.0 * deviation / measured
            axes.errorbar(x, np.zeros(len(x)), half_reading, fmt="none", ecolor=PALE, capsize=5, label=label)
        bars = None if half is None else 100.0 * half / measured
        label = None if place else series
        axes.errorbar(x, error, bars, fmt="o", color=COLOURS[0], capsize=3, markersize=5, label=label)
        if len(rows) * len(modes) <= 24:
            for at, value, mode in zip(x, error, modes, strict=True):
                label_point(axes, f"{mode}", (at, value), offset=(6.0, 3.0))
        ticks.append((float(x.mean()), name))
        place = float(x[-1]) + 1.8
        if len(rows) > 1 and name is not rows[-1][0]:
            axes.axvline(place - 0.9, color="#E6E6E6", linewidth=0.8)
    axes.axhline(0.0, color=INK, linewidth=0.8)
    tilted = sum(len(name) for _, name in ticks) > 50
    axes.set_xticks(
        [at for at, _ in ticks],
        [printable(name) for _, name in ticks],
        rotation=35 if tilted else 0,
        ha="right" if tilted else "center",
        rotation_mode="anchor",
        fontsize=9,
    )
    low, high = axes.get_ylim()
    most = max(abs(low), abs(high), 0.05)
    axes.set_ylim(-most, 1.25 * most)
    axes.set_xlim(-1.2, place - 0.6)
    add_legend(axes, loc="upper right", ncols=2)


def _parameters(cell: SubFigure, found: Identification, names: Sequence[str]) -> None:
    """Draw the 95 % interval of every parameter relative to its value."""
    axes = cell.subplots()
    between = "\n" if len(names) <= _MOST_BESIDE else "   "
    set_up(axes, "95 % intervals of the parameters", "relative to the value", grid="both")
    styles = [(BAND, 12.0, "with tolerances")] if found.errors else []
    styles.append((COLOURS[0], 6.0, "from the data"))
    for colour, width, label in styles:
        axes.plot([], [], color=colour, linewidth=width, label=label)
    labels = []
    for index, address in enumerate(names):
        value = found.values[address]
        intervals = [found.interval(address)] if found.errors else []
        for ends, (colour, width, _) in zip([*intervals, found.interval(address, exact=True)], styles, strict=True):
            low, high = sorted(end / value if value else float("inf") for end in ends)
            # A wider interval would hide all others.
            bounded = np.isfinite(high) and high < _OPEN and bool(value)
            if bounded and low > 0.0:
                axes.plot([low, high], [-index] * 2, color=colour, linewidth=width, solid_capstyle="butt")
                continue
            text = "the interval includes zero" if bounded else "not determined"
            label_point(axes, text, (1.0, -index), offset=(6.0, -3.0), colour=BAD)
        axes.plot(1.0, -index, "|", color=INK, markersize=11)
        labels.append(f"{printable(address)}{between}{value:.4g}")
    axes.set_yticks([-i for i in range(len(labels))], labels, fontsize=8 if len(labels) > 6 else 9)
    axes.set_ylim(-len(labels) + 0.4, 0.6)
    axes.set_xscale("log")
    _factors(axes)
    add_legend(cell, ncols=2)


def _factors(axes: Axes) -> None:
    """Set a few round ticks on both sides of one."""
    from matplotlib.ticker import FixedLocator, NullLocator

    low, high = axes.get_xlim()
    span = max(high, 1.0 / low, 1.001)
    decades = math.ceil(math.log10(span))
    step = next((s for s in _STEPS if 4.0 * s >= span - 1.0), None)
    if step is not None:
        above = [1.0 + k * step for k in range(1, 5)]
    elif decades == 1:
        above = [2.0, 5.0, 10.0]
    else:
        every = -(-decades // 4)
        above = [10.0**k for k in range(every, decades + 1, every)]
    ticks = [*(1.0 / tick for tick in above[::-1]), 1.0, *above]
    axes.xaxis.set_major_locator(FixedLocator(ticks))
    axes.xaxis.set_minor_locator(NullLocator())
    names = [f"{tick:.5g}" for tick in above]
    axes.set_xticks(ticks, [*(f"\u00f7 {name}" for name in names[::-1]), "1", *(f"\u00d7 {name}" for name in names)])
    axes.set_xlim(1.0 / span, span)


def draw_profiles(profiles: Profiles, ax: Axes | None = None) -> Figure:
    """Draw the rise of -2 log L over each parameter, the threshold of the interval, and its meaning."""
    if not profiles:
        raise ValueError("profiles is empty, expected at least one")
    figure, cells = _titled_panels(ax, len(profiles), 3, (5.0, 3.6), profiles.provenance.title)
    for axes, profile in zip(cells, profiles.values(), strict=True):
        set_up(axes, profile.name, "value, SI units", "rise of \u22122 log L")
        axes.set_title(f"{profile.name}\n{profile.statement}", fontsize=10, loc="left", color=INK)
        wide = bool(np.all(profile.values > 0.0) and profile.values[-1] > _WIDE * profile.values[0])
        axes.plot(*_curve(profile, wide), color=COLOURS[0], linewidth=1.3)
        axes.plot(profile.values, profile.rise, "o", color=COLOURS[0], markersize=3.5)
        axes.axhline(profile.threshold, color=BAD, linewidth=1.0)
        axes.annotate(
            f"{100.0 * profile.level:g} %",
            (1.0, profile.threshold),
            xycoords=("axes fraction", "data"),
            xytext=(-2, 3),
            textcoords="offset points",
            ha="right",
            fontsize=9,
            color=BAD,
        )
        for end, is_open in ((profile.lower, profile.lower_open), (profile.upper, profile.upper_open)):
            if not is_open:
                axes.axvline(end, color=BAD, linewidth=0.8, linestyle=":")
        axes.set_ylim(-0.05 * profile.threshold, 3.0 * profile.threshold)
        if wide:
            axes.set_xscale("log")
        else:
            axes.locator_params(axis="x", nbins=5)
    return finished(figure)


def _titled_panels(
    ax: Axes | None, count: int, most: int, size: tuple[float, float], title: str
) -> tuple[Figure | SubFigure, list[Axes]]:
    """Return a figure and its panels, up to `most` beside each other, each with a width and a height in inches."""
    columns = min(count, most)
    figure = surface(ax, size[0] * columns, size[1] * -(-count // columns) + (0.6 if title else 0.1))
    if title:
        title_left(figure, title)
    return figure, panels(figure, count, columns)


def _curve(profile: Profile, wide: bool) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Interpolate the root of the rise, which is nearly linear; return values and rise."""
    root = np.sqrt(profile.rise) * np.sign(profile.values - profile.value)
    places = np.log(profile.values) if wide else profile.values
    fine = np.linspace(places[0], places[-1], 400)
    return np.exp(fine) if wide else fine, np.interp(fine, places, root) ** 2


def draw_samples(samples: Samples, ax: Axes | None = None) -> Figure:
    """Draw a histogram of each parameter with its 95 % interval."""
    figure, cells = _titled_panels(ax, len(samples.names), 4, (3.6, 3.0), samples.provenance.title)
    for axes, name in zip(cells, samples.names, strict=True):
        set_up(axes, name, "value, SI units")
        axes.hist(samples.of(name), bins="auto", color=COLOURS[0], alpha=0.6)
        for end in samples.interval(name):
            axes.axvline(end, color=BAD, linewidth=1.0, linestyle=":")
        axes.set_yticks([])
    return finished(figure)


def draw_transfer(found: Transfer, ax: Axes | None = None) -> Figure:
    """Draw errors of predicted natural frequencies with their intervals, and predicted receptances with their bands."""
    frfs = found.frfs[:8]
    if not found.modes and not frfs:
        raise ValueError(f"nothing was predicted: {'; '.join(found.not_predicted) or 'there is no split'}")
    columns = 1 if not frfs else 2
    rows = max(len(frfs), 1)
    tall = 1.6 + 0.24 * len(found.modes)
    height = max(tall, 2.9 * rows) + 0.6
    figure = surface(ax, 7.2 + 6.2 * (columns - 1), height)
    hits, count = found.inside
    text = f"{hits} of {count} natural frequencies in their {100 * found.level:g} % intervals"
    title_left(figure, f"{found.title}\n{text}", 12.0 if len(found.title) < 50 * columns else 10.0)
    cells = figure.subfigures(1, columns, squeeze=False, width_ratios=[7.2, 6.2][:columns])[0]
    _draw_modes(cells[0].subplots(), found)
    if frfs:
        for axes, frf in zip(np.ravel(cells[1].subplots(len(frfs), 1, squeeze=False)), frfs, strict=True):
            _draw_frf(axes, frf, found.level)
    return finished(figure, found.rejection)


def _draw_modes(axes: Axes, found: Transfer) -> None:
    set_up(axes, "Held out", "predicted against measured (%)", grid="x")
    axes.axvline(0.0, color=INK, linewidth=1.0)
    labels, before, several = [], "", len({mode.configuration for mode in found.modes}) > 1
    for row, mode in enumerate(found.modes):
        text = f"{mode.measured_hz:.0f} Hz" + ("" if mode.mode is None else f"  mode {mode.mode}")
        labels.append(f"{mode.configuration}   {text}" if mode.configuration != before and several else text)
        before = mode.configuration
        interval = mode.interval_hz(found.level, mode.measured_deviation_hz)
        if mode.measured_hz is None or mode.error_percent is None or interval is None:
            axes.plot(0.0, row, "x", color=BAD, markersize=7)
            label_point(axes, "no prediction", (0.0, row), offset=(6.0, -3.0), colour=BAD)
            continue
        if mode.uninformative(found.level):
            axes.plot(mode.error_percent, row, "o", color=PALE, markerfacecolor="white", markersize=5)
            point = mode.error_percent, row
            label_point(axes, f"interval {UNINFORMATIVE}", point, offset=(6.0, -3.0), colour=PALE)
            continue
        low, high = (100.0 * (end / mode.measured_hz - 1.0) for end in interval)
        inside = mode.within(found.level)
        colour = COLOURS[0] if inside else BAD
        if np.isfinite(high):
            axes.plot([low, high], [row, row], color=colour, linewidth=2.2, alpha=0.45, solid_capstyle="butt")
        axes.plot(mode.error_percent, row, "o" if inside else "D", color=colour, markersize=5)
    axes.set_yticks(range(len(labels)), list(map(printable, labels)), fontsize=8)
    axes.set_ylim(len(labels) - 0.4, -0.6)
    axes.plot([], [], "o", color=COLOURS[0], markersize=5, label="measured is inside the interval")
    axes.plot([], [], "D", color=BAD, markersize=5, label="measured is outside the interval")
    add_legend(axes, fontsize=8, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=2, borderaxespad=0.1)


def _draw_frf(axes: Axes, frf: PredictedFRF, level: float) -> None:
    set_up(axes, "", "frequency (Hz)", "magnitude (SI)")
    share = frf.share_within(level)
    inside = "no useful band" if share is None else f"{100.0 * share:.0f} % of lines in the band"
    axes.set_title(
        f"{frf.name}: {frf.rms_decibel:.2f} dB, {inside}",
        loc="left",
        fontsize=10,
        color=INK,
    )
    lines = frf.frequency_hz.real
    size = np.abs(frf.receptance)
    low, high = frf.band(level)
    axes.fill_between(
        lines, np.maximum(low, size / _OPEN), np.minimum(high, size * _OPEN), color=BAND, linewidth=0.0, label="band"
    )
    _curves(axes, lines, frf.measured, frf.receptance, "predicted")
    axes.set_yscale("log")
    add_legend(axes, fontsize=8, loc="upper right")


def draw_next_measurement(found: NextMeasurement, ax: Axes | None = None) -> Figure:
    """Draw the interval of each target now and as expected with each candidate, the best candidate on top."""
    # Four panels are drawn as a square.
    columns = min(len(found.targets), 2 if len(found.targets) == 4 else 3)
    rows = -(-len(found.targets) // columns)
    names = ["now", *(one.label for one in found.ranking)]
    height = rows * (0.9 + 0.36 * len(names)) + 0.7
    figure = surface(ax, 2.2 + 3.6 * columns, height)
    title_left(figure, f"{found.title}: intervals now and as expected")
    cells = panels(figure, len(found.targets), columns, sharey=True)
    for axes, name in zip(cells, found.targets, strict=True):
        _draw_target(axes, name, [one.expected[name] for one in found.ranking], names)
    return finished(figure, found.rejection)


def _draw_target(axes: Axes, name: str, expected: list[Expectation], names: list[str]) -> None:
    set_up(axes, name, "", "")
    axes.grid(visible=False)
    first = expected[0]
    log = first.scale == "log"
    low, high = _shown(first, first.now)
    for row, (ends, colour) in enumerate(
        [((low, high), INK), *((_shown(e, (e.lower, e.upper)), COLOURS[0]) for e in expected)]
    ):
        axes.plot(ends, [row, row], color=colour, linewidth=4.0 if row else 3.0, solid_capstyle="butt")
        if row and expected[row - 1].stays_open >= 0.005:
            share = f"{100.0 * expected[row - 1].stays_open:.0f} % stays open"
            axes.annotate(share, (1.0, row), xycoords=("axes fraction", "data"), ha="right", va="bottom", fontsize=7.5)
    for end, side, is_open in ((low, "<", first.now[0] in (0.0, -np.inf)), (high, ">", np.isinf(first.now[1]))):
        if is_open and first.value != 0.0:
            axes.plot([end], [0], side, color=INK, markersize=7.0)
    if first.value != 0.0:
        axes.axvline(first.value, color=PALE, linewidth=0.9)
    if log:
        axes.set_xscale("log")
        if high / low < _WIDE:
            plain_ticks(axes.xaxis)
    axes.set_yticks(range(len(names)), list(map(printable, names)), fontsize=9)
    axes.set_ylim(len(names) - 0.5, -0.5)


def _shown(e: Expectation, ends: tuple[float, float]) -> tuple[float, float]:
    """Return an interval whose open sides end with the axis."""
    if e.scale == "log":
        low, high = e.value / _WIDEST, e.value * _WIDEST
    else:
        whole = 10.0 * max(abs(e.value), e.upper - e.lower)
        low, high = e.value - whole, e.value + whole
    return max(ends[0], low), min(ends[1], high)
