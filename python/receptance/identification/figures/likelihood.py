"""Figures of profile likelihoods and of draws from a posterior."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from receptance.report.figure import BAD, COLOURS, INK, finished, panels, set_up, surface, title_left

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from receptance.identification.profiles import Profile, Profiles
    from receptance.identification.sampling import Samples

__all__ = ["draw_profiles", "draw_samples"]

_COLUMNS = 4
_WIDE = 20.0
"""Ranges over more than this factor have a logarithmic axis."""
_TOP = 3.0
"""Upper limit of the axis in thresholds."""


def draw_profiles(profiles: Profiles, ax: Axes | None = None) -> Figure:
    """Draw the rise of -2 log L over each parameter, the threshold of the interval, and its meaning."""
    if not profiles:
        raise ValueError("profiles is empty, expected at least one")
    columns = min(len(profiles), 3)
    rows = -(-len(profiles) // columns)
    title = profiles.provenance.title
    figure = surface(ax, 5.0 * columns, 3.6 * rows + (0.6 if title else 0.1))
    if title:
        title_left(figure, title)
    for axes, profile in zip(panels(figure, len(profiles), columns), profiles.values(), strict=True):
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
        axes.set_ylim(-0.05 * profile.threshold, _TOP * profile.threshold)
        if wide:
            axes.set_xscale("log")
        else:
            axes.locator_params(axis="x", nbins=5)
    return finished(figure)


def _curve(profile: Profile, wide: bool) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Interpolate the root of the rise, which is nearly linear; return values and rise."""
    root = np.sqrt(profile.rise) * np.sign(profile.values - profile.value)
    places = np.log(profile.values) if wide else profile.values
    fine = np.linspace(places[0], places[-1], 400)
    return np.exp(fine) if wide else fine, np.interp(fine, places, root) ** 2


def draw_samples(samples: Samples, ax: Axes | None = None) -> Figure:
    """Draw a histogram of each parameter with its 95 % interval."""
    columns = min(len(samples.names), _COLUMNS)
    rows = -(-len(samples.names) // columns)
    figure = surface(ax, 3.6 * columns, 3.0 * rows + 0.5)
    if samples.provenance.title:
        title_left(figure, samples.provenance.title)
    for axes, name in zip(panels(figure, len(samples.names), columns), samples.names, strict=True):
        set_up(axes, name, "value, SI units")
        axes.hist(samples.of(name), bins="auto", color=COLOURS[0], alpha=0.6)
        for end in samples.interval(name):
            axes.axvline(end, color=BAD, linewidth=1.0, linestyle=":")
        axes.set_yticks([])
    return finished(figure)
