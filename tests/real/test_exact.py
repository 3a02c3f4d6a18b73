"""The exact modifications against small systems that are solved directly."""

from __future__ import annotations

import numpy as np
import pytest

from real import exact

pytestmark = pytest.mark.slow

MASSES = np.array([1.0, 2.0, 1.1])
SPACING = 0.02
SIZE = 25001  # to 500 Hz
HZ = SPACING * np.arange(SIZE)


def chain(masses=MASSES, ground=(0.0, 0.0, 0.0), dashpot=0.0):
    """Return M, C, K of three free masses on springs, with springs and a first dashpot to ground."""
    k = np.array([[4e5, -4e5, 0.0], [-4e5, 1e6, -6e5], [0.0, -6e5, 6e5]])
    c = np.array([[3.0, -3.0, 0.0], [-3.0, 7.0, -4.0], [0.0, -4.0, 4.0]])
    return np.diag(masses), c + np.diag([dashpot, 0.0, 0.0]), k + np.diag(ground)


def accelerance(s, system):
    """Return `(3, 3, n)` by solving the matrices at each s."""
    m, c, k = system
    dynamic = m * s[:, None, None] ** 2 + c * s[:, None, None] + k
    return np.moveaxis(np.linalg.inv(dynamic), 0, 2) * s**2


def poles_and_residues(system):
    """Return poles and residue matrices `(6, 3, 3)` of the receptance, from the state matrix."""
    m, c, k = system
    inverse = np.linalg.inv(m)
    state = np.block([[np.zeros((3, 3)), np.eye(3)], [-inverse @ k, -inverse @ c]])
    poles, right = np.linalg.eig(state)
    left = np.linalg.inv(right)
    return poles, np.einsum("ip,pj->pij", right[:3], left[:, 3:] @ inverse)


@pytest.mark.parametrize("rate", [0.0, 12.0])
def test_bodies_at_the_measured_point_and_elsewhere(rate):
    s = exact.laplace(np.linspace(5.0, 200.0, 300), rate)
    plain = accelerance(s, chain())
    mass, stiffness = 0.3, 2e5
    for b in range(3):
        heavier = np.array([m + mass * (i == b) for i, m in enumerate(MASSES)])
        true = accelerance(s, chain(heavier, [stiffness * (i == b) for i in range(3)]))
        at_body = exact.with_body(plain[b], plain[b, b], s, mass, stiffness)
        np.testing.assert_allclose(at_body, true[b], rtol=1e-9)
        for i in range(3):
            for j in range(3):
                found = exact.with_body_elsewhere(
                    plain[i, j], plain[i, b], plain[b, j], plain[b, b], s, mass, stiffness
                )
                np.testing.assert_allclose(found, true[i, j], rtol=1e-7, atol=1e-9 * np.abs(true).max())


@pytest.mark.parametrize("rate", [2.0, 10.0, 40.0])
def test_a_window_shifts_the_lines(rate):
    """From lines 0.02 Hz apart to 500 Hz, where the highest mode is at 163 Hz."""
    plain = accelerance(exact.laplace(np.maximum(HZ, 1e-6)), chain())[0]
    found = exact.windowed(plain, SPACING, rate)
    own = (HZ > 5.0) & (HZ < 400.0)
    true = accelerance(exact.laplace(HZ, rate), chain())[0]
    away = np.abs(found / true - 1.0)[:, own]
    assert np.median(away) < 1e-3
    assert np.all(np.abs(found - true)[:, own] < 5e-3 * np.abs(true).max(axis=1, keepdims=True))
    # Without it the difference is what a window does: this test can fail.
    assert np.median(np.abs(plain / true - 1.0)[:, own]) > 2e-3


def test_a_truncated_record():
    """Receptance of a free body less its rigid motion: the integral to the end is known for each pole."""
    poles, residues = poles_and_residues(chain(ground=(1e4, 0.0, 0.0), dashpot=20.0))
    rate, end = 10.0, 0.25
    s = exact.laplace(HZ, rate)
    terms = residues[:, 0, 1, None] / (s - poles[:, None])
    found = exact.windowed(terms.sum(axis=0), SPACING, 0.0, end)
    true = (terms * (1.0 - np.exp((poles[:, None] - s) * end))).sum(axis=0)
    own = HZ < 300.0
    assert np.max(np.abs(found - true)[own]) < 2e-3 * np.abs(true).max()
    assert np.max(np.abs(terms.sum(axis=0) - true)[own]) > 2e-2 * np.abs(true).max()


def test_a_delay_moves_the_impulse_response():
    plain = accelerance(exact.laplace(np.maximum(HZ, 1e-6)), chain())[0, 0]
    step = 1.0 / (2 * (SIZE - 1) * SPACING)
    late = exact.impulse_response(exact.with_delay(plain, 7 * step, exact.laplace(HZ)), SPACING)
    first = exact.impulse_response(plain, SPACING)
    np.testing.assert_allclose(late, np.roll(first, 7), atol=1e-6 * np.abs(first).max())


@pytest.mark.parametrize(("mass", "stiffness"), [(0.05, 0.0), (0.0, 3e4), (0.1, 2e4)])
def test_shifts_of_modes(mass, stiffness):
    """Against eigenvalues of the changed system; the local fit holds the other modes in its numerator."""
    hz = np.arange(20.0, 250.0, 0.05)
    drive = accelerance(exact.laplace(hz), chain())[1, 1]
    poles, _ = poles_and_residues(chain())
    changed, _ = poles_and_residues(chain([1.0, 2.0 + mass, 1.1], (0.0, stiffness, 0.0)))
    before, after = (np.sort(np.abs(p[p.imag > 10.0])) / 2.0 / np.pi for p in (poles, changed))
    # With a spring to ground the free body has a third mode, below the others.
    after = after[-before.size :]
    for own, moved in zip(before, after, strict=True):
        mode = exact.local_mode(hz, drive, own - 8.0, own + 8.0)
        found = exact.shifted_mode(mode, mass, stiffness)
        assert found[0] == pytest.approx(own, rel=1e-4)
        assert found[1] / found[0] - 1.0 == pytest.approx(moved / own - 1.0, rel=0.03, abs=2e-5)
        assert (found[1] - found[0] < 0.0) == (moved < own)
