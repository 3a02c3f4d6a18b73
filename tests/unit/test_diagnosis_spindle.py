"""A mode of the spindle that has moved is named, and not the joint."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from receptance import CARBIDE, STEEL, Assembly, ModalPart, Mode, Observation, Part, PointJoint, Segment, Unknown
from receptance.diagnosis import diagnose
from receptance.fit import Tolerance

SPINDLE = ModalPart(
    modes=[
        Mode(frequency_hz=900.0, damping_ratio=0.04, y=0.25, theta=1.1),
        Mode(frequency_hz=2300.0, damping_ratio=0.03, y=0.4, theta=-5.0),
    ],
    residual_y=2e-9,
    residual_theta=4e-7,
    name="spindle",
)
LINES = np.arange(300.0, 4000.0, 20.0)
JOINT = [
    Unknown(address="joint.k_y", lower=1e7, upper=1e10),
    Unknown(address="joint.k_theta", lower=1e3, upper=1e7),
    Unknown(address="joint.loss_factor", lower=1e-3, upper=0.3),
]


def machine(overhang: float, spindle: ModalPart) -> Assembly:
    tool = Part([Segment(length=overhang, outer_diameter=0.0127, material=CARBIDE)], name="tool")
    holder = Part([Segment(length=0.08, outer_diameter=0.05, material=STEEL)], name="holder")
    return Assembly([tool, PointJoint(k_y=6.3e8, k_theta=1e5, loss_factor=0.02, name="joint"), holder, spindle])


def test_a_mode_that_moved_is_named() -> None:
    rng = np.random.default_rng(8)
    described = SPINDLE.with_values({"mode[1].frequency_hz": 2300.0 * 0.98})
    observed = []
    for overhang in (0.0623, 0.09):
        noise = 0.02 * (rng.normal(size=LINES.size) + 1j * rng.normal(size=LINES.size))
        observed.append(
            Observation(
                assembly=machine(overhang, described),
                frequency_hz=LINES,
                receptance=machine(overhang, SPINDLE).receptance(LINES) * np.exp(noise),
                standard_deviation=0.02,
                label=f"{overhang:g} m",
            )
        )
    tolerances = [Tolerance(name="carbide", moves={"tool.segment[0].youngs_modulus": 0.01}, relative=True)]
    causes = ["spindle_mode", "joint_cross_term", "tool_density", "calibration_gain", "missing_mode"]
    verdict = diagnose(observed, JOINT, tolerances=tolerances, causes=causes, most=1)
    assert verdict.verdict == "named"
    (cause,) = verdict.causes
    assert (cause.id, cause.variant) == ("spindle_mode", "mode at 2254 Hz")
    assert cause.parameters["spindle_mode.log_frequency"][0] == pytest.approx(-np.log(0.98), rel=0.1)
    assert "see spindle_mode" in verdict.undecidable["missing_mode"]


def test_model_without_spindle_modes_is_undecidable() -> None:
    tool = Part([Segment(length=0.0623, outer_diameter=0.0127, material=CARBIDE)], name="tool")
    holder = Part([Segment(length=0.08, outer_diameter=0.05, material=STEEL)], name="holder")
    free = Assembly([tool, replace(PointJoint(k_y=6.3e8, k_theta=1e5, loss_factor=0.02), name="joint"), holder])
    data = Observation(
        assembly=free, frequency_hz=LINES, receptance=free.receptance(LINES) * 1.3, standard_deviation=0.02
    )
    verdict = diagnose(data, JOINT, causes=["spindle_mode", "calibration_gain"], most=1)
    assert "does not end with a spindle" in verdict.undecidable["spindle_mode"]
