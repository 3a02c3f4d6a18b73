"""A joint in micro-slip: its law, stated and computed level, derivatives and identifiability."""

from __future__ import annotations

import pickle
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

from receptance import (
    CARBIDE,
    STEEL,
    Assembly,
    Coordinate,
    GrossSlipError,
    MicroslipJoint,
    Observation,
    Part,
    PointJoint,
    Segment,
    Unknown,
    identify,
)
from receptance.fit import profile_likelihoods
from receptance.model.joints import largest_share

TOOL = Part([Segment(length=0.0623, outer_diameter=0.0127, material=CARBIDE)], name="tool")
HOLDER = Part([Segment(length=0.129, outer_diameter=0.045, material=STEEL)], name="holder")
LINES = np.linspace(1200.0, 2800.0, 90)
ENDS = {"response": Coordinate("holder", "end", "y"), "excitation": Coordinate("tool", 0.0, "y")}
GOOD: dict[str, Any] = {
    "k_y": 2e8,
    "k_theta": 4e4,
    "k_ytheta": 1e5,
    "c_y": 50.0,
    "c_theta": 0.02,
    "c_ytheta": 0.1,
    "loss_factor": 0.01,
    "slip_y": 0.1,
    "slip_theta": 0.2,
    "exponent": 0.7,
    "level": 1.3,
    "reference_y": 1e-7,
    "reference_theta": 2e-6,
}


def make(**changes: Any) -> Assembly:
    return Assembly([TOOL, MicroslipJoint(**{**GOOD, **changes}, name="joint"), HOLDER])


def test_small_amplitudes_are_a_point_joint() -> None:
    point = PointJoint(**{name: GOOD[name] for name in PointJoint.columns_of}, name="joint")
    expected = Assembly([TOOL, point, HOLDER])
    for assembly in (make(level=0.0), make(slip_y=0.0, slip_theta=0.0)):
        np.testing.assert_allclose(assembly.receptance(LINES, **ENDS), expected.receptance(LINES, **ENDS), rtol=1e-12)
        np.testing.assert_allclose(assembly.natural_frequencies(15e3), expected.natural_frequencies(15e3), rtol=1e-13)
    faint = make().receptance(LINES, force=1e-12)
    np.testing.assert_allclose(faint, expected.receptance(LINES), rtol=1e-6)


def test_a_stated_level_is_a_point_joint_of_that_stiffness() -> None:
    """On each line alone: real part into stiffness, imaginary part into damping."""
    assembly = make()
    stiffness = assembly.elements["joint"].stiffness(LINES)  # type: ignore[union-attr]
    found = assembly.receptance(LINES)
    for f, k, h in zip(LINES[::20], stiffness[::20], found[::20], strict=True):
        c = k.imag / (2.0 * np.pi * f)
        point = PointJoint(
            k_y=k[0, 0].real,
            k_theta=k[1, 1].real,
            k_ytheta=k[0, 1].real,
            c_y=c[0, 0],
            c_theta=c[1, 1],
            c_ytheta=c[0, 1],
        )
        np.testing.assert_allclose(Assembly([TOOL, point, HOLDER]).receptance([f])[0], h, rtol=1e-12)


def test_the_law() -> None:
    """Lost share and loss in the ratio 4 / (3 pi) for p = 1, that of Rayleigh's and Davidenkov's loops."""
    joint = MicroslipJoint(k_y=1e8, k_theta=1e5, slip_y=0.1, exponent=1.0, level=2.0)
    assert joint.stiffness([500.0])[0, 0, 0] == pytest.approx(1e8 * (0.8 + 0.2j * 4.0 / (3.0 * np.pi)))
    assert joint.stiffness([500.0])[0, 1, 1] == 1e5
    stiffer = make().natural_frequencies(15e3)
    assert np.all(make(level=2.0).natural_frequencies(15e3)[:2] < stiffer[:2])


@pytest.mark.parametrize("force", [None, 0.02, 0.3])
@pytest.mark.parametrize("places", [{}, ENDS])
def test_every_parameter_has_its_derivative(force: float | None, places: dict[str, Coordinate]) -> None:
    assembly = make()
    names = [name for name in assembly.parameters if name.startswith("joint.")]
    assert len(names) == 13
    names += ["tool.segment[0].length", "holder.segment[0].youngs_modulus"]
    h, slope = assembly.derivatives(LINES[::3], names, force=force, **places)
    np.testing.assert_allclose(h, assembly.receptance(LINES[::3], force=force, **places), rtol=1e-10)
    for column, name in enumerate(names):
        value = assembly.get(name)
        step = 1e-4 * value
        sides = [
            assembly.replace({name: value + s * step}).receptance(LINES[::3], force=force, **places)
            for s in (-2, -1, 1, 2)
        ]
        expected = (sides[0] - 8.0 * sides[1] + 8.0 * sides[2] - sides[3]) / (12.0 * step)
        if name.endswith(("level",) if force else ("reference_y", "reference_theta")):
            np.testing.assert_array_equal(slope[:, column], 0.0)
        allowed = 1e-5 * np.abs(expected).max() + 1e-9 * np.abs(h).max() / value
        assert np.max(np.abs(slope[:, column] - expected)) <= allowed, name


def test_natural_frequencies_have_derivatives_too() -> None:
    assembly = make()
    names = ["joint.k_y", "joint.slip_theta", "joint.exponent", "joint.level", "joint.c_y", "tool.segment[0].length"]
    found, slope = assembly.natural_frequency_derivatives(12e3, names)
    for column, name in enumerate(names):
        value = assembly.get(name)
        step = 1e-5 * value
        up, down = (assembly.replace({name: value + s * step}).natural_frequencies(12e3) for s in (1, -1))
        np.testing.assert_allclose(
            slope[:, column], (up - down) / (2.0 * step), rtol=1e-5, atol=1e-7 * found[0] / value
        )


@pytest.mark.parametrize("exponent", [0.3, 1.0, 2.0])
def test_level_is_consistent_with_motion_under_the_force(exponent: float) -> None:
    """Line by line a root of level = F |theta_a - theta_b| / a_ref, each side from a stated level."""
    given = {"slip_y": 0.0, "exponent": exponent, "c_y": 5.0, "c_theta": 0.002, "c_ytheta": 0.0, "k_ytheta": 0.0}
    force = {0.3: 0.003, 1.0: 0.03, 2.0: 0.05}[exponent]
    assembly = make(**{**given, "level": 0.0})
    found = assembly.receptance(LINES, force=force)
    sides = [Coordinate("tool", "end", "theta"), Coordinate("holder", 0.0, "theta")]

    def excess(level: float, f: float) -> float:
        a, b = assembly.replace({"joint.level": level}).receptance([f], response=sides)[0, :, 0]
        return level - force * abs(a - b) / GOOD["reference_theta"]

    # Up to where the whole interface slides.
    most = 0.999 * (largest_share(exponent) / GOOD["slip_theta"]) ** (1.0 / exponent)
    shares = []
    for f, h in zip(LINES[::6], found[::6], strict=True):
        level = brentq(excess, 0.0, most, args=(f,), xtol=1e-14, rtol=1e-13)
        shares.append(GOOD["slip_theta"] * level**exponent)
        at_level = assembly.replace({"joint.level": level}).receptance([f])[0]
        np.testing.assert_allclose(h, at_level, rtol=1e-7)
    assert max(shares) > 0.03


def test_a_stronger_force_softens_and_flattens_the_peak() -> None:
    lines = np.linspace(1500.0, 2400.0, 1200)
    peaks = [make(exponent=1.0).receptance(lines, force=force) for force in (0.003, 0.03, 0.1)]
    places = [lines[np.abs(h).argmax()] for h in peaks]
    heights = [np.abs(h).max() for h in peaks]
    assert places[0] > places[1] > places[2]
    assert heights[0] > heights[1] > heights[2]
    per_line = make().receptance(lines[:3], force=[0.01, 0.02, 0.03])
    for i, force in enumerate((0.01, 0.02, 0.03)):
        np.testing.assert_allclose(per_line[i], make().receptance(lines[i : i + 1], force=force)[0], rtol=1e-9)


def test_each_line_has_its_force() -> None:
    """More lines than one task of the core has, on any number of threads, beside each line alone."""
    lines = np.geomspace(1000.0, 6e3, 700)
    force = 0.02 * np.random.default_rng(4).uniform(0.1, 1.0, lines.size)
    names = ["joint.k_theta", "joint.slip_theta", "joint.loss_factor", "tool.segment[0].length"]
    h, slope = make().derivatives(lines, names, force=force, threads=1)
    for threads in (2, 3):
        again = make().derivatives(lines, names, force=force, threads=threads)
        np.testing.assert_array_equal(again[0], h)
        np.testing.assert_array_equal(again[1], slope)
    for line in (0, 1, 7, 255, 256, 300, 511, 512, 699):
        some = slice(line, line + 1)
        alone = make().derivatives(lines[some], names, force=force[some])
        np.testing.assert_allclose(alone[0], h[some], rtol=1e-9)
        np.testing.assert_allclose(alone[1], slope[some], rtol=1e-8)


def test_linear_structure_is_independent_of_force() -> None:
    linear = Assembly([TOOL, PointJoint(k_y=2e8, k_theta=4e4), HOLDER])
    np.testing.assert_array_equal(linear.receptance(LINES, force=50.0), linear.receptance(LINES))


def test_errors_name_the_mistake() -> None:
    with pytest.raises(ValueError, match=r"'joint': the level 6 reduces k_theta by a share of 0.701, expected at most"):
        make(level=6.0)
    with pytest.raises(ValueError, match=r"exponent is 0, expected more than zero and at most 4"):
        make(exponent=0.0)
    with pytest.raises(ValueError, match=r"k_theta is zero, expected a positive stiffness"):
        make(k_theta=0.0, k_ytheta=0.0)
    with pytest.raises(ValueError, match=r"k_ytheta is 2.7e\+06, expected at most sqrt"):
        make(k_ytheta=2.7e6)
    with pytest.raises(GrossSlipError, match=r"joint 'joint' slides as a whole in (y|theta) at \d+.* Hz under 100 N"):
        make().receptance(LINES, force=100.0)
    with pytest.raises(ValueError, match=r"joint.reference_theta is zero, expected the amplitude at level 1"):
        make(reference_theta=0.0).receptance(LINES, force=0.01)
    with pytest.raises(ValueError, match=r"force\[0\] is -1, expected a finite number above zero"):
        make().receptance(LINES, force=-1.0)
    with pytest.raises(ValueError, match=r"force has shape \(2,\), expected one number or \(90,\)"):
        make().receptance(LINES, force=[1.0, 2.0])
    with pytest.raises(ValueError, match="force needs exactly one excitation, and there are 2"):
        make().receptance(LINES, excitation=[Coordinate(), Coordinate("holder", "end")], force=0.01)
    with pytest.raises(ValueError, match="expected real lines for a stepped sine"):
        make().receptance(LINES - 1j, force=0.01)
    with pytest.raises(ValueError, match="complex lines to a decaying window"):
        Observation(assembly=make(), frequency_hz=LINES - 1j, receptance=make().receptance(LINES), force=1.0)
    with pytest.raises(ValueError, match=r"no parameter 'joint.slip'; MicroslipJoint has .*, slip_y, slip_theta"):
        make().get("joint.slip")
    with pytest.raises(ValueError, match="level is 0, expected more than zero: with an exponent below 1"):
        make(level=0.0).derivatives(LINES, ["joint.level"])
    with pytest.raises(ValueError, match="or has a joint in micro-slip"):
        make().reduced_to_joint("joint", LINES)
    assert pickle.loads(pickle.dumps(make())) == make()


STIFFNESS = Unknown(address="joint.k_theta", lower=1e4, upper=2e5)
SLIP = Unknown(address="joint.slip_theta", lower=1e-3, upper=0.45)
LOSS = Unknown(address="joint.loss_factor", lower=1e-4, upper=0.2)
TRUE: dict[str, Any] = {"slip_y": 0.0, "exponent": 1.0, "c_y": 0.0, "c_theta": 0.0, "c_ytheta": 0.0, "k_ytheta": 0.0}
BAND = np.linspace(1500.0, 2400.0, 200)


def hit(level: float, seed: int, *, scatter: float = 0.01, k_y: float = 2e8) -> Observation:
    true = make(**{**TRUE, "level": level, "k_y": k_y})
    rng = np.random.default_rng(seed)
    noise = scatter * (rng.normal(size=BAND.size) + 1j * rng.normal(size=BAND.size))
    values = true.receptance(BAND) * np.exp(noise)
    return Observation(
        assembly=true, frequency_hz=BAND, receptance=values, standard_deviation=scatter, label=f"level {level:g}"
    )


def test_slip_at_one_level_is_noted_as_indistinguishable() -> None:
    """Stiffness, slip and loss factor make one complex stiffness: two numbers for three unknowns.

    Translation is held fast, whose loss would otherwise determine the loss factor.
    """
    found = identify([hit(1.0, seed, k_y=1e13) for seed in (1, 2)], [STIFFNESS, SLIP, LOSS], starts=4)
    assert found.rms == pytest.approx(1.0, abs=0.1)
    left = found.values["joint.k_theta"] * (1.0 - found.values["joint.slip_theta"])
    assert left == pytest.approx(0.8 * GOOD["k_theta"], rel=0.01)
    profiles = profile_likelihoods(found)
    for name in ("joint.slip_theta", "joint.loss_factor"):
        assert profiles[name].lower_open
        assert not profiles[name].statement.startswith("determined"), profiles[name].statement
    assert any("tied" in advice for advice in found.advice)


def test_two_levels_separate_slip_from_stiffness() -> None:
    found = identify([hit(0.5, 1), hit(2.0, 2)], [STIFFNESS, SLIP, LOSS], starts=4)
    assert found.rms == pytest.approx(1.0, abs=0.1)
    true = {"joint.k_theta": GOOD["k_theta"], "joint.slip_theta": GOOD["slip_theta"], "joint.loss_factor": 0.01}
    for name, profile in profile_likelihoods(found).items():
        assert profile.statement.startswith("determined"), profile.statement
        assert profile.lower <= true[name] <= profile.upper, name
        assert (profile.upper - profile.lower) / true[name] < 0.1, name


def test_stepped_sines_at_two_forces_are_identified() -> None:
    rng = np.random.default_rng(5)
    data = []
    for force in (0.01, 0.05):
        true = make(**TRUE)
        noise = 0.01 * (rng.normal(size=BAND.size) + 1j * rng.normal(size=BAND.size))
        values = true.receptance(BAND, force=force) * np.exp(noise)
        data.append(
            Observation(
                assembly=true,
                frequency_hz=BAND,
                receptance=values,
                standard_deviation=0.01,
                force=force,
                label=f"{force} N",
            )
        )
    unknowns = [
        Unknown(address="joint.k_theta", lower=1e4, upper=2e5, start=4.3e4),
        Unknown(address="joint.slip_theta", lower=1e-3, upper=0.45, start=0.1),
        Unknown(address="joint.loss_factor", lower=1e-4, upper=0.2, start=0.02),
    ]
    found = identify(data, unknowns, starts=1)
    assert found.rms == pytest.approx(1.0, abs=0.1)
    for name, true_value in (("joint.k_theta", 4e4), ("joint.slip_theta", 0.2), ("joint.loss_factor", 0.01)):
        low, high = found.interval(name, 0.999)
        assert low <= true_value <= high, (name, low, high)
        assert (high - low) / true_value < 0.2, name
