"""Stability against values by Chebyshev collocation (converged to 1e-6), and the two methods against each other."""

from __future__ import annotations

import numpy as np
import pytest

from receptance.stability import (
    Milling,
    TipModes,
    Turning,
    critical_depths,
    floquet_multiplier,
    semi_discretised_limit,
    stability_lobes,
)

# One degree of freedom in the direction of feed, two teeth, down-milling.
TIP = TipModes(frequency_hz=[922.0], damping_ratio=[0.011], shapes=[[0.03993**-0.5, 0.0]])
DEPTHS = 1e-3 * np.array([0.2, 0.5, 0.7, 1.0])
MULTIPLIERS = np.array([0.819743, 1.073976, 1.221556, 1.406474])
SPEEDS = {
    1.0: [5e3, 8e3, 10e3, 15e3, 20e3, 25e3],
    0.1: [5e3, 10e3, 15e3, 20e3, 25e3],
    0.05: [5e3, 10e3, 15e3, 20e3, 25e3],
}
LIMITS_MM = {
    1.0: [0.40863, 0.67639, 0.32238, 0.38659, 1.41751, 3.93993],
    0.1: [1.29626, 2.51841, 4.34368, 1.22147, 1.62880],
    0.05: [2.20692, 4.09071, 8.21248, 2.29868, 2.91172],
}


def cut_of(immersion: float) -> Milling:
    return Milling(teeth=2, k_t=6e8, k_n=2e8, immersion=immersion, feed="down")


def test_multipliers():
    found = floquet_multiplier(cut_of(1.0), TIP, speed_rpm=5000.0, depth=DEPTHS)
    np.testing.assert_allclose(found, MULTIPLIERS, rtol=0.0, atol=1e-5)


def test_the_order_of_convergence(summarise):
    """Second order without and fourth order with extrapolation."""
    steps = [24, 48, 96]
    text = []
    for extrapolate, least, atol in ((False, 1.8, 0.0), (True, 3.5, 1e-6)):
        errors = [
            np.abs(
                floquet_multiplier(
                    cut_of(1.0), TIP, speed_rpm=5000.0, depth=DEPTHS, steps=count, extrapolate=extrapolate
                )
                - MULTIPLIERS
            ).max()
            for count in steps
        ]
        orders = np.diff(np.log(np.maximum(errors, atol))) / -np.log(2.0)
        text.append(f"steps {steps}: errors {', '.join(f'{e:.1e}' for e in errors)}, orders {orders.round(2)}")
        assert (orders > least).all(), text
    summarise("semi-discretisation", "\n".join(text), text)


@pytest.mark.parametrize("immersion", SPEEDS)
def test_limits(immersion):
    found = semi_discretised_limit(cut_of(immersion), TIP, speeds_rpm=SPEEDS[immersion], most=10e-3)
    np.testing.assert_allclose(1e3 * found, LIMITS_MM[immersion], rtol=2e-4)


def test_zeroth_order_minimum():
    f = np.arange(850.0, 1100.0, 0.05)
    depth, _ = critical_depths(cut_of(1.0), f, TIP.receptance(f))
    line, column = np.unravel_index(np.argmin(depth), depth.shape)
    assert 1e3 * depth[line, column] == pytest.approx(0.29805, abs=1e-5)
    assert f[line] == pytest.approx(932.1, abs=0.1)


@pytest.mark.parametrize(
    "shapes",
    [[[5.0, 1.0], [0.5, 4.0]], [[5.0, 0.0], [0.0, 5.0]]],
    ids=["coupled modes", "the same in both directions: eigenvalues of equal magnitude"],
)
@pytest.mark.parametrize("teeth", [4, 6, 8])
def test_both_methods_agree_where_the_mean_force_is_the_force(teeth, shapes):
    """In a slot with an even number of at least four teeth the coefficients are constant."""
    second = 1500.0 if shapes[0][1] else 922.0
    damping = [0.011, 0.02 if shapes[0][1] else 0.011]
    tip = TipModes(frequency_hz=[922.0, second], damping_ratio=damping, shapes=shapes)
    cut = Milling(teeth=teeth, k_t=6e8, k_n=2e8)
    f, speeds = np.arange(300.0, 3000.0, 0.1), np.array([20e3, 5e3, 9e3])
    lobes = stability_lobes(cut, f, tip.receptance(f), speeds_rpm=speeds)
    assert lobes.notes == ()
    exact = semi_discretised_limit(cut, tip, speeds_rpm=speeds, most=3e-3, tolerance=1e-5)
    np.testing.assert_allclose(lobes.depth, exact, rtol=5e-4)


def test_up_and_down_milling_mirror_each_other():
    f, speeds = np.arange(300.0, 3000.0, 0.5), np.array([5e3, 9e3, 20e3])
    in_x = TipModes(frequency_hz=[922.0], damping_ratio=[0.011], shapes=[[5.0, 0.0]])
    in_y = TipModes(frequency_hz=[922.0], damping_ratio=[0.011], shapes=[[0.0, 5.0]])
    limits = [
        stability_lobes(
            Milling(teeth=4, k_t=6e8, k_n=2e8, immersion=0.5, feed=feed), f, tip.receptance(f), speeds_rpm=speeds
        ).depth
        for feed, tip in (("down", in_x), ("up", in_y))
    ]
    np.testing.assert_allclose(*limits, rtol=1e-12)


def test_turning():
    """b_lim = -1/(2 K Re G), least where Re G is: 2 k zeta (1 + zeta) / K for one mode (Altintas 2012, eq. 4.20)."""
    mass, zeta, k = 2.0, 0.03, 1e9
    tip = TipModes(frequency_hz=[250.0], damping_ratio=[zeta], shapes=[[mass**-0.5, 0.0]])
    f = np.arange(100.0, 900.0, 0.02)
    lobes = stability_lobes(Turning(k=k), f, tip.receptance(f)[:, 0, 0], speeds_rpm=np.arange(500.0, 20e3, 5.0))
    stiffness = mass * (2.0 * np.pi * 250.0) ** 2
    assert lobes.depth.min() == pytest.approx(2.0 * stiffness * zeta * (1.0 + zeta) / k, rel=1e-5)
    # At the limit the characteristic equation 1 + K b (1 - e^{-i w T}) G = 0 holds.
    finite = np.isfinite(lobes.depth)
    chatter, order = np.unique(lobes.chatter_hz[finite], return_index=True)
    delay = np.exp(-2j * np.pi * chatter * 60.0 / lobes.speeds_rpm[finite][order])
    left = 1.0 + k * lobes.depth[finite][order] * (1.0 - delay) * tip.receptance(chatter)[:, 0, 0]
    assert np.abs(left).max() < 2e-4
