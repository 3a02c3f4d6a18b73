"""Diagnoses of parts with cones: a divided cone is the same cone, and a thicker cone is thicker at both ends."""

from __future__ import annotations

import numpy as np
import pytest

from receptance import STEEL, Assembly, Observation, Part, PointJoint, Segment, Unknown
from receptance.coupling import body_of
from receptance.diagnosis import CATALOGUE
from receptance.diagnosis.changes import moved_step
from receptance.diagnosis.model import IndescribableError, Model, UndecidableError, of_thickness
from receptance.fit import Move, Tolerance

LINES = np.linspace(300.0, 9000.0, 150)
JOINT = (
    Unknown(address="joint.k_y", lower=1e7, upper=1e10, start=5e8),
    Unknown(address="joint.k_theta", lower=1e3, upper=1e7, start=1e5),
)
LENGTH, NEAR, FAR, BORE, FAR_BORE = (
    "length",
    "outer_diameter",
    "end_outer_diameter",
    "inner_diameter",
    "end_inner_diameter",
)
ABSOLUTE = {LENGTH: 1e-4, NEAR: 2e-5, FAR: 3e-5, BORE: 4e-5, FAR_BORE: 1e-5}


def make_assembly(nose: Segment | None = None) -> Assembly:
    tool = Part([Segment(length=0.06, outer_diameter=0.014, end_outer_diameter=0.018, material=STEEL)], name="tool")
    cone = Segment(
        length=0.07, outer_diameter=0.03, end_outer_diameter=0.05, inner_diameter=0.01, end_inner_diameter=0.02,
        material=STEEL,
    )  # fmt: skip
    body = Segment(length=0.05, outer_diameter=0.05, material=STEEL)
    joint = PointJoint(k_y=5e8, k_theta=1e5, c_y=200.0, c_theta=0.2, name="joint")
    return Assembly([tool, joint, Part([nose or cone, body], name="holder")])


def make_model(*unknowns: Unknown, tolerances: tuple[Tolerance, ...] = (), nose: Segment | None = None) -> Model:
    rng = np.random.default_rng(11)
    assembly = make_assembly(nose)
    noise = 0.01 * (rng.normal(size=LINES.size) + 1j * rng.normal(size=LINES.size))
    values = assembly.receptance(LINES) * np.exp(noise)
    data = Observation(assembly=assembly, frequency_hz=LINES, receptance=values, standard_deviation=0.01)
    return Model((data,), (*JOINT, *unknowns), tolerances)


def of_cone(relative: bool) -> tuple[Tolerance, ...]:
    sizes = dict.fromkeys((NEAR, FAR, BORE, FAR_BORE), 1e-3) if relative else ABSOLUTE
    return tuple(
        Tolerance(name=field, moves={f"holder.segment[0].{field}": size}, relative=relative)
        for field, size in sizes.items()
    )


@pytest.mark.parametrize("relative", [False, True])
@pytest.mark.parametrize("position", [0.01, 0.035, 0.0655])
def test_the_fit_does_not_change_where_a_cone_is_divided(position: float, relative: bool) -> None:
    whole = make_model(tolerances=of_cone(relative))
    divided, index = whole.split("holder", position)
    assert index == 1
    first, second, _ = divided.parts("holder")[0].segments
    assert first.ends[1] == pytest.approx(second.ends[0], rel=1e-14)
    x = whole.task.variables.from_values(np.array([4e8, 1.2e5, *np.zeros(len(whole.tolerances))]))
    before, after = whole.problem.residual(x), divided.problem.residual(x)
    assert after == pytest.approx(before, rel=1e-9, abs=1e-9 * np.abs(before).max())
    slopes, moved = whole.problem.jacobian(x), divided.problem.jacobian(x)
    for column, (a, b) in enumerate(zip(slopes.T, moved.T, strict=True)):
        assert b == pytest.approx(a, rel=0.0, abs=1e-8 * np.abs(a).max()), column


def test_a_cone_is_divided_again() -> None:
    whole = make_model(tolerances=of_cone(False))
    divided = whole
    for position in (0.01, 0.03, 0.06):
        divided, _ = divided.split("holder", position)
    x = whole.task.variables.from_values(np.array([4e8, 1.2e5, *np.zeros(len(whole.tolerances))]))
    slopes, moved = whole.problem.jacobian(x), divided.problem.jacobian(x)
    assert moved == pytest.approx(slopes, rel=0.0, abs=1e-8 * np.abs(slopes).max())
    assert divided.observations[0].assembly.natural_frequencies(15e3) == pytest.approx(
        whole.observations[0].assembly.natural_frequencies(15e3), rel=1e-9
    )


def test_an_unknown_diameter_of_a_cone_cannot_be_divided() -> None:
    address = f"holder.segment[0].{FAR}"
    model = make_model(Unknown(address=address, lower=0.04, upper=0.06))
    with pytest.raises(IndescribableError, match="is of a cone that is to be divided"):
        model.split("holder", 0.03)


def test_a_thicker_cone_has_both_ends_thicker_by_one_factor() -> None:
    model = make_model()
    moves = of_thickness(model, "holder.segment[0]")
    assert moves == {f"holder.segment[0].{NEAR}": 1.0, f"holder.segment[0].{FAR}": 1.0}
    assert of_thickness(model, "holder.segment[1]") == {f"holder.segment[1].{NEAR}": 1.0}
    (moved,) = (
        unknown
        for unknown in CATALOGUE["tip_diameter"].extensions(model)[0][0].apply(model).unknowns
        if isinstance(unknown, Move) and unknown.relative
    )
    assert dict(moved.moves) == {f"tool.segment[0].{NEAR}": 1.0, f"tool.segment[0].{FAR}": 1.0}


def test_a_step_of_a_divided_cone_moves_nothing_else() -> None:
    divided, _ = make_model().split("holder", 0.03)
    assert moved_step(divided, "holder", 0.03) == {
        "holder.segment[0].length": 1.0,
        "holder.segment[1].length": -1.0,
    }


def test_a_joint_along_a_conical_mouth_is_declined_with_its_reason() -> None:
    with pytest.raises(UndecidableError, match=r"first segment of holder is a cone.*describe the mouth"):
        CATALOGUE["joint_spread"].extensions(make_model())


def test_the_shank_of_a_conical_tool_has_the_diameter_of_its_end() -> None:
    nose = Segment(length=0.07, outer_diameter=0.05, material=STEEL)
    model = make_model(nose=nose, tolerances=(Tolerance(name="end", moves={f"tool.segment[0].{FAR}": 1e-5}),))
    spread = CATALOGUE["joint_spread"].extensions(model)[0][0].apply(model)
    joint = spread.observations[0].assembly.elements["joint"]
    assert joint.shank.outer_diameter == 0.018
    assert dict(spread.tolerances[0].moves) == {f"tool.segment[0].{FAR}": 1e-5, "joint.shank.outer_diameter": 1e-5}


def test_a_rigid_cone_has_the_inertia_of_thin_cylinders() -> None:
    part = make_assembly().parts["holder"]
    body = body_of(part)
    count = 400
    slices = [s.between(i / count, (i + 1) / count) for s in part.segments for i in range(count)]
    thin = [
        Segment(length=s.length, outer_diameter=s.at(0.5)[0], inner_diameter=s.at(0.5)[1], material=STEEL)
        for s in slices
    ]
    fine = body_of(Part(thin))
    # The error of the middles is of the second order in the length of a slice.
    for name in ("mass", "inertia", "centre"):
        assert getattr(body, name) == pytest.approx(getattr(fine, name), rel=1.0 / count**2), name
    assert body.mass == pytest.approx(part.mass, rel=1e-14)
    # A cone of base d and height h, from the tip: centre 3 h / 4, inertia m (3 r^2 / 20 + 3 h^2 / 80).
    h, d = 0.08, 0.05
    cone = body_of(Part([Segment(length=h, outer_diameter=1e-12, end_outer_diameter=d, material=STEEL)]))
    assert cone.centre == pytest.approx(0.75 * h)
    assert cone.inertia == pytest.approx(cone.mass * (3.0 * (0.5 * d) ** 2 / 20.0 + 3.0 * h**2 / 80.0))
