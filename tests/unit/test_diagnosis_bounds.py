"""Screening beside an unknown at its bound: residuals that only a value beyond the bound explains remain."""

from __future__ import annotations

import numpy as np
import pytest

from receptance import CARBIDE, STEEL, Assembly, Observation, Part, PointJoint, Segment, Unknown
from receptance.diagnosis.fitting import Fit, refit
from receptance.diagnosis.model import Model

TRUE = {"k_y": 6e8, "k_theta": 1e5, "c_y": 300.0, "c_theta": 1.0}


def fitted(lower: float, upper: float) -> Fit:
    """Return a fit of the rotational stiffness within bounds."""
    lines = np.linspace(200.0, 6000.0, 200)
    tool = Part([Segment(length=0.07, outer_diameter=0.012, material=CARBIDE)], name="tool")
    holder = Part([Segment(length=0.13, outer_diameter=0.045, material=STEEL)], name="holder")
    assembly = Assembly([tool, PointJoint(**TRUE, name="joint"), holder])
    rng = np.random.default_rng(3)
    scatter = np.exp(0.01 * (rng.normal(size=lines.size) + 1j * rng.normal(size=lines.size)))
    observation = Observation(
        assembly=assembly,
        frequency_hz=lines,
        receptance=assembly.receptance(lines) * scatter,
        standard_deviation=0.01,
    )
    unknown = Unknown(address="joint.k_theta", lower=lower, upper=upper)
    model = Model((observation,), (unknown,), (), seed=0, threads=1)
    return refit(model, {"joint.k_theta": np.sqrt(lower * upper)})


def test_residuals_are_normal_to_all_columns_within_the_bounds() -> None:
    fit = fitted(4e4, 2e5)
    assert fit.basis.shape[1] == 1
    residual = fit.compressed_residual
    assert np.linalg.norm(fit.basis.T @ residual) < 1e-2 * np.linalg.norm(residual)


@pytest.mark.parametrize(("lower", "upper", "held"), [(0.5, 0.9, 0.9), (1.1, 2.0, 1.1)])
def test_a_variable_that_its_bound_holds_explains_nothing(lower: float, upper: float, held: float) -> None:
    fit = fitted(lower * TRUE["k_theta"], upper * TRUE["k_theta"])
    slopes = fit.problem.jacobian(fit.x)
    beyond = abs(float(slopes[:, 0] @ fit.residual)) / float(np.linalg.norm(slopes[:, 0]))
    assert fit.values["joint.k_theta"] == pytest.approx(held * TRUE["k_theta"], rel=1e-6)
    # Without the bound, chi-square would fall by about the square of this.
    assert beyond > 10.0
    assert fit.basis.shape[1] == 0
