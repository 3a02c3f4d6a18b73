"""Figures of fits, likelihoods and draws, and panels that figures of predictions share."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.ticker import FixedLocator, NullLocator
from numpy.typing import NDArray

from receptance import units
from receptance._text import printable
from receptance.fit.likelihood import Profile, Profiles
from receptance.fit.prediction import DECIBEL
from receptance.fit.result import Identification
from receptance.fit.sampling import Samples
from receptance.model.coordinates import Coordinate
from receptance.report.colours import BAD, BAND, COLOURS, INK, PALE
from receptance.report.figure import add_legend, finished, label_point, panels, set_up, surface, title_left

MOST_FRFS = 12
"""Most receptances of a fit or a prediction that are drawn."""
_MOST_BESIDE = 8
"""Most parameters whose intervals are drawn in a panel beside the others."""
_STEPS = (0.0005, 0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5)
"""Distances of ticks on an axis of factors."""
_MAX_BAND = 3.0
"""Largest half width of the band of a ratio that is drawn, as natural logarithm."""
WIDE = 20.0
"""Ranges over more than this factor have a logarithmic axis."""
OPEN = 1e3
"""Factor to either side up to which the band of a transfer is drawn."""


def draw_identification(fit: Identification, ax: Axes | None = None) -> Figure:
    """Draw measurements and fitted model, their ratio, and the intervals of the parameters, or those of a series."""
    if fit.series:
        return finished(fit.series.plot(ax), fit.rejection)
    everything = list(zip(fit.labels, fit.task.observed, fit.assemblies, strict=True))
    frfs = [(label, observation, assembly) for label, observation, assembly in everything if observation.is_receptance]
    shown = frfs[:MOST_FRFS]
    lists = [
        (label, observation, assembly) for label, observation, assembly in everything if not observation.is_receptance
    ]
    parameters = [name for name in fit.values if name not in fit.errors]
    # Many rows take the whole width below the other panels.
    below = 1.4 + 0.24 * len(parameters) if len(parameters) > _MOST_BESIDE else 0.0
    title = f"{fit.title}{left_out(frfs, shown)}"
    figure, cells = cell_grid(ax, len(shown) + bool(lists) + (not below), title, below)
    for (label, seen, assembly), cell in zip(shown, cells, strict=False):
        model = assembly.receptance(
            seen.frequency_hz, response=seen.response, excitation=seen.excitation, force=seen.force
        )
        top, bottom = pair_of_panels(cell)
        set_up_magnitude(top, label, seen.response, seen.excitation)
        lines = seen.frequency_hz.real
        draw_curves(top, lines, seen.receptance, model, "fitted")
        low, high = top.get_ylim()
        top.set_ylim(low, 30.0 * high)
        noise = seen.standard_deviation
        legend_with_noise(top, noise)
        ratio = np.log(np.abs(seen.receptance / model))
        draw_ratio(bottom, "measured over\nfitted (dB)", lines, ratio, None, noise)
    if lists:
        axes = cells[len(shown)].subplots()
        rows = []
        for label, listed, assembly in lists:
            fitted = assembly.lowest_natural_frequencies(max(listed.modes))[0][[mode - 1 for mode in listed.modes]]
            rows.append((label, listed.modes, listed.frequency_hz, fitted, None, listed.standard_deviation))
        draw_frequencies(axes, "Natural frequencies, fitted against measured", "fitted", rows)
    _parameters(cells[-1], fit, parameters)
    return finished(figure, fit.rejection)


def cell_grid(
    ax: Axes | None, count: int, title: str, below: float = 0.0
) -> tuple[Figure | SubFigure, list[SubFigure]]:
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


def left_out(responses: Sequence[object], drawn: Sequence[object]) -> str:
    """Return how many responses are not drawn, for the end of a title."""
    rest = len(responses) - len(drawn)
    return f" ({rest} more responses are not drawn)" if rest > 0 else ""


def pair_of_panels(cell: SubFigure) -> tuple[Axes, Axes]:
    """Return the panels of magnitude and of ratio."""
    top, below = cell.subplots(2, 1, sharex=True, height_ratios=[2.6, 1.0])
    return top, below


def set_up_magnitude(axes: Axes, title: str, response: Coordinate, excitation: Coordinate) -> None:
    """Set title, label with unit, and logarithmic axis of the magnitude of a receptance."""
    unit = units.frf_unit(units.FRFKind("receptance", response.direction, excitation.direction))
    set_up(axes, title, y=f"|receptance| ({unit})")
    axes.set_yscale("log")


def draw_curves(
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


def draw_ratio(
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
        most = max(most, 1.5 * DECIBEL * float(np.nanpercentile(band, 98)))
    if log_ratio is not None:
        axes.plot(lines, DECIBEL * log_ratio, ".", color=INK, markersize=1.8)
        most = max(most, 1.3 * DECIBEL * float(np.percentile(np.abs(log_ratio), 99)))
    if noise is not None:
        for sign in (-2.0, 2.0):
            axes.plot(lines, sign * DECIBEL * noise, color=BAD, linewidth=0.8, alpha=0.7)
        most = max(most, 3.0 * DECIBEL * float(np.median(noise)))
    axes.axhline(0.0, color=INK, linewidth=0.6)
    axes.set_ylim(-most, most)


def legend_with_noise(axes: Axes, noise: NDArray[np.float64] | None) -> None:
    """Add a legend, with the noise of the panel below if it is known."""
    if noise is not None:
        axes.plot([], [], color=BAD, linewidth=0.8, alpha=0.7, label="noise, two standard deviations (below)")
    add_legend(axes, loc="upper right", markerscale=4)


def draw_frequencies(axes: Axes, title: str, series: str, rows: Sequence[tuple[Any, ...]]) -> None:
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


def _parameters(cell: SubFigure, fit: Identification, names: Sequence[str]) -> None:
    """Draw the 95 % interval of every parameter relative to its value."""
    axes = cell.subplots()
    between = "\n" if len(names) <= _MOST_BESIDE else "   "
    set_up(axes, "95 % intervals of the parameters", "relative to the value", grid="both")
    styles = [(BAND, 12.0, "with tolerances")] if fit.errors else []
    styles.append((COLOURS[0], 6.0, "from the data"))
    for colour, width, label in styles:
        axes.plot([], [], color=colour, linewidth=width, label=label)
    labels = []
    for index, address in enumerate(names):
        value = fit.values[address]
        intervals = [fit.interval(address)] if fit.errors else []
        for ends, (colour, width, _) in zip([*intervals, fit.interval(address, exact=True)], styles, strict=True):
            low, high = sorted(end / value if value else float("inf") for end in ends)
            # A wider interval would hide all others.
            bounded = np.isfinite(high) and high < OPEN and bool(value)
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


def draw_profiles(likelihood: Profile | Profiles, ax: Axes | None = None) -> Figure:
    """Draw the rise of -2 log L over each parameter, the threshold of the interval, and its meaning."""
    profiles = likelihood if isinstance(likelihood, Profiles) else Profiles({likelihood.name: likelihood})
    if not profiles:
        raise ValueError("profiles is empty, expected at least one")
    figure, cells = _titled_panels(ax, len(profiles), 3, (5.0, 3.6), profiles.provenance.title)
    for axes, profile in zip(cells, profiles.values(), strict=True):
        set_up(axes, profile.name, "value, SI units", "rise of \u22122 log L")
        axes.set_title(f"{profile.name}\n{profile.statement}", fontsize=10, loc="left", color=INK)
        wide = bool(np.all(profile.values > 0.0) and profile.values[-1] > WIDE * profile.values[0])
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
