"""Fits of one joint on the reduced model: the same residuals and derivatives as on the whole one."""

import numpy as np
import pytest

from receptance import Coordinate, GroundSpring, PointMass, Unknown, identify
from receptance.identification.reduced import JointResidual, only_joint
from receptance.identification.residuals import FRFResidual
from receptance.identification.unknowns import Variables
from tool_in_holder import DASHPOTS, LINES, STIFFNESSES, TRUE, make_assembly, simulate

COUPLING = Unknown(address="joint.k_ytheta", lower=-1e9, upper=1e9)
LOSS = Unknown(address="joint.loss_factor", lower=0.0, upper=0.5)
NOSE = Coordinate("holder", 0.0)


def both(frf, unknowns, unit="logarithm", chosen=None):
    variables = Variables(tuple(unknowns))
    whole = FRFResidual(frf, variables, unit, chosen, 1)
    return variables, whole, JointResidual(frf, variables, unit, chosen, "joint", 1)


@pytest.mark.parametrize(
    "places",
    [
        {},
        {"response": NOSE},
        {"response": NOSE, "excitation": NOSE},
        {"excitation": Coordinate("holder", "end", "theta")},
    ],
)
def test_sum_of_squares_gradient_and_curvature_are_those_of_the_whole_model(places):
    unknowns = [*STIFFNESSES, COUPLING, *DASHPOTS, LOSS]
    frf = simulate(make_assembly(k_ytheta=3e6), **places)
    variables, whole, reduced = both(frf, unknowns)
    seed = 5
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    for _ in range(5):
        values = np.array([10 ** rng.uniform(6, 10), 10 ** rng.uniform(3, 7), 0.0, *10 ** rng.uniform(-1, 2, 2), 0.03])
        values[2] = rng.uniform(-0.9, 0.9) * np.sqrt(values[0] * values[1])
        slopes = variables.slopes(values)
        residual, jacobian = whole.evaluate(values, slopes)
        small, small_jacobian = reduced.evaluate(values, slopes)
        assert small @ small == pytest.approx(residual @ residual, rel=1e-9)
        size = np.linalg.norm(jacobian, axis=0)
        gradient = np.abs(small_jacobian.T @ small - jacobian.T @ residual)
        assert np.all(gradient <= 1e-9 * size * np.linalg.norm(residual))
        curvature = np.abs(small_jacobian.T @ small_jacobian - jacobian.T @ jacobian)
        assert np.all(curvature <= 1e-9 * np.outer(size, size))


def test_bands_weights_attachments_and_threads_enter_alike():
    assembly = make_assembly()
    more = [
        PointMass(mass=0.002, part="tool", position=0.01),
        GroundSpring(k_y=1e5, c_y=3.0, part="holder", position="end"),
    ]
    assembly = type(assembly)(assembly.elements.values(), more)
    spread = np.linspace(0.01, 0.1, LINES.size)
    frf = simulate(assembly, standard_deviation=spread)
    chosen = (LINES > 900.0) & (LINES < 7777.0)
    variables, whole, reduced = both(frf, STIFFNESSES, "standard deviations", chosen)
    values = np.array([2e8, 4e4])
    slopes = variables.slopes(values)
    expected, got = whole.evaluate(values, slopes)[0], reduced.evaluate(values, slopes)[0]
    assert got @ got == pytest.approx(expected @ expected, rel=1e-9)
    threaded = JointResidual(frf, variables, "standard deviations", chosen, "joint", 3)
    assert np.array_equal(threaded.evaluate(values, slopes)[0], got)


def test_the_reduction_is_taken_where_only_one_joint_is_unknown():
    frf = simulate(make_assembly())
    assert only_joint(frf, Variables(tuple(STIFFNESSES))) == "joint"
    diameter = Unknown(address="tool.segment[0].outer_diameter", lower=0.01, upper=0.02)
    assert only_joint(frf, Variables((*STIFFNESSES, diameter))) is None
    assert only_joint(frf, Variables((diameter,))) is None


def test_the_fit_reaches_the_truth_from_soft_and_from_stiff():
    for start in (1e6, 1e11):
        unknowns = [
            Unknown(address="joint.k_y", lower=1e6, upper=1e11, start=start),
            Unknown(address="joint.k_theta", lower=1e2, upper=1e8, start=1e2 if start < 1e8 else 1e8),
            *DASHPOTS,
        ]
        found = identify(simulate(make_assembly()), unknowns, starts=4)
        for address, value in TRUE.items():
            assert found.values[address] == pytest.approx(value, rel=1e-6)
        assert len(found.residuals[0]) == 2 * LINES.size
