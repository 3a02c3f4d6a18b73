"""Arguments of the methods that return complex natural frequencies: wrong ones are errors, none is a crash."""

from __future__ import annotations

import numpy as np
import pytest

from receptance import STEEL, Assembly, GroundSpring, Part, PointJoint, Segment, _core
from receptance.errors import ReceptanceError

NONE = np.zeros((0, 3))


def model() -> _core.Model:
    lengths = {"tool": 0.1, "holder": 0.2}
    bars = [Part([Segment(length=x, outer_diameter=0.02, material=STEEL)], name=n) for n, x in lengths.items()]
    joint = PointJoint(k_y=1e8, k_theta=1e4, c_y=100.0, c_theta=0.1, name="joint")
    clamp = GroundSpring(part="holder", position="end", k_y=1e8, k_theta=1e5, name="clamp")
    return Assembly([bars[0], joint, bars[1]], [clamp]).flat().model


@pytest.mark.parametrize(
    "call",
    [
        lambda m: m.complex_frequencies(np.array([np.nan]), NONE),
        lambda m: m.complex_frequencies(np.array([-1e3]), NONE),
        lambda m: m.complex_frequencies(np.array([1e3, 2e3])[::-1][::1], np.array([[1.0, 7.0, 2.0]])),
        lambda m: m.complex_frequencies(np.array([1e300]), NONE),
        lambda m: m.poles(np.array([0j]), (1.0, 1e4), (-0.5, 1.0)),
        lambda m: m.poles(np.array([np.nan + 0j]), (1.0, 1e4), (-0.5, 1.0)),
        lambda m: m.poles(np.zeros(0, complex), (1e4, 1.0), (-0.5, 1.0)),
        lambda m: m.poles(np.zeros(0, complex), (0.0, 1e4), (-0.5, 1.0)),
        lambda m: m.poles(np.zeros(0, complex), (1.0, np.inf), (-0.5, 1.0)),
        lambda m: m.poles(np.zeros(0, complex), (1.0, 1e4), (-2.0, 1.0)),
        lambda m: m.poles(np.zeros(0, complex), (1.0, 1e4), (np.nan, 1.0)),
    ],
)
def test_wrong_arguments_are_errors(call: object) -> None:
    with pytest.raises((ValueError, ReceptanceError)):
        call(model())  # type: ignore[operator]


def test_any_numbers_return_or_raise() -> None:
    """Numbers or errors of the library for arguments of any magnitude."""
    seed = 20261123
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    own = model()
    special = np.array([0.0, -0.0, 1e-300, 1e300, np.inf, -np.inf, np.nan, -1.0])
    for _ in range(400):
        starts = 10.0 ** rng.uniform(-2, 6, rng.integers(0, 4))
        if starts.size and rng.random() < 0.4:
            starts[0] = rng.choice(special)
        parameters = np.array([[rng.integers(0, 8), rng.integers(0, 3), rng.integers(0, 9)]], dtype=float)
        ends = np.sort(10.0 ** rng.uniform(1, 5, 2))
        try:
            found, slopes = own.complex_frequencies(starts, parameters[: rng.integers(0, 2)])
            assert found.shape == starts.shape
            assert slopes.shape[0] == starts.size
        except (ValueError, ReceptanceError):
            pass
        try:
            found, missed = own.poles(starts + 1j * rng.normal(), (ends[0], ends[1]), (-0.5, rng.uniform(0.1, 1.5)))
            assert missed >= 0
            assert np.isfinite(found).all()
        except (ValueError, ReceptanceError):
            pass


def test_damping_ratios_belong_to_modes() -> None:
    tied = model().tied(np.array([[0.0, 0.0, 2.0, 0.0, 1.0]]), np.array([0.1]), np.array([[0.0, 1, -1, 0, 0, 0]]))
    problem = _core.Problem(np.zeros(1, dtype=bool), np.array([[0.05], [0.2]]), np.zeros((0, 3)), 1)
    one = np.ones(1)
    for ratio, weights in ((one, None), (None, one), (np.ones(2), np.ones(2)), (0.1 * one, np.inf * one)):
        with pytest.raises(ValueError, match="damping"):
            problem.add_frequencies(tied, np.zeros(1), 1e3 * one, one, ratio, weights)
    problem.add_frequencies(tied, np.zeros(1), 1e3 * one, one, 0.01 * one, one)
    assert np.isfinite(problem.normal_matrix(np.array([0.1]))).all()
    problem.add_linear(np.array([[2.0], [3.0]]), np.array([0.2]))
    residual, jacobian = problem.rows(np.array([0.1]), np.ones(1, dtype=bool))
    assert residual[2:] == pytest.approx([-0.2, -0.3])
    assert jacobian[2:, 0].tolist() == [2.0, 3.0]
    assert problem.reason(np.array([0.1])) is None
    number, text = problem.reason(np.array([-0.1]))
    assert number == 0
    assert "length" in text
    with pytest.raises(ValueError, match="centre"):
        problem.add_linear(np.array([[2.0], [3.0]]), np.zeros(2))
    with pytest.raises(ValueError, match="matrix"):
        problem.add_linear(np.ones((1, 2)), np.zeros(1))
