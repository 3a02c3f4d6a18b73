"""Causes of a part that is held to ground: an elastic instead of a rigid body, and contact elsewhere than modelled."""

from __future__ import annotations

import numpy as np
import pytest

from receptance import STEEL, Assembly, Coordinate, GroundSpring, Observation, Part, Segment, Unknown
from receptance.coupling import Holder
from receptance.diagnosis import CATALOGUE, Model, UndecidableError, diagnose
from receptance.diagnosis.fitting import fit_base, with_null
from receptance.diagnosis.starts import fit_again, fit_levels, has_levels
from receptance.fit import Law

FORCES = (5.0, 25.0)
HOLDER = Holder(
    part=Part(
        [Segment(length=x, outer_diameter=d, material=STEEL) for x, d in ((0.08, 0.08), (0.1, 0.055), (0.03, 0.025))],
        name="holder",
    ),
    big_end=0.08,
    small_end=0.18,
)


def make_observations(motion: str, modelled: str = "spread", noise: float = 0.005) -> list[Observation]:
    """Return an elastic holder at three forces, seen as a rigid one."""
    rng = np.random.default_rng(3)
    found = []
    for force in FORCES:
        k = 5e9 * (1.0 + 0.002 * force)
        if motion == "axial":
            lines = np.arange(3000.0, 6500.0, 50.0)
            truth, model = HOLDER.axial(k, 1500.0), HOLDER.axial(k, 1e3, body="rigid")
        else:
            lines = np.arange(500.0, 6000.0, 50.0)
            truth = uneven(0.4 * k, 0.2 * k)
            model = HOLDER.radial(k, k, 1e3, 1e3, body="rigid", contact=modelled)
        for position in (0.0,) if motion == "axial" else (0.01, 0.05):
            place, hit = Coordinate("holder", position), Coordinate("holder", 0.0 if motion == "axial" else 0.01)
            scatter = rng.normal(size=(2, lines.size)) * noise
            values = truth.receptance(lines, response=place, excitation=hit)
            found.append(
                Observation(
                    assembly=model,
                    frequency_hz=lines,
                    receptance=values * np.exp(scatter[0] + 1j * scatter[1]),
                    standard_deviation=noise,
                    response=place,
                    excitation=hit,
                    configuration=f"{force:g} kN",
                    conditions={"drawbar force": 1e3 * force},
                )
            )
    return found


def uneven(k_1: float, k_2: float) -> Assembly:
    """Return the holder on contact that is strongest at the ends of its taper."""
    x = (np.arange(12) + 0.5) / 12.0
    place = {"part": "holder", "position": 0.08, "length": 0.1}
    ends = [
        GroundSpring(k_y=k, c_y=c, weights=tuple(np.exp(-2.8 * way)), **place)
        for k, c, way in ((k_1, 9e3, x), (k_2, 6e3, 1.0 - x))
    ]
    return Assembly([HOLDER.part], ends)


def springs(*names: str) -> list[Law]:
    return [
        Law(address=f"{name}.{field}", lower=low, upper=high, free=True)
        for name in names
        for field, low, high in (("k_y", 1e7, 1e12), ("c_y", 1.0, 1e6))
    ]


def test_elastic_body_is_named_with_its_modulus() -> None:
    verdict = diagnose(
        make_observations("axial"), springs("taper"), causes=["flexible_body", "calibration_gain", "time_delay"]
    )
    assert verdict.verdict == "named"
    assert [one.id for one in verdict.causes] == ["flexible_body"]
    _, low, high = verdict.causes[0].parameters["flexible_body.decades"]
    assert low < np.log10(STEEL.youngs_modulus / 2e11) < high


@pytest.mark.slow
def test_across_the_contact_is_named_with_it() -> None:
    verdict = diagnose(
        make_observations("radial", "ends"),
        springs("big_end", "small_end"),
        causes=["flexible_body", "contact_distribution"],
    )
    assert verdict.verdict == "named"
    assert {one.id for one in verdict.causes} == {"flexible_body", "contact_distribution"}
    _, low, high = next(one for one in verdict.causes if one.id == "flexible_body").parameters["flexible_body.decades"]
    assert low < np.log10(STEEL.youngs_modulus / 2e11) < high


def test_levels_are_fitted_individually_from_distant_starts() -> None:
    """Free springs at two forces are two problems."""
    model = Model(tuple(make_observations("axial")), tuple(springs("taper")))
    assert has_levels(model)
    whole, alone = fit_levels(model), fit_base(model.select(model.observations[:1]))
    assert whole.by_configuration["5 kN"] == pytest.approx(alone.chi_square, rel=1e-6)


@pytest.mark.slow
def test_cause_found_at_one_level_is_fitted_to_all() -> None:
    """The rigid body does not explain one force, and is not fitted to the other; the elastic one explains both."""
    model = Model(tuple(make_observations("axial")), tuple(springs("taper")))
    rigid = fit_levels(model)
    assert fit_again(rigid) is None
    elastic = fit_again(with_null(CATALOGUE["flexible_body"].variants(model)[0].apply(model), rigid))
    assert elastic is not None
    assert elastic.misfit < 1.3
    assert elastic.values["flexible_body.decades"] == pytest.approx(np.log10(STEEL.youngs_modulus / 2e11), abs=0.02)


def test_levels_need_free_values_at_two_of_them() -> None:
    one, other = make_observations("axial")
    assert not has_levels(Model((one,), tuple(springs("taper"))))
    assert not has_levels(Model((one, other), (Unknown(address="taper.k_y", lower=1e7, upper=1e12),)))


@pytest.mark.parametrize(
    ("name", "motion", "names"),
    [
        ("flexible_body", "axial", ("taper",)),
        ("contact_distribution", "axial", ("taper",)),
        ("contact_distribution", "radial", ("big_end", "small_end")),
    ],
)
@pytest.mark.parametrize("modelled", ["spread", "ends"])
def test_cause_has_no_effect_at_its_null(name: str, motion: str, names: tuple[str, ...], modelled: str) -> None:
    model = Model(tuple(make_observations(motion, modelled=modelled)), tuple(springs(*names)))
    problem = model.task.problem()
    x = problem.variables.start
    before = problem.residual(x).copy()
    extensions = CATALOGUE[name].extensions(model)
    assert extensions
    for variant, extended in extensions:
        assert {one.assembly.motion for one in extended.observations} == {problem_motion(motion)}
        there = extended.task.problem()
        after = there.residual(there.variables.start)
        # Distributed springs agree to a thousandth.
        limit = 0.01 if "at points" in variant.name else 1e-6
        np.testing.assert_allclose(after[: before.size], before, atol=limit * np.abs(before).max())


def problem_motion(motion: str) -> str:
    return "axial" if motion == "axial" else "bending"


def test_contact_of_undetermined_position_is_undecidable() -> None:
    (one, *_) = make_observations("radial")
    bare = Observation(
        assembly=Assembly([HOLDER.part]),
        frequency_hz=one.frequency_hz,
        receptance=one.receptance,
        standard_deviation=0.01,
    )
    law = Law(address="holder.segment[0].density", lower=1e3, upper=1e4)
    with pytest.raises(UndecidableError, match="no spring to ground is identified"):
        CATALOGUE["contact_distribution"].variants(Model((bare,), (law,)))
