"""Drawings of assemblies: the scale, the labels, and elements of every kind."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

import numpy as np
import pytest
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.patches import Polygon

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
    SectionShape,
    Segment,
    SpreadJoint,
)
from receptance.model.figure import draw_assemblies
from receptance.model.sketch import Drawing, Mark

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


def outlines(figure: Figure) -> list[np.ndarray]:
    """Return the four corners of each body that is drawn, in mm."""
    (axes,) = figure.axes
    return [patch.get_xy()[:4] for patch in axes.patches if isinstance(patch, Polygon)]


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
    corners = outlines(figure)
    assert np.ptp(corners[0][:, 0]) == pytest.approx(30.0)
    assert max(outline[:, 0].max() for outline in corners) == pytest.approx(88.0)
    assert max(np.ptp(outline[:, 1]) for outline in corners) == pytest.approx(45.0)
    (left, bottom), (right, top) = axes.transData.transform([(0.0, 0.0), (10.0, 10.0)])
    assert right - left == pytest.approx(top - bottom, rel=1e-6)


CONE = Segment(
    length=0.05,
    outer_diameter=0.03,
    end_outer_diameter=0.06,
    inner_diameter=0.01,
    end_inner_diameter=0.02,
    material=STEEL,
)


def test_cones_are_trapezoids_with_both_diameters() -> None:
    figure = Assembly([Part([CONE], name="nose")]).plot()
    assert "ø30–60/10–20" in texts(figure)
    outer, bore = outlines(figure)
    for outline, (near, far) in ((outer, (30.0, 60.0)), (bore, (10.0, 20.0))):
        assert outline == pytest.approx(
            np.array([[0.0, -near / 2], [50.0, -far / 2], [50.0, far / 2], [0.0, near / 2]])
        )


def test_an_attachment_is_on_the_surface_of_a_cone() -> None:
    rider = PointMass(mass=0.002, part="nose", position=0.02, name="rider")
    figure = Assembly([Part([CONE], name="nose")], [rider]).plot()
    (axes,) = figure.axes
    leaders = [line for line in axes.lines if np.allclose(line.get_xdata(), 20.0) and len(line.get_xdata()) == 2]
    assert [line.get_ydata()[0] for line in leaders] == pytest.approx([500.0 * CONE.at(0.4)[0]])


def test_a_part_of_many_pieces_has_the_labels_of_its_ends() -> None:
    pieces = [CONE.between(i / 30, (i + 1) / 30) for i in range(30)]
    labels = texts(Assembly([Part(pieces, name="nose")]).plot())
    assert {label for label in labels if label} == {"ø30/10", "ø60/20", "50", "nose"}


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


def test_flutes_are_hatched_around_their_core_and_strips_are_flat() -> None:
    mill = SectionShape.fluted(4, diameter=0.012, core_diameter=0.007)
    strip = SectionShape.rectangle(0.03, 0.004)
    part = Part(
        [
            Segment(length=0.03, outer_diameter=0.012, shape=mill, material=CARBIDE),
            Segment(length=0.04, outer_diameter=0.012, material=CARBIDE),
            Segment(length=0.02, outer_diameter=strip.diameter, shape=strip, material=STEEL),
        ],
        name="tool",
    )
    (axes,) = Assembly([part]).plot().axes
    heights = [np.ptp(body.get_xy()[:, 1]) for body in axes.patches if isinstance(body, Polygon)]
    assert heights[:4] == pytest.approx([12.0, 7.0, 12.0, 4.0], rel=1e-3)
    assert [bool(body.get_hatch()) for body in axes.patches[:4]] == [True, False, False, False]
    texts = [text.get_text() for text in axes.texts]
    assert "ø12, 4 flutes" in texts
    assert "30 x 4" in texts
