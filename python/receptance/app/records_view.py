"""Measured FRFs, the model at the values of the sliders, their difference and modes, over a common frequency axis."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from bokeh.layouts import column, row
from bokeh.models import CheckboxGroup, ColumnDataSource, LayoutDOM, Range1d, Select, Spacer
from numpy.typing import NDArray

from receptance import units
from receptance.app import look
from receptance.app.view import PageOfView
from receptance.campaign import MeasuredLines, Trial, TrialRecord
from receptance.errors import ReceptanceError

MOST_SHOWN = 4
"""Records that are shown at first."""
_DECIBEL, _DEGREES = "difference (dB)", "difference (deg)"
_LEFT = 66
"""Room for the labels of vertical axes in pixels, so that figures below each other are aligned."""
_BESIDE = 0.5
"""Most that is shown beside the lines that are used, on each side, as a share of their band."""
_MODES = ("frequency (Hz)", "model (Hz)", "difference (%)", "damping (%)", "model (%)")


@dataclass(frozen=True)
class Quantity:
    """What is drawn of a receptance, and of the difference below it."""

    of: Callable[[NDArray[np.complex128]], NDArray[np.float64]]
    label: str
    """Label of the axis, with the unit of the receptance in place of {unit}."""
    difference: Callable[[TrialRecord], NDArray[np.float64]]
    below: str
    """Label of the axis of the difference."""
    is_logarithmic: bool = False


def _phase(receptance: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Return the phase from -270 to 90 degrees: a receptance at a resonance goes from 0 to -180, away from the cut."""
    return np.asarray((np.degrees(np.angle(receptance)) + 270.0) % 360.0 - 270.0)


QUANTITIES = {
    "magnitude": Quantity(np.abs, "|receptance| ({unit})", lambda r: r.difference_db, _DECIBEL, True),
    "phase": Quantity(_phase, "phase (deg)", lambda r: r.difference_deg, _DEGREES),
    "real part": Quantity(np.real, "real part ({unit})", lambda r: r.difference_db, _DECIBEL),
    "imaginary part": Quantity(np.imag, "imaginary part ({unit})", lambda r: r.difference_deg, _DEGREES),
}


class RecordsView:
    """Figures of the chosen records; `show` moves the curves of the model, and `show_modes` the tables of modes."""

    def __init__(self, page: PageOfView) -> None:
        self._page, self._session = page, page.session
        quantity, self._is_dark = page.query.get("quantity", ""), page.query.get("theme") == "dark"
        names = list(QUANTITIES)
        self._quantity = Select(
            title="Quantity", options=names, value=quantity if quantity in names else names[0], width=140
        )
        self._chosen = CheckboxGroup(
            labels=[], active=[], inline=True, sizing_mode="stretch_width", margin=(24, 5, 5, 5)
        )
        self._quantity.on_change("value", self._rebuild)
        self._chosen.on_change("active", self._rebuild)
        self._moving = ColumnDataSource()
        self._frequencies = look.LiveText()
        self._figures = column(self._frequencies.layout, sizing_mode="stretch_width")
        self._figures.js_on_change("children", look.labels())
        self._tables: dict[str, look.LiveText] = {}
        self.layout = column(row(self._quantity, self._chosen, sizing_mode="stretch_width"), self._figures,
                             sizing_mode="stretch_width")  # fmt: skip

    @property
    def records(self) -> dict[str, TrialRecord]:
        """The records of the trial; none where the model has no value."""
        try:
            return {} if self._session.trial is None else self._session.trial.records
        except (ReceptanceError, ValueError):
            return {}

    def reset(self) -> None:
        """Show the records of another document."""
        names, kept = list(self.records), set(self._names())
        self._quantity.visible = self._chosen.visible = bool(names)
        first = [number for number, name in enumerate(names) if name in kept] or list(range(len(names)))[:MOST_SHOWN]
        self._chosen.labels = names
        if first == self._chosen.active:
            self._draw()
        else:
            self._chosen.active = first

    def _names(self) -> list[str]:
        """Return the names of the chosen records."""
        return [
            self._chosen.labels[number] for number in sorted(self._chosen.active) if number < len(self._chosen.labels)
        ]

    def _rebuild(self, attr: str, old: Any, new: Any) -> None:
        self._page.remember(quantity="" if self._quantity.value == "magnitude" else self._quantity.value)
        self._draw()

    def _shown(self) -> dict[str, TrialRecord]:
        records = self.records
        return {name: records[name] for name in self._names() if name in records}

    def _columns(self, records: dict[str, TrialRecord]) -> dict[str, NDArray[np.float64]]:
        """Return the columns that move, all of the length of the longest record."""
        quantity, columns = QUANTITIES[self._quantity.value], {}
        longest = max((r.calculated.size for r in records.values()), default=0)
        for number, record in enumerate(records.values()):
            values = {"f": record.observation.frequency_hz.real, "model": quantity.of(record.calculated),
                      "difference": quantity.difference(record)}  # fmt: skip
            for name, column_of in values.items():
                padded = np.full(longest, np.nan)
                padded[: column_of.size] = column_of
                columns[f"{name}{number}"] = padded
        return columns

    def _draw(self) -> None:
        records, campaign = self._shown(), self._session.campaign
        self._moving = ColumnDataSource(self._columns(records), name="moving")
        lines = {} if campaign is None else {name: campaign.measured_lines(name) for name in records}
        self._axis = _frequency_axis(records, lines)
        self._tables = {name: look.LiveText() for name in records}
        blocks: list[LayoutDOM] = [
            self._block(name, record, lines[name], number) for number, (name, record) in enumerate(records.items())
        ]
        if len(blocks) % 2 and len(blocks) > 1:
            blocks.append(Spacer(sizing_mode="stretch_width"))
        pairs = [blocks[i : i + 2] for i in range(0, len(blocks), 2)]
        self._figures.children = [
            *(row(*pair, sizing_mode="stretch_width") for pair in pairs),
            self._frequencies.layout,
        ]
        self._page.later(self.show_modes)  # the fits of measured modes take longer than the figures

    def _block(self, name: str, record: TrialRecord, lines: MeasuredLines, number: int) -> LayoutDOM:
        quantity, seen = QUANTITIES[self._quantity.value], record.observation
        unit = units.frf_unit(units.FRFKind("receptance", seen.response.direction, seen.excitation.direction))
        scale = "log" if quantity.is_logarithmic else "linear"
        title = f"{name}{', held out' if record.held_out else ''}"
        top = look.curve_figure(title, "", quantity.label.format(unit=unit), x_range=self._axis, y_axis_type=scale)
        measured = ColumnDataSource({"f": seen.frequency_hz.real, "measured": quantity.of(seen.receptance)})
        used = [
            top.line("f", "measured", source=measured, color=look.MEASURED, line_width=1.6, legend_label="measured"),
            top.line(f"f{number}", f"model{number}", source=self._moving, color=look.MODEL, line_width=1.6,
                     legend_label="model"),
        ]  # fmt: skip
        top.y_range.renderers = used
        with np.errstate(invalid="ignore"):
            values = quantity.of(lines.receptance)
        if lines.unused:
            left_out = np.where(np.any(list(lines.unused.values()), axis=0), values, np.nan)
            top.scatter(
                lines.frequency_hz,
                left_out,
                size=2,
                color=look.palette(self._is_dark)["unused"],
                legend_label="not used",
            )
        figures = [top]
        if lines.coherence is not None:
            coherence = look.curve_figure("", "", "coherence", height=75, x_range=self._axis, y_range=(0.0, 1.05))
            coherence.line(lines.frequency_hz, lines.coherence, color=look.MEASURED, line_width=1.0)
            coherence.yaxis.ticker = [0.0, 0.5, 1.0]
            coherence.name = f"{title}, coherence"
            figures.append(coherence)
        below = look.curve_figure("", "frequency (Hz)", quantity.below, height=150, x_range=self._axis)
        below.line(f"f{number}", f"difference{number}", source=self._moving, color=look.DIFFERENCE, line_width=1.2)
        below.name = f"{title}, {quantity.below}"
        for upper in figures:
            upper.xaxis.visible = False
        for each in (*figures, below):
            each.min_border_left = _LEFT
        unused = (f"{np.count_nonzero(which)} lines are not used: {reason}" for reason, which in lines.unused.items())
        return column(
            *figures, below, look.text(look.items(unused)), self._tables[name].layout, sizing_mode="stretch_width"
        )

    def show(self) -> None:
        """Move the curves to the values of the trial, all in one message."""
        records = self._shown()
        if not records:
            return
        columns = self._columns(records)
        self._moving.patch({n: [(slice(None), c)] for n, c in columns.items() if not n.startswith("f")})

    def show_modes(self) -> None:
        """Show the modes of the records at the values of the trial, and measured natural frequencies."""
        trial = self._session.trial
        for name, table in self._tables.items():
            table.show("" if trial is None else look.rows(("mode", *_MODES), _mode_rows(trial, name)))
        without = [] if trial is None else [n for n, o in trial.campaign.measurements.items() if not o.is_receptance]
        body = [[name, *cells] for name in without if trial is not None for cells in _mode_rows(trial, name)]
        self._frequencies.show(look.rows(("measurement", "mode", *_MODES), body) if body else "")


def _frequency_axis(records: dict[str, TrialRecord], lines: dict[str, MeasuredLines]) -> Range1d:
    """Return the range of the lines that are used, and of some beside them that are not."""
    if not records:
        return Range1d(0.0, 1.0)
    used = [record.observation.frequency_hz.real for record in records.values()]
    low, high = float(min(map(np.min, used))), float(max(map(np.max, used)))
    beside = _BESIDE * (high - low)
    first = min(float(each.frequency_hz[0]) for each in lines.values())
    last = max(float(each.frequency_hz[-1]) for each in lines.values())
    return Range1d(max(first, low - beside), min(last, high + beside))


def _mode_rows(trial: Trial, name: str) -> list[list[str]]:
    """Return the cells of the modes of a measurement; none where the model has no value."""
    try:
        modes = trial.modes(name)
    except (ReceptanceError, ValueError):
        return []
    numbers = trial.campaign.measurements[name].modes or range(1, len(modes) + 1)
    return [
        [
            str(number), _number(mode.measured_hz, ".1f"), _number(mode.calculated_hz, ".1f"),
            _number(mode.difference_percent, "+.2f"), _number(100.0 * mode.measured_damping, ".3g"),
            _number(100.0 * mode.calculated_damping, ".3g"),
        ]
        for number, mode in zip(numbers, modes, strict=True)
    ]  # fmt: skip


def _number(value: float, form: str) -> str:
    return format(value, form) if math.isfinite(value) else "-"
