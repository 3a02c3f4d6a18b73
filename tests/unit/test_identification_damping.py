"""Damping ratios as data: complex eigenfrequencies, their derivatives, fits, campaigns and diagnoses with them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from campaign_text import TEXT, changed, load
from receptance import (
    CARBIDE,
    STEEL,
    Assembly,
    GroundSpring,
    Observation,
    Part,
    PointJoint,
    Segment,
    Unknown,
    damped_modes,
    identify,
)
from receptance.campaign import CampaignError
from receptance.diagnosis import diagnose
from receptance.diagnosis.by_mode import residuals_by_mode
from receptance.errors import ReceptanceError
from receptance.fit import Tolerance

JOINT = [
    Unknown(address="joint.k_y", lower=1e6, upper=1e11),
    Unknown(address="joint.k_theta", lower=1e2, upper=1e8),
    Unknown(address="joint.c_y", lower=1e-1, upper=1e6),
    Unknown(address="joint.c_theta", lower=1e-4, upper=1e3),
]


def make_assembly(overhang: float = 0.08, **joint: float) -> Assembly:
    tool = Part(
        [Segment(length=overhang, outer_diameter=0.012, material=replace(CARBIDE, loss_factor=5e-4))], name="tool"
    )
    holder = Part([Segment(length=0.13, outer_diameter=0.045, material=STEEL)], name="holder")
    values = {"k_y": 6e8, "k_theta": 1e5, "c_y": 300.0, "c_theta": 1.0, **joint}
    return Assembly([tool, PointJoint(**values, name="joint"), holder])


def measure(
    overhang: float, rng: np.random.Generator | None = None, upper: float = 20e3, **joint: float
) -> Observation:
    true = make_assembly(overhang, **joint)
    poles, _ = true.complex_frequencies(true.natural_frequencies(upper))
    noise = np.zeros((2, poles.size)) if rng is None else rng.normal(size=(2, poles.size))
    return Observation.from_modes(
        assembly=make_assembly(overhang),
        frequency_hz=np.abs(poles) * (1.0 + 1e-4 * noise[0]),
        standard_deviation_hz=1e-4 * np.abs(poles),
        damping_ratio=poles.imag / np.abs(poles) * (1.0 + 0.02 * noise[1]),
        standard_deviation_damping=0.02 * poles.imag / np.abs(poles),
        label=f"{overhang}",
    )


def on_springs(c_y: float) -> Assembly:
    stiff = replace(STEEL, youngs_modulus=1e16, poisson_ratio=0.0)
    body = Part([Segment(length=0.02, outer_diameter=0.05, material=stiff)], name="body")
    half = {"k_y": 1e6, "c_y": c_y, "k_theta": 1e7}
    return Assembly(
        [body],
        [
            GroundSpring(part="body", position=0.0, name="first", **half),
            GroundSpring(part="body", position="end", name="second", **half),
        ],
    )


def test_a_rigid_body_on_a_spring_and_a_dashpot() -> None:
    """m s^2 + c s + k = 0, with every other mode far above."""
    both = on_springs(c_y=40.0)
    mass = both.elements["body"].mass
    found, _ = both.complex_frequencies(both.natural_frequencies(2e3)[:1])
    assert abs(found[0]) == pytest.approx(np.sqrt(2e6 / mass) / (2.0 * np.pi), rel=1e-6)
    assert found[0].imag / abs(found[0]) == pytest.approx(80.0 / (2.0 * np.sqrt(2e6 * mass)), rel=1e-5)


def test_hysteretic_loss_of_everything_is_half_a_loss_factor() -> None:
    lossy = make_assembly(c_y=0.0, c_theta=0.0, loss_factor=0.01).replace(
        {"tool.segment[0].loss_factor": 0.01, "holder.segment[0].loss_factor": 0.01}
    )
    found, _ = lossy.complex_frequencies(lossy.natural_frequencies(20e3))
    # w^2 = w0^2 (1 + i eta)
    np.testing.assert_allclose(found, lossy.natural_frequencies(20e3) * np.sqrt(1.0 + 0.01j), rtol=1e-9)


def test_derivatives() -> None:
    one = make_assembly()
    addresses = [
        "joint.k_theta",
        "joint.c_y",
        "joint.c_theta",
        "tool.segment[0].loss_factor",
        "holder.segment[0].density",
    ]
    near = one.natural_frequencies(20e3)
    _, slopes = one.complex_frequencies(near, addresses)
    for column, address in enumerate(addresses):
        value = one.get(address)
        step = 1e-5 * value
        up, down = (one.replace({address: value + s}).complex_frequencies(near)[0] for s in (step, -step))
        difference = (up - down) / (2.0 * step)
        np.testing.assert_allclose(slopes[:, column], difference, atol=1e-4 * np.abs(difference).max())


def test_each_mode_is_followed_to_a_distinct_pole() -> None:
    """Strong dashpots bring poles close to other undamped frequencies; all are distinct and all are modes."""
    print("seed 20261122")
    rng = np.random.default_rng(20261122)
    followed = 0
    for _ in range(12):
        values = {"c_y": 300.0 * 10.0 ** rng.uniform(0.0, 3.0), "c_theta": 10.0 ** rng.uniform(0.0, 3.0)}
        one = make_assembly(rng.uniform(0.05, 0.14), k_theta=10.0 ** rng.uniform(3.5, 5.0), **values)
        near = one.natural_frequencies(20e3)
        every = damped_modes(one, 40e3)
        assert every.missed == 0
        try:
            found, _ = one.complex_frequencies(near)
        except ReceptanceError:
            continue
        followed += 1
        assert len(np.unique(found.round(3))) == near.size
        distance = np.abs(found[:, None] - every.poles_hz[None, :]).min(axis=1)
        known = found.imag < 0.9 * np.abs(found)
        assert np.all(distance[known] < 1e-5 * np.abs(found[known]))
    assert followed >= 6


def test_overdamped_mode_is_noted() -> None:
    both = on_springs(c_y=4000.0)
    with pytest.raises(ReceptanceError, match="mode at"):
        both.complex_frequencies(both.natural_frequencies(2e3)[:1])


def test_dampings_are_identified() -> None:
    found = identify([measure(0.06), measure(0.09)], JOINT, starts=4)
    assert found.values["joint.k_theta"] == pytest.approx(1e5, rel=1e-3)
    assert found.values["joint.c_y"] == pytest.approx(300.0, rel=1e-3)
    assert found.values["joint.c_theta"] == pytest.approx(1.0, rel=1e-3)
    assert [residual.size for residual in found.residuals] == [2 * measure(x).frequency_hz.size for x in (0.06, 0.09)]


def test_some_ratios_may_be_missing() -> None:
    whole = measure(0.08)
    ratios = np.array(whole.damping_ratio)
    ratios[1:] = np.nan
    some = Observation.from_modes(
        assembly=whole.assembly,
        frequency_hz=whole.frequency_hz,
        standard_deviation_hz=1.0,
        damping_ratio=ratios,
        standard_deviation_damping=1e-4,
    )
    assert some.damped.tolist() == [0]
    assert identify([some], JOINT[:2], starts=2).residuals[0].size == whole.frequency_hz.size + 1


@pytest.mark.parametrize(
    ("fields", "output"),
    [
        ({"damping_ratio": [0.1, 0.2]}, "has shape"),
        ({"damping_ratio": [1.5]}, "less than 1"),
        ({"damping_ratio": [float("nan")]}, "has no number"),
        ({"standard_deviation_damping": 0.1}, "without damping_ratio"),
        ({"damping_ratio": [0.1], "standard_deviation_hz": 1.0}, "give both, or neither"),
        ({"damping_ratio": [0.1], "standard_deviation_damping": 0.1}, "give both, or neither"),
    ],
)
def test_bad_input(fields: dict[str, object], output: str) -> None:
    with pytest.raises(ValueError, match=output):
        Observation.from_modes(assembly=make_assembly(), frequency_hz=[1700.0], **fields)  # type: ignore[arg-type]


DAMPED = (
    'frequencies = ["2500 Hz", "10000 Hz"]\nstandard_deviation = "2 Hz"',
    'frequencies = ["2500 Hz", "10000 Hz"]\nstandard_deviation = "2 Hz"\ndamping_ratios = ["1.2 %", "unknown"]\n'
    'damping_deviation = "5 %"',
)


def test_a_campaign_has_them(tmp_path: Path) -> None:
    one = load(tmp_path, changed(DAMPED)).measurements["short"]
    assert one.damping_ratio[0] == pytest.approx(0.012)
    assert np.isnan(one.damping_ratio[1])
    assert one.standard_deviation_damping[0] == pytest.approx(6e-4)
    (tmp_path / "m.csv").write_text(
        "mode,frequency [Hz],standard_deviation [Hz],damping_ratio [%],damping_deviation [%]\n"
        "1,2500,2,1.2,5\n2,10000,2,,5\n"
    )
    again = load(tmp_path, changed((DAMPED[0], 'file = "m.csv"'))).measurements["short"]
    np.testing.assert_allclose(again.damping_ratio, one.damping_ratio)
    np.testing.assert_allclose(again.standard_deviation_damping, one.standard_deviation_damping)


def test_a_campaign_is_identified_with_them(tmp_path: Path) -> None:
    unknown = '"joint.c_y" = { lower = "1 N s/m", upper = "1e5 N s/m" }\n'
    settings = "[settings]\nstarts = 2\nprofiles = false\n"
    # Frequencies and a damping ratio that a joint can have.
    pair = load(tmp_path, changed(DAMPED)).measurements["short"].assembly
    true = damped_modes(pair.replace({"joint.k_y": 3e8, "joint.k_theta": 1e5, "joint.c_y": 500.0}), 2e4)
    first, second, ratio = *true.frequency_hz[:2].tolist(), 100.0 * float(true.damping_ratio[0])
    frequencies = ('"2500 Hz", "10000 Hz"', f'"{first!r} Hz", "{second!r} Hz"')
    text = changed(DAMPED, frequencies, ('"1.2 %", "unknown"', f'"{ratio!r} %", "unknown"')) + unknown + settings
    found = load(tmp_path, text).identify()
    low, high = found.interval("joint.c_y")
    assert 0.0 < low < found.values["joint.c_y"] < high


@pytest.mark.parametrize(
    ("old", "new", "output"),
    [
        ('"1.2 %", "unknown"', '"1.2 %"', "damping_ratio has shape"),
        ('"1.2 %", "unknown"', '"1.2 Hz", "unknown"', "expected a damping ratio such as"),
        ('damping_deviation = "5 %"', "", "give both, or neither"),
        ('damping_ratios = ["1.2 %", "unknown"]\n', "", "has a damping_deviation, but no damping_ratios"),
        ('"5 %"', '["5 %"]', "damping_deviation: is a list of 1, expected one for all or 2"),
    ],
)
def test_mistakes_of_a_campaign(tmp_path: Path, old: str, new: str, output: str) -> None:
    text = changed((DAMPED[0], DAMPED[1].replace(old, new)))
    assert text != TEXT
    with pytest.raises(CampaignError) as error:
        load(tmp_path, text)
    assert output in str(error.value)


@pytest.mark.slow
def test_diagnosis_finds_a_non_viscous_loss() -> None:
    """Frequencies and damping ratios of four overhangs; damping that no pair of dashpots has."""
    rng = np.random.default_rng(3)
    data = [measure(x, rng, c_y=30.0, c_theta=0.1, loss_factor=0.03) for x in (0.05, 0.065, 0.08, 0.1)]
    tolerances = [Tolerance(name="E", moves={"tool.segment[*].youngs_modulus": 0.002}, relative=True)]
    verdict = diagnose(
        data, JOINT, tolerances=tolerances, causes=["joint_hysteretic_loss", "tool_density"], max_causes=1
    )
    assert [one.id for one in verdict.causes] == ["joint_hysteretic_loss"]
    before = residuals_by_mode(verdict.selection.base)
    after = residuals_by_mode(verdict.explanation.fit)
    worst = [max(abs(one.damping_percent) for one in modes) for modes in (before, after)]
    assert worst[1] < 10.0 < worst[0]
    assert not any("of damping" in note for note in verdict.notes)
