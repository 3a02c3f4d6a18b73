"""Figures of sweeps."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import numpy as np
from matplotlib.axes import Axes
from matplotlib.collections import QuadMesh
from matplotlib.figure import Figure
from numpy.typing import NDArray

from receptance.report.colours import COLOURS, INK
from receptance.report.figure import finished, set_up, surface, title_left

if TYPE_CHECKING:
    import xarray as xr

_BINS = 30
"""Number of bins for a parameter with more than twice as many values."""
_LOGARITHMIC = 10.0
"""Ratio of the ends of a range from which the axis is logarithmic."""
LARGEST_COUNT = 4
"""Largest number of parameters in a figure."""


def draw_misfit(results: xr.Dataset, variable: str = "misfit", ax: Axes | None = None) -> Figure:
    """Draw the smallest misfit over each parameter and each pair, minimised over the others.

    Parameters
    ----------
    results : xarray.Dataset
        From `receptance.sweep.sweep`, with at most four parameters.
    variable : str, optional
        Name of the misfit.
    ax : Axes, optional
        As in `Result.plot`.

    Returns
    -------
    matplotlib.figure.Figure
        The figure; save it with `savefig`.

    Raises
    ------
    ValueError
        More than four parameters, or no feasible candidate.

    Examples
    --------
    >>> from receptance import STEEL, Assembly, Observation, Part, PointJoint, Segment
    >>> from receptance.sweep.figure import draw_misfit
    >>> from receptance.sweep import Grid, Misfit, sweep
    >>> bar = Segment(length=0.1, outer_diameter=0.02, material=STEEL)
    >>> joint = PointJoint(k_y=1e8, k_theta=1e5, name="joint")
    >>> pair = Assembly([Part([bar], name="tool"), joint, Part([bar], name="holder")])
    >>> modes = Observation.from_modes(
    ...     assembly=pair, frequency_hz=pair.natural_frequencies(2e4)[:2], standard_deviation_hz=2.0
    ... )
    >>> len(draw_misfit(sweep(pair, Grid({"joint.k_theta": [5e4, 1e5, 2e5]}), Misfit(modes))).axes)
    1
    """
    feasible = results["valid"].values & np.isfinite(results[variable].values)
    names = json.loads(results.attrs["addresses"])
    if len(names) > LARGEST_COUNT:
        raise ValueError(f"draw_misfit: {len(names)} parameters were varied, a figure shows at most {LARGEST_COUNT}")
    if not feasible.any():
        raise ValueError("draw_misfit: no candidate is feasible")
    columns = [results[name].values[feasible] for name in names]
    misfit = results[variable].values[feasible]
    count = len(names)
    figure = surface(ax, max(3.4 * count, 6.4), max(2.9 * count, 4.2))
    title_left(figure, f"Smallest {variable}, minimised over the other parameters")
    grid = figure.subplots(count, count, squeeze=False)
    best = int(np.argmin(misfit))
    image = None
    floor = max(float(misfit[best]), np.finfo(float).tiny)
    for i in range(count):
        for j in range(count):
            axes = grid[i, j]
            if j > i:
                axes.set_axis_off()
            elif i == j:
                _draw_parameter(axes, names[i], columns[i], misfit, best)
            else:
                image = _draw_pair(axes, names, columns, (j, i), np.log10(np.maximum(misfit, floor)), best)
    if image is not None:
        bar = figure.colorbar(image, ax=grid[:, -1].tolist(), shrink=0.7)
        bar.set_label(f"log10 of the smallest {variable}", color=INK)
    return finished(figure)


def _draw_parameter(axes: Axes, name: str, column: NDArray[np.float64], misfit: NDArray[np.float64], best: int) -> None:
    edges, index = _binned(column)
    least = np.full(edges.size - 1, np.nan)
    np.fmin.at(least, index, misfit)
    middle = np.sqrt(edges[1:] * edges[:-1]) if _is_logarithmic(column) else 0.5 * (edges[1:] + edges[:-1])
    shown = np.isfinite(least)
    set_up(axes, name, name, "smallest misfit")
    axes.plot(middle[shown], least[shown], color=COLOURS[0], marker="o", markersize=3, linewidth=1.2)
    axes.plot(column[best], misfit[best], marker="*", color=COLOURS[1], markersize=12)
    if misfit.min() > 0.0:
        axes.set_yscale("log")
    if _is_logarithmic(column):
        axes.set_xscale("log")


def _draw_pair(
    axes: Axes,
    names: list[str],
    columns: list[NDArray[np.float64]],
    pair: tuple[int, int],
    height: NDArray[np.float64],
    best: int,
) -> QuadMesh:
    x, y = (columns[i] for i in pair)
    (x_edges, x_index), (y_edges, y_index) = _binned(x), _binned(y)
    least = np.full((y_edges.size - 1, x_edges.size - 1), np.nan)
    np.fmin.at(least, (y_index, x_index), height)
    set_up(axes, "", names[pair[0]], names[pair[1]])
    image = axes.pcolormesh(x_edges, y_edges, least, cmap="viridis_r", vmin=height.min(), vmax=height.max())
    axes.plot(x[best], y[best], marker="*", color=COLOURS[1], markersize=12)
    for column, scale in ((x, axes.set_xscale), (y, axes.set_yscale)):
        if _is_logarithmic(column):
            scale("log")
    return image


def _is_logarithmic(column: NDArray[np.float64]) -> bool:
    return bool(column.min() > 0.0 and column.max() / column.min() >= _LOGARITHMIC)


def _binned(column: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return the edges of bins and the bin of each value: one bin per value of a grid, otherwise equal widths."""
    logarithmic = _is_logarithmic(column)
    positions = np.log(column) if logarithmic else column
    values = np.unique(positions)
    if values.size == 1:
        edges = values[0] + np.array([-0.5, 0.5])
    elif values.size <= 2 * _BINS:
        inner = 0.5 * (values[1:] + values[:-1])
        edges = np.concatenate([[1.5 * values[0] - 0.5 * values[1]], inner, [1.5 * values[-1] - 0.5 * values[-2]]])
    else:
        edges = np.linspace(values[0], values[-1], _BINS + 1)
    index = np.clip(np.searchsorted(edges, positions, side="right") - 1, 0, edges.size - 2)
    return (np.exp(edges) if logarithmic else edges), index.astype(np.int64)
