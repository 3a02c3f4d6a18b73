"""Laws across configurations, tolerances and priors: the map from the fitted vector to assemblies."""

from __future__ import annotations

import math
import pickle

import numpy as np
import pytest

from receptance import CARBIDE, STEEL, Assembly, Observation, Part, PointJoint, Segment, Unknown
from receptance.fit import Law, Power, Prior, Tolerance, identify
from receptance.fit.parameters import Parameters, Site

LINES = np.linspace(200.0, 6000.0, 150)


def make_assembly(
    overhang: float = 0.0623, k_y: float = 6.3e8, k_theta: float = 1.0e5, diameter: float = 0.0127
) -> Assembly:
    tool = Part([Segment(length=overhang, outer_diameter=diameter, material=CARBIDE)], name="tool")
    holder = Part([Segment(length=0.129, outer_diameter=0.045, material=STEEL)], name="holder")
    return Assembly([tool, PointJoint(k_y=k_y, k_theta=k_theta, c_theta=2.0, name="joint"), holder])


def measure(
    truth: Assembly, nominal: Assembly, name: str, seed: int | None, sd: float = 0.01, **conditions: float
) -> Observation:
    values = truth.receptance(LINES)
    if seed is not None:
        noise = np.random.default_rng(seed).normal(scale=sd, size=(2, LINES.size))
        values = values * np.exp(noise[0] + 1j * noise[1])
    return Observation(
        assembly=nominal,
        frequency_hz=LINES,
        receptance=values,
        standard_deviation=sd,
        configuration=name,
        conditions=conditions,
    )


def test_the_map_and_its_derivatives():
    nominal = make_assembly()
    requested = [
        Law(address="joint.k_y", lower=1e6, upper=1e10, powers=Power(of="torque", reference=20.0), individual=0.05),
        Law(address="joint.k_theta", lower=1e3, upper=1e7, free=True),
    ]
    tolerances = [
        Tolerance(name="blank", moves={"tool.segment[*].outer_diameter": 1e-5}),
        Tolerance(name="carbide", moves={"tool.segment[*].youngs_modulus": 0.02}, relative=True),
        Tolerance(name="clamping a", moves={"tool.segment[0].length": 1e-4}, configurations="a"),
    ]
    places = [Site(nominal, name, "", {"torque": t}) for name, t in (("a", 20.0), ("b", 40.0))]
    parameters = Parameters(requested, tolerances, places)
    assert [unknown.name for unknown in parameters.unknowns] == [
        "joint.k_y",
        "joint.k_y ~ torque",
        "joint.k_theta @ a",
        "joint.k_theta @ b",
        "joint.k_y @ a",
        "joint.k_y @ b",
        "blank",
        "carbide",
        "clamping a",
    ]
    assert parameters.count == 4
    u = np.array([3e8, 0.5, 1e5, 2e5, 1.0, -2.0, 0.5, -1.0, 2.0])
    a, b = (parameters.at(place) for place in places)
    second = dict(zip(b.addresses, b.values(u), strict=True))
    assert second["joint.k_y"] == pytest.approx(3e8 * 2.0**0.5 * math.exp(-0.1))
    assert second["joint.k_theta"] == pytest.approx(2e5)
    assert second["tool.segment[0].outer_diameter"] == pytest.approx(0.0127 + 0.5e-5)
    assert second["tool.segment[0].youngs_modulus"] == pytest.approx(CARBIDE.youngs_modulus * math.exp(-0.02))
    assert "tool.segment[0].length" not in second
    assert dict(zip(a.addresses, a.values(u), strict=True))["tool.segment[0].length"] == pytest.approx(0.0623 + 2e-4)
    for placed in (a, b):
        slope = placed.jacobian(u)
        for i in range(u.size):
            step = 1e-6 * max(abs(u[i]), 1.0)
            up, down = u.copy(), u.copy()
            up[i] += step
            down[i] -= step
            expected = (placed.values(up) - placed.values(down)) / (2 * step)
            # Ten digits of the largest number are lost in the difference of two of them.
            assert np.allclose(slope[:, i], expected, rtol=1e-6, atol=1e-7 * np.abs(placed.values(u)) / step * 1e-3)


def test_law_has_exponents_and_individual_deviations():
    """A coupling term scales with the geometric mean of two stiffnesses."""
    half = {"joint.k_ytheta": 0.5}
    requested = [
        Law(address="joint.k_y", lower=1e6, upper=1e10, powers=Power(of="torque", reference=20.0), follows=half),
        Law(address="joint.k_theta", lower=1e3, upper=1e7, individual=0.05, follows=half),
        Unknown(address="joint.k_ytheta", lower=-1e7, upper=1e7, start=0.0),
    ]
    places = [Site(make_assembly(), name, "", {"torque": t}) for name, t in (("a", 20.0), ("b", 40.0))]
    parameters = Parameters(requested, [], places)
    u = dict.fromkeys((unknown.name for unknown in parameters.unknowns), 0.0)
    u |= {"joint.k_y": 3e8, "joint.k_y ~ torque": 0.6, "joint.k_theta": 1e5, "joint.k_ytheta": -2e6}
    u |= {"joint.k_theta @ a": 1.0, "joint.k_theta @ b": -2.0}
    ratios = []
    for place in places:
        placed = parameters.at(place)
        own = dict(zip(placed.addresses, placed.values(np.array(list(u.values()))), strict=True))
        ratios.append(own["joint.k_ytheta"] / math.sqrt(own["joint.k_y"] * own["joint.k_theta"]))
    assert ratios == pytest.approx([-2e6 / math.sqrt(3e8 * 1e5)] * 2)
    with pytest.raises(ValueError, match=r"what follows it: no observation's assembly has it; there are joint\.k_y"):
        Parameters([Law(address="joint.k_y", lower=1.0, upper=2.0, follows={"joint.k_both": 0.5})], [], places)


def test_an_unknown_reaches_assemblies_that_were_not_observed():
    true, spare = (
        make_assembly(k_theta=1.3e5),
        Part([Segment(length=0.1, outer_diameter=0.0127, material=CARBIDE)], name="spare"),
    )
    held_out = Assembly([spare, PointJoint(k_y=6.3e8, k_theta=1e5, name="other"), true.elements["holder"]])
    data = Observation.from_modes(
        assembly=make_assembly(), frequency_hz=true.natural_frequencies(8e3), standard_deviation_hz=1.0
    )
    unknown = Unknown(address="joint.k_theta", lower=1e3, upper=1e7, also={"other.k_theta": 0.5})
    found = identify(data, unknown)
    assert found.values["joint.k_theta"] == pytest.approx(1.3e5, rel=1e-3)
    assert found.at(held_out).assembly.get("other.k_theta") == pytest.approx(0.65e5, rel=1e-3)
    assert any("no observation's assembly has other.k_theta; it affects predictions" in n for n in found.notes)
    with pytest.raises(ValueError, match=r"no observation's assembly has other\.k_theta"):
        identify(data, Unknown(address="other.k_theta", lower=1e3, upper=1e7, also={"other.k_y": 1e4}))


def test_a_power_law_is_found_over_overhangs():
    law = Power(of="tool.segment[0].length", reference=0.0623)
    observations = []
    for i, overhang in enumerate((0.05, 0.0623, 0.08)):
        truth = make_assembly(overhang, k_theta=1e5 * (overhang / 0.0623) ** -0.7)
        observations.append(measure(truth, make_assembly(overhang), f"{1e3 * overhang:g} mm", i))
    found = identify(
        observations,
        [
            Unknown(address="joint.k_y", lower=1e7, upper=1e10),
            Law(address="joint.k_theta", lower=1e3, upper=1e7, powers=law),
        ],
        starts=4,
    )
    exponent = "joint.k_theta ~ tool.segment[0].length"
    assert found.values[exponent] == pytest.approx(-0.7, abs=4 * found.standard_errors[exponent])
    assert found.standard_errors[exponent] < 0.05
    assert found.values["joint.k_theta"] == pytest.approx(1e5, rel=0.05)
    # Unmeasured configurations follow the law.
    other = found.at(make_assembly(0.07)).assembly
    assert other.get("joint.k_theta") == pytest.approx(
        found.values["joint.k_theta"] * (0.07 / 0.0623) ** found.values[exponent]
    )


def test_law_follows_conditions_and_free_values_do_not():
    torques = {"loose": 20.0, "tight": 60.0}
    observations = [
        measure(make_assembly(k_theta=4e4 * (t / 20.0) ** 0.5), make_assembly(), name, i, torque=t)
        for i, (name, t) in enumerate(torques.items())
    ]
    fixed = Unknown(address="joint.k_y", lower=1e7, upper=1e10)
    power = Law(address="joint.k_theta", lower=1e3, upper=1e7, powers=Power(of="torque", reference=20.0))
    free = Law(address="joint.k_theta", lower=1e3, upper=1e7, free=True)
    with_law = identify(observations, [fixed, power], starts=3)
    without = identify(observations, [fixed, free], starts=3)
    assert with_law.values["joint.k_theta ~ torque"] == pytest.approx(0.5, abs=0.05)
    ratio = without.values["joint.k_theta @ tight"] / without.values["joint.k_theta @ loose"]
    assert ratio == pytest.approx(3.0 ** with_law.values["joint.k_theta ~ torque"], rel=1e-4)
    assert with_law.at(make_assembly(), conditions={"torque": 40.0}).assembly.get("joint.k_theta") == pytest.approx(
        4e4 * 2.0**0.5, rel=0.05
    )
    with pytest.raises(ValueError, match="no condition 'torque'"):
        with_law.at(make_assembly())
    with pytest.raises(ValueError, match="free in each configuration"):
        without.at(make_assembly(), configuration="other")


def test_tolerances_widen_intervals_and_are_fitted_if_observable():
    truth = make_assembly(diameter=0.0127 * 1.004)
    frf = measure(truth, make_assembly(), "one", 1)
    unknowns = [
        Unknown(address="joint.k_y", lower=1e7, upper=1e10),
        Unknown(address="joint.k_theta", lower=1e3, upper=1e7),
    ]
    blank = Tolerance(name="blank", moves={"tool.segment[*].outer_diameter": 0.002}, relative=True)
    exact = identify(frf, unknowns, starts=3, noise="stated")
    found = identify(frf, unknowns, tolerances=blank, starts=3)
    assert found.errors == ("blank",)
    assert found.values["blank"] == pytest.approx(2.0, abs=0.3)
    assert found.rms < 1.1 < exact.rms
    assert found.standard_errors["joint.k_theta"] > exact.standard_errors["joint.k_theta"]
    low, high = found.interval("joint.k_theta")
    assert low < 1e5 < high
    assert found.assemblies[0].get("tool.segment[0].outer_diameter") == pytest.approx(0.0127 * 1.004, rel=1e-3)
    again = pickle.loads(pickle.dumps(found))
    assert again.values == found.values
    # A new tool of that blank has the same error.
    predicted = found.at(make_assembly(0.07)).natural_frequencies(6000.0)
    frequency, spread = predicted.predicted_hz, predicted.standard_error_hz
    assert np.all(
        np.abs(frequency - make_assembly(0.07, diameter=0.0127 * 1.004).natural_frequencies(6000.0)) < 5 * spread
    )


def test_one_error_shared_by_two_observations_and_one_of_each():
    frfs = [measure(make_assembly(l_), make_assembly(l_), name, None) for name, l_ in (("a", 0.05), ("b", 0.07))]
    unknowns = [Unknown(address="joint.k_theta", lower=1e3, upper=1e7)]
    shared = Tolerance(name="carbide", moves={"tool.segment[*].youngs_modulus": 0.02}, relative=True)
    own = [Tolerance(name=f"overhang {n}", moves={"tool.segment[0].length": 1e-4}, configurations=n) for n in "ab"]
    found = identify(frfs, unknowns, tolerances=[shared, *own], starts=2)
    assert found.errors == ("carbide", "overhang a", "overhang b")
    assert found.values["joint.k_theta"] == pytest.approx(1e5, rel=1e-4)
    assert np.allclose([found.values[name] for name in found.errors], 0.0, atol=1e-3)


def test_prior_determines_an_unobservable_parameter():
    frequency = make_assembly().natural_frequencies(5e3)[:1]
    mode = Observation.from_modes(assembly=make_assembly(), frequency_hz=frequency, standard_deviation_hz=5.0)
    prior = Prior(mean=1e9, standard_deviation=0.3)
    found = identify(
        mode,
        [
            Unknown(address="joint.k_y", lower=1e7, upper=1e11, prior=prior),
            Unknown(address="joint.k_theta", lower=1e3, upper=1e7),
        ],
        starts=2,
    )
    assert found.values["joint.k_y"] == pytest.approx(1e9, rel=0.02)
    assert found.standard_errors["joint.k_y"] == pytest.approx(3e8, rel=0.1)


@pytest.mark.parametrize(
    ("make", "error", "words"),
    [
        (lambda: Power(of="torque", reference=0.0), ValueError, "reference is 0"),
        (
            lambda: Law(address="joint.k_y", lower=1.0, upper=2.0, free=True, individual=0.1),
            ValueError,
            "one of the two",
        ),
        (lambda: Law(address="joint.k_y", lower=1.0, upper=2.0, powers=("torque",)), TypeError, "expected a Power"),
        (
            lambda: Law(address="joint.k_y", lower=1.0, upper=2.0, free=True, follows={"joint.k_ytheta": 0.5}),
            ValueError,
            "it is free and has parameters that follow it",
        ),
        (lambda: Tolerance(name="", moves={"a": 1.0}), TypeError, "expected the name of the error"),
        (lambda: Tolerance(name="x", moves={"tool.segment[0].length": 0.0}), ValueError, "is 0"),
        (lambda: Prior(mean=1.0, standard_deviation=0.0), ValueError, "standard_deviation is 0"),
        (
            lambda: Unknown(address="a", lower=1.0, upper=2.0, prior=Prior(mean=-1.0, standard_deviation=1.0)),
            ValueError,
            "the prior's mean is -1",
        ),
        (lambda: Unknown(address="a", lower=1.0, upper=2.0, configurations=()), ValueError, "names of configurations"),
        (lambda: _fit(tolerances="x"), TypeError, "expected a Tolerance"),
        (
            lambda: _fit(tolerances=[Tolerance(name="x", moves={"tool.mass": 1.0})]),
            ValueError,
            "no observation's assembly",
        ),
        (
            lambda: _fit(tolerances=[Tolerance(name="x", moves={"tool.segment[0].length": 1e-4}, configurations="z")]),
            ValueError,
            "no observation is of z; there are one",
        ),
        (
            lambda: _fit(tolerances=[Tolerance(name="joint.k_y", moves={"tool.segment[0].length": 1e-4})]),
            ValueError,
            "given to two unknowns",
        ),
        (lambda: _fit(powers=Power(of="torque", reference=1.0)), ValueError, "no condition 'torque'"),
    ],
)
def test_mistakes_give_messages(make, error, words):
    with pytest.raises(error, match=words):
        make()


def _fit(tolerances: object = (), powers: object = ()) -> None:
    frf = measure(make_assembly(), make_assembly(), "one", None)
    identify(frf, Law(address="joint.k_y", lower=1e7, upper=1e10, powers=powers), tolerances=tolerances, starts=1)


def test_priors_need_standard_deviations():
    bare = Observation.from_modes(assembly=make_assembly(), frequency_hz=make_assembly().natural_frequencies(15e3)[:2])
    with pytest.raises(ValueError, match="can only be weighed"):
        identify(
            bare,
            Unknown(address="joint.k_y", lower=1e7, upper=1e10),
            tolerances=Tolerance(name="x", moves={"tool.segment[0].length": 1e-4}),
        )


def test_a_free_law_has_a_value_between_those_of_neighbours_along_a_condition():
    law = Law(address="joint.k_y", lower=1e6, upper=1e10, free=True, along="force")
    places = [Site(make_assembly(), f"{force:g} kN", conditions={"force": force}) for force in (10.0, 0.0, 20.0)]
    parameters = Parameters([law], [], places)
    unknowns = np.array([3e8, 1e8, 4e8])  # in the order of the places
    between = Site(make_assembly(), "5 kN", conditions={"force": 5.0})
    placed = parameters.at(between)
    assert placed.values(unknowns) == pytest.approx([2e8])
    np.testing.assert_allclose(placed.jacobian(unknowns), [[0.5, 0.5, 0.0]])
    again = Site(make_assembly(), "another 20 kN", conditions={"force": 20.0})
    assert parameters.at(again).values(unknowns) == pytest.approx([4e8])
    with pytest.raises(ValueError, match="known for 'force' from 0 to 20"):
        parameters.at(Site(make_assembly(), "25 kN", conditions={"force": 25.0}))
    with pytest.raises(ValueError, match="no condition 'force'"):
        parameters.at(Site(make_assembly(), "unknown"))
    with pytest.raises(ValueError, match="of a free law only"):
        Law(address="joint.k_y", lower=1e6, upper=1e10, along="force")
