"""The references against slow ones: matrix exponentials, plain coupling, differences, known values."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.linalg import expm

from numpy_reference import (
    BothEndsSeries,
    Joint,
    LogResidual,
    Substructures,
    TipSeries,
    TransferChain,
    chain_tip_receptance,
    identify,
    natural_frequencies,
    segment_receptance,
    tip_by_stiffness,
    tip_receptance,
)
from numpy_reference.cases import GUESS, HIGHEST, JOINT, segment_row, ten_segments, tool_and_holder

FREQUENCIES = 2 * np.pi * np.array([200.0, 991.0, 3333.0, 5021.0, 9973.0])
LINES = [FREQUENCIES, FREQUENCIES - 20j]
STEEL = (200e9, 7800.0, 0.29, 0.01)


def plain_constants(row):
    """S, B, m, r written again from the contract, scalars, one layer after the other."""
    total = np.zeros(4, dtype=complex)
    layers = [(row[3], row[4], *row[5:9])]
    if row[10]:
        layers.append((row[4], 0.0, *row[9:13]))
    for outer, inner, modulus, density, nu, eta in layers:
        q = (inner / outer) ** 2
        if row[13]:
            top = 6 * (1 + nu) ** 2 * (1 + q) ** 2
            kappa = top / (7 + 34 * q + 7 * q**2 + nu * (12 + 48 * q + 12 * q**2) + nu**2 * (4 + 16 * q + 4 * q**2))
        else:
            kappa = 6 * (1 + nu) * (1 + q) ** 2 / ((7 + 6 * nu) * (1 + q) ** 2 + (20 + 12 * nu) * q)
        area, second = np.pi / 4 * (outer**2 - inner**2), np.pi / 64 * (outer**4 - inner**4)
        lossy = modulus * (1 + 1j * eta)
        total += [kappa * lossy / (2 * (1 + nu)) * area, lossy * second, density * area, density * second]
    return total


def plain_transfer(w, row, length):
    """Transfer of (y, theta, V, M) over a piece of a segment."""
    s, b, m, r = plain_constants(row)
    a = np.array([[0, 1, 1 / s, 0], [0, 0, 0, 1 / b], [-m * w**2, 0, 0, 0], [0, -r * w**2, -1, 0]])
    # Balanced by hand: expm's norm would otherwise see only the stiffest entry.
    scale = np.array([length, 1.0, abs(b) / length**2, abs(b) / length])
    return scale[:, None] * expm(a * length * scale / scale[:, None]) / scale


def free_ends(transfer):
    """Receptance of both ends of a part; right loads are V, M, left loads their negatives."""
    t = transfer
    inverse = np.linalg.inv(t[2:, :2])
    far = t[:2, :2] @ inverse
    return np.block([[inverse @ t[2:, 2:], inverse], [far @ t[2:, 2:] - t[:2, 2:], far]])


def plain_receptance(w, rows):
    """Receptance of both ends of a chain: transfer matrices over 0.1 m at most, coupled plainly."""
    result, transfer, reach = None, np.eye(4), 0.0
    for row in np.atleast_2d(rows):
        pieces = int(np.ceil(row[2] / 0.1))
        length = row[2] / pieces
        for _ in range(pieces):
            if reach + length > 0.1 + 1e-12 and reach > 0:
                result = plain_coupling(result, free_ends(transfer))
                transfer, reach = np.eye(4), 0.0
            transfer = plain_transfer(w, row, length) @ transfer
            reach += length
    return plain_coupling(result, free_ends(transfer))


def plain_coupling(left, right):
    """Two free parts joined rigidly, by the interface's force."""
    if left is None:
        return right
    gap = np.vstack([left[2:, :2].T, -right[:2, 2:].T])
    free = np.block([[left[:2, :2], np.zeros((2, 2))], [np.zeros((2, 2)), right[2:, 2:]]])
    return free - gap @ np.linalg.solve(left[2:, 2:] + right[:2, :2], gap.T)


def plain_assembly(w, tool, holder, joint):
    """Tip block of tool and holder coupled through the joint's compliance."""
    h, back = plain_receptance(w, tool), plain_receptance(w, holder)[:2, :2]
    lossy = 1 + 1j * joint.loss_factor
    k = np.diag([joint.k_y * lossy + 1j * w * joint.c_y, joint.k_theta * lossy + 1j * w * joint.c_theta])
    return h[:2, :2] - h[:2, 2:] @ np.linalg.solve(h[2:, 2:] + back + np.linalg.inv(k), h[2:, :2])


SEGMENTS = {
    "slender": segment_row(0, 0.125, 0.01, material=STEEL),
    "short and thick": segment_row(0, 0.008, 0.05, 0.02, material=STEEL),
    "long": segment_row(0, 0.35, 0.02, material=STEEL),
    "Hutchinson": segment_row(0, 0.1, 0.05, 0.02, material=STEEL, shear_model=1.0),
    "bonded core": segment_row(0, 0.08, 0.02, 0.012, STEEL, (580e9, 14500.0, 0.22, 0.002)),
}


@pytest.mark.parametrize("w", LINES, ids=["real", "complex"])
@pytest.mark.parametrize("row", SEGMENTS.values(), ids=SEGMENTS)
def test_segment(row, w):
    row = np.array(row)
    expected = np.array([plain_receptance(line, row) for line in w])
    assert_allclose(segment_receptance(w, row), expected, rtol=1e-8)
    assert_allclose(BothEndsSeries(row, HIGHEST)(w), expected, rtol=1e-8)


def test_segment_past_its_cut_off():
    row = np.array(segment_row(0, 0.1, 0.05, 0.02, (210e9, 7850.0, 0.3, 0.001)))
    w = 2 * np.pi * np.array([31.0e3, 31.09e3, 31.2e3, 45.0e3])
    assert_allclose(segment_receptance(w, row), [plain_receptance(x, row) for x in w], rtol=1e-8)


def test_segment_blocks_agree_and_output_array_is_used():
    w, row = np.linspace(10.0, HIGHEST, 1000), np.array(SEGMENTS["slender"])
    out = np.empty((1000, 4, 4), dtype=complex)
    assert segment_receptance(w, row, out=out, block=300) is out
    # Blocks of low frequency use another expression, which differs by rounding.
    assert_allclose(out, segment_receptance(w, row), rtol=1e-11)


def test_segment_at_low_frequency_keeps_the_rigid_body():
    row = np.array(segment_row(0, 0.003, 0.05, material=STEEL))
    w = np.array([1.0, 6.0])
    # A body of no compliance: its receptance about the middle, from mass and transverse inertia.
    _, _, m, r = plain_constants(row).real
    mass, inertia, h = m * 0.003, m * 0.003**3 / 12 + r * 0.003, 0.0015
    arms = np.array([[1, -h], [0, 1], [1, h], [0, 1]])
    rigid = -(arms / [mass, inertia]) @ arms.T / w[:, None, None] ** 2
    assert_allclose(segment_receptance(w, row), rigid, rtol=1e-6)
    assert_allclose(segment_receptance(w, row), BothEndsSeries(row, HIGHEST)(w), rtol=1e-12)


@pytest.mark.parametrize("w", LINES, ids=["real", "complex"])
@pytest.mark.parametrize("total", [0.05, 0.2, 0.3])
def test_chain_tip(total, w):
    rows = ten_segments(total)
    expected = np.array([plain_receptance(line, rows)[:2, :2] for line in w])
    assert_allclose(TipSeries(rows, HIGHEST)(w), expected, rtol=1e-7)
    assert_allclose(TransferChain(rows, HIGHEST)(w), expected, rtol=1e-7)
    assert_allclose(TransferChain(rows, HIGHEST, limit=1.0, merge=False)(w), expected, rtol=1e-7)
    assert_allclose(tip_by_stiffness(w, rows), expected, rtol=1e-7)


def digits_transfer(w, row):
    """Transfer of (y, theta, V, M) over a segment to sixty digits."""
    s, b, m, r = (mpmath.mpmathify(x) for x in plain_constants(row))
    a = mpmath.matrix([[0, 1, 1 / s, 0], [0, 0, 0, 1 / b], [-m * w**2, 0, 0, 0], [0, -r * w**2, -1, 0]])
    return mpmath.expm(a * mpmath.mpf(row[2]))


@pytest.mark.parametrize("frequency", [1.0, 30.0, 9000.0])
def test_digits_of_chain_and_joint(frequency):
    tool, holder = tool_and_holder()
    with mpmath.workdps(60):
        w = mpmath.mpf(2 * np.pi * frequency)
        front, back = mpmath.eye(4), mpmath.eye(4)
        for row in tool:
            front = digits_transfer(w, row) * front
        for row in holder:
            back = digits_transfer(w, row) * back
        joint = mpmath.eye(4)
        # Across the joint the loads go on and the motions jump by V / k_y and M / k_theta.
        joint[0, 2] = 1 / (JOINT.k_y + 1j * w * JOINT.c_y)
        joint[1, 3] = 1 / (JOINT.k_theta + 1j * w * JOINT.c_theta)
        expected = []
        for whole in (back * joint * front, back):
            tip = whole[2:, :2] ** -1 * whole[2:, 2:]
            expected.append(np.array([[complex(tip[i, j]) for j in range(2)] for i in range(2)]))
    line = np.array([2 * np.pi * frequency])
    found = tip_receptance(line, Substructures(tool, holder, HIGHEST), JOINT)[0]
    assert_allclose(found, expected[0][0, 0], rtol=1e-11)
    assert_allclose(TipSeries(holder, HIGHEST)(line)[0], expected[1], rtol=1e-11)
    assert_allclose(TransferChain(holder, HIGHEST)(line)[0], expected[1], rtol=1e-11)


def test_long_chain_leaves_the_whole_chain_series():
    rows, w = ten_segments(1.0), FREQUENCIES
    with pytest.raises(ValueError, match="wave span"):
        TipSeries(rows, HIGHEST)
    assert_allclose(chain_tip_receptance(w, rows), tip_by_stiffness(w, rows), rtol=1e-9)


def test_formulations_agree_with_each_other():
    w, rows = np.linspace(2 * np.pi * 10, HIGHEST, 3000), ten_segments()
    assert_allclose(TipSeries(rows, HIGHEST)(w), TransferChain(rows, HIGHEST)(w), rtol=1e-9)


def test_tool_both_ends():
    tool, _ = tool_and_holder()
    expected = np.array([plain_receptance(line, tool) for line in FREQUENCIES])
    series = BothEndsSeries(tool, HIGHEST)
    assert_allclose(series(FREQUENCIES), expected, rtol=1e-7)
    planes = series.planes(FREQUENCIES)
    for plane, (i, j) in zip(planes, series.ENTRIES, strict=True):
        assert_allclose(plane, expected[:, i, j], rtol=1e-7)


@pytest.mark.parametrize("w", LINES, ids=["real", "complex"])
@pytest.mark.parametrize("joint", [JOINT, Joint(1e9, 1e6, 50.0, 0.1, 0.02), Joint(1e6, 1e3, 5.0, 0.01)])
def test_assembly_and_its_derivatives(joint, w):
    tool, holder = tool_and_holder()
    parts = Substructures(tool, holder, HIGHEST)
    receptance, slopes = tip_receptance(w, parts, joint, derivatives=True)
    assert_allclose(receptance, [plain_assembly(x, tool, holder, joint)[0, 0] for x in w], rtol=1e-7)
    hoisted = tip_receptance(w, parts(w), joint, derivatives=True)
    assert_allclose(hoisted[0], receptance, rtol=1e-12)
    assert_allclose(hoisted[1], slopes, rtol=1e-12)
    assert_allclose(tip_receptance(w, parts, joint)[0], receptance, rtol=1e-12)
    for k in range(4):
        step = joint[k] * 1e-4
        high, low = (joint._replace(**{joint._fields[k]: joint[k] + sign * step}) for sign in (1, -1))
        difference = (tip_receptance(w, parts, high)[0] - tip_receptance(w, parts, low)[0]) / (2 * step)
        # Cancellation in the difference, relative to H itself, limits the accuracy of this check.
        assert_allclose(slopes[:, k], difference, rtol=1e-5, atol=1e-10 * np.abs(receptance).max() / joint[k])


BEAMS = {
    "steel": (segment_row(0, 0.125, 0.01), [2837.30, 7597.40, 14325.63, 22605.17], 23e3),
    "carbide": (
        segment_row(0, 0.12, 0.02, material=(580e9, 14500.0, 0.24, 0.0)),
        [7318.47, 18268.10, 32037.50, 47216.83],
        48e3,
    ),
    "tube": (
        segment_row(0, 0.1, 0.05, 0.02, (210e9, 7850.0, 0.3, 0.0)),
        [15830.80, 26338.44, 38263.16, 38945.42],
        39e3,
    ),
}


@pytest.mark.parametrize(("row", "expected", "limit"), BEAMS.values(), ids=BEAMS)
def test_natural_frequencies_of_published_beams(row, expected, limit):
    assert_allclose(natural_frequencies(np.array(row), limit), expected, atol=0.006)


@pytest.mark.parametrize("total", [0.2, 0.35])
def test_natural_frequencies_by_counting(total, monkeypatch):
    rows = ten_segments(total)
    by_series = natural_frequencies(rows, 25e3 * 0.2 / total)
    monkeypatch.setattr("numpy_reference.natural.SPAN_LIMIT", 0.0)
    assert_allclose(by_series, natural_frequencies(rows, 25e3 * 0.2 / total), rtol=1e-10)


def test_natural_frequencies_of_an_assembly():
    tool, holder = tool_and_holder()
    for table in (tool, holder):
        table[:, 8] = 0
    after = holder.copy()
    after[:, :2] += len(tool) + 1
    joint = np.array([[3, 4, 5e7, 2e5, 0, 0, 0, 0, 0]])
    limit = 10e3
    found = natural_frequencies(np.vstack([tool, after]), limit, joints=joint)
    # Poles are sign changes of the reciprocal of the drive-point receptance.
    rigidly = Joint(5e7, 2e5, 0.0, 0.0)
    f = np.linspace(100.0, limit, 1500)
    stiffness = np.array([1 / plain_assembly(2 * np.pi * x, tool, holder, rigidly)[0, 0].real for x in f])
    zero = np.flatnonzero((stiffness[:-1] < 0) & (stiffness[1:] > 0) | (stiffness[:-1] > 0) & (stiffness[1:] < 0))
    step = f[1] - f[0]
    smooth = [i for i in zero if max(abs(stiffness[i]), abs(stiffness[i + 1])) < np.median(np.abs(stiffness))]
    assert len(smooth) == found.size
    assert_allclose(found, f[smooth] + step / 2, atol=step)


def test_grounded_and_loaded_chain():
    rows = ten_segments()
    ends = {"grounds": np.array([[10.0, 1e14, 1e11, 0, 0, 0, 0, 0]]), "masses": np.array([[0, 0.005, 1e-7]])}
    found = natural_frequencies(rows, 8e3, **ends)
    w = 2 * np.pi * found
    rows[:, 8] = 0
    for x in w:
        h = plain_receptance(x, rows)
        clamped = h[:2, :2] - h[:2, 2:] @ np.linalg.solve(h[2:, 2:], h[2:, :2])
        loaded = np.eye(2) - x**2 * clamped @ np.diag([0.005, 1e-7])
        # Singular but for the nearly rigid ground.
        assert np.linalg.cond(loaded) > 1e4
    assert found.size >= 2


def test_residual_jacobian():
    tool, holder = tool_and_holder()
    w = np.linspace(2 * np.pi * 100, HIGHEST, 500)
    planes = Substructures(tool, holder, HIGHEST)(w)
    measured = tip_receptance(w, planes, JOINT)[0]
    for loss in (0.0, 0.01):
        residual = LogResidual(w, measured, planes, loss)
        x = np.array([7.9, 5.4, 5.0, 0.1])
        jacobian = residual.jacobian(x)
        model = tip_receptance(w, planes, residual.joint(x))[0]
        direct = np.log(measured / model)
        assert_allclose(residual(x), np.concatenate([direct.real, direct.imag]), atol=1e-11)
        for k, step in enumerate(1e-5 * np.eye(4)):
            difference = (residual(x + step) - residual(x - step)) / 2e-5
            assert_allclose(jacobian[:, k], difference, atol=1e-7 * np.abs(jacobian[:, k]).max())


@pytest.mark.parametrize("analytic", [True, False], ids=["analytic", "2-point"])
def test_identification(analytic):
    tool, holder = tool_and_holder()
    w = np.linspace(2 * np.pi * 50, HIGHEST, 2000)
    measured = np.array([plain_assembly(x, tool, holder, JOINT)[0, 0] for x in w])
    fit = identify(w, measured, tool, holder, GUESS, analytic=analytic)
    assert fit.result.success
    assert fit.nfev < 40
    assert_allclose(fit.joint, JOINT, rtol=1e-5)
