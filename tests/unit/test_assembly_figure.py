"""Drawings of assemblies: the scale, the labels, and elements of every kind."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Rectangle

from receptance import (
    CARBIDE,
    STEEL,
    Assembly,
    Coordinate,
    GroundSpring,
    ModalPart,
    Mode,
    Part,
    PointJoint,
    PointMass,
    Section,
    Segment,
    SpreadJoint,
)
from receptance.model.figure import Drawing, Mark, draw_assemblies

TOOL = Part(
    [Segment(length=0.03, outer_diameter=0.01, material=CARBIDE)]
    + [Segment(length=0.002, outer_diameter=0.012 + 0.001 * i, material=CARBIDE) for i in range(4)],
    name="tool",
)
HOLDER = Part([Segment(length=0.05, outer_diameter=0.045, inner_diameter=0.02, material=STEEL)], name="holder")
ALONG = SpreadJoint(
    length=0.04,
    shank=Section(outer_diameter=0.012, material=CARBIDE),
    sleeve=Section(outer_diameter=0.04, inner_diameter=0.012, material=STEEL),
    k_y=1e9,
    name="along",
)
SPINDLE = ModalPart(modes=[Mode(frequency_hz=800.0, damping_ratio=0.03, y=1.0, theta=0.0)], name="spindle")
EVERYTHING = Assembly(
    [TOOL, ALONG, HOLDER, SPINDLE],
    [PointMass(mass=0.002, part="tool", name="forgotten"), GroundSpring(k_y=1e6, part="holder", name="fixture")],
)
POINTED = Assembly([TOOL, PointJoint(k_y=1e8, k_theta=1e5, name="joint"), HOLDER])


def texts(figure: Figure) -> set[str]:
    return {text.get_text() for axes in figure.axes for text in axes.texts}


def boxes(figure: Figure) -> Iterator[tuple[str, object]]:
    renderer = FigureCanvasAgg(figure).get_renderer()
    figure.draw(renderer)
    for axes in figure.axes:
        for text in axes.texts:
            if text.get_text():
                yield text.get_text(), text.get_window_extent(renderer)


def test_everything_is_named() -> None:
    marks = (Mark("response", Coordinate("tool"), "response"), Mark("hit", Coordinate("holder", "end"), "excitation"))
    figure = draw_assemblies([Drawing(EVERYTHING, "all", marks)])
    assert {"tool", "along", "holder", "spindle", "forgotten 2 g", "fixture", "response", "hit"} <= texts(figure)
    assert {"ø10", "ø45/20", "30", "40", "50"} <= texts(figure)


def test_lengths_are_to_scale() -> None:
    figure = POINTED.plot()
    (axes,) = figure.axes
    figure.draw_without_rendering()
    shapes = [shape for shape in axes.patches if isinstance(shape, Rectangle)]
    assert [shape.get_width() for shape in shapes][:1] == pytest.approx([30.0])
    assert max(shape.get_x() + shape.get_width() for shape in shapes) == pytest.approx(88.0)
    assert max(shape.get_height() for shape in shapes) == pytest.approx(45.0)
    (left, bottom), (right, top) = axes.transData.transform([(0.0, 0.0), (10.0, 10.0)])
    assert right - left == pytest.approx(top - bottom, rel=1e-6)


def test_two_assemblies_have_the_same_scale() -> None:
    longer = POINTED.replace({"tool.segment[0].length": 0.1})
    figure = draw_assemblies([Drawing(POINTED), Drawing(longer)])
    figure.draw_without_rendering()
    widths = [np.ptp(axes.transData.transform([(0.0, 0.0), (10.0, 0.0)])[:, 0]) for axes in figure.axes]
    assert widths[0] == pytest.approx(widths[1])


@pytest.mark.parametrize("assembly", [EVERYTHING, POINTED])
def test_labels_do_not_overlap(assembly: Assembly) -> None:
    marks = tuple(Mark(f"a long name of point {i}", Coordinate("tool"), "response") for i in range(3))
    found = list(boxes(draw_assemblies([Drawing(assembly, "", marks)])))
    for (name, one), (other, two) in combinations(found, 2):
        assert not one.overlaps(two), f"{name} and {other}"  # type: ignore[attr-defined]
