"""Unequal pitch and helix against simulations in the time domain, which share nothing with the library.

The reference integrates the equations of motion with Runge-Kutta's method of fourth order from random histories. Each
edge is divided into many slices along the depth, each with an angle, a delay and a force of its own; the multipliers
follow from subspace iteration on the simulated histories.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from receptance.stability import Milling, TipModes, floquet_multiplier, semi_discretised_limit, stability_lobes

SEED = 20261127
K_T, K_N = 6e8, 2e8
TIP = TipModes(
    frequency_hz=[922.0, 1310.0],
    damping_ratio=[0.03, 0.02],
    shapes=[[0.03993**-0.5, 0.6], [-0.8, 4.1]],
)
DIAMETER = 0.012
DOWN_HALF = (0.5 * np.pi, np.pi)
_SUBSAMPLES = 40


def _forces(angle: np.ndarray, first: float, last: float) -> np.ndarray:
    """Return the force over depth and displacement of an element of an edge at angles, `(..., 2, 2)`."""
    angle = np.mod(angle, 2.0 * np.pi)
    cut = (angle > first) & (angle < last)
    sine, cosine = np.sin(angle), np.cos(angle)
    rows = np.array([[-K_T * cosine - K_N * sine] * 2, [K_T * sine - K_N * cosine] * 2])
    columns = np.array([[sine, cosine]] * 2)
    return np.moveaxis(rows * columns * cut, (0, 1), (-2, -1))


@dataclass(frozen=True)
class Case:
    """A cutter of 12 mm in down-milling at half immersion; `period` in rad, after which it turns into itself."""

    pitch: list[float]
    helix: list[float]
    speed: float
    depth: float
    period: float

    @property
    def cut(self) -> Milling:
        return Milling(
            teeth=len(self.pitch),
            k_t=K_T,
            k_n=K_N,
            immersion=0.5,
            diameter=DIAMETER,
            pitch_deg=self.pitch,
            helix_deg=self.helix,
        )


def simulated_multiplier(case: Case, steps: int, slices: int) -> float:
    """Return the largest magnitude of the multipliers over the period of a cutter, with `steps` in it."""
    pitch, depth, period = case.pitch, case.depth, case.period
    h = period / steps
    twist = 2.0 * np.tan(np.deg2rad(case.helix)) / DIAMETER
    places = -np.concatenate([[0.0], np.cumsum(np.deg2rad(pitch))[:-1]])
    heights = depth * (np.arange(slices) + 0.5) / slices
    local = places[:, None] - twist[:, None] * heights  # angle of each slice of each edge
    delay = (np.roll(local, 1, axis=0) - local).copy()
    delay[0] += 2.0 * np.pi
    # Mean forces over each step.
    sub = h * (np.arange(_SUBSAMPLES) + 0.5) / _SUBSAMPLES
    at = (h * np.arange(steps))[:, None] + sub
    mean = np.array([_forces(at[:, :, None] + local[j], *DOWN_HALF).mean(axis=1) for j in range(len(pitch))])
    force = depth / slices * np.moveaxis(mean, 0, 1).reshape(steps, -1, 2, 2)
    lag = delay.ravel() / h  # in steps
    whole = np.ceil(lag).astype(int)
    past = int(whole.max()) + 1
    omega = 2.0 * np.pi * TIP.frequency_hz
    time = h * 60.0 / (2.0 * np.pi * case.speed)
    present = force.sum(axis=1)

    def slope(q: np.ndarray, v: np.ndarray, now: np.ndarray, late: np.ndarray) -> np.ndarray:
        load = np.tensordot(now, np.tensordot(TIP.shapes.T, q, 1), 1) - late
        free = (omega**2)[:, None] * q + (2.0 * TIP.damping_ratio * omega)[:, None] * v
        return np.tensordot(TIP.shapes, load, 1) - free

    def run(history: np.ndarray) -> np.ndarray:
        """Advance histories of modal displacement and velocity `(past + 1, 2, modes, block)` by a period."""
        track = np.concatenate([history, np.zeros((steps, *history.shape[1:]))])
        for i in range(steps):
            n = past + i
            loads = []
            for share in (0.0, 0.5, 1.0):
                place = n + share - lag
                low = np.minimum(np.floor(place).astype(int), n - 1)
                s = (place - low)[:, None, None]
                (u0, v0), (u1, v1) = (np.moveaxis(track[low + e], 1, 0) for e in (0, 1))
                late = (1 + 2 * s) * (1 - s) ** 2 * u0 + s * (1 - s) ** 2 * time * v0
                late = late + s**2 * (3 - 2 * s) * u1 + s**2 * (s - 1) * time * v1
                loads.append(np.einsum("gij,kj,gkb->ib", force[i], TIP.shapes, late))
            q, v = track[n]
            a1 = slope(q, v, present[i], loads[0])
            a2 = slope(q + 0.5 * time * v, v + 0.5 * time * a1, present[i], loads[1])
            a3 = slope(q + 0.5 * time * v + 0.25 * time**2 * a1, v + 0.5 * time * a2, present[i], loads[1])
            a4 = slope(q + time * v + 0.5 * time**2 * a2, v + time * a3, present[i], loads[2])
            track[n + 1, 0] = q + time * v + time**2 / 6.0 * (a1 + a2 + a3)
            track[n + 1, 1] = v + time / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
        return track[steps:]

    print(f"seed {SEED}")
    scale = np.array([1.0, 1.0 / omega.mean()])[:, None, None]
    block = np.random.default_rng(SEED).standard_normal((past + 1, 2, omega.size, 10)) / scale
    before = 0.0
    for _ in range(60):
        flat = np.linalg.qr((block * scale).reshape(-1, block.shape[-1]))[0]
        block = run(flat.reshape(block.shape) / scale)
        found = np.abs(np.linalg.eigvals(flat.T @ (block * scale).reshape(flat.shape))).max()
        if abs(found - before) < 1e-7:
            return float(found)
        before = found
    raise AssertionError("the subspace iteration does not converge")


CASES = {
    "even, straight": Case([90.0] * 4, [0.0] * 4, 6100.0, 0.7e-3, 0.5 * np.pi),
    "pitch that repeats": Case([70.0, 110.0] * 2, [0.0] * 4, 6100.0, 0.7e-3, np.pi),
    "pitch of a turn": Case([80.0, 97.3, 113.0, 69.7], [0.0] * 4, 7000.0, 1e-3, 2.0 * np.pi),
    "three teeth": Case([100.0, 125.0, 135.0], [0.0] * 3, 9000.0, 0.9e-3, 2.0 * np.pi),
    "helix": Case([90.0] * 4, [35.0] * 4, 6100.0, 2.5e-3, 0.5 * np.pi),
    "pitch and helix": Case([70.0, 110.0] * 2, [30.0] * 4, 6100.0, 2e-3, np.pi),
    "helix of two kinds": Case([90.0] * 4, [35.0, 38.0] * 2, 6100.0, 3e-3, np.pi),
    "left-hand helix": Case([90.0, 75.0, 105.0, 90.0], [-30.0] * 4, 7000.0, 2e-3, 2.0 * np.pi),
    "all different": Case([85.0, 95.0, 88.0, 92.0], [35.0, 38.0, 36.0, 41.0], 8000.0, 2e-3, 2.0 * np.pi),
}
QUICK = ("three teeth", "pitch and helix", "helix of two kinds")


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=() if name in QUICK else pytest.mark.slow) for name in CASES]
)
def test_multipliers_are_those_of_simulations(name: str) -> None:
    case = CASES[name]
    steps = round(case.period / (2.0 * np.pi) * 800)
    simulated = simulated_multiplier(case, steps, 16 if any(case.helix) else 1)
    multiplier = floquet_multiplier(case.cut, TIP, speed_rpm=case.speed, depth=case.depth)[0]
    print(f"{name}: simulated {simulated:.6f}, semi-discretised {multiplier:.6f}")
    assert multiplier == pytest.approx(simulated, rel=5e-4)


@pytest.mark.slow
def test_the_simulation_has_converged() -> None:
    case = CASES["all different"]
    assert simulated_multiplier(case, 800, 16) == pytest.approx(simulated_multiplier(case, 1600, 32), rel=2e-4)


def test_nearly_equal_teeth_have_the_multipliers_of_equal_ones() -> None:
    """Published |mu| of a tooth period, here over a turn of two teeth with interpolated displacements."""
    tip = TipModes(frequency_hz=[922.0], damping_ratio=[0.011], shapes=[[0.03993**-0.5, 0.0]])
    cut = Milling(teeth=2, k_t=K_T, k_n=K_N, pitch_deg=(180.0 - 4e-3, 180.0 + 4e-3))
    assert not cut.is_even
    depths = 1e-3 * np.array([0.2, 0.5, 0.7, 1.0])
    over_a_turn = floquet_multiplier(cut, tip, speed_rpm=5000.0, depth=depths)
    np.testing.assert_allclose(over_a_turn**0.5, [0.819743, 1.073976, 1.221556, 1.406474], rtol=0.0, atol=1e-4)


def test_a_helix_that_lags_by_the_pitch_has_the_mean_force() -> None:
    """At this depth as much of the edges is at every angle, so the limit by the mean force is exact."""
    lines, speed = np.arange(300.0, 4000.0, 0.05), 9000.0
    cut = Milling(teeth=3, k_t=K_T, k_n=K_N, immersion=0.3, feed="up")
    limit = stability_lobes(cut, lines, TIP.receptance(lines), speeds_rpm=[speed]).depth[0]
    helix = 40.0
    lag = 2.0 * np.tan(np.deg2rad(helix)) * limit
    twisted = replace(cut, helix_deg=helix, diameter=lag / (2.0 * np.pi / 3))
    assert floquet_multiplier(twisted, TIP, speed_rpm=speed, depth=limit)[0] == pytest.approx(1.0, abs=1e-5)
    assert abs(floquet_multiplier(cut, TIP, speed_rpm=speed, depth=limit)[0] - 1.0) > 1e-3
    np.testing.assert_array_equal(
        stability_lobes(twisted, lines, TIP.receptance(lines), speeds_rpm=[speed]).depth, limit
    )


def test_unequal_pitch_raises_the_limit_where_it_was_designed() -> None:
    """Delays that differ by half a wave of the chatter cancel it."""
    tip = TipModes(frequency_hz=[1200.0], damping_ratio=[0.03], shapes=[[5.0, 0.0]])
    speed = 5000.0
    half_wave = np.rad2deg(np.pi / 1230.0 * speed / 60.0)  # of the angle between two teeth
    equal = Milling(teeth=4, k_t=K_T, k_n=K_N, immersion=0.5)
    unequal = replace(equal, pitch_deg=(90.0 - 0.5 * half_wave, 90.0 + 0.5 * half_wave) * 2)
    lowest = [
        semi_discretised_limit(
            cut, tip, speeds_rpm=speed * np.linspace(0.97, 1.03, 5), most=20e-3, tolerance=1e-2
        ).min()
        for cut in (equal, unequal)
    ]
    assert lowest[1] > 2.0 * lowest[0], lowest


def test_edges_that_meet_are_refused() -> None:
    cut = Milling(teeth=2, k_t=K_T, k_n=K_N, diameter=0.01, helix_deg=(20.0, 50.0))
    with pytest.raises(
        ValueError, match=r"edges 2 and 1 come closer than 5 degrees .* mm from the tip, expected smaller"
    ):
        floquet_multiplier(cut, TIP, speed_rpm=5000.0, depth=30e-3)
