"""A mode of the spindle that has moved is named, and not the joint."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from receptance import CARBIDE, STEEL, Assembly, ModalPart, Mode, Observation, Part, PointJoint, Segment, Unknown
from receptance.diagnosis import CATALOGUE, Model, diagnose
from receptance.diagnosis.advice import advise, menu_of
from receptance.diagnosis.explanation import Explanation, Selection
from receptance.diagnosis.fitting import refit
from receptance.diagnosis.judgement import Judgement
from receptance.diagnosis.model import UndecidableError
from receptance.fit import Tolerance
from receptance.fit.observation import altered
from receptance.model.anatomy import anatomy_of
from receptance.predict import Menu

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
TOLERANCES = (Tolerance(name="carbide", moves={"tool.segment[0].youngs_modulus": 0.01}, relative=True),)
JOINT = [
    Unknown(address="joint.k_y", lower=1e7, upper=1e10),
    Unknown(address="joint.k_theta", lower=1e3, upper=1e7),
    Unknown(address="joint.loss_factor", lower=1e-3, upper=0.3),
]


def machine(overhang: float, *spindle: ModalPart) -> Assembly:
    tool = Part([Segment(length=overhang, outer_diameter=0.0127, material=CARBIDE)], name="tool")
    holder = Part([Segment(length=0.08, outer_diameter=0.05, material=STEEL)], name="holder")
    return Assembly([tool, PointJoint(k_y=6.3e8, k_theta=1e5, loss_factor=0.02, name="joint"), holder, *spindle])


def measured(described: Sequence[ModalPart], true: Sequence[ModalPart]) -> Model:
    """Return a model of two overhangs, with 2 % of noise."""
    rng = np.random.default_rng(8)
    observed = []
    for overhang in (0.0623, 0.09):
        noise = 0.02 * (rng.normal(size=LINES.size) + 1j * rng.normal(size=LINES.size))
        observed.append(
            Observation(
                assembly=machine(overhang, *described),
                frequency_hz=LINES,
                receptance=machine(overhang, *true).receptance(LINES) * np.exp(noise),
                standard_deviation=0.02,
                label=f"{overhang:g} m",
            )
        )
    return Model(tuple(observed), tuple(JOINT), TOLERANCES)


def suspected(model: Model, *names: str) -> tuple[Selection, list[Explanation]]:
    """Return fitted explanations by the first variant of causes, and the selection that has them."""
    base = refit(model, {})
    selection = Selection(base, 7.0, 0.0, [], {})
    for name in names:
        fits = [(refit(extended, {}), variant) for variant, extended in CATALOGUE[name].extensions(model)]
        fit, variant = min(fits, key=lambda one: one[0].chi_square)
        selection.add(Explanation((variant,), fit, 100.0, 90.0))
    return selection, list(selection.singles)


def test_a_mode_that_moved_is_named() -> None:
    model = measured([SPINDLE.with_values({"mode[1].frequency_hz": 2300.0 * 0.98})], [SPINDLE])
    causes = ["spindle_mode", "joint_cross_term", "tool_density", "calibration_gain", "missing_mode"]
    verdict = diagnose(model.observations, JOINT, tolerances=TOLERANCES, causes=causes, max_causes=1)
    assert verdict.verdict == "named"
    (cause,) = verdict.causes
    assert (cause.id, cause.variant) == ("spindle_mode", "mode at 2254 Hz")
    assert cause.parameters["spindle_mode.log_frequency"][0] == pytest.approx(-np.log(0.98), rel=0.1)
    assert "see spindle_mode" in verdict.undecidable["missing_mode"]
    assert cause.remedy.startswith("hit the blank again in the warm spindle")


def test_a_changed_mode_is_settled_by_the_blank_in_the_warm_spindle() -> None:
    """The holder alone is not measured, although that would settle the stiffness of the holder."""
    model = measured([SPINDLE.with_values({"mode[1].frequency_hz": 2300.0 * 0.98})], [SPINDLE])
    for other in ("holder_modulus", "joint_cross_term"):
        selection, pair = suspected(model, "spindle_mode", other)
        found = advise(selection, Judgement("ambiguous", tuple(pair), ("spindle_mode", other), ()))
        assert found is not None
        assert found.action == "hit the gauge blank again in the warm spindle", other
        assert found.resolves == 1.0


def test_the_menu_follows_from_the_anatomy() -> None:
    """Of a holder in a spindle, whatever its parts are called, nothing hangs and the holder is not measured alone."""
    held = measured([SPINDLE], [SPINDLE])
    free = measured([], [])
    only_free = {item.action for item in menu_of(free)} - {item.action for item in menu_of(held)}
    only_held = {item.action for item in menu_of(held)} - {item.action for item in menu_of(free)}
    assert only_free == {
        "measure frequency and decay of the swing on the suspension",
        "hang it softer and repeat one measurement",
        "measure the holder alone, free-free",
    }
    assert only_held == {"hit the gauge blank again in the warm spindle"}
    with pytest.raises(UndecidableError, match="the holder is in a spindle, so that nothing hangs"):
        CATALOGUE["suspension"].extensions(held)
    assert CATALOGUE["suspension"].extensions(free)
    names = {"tool": "suspension", "joint": "fit", "holder": "free", "spindle": "rope"}
    renamed = []
    for observation in held.observations:
        elements = [replace(element, name=names[name]) for name, element in observation.assembly.elements.items()]
        renamed.append(altered(observation, assembly=Assembly(elements)))
    unknowns = tuple(replace(one, address=one.address.replace("joint", "fit")) for one in JOINT)
    assert menu_of(Model(tuple(renamed), unknowns, ())) == menu_of(held)
    labels = [candidate.label for candidate in Menu(held.observations, held.unknowns, held.tolerances).candidates()]
    assert "gauge blank in the spindle" in labels
    assert not [label for label in labels if label.startswith("holder alone")]


@pytest.mark.parametrize(
    ("names", "expected"),
    [
        (["tool", "joint", "holder", "spindle"], True),
        (["tool", "spindle"], True),
        (["tool", "joint", "spindle"], False),
        (["tool", "joint", "holder"], False),
    ],
)
def test_what_is_in_a_spindle(names: list[str], expected: bool) -> None:
    """Data right behind the joint may be those of a holder that hangs free."""
    elements = machine(0.07, SPINDLE).elements
    chain = [replace(elements[name], name=name) for name in names]
    assert anatomy_of(Assembly(chain), ["joint.k_y"]).in_spindle is expected


def test_unexplained_data_of_a_machine_are_settled_in_the_spindle() -> None:
    for spindle, words in (
        ([SPINDLE], "hit the gauge blank again in the warm spindle"),
        ([], "blank and holder alone"),
    ):
        selection, _ = suspected(measured(spindle, spindle))
        found = advise(selection, Judgement("unexplained", (), (), ()))
        assert found is not None
        assert words in found.action


def test_the_remedy_of_a_holder_in_a_spindle() -> None:
    soft = measured([SPINDLE], [SPINDLE]).rebuild(
        lambda assembly: assembly.replace({"holder.segment[0].youngs_modulus": 0.75 * STEEL.youngs_modulus})
    )
    verdict = diagnose(
        soft.observations, JOINT, tolerances=TOLERANCES, causes=["holder_modulus", "tool_density"], max_causes=1
    )
    (finding,) = [one for one in verdict.candidates if one.id == "holder_modulus"]
    assert "gauge blank in the same spindle" in finding.remedy
    assert CATALOGUE["holder_modulus"].remedy == "measure the holder alone, free-free"


def test_model_without_spindle_modes_is_undecidable() -> None:
    tool = Part([Segment(length=0.0623, outer_diameter=0.0127, material=CARBIDE)], name="tool")
    holder = Part([Segment(length=0.08, outer_diameter=0.05, material=STEEL)], name="holder")
    free = Assembly([tool, replace(PointJoint(k_y=6.3e8, k_theta=1e5, loss_factor=0.02), name="joint"), holder])
    data = Observation(
        assembly=free, frequency_hz=LINES, receptance=free.receptance(LINES) * 1.3, standard_deviation=0.02
    )
    verdict = diagnose(data, JOINT, causes=["spindle_mode", "calibration_gain"], max_causes=1)
    assert "does not end with a spindle" in verdict.undecidable["spindle_mode"]
