"""An assembly to scale with its mode shapes, and the values of what is chosen in it."""

from __future__ import annotations

from html import escape
from typing import Any

import numpy as np
from bokeh.layouts import column, row
from bokeh.models import ColumnDataSource, CustomJS, Legend, LegendItem, Range1d, Select

from receptance.app import look
from receptance.app.value_inputs import ValueInputs
from receptance.app.view import PageOfView
from receptance.campaign import Campaign, Trial
from receptance.campaign.check import marks_of
from receptance.errors import ReceptanceError
from receptance.model.assembly import Assembly
from receptance.model.modes import ModeShapes, mode_shapes
from receptance.model.sketch import Drawing, Mark, Sketch, extent
from receptance.report.colours import COLOURS, INK
from receptance.report.table import percent

_WIDTH, _DOTS_PER_INCH = 820.0, 96.0
"""Width of the axes in pixels for which labels are laid out, and pixels of an inch."""
_MOST_WIDE = 1150
"""Largest width of the figures in pixels: a wider drawing leaves no room for what is below it."""
_MARGIN = 0.045
"""Room beside the assembly as a share of its length."""
_SHAPES = 4
"""Mode shapes that are drawn."""
_UPPER_HZ = 10e3
"""Limit of modes without measurements."""
_MARKERS = {"response": "triangle", "excitation": "inverted_triangle", "mass": "square", "ground": "triangle"}
_FIT = """const frame = this.inner_width; if (frame > 0) {
  const height = Math.round(frame * this.tags[0] + this.outer_height - this.inner_height);
  if (Math.abs(height - this.height) > 1) this.height = height; }"""
"""Height of the drawing at which both axes have one scale."""
_LEFT = 66
"""Room beside the axes in pixels, so that both figures have the same axis."""


class AssemblyView:
    """The drawing; `show` moves it to the values of the trial."""

    def __init__(self, page: PageOfView) -> None:
        self._page, self._session = page, page.session
        self._is_dark = page.query.get("theme") == "dark"
        self._campaign: Campaign | None = None
        """The last one without mistakes: it is drawn while the text has some."""
        self._assembly = Select(title="Assembly", options=[], width=220)
        self._element = Select(title="Part, joint or point", options=[], width=220)
        self._values = ValueInputs(page)
        self._materials = look.text()
        self._sources = {name: ColumnDataSource() for name in ("bodies", "joints", "symbols", "labels", "lines")}
        self._axis, self._height = Range1d(0.0, 1.0), Range1d(-1.0, 1.0)
        self._draw_figures()
        self._assembly.on_change("value", self._choose_assembly)
        self._element.on_change("value", self._choose_element)
        for name in ("bodies", "joints", "symbols"):
            source = self._sources[name]
            source.selected.on_change("indices", lambda attr, old, new, source=source: self._tap(source, new))
        self.layout = column(
            row(self._assembly, self._element),
            self._drawing,
            self._materials,
            self._modes,
            self._values.layout,
            sizing_mode="stretch_width",
        )

    # Figures.

    def _draw_figures(self) -> None:
        ink = look.readable(INK, self._is_dark)
        options: dict[str, Any] = {"x_range": self._axis, "max_width": _MOST_WIDE, "min_border_left": _LEFT}
        drawing = look.curve_figure("", "", "", height=260, y_range=self._height, tools="tap,save", **options)
        drawing.yaxis.visible = drawing.grid.visible = drawing.xaxis.visible = False
        drawing.name, drawing.tags = "assembly to scale", [0.25]
        for change in ("inner_width", "tags"):
            drawing.js_on_change(change, CustomJS(code=f"const fit = function() {{ {_FIT} }}; fit.call(cb_obj)"))
        marked = {"nonselection_alpha": 1.0, "hover_alpha": 1.0}
        drawing.segment("x0", "y0", "x1", "y1", color="colour", line_width="width", source=self._sources["lines"])
        drawing.patches(
            "xs", "ys", source=self._sources["bodies"], fill_color="fill", line_color="edge", line_width="width",
            hatch_pattern="hatch", hatch_color="edge", hatch_alpha=0.5, hatch_scale=8, nonselection_fill_alpha=1.0,
            nonselection_line_alpha=1.0, nonselection_hatch_alpha=0.5,
        )  # fmt: skip
        drawing.segment(
            "x0", "y0", "x1", "y1", source=self._sources["joints"], color="colour", line_width="width",
            nonselection_line_alpha=1.0,
        )  # fmt: skip
        drawing.scatter(
            "x", "y", source=self._sources["symbols"], marker="marker", size=9, fill_color="colour", line_color="edge",
            line_width="width", **marked,
        )  # fmt: skip
        drawing.text(
            "x", "y", "text", source=self._sources["labels"], text_color="colour", text_align="center",
            text_baseline="middle", text_font_size="12px", background_fill_color=look.palette(self._is_dark)["panel"],
            padding=1,
        )  # fmt: skip
        self._drawing = drawing
        shapes = look.curve_figure("", "distance from the tip (mm)", "y (1/√kg)", height=190, tools="save", **options)
        shapes.name = "mode shapes"
        self._shapes = ColumnDataSource({"x": [], **{f"y{i}": [] for i in range(_SHAPES)}})
        curves = [
            shapes.line(
                "x", f"y{i}", source=self._shapes, line_width=2,
                color=look.readable(COLOURS[i], self._is_dark) if i else look.MODEL,
            )
            for i in range(_SHAPES)
        ]  # fmt: skip
        self._legend = [LegendItem(label="", renderers=[curve]) for curve in curves]
        shapes.add_layout(Legend(orientation="horizontal", items=self._legend, spacing=14, margin=2), "above")
        shapes.ray(x=0, y=0, length=0, angle=[0, np.pi], color=ink, line_width=0.6)
        self._modes = shapes

    # What is chosen.

    def reset(self) -> None:
        """Show the assemblies of another document."""
        campaign = self._session.campaign
        if campaign is not None:
            self._campaign = campaign
        names = [] if self._campaign is None else list(self._campaign.assemblies)
        self._assembly.options = names
        if self._assembly.value not in names:
            linked = self._page.query.get("assembly", "")
            self._assembly.value = linked if linked in names else next(iter(names), "")
        self.show()
        self._choose_values()

    def _choose_assembly(self, attr: str, old: str, new: str) -> None:
        self._page.remember(assembly=new)
        self.show()
        self._page.later(self._choose_values)

    def _choose_element(self, attr: str, old: str, new: str) -> None:
        self._page.remember(element=new)
        self.show()
        # The drawing answers at once; new inputs take the browser longer.
        self._page.later(self._choose_values)

    def _choose_values(self) -> None:
        self._values.choose(self._assembly.value, self._element.value)

    def _tap(self, source: ColumnDataSource, indices: list[int]) -> None:
        if indices:
            name = source.data["element"][indices[-1]]
            source.selected.indices = []
            if name in self._element.options:
                self._element.value = name

    def _chosen(self) -> tuple[Assembly, tuple[Mark, ...]] | None:
        """Return the assembly at the values of the trial, as it was measured, and the points of measurement."""
        campaign, trial, name = self._campaign, self._session.trial, self._assembly.value
        if campaign is None or not name:
            return None
        measured = {key: seen for key, seen in campaign.measurements.items() if seen.configuration == name}
        marks = tuple(dict.fromkeys(mark for seen in measured.values() for mark in marks_of(seen)))
        return _assembly_of(campaign, trial, name, next(iter(measured), None)), marks

    # The drawing.

    def show(self) -> None:
        """Draw the assembly at the values of the trial."""
        chosen = self._chosen()
        for part in (self._drawing, self._modes, self._materials):
            part.visible = chosen is not None
        if chosen is None:
            return
        assembly, marks = chosen
        names = [*assembly.elements, *assembly.attachments]
        if self._element.options != names:
            self._element.options = names
        if self._element.value not in names:
            linked = self._page.query.get("element", "")
            self._element.value = linked if linked in names else names[0]  # draws
            return
        self._show_sketch(assembly, marks)
        self._show_shapes(assembly)

    def _show_sketch(self, assembly: Assembly, marks: tuple[Mark, ...]) -> None:
        length, fills = extent(assembly), dict[str, str]()
        ends = (-_MARGIN * length, (1.0 + _MARGIN) * length)
        scale = (ends[1] - ends[0]) / (_WIDTH / _DOTS_PER_INCH)
        sketch = Sketch(Drawing(assembly, "", marks), scale, ends, fills)
        low, high = sketch.below.end - 0.05 * scale, sketch.above.end + 0.05 * scale
        self._axis.update(start=ends[0], end=ends[1])
        self._height.update(start=low, end=high)
        self._drawing.tags = [(high - low) / (ends[1] - ends[0])]
        c, chosen = look.palette(self._is_dark), self._element.value
        accent, plain = c["accent"], "#222222"  # fills of materials are light in both themes
        corners = [body.corners() for body in sketch.bodies]
        self._sources["bodies"].data = {
            "xs": [[x for x, _ in points] for points in corners],
            "ys": [[y for _, y in points] for points in corners],
            "fill": [c["panel"] if body.fill == "white" else body.fill for body in sketch.bodies],
            "hatch": ["/" if body.hatch else " " for body in sketch.bodies],
            "edge": [accent if body.element == chosen else c["ink"] if body.fill == "white" else plain
                     for body in sketch.bodies],
            "width": [2.5 if body.element == chosen else body.edge for body in sketch.bodies],
            "element": [body.element for body in sketch.bodies],
        }  # fmt: skip
        sides = [
            (x, x + along, y0, y1, name)
            for x, along, half, name in sketch.joints
            for y0, y1 in (((half, half), (-half, -half)) if along else ((-half, half),))
        ]
        self._sources["joints"].data = {
            **{key: [side[i] for side in sides] for i, key in enumerate(("x0", "x1", "y0", "y1", "element"))},
            "colour": [accent if side[4] == chosen else look.readable(COLOURS[1], self._is_dark) for side in sides],
            "width": [6.0 if side[4] == chosen else 4.0 for side in sides],
        }
        self._sources["symbols"].data = {
            "x": [x for x, *_ in sketch.symbols],
            "y": [y + 0.06 * scale * (1.0 if y > 0.0 else -1.0) for _, y, *_ in sketch.symbols],
            "marker": [_MARKERS[kind] for _, _, kind, *_ in sketch.symbols],
            "colour": [look.readable(colour, self._is_dark) for *_, colour, _ in sketch.symbols],
            "edge": [accent if name == chosen else c["panel"] for *_, name in sketch.symbols],
            "width": [3.0 if name == chosen else 0.5 for *_, name in sketch.symbols],
            "element": [name for *_, name in sketch.symbols],
        }
        self._show_labels(sketch)
        swatches = (f'<span class="swatch" style="background:{f}"></span>{escape(n)}' for n, f in fills.items() if n)
        self._materials.text = "".join(swatches)

    def _show_labels(self, sketch: Sketch) -> None:
        labels = sketch.labels
        self._sources["labels"].data = {
            "x": [label.centre[0] for label in labels],
            "y": [label.centre[1] for label in labels],
            "text": [label.text for label in labels],
            "colour": [look.readable(label.colour, self._is_dark) for label in labels],
        }
        ink, tick = look.readable(INK, self._is_dark), 0.03 * sketch.scale
        middle = (*sketch.ends, 0.0, 0.0, look.palette(self._is_dark)["pale"], 1.0)
        leaders = [
            (label.leader[0], label.leader[0], label.leader[1], label.centre[1],
             look.readable(label.colour, self._is_dark), 0.5)
            for label in labels if label.leader is not None
        ]  # fmt: skip
        spans = [(low, high, y, y, ink, 0.6) for low, high, y in sketch.spans]
        ticks = [(x, x, y - tick, y + tick, ink, 0.6) for low, high, y in sketch.spans for x in (low, high)]
        arrows = [
            (x, x, y, y + 0.22 * sketch.scale, look.readable(colour, self._is_dark), 1.4)
            for x, y, kind, colour, _ in sketch.symbols if kind == "excitation"
        ]  # fmt: skip
        lines = [middle, *leaders, *spans, *ticks, *arrows]
        keys = ("x0", "x1", "y0", "y1", "colour", "width")
        self._sources["lines"].data = {key: [line[i] for line in lines] for i, key in enumerate(keys)}

    def _show_shapes(self, assembly: Assembly) -> None:
        campaign = self._campaign
        upper = None if campaign is None else campaign.highest_frequency
        try:
            shapes = mode_shapes(assembly, upper or _UPPER_HZ)
        except (ReceptanceError, ValueError):
            self._modes.visible = False
            return
        count = min(len(shapes), _SHAPES)
        data = {f"y{i}": _deflection(shapes, i) if i < count else np.full(shapes.distance.size, np.nan)
                for i in range(_SHAPES)}  # fmt: skip
        self._shapes.data = {"x": 1e3 * shapes.distance, **data}
        for i, item in enumerate(self._legend):
            item.visible = i < count
            if item.visible:
                frequency, damping = shapes.frequency_hz[i], percent(shapes.damping_ratio[i], 3)
                item.label = {"value": f"{frequency:.1f} Hz, damping {damping}"}


def _deflection(shapes: ModeShapes, number: int) -> Any:
    """Return the deflection of a mode at the phase of its largest one."""
    y = shapes.y[number]
    return (y * np.conj(y[np.abs(y).argmax()]) / np.abs(y).max()).real


def _assembly_of(campaign: Campaign, trial: Trial | None, name: str, measurement: str | None) -> Assembly:
    """Return an assembly at the values of a trial, with the sensor of a measurement."""
    try:
        if trial is not None and measurement in trial.campaign.measurements:
            return trial.measured_assembly(measurement)
        if trial is not None and name in trial.campaign.assemblies:
            return trial.described_campaign.assemblies[name]
    except (ReceptanceError, ValueError):
        pass  # the model has no value there; the described assembly has
    return campaign.assemblies[name] if measurement is None else campaign.measurements[measurement].assembly
