"""Elastic holder, direct fit, choice by mode shape, and series over force."""

from __future__ import annotations

import os
import pickle
from dataclasses import replace

import numpy as np
import pytest

from receptance import FRF, STEEL, Coordinate, Part, Segment
from receptance.coupling import (
    Body,
    ForceSeries,
    Holder,
    RadialJoint,
    Shape,
    fit_laws,
    fit_taper,
    radial_from_modes,
)
from receptance.examples import virtual_rig

SEED = int(os.environ.get("RECEPTANCE_TEST_SEED", "20261123"))
RADIAL = {"k_x1": 1.5e9, "k_x2": 9e8, "c_x1": 7000.0, "c_x2": 5000.0}


@pytest.fixture(scope="module")
def holder() -> Holder:
    return virtual_rig.holder()


def test_contacts_have_the_same_total(holder: Holder) -> None:
    """All contacts have the same stiffness against translation of a rigid body; they differ for rotations."""
    for contact in ("ends", "spread", "fading"):
        assembly = holder.radial(1e3, 2e3, body="rigid", contact=contact)
        total = sum(spring.k_y for spring in assembly.attachments.values())
        assert total == 3e3
        for spring in assembly.attachments.values():
            assert sum(spring.shares) == pytest.approx(1.0, rel=1e-12)
            assert len(spring.shares) == len(spring.offsets)
        axial = holder.axial(5e9, body="rigid", contact=contact).natural_frequencies(1e4)
        assert axial[0] == pytest.approx(np.sqrt(5e9 / holder.body.mass) / (2 * np.pi), rel=1e-6)
    big, small = holder.radial(1.0, 1.0, contact="fading").attachments.values()
    assert big.shares[0] > big.shares[-1]
    assert small.shares == pytest.approx(tuple(reversed(big.shares)), rel=1e-12)


def test_bonded_is_the_limit(holder: Holder) -> None:
    for motion in ("axial", "bending"):
        bonded = holder.bonded(motion).natural_frequencies(2e4)[0]
        previous = 0.0
        for k in (1e9, 1e10, 1e12, 1e15):
            assembly = holder.axial(k) if motion == "axial" else holder.radial(k, k)
            first = assembly.natural_frequencies(2e4)[0]
            assert previous < first <= bonded * (1.0 + 1e-9)
            previous = first
        assert previous == pytest.approx(bonded, rel=1e-3)


@pytest.mark.slow
def test_direct_lateral_fit_converges_from_the_default_start(holder: Holder) -> None:
    f = np.arange(500.0, 6200.0, 20.0)
    places = (Coordinate("holder", 0.01), Coordinate("holder", 0.05))
    values = holder.radial(**RADIAL).receptance(f, response=places, excitation=places[:1])
    frf = FRF(frequency_hz=f, values=values, responses=places, excitations=places[:1], log_variance=1e-6)
    fit = fit_taper(holder, frf, motion="bending")
    assert fit.values == pytest.approx(RADIAL, rel=1e-5)
    assert set(fit.intervals) == set(fit.standard_errors) == set(RADIAL)


def test_direct_axial_fit_converges_from_the_default_start(holder: Holder) -> None:
    """A band about one mode that is narrower than the artificial damping of the staged search."""
    near = np.arange(4000.0, 5800.0, 20.0)
    axial = FRF(
        frequency_hz=near, values=holder.axial(5.6e9, 1500.0, contact="ends").receptance(near), log_variance=1e-6
    )
    fit = fit_taper(holder, axial, motion="axial", contact="ends")
    assert fit.values == pytest.approx({"k_z1": 5.6e9, "c_z1": 1500.0}, rel=1e-5)


def test_a_holder_is_checked(holder: Holder) -> None:
    assert pickle.loads(pickle.dumps(holder)) == holder
    with pytest.raises(ValueError, match="expected 0 <= big_end"):
        Holder(part=holder.part, big_end=0.1, small_end=0.05)
    with pytest.raises(ValueError, match="contact is 'glued', expected one of spread, fading, ends"):
        holder.axial(1e9, contact="glued")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="body is 'soft'"):
        holder.radial(1e9, 1e9, body="soft")  # type: ignore[arg-type]
    filled = Segment(length=0.1, outer_diameter=0.05, inner_diameter=0.02, material=STEEL, core=STEEL)
    rigid = Holder(part=Part([filled]), big_end=0.0, small_end=0.1).axial(5e9, body="rigid")
    core = rigid.elements["holder"].segments[0].core
    assert core.youngs_modulus == STEEL.youngs_modulus * 1e9


def test_shape_selects_or_gives_the_reason() -> None:
    body = Body(mass=4.5, inertia=0.01)
    true = RadialJoint(body=body, z1=0.02, z2=-0.08, k_x1=1e9, k_x2=5e8)
    modes = true.undamped_modes()
    ratio = modes.ratio(0.06, 0.0)
    given = {"first": 0.06, "second": 0.0, "ratio": (complex(ratio[0]), complex(ratio[1]))}
    for error, count, words in (((0.01, 0.01), 1, "selects"), ((50.0, 50.0), 2, "does not decide")):
        shape = Shape(**given, standard_error=error)
        found = radial_from_modes(body, 0.02, -0.08, modes.frequency_hz, shape=shape)
        assert len(found.solutions) == count
        assert words in found.statement
        assert found.nearest is not None
        assert found.solutions[found.nearest].joint.k_x1 == pytest.approx(1e9, rel=1e-9)
    contradicting = Shape(first=0.06, second=0.0, ratio=(5.0, -3.0), standard_error=(0.01, 0.01))
    found = radial_from_modes(body, 0.02, -0.08, modes.frequency_hz, shape=contradicting)
    assert len(found.solutions) == 2
    assert "contradicts both joints" in found.statement
    assert radial_from_modes(body, 0.02, -0.08, modes.frequency_hz).nearest is None


def test_laws_are_selected_by_the_data() -> None:
    """The true law is selected in most draws, and the interval of the exponent contains the true one."""
    random = np.random.default_rng(SEED)
    print(f"seed {SEED}")
    force = np.arange(26.0)
    x = force / 25.0
    for name, values, at_least in (
        ("constant", np.full(26, 5.0), 30),
        ("linear", 5.0 + 0.3 * x, 30),
        ("power", 5.0 + 0.3 * x**1.7, 38),
        ("power", 5.0 + 0.3 * x**0.5, 38),
    ):
        selected, covered = 0, 0
        for _ in range(40):
            noisy = values + 0.01 * random.standard_normal(26)
            series = ForceSeries(name="k", force=force, values=noisy, standard_errors=np.full(26, 0.01))
            selected += series.law.name == name
            if name == "power":
                low, high = series.exponent_interval
                covered += low <= (1.7 if values[13] < 5.15 else 0.5) <= high
        assert selected >= at_least
        # 0.005 quantile of 40 draws of 0.95.
        assert name != "power" or covered >= 34


def test_series_state_their_findings() -> None:
    force = np.arange(26.0)
    errors = np.full(26, 0.01)
    noise = 0.01 * np.random.default_rng(SEED).standard_normal(26)
    # Noise without its best parabola has no trend.
    residual = noise - np.polynomial.Polynomial.fit(force, noise, 2)(force)
    flat = ForceSeries(name="c", force=force, values=5.0 + residual, standard_errors=errors)
    assert flat.trend().direction == flat.slope_trend().direction == "not determined"
    assert "(open)" in flat.sentence()
    straight = ForceSeries(name="k", force=force, values=5.0 - 0.4 * force / 25.0 + residual, standard_errors=errors)
    assert straight.trend().direction == "falls"
    low, high = straight.trend().interval
    assert low < -0.4 < high
    assert "straight line" in straight.sentence()
    curved = replace(straight, values=5.0 + (force / 25.0) ** 2 + residual)
    assert curved.slope_trend().direction == "rises"
    assert "the slope increases with force" in curved.sentence()
    low, high = curved.slope_trend().interval
    assert low < 2.0 < high
    # Scatter that the errors do not explain widens intervals.
    rough = replace(curved, values=5.0 + (force / 25.0) ** 2 + 10.0 * residual)
    ends = [np.subtract(*one.exponent_interval[::-1]) for one in (rough, curved)]
    assert ends[0] > 4.0 * ends[1]
    law = fit_laws(force, 3.0 + 2.0 * (force / 25.0) ** 2, errors)[2]
    np.testing.assert_allclose(law.at([0.0, 12.5, 25.0]), [3.0, 3.5, 5.0], rtol=1e-5)


def test_mistakes_in_series() -> None:
    force, values, errors = np.arange(6.0), np.ones(6), np.ones(6)
    with pytest.raises(ValueError, match="at least six"):
        ForceSeries(name="k", force=force[:5], values=values[:5], standard_errors=errors[:5])
    with pytest.raises(ValueError, match="different lengths"):
        ForceSeries(name="k", force=np.arange(7.0), values=values, standard_errors=errors)
    with pytest.raises(ValueError, match="not ascending"):
        ForceSeries(name="k", force=force[::-1], values=values, standard_errors=errors)
    with pytest.raises(ValueError, match="must be more than zero"):
        ForceSeries(name="k", force=force, values=values, standard_errors=0.0 * errors)
