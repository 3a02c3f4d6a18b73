"""Natural frequencies against the published table, against finite elements that count on their own, and differences."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import mpmath
import numpy as np
import pytest
from numpy.typing import NDArray

from oracle import draw, elements, exact
from oracle.tables import Tables, joint, make, segment
from receptance import (
    Assembly,
    GroundSpring,
    Material,
    Part,
    PointJoint,
    PointMass,
    Segment,
    SingularInterfaceError,
    _core,
)
from validation import accuracy

MODELS = 500
GUARD = 1e-3
"""Relative width of the band on either side of the limit within which a mode may be counted or not."""
VALUES = 2e-4
WAVES = 25.0
"""Largest sum of wave number times length up to the limit: it keeps the finite elements small."""
MOST = 2**31
NO_PARAMETERS = np.zeros((0, 3))
STEEL = (200e9, 7800.0, 0.29)
Summarise = Callable[[str, str, object], None]

BEAMS = [
    (0.125, 0.010, 0.0, (200e9, 7800.0, 0.29), (2837.30, 7597.40, 14325.63, 22605.17)),
    (0.120, 0.020, 0.0, (580e9, 14500.0, 0.24), (7318.47, 18268.10, 32037.50, 47216.83)),
    (0.100, 0.050, 0.020, (210e9, 7850.0, 0.3), (15830.80, 26338.44, 38263.16, 38945.42)),
]


def natural(model: Tables, upper_hz: float, parameters: NDArray[np.float64] = NO_PARAMETERS) -> tuple[NDArray, NDArray]:
    """Return natural frequencies in Hz and their derivatives."""
    found, slope = _core.Model(0, *model).natural_frequencies(2 * np.pi * upper_hz, MOST, parameters)
    return found / (2 * np.pi), slope / (2 * np.pi)


@pytest.mark.parametrize(("length", "outer", "inner", "constants", "expected"), BEAMS)
def test_reference_table(length: float, outer: float, inner: float, constants: tuple, expected: tuple) -> None:
    modulus, density, nu = constants
    material = Material(youngs_modulus=modulus, density=density, poisson_ratio=nu, loss_factor=0.01)
    bar = Assembly([Part([Segment(length=length, outer_diameter=outer, inner_diameter=inner, material=material)])])
    upper = 1.0001 * expected[-1]
    np.testing.assert_allclose(bar.natural_frequencies(upper), expected, rtol=0, atol=0.01)
    assert len(bar.natural_frequencies(0.9999 * expected[-1])) == 3
    assert len(bar.natural_frequencies(0.9999 * expected[0])) == 0


class Drawn(NamedTuple):
    """A random undamped model and the range to look in."""

    model: Tables
    upper_hz: float
    label: str


def draw_model(seed: int, number: int) -> Drawn:
    """Draw a model of any kind, its losses taken out, and a limit that the finite elements can reach."""
    rng = np.random.default_rng([seed, 2, number])
    case = draw.case(rng)
    segments, joints, masses, grounds = (table.copy() for table in case.tables)
    segments[:, [8, 12]], joints[:, 5:], grounds[:, 4:] = 0.0, 0.0, 0.0
    model = Tables(segments, joints, masses, grounds)
    waves = WAVES * rng.uniform(0.3, 1.0)

    def total(hz: float) -> float:
        return sum(elements.wave_number_bound(row, 2 * np.pi * hz) * row[2] for row in segments)

    low, high = 1e-3, 1e7
    while high > 1.001 * low:
        middle = float(np.sqrt(low * high))
        low, high = (middle, high) if total(middle) < waves else (low, middle)
    return Drawn(model, min(low, 200e3), f"seed {seed}, model {number}: {case.label}, to {min(low, 200e3):.6g} Hz")


@pytest.mark.parametrize("part", [0, *(pytest.param(part, marks=pytest.mark.slow) for part in (1, 2, 3, 4))])
def test_all_natural_frequencies_of_random_models_are_found(part: int, summarise: Summarise) -> None:
    seed, counted, worst, faults = accuracy.base_seed(), 0, 0.0, []
    for number in range(part * MODELS // 5, (part + 1) * MODELS // 5):
        model, upper, label = draw_model(seed, number)
        expected = elements.natural_frequencies(model, upper * (1 + GUARD))
        found, _ = natural(model, upper)
        sure = int(np.sum(expected < upper * (1 - GUARD)))
        if not sure <= len(found) <= len(expected):
            faults.append(f"{len(found)} modes, expected {sure} to {len(expected)}: {label}")
            continue
        error = np.abs(found / expected[: len(found)] - 1.0)
        counted += len(found)
        worst = max(worst, float(error.max(initial=0.0)))
        if np.any(error > VALUES):
            faults.append(f"error {error.max():.2g} of mode {error.argmax() + 1} of {len(found)}: {label}")
    text = f"{MODELS // 5} models of seed {seed}: {counted} modes, none missed, worst difference {worst:.1e}"
    summarise(f"natural frequencies {part + 1}/5", text if not faults else "\n".join(faults), [counted, worst])
    assert not faults, "\n".join(faults)
    assert counted > MODELS // 5


def chain(*, grounded: bool) -> Tables:
    """Return a tool, a collet and a holder, free or on a support, with a mass and a coupled joint."""
    return make(
        [
            segment(0, 1, 0.062, 0.0127, (580e9, 14500.0, 0.22)),
            segment(3, 4, 0.04, 0.045, STEEL, inner_diameter=0.0127, core=(580e9, 14500.0, 0.22)),
            segment(4, 5, 0.09, 0.05, STEEL, inner_diameter=0.02),
        ],
        [joint(1, 2, 6e8, 1e5, 1e6), joint(2, 3, 2e9, 4e5)],
        [[0, 0.6e-3, 1e-8], [2, 0.1, 2e-5]],
        [[5, 3e7, 2e4, -1e5, 0.0, 0.0, 0.0, 0.0]] if grounded else (),
    )


TREE = make(
    [segment(0, 1, 0.08, 0.02, STEEL), segment(1, 2, 0.12, 0.04, STEEL), segment(4, 3, 0.05, 0.012, STEEL)],
    [joint(1, 3, 2e7, 5e3, 1e4)],
    [[4, 0.01, 1e-6]],
)


def every_parameter(model: Tables) -> NDArray[np.float64]:
    """Return all entries that natural frequencies depend on, but for values of zero."""
    first = (2, 2, 1, 1)
    last = (14, 5, 3, 4)
    rows = [
        (table, row, column)
        for table, values in enumerate(model)
        for row in range(len(values))
        for column in range(first[table], last[table])
        if (table, column) not in {(0, 8), (0, 12), (0, 13)} and values[row, column] != 0.0
    ]
    return np.array(rows, dtype=np.float64)


@pytest.mark.parametrize("model", [chain(grounded=False), chain(grounded=True), TREE], ids=["free", "grounded", "tree"])
def test_derivatives_against_differences(model: Tables) -> None:
    parameters, upper, step = every_parameter(model), 15e3, 3e-5
    assert len(parameters) >= 20
    f, slope = natural(model, upper, parameters)
    assert slope.shape == (len(f), len(parameters))
    assert len(f) >= 3
    for number, (table, row, column) in enumerate(parameters.astype(int)):
        sides = []
        for sign in (1.0, -1.0):
            moved = [values.copy() for values in model]
            moved[table][row, column] *= 1.0 + sign * step
            sides.append(natural(Tables(*moved), 1.01 * upper)[0][: len(f)])
        difference = (sides[0] - sides[1]) / (2 * step)
        relative = slope[:, number] * model[table][row, column]
        np.testing.assert_allclose(
            relative, difference, rtol=2e-6, atol=2e-8 * f.max(), err_msg=f"{table, row, column}"
        )


def test_loss_and_damping_have_no_influence() -> None:
    model = chain(grounded=True)
    lossy = Tables(*(table.copy() for table in model))
    lossy.segments[:, 8] = 0.05
    lossy.joints[:, 5:7], lossy.joints[:, 8] = 100.0, 0.1
    lossy.grounds[:, 7] = 0.2
    np.testing.assert_array_equal(natural(lossy, 15e3)[0], natural(model, 15e3)[0])
    parameters = np.array([[0, 0, 8], [1, 0, 5], [1, 1, 8], [3, 0, 7]], dtype=float)
    np.testing.assert_array_equal(natural(model, 15e3, parameters)[1], 0.0)


@pytest.mark.parametrize("model", [chain(grounded=False), chain(grounded=True), TREE], ids=["free", "grounded", "tree"])
def test_against_elements_and_poles(model: Tables) -> None:
    found, _ = natural(model, 40e3)
    expected = elements.natural_frequencies(model, 40e3)
    np.testing.assert_allclose(found, expected, rtol=1e-7)
    tip = np.array([[0.0, 0.0]])
    for f in found:
        lines = 2 * np.pi * f * np.array([1 - 2e-9, 1 - 1e-9, 1 + 1e-9, 1 + 2e-9]) + 0j
        h = _core.Model(0, *model).receptance(_core.Lines(lines), tip, tip, NO_PARAMETERS, 1)[0].real.ravel()
        assert h[1] < 0 < h[2] or h[2] < 0 < h[1]
        # a pole, and so strong that it dominates its neighbourhood: twice as far, half as large
        np.testing.assert_allclose(h[[0, 3]], h[[1, 2]] / 2, rtol=1e-3)


def test_repeated_calls_give_the_same_bits_and_a_limit_gives_the_first_modes() -> None:
    model = chain(grounded=True)
    parameters = every_parameter(model)
    first = natural(model, 40e3, parameters)
    for _ in range(3):
        again = natural(model, 40e3, parameters)
        np.testing.assert_array_equal(first[0], again[0])
        np.testing.assert_array_equal(first[1], again[1])
    some, _ = _core.Model(0, *model).natural_frequencies(2 * np.pi * 40e3, 3, NO_PARAMETERS)
    np.testing.assert_allclose(some / (2 * np.pi), first[0][:3], rtol=1e-13)
    assert len(_core.Model(0, *model).natural_frequencies(2 * np.pi * 40e3, 0, NO_PARAMETERS)[0]) == 0


def test_rods_have_their_textbook_frequencies() -> None:
    length, (modulus, density, nu) = 0.3, STEEL
    model = make([segment(i, i + 1, length / 3, 0.02, STEEL, inner_diameter=0.01) for i in range(3)])
    for motion, stiffness in ((1, modulus), (2, modulus / (2 * (1 + nu)))):
        found, _ = _core.Model(motion, *model).natural_frequencies(2 * np.pi * 60e3, MOST, NO_PARAMETERS)
        speed = np.sqrt(stiffness / density)
        expected = np.arange(1, 100) * np.pi * speed / length
        np.testing.assert_allclose(found, expected[expected < 2 * np.pi * 60e3], rtol=1e-12)


def test_facade_leaves_rigid_modes_out() -> None:
    steel = Material(youngs_modulus=200e9, density=7800.0, poisson_ratio=0.29)
    bar = Part([Segment(length=0.1, outer_diameter=0.02, material=steel)], name="bar")
    free = Assembly([bar]).natural_frequencies(20e3)
    pinned = Assembly([bar], [GroundSpring(k_y=1e6, part="bar")]).natural_frequencies(20e3)
    held = Assembly([bar], [GroundSpring(k_y=1e6, k_theta=1e3, part="bar")]).natural_frequencies(20e3)
    assert len(pinned) == len(free) + 1
    assert len(held) == len(free) + 2
    heavy = Assembly([bar], [PointMass(mass=1e-3, inertia=1e-7, part="bar")]).natural_frequencies(20e3)
    assert len(heavy) == len(free)
    assert np.all(heavy < free)


STIFF = [(1e6, 1e18), (1e6, 1e40), (1e40, 1e3), (1e40, 1e38)]
"""Stiffnesses in y and in theta, one far above the other or both far above the parts."""


def with_spring(element: str, k_y: float, k_theta: float, k_ytheta: float) -> Tables:
    """Return three segments with this spring as a joint or to ground, and a soft one at the other place."""
    spring, soft = [k_y, k_theta, k_ytheta], [1e8, 1e5, 0.0]
    rows = (spring, soft) if element == "joint" else (soft, spring)
    return make(
        [segment(0, 1, 0.08, 0.016, STEEL), segment(1, 2, 0.05, 0.016, STEEL), segment(3, 4, 0.1, 0.03, STEEL)],
        [joint(2, 3, *rows[0])],
        [],
        [[4, *rows[1], 0.0, 0.0, 0.0, 0.0]],
    )


def distance_from_pole(model: Tables, hz: float) -> float:
    """Return the relative distance of a frequency from the pole of the tip's receptance beside it, by many digits."""
    w = [2 * np.pi * hz, 2 * np.pi * hz * (1 + 1e-7)]
    with mpmath.workdps(50):
        near, far = (1 / exact.receptance(model, line, [(0, 0)], [(0, 0)])[0][0].real for line in w)
        return float(near * (w[1] - w[0]) / (near - far) / w[0])


@pytest.mark.parametrize("element", ["joint", "ground"])
@pytest.mark.parametrize("correlation", [0.0, 0.5, -0.9])
@pytest.mark.parametrize(("k_y", "k_theta"), STIFF)
def test_stiff_springs_keep_the_modes_of_the_soft_direction(
    element: str, correlation: float, k_y: float, k_theta: float
) -> None:
    model = with_spring(element, k_y, k_theta, correlation * np.sqrt(k_y) * np.sqrt(k_theta))
    found, _ = natural(model, 6e3)
    # Beside a rigid direction coupling only takes its share of the soft one.
    left = 1.0 - correlation**2
    rigid = (left * k_y, k_theta) if k_y < k_theta else (k_y, left * k_theta)
    expected = elements.natural_frequencies(with_spring(element, *rigid, 0.0), 6e3)
    np.testing.assert_allclose(found, expected, rtol=1e-4)
    assert max(abs(distance_from_pole(model, hz)) for hz in found) < 1e-13


@pytest.mark.parametrize(
    "grounds",
    [
        [[0, 1e6, 0.0, 0.0]],
        [[0, 0.0, 1e3, 0.0]],
        [[0, 1e6, 0.0, 0.0], [2, 1e25, 0.0, 0.0]],
        [[0, 1e6, 0.0, 0.0], [2, 0.0, 1e25, 0.0]],
        [[2, 1e25, 1.0, 0.0]],
        # Two hinges at node 2, and one there with another halfway.
        [[0, 1e6, 1e6 * 0.25**2, 1e6 * 0.25], [2, 1e25, 0.0, 0.0]],
        [[0, 1e6, 1e6 * 0.125**2, 1e6 * 0.125], [2, 1e25, 0.0, 0.0]],
        [[0, 1e200, 1e200, 0.0]],
    ],
)
def test_modes_that_no_ground_resists_are_counted_whatever_the_stiffnesses(grounds: list[list[float]]) -> None:
    rows = [[*row, 0.0, 0.0, 0.0, 0.0] for row in grounds]
    model = make([segment(0, 1, 0.125, 0.02, STEEL), segment(1, 2, 0.125, 0.02, STEEL)], [], [], rows)
    expected = elements.natural_frequencies(model, 20e3)
    np.testing.assert_allclose(natural(model, 20e3)[0], expected, rtol=1e-6)


@pytest.mark.parametrize("upper", [0.0, -1.0, np.nan, np.inf])
def test_a_limit_must_be_positive(upper: float) -> None:
    steel = Material(youngs_modulus=200e9, density=7800.0, poisson_ratio=0.29)
    bar = Assembly([Part([Segment(length=0.1, outer_diameter=0.02, material=steel)])])
    with pytest.raises(ValueError, match="upper_hz"):
        bar.natural_frequencies(upper)
    with pytest.raises(ValueError, match="upper limit"):
        _core.Model(0, *chain(grounded=False)).natural_frequencies(upper, 10, NO_PARAMETERS)


def test_a_joint_that_only_a_dashpot_holds_is_singular() -> None:
    steel = Material(youngs_modulus=200e9, density=7800.0, poisson_ratio=0.29)
    bar = Part([Segment(length=0.1, outer_diameter=0.02, material=steel)])
    damped = Assembly([bar, PointJoint(k_y=1e8, c_theta=10.0), bar])
    with pytest.raises(SingularInterfaceError, match="joint"):
        damped.natural_frequencies(1e4)
