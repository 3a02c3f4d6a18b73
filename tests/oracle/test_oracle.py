"""The references against independent results, and against each other."""

from __future__ import annotations

import math

import mpmath
import numpy as np
import pytest

from . import draw, elements, exact, tables
from .arithmetic import Gmpy2Arithmetic, MpmathArithmetic, gmpy2
from .resonance import cutoff, resonance_above
from .tables import Tables, joint, make, segment

pytestmark = pytest.mark.slow

STEEL = (200e9, 7800.0, 0.29)
CARBIDE = (580e9, 14500.0, 0.24)
HOLDER = (210e9, 7850.0, 0.3)
REFERENCE_BEAMS = [
    (segment(0, 1, 0.125, 0.01, STEEL), (2837.30, 7597.40, 14325.63, 22605.17), 188.9e3),
    (segment(0, 1, 0.120, 0.02, CARBIDE), (7318.47, 18268.10, 32037.50, 47216.83), 120.0e3),
    (
        segment(0, 1, 0.100, 0.05, HOLDER, inner_diameter=0.02),
        (15830.80, 26338.44, 38263.16, 38945.42),
        31.09e3,
    ),
]


def ends(far: int) -> list[tuple[int, int]]:
    return [(0, 0), (0, 1), (far, 0), (far, 1)]


def assert_close(actual: list, expected: list, tolerance: float) -> None:
    for x, y in zip(np.ravel(actual), np.ravel(expected), strict=True):
        assert abs(x - y) <= tolerance * abs(y)


def rich_assembly() -> Tables:
    """Return losses, a core, a coupled joint, a point mass, a ground and a side branch."""
    return make(
        [
            segment(0, 1, 0.04, 0.012, CARBIDE, loss_factor=0.002),
            segment(2, 3, 0.05, 0.04, STEEL, inner_diameter=0.012, core=CARBIDE, loss_factor=1e-3),
            segment(3, 4, 0.08, 0.05, HOLDER, inner_diameter=0.02, shear_model=tables.HUTCHINSON),
            segment(5, 3, 0.02, 0.008, STEEL),
        ],
        [joint(1, 2, 2e7, 3e4, 4e5, (20.0, 0.05, 0.3), 0.01)],
        [[2, 0.02, 1e-6]],
        [[4, 1e8, 1e5, 0.0, 100.0, 0.0, 0.0, 0.05]],
    )


def by_exponential(row: list[float], w: complex) -> list[list[mpmath.mpc]]:
    """Return a free segment's receptance at both ends by the Taylor series of its first-order system."""
    _, _, length, outer, inner, modulus, density, nu, loss, *_ = map(mpmath.mpf, row)
    q = (inner / outer) ** 2
    area = mpmath.pi / 4 * (outer**2 - inner**2)
    moment = mpmath.pi / 64 * (outer**4 - inner**4)
    kappa = 6 * (1 + nu) * (1 + q) ** 2 / ((7 + 6 * nu) * (1 + q) ** 2 + (20 + 12 * nu) * q)
    lossy = 1 + 1j * loss
    shear = kappa * modulus / (2 * (1 + nu)) * area * lossy
    w2 = mpmath.mpc(w) ** 2
    system = mpmath.zeros(4)  # of y, theta, M, V
    system[0, 1], system[0, 3] = 1, 1 / shear
    system[1, 2] = 1 / (modulus * moment * lossy)
    system[2, 3], system[2, 1] = -1, -density * moment * w2
    system[3, 0] = -density * area * w2
    transfer = mpmath.expm(system * length, method="taylor")
    columns = []
    for load in range(4):
        # inner loads at the near end are minus the outer ones, at the far end plus
        outer_loads = [mpmath.mpf(load == i) for i in range(4)]
        near = mpmath.matrix([-outer_loads[1], -outer_loads[0]])
        far = mpmath.matrix([outer_loads[3], outer_loads[2]])
        motion = mpmath.lu_solve(transfer[2:4, 0:2], far - transfer[2:4, 2:4] * near)
        end = transfer[0:2, 0:2] * motion + transfer[0:2, 2:4] * near
        columns.append([motion[0], motion[1], end[0], end[1]])
    return [list(line) for line in zip(*columns, strict=True)]


@pytest.mark.parametrize(("row", "frequencies", "turning"), REFERENCE_BEAMS)
def test_reference_natural_frequencies(row: list[float], frequencies: tuple[float, ...], turning: float) -> None:
    """The exact resonances, the finite elements and the published table agree; the receptance peaks there."""
    model = make([row])
    by_elements = elements.natural_frequencies(model, 1.01 * frequencies[-1])
    np.testing.assert_allclose(by_elements, frequencies, atol=0.006, rtol=0)
    for frequency in by_elements:
        w = resonance_above(model.segments[0], 2 * np.pi * frequency * 0.9999, "free-free", 1e6)
        assert w is not None
        assert w == pytest.approx(2 * np.pi * frequency, rel=1e-9)
        at, off = (abs(exact.receptance(model, x, [(0, 0)], [(0, 0)])[0][0]) for x in (w, 1.001 * w))
        assert at > 1e11 * off
    assert cutoff(model.segments[0]) / (2 * np.pi) == pytest.approx(turning, rel=5e-4)


def test_slender_beam_is_euler_bernoulli() -> None:
    row = make([segment(0, 1, 1.0, 1e-3, STEEL)]).segments[0]
    scale = math.sqrt(200e9 * 1e-6 / 16 / 7800.0)
    for wave in (4.7300407, 7.8532046, 10.9956078):
        w = resonance_above(row, 0.99 * wave**2 * scale, "free-free", 1e6)
        assert w == pytest.approx(wave**2 * scale, rel=2e-5)


@pytest.mark.parametrize(
    ("length", "outer", "w"),
    [(0.125, 0.01, 1e4), (1e-4, 0.05, 6.0), (0.05, 0.05, 3e5 - 20j), (2.0, 0.01, 2e4), (0.1, 0.05, 1e6)],
)
def test_single_segment_against_matrix_exponential(length: float, outer: float, w: complex) -> None:
    row = segment(0, 1, length, outer, STEEL, inner_diameter=0.3 * outer, loss_factor=0.01)
    with mpmath.workdps(150):
        expected = by_exponential(row, w)
        assert_close(exact.receptance(make([row]), w, ends(1), ends(1)), expected, 1e-40)


def test_exactly_at_the_cut_off() -> None:
    """With these constants S/r is 16 exactly, so that one wave number is zero and not merely small."""
    row = segment(0, 1, 2.0, 1.0, (7.0, 3.0, 0.0))
    model = make([row])
    assert cutoff(model.segments[0]) == 4.0
    with mpmath.workdps(100):
        assert_close(exact.receptance(model, 4.0, ends(1), ends(1)), by_exponential(row, 4.0), 1e-30)


def test_rigid_body_at_low_frequency() -> None:
    length, outer = 0.1, 0.02
    area, moment = math.pi / 4 * outer**2, math.pi / 64 * outer**4
    mass = 7800.0 * area * length
    inertia = mass * length**2 / 12 + 7800.0 * moment * length
    w = 1e-3
    found = exact.receptance_complex128(make([segment(0, 1, length, outer, STEEL)]), w, ends(1), ends(1))
    arms = np.array([[1.0, -length / 2], [0.0, 1.0], [1.0, length / 2], [0.0, 1.0]])
    expected = arms @ np.diag([-1 / (mass * w**2), -1 / (inertia * w**2)]) @ arms.T
    np.testing.assert_allclose(found.real, expected, rtol=1e-12)


def test_cantilever_static_compliance() -> None:
    length, outer = 0.1, 0.02
    area, bending = math.pi / 4 * outer**2, 200e9 * math.pi / 64 * outer**4
    shear = 6 * 1.29 / (7 + 6 * 0.29) * 200e9 / 2.58 * area
    clamp = [[1, 1e30, 1e30, 0.0, 0.0, 0.0, 0.0, 0.0]]
    model = make([segment(0, 1, length, outer, STEEL)], grounds=clamp)
    found = exact.receptance_complex128(model, 1e-5, [(0, 0), (0, 1)], [(0, 0), (0, 1)])
    coupling = -(length**2) / (2 * bending)
    expected = [[length**3 / (3 * bending) + length / shear, coupling], [coupling, length / bending]]
    np.testing.assert_allclose(found.real, expected, rtol=1e-12)


def test_two_masses_and_a_joint() -> None:
    """The joint's law with every term in it, against the 4x4 system written out."""
    w = 800.0 - 3.0j
    model = make((), [joint(0, 1, 1e5, 20.0, -900.0, (3.0, 1e-3, -0.02), 0.1)], [[0, 0.2, 1e-4], [1, 0.5, 3e-4]])
    k = (1 + 0.1j) * np.array([[1e5, -900.0], [-900.0, 20.0]]) + 1j * w * np.array([[3.0, -0.02], [-0.02, 1e-3]])
    whole = np.block([[k, -k], [-k, k]]) - w**2 * np.diag([0.2, 1e-4, 0.5, 3e-4])
    np.testing.assert_allclose(
        exact.receptance_complex128(model, w, ends(1), ends(1)), np.linalg.inv(whole), rtol=1e-10
    )


def test_reciprocity_and_passivity() -> None:
    rng = np.random.default_rng(11)
    drawn = [draw.case(rng) for _ in range(40)]
    models = [(c.tables, c.w[0], c.excitations) for c in drawn] + [(rich_assembly(), 5e3, ends(4))]
    for model, w, points in models:
        h = exact.receptance(model, w, points, points)
        with mpmath.workdps(100):
            for i in range(len(h)):
                for j in range(i):
                    assert abs(h[i][j] - h[j][i]) <= 1e-30 * abs(h[i][j])
            if complex(w).imag == 0.0:
                # zero without losses, but for rounding
                assert all(h[i][i].imag <= 1e-30 * abs(h[i][i]) for i in range(len(h)))


def test_splitting_a_segment_leaves_receptance_unchanged() -> None:
    whole = make([segment(0, 1, 0.125, 0.03, STEEL, inner_diameter=0.01, loss_factor=0.003)])
    parts = [segment(i, i + 1, length, 0.03, STEEL, inner_diameter=0.01, loss_factor=0.003)
             for i, length in enumerate((0.0625, 2.0**-14, 0.0625 - 2.0**-14))]  # fmt: skip
    for w in (6.0, 2e4, 1e6 - 50j):
        with mpmath.workdps(100):
            expected = exact.receptance(whole, w, ends(1), ends(1))
            assert_close(exact.receptance(make(parts), w, ends(3), ends(3)), expected, 1e-30)


def test_both_arithmetics_agree() -> None:
    if gmpy2 is None:
        pytest.skip("gmpy2 is not installed")
    rng = np.random.default_rng(5)
    for drawn in [draw.case(rng) for _ in range(15)]:
        both = [
            exact.receptance(drawn.tables, drawn.w[0], drawn.excitations, drawn.responses, ar=ar)
            for ar in (Gmpy2Arithmetic, MpmathArithmetic)
        ]
        with mpmath.workdps(100):
            assert_close(*both, 1e-30)


def modes_below(model: Tables, w: float) -> int:
    """Count an undamped model's modes below w, rigid ones included, as Wittrick and Williams do.

    They are the negative eigenvalues of the dynamic stiffness of all nodes, so those of its inverse, and the
    modes that each segment has with both ends held.
    """
    points = [(node, direction) for node in range(model.n_nodes) for direction in (0, 1)]
    h = exact.receptance(model, w, points, points)
    with mpmath.workdps(80):
        scale = [1 / mpmath.sqrt(abs(h[i][i].real)) for i in range(len(h))]
        scaled = mpmath.matrix([
            [scale[i] * h[i][j].real * scale[j] for j in range(len(h))] for i in range(len(h))
        ])  # fmt: skip
        count = sum(value < 0 for value in mpmath.eigsy(scaled, eigvals_only=True))
    for row in model.segments:
        held: float | None = w
        while elements.wave_number_bound(row, held) * row[2] > 1.0:
            held /= 2.0
        while (held := resonance_above(row, held * (1 + 1e-9), "clamped-clamped", w)) is not None:
            count += 1
    return int(count)


def undamped(model: Tables) -> Tables:
    segments, joints, masses, grounds = (table.copy() for table in model)
    segments[:, [8, 12]] = 0.0
    joints[:, 5:] = 0.0
    grounds[:, 4:] = 0.0
    return Tables(segments, joints, masses, grounds)


STIFF_AND_SHORT = make(
    [segment(0, 1, 1e-4, 0.05, STEEL), segment(1, 2, 0.3, 0.004, STEEL), segment(3, 4, 0.1, 0.03, CARBIDE)],
    [joint(2, 3, 1e12, 1e8)],
    grounds=[[4, 1e4, 10.0, 0.0, 0.0, 0.0, 0.0, 0.0]],
)
SOFT_COLLET = make(
    [segment(0, 1, 0.07, 0.01, CARBIDE), segment(3, 4, 0.1, 0.04, STEEL)],
    [joint(1, 2, 1e6, 1e3, 2e4), joint(2, 3, 5e7, 2e4)],
    [[2, 0.05, 1e-5]],
)
MASSLESS_NODE = make(SOFT_COLLET.segments, SOFT_COLLET.joints)


@pytest.mark.parametrize(
    ("model", "highest_hz"),
    [(undamped(rich_assembly()), 30e3), (STIFF_AND_SHORT, 5e3), (SOFT_COLLET, 20e3), (MASSLESS_NODE, 20e3)],
)
def test_exact_and_finite_element_natural_frequencies(model: Tables, highest_hz: float) -> None:
    """Each frequency of the elements is a pole of the exact receptance, and none is missing."""
    found = elements.natural_frequencies(model, highest_hz)
    assert len(found) > 3
    np.testing.assert_allclose(found, elements.natural_frequencies(model, highest_hz, 2.0), rtol=1e-7)
    assert elements.rigid_modes(model) + len(found) == modes_below(model, 2 * np.pi * highest_hz)
    for frequency in found:
        w = 2 * np.pi * frequency
        first, second = w * (1 - 1e-7), w * (1 + 1e-7)
        f, g = (1 / exact.receptance(model, x, [(0, 0)], [(0, 0)])[0][0].real for x in (first, second))
        root = (first * g - second * f) / (g - f)
        assert float(root) == pytest.approx(w, rel=1e-7)


def test_rigid_modes_are_counted() -> None:
    row = segment(0, 1, 0.1, 0.01, STEEL)
    other = segment(2, 3, 0.1, 0.01, STEEL)
    assert elements.rigid_modes(make([row])) == 2
    assert elements.rigid_modes(make([row, other], [joint(1, 2, 1e8, 1e5)])) == 2
    assert elements.rigid_modes(make([row, other], [joint(1, 2, 1e8, 0.0)])) == 3
    assert elements.rigid_modes(make([row, other], [joint(1, 2, 1e6, 100.0, 1e4)])) == 3
    assert elements.rigid_modes(make([row], grounds=[[0, 1e3, 0, 0, 0, 0, 0, 0]])) == 1
    assert elements.rigid_modes(make([row], grounds=[[n, 1e3, 0, 0, 0, 0, 0, 0] for n in (0, 1)])) == 0


def test_joint_derivatives_are_products_of_relative_motions() -> None:
    model, w = rich_assembly(), 9e3
    points, inner = ends(4), [(1, 0), (1, 1), (2, 0), (2, 1)]
    found = exact.derivative(model, w, points, points, [(1, 0, 2), (1, 0, 3), (1, 0, 4), (1, 0, 5), (1, 0, 8)])
    motions = exact.receptance(model, w, points, inner)
    with mpmath.workdps(60):
        loss = 1 + mpmath.mpc(0, 1) * mpmath.mpf(0.01)
        for i in range(4):
            for j in range(4):
                y, theta = ([motions[d][n] - motions[d + 2][n] for n in (i, j)] for d in (0, 1))
                square_y, square_theta = y[0] * y[1], theta[0] * theta[1]
                mixed = y[0] * theta[1] + y[1] * theta[0]
                stiff = 2e7 * square_y + 3e4 * square_theta + 4e5 * mixed
                expected = [
                    -loss * square_y,
                    -loss * square_theta,
                    -loss * mixed,
                    -1j * w * square_y,
                    -1j * stiff,
                ]
                assert_close(found[i][j], expected, 1e-25)


def test_segment_derivatives_obey_similarity() -> None:
    """E and rho times s makes H/s; all lengths times s, with rho/s^2, makes each entry a known power of s."""
    row = segment(0, 1, 0.1, 0.03, STEEL, inner_diameter=0.01, loss_factor=0.01, core=CARBIDE)
    model, w = make([row]), 3e4
    columns = (5, 9, 6, 10, 2, 3, 4)
    found = exact.derivative(model, w, ends(1), ends(1), [(0, 0, column) for column in columns])
    h = exact.receptance(model, w, ends(1), ends(1))
    with mpmath.workdps(60):
        for i in range(4):
            for j in range(4):
                e, core_e, rho, core_rho, *sizes = (
                    row[column] * value for column, value in zip(columns, found[i][j], strict=True)
                )
                assert_close([e + core_e + rho + core_rho], [-h[i][j]], 1e-25)
                assert_close([sum(sizes) - 2 * (rho + core_rho)], [-(1 + i % 2 + j % 2) * h[i][j]], 1e-25)


def test_derivatives_where_the_parameter_is_zero() -> None:
    """A zero bore and an absent core have no first-order effect; the coupling of a joint has one."""
    model = make([segment(0, 1, 0.1, 0.01, STEEL), segment(2, 3, 0.1, 0.02, STEEL)], [joint(1, 2, 1e7, 1e4)])
    parameters = [(0, 0, 4), (0, 0, 10), (1, 0, 4), (0, 0, 8)]
    found = exact.derivative_complex128(model, [5e3, 6e3], [(0, 0)], [(0, 0)], parameters)
    assert found.shape == (2, 1, 1, 4)
    np.testing.assert_array_equal(found[..., :2], 0.0)
    motions = exact.receptance_complex128(model, [5e3, 6e3], [(0, 0)], [(1, 0), (1, 1), (2, 0), (2, 1)])[..., 0]
    y, theta = motions[:, 0] - motions[:, 2], motions[:, 1] - motions[:, 3]
    np.testing.assert_allclose(found[:, 0, 0, 2], -2 * y * theta, rtol=1e-13)
    assert np.all(np.abs(found[..., 3]) > 0.0)
    with pytest.raises(ValueError, match="not a physical quantity"):
        exact.derivative(model, 5e3, [(0, 0)], [(0, 0)], [(0, 0, 13)])


def test_sensitivity_is_small_off_resonance_and_large_on_it() -> None:
    rng = np.random.default_rng(3)
    model = make([segment(0, 1, 0.125, 0.01, STEEL)])
    parameters = [(0, 0, 2), (0, 0, 5)]
    off = exact.sensitivity(model, 1e3, ends(1), ends(1), 8, rng)
    assert off.shape == (4, 4)
    assert np.all((off > 1e-17) & (off < 1e-13))
    slopes = exact.derivative_sensitivity(model, 1e3, ends(1), ends(1), parameters, 8, rng)
    assert slopes.shape == (4, 4, 2)
    assert np.all((slopes > 1e-17) & (slopes < 1e-13))
    w = resonance_above(model.segments[0], 1e4, "free-free", 1e6)
    assert w is not None
    assert np.all(exact.sensitivity(model, w, ends(1), ends(1), 8, rng) > 0.1)


def test_draws_are_reproducible_and_within_limits() -> None:
    first, second = ([draw.case(rng) for _ in range(150)] for rng in map(np.random.default_rng, (7, 7)))
    kinds = set()
    for one, other in zip(first, second, strict=True):
        assert one.label == other.label
        assert all(np.array_equal(x, y) for x, y in zip(one.tables, other.tables, strict=True))
        assert np.array_equal(one.w, other.w)
        kinds.add(one.label.split(",")[0].split(" ")[0])
        assert np.all(np.diff(one.w.real) > 0)
        assert np.all(one.w.imag <= 0)
        for springs in (one.tables.joints[:, 2:], one.tables.grounds[:, 1:]):
            assert np.all(springs[:, 2] ** 2 <= springs[:, 0] * springs[:, 1])
            assert np.all(springs[:, 5] ** 2 <= springs[:, 3] * springs[:, 4])
        exact.receptance(one.tables, one.w[-1], one.excitations, one.responses)
    assert kinds >= {
        "chain",
        "single",
        "cutoff",
        "wire",
        "short",
        "free-free",
        "clamped-free",
        "clamped-clamped",
    }
