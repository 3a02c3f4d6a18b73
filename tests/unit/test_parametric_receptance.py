"""Many candidates in one call equal the assemblies with these values, with either method."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from properties.test_invariance import rich
from receptance import (
    STEEL,
    Assembly,
    Coordinate,
    ModalPart,
    Mode,
    Observation,
    Part,
    PointJoint,
    Segment,
    Unknown,
    identify,
)
from receptance.sweep.parametric_receptance import ParametricReceptance, parametric_receptance

SEED = 8
FIELDS = PointJoint.columns_of
LINES = np.linspace(20.0, 6000.0, 333)
WINDOWED = LINES - 3.0j
JOINT = tuple(f"joint.{field}" for field in FIELDS)
SOME = ("tool.segment[1].length", "holder.segment[*].youngs_modulus", "joint.k_y", "sensor.mass")
NOSE = Coordinate("holder", 0.0)


def plain() -> Assembly:
    """Return tool, joint and holder for which the core can use power series."""
    steel = replace(STEEL, loss_factor=0.003)
    tool = Part([Segment(length=0.06, outer_diameter=0.012, material=steel)], name="tool")
    holder = Part([Segment(length=0.09, outer_diameter=0.05, material=steel)], name="holder")
    return Assembly([tool, PointJoint(k_y=1e8, k_theta=1e5, name="joint"), holder])


def joints(count: int, kind: str) -> np.ndarray:
    """Return rows of joints from soft to stiff: elastic, viscous, coupled, with a loss factor, or all of these."""
    print(f"seed {SEED}")
    draw = np.random.default_rng(SEED)
    rows = np.zeros((count, len(FIELDS)))
    rows[:, :2] = 10.0 ** draw.uniform([6.0, 3.0], [10.0, 7.0], (count, 2))
    if kind in ("viscous", "coupled", "all"):
        rows[:, 3:5] = 10.0 ** draw.uniform([0.0, -3.0], [4.0, 1.0], (count, 2))
    if kind in ("coupled", "all"):
        rows[:, 2] = draw.uniform(-0.9, 0.9, count) * np.sqrt(rows[:, 0] * rows[:, 1])
        rows[:, 5] = draw.uniform(-0.9, 0.9, count) * np.sqrt(rows[:, 3] * rows[:, 4])
    if kind in ("lossy", "all"):
        rows[:, 6] = draw.uniform(0.0, 0.1, count)
    return rows


def one_by_one(
    assembly: Assembly, addresses: tuple[str, ...], rows: np.ndarray, lines: np.ndarray, **points: Any
) -> np.ndarray:
    """Return the receptances of the assemblies themselves."""
    values = (dict(zip(addresses, row.tolist(), strict=True)) for row in rows)
    return np.array([assembly.replace(one).receptance(lines, **points) for one in values])


def assert_agrees(found: ParametricReceptance, rows: np.ndarray, h: np.ndarray) -> None:
    """Compare all results with the receptances of the assemblies."""
    got = found.receptance(rows)
    assert np.max(np.abs(got / h - 1.0)) <= 1e-9
    assert np.max(np.abs(found.magnitude(rows) / np.abs(h) - 1.0)) <= 1e-9
    draw = np.random.default_rng(SEED)
    measured = h[0] * (1.0 + 0.05 * draw.standard_normal(h.shape[1])) * np.exp(0.05j * draw.standard_normal(h.shape[1]))
    weights = draw.uniform(0.1, 10.0, h.shape[1])
    for residual, each in (("logarithm", np.log(measured / h)), ("complex", 1e9 * (measured - h))):
        expected = np.sum(np.abs(weights * each) ** 2, axis=1)
        scale = 1.0 if residual == "logarithm" else 1e18
        misfit = scale * found.misfit(rows, measured, weights, residual=residual)
        np.testing.assert_allclose(misfit, expected, rtol=1e-9)


@pytest.mark.parametrize("kind", ["elastic", "viscous", "coupled", "lossy", "all"])
@pytest.mark.parametrize("lines", [LINES, WINDOWED], ids=["real", "windowed"])
def test_joints_are_the_assemblies_with_them(kind: str, lines: np.ndarray) -> None:
    rows = joints(7, kind)
    found = parametric_receptance(plain(), JOINT, lines)
    assert found.method == "joint"
    assert_agrees(found, rows, one_by_one(plain(), JOINT, rows, lines))


def test_joints_between_any_coordinates_of_any_assembly() -> None:
    rows = joints(9, "all")
    found = parametric_receptance(rich(), JOINT, LINES, NOSE, Coordinate(direction="theta"))
    h = one_by_one(rich(), JOINT, rows, LINES, response=NOSE, excitation=Coordinate(direction="theta"))
    assert_agrees(found, rows, h)


@pytest.mark.parametrize("addresses", [JOINT[:4], (JOINT[0], "tool.segment[0].length")])
def test_a_measured_spindle_ends_the_assemblies(addresses: tuple[str, ...]) -> None:
    mode = Mode(frequency_hz=650.0, damping_ratio=0.03, y=0.25, theta=1.1)
    spindle = ModalPart(modes=[mode], residual_y=2e-9, residual_theta=2e-7, name="spindle")
    taper = PointJoint(k_y=2e9, k_theta=3e6, loss_factor=0.01, name="taper")
    mounted = Assembly([*plain().elements.values(), taper, spindle])
    rows = joints(3, "all")[:, :4] if len(addresses) > 2 else np.array([[1e8, 0.06], [3e8, 0.05]])
    assert_agrees(parametric_receptance(mounted, addresses, LINES), rows, one_by_one(mounted, addresses, rows, LINES))


def test_unvaried_parameters_keep_their_values() -> None:
    rows = joints(3, "viscous")[:, [1, 3]]
    addresses = ("joint.k_theta", "joint.c_y")
    assert_agrees(parametric_receptance(rich(), addresses, LINES), rows, one_by_one(rich(), addresses, rows, LINES))


@pytest.mark.parametrize("points", [{}, {"response": NOSE, "excitation": Coordinate("tool", 0.02)}])
def test_any_parameters_run_as_whole_models(points: dict[str, Coordinate]) -> None:
    values = np.array([rich().get(name) for name in SOME])
    rows = values * np.random.default_rng(SEED).uniform(0.8, 1.2, (6, values.size))
    found = parametric_receptance(rich(), SOME, LINES, **points)
    assert found.method == "models"
    assert_agrees(found, rows, one_by_one(rich(), SOME, rows, LINES, **points))


def test_rods() -> None:
    rods = Assembly(list(plain().elements.values()), motion="axial")
    addresses = ("joint.k_y", "tool.segment[0].length")
    rows = np.array([[1e8, 0.06], [3e8, 0.05]])
    found = parametric_receptance(rods, addresses, LINES)
    assert found.method == "models"
    assert_agrees(found, rows, one_by_one(rods, addresses, rows, LINES))


@pytest.mark.parametrize("addresses", [JOINT[:2], (*JOINT[:2], "tool.segment[0].outer_diameter")])
def test_results_are_bitwise_independent_of_threads_and_calls(addresses: tuple[str, ...]) -> None:
    rows = np.column_stack([joints(301, "viscous")[:, :2], np.linspace(0.01, 0.02, 301)])[:, : len(addresses)]
    measured = plain().receptance(LINES)
    whole = parametric_receptance(plain(), addresses, LINES, threads=1)
    cut = parametric_receptance(plain(), addresses, LINES, threads=2)
    cut.per_call = 17
    np.testing.assert_array_equal(whole.receptance(rows), cut.receptance(rows))
    np.testing.assert_array_equal(whole.magnitude(rows), cut.magnitude(rows))
    for residual in ("logarithm", "complex"):
        np.testing.assert_array_equal(
            whole.misfit(rows, measured, residual=residual), cut.misfit(rows, measured, residual=residual)
        )
    assert whole.receptance(rows[:0]).shape == (0, LINES.size)
    assert whole.misfit(rows[:0], measured).shape == (0,)


@pytest.mark.parametrize("lines", [LINES[:1], LINES[:7], LINES[:8], LINES[:65]])
def test_any_number_of_lines_and_joints(lines: np.ndarray) -> None:
    rows = joints(3, "viscous")
    assert_agrees(parametric_receptance(plain(), JOINT, lines), rows, one_by_one(plain(), JOINT, rows, lines))


def test_invalid_candidates_are_nan_and_leave_others_unchanged() -> None:
    rows = joints(6, "viscous")
    good = parametric_receptance(plain(), JOINT, LINES).receptance(rows)
    rows[1, 2] = 2.0 * np.sqrt(rows[1, 0] * rows[1, 1])  # indefinite
    rows[2, [0, 3]] = 0.0  # no stiffness in y
    rows[4, 6] = -0.1
    found = parametric_receptance(plain(), JOINT, LINES)
    none = np.array([False, True, True, False, True, False])
    for numbers in (found.receptance(rows), found.magnitude(rows), found.misfit(rows, good[0])[:, None]):
        np.testing.assert_array_equal(np.isnan(numbers).all(axis=1), none)
        np.testing.assert_array_equal(np.isnan(numbers).any(axis=1), none)
    np.testing.assert_array_equal(found.receptance(rows)[~none], good[~none])
    bored = parametric_receptance(plain(), ("tool.segment[0].inner_diameter", "joint.k_y"), LINES)
    numbers = bored.receptance([[0.0, 1e8], [0.02, 1e8]])
    assert np.isfinite(numbers[0]).all()
    assert np.isnan(numbers[1]).all()


def test_the_misfit_is_twice_the_cost_of_a_fit() -> None:
    rows = joints(1, "viscous")[:, :2]
    h = one_by_one(plain(), JOINT[:2], rows, LINES)[0] * np.exp(0.01 * np.sin(LINES))
    frf = Observation(assembly=plain(), frequency_hz=LINES, receptance=h, standard_deviation=0.02)
    fit = identify(
        frf,
        [Unknown(address="joint.k_y", lower=1e6, upper=1e10), Unknown(address="joint.k_theta", lower=1e3, upper=1e7)],
    )
    values = [[fit.values[name] for name in JOINT[:2]]]
    misfit = parametric_receptance(plain(), JOINT[:2], LINES).misfit(values, h, np.full(LINES.size, 50.0))
    assert misfit[0] == pytest.approx(2.0 * min(start.cost for start in fit.starts), rel=1e-6)


def test_errors_describe_the_mistake() -> None:
    found = parametric_receptance(plain(), JOINT[:2], LINES)
    for values, words in (
        ([[1e8]], r"expected \(m, 2\)"),
        ([[1e8, np.nan]], r"values\[0\]: joint.k_theta is nan"),
    ):
        with pytest.raises(ValueError, match=words):
            found.receptance(values)
    h = plain().receptance(LINES)
    for arguments, words in (
        ((h[1:],), "measured: shape"),
        ((h, np.ones(3)), "weights: shape"),
        ((0.0 * h,), "zero has no logarithm"),
        ((h, None, "magnitude"), "expected one of logarithm, complex"),
    ):
        with pytest.raises(ValueError, match=words):
            found.misfit([[1e8, 1e5]], *arguments)
    with pytest.raises(ValueError, match="all different"):
        parametric_receptance(plain(), (JOINT[0], JOINT[0]), LINES)
    with pytest.raises(ValueError, match="nothing"):
        parametric_receptance(plain(), ("joint.nothing",), LINES)
