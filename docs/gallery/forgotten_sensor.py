"""A diagnosis of three simulated measurements with a sensor that the model does not have."""

import numpy as np

from receptance import (
    CARBIDE,
    STEEL,
    Assembly,
    Coordinate,
    Observation,
    Part,
    PointJoint,
    PointMass,
    Segment,
    Unknown,
    identify,
)
from receptance.diagnosis import diagnose
from receptance.fit import Tolerance

lines = np.linspace(200.0, 6000.0, 400)
tip = Coordinate("tool", 0.0)
rng = np.random.default_rng(4)
truth = PointJoint(k_y=6e8, k_theta=1e5, c_y=300.0, c_theta=1.0, name="joint")


def assembled(overhang, *attached):
    tool = Part([Segment(length=overhang, outer_diameter=0.012, material=CARBIDE)], name="tool")
    holder = Part([Segment(length=0.13, outer_diameter=0.045, material=STEEL)], name="holder")
    return Assembly([tool, truth, holder], attached)


def measured(overhang):
    values = assembled(overhang, PointMass(mass=1e-3)).receptance(lines, response=tip, excitation=tip)
    noise = 0.01 * (rng.normal(size=lines.size) + 1j * rng.normal(size=lines.size))
    return Observation(
        assembly=assembled(overhang),
        frequency_hz=lines,
        receptance=values * np.exp(noise),
        standard_deviation=0.01,
        label=f"{1e3 * overhang:.0f} mm",
    )


observations = [measured(overhang) for overhang in (0.05, 0.07, 0.09)]
joint = [
    Unknown(address="joint.k_y", lower=1e6, upper=1e11),
    Unknown(address="joint.k_theta", lower=1e2, upper=1e8),
    Unknown(address="joint.c_y", lower=1e-1, upper=1e6),
    Unknown(address="joint.c_theta", lower=1e-4, upper=1e3),
]
tolerances = [
    Tolerance(name="carbide E", moves={"tool.segment[*].youngs_modulus": 0.005}, relative=True),
    Tolerance(name="carbide density", moves={"tool.segment[*].density": 0.003}, relative=True),
]
alone = identify(observations[1], joint, strategy="staged", starts=2)
ratios = [alone.values[f"joint.{name}"] / getattr(truth, name) for name in ("k_y", "k_theta")]
print(f"the fit to 70 mm alone: k_y {ratios[0]:.2f} and k_theta {ratios[1]:.2f} of the true values")
tried = ["sensor_mass", "hammer_offset", "overhang_error", "tool_density", "calibration_gain"]
verdict = diagnose(observations, joint, tolerances=tolerances, causes=tried, max_causes=1)
print(verdict.verdict, [cause.id for cause in verdict.causes])
mass, low, high = verdict.causes[0].parameters["sensor_mass.mass"]
print(f"mass {1e3 * mass:.2f} g, 95 % interval {1e3 * low:.2f} to {1e3 * high:.2f} g; in fact 1 g")
figure = verdict.plot()
