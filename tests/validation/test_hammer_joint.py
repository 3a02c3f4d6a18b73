"""From hits to the joint: simulated by finite elements in the time domain, identified with the wave solution."""

import os
import warnings

import numpy as np
import pytest

import hammer_joint
from receptance import (
    Assembly,
    Coordinate,
    Material,
    Observation,
    Part,
    PointJoint,
    Segment,
    Unknown,
    campaign,
    examples,
    identify,
)
from receptance.errors import ReceptanceWarning
from receptance.hammer import HammerRecords, estimate_frf

SEED = int(os.environ.get("RECEPTANCE_TEST_SEED", "7"))
RUNS = 24
DECAY_RATE = 60.0
TRUE = {"joint.k_y": 6.3e8, "joint.k_theta": 1.0e5, "joint.c_y": 500.0, "joint.c_theta": 0.1}
UNKNOWNS = [
    Unknown(address="joint.k_y", lower=1e7, upper=1e11),
    Unknown(address="joint.k_theta", lower=1e3, upper=1e7),
    Unknown(address="joint.c_y", lower=1.0, upper=1e5),
    Unknown(address="joint.c_theta", lower=1e-3, upper=10.0),
]


def model(**joint):
    carbide, steel = (
        Material(youngs_modulus=e, density=rho, poisson_ratio=nu)
        for e, rho, nu in (hammer_joint.CARBIDE, hammer_joint.STEEL)
    )
    length, diameter = hammer_joint.TOOL
    tool = Part([Segment(length=length, outer_diameter=diameter, material=carbide)], name="tool")
    sections = [Segment(length=x, outer_diameter=d, material=steel) for x, d in hammer_joint.SECTIONS]
    return Assembly([tool, PointJoint(**joint, name="joint"), Part(sections, name="holder")])


def structure():
    return hammer_joint.Structure(**{address.split(".")[1]: value for address, value in TRUE.items()})


def test_simulated_and_identified_structures_agree():
    lines = np.linspace(200.0, 12e3, 500)
    assembly = model(**{address.split(".")[1]: value for address, value in TRUE.items()})
    for decay_rate in (0.0, DECAY_RATE):
        wave = assembly.receptance(lines - 1j * decay_rate / (2.0 * np.pi))
        np.testing.assert_allclose(structure().receptance(lines, decay_rate), wave, rtol=1e-6)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::receptance.errors.ReceptanceWarning")
def test_the_packaged_hammer_campaign_is_adequate(tmp_path):
    """Its lines are correlated unequally, from 4 to 170 count as one, and its model is exact."""
    examples.write("hammer", tmp_path)
    found = campaign.load(tmp_path, threads=1).diagnose(causes=["sensor_mass"])
    assert found.verdict == "adequate"
    assert found.adequacy.misfit == pytest.approx(1.0, abs=0.1)


@pytest.mark.slow
def test_joint_is_unbiased_with_a_known_exponential_window(summarise):
    """Where the shift of the lines is left out, all of the window is taken for damping of the joint."""
    bench = hammer_joint.Bench(structure())
    assembly = model(k_y=3e8, k_theta=2e5, c_y=300.0, c_theta=0.2)
    errors = {"with the shift": [], "without it": []}
    generator = np.random.default_rng(SEED)
    for _ in range(RUNS):
        force, response = bench.strike(generator, 10, 200.0, -60.0, -50.0)
        records = HammerRecords(
            force=force,
            response=response,
            sample_rate_hz=bench.sample_rate_hz,
            quantity="acceleration",
            excitation=Coordinate(),
            responses=Coordinate(),
        )
        frf = estimate_frf(records, decay_rate=DECAY_RATE, low_hz=300.0, high_hz=13e3)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", ReceptanceWarning)
            ignoring = frf.with_(decay_rate=0.0)
        # Both in standard errors of the right fit: those of the other one include its error of the model.
        right = identify(Observation.from_frf(assembly, frf), UNKNOWNS, starts=3)
        wrong = identify(Observation.from_frf(assembly, ignoring), UNKNOWNS, starts=3)
        for name, fit in (("with the shift", right), ("without it", wrong)):
            assert fit.converged
            errors[name].append([(fit.values[a] - TRUE[a]) / right.standard_errors[a] for a in TRUE])
    means = {name: np.mean(rows, axis=0) for name, rows in errors.items()}
    spread = np.std(errors["with the shift"], axis=0)
    lines = [
        f"errors in standard errors, mean of {RUNS} runs, seed {SEED}",
        " " * 16 + "".join(f"{a:>15}" for a in TRUE),
    ]
    lines += [f"{name:16s}" + "".join(f"{value:15.2f}" for value in mean) for name, mean in means.items()]
    lines.append(f"{'their scatter':16s}" + "".join(f"{value:15.2f}" for value in spread))
    plain = {name: mean.tolist() for name, mean in means.items()}
    summarise("joint from hits", "\n".join(lines), {**plain, "scatter": spread.tolist()})
    assert np.all(np.abs(means["with the shift"]) < 1.0), lines
    assert np.all(np.abs(means["without it"]) > 2.0), lines
    assert np.all(means["without it"][2:] > 10.0), lines
    # Lines that a window makes alike are counted as fewer, rather too few than too many.
    assert np.all((spread > 0.2) & (spread < 1.5)), lines
