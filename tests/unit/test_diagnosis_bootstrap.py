"""The detection threshold is bootstrapped to first order; here every draw is fitted in full."""

from __future__ import annotations

import math

import numpy as np
import pytest

from blank_in_holder import make_assembly
from receptance import CARBIDE, Observation, Unknown
from receptance.diagnosis import CATALOGUE, Model
from receptance.diagnosis.fitting import refit
from receptance.diagnosis.screening import detection_threshold, directions
from receptance.fit import Tolerance
from receptance.fit.observation import altered

LINES = np.linspace(200.0, 6000.0, 150)
CAUSES = ("sensor_mass", "tool_modulus", "tool_density", "calibration_gain", "time_delay", "joint_cross_term")
DRAWS = 24
PENALTY = math.log(6 * LINES.size)


def base(rng: np.random.Generator | None) -> Model:
    """Return the model with data of its own: without noise, or with noise and an ordinary carbide."""
    modulus = 1.0 if rng is None else math.exp(0.005 * rng.normal())
    observed = []
    for overhang in (0.05, 0.07, 0.09):
        noise = np.zeros((2, LINES.size)) if rng is None else 0.01 * rng.normal(size=(2, LINES.size))
        truth = make_assembly(overhang).replace({"tool.segment[0].youngs_modulus": modulus * CARBIDE.youngs_modulus})
        one = Observation(
            assembly=make_assembly(overhang),
            frequency_hz=LINES,
            receptance=truth.receptance(LINES, threads=1),
            standard_deviation=0.01,
            label=f"{overhang}",
        )
        observed.append(altered(one, receptance=one.receptance * np.exp(noise[0] + 1j * noise[1])))
    joint = {"joint.k_y": 6e8, "joint.k_theta": 1e5, "joint.c_y": 300.0, "joint.c_theta": 1.0}
    unknowns = tuple(Unknown(address=a, lower=v / 1e3, upper=v * 1e3, start=v) for a, v in joint.items())
    error = Tolerance(name="carbide", moves={"tool.segment[*].youngs_modulus": 0.005}, relative=True)
    return Model(tuple(observed), unknowns, (error,))


@pytest.mark.slow
def test_the_linearised_maximum_is_that_of_full_refits() -> None:
    rng = np.random.default_rng(31)
    full, linear = [], []
    for _ in range(DRAWS):
        fit = refit(base(rng), {})
        found = directions(fit, [pair for name in CAUSES for pair in CATALOGUE[name].extensions(fit.model)])
        linear.append(max(one.score - PENALTY * one.count for one in found))
        best = -np.inf
        for one in found:
            end = refit(one.model, {**fit.values, **one.estimate})
            best = max(best, fit.chi_square - end.chi_square - PENALTY * one.count)
        full.append(best)
    # Draw by draw the two are the same number, and so are their distributions and the threshold's own draws.
    assert np.abs(np.array(full) - linear).max() < 0.5
    noiseless = refit(base(None), {})
    found = directions(noiseless, [pair for name in CAUSES for pair in CATALOGUE[name].extensions(noiseless.model)])
    middle, high, low = (detection_threshold(found, PENALTY, level=level) for level in (0.5, 0.95, 0.05))
    spread = math.sqrt(0.25 / DRAWS)
    assert np.quantile(full, 0.5 - 2.5 * spread) < middle < np.quantile(full, 0.5 + 2.5 * spread)
    assert np.mean((np.array(full) < high) & (np.array(full) > low)) > 0.9 - 3.0 * math.sqrt(0.09 / DRAWS)
