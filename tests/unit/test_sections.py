"""Shapes of sections: closed forms, invalid input and messages, planes and averages."""

from __future__ import annotations

import math
import pickle
from typing import Any

import numpy as np
import pytest

from receptance import CARBIDE, STEEL, Assembly, Part, ReceptanceWarning, SectionShape, Segment
from receptance.model import section_solutions
from receptance.model.flutes import LEAST_FLUTES, MOST_CORE, MOST_FLUTES, fluted_outline, smallest_core
from receptance.model.meshing import MeshError
from receptance.model.outlines import MOST_POINTS, Outline, checked_outline, moments
from receptance.model.sections import CIRCLE


def _circle(radius: float, count: int = 180) -> np.ndarray:
    angle = 2.0 * np.pi * np.arange(count) / count
    step = 2.0 * np.pi / count
    return math.sqrt(step / math.sin(step)) * radius * np.column_stack([np.cos(angle), np.sin(angle)])


def test_a_polygon_of_a_circle_is_the_circle() -> None:
    shape = SectionShape.polygon(_circle(0.01))
    for plane in ("x", "y", "mean"):
        for shear in ("cowper", "hutchinson"):
            factors = shape.factors(plane, shear)  # type: ignore[arg-type]
            assert factors[:4] == pytest.approx((1.0, 1.0, 1.0, 1.0), rel=1e-3)
            assert factors[4:] == pytest.approx(CIRCLE[shear], abs=1e-4)  # type: ignore[index]


def test_a_polygon_with_a_round_hole_is_the_ring() -> None:
    """Cowper's ring: 1/kappa = ((7 + 6 nu) (1 + m^2)^2 + (20 + 12 nu) m^2) / (6 (1 + nu) (1 + m^2)^2)."""
    ratio = 0.6
    shape = SectionShape.polygon(_circle(0.01), [_circle(0.01 * ratio)])
    factors = shape.factors("x")
    assert factors.area == pytest.approx(1.0 - ratio**2, rel=1e-3)
    assert factors.moment == pytest.approx(1.0 - ratio**4, rel=1e-3)
    assert factors.torsion == pytest.approx(1.0 - ratio**4, rel=1e-3)
    part = (1.0 + ratio**2) ** 2
    at_zero, with_nu = 7.0 / 6.0 + 20.0 * ratio**2 / (6.0 * part), 1.0 + 12.0 * ratio**2 / (6.0 * part)
    assert factors[4:] == pytest.approx((at_zero, with_nu - at_zero, 0.0), abs=1e-3)


@pytest.mark.parametrize("height", [0.05, 0.02, 0.006])
def test_polygons_and_series_of_rectangles_agree(height: float) -> None:
    width = 0.05
    series = SectionShape.rectangle(width, height)
    polygon = SectionShape.polygon([(0, 0), (width, 0), (width, height), (0, height)])
    assert polygon.diameter == pytest.approx(series.diameter)
    assert polygon.moment == pytest.approx(series.moment, rel=1e-9)
    assert polygon.torsion == pytest.approx(series.torsion, rel=1e-3)
    for first, second in ((polygon.cowper, series.cowper), (polygon.hutchinson, series.hutchinson)):
        for mine, exact in zip(first, second, strict=True):
            assert mine == pytest.approx(exact, rel=1e-3, abs=1e-3)


def test_the_equilateral_triangle_has_its_torsion_constant() -> None:
    side = 0.01
    shape = SectionShape.polygon([(0, 0), (side, 0), (side / 2, side * math.sqrt(0.75))])
    assert shape.torsion_constant_m4 == pytest.approx(math.sqrt(3.0) / 80.0 * side**4, rel=1e-4)
    assert shape.is_isotropic


def test_a_strip_clamped_by_its_sides_has_frequencies_of_both_planes() -> None:
    shape = SectionShape.rectangle(0.05, 0.002)
    lowest = {}
    for name, placed in (("flat", shape), ("upright", shape.turned())):
        strip = Segment(length=0.5, outer_diameter=shape.diameter, shape=placed, material=STEEL)
        lowest[name] = Assembly([Part([strip])]).natural_frequencies(20e3)[0]
    wave = 4.730040744862704
    for name, depth in (("flat", 0.002), ("upright", 0.05)):
        slender = wave**2 / (2 * np.pi * 0.5**2) * math.sqrt(STEEL.youngs_modulus * depth**2 / 12 / STEEL.density)
        assert lowest[name] == pytest.approx(slender, rel=0.04 if name == "upright" else 1e-3)


@pytest.mark.parametrize("number", range(LEAST_FLUTES, MOST_FLUTES + 1))
def test_all_flutes_have_a_section_between_core_and_cylinder(number: int) -> None:
    for core in np.linspace(smallest_core(number) + 1e-3, MOST_CORE, 4):
        outline = checked_outline("flutes", fluted_outline(number, float(core)))
        radii = np.hypot(*outline.points.T)
        assert radii.min() == pytest.approx(core / 2, rel=1e-3)
        assert radii.max() == pytest.approx(0.5, rel=1e-3)
        shape = SectionShape.fluted(number, diameter=0.012, core_diameter=0.012 * float(core))
        factors = shape.factors("x")
        assert core**2 < factors.area < 1.0
        assert core**4 < factors.moment < 1.0
        assert core**4 < factors.torsion < factors.area**2
        assert shape.is_isotropic


def test_the_outline_has_the_integral_of_its_formula() -> None:
    """Four flutes: the region below the arc a sin + sqrt(r^2 - a^2 cos^2) less the half circle, by quadrature."""
    outer, core = 0.5, 0.6
    inner = core * outer
    a = (outer**2 - inner**2) / (2 * outer)
    r = outer - a
    depth = outer - inner
    points, weights = np.polynomial.legendre.leggauss(60)
    theta = np.pi / 4 * (points + 1.0)
    reach = a * np.sin(theta) + np.sqrt(r**2 - a**2 * np.cos(theta) ** 2)
    area = np.pi / 4 * weights @ (reach**2 / 2) - np.pi * depth**2 / 8
    half = np.pi * (depth / 2) ** 4 / 4 + np.pi / 2 * (depth / 2) ** 2 * (r + a - depth / 2) ** 2
    polar = np.pi / 4 * weights @ (reach**4 / 4) - half
    exact = moments(Outline(fluted_outline(4, core), ()))
    assert exact.area == pytest.approx(4 * area, rel=1e-4)
    assert exact.xx == pytest.approx(2 * polar, rel=1e-4)
    assert exact.yy == pytest.approx(2 * polar, rel=1e-4)


def test_two_flutes_average_compliance_and_inertia() -> None:
    straight = SectionShape.fluted(2, diameter=0.01, core_diameter=0.006, straight=True)
    helical = SectionShape.fluted(2, diameter=0.01, core_diameter=0.006)
    soft, stiff = sorted(straight.moment)
    assert stiff > 1.5 * soft
    assert helical.factors("x").moment == pytest.approx(2 / (1 / soft + 1 / stiff))
    assert helical.factors("y").inertia == pytest.approx((soft + stiff) / 2)
    assert straight.factors("mean") == pytest.approx(helical.factors("x"))
    assert {straight.factors(plane).moment for plane in ("x", "y")} == {soft, stiff}  # type: ignore[arg-type]


def test_shapes_are_values() -> None:
    first = SectionShape.fluted(4, diameter=0.012, core_diameter=0.007)
    assert pickle.loads(pickle.dumps(first)) == first
    assert hash(first) == hash(SectionShape.fluted(4, diameter=0.012, core_diameter=0.007))
    assert first != SectionShape.fluted(3, diameter=0.012, core_diameter=0.007)


def test_a_fluted_tool_bends_between_core_and_blank() -> None:
    shape = SectionShape.fluted(4, diameter=0.012, core_diameter=0.0072)

    def lowest(**section: Any) -> float:
        bar = Segment(length=0.06, material=CARBIDE, **section)
        return float(Assembly([Part([bar])]).natural_frequencies(60e3)[0])

    # Free bars: frequencies grow with the radius of gyration, which is that of neither cylinder.
    gyration = math.sqrt(shape.factors("y").moment / shape.factors("y").area)
    assert lowest(outer_diameter=0.012, shape=shape) == pytest.approx(gyration * lowest(outer_diameter=0.012), rel=0.06)


SQUARE = [(0.0, 0.0), (20.0, 0.0), (20.0, 20.0), (0.0, 20.0)]


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (
            {"points": [(0, 0), (20, 20), (20, 0), (0, 20)]},
            r"points\[0\] to \[1\], \(0, 0\) mm to \(20, 20\) mm, crosses or touches points\[2\] to \[3\]",
        ),
        ({"points": [(0, 0), (20, 0), (5, 0), (5, 9)]}, r"crosses or touches"),
        ({"points": SQUARE[:2]}, r"points has 2 different points, expected at least 3"),
        ({"points": [*SQUARE[:2], SQUARE[1], SQUARE[2]]}, r"points\[2\] repeats the point before it, \(20, 0\) mm"),
        ({"points": [(0, 0), (10, 0), (20, 0)]}, "enclose no area"),
        ({"points": [(0, 0), (10, math.nan), (20, 5)]}, r"points\[1\] is \(10.0, nan\), expected finite numbers in mm"),
        ({"points": [1, 2, 3]}, r"has the shape \(3,\), expected \(n, 2\)"),
        ({"points": SQUARE, "unit": "m"}, r'extend over 20 m, expected .*unit="mm"'),
        ({"points": SQUARE, "unit": "um"}, r"extend over 20 um, expected a section of 0.1 mm"),
        ({"points": SQUARE, "unit": "kg"}, "unit is 'kg', expected a unit of length"),
        (
            {"points": SQUARE, "holes": [[(30, 5), (35, 5), (30, 9)]]},
            r"holes\[0\] is outside the outline: \(30, 5\) mm",
        ),
        (
            {"points": SQUARE, "holes": [[(15, 5), (25, 5), (15, 9)]]},
            r"holes\[0\]\[0\] to \[1\].* points\[1\] to \[2\]",
        ),
        (
            {"points": SQUARE, "holes": [[(4, 4), (16, 4), (10, 16)], [(9, 6), (11, 6), (10, 8)]]},
            r"holes\[1\] and holes\[0\] overlap",
        ),
        ({"points": _circle(9.0, MOST_POINTS + 1)}, "has 2001 points, expected at most 2000; take one point in 2"),
    ],
)
def test_errors_of_polygons_name_point_and_unit(arguments: dict[str, Any], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        SectionShape.polygon(**{"unit": "mm", **arguments})


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ((1, 0.01, 0.006), "number is 1, expected 2 to 20 flutes; the centroid"),
        (
            (21, 0.01, 0.006),
            "number is 21, expected 2 to 20 flutes; with more the section is nearly that of a cylinder",
        ),
        ((4, 0.01, 0.012), "core_diameter is 12 mm, expected less than the diameter 10 mm"),
        ((4, 0.01, 0.0005), r"core_diameter is 0.5 mm, 0.05 of the diameter; with 4 flutes expected 0.17"),
        ((16, 0.01, 0.004), "with 16 flutes expected 0.5"),
        ((4, 0.0, 0.0), "diameter is 0 mm, expected a positive length"),
    ],
)
def test_errors_of_flutes_say_what_is_possible(arguments: tuple[int, float, float], words: str) -> None:
    number, diameter, core = arguments
    with pytest.raises(ValueError, match=words):
        SectionShape.fluted(number, diameter=diameter, core_diameter=core)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"area": 66.0}, r"area is 66 m\^2, more than the .* check the units, 1 mm\^2 is 1e-6 m\^2"),
        ({"second_moment": 3.7e-12}, r"at least .* that of a circle; check the units, 1 mm\^4 is 1e-12 m\^4"),
        ({"second_moment": 370.0}, r"at most .* check the units, 1 mm\^4 is 1e-12 m\^4"),
        ({"second_moment": (1e-10, 2e-10, 3e-10)}, "second_moment has 3 numbers"),
        ({"torsion_constant": 1e-9}, "torsion_constant is 1e-09 m.4, expected at most the sum of the second moments"),
        ({"shear_coefficient": 85.0}, "shear_coefficient is 85, expected a number such as 0.85"),
        ({"diameter": -1.0}, "diameter is -1 m, expected a positive number"),
    ],
)
def test_properties_that_no_section_has_are_refused(changes: dict[str, Any], words: str) -> None:
    good = {"diameter": 0.012, "area": 66e-6, "second_moment": 3.7e-10}
    SectionShape.from_properties(**good)  # type: ignore[arg-type]
    with pytest.raises(ValueError, match=words):
        SectionShape.from_properties(**{**good, **changes})


def test_coupled_planes_and_negative_coefficients_are_refused() -> None:
    angle = SectionShape.polygon([(0, 0), (30, 0), (30, 4), (4, 4), (4, 30), (0, 30)], unit="mm")
    with pytest.raises(ValueError, match=r"principal axes are at 45 deg .* turn the points by -45 deg"):
        angle.factors("x")
    assert angle.averaged().factors("x") == pytest.approx(angle.factors("mean"))
    with pytest.raises(ValueError, match=r"Hutchinson is negative in the plane y.*give shear=.cowper"):
        SectionShape.rectangle(0.05, 0.002).factors("y", "hutchinson")


def test_turned_points_give_the_same_shape() -> None:
    """Random shapes about their own principal axes do not depend on the axes of the drawing."""
    seed = 20261129
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    for _ in range(5):
        corners = int(rng.integers(5, 12))
        angle = np.sort(rng.uniform(0, 2 * np.pi, corners)) + np.linspace(0, 0.5, corners)
        points = (rng.uniform(4.0, 10.0, corners) * np.array([np.cos(angle), np.sin(angle)])).T
        turn = rng.uniform(-0.2, 0.2)
        matrix = np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]])
        try:
            first = SectionShape.polygon(points, unit="mm")
        except ValueError as error:  # a random polygon may cross itself where it does not go around the origin
            assert "crosses" in str(error)  # noqa: PT017
            continue
        second = SectionShape.polygon(points @ matrix + rng.uniform(-5, 5, 2), unit="mm")
        assert sorted(second.moment) == pytest.approx(sorted(first.moment), rel=1e-9)
        assert second.torsion == pytest.approx(first.torsion, rel=3e-3)
        assert np.sort(np.array(second.cowper)[:, 0]) == pytest.approx(np.sort(np.array(first.cowper)[:, 0]), rel=3e-3)


def test_without_a_mesh_approximations_are_told(monkeypatch: pytest.MonkeyPatch) -> None:
    def without_mesh(*arguments: object) -> None:
        raise MeshError

    monkeypatch.setattr(section_solutions, "mesh_of", without_mesh)
    monkeypatch.setattr("receptance.errors.importlib.util.find_spec", lambda name: None)
    with pytest.warns(ReceptanceWarning, match=r"compact section .* pip install 'receptance\[sections\]'"):
        shape = SectionShape.polygon([(0, 0), (21.5, 0), (21.5, 9.5), (0, 9.5)], unit="mm")
    series = SectionShape.rectangle(0.0215, 0.0095)
    assert shape.cowper[0] == pytest.approx(series.cowper[0])
    assert shape.torsion == pytest.approx(series.torsion, rel=0.1)
    assert shape.moment == pytest.approx(series.moment)


def test_a_large_shape_is_told_to_be_in_metres() -> None:
    with pytest.warns(ReceptanceWarning, match="give lengths in metres"):
        SectionShape.rectangle(50.0, 2.0)
