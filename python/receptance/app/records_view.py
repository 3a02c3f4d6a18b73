"""Measured FRFs, the model at the values of the sliders, and their difference, over a common frequency axis."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from bokeh.layouts import column, row
from bokeh.models import ColumnDataSource, LayoutDOM, MultiChoice, Range1d, Select
from numpy.typing import NDArray

from receptance import units
from receptance.app import look
from receptance.app.session import Session
from receptance.campaign import TrialRecord
from receptance.errors import ReceptanceError

MOST_SHOWN = 4
"""Records that are shown at first."""
_DECIBEL, _DEGREES = "difference (dB)", "difference (deg)"


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


QUANTITIES = {
    "magnitude": Quantity(np.abs, "|receptance| ({unit})", lambda r: r.difference_db, _DECIBEL, True),
    "phase": Quantity(lambda h: np.degrees(np.angle(h)), "phase (deg)", lambda r: r.difference_deg, _DEGREES),
    "real part": Quantity(np.real, "real part ({unit})", lambda r: r.difference_db, _DECIBEL),
    "imaginary part": Quantity(np.imag, "imaginary part ({unit})", lambda r: r.difference_deg, _DEGREES),
}


class RecordsView:
    """Figures of the chosen records; `show` moves the curves of the model."""

    def __init__(self, session: Session, remember: Callable[..., None], quantity: str = "") -> None:
        self._session, self._remember = session, remember
        names = list(QUANTITIES)
        self._quantity = Select(title="Quantity", options=names, value=quantity if quantity in names else names[0])
        self._chosen = MultiChoice(title="Records", options=[], value=[], sizing_mode="stretch_width")
        self._quantity.on_change("value", self._rebuild)
        self._chosen.on_change("value", self._rebuild)
        self._moving = ColumnDataSource()
        self._figures = column(sizing_mode="stretch_width")
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
        names = list(self.records)
        kept = [name for name in self._chosen.value if name in names]
        self._chosen.options = names
        chosen = kept or names[:MOST_SHOWN]
        if chosen == self._chosen.value:
            self._draw()
        else:
            self._chosen.value = chosen

    def _rebuild(self, attr: str, old: Any, new: Any) -> None:
        self._remember(quantity="" if self._quantity.value == "magnitude" else self._quantity.value)
        self._draw()

    def _shown(self) -> dict[str, TrialRecord]:
        records = self.records
        return {name: records[name] for name in self._chosen.value if name in records}

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
        records = self._shown()
        self._moving = ColumnDataSource(self._columns(records), name="moving")
        lines = [record.observation.frequency_hz.real for record in records.values()]
        ends = (min(map(np.min, lines)), max(map(np.max, lines))) if lines else (0.0, 1.0)
        self._axis = Range1d(float(ends[0]), float(ends[1]))
        blocks = [self._block(name, record, number) for number, (name, record) in enumerate(records.items())]
        pairs = [blocks[i : i + 2] for i in range(0, len(blocks), 2)]
        self._figures.children = [row(*pair, sizing_mode="stretch_width") for pair in pairs]

    def _block(self, name: str, record: TrialRecord, number: int) -> LayoutDOM:
        quantity, seen = QUANTITIES[self._quantity.value], record.observation
        unit = units.frf_unit(units.FRFKind("receptance", seen.response.direction, seen.excitation.direction))
        scale = "log" if quantity.is_logarithmic else "linear"
        title = f"{name}{', held out' if record.held_out else ''}"
        top = look.curve_figure(title, "", quantity.label.format(unit=unit), x_range=self._axis, y_axis_type=scale)
        measured = ColumnDataSource({"f": seen.frequency_hz.real, "measured": quantity.of(seen.receptance)})
        top.line("f", "measured", source=measured, color=look.MEASURED, line_width=1.6, legend_label="measured")
        top.line(f"f{number}", f"model{number}", source=self._moving, color=look.MODEL, line_width=1.6,
                 legend_label="model")  # fmt: skip
        below = look.curve_figure("", "frequency (Hz)", quantity.below, height=150, x_range=self._axis)
        below.line(f"f{number}", f"difference{number}", source=self._moving, color=look.DIFFERENCE, line_width=1.2)
        below.name = f"{title}, {quantity.below}"
        return column(top, below, sizing_mode="stretch_width")

    def show(self) -> None:
        """Move the curves to the values of the trial, all in one message."""
        records = self._shown()
        if not records:
            return
        columns = self._columns(records)
        self._moving.patch({n: [(slice(None), c)] for n, c in columns.items() if not n.startswith("f")})
