"""Transfer: splits, exclusion of held-out data, unpredictable quantities, intervals, forms."""

from __future__ import annotations

import json
import pickle
from dataclasses import replace

import numpy as np
import pytest

from receptance import (
    CARBIDE,
    STEEL,
    Assembly,
    Observation,
    Part,
    PointJoint,
    Segment,
    Unknown,
    identify,
)
from receptance.fit import Law, Power, Tolerance
from receptance.fit.peaks import match_peaks
from receptance.predict import transfer

TRUE = {"joint.k_y": 3e8, "joint.k_theta": 8e4, "joint.c_y": 300.0, "joint.c_theta": 0.08}
LENGTHS = (0.05, 0.06, 0.08)
LINES = np.linspace(300.0, 6000.0, 400)


def make_assembly(length: float, **joint: float) -> Assembly:
    """Return a tool of some overhang in a holder."""
    tool = Part([Segment(length=length, outer_diameter=0.0127, material=CARBIDE)], name="tool")
    sections = [Segment(length=x, outer_diameter=d, material=STEEL) for x, d in ((0.05, 0.04), (0.08, 0.05))]
    values = {address.split(".")[1]: value for address, value in TRUE.items()} | joint
    return Assembly([tool, PointJoint(**values, name="joint"), Part(sections, name="holder")])


def frequencies(length: float, spread: float | None = 1.0, **joint: float) -> Observation:
    """Return exact natural frequencies, rounded."""
    modes = make_assembly(length, **joint).natural_frequencies(2e4)[:2]
    return Observation.from_modes(
        assembly=make_assembly(length),
        frequency_hz=modes,
        standard_deviation_hz=spread,
        configuration=f"{1e3 * length:.0f} mm",
    )


def responses(seed: int = 0, noise: float = 0.01) -> list[Observation]:
    """Return noisy receptances."""
    rng = np.random.default_rng(seed)
    found = []
    for length in LENGTHS:
        scatter = noise * (rng.standard_normal(LINES.size) + 1j * rng.standard_normal(LINES.size))
        found.append(
            Observation(
                assembly=make_assembly(length),
                frequency_hz=LINES,
                receptance=make_assembly(length).receptance(LINES) * np.exp(scatter),
                standard_deviation=noise,
                configuration=f"{1e3 * length:.0f} mm",
            )
        )
    return found


STIFFNESSES = [
    Unknown(address="joint.k_y", lower=1e6, upper=1e11, start=2e8),
    Unknown(address="joint.k_theta", lower=1e3, upper=1e7, start=6e4),
]
DAMPINGS = [
    Unknown(address="joint.c_y", lower=1.0, upper=1e5, start=200.0),
    Unknown(address="joint.c_theta", lower=1e-3, upper=10.0, start=0.1),
]
MODES = [frequencies(length) for length in LENGTHS]


def test_every_configuration_is_held_out_once() -> None:
    found = transfer(MODES, STIFFNESSES, starts=1)
    assert [split.held_out for split in found.splits] == [("50 mm",), ("60 mm",), ("80 mm",)]
    for split, one in zip(found.splits, MODES, strict=True):
        assert split.held_out[0] not in split.fitted
        others = [o for o in MODES if o is not one]
        alone = identify(others, STIFFNESSES, starts=1)
        assert split.identified is not None
        assert split.identified.values == alone.values
        predicted = alone.at(one.assembly).assembly.natural_frequencies(2e4)[:2]
        assert [mode.predicted_hz for mode in split.modes] == pytest.approx(predicted.tolist(), rel=1e-12)
    assert found.inside == (6, 6)
    assert found.rms_percent is not None
    assert found.rms_percent < 1e-6


def test_a_wrong_held_out_measurement_is_outside_its_interval() -> None:
    wrong = [*MODES[:2], frequencies(LENGTHS[2], k_theta=6e4)]
    found = transfer(wrong, STIFFNESSES, splits=[["80 mm"]], starts=1)
    assert found.modes[0].within() is False
    assert found.modes[0].error_percent > 1.0
    assert found.bias_percent == pytest.approx(np.mean([mode.error_percent for mode in found.modes]))


def test_single_and_grouped_configurations() -> None:
    found = transfer(MODES, STIFFNESSES, splits="one-for-all", starts=1)
    assert [split.fitted for split in found.splits] == [("50 mm",), ("60 mm",), ("80 mm",)]
    assert all(len(split.held_out) == 2 for split in found.splits)
    assert transfer(MODES, STIFFNESSES, splits=["50 mm"], starts=1).splits[0].held_out == ("50 mm",)


def test_separate_clamping_widens_the_interval_by_its_tolerance() -> None:
    clampings = [
        Tolerance(
            name=f"overhang {o.configuration}",
            moves={"tool.segment[0].length": 1e-4},
            configurations=o.configuration,
        )
        for o in MODES
    ]
    bare = transfer(MODES, STIFFNESSES, splits=["80 mm"], starts=1).modes[0]
    free = transfer(MODES, STIFFNESSES, splits=["80 mm"], tolerances=clampings, starts=1).modes[0]
    _, slope = make_assembly(0.08).natural_frequency_derivatives(1e4, ["tool.segment[0].length"])
    assert bare.deviation_hz is not None
    assert free.deviation_hz is not None
    assert free.deviation_hz > np.hypot(bare.deviation_hz, 0.99e-4 * abs(slope[0, 0]))


def test_receptances_with_their_bands() -> None:
    found = transfer(responses(), [*STIFFNESSES, *DAMPINGS], starts=1, draws=60)
    assert len(found.frfs) == 3
    for frf in found.frfs:
        # Noise of 1 % in magnitude is 0.087 dB.
        assert 0.07 < frf.rms_decibel < 0.12
        assert 0.88 < frf.share_within(0.95) <= 1.0
        low, high = frf.band(0.95)
        assert np.all(low <= np.abs(frf.receptance))
        assert np.all(np.abs(frf.receptance) <= high)
    assert {mode.configuration for mode in found.modes} == {"50 mm", "60 mm", "80 mm"}
    assert all(abs(mode.error_percent) < 0.2 for mode in found.modes)
    again = transfer(responses(), [*STIFFNESSES, *DAMPINGS], starts=1, draws=60)
    assert np.array_equal(again.frfs[0].drawn, found.frfs[0].drawn), "draws have a seed"


def test_drawn_and_linear_bands_agree_for_small_uncertainty() -> None:
    fit = identify(responses(noise=1e-3), [*STIFFNESSES, *DAMPINGS], starts=1)
    longer = make_assembly(0.09)
    away = np.linspace(300.0, 600.0, 5)
    linear = fit.at(longer).receptance(away)
    drawn = fit.at(longer).receptance(away, draws=1500, seed=1)
    ratio = np.log(drawn.band()[1] / np.abs(drawn.receptance)) / np.log(linear.band()[1] / np.abs(linear.receptance))
    assert ratio == pytest.approx(np.ones(5), abs=0.1)
    assert np.std(np.log(np.abs(drawn.drawn)), axis=0) == pytest.approx(linear.scatter.total, rel=0.08)
    low, high = linear.band(0.95, noise=0.01)
    assert np.all(high / low > np.exp(2 * 1.95 * 0.01))


def test_missing_scatter_is_estimated() -> None:
    rng = np.random.default_rng(3)
    measured = [frequencies(length, spread=None) for length in (0.04, 0.05, 0.06, 0.07, 0.08)]
    measured = [
        Observation.from_modes(
            assembly=o.assembly,
            frequency_hz=o.frequency_hz * (1.0 + 1e-3 * rng.standard_normal(2)),
            configuration=o.configuration,
        )
        for o in measured
    ]
    found = transfer(measured, STIFFNESSES, starts=1)
    readings = [mode.measured_deviation_hz / mode.measured_hz for mode in found.modes]
    assert 3e-4 < np.median(readings) < 3e-3
    assert found.modes[0].degrees_of_freedom == 6, "of Student's t distribution"
    assert found.inside[0] >= 8


def test_laws_are_extrapolated_and_individual_parts_widen() -> None:
    measured = [
        Observation.from_modes(
            assembly=make_assembly(0.06),
            frequency_hz=make_assembly(0.06, k_theta=8e4 * (torque / 40.0) ** 0.5).natural_frequencies(2e4)[:2],
            standard_deviation_hz=0.5,
            configuration=f"{torque:g} N m",
            conditions={"torque": torque},
        )
        for torque in (20.0, 40.0, 80.0)
    ]
    power = Power(of="torque", reference=40.0)
    k_y = Unknown(address="joint.k_y", lower=1e6, upper=1e11, start=3e8)
    for individual in (0.0, 0.05):
        law = Law(address="joint.k_theta", lower=1e3, upper=1e7, start=8e4, powers=power, individual=individual)
        last = transfer(measured, [k_y, law], splits=["80 N m"], starts=1).modes[0]
        assert abs(last.error_percent) < 0.05
        if individual:
            _, slope = make_assembly(0.06, k_theta=8e4 * 2**0.5).natural_frequency_derivatives(1e4, ["joint.k_theta"])
            assert last.deviation_hz > 0.99 * 0.05 * 8e4 * 2**0.5 * slope[0, 0]


def test_unpredictable_quantities_are_reported() -> None:
    other = Part([Segment(length=0.05, outer_diameter=0.01, material=CARBIDE)], name="tool")
    lonely = Assembly([other, PointJoint(k_y=1e8, k_theta=1e4, name="other"), make_assembly(0.05).elements["holder"]])
    alone = Observation.from_modes(
        assembly=lonely,
        frequency_hz=lonely.natural_frequencies(2e4)[:2],
        standard_deviation_hz=1.0,
        configuration="lonely",
    )
    unknowns = [*STIFFNESSES, Unknown(address="other.k_theta", lower=1e3, upper=1e6)]
    found = transfer([*MODES, alone], unknowns, starts=1)
    assert found.not_predicted == ("lonely: other.k_theta is in no configuration that is left",)
    assert len(found.modes) == 6
    assert "not predicted: lonely" in found.summary()


def test_bad_input_is_refused() -> None:
    with pytest.raises(ValueError, match="two or more"):
        transfer(MODES[:1], STIFFNESSES)
    with pytest.raises(ValueError, match="there is no configuration '90 mm'"):
        transfer(MODES, STIFFNESSES, splits=[["90 mm"]])
    with pytest.raises(ValueError, match="leave some to fit"):
        transfer(MODES, STIFFNESSES, splits=[["50 mm", "60 mm", "80 mm"]])
    with pytest.raises(ValueError, match="splits is 'all'"):
        transfer(MODES, STIFFNESSES, splits="all")
    with pytest.raises(ValueError, match="splits is empty"):
        transfer(MODES, STIFFNESSES, splits=[])
    with pytest.raises(ValueError, match="level is 2"):
        transfer(MODES, STIFFNESSES, level=2.0)
    with pytest.raises(TypeError, match=r"observations\[1\]"):
        transfer([MODES[0], "nothing"], STIFFNESSES)
    with pytest.raises(ValueError, match="free in each configuration"):
        transfer(MODES, Law(address="joint.k_theta", lower=1e3, upper=1e7, free=True))


def test_forms() -> None:
    found = transfer(responses(), [*STIFFNESSES, *DAMPINGS], starts=1, draws=5)
    form = json.loads(json.dumps(found.to_dict(), allow_nan=False))
    assert form["modes"] == len(found.modes)
    assert {split["held_out"][0] for split in form["splits"]} == {"50 mm", "60 mm", "80 mm"}
    assert "log-spectral" in found.summary()
    assert repr(found).startswith("Transfer(3 splits, ")
    assert pickle.loads(pickle.dumps(found)).rms_percent == found.rms_percent
    assert set(found.identified) == set(TRUE)
    assert len(found.plot().axes) == 4
    with pytest.raises(ValueError, match="nothing was predicted"):
        replace(found, splits=()).plot()


@pytest.mark.parametrize("stated", [None, 0.01], ids=["no standard deviations", "far too small ones"])
def test_noise_is_no_peak(stated: float | None) -> None:
    """Where the response is below the noise, the highest of its lines are not listed as measured peaks."""
    lines = np.linspace(300.0, 9000.0, 1500)
    true = make_assembly(0.06).receptance(lines)
    elastic = make_assembly(0.06).natural_frequencies(9000.0)
    given = None if stated is None else np.full(lines.size, stated)
    clean = [peak.measured_hz for peak in match_peaks(lines, true, true, given)]
    assert clean == pytest.approx(elastic, rel=2e-3)
    level = 0.5 * np.median(np.abs(true[lines > 5500.0]))
    for seed in range(10):
        rng = np.random.default_rng(seed)
        measured = true + level * (rng.standard_normal(lines.size) + 1j * rng.standard_normal(lines.size))
        found = [peak.measured_hz for peak in match_peaks(lines, measured, true, given) if peak.measured_hz is not None]
        assert 1 <= len(found) <= elastic.size, f"seed {seed}: {found}"
        assert all(np.min(np.abs(elastic / f - 1.0)) < 0.01 for f in found), f"seed {seed}: {found}"
