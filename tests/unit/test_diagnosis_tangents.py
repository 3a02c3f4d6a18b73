"""Derivatives by the unknowns of many variants at once, against those of each variant's own problem."""

from __future__ import annotations

import contextlib

import numpy as np

from blank_in_holder import make_assembly
from receptance import Observation, Unknown
from receptance.diagnosis import CATALOGUE, Model, UndecidableError, Variant
from receptance.diagnosis.fitting import Fit, refit
from receptance.diagnosis.tangents import slopes_of
from receptance.fit import Tolerance
from variant_of_cause import extended_by

LINES = np.linspace(200.0, 6000.0, 60)
OVERHANGS = (0.05, 0.07, 0.09)


def make_model() -> Model:
    rng = np.random.default_rng(5)
    observations = tuple(
        Observation(
            assembly=(own := make_assembly(overhang)),
            frequency_hz=LINES,
            receptance=own.receptance(LINES) * np.exp(0.02 * rng.normal(size=LINES.size) + 0.01j),
            standard_deviation=0.01,
            label=f"{1e3 * overhang:.0f} mm, hit {hit}",
            configuration=f"{1e3 * overhang:.0f} mm",
        )
        for overhang in OVERHANGS
        for hit in (1, 2)
    )
    unknowns = (
        Unknown(address="joint.k_y", lower=1e6, upper=1e11, start=5e8),
        Unknown(address="joint.k_theta", lower=1e2, upper=1e8, start=1.1e5),
        Unknown(address="joint.c_y", lower=1.0, upper=1e6, start=200.0),
    )
    tolerances = (
        Tolerance(name="modulus", moves={"tool.segment[*].youngs_modulus": 0.02}, relative=True),
        Tolerance(name="clamped", moves={"tool.segment[0].length": 2e-4}, configurations="50 mm"),
        Tolerance(name="one hit", moves={"holder.segment[0].length": 1e-4}, labels="70 mm, hit 2"),
    )
    return Model(observations, unknowns, tolerances, threads=1)


def every_extension(model: Model) -> list[tuple[Variant, Model]]:
    found = []
    for cause in (one for one in CATALOGUE.values() if not one.changes_data):
        with contextlib.suppress(UndecidableError):
            found += cause.extensions(model)
    return found


def own_slopes(fit: Fit, model: Model) -> np.ndarray:
    """Derivatives of the observed residuals from a task and a problem of the variant alone."""
    before = {unknown.name for unknown in fit.model.unknowns}
    task = Model(model.observations, model.unknowns, model.tolerances, threads=1).task
    values = np.array([fit.values.get(u.name, u.start or 0.0) for u in task.parameters.unknowns])
    fresh = np.array([u.name in {o.name for o in model.unknowns} - before for u in task.parameters.unknowns])
    problem = task.problem()
    _, rows = problem.rows(task.variables.from_values(values), fresh)
    rows = rows / task.variables.slopes(values)[fresh]
    return rows[: sum(problem.sizes)]


def test_derivatives_are_those_of_each_variant_alone() -> None:
    model = make_model()
    fit = refit(model, {})
    extensions = [pair for pair in every_extension(fit.model) if len(pair[1].unknowns) > len(model.unknowns)]
    assert len({variant.cause.id for variant, _ in extensions}) > 12
    found = slopes_of(fit, [extended for _, extended in extensions])
    for (variant, extended), slopes in zip(extensions, found, strict=True):
        expected = own_slopes(fit, extended)
        assert slopes is not None, variant.id
        assert slopes.shape == expected.shape, variant.id
        scale = np.max(np.abs(expected), axis=0)
        # Resonators are evaluated together, and each of them weighs a milligram at its null.
        limit = 1e-3 if variant.cause.id == "missing_mode" else 1e-6
        assert np.max(np.abs(slopes - expected) / np.where(scale > 0.0, scale, 1.0)) < limit, variant.id


def test_derivatives_beside_a_cause_that_is_fitted_already() -> None:
    model = make_model()
    fit = refit(extended_by(model, "joint_spread", "4 points"), {"joint_spread.length": 0.01})
    for id in ("sensor_mass", "fluted_part", "holder_inertia"):
        models = [extended for _, extended in CATALOGUE[id].extensions(fit.model)]
        for own, slopes in zip(models, slopes_of(fit, models), strict=True):
            expected = own_slopes(fit, own)
            assert slopes is not None
            assert np.allclose(slopes, expected, rtol=1e-6, atol=1e-7 * np.max(np.abs(expected))), id
