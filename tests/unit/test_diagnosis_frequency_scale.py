"""A wrong frequency axis: the cause against an independent formula, and diagnoses with tolerances."""

from __future__ import annotations

import numpy as np
import pytest

from receptance import (
    CARBIDE,
    STEEL,
    Assembly,
    Coordinate,
    GroundSpring,
    MeasuredPart,
    ModalPart,
    Mode,
    Observation,
    Part,
    PointJoint,
    PointMass,
    Resonator,
    Section,
    Segment,
    SpreadJoint,
    Unknown,
)
from receptance.diagnosis import CATALOGUE, Model, UndecidableError, Verdict, diagnose
from receptance.fit import Tolerance

LINES = np.linspace(200.0, 9000.0, 300)
OVERHANGS = (0.05, 0.07, 0.09)
SCALE = "frequency_scale.log_scale"
JOINT = [
    Unknown(address="joint.k_y", lower=1e6, upper=1e11, start=6e8),
    Unknown(address="joint.k_theta", lower=1e2, upper=1e8, start=1e5),
    Unknown(address="joint.c_y", lower=1e-1, upper=1e6, start=300.0),
    Unknown(address="joint.c_theta", lower=1e-4, upper=1e3, start=1.0),
]
TIP, NOSE = Coordinate("tool", 0.0), Coordinate("holder", 0.0)


def assembled(overhang: float) -> Assembly:
    tool = Part([Segment(length=overhang, outer_diameter=0.012, material=CARBIDE)], name="tool")
    holder = Part([Segment(length=0.13, outer_diameter=0.045, material=STEEL)], name="holder")
    return Assembly([tool, PointJoint(k_y=6e8, k_theta=1e5, c_y=300.0, c_theta=1.0, name="joint"), holder])


def of_all_kinds() -> list[Assembly]:
    """Assemblies with every kind of element that has a mass, a stiffness or a damping."""
    tool = Part([Segment(length=0.08, outer_diameter=0.012, material=CARBIDE)], name="tool")
    holder = Part([Segment(length=0.1, outer_diameter=0.045, material=STEEL)], name="holder")
    shank = Section(outer_diameter=0.012, material=CARBIDE)
    sleeve = Section(outer_diameter=0.045, inner_diameter=0.012, material=STEEL)
    spread = SpreadJoint(
        length=0.03, shank=shank, sleeve=sleeve, k_y=3e8, k_theta=2e4, c_y=200.0, loss_factor=0.02, name="joint"
    )
    points = [
        PointMass(mass=2e-3, inertia=1e-7, part="tool", position=0.0),
        GroundSpring(k_y=3e6, k_theta=1e3, c_y=30.0, c_theta=0.1, part="holder", position="end"),
        Resonator(mass=4e-3, k_y=5e5, c_y=5.0, part="tool", position=0.0),
    ]
    joint = PointJoint(k_y=6e8, k_theta=1e5, k_ytheta=1e6, c_y=300.0, c_theta=1.0, c_ytheta=2.0, name="joint")
    modes = [Mode(frequency_hz=900.0, damping_ratio=0.03, y=0.4, theta=3.0)]
    spindle = ModalPart(modes=modes, residual_y=2e-9, residual_theta=1e-6, name="spindle")
    return [Assembly([tool, joint, holder], points), Assembly([tool, joint, spindle]), Assembly([tool, spread, holder])]


def frf(assembly: Assembly, scale: float = 0.0, order: int = 0, seed: int | None = None, **more: object) -> Observation:
    """The FRF at the true frequencies (1 + scale) f as if it were at f; of the motion differentiated `order` times."""
    place = more.pop("place", TIP)
    true = assembly.receptance((1.0 + scale) * LINES, response=place, excitation=place) * (1.0 + scale) ** order
    if seed is not None:
        real, imaginary = np.random.default_rng(seed).normal(size=(2, LINES.size))
        true = true * np.exp(0.01 * (real + 1j * imaginary))
    return Observation(
        assembly=assembly,
        frequency_hz=LINES,
        receptance=true,
        response=place,
        excitation=place,
        standard_deviation=0.01,
        **more,
    )


@pytest.mark.parametrize("order", [0, 1, 2])
@pytest.mark.parametrize("kind", [0, 1, 2], ids=["beams and points", "modes", "spread joint"])
def test_the_model_is_the_receptance_at_scaled_frequencies(kind: int, order: int) -> None:
    assembly = of_all_kinds()[kind]
    model = Model((frf(assembly, 0.008, order),), tuple(JOINT[:1]) if kind == 0 else ())
    variant = CATALOGUE["frequency_scale"].variants(model)[order]
    assert variant.name == ("in displacements", "in velocities", "in accelerations")[order]
    scaled = variant.apply(model)
    problem, x = scaled.problem, scaled.task.variables.start.copy()
    x[-1] = np.log1p(0.008)
    assert np.abs(problem.residual(x)[: 2 * LINES.size]).max() < 1e-6
    x[-1] = 0.0
    assert np.abs(problem.residual(x)[: 2 * LINES.size]).max() > 1.0


def test_natural_frequencies_are_divided_by_the_scale() -> None:
    assembly = of_all_kinds()[0]
    true = assembly.natural_frequencies(9000.0)
    data = Observation.from_modes(assembly=assembly, frequency_hz=true / 1.008, standard_deviation_hz=1e-3 * true)
    ((_, scaled),) = CATALOGUE["frequency_scale"].extensions(Model((data,), tuple(JOINT[:1])))
    x = scaled.task.variables.start.copy()
    x[-1] = np.log1p(0.008)
    assert np.abs(scaled.problem.residual(x)).max() < 1e-5


def test_a_table_may_have_the_same_error() -> None:
    tool = Part([Segment(length=0.08, outer_diameter=0.012, material=CARBIDE)], name="tool")
    matrix = np.ones((LINES.size, 1, 1)) * np.diag([2e-8, 1e-6])
    assembly = Assembly([tool, MeasuredPart(frequency_hz=LINES, matrix=matrix, name="spindle")])
    with pytest.raises(UndecidableError, match="a table of receptances"):
        CATALOGUE["frequency_scale"].variants(Model((frf(assembly),), ()))


def found(scale: float, order: int, *places: Coordinate, materials: float) -> Verdict:
    tolerances = [
        Tolerance(name=f"{part} {field}", moves={f"{part}.segment[*].{field}": deviation}, relative=True)
        for part in ("tool", "holder")
        for field, deviation in (("youngs_modulus", materials), ("density", 0.003))
    ]
    tolerances += [
        Tolerance(name=f"clamping {x}", moves={"tool.segment[0].length": 1e-4}, configurations=f"{x}")
        for x in OVERHANGS
    ]
    data = [
        frf(assembled(x), scale, order, seed=number, place=place, label=f"{x} {place.part}", configuration=f"{x}")
        for number, (x, place) in enumerate((x, place) for x in OVERHANGS for place in places)
    ]
    causes = ("frequency_scale", "calibration_gain", "tool_density", "tool_modulus", "holder_modulus", "holder_inertia")
    return diagnose(data, JOINT, tolerances=tolerances, causes=causes, max_causes=1)


@pytest.mark.parametrize("order", [0, 2])
def test_an_axis_that_is_off_is_named(order: int) -> None:
    """A density of all parts (displacements) or a modulus of all (accelerations) is the same; tolerances exclude it."""
    verdict = found(0.008, order, TIP, NOSE, materials=0.003)
    assert (verdict.verdict, [one.id for one in verdict.causes]) == ("named", ["frequency_scale"])
    low, high = verdict.causes[0].parameters[SCALE][1:]
    assert 0.0 < low < np.log1p(0.008) < high
    # A cause of the measurement does not act in the machine.
    np.testing.assert_allclose(
        verdict.at(assembled(0.06)).natural_frequencies(6000.0).predicted_hz,
        assembled(0.06).natural_frequencies(6000.0),
        rtol=4e-3,
    )


def test_within_the_tolerances_of_the_moduli_nothing_is_found() -> None:
    assert found(0.008, 2, TIP, materials=0.015).verdict == "adequate"


def test_a_right_axis_is_adequate() -> None:
    assert found(0.0, 0, TIP, NOSE, materials=0.003).verdict == "adequate"
