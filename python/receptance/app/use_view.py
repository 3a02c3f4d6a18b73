"""The view "Use": stable depths of the cuts, the operating point under the pointer, and the catalogue of tools."""

from __future__ import annotations

from html import escape
from typing import Any

import numpy as np
from bokeh.events import MouseMove
from bokeh.layouts import column, row
from bokeh.models import ColumnDataSource, CrosshairTool, LayoutDOM, Range1d, Spinner
from numpy.typing import NDArray

from receptance import catalogue, report
from receptance.app import look, results
from receptance.app.commands import Commands
from receptance.app.view import PageOfView
from receptance.catalogue import Catalogue
from receptance.errors import ReceptanceError
from receptance.report import Rejection
from receptance.report.colours import COLOURS
from receptance.report.html import list_html, reasons_html, shown, table_html
from receptance.stability import Lobes, operating_point
from receptance.stability.operating import top_of

_NAME = "use"
_STABLE, _UNCERTAIN, _CHATTER = COLOURS[2], COLOURS[0], COLOURS[1]
_STEPS = 50
"""Steps of the operating point over the axes."""


class UseView:
    """The view "Use"."""

    title = "Use"

    def __init__(self, page: PageOfView) -> None:
        self._page, self._session = page, page.session
        session = self._session
        commands = {
            "stability": ("Lobes", session.cut),
            "catalogue": ("Catalogue", session.predict_catalogue),
        }
        self._commands = Commands(page, commands, "Stop")
        self._general, self._catalogue = look.result(), look.result()
        self._diagrams: list[_Diagram] = []
        self._cuts = column(sizing_mode="stretch_width")
        exports = results.export_buttons
        self._stability = column(
            self._general, exports(session, lambda: session.stability, page.say), self._cuts,
            sizing_mode="stretch_width", visible=False,
        )  # fmt: skip
        self._tools = column(
            self._catalogue, exports(session, lambda: session.catalogue, page.say),
            sizing_mode="stretch_width", visible=False,
        )  # fmt: skip
        self.layout = column(
            self._commands.layout, self._stability, self._tools,
            sizing_mode="stretch_width",
        )  # fmt: skip
        page.when_shown(_NAME, self._show_nominal)
        session.on("trial", call=self._show_nominal)
        session.on("stability", call=self._show_stability)
        session.on("catalogue", call=self._show_catalogue)

    def _show_stability(self) -> None:
        result = self._session.stability
        self._stability.visible = result is not None
        self._diagrams = [] if result is None else [_Diagram(lobes) for lobes in result.values() if lobes.has_limits]
        if result is None:
            self._cuts.children = []
            return
        self._general.text = "".join([
            f"<h2>{shown(result.heading)}</h2>", reasons_html(Rejection(widened=result.rejection.widened)),
            *list_html("Advice", result.warnings()),
            *list_html("Notes", result.grouped_notes()),
        ])  # fmt: skip
        diagrams = iter(self._diagrams)
        self._cuts.children = [
            next(diagrams).layout if lobes.has_limits else _without_diagram(lobes) for lobes in result.values()
        ]
        self._show_nominal()

    def _show_nominal(self) -> None:
        """Show the lobes at the values of the sliders."""
        trial = self._session.trial
        if trial is None or not self._diagrams or self._page.shown != _NAME:
            return
        try:
            nominal = trial.stability()
        except (ValueError, ReceptanceError):
            return  # the model has no value here, which its view shows
        for diagram in self._diagrams:
            diagram.show_nominal(nominal[diagram.lobes.name])

    def _show_catalogue(self) -> None:
        result, campaign = self._session.catalogue, self._session.campaign
        self._tools.visible = result is not None
        if result is None or campaign is None:
            return
        names = [str(row[0]) for row in result.tables()[0].rows]
        outlines = zip(
            names, catalogue.figure.draw_outlines(Catalogue(campaign)), strict=False
        )  # the table has the first tools
        drawings = [report.figure.as_svg(figure, name) for name, figure in outlines]
        self._catalogue.text = results.answer(result) + results.details(result, drawings)


def _without_diagram(lobes: Lobes) -> LayoutDOM:
    """Return why a cut has no diagram: an unsafe depth of cut is worse than none."""
    place = look.result()
    place.text = "".join([
        f"<h3>{shown(lobes.title_of_cut())}</h3>", reasons_html(Rejection(unusable=lobes.rejection.unusable)),
        *(f"<p>{shown(text)}</p>" for text in lobes.sentences()[1:]), *list_html("Notes", lobes.grouped_notes()),
    ])  # fmt: skip
    return place


class _Diagram:
    """The lobes of a cut with bands, and the operating point."""

    def __init__(self, lobes: Lobes) -> None:
        self.lobes = lobes
        self._order = np.argsort(lobes.speeds_rpm, kind="stable")
        self._top = top_of(lobes)
        speed = lobes.speeds_rpm[self._order]
        self._nominal = ColumnDataSource({"speed": speed, "depth": np.full(speed.size, np.nan)})
        self._place = ColumnDataSource({"speed": [], "depth": []})
        self._text = look.status()
        ends = (float(speed[0]), float(speed[-1]))
        self._speed = Spinner(title="Spindle speed (rpm)", low=ends[0], high=ends[1], value=None,
                              step=(ends[1] - ends[0]) / _STEPS, width=160)  # fmt: skip
        self._depth = Spinner(title="Depth of cut (mm)", low=0.0, value=None, step=self._top / _STEPS, width=160,
                              format="0.000")  # fmt: skip
        for spinner in (self._speed, self._depth):
            spinner.on_change("value", self._typed)
        table = look.result()
        table.text = "".join([
            *map(table_html, lobes.tables()), *(f"<p>{shown(text)}</p>" for text in lobes.sentences()[1:]),
            *list_html("Notes", lobes.grouped_notes()),
        ])  # fmt: skip
        self.layout = column(
            self._drawn(speed, ends),
            row(self._speed, self._depth, self._text.layout, sizing_mode="stretch_width"),
            table,
            sizing_mode="stretch_width",
        )  # fmt: skip

    def _in_mm(self, depth: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return depths over ascending speed, high ones just beyond the axis."""
        return np.minimum(1e3 * depth[self._order], 2.0 * self._top)

    def _drawn(self, speed: NDArray[np.float64], ends: tuple[float, float]) -> LayoutDOM:
        lobes = self.lobes
        plot = look.curve_figure(
            lobes.title_of_cut(), "spindle speed (rpm)", "depth of cut (mm)", 420,
            x_range=Range1d(*ends), y_range=Range1d(0.0, self._top),
        )  # fmt: skip
        plot.add_tools(CrosshairTool(line_color=look.MEASURED))
        limit = self._in_mm(lobes.depth)
        low = limit if lobes.lower is None else self._in_mm(lobes.lower)
        high = limit if lobes.upper is None else self._in_mm(lobes.upper)
        curves = {"speed": speed, "limit": limit, "low": low, "high": high, "stable": self._in_mm(lobes.certain_depth)}
        source = ColumnDataSource(
            {**curves, "ground": np.zeros(speed.size), "top": np.full(speed.size, 2.0 * self._top)}
        )
        areas = [("ground", "low", _STABLE, "stable")]
        areas += [("low", "high", _UNCERTAIN, "95 % band of the limit")] if lobes.lower is not None else []
        areas += [("high", "top", _CHATTER, "chatter")]
        for below, above, colour, label in areas:
            plot.varea("speed", below, above, source=source, color=colour, alpha=0.18, legend_label=label)
        plot.line("speed", "limit", source=source, color=_UNCERTAIN, line_width=1.8, legend_label="limit")
        if lobes.probability is not None:
            plot.line("speed", "stable", source=source, color=_STABLE, line_width=1.8, line_dash="dotted",
                      legend_label=f"stable with {100.0 * lobes.probability:g} %")  # fmt: skip
        plot.line("speed", "depth", source=self._nominal, color=look.MEASURED, line_width=1.8, line_dash="dashed",
                  legend_label="limit at the values of Model")  # fmt: skip
        best = [cut for cut in lobes.best_cuts if 1e3 * cut.depth <= self._top]
        plot.scatter([cut.speed_rpm for cut in best], [1e3 * cut.depth for cut in best], marker="inverted_triangle",
                     size=10, color=look.MEASURED, legend_label="recommended")  # fmt: skip
        plot.scatter("speed", "depth", source=self._place, marker="circle_cross", size=13, color=_CHATTER,
                     fill_alpha=0.0, line_width=2)  # fmt: skip
        plot.add_layout(plot.legend[0], "right")
        plot.xaxis.formatter.use_scientific = False
        plot.on_event(MouseMove, self._pointed)
        return plot

    def _pointed(self, event: Any) -> None:
        if event.x is not None and self._speed.low <= event.x <= self._speed.high and event.y >= 0.0:
            self._say(event.x, event.y)

    def _typed(self, attr: str, old: Any, new: Any) -> None:
        speed, depth = self._speed.value, self._depth.value
        if speed is not None and depth is not None:
            self._place.data = {"speed": [speed], "depth": [depth]}
            self._say(speed, depth)

    def _say(self, speed: float, depth_mm: float) -> None:
        self._text.show(escape(str(operating_point(self.lobes, speed, 1e-3 * depth_mm))))

    def show_nominal(self, lobes: Lobes) -> None:
        """Show the limit at the values of the sliders."""
        depth = self._in_mm(lobes.depth) if lobes.has_limits else np.full(self._order.size, np.nan)
        self._nominal.patch({"depth": [(slice(None), depth)]})
