"""Offsets of the frequency axis and slow changes of level and phase between a structure and its record."""

from __future__ import annotations

import numpy as np
import pytest

import scipy_fits
from receptance import CARBIDE, STEEL, Assembly, Observation, Part, PointJoint, Segment, Unknown, identify
from receptance.errors import ReceptanceError
from receptance.fit.parameters import FREQUENCY_OFFSETS, Parameters
from receptance.fit.problem import Task

LINES = np.linspace(180.0, 6000.0, 300)
AMPLIFIER = {"level_exponent": 0.03, "level_slope": 3e-6, "phase": 0.03, "low_pass": 1e-5, "high_pass": 100.0}
OFFSETS = dict.fromkeys((address.removeprefix("observation.") for address in FREQUENCY_OFFSETS), 2.0)


def make_assembly(overhang: float) -> Assembly:
    tool = Part([Segment(length=overhang, outer_diameter=0.012, material=CARBIDE)], name="tool")
    holder = Part([Segment(length=0.13, outer_diameter=0.045, material=STEEL)], name="holder")
    return Assembly([tool, PointJoint(k_y=6e8, k_theta=1e5, c_y=200.0, c_theta=0.7, name="joint"), holder])


def observation(values: np.ndarray, lines: np.ndarray = LINES, **fields: float) -> Observation:
    return Observation(
        assembly=make_assembly(0.09), frequency_hz=lines, receptance=values, standard_deviation=0.01, **fields
    )


def unknown(name: str, start: float) -> Unknown:
    size = 2.0 * abs(start)
    return Unknown(address=f"observation.{name}", lower=-size, upper=size, start=start, scale="linear")


@pytest.mark.parametrize("lines", [LINES, LINES - 2j])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_residuals_are_those_of_the_formula(lines: np.ndarray, sign: float) -> None:
    for sizes in (AMPLIFIER, *({name: size} for name, size in OFFSETS.items())):
        unknowns = [
            Unknown(address="joint.k_theta", lower=1e2, upper=1e8, start=1e5),
            *(unknown(name, sign * size) for name, size in sizes.items()),
            Unknown(address="observation.decay_rate", lower=0.0, upper=100.0, start=10.0, scale="linear"),
        ]
        seen = observation(make_assembly(0.088).receptance(lines), lines)
        task = Task((seen,), Parameters(unknowns, (), [seen.site(0)]), ("standard deviations",), threads=1)
        problem, x = task.problem(), task.variables.start
        residual, jacobian = scipy_fits.residual_and_jacobian(task, x)
        scale = np.linalg.norm(jacobian, axis=0)
        assert scale.min() > 0.0
        assert problem.residual(x) == pytest.approx(residual, rel=1e-9, abs=1e-8)
        assert problem.jacobian(x) / scale == pytest.approx(jacobian / scale, rel=1e-6, abs=1e-8)


@pytest.mark.parametrize(("address", "power"), FREQUENCY_OFFSETS.items())
def test_offset_of_the_lines_is_found(address: str, power: int) -> None:
    # The record is an acceleration, velocity or displacement on the true lines, integrated on the stated ones.
    true = LINES - 3.0
    values = make_assembly(0.09).receptance(true) * (true / LINES) ** power
    found = identify([observation(values)], [unknown(address.removeprefix("observation."), 5.0)])
    assert found.values[address] == pytest.approx(3.0, rel=1e-6)


def test_offset_of_a_record_that_ends_too_early_is_refused() -> None:
    with pytest.raises(ReceptanceError, match="frequency offset"):
        identify([observation(make_assembly(0.09).receptance(LINES), ends=0.07)], [unknown("frequency_offset", 5.0)])
