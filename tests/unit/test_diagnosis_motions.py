"""Every cause and alternative on every kind of structure: its variants can be evaluated, or it is undecidable."""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import replace

import numpy as np
import pytest

from receptance import (
    CARBIDE,
    STEEL,
    Assembly,
    ColletJoint,
    Coordinate,
    GroundSpring,
    MicroslipJoint,
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
from receptance.diagnosis import CATALOGUE, Cause, Model, Parameter, UndecidableError, Variant, diagnose
from receptance.diagnosis.catalogue import ALTERNATIVES
from receptance.diagnosis.causes import transfer
from receptance.model.addresses import MotionError, check_motion
from variant_of_cause import variant_of

CAUSES = (*CATALOGUE.values(), *ALTERNATIVES)
LINES = np.linspace(150.0, 5000.0, 60)
TERMS = {"k_y": 6e8, "k_theta": 1e5, "c_y": 300.0, "c_theta": 1.0}
SHANK, SLEEVE = (
    Section(outer_diameter=0.012, material=CARBIDE),
    Section(outer_diameter=0.04, inner_diameter=0.012, material=STEEL),
)
HALF = PointJoint(**{name: 2.0 * value for name, value in TERMS.items()})
JOINTS = {
    "point joint": PointJoint(**TERMS, name="joint"),
    "axial spring": PointJoint(k_y=6e8, c_y=300.0, name="joint"),
    "collet": ColletJoint(inner=HALF, outer=HALF, mass=0.02, inertia=1e-6, name="joint"),
    "spread joint": SpreadJoint(length=0.02, shank=SHANK, sleeve=SLEEVE, **TERMS, name="joint"),
    "micro-slip": MicroslipJoint(**TERMS, slip_y=1e-6, slip_theta=1e-5, name="joint"),
    "no joint": None,
}
OF_MOTION = {
    "bending": ("point joint", "collet", "spread joint", "micro-slip", "no joint"),
    "axial": ("point joint", "axial spring", "no joint"),
    "torsion": ("no joint",),
}
POINTS = {
    "nothing": (),
    "ground springs": (
        GroundSpring(k_y=1e7, k_theta=1e3, c_y=10.0, part="holder", position=0.03, name="first"),
        GroundSpring(k_y=1e7, k_theta=1e3, c_y=10.0, part="holder", position="end", name="last"),
    ),
    "a spring along the holder": (
        GroundSpring(k_y=1e8, part="holder", position=0.02, length=0.06, points=6, name="first"),
    ),
    "a mass": (PointMass(mass=0.01, inertia=1e-6, part="tool", position=0.0, name="screw"),),
    "a resonator": (Resonator(mass=0.05, k_y=1e6, c_y=5.0, part="holder", position="end", name="nut"),),
}
CASES = [
    (motion, joint, points, data)
    for motion, joints in OF_MOTION.items()
    for joint in joints
    for points in (POINTS if motion != "torsion" else ("nothing",))
    for data in ("FRFs", "natural frequencies")
]


def make_assembly(motion: str, joint: str, points: str, overhang: float) -> Assembly:
    tool = Part([Segment(length=overhang, outer_diameter=0.012, material=CARBIDE)], name="tool")
    holder = Part([Segment(length=0.11, outer_diameter=0.04, material=STEEL)], name="holder")
    element = JOINTS[joint]
    chain = (tool, holder) if element is None else (tool, element, holder)
    return Assembly(chain, POINTS[points], motion=motion)  # type: ignore[arg-type]


def observe(assembly: Assembly, data: str, label: str, force: float) -> Iterator[Observation]:
    more = {"label": label, "conditions": {"force": force, "plane": force / 10.0}}
    if data == "natural frequencies":
        modes = assembly.natural_frequencies(60e3)[:4]
        yield Observation.from_modes(assembly=assembly, frequency_hz=modes, standard_deviation_hz=1e-3 * modes, **more)
        return
    tip, middle = Coordinate("tool", 0.0), Coordinate("tool", 0.02)
    for response, excitation in ((tip, tip), (middle, tip), (tip, middle)):
        yield Observation(
            assembly=assembly,
            frequency_hz=LINES,
            receptance=assembly.receptance(LINES, response=response, excitation=excitation),
            response=response,
            excitation=excitation,
            standard_deviation=0.01,
            **(more | {"label": f"{label} {response.position:g} {excitation.position:g}", "configuration": label}),
        )


def make_model(motion: str, joint: str, points: str, data: str) -> Model:
    observations = [
        one
        for overhang, force in ((0.05, 10.0), (0.08, 20.0))
        for one in observe(make_assembly(motion, joint, points, overhang), data, f"{overhang:g} m", force)
    ]
    assembly = observations[0].assembly
    addresses = ["joint.k_y", "joint.k_theta", "joint.c_y", "joint.inner.k_y", "first.k_y", "last.k_y"]
    known = [address for address in addresses if address in assembly.parameters and assembly.get(address)]
    starts = {address: assembly.get(address) for address in known or ["tool.segment[0].loss_factor"]}
    unknowns = [
        Unknown(address=address, lower=1e-3 * (start or 1.0), upper=1e3 * (start or 1.0), start=start or 1e-2)
        for address, start in starts.items()
    ]
    return Model(tuple(observations), tuple(unknowns)).with_shared_assemblies().with_witnesses()


def check(causes: tuple[Cause, ...], model: Model) -> dict[str, str]:
    """Evaluate every variant that a model has; return the reasons of undecidable causes."""
    undecidable = {}
    for cause in causes:
        try:
            extensions = cause.extensions(model)
        except UndecidableError as error:
            undecidable[cause.id] = str(error)
            continue
        assert extensions
        assert len({variant for variant, _ in extensions}) == len(extensions), cause.id
        for variant, extended in extensions:
            problem = extended.problem
            start = problem.variables.start
            residual = problem.residual(start)
            assert np.isfinite(residual).all(), (*variant.id, problem.reason(start))
    return undecidable


@pytest.mark.parametrize(("motion", "joint", "points", "data"), CASES)
def test_every_cause_can_be_evaluated_or_is_undecidable(motion: str, joint: str, points: str, data: str) -> None:
    undecidable = check(CAUSES, make_model(motion, joint, points, data))
    assert all(undecidable.values())
    if motion == "axial" and joint != "no joint":
        assert undecidable["joint_spread"] == "a SpreadJoint has no axial motion"
    if motion == "torsion":
        for id in ("sensor_mass", "suspension", "mass_somewhere", "body_on_the_tip"):
            assert undecidable[id] == "attachments have no torsion motion"


def with_rigid_holder(assembly: Assembly) -> Assembly:
    return assembly.replace({"holder.segment[0].youngs_modulus": 1e15})


def with_stepped_tool(assembly: Assembly) -> Assembly:
    tool, *rest = assembly.elements.values()
    (segment,) = tool.segments
    pieces = [replace(segment, length=length) for length in (0.03, segment.length - 0.03)]
    return Assembly([Part(pieces, name="tool"), *rest], assembly.attachments.values(), motion=assembly.motion)


def in_spindle(assembly: Assembly) -> Assembly:
    modes = (Mode(frequency_hz=900.0, damping_ratio=0.04, y=0.25, theta=1.1),)
    return Assembly([*assembly.elements.values(), ModalPart(modes=modes, residual_y=2e-9, name="spindle")])


def with_holder_as_data(assembly: Assembly) -> Assembly:
    tool, joint, *_, spindle = in_spindle(assembly).elements.values()
    return Assembly([tool, joint, spindle])


SIMPLE = ("bending", "point joint", "nothing", "FRFs")
MODELS = {
    "with a joint": make_model(*SIMPLE),
    "natural frequencies": make_model(*SIMPLE[:3], "natural frequencies"),
    "one configuration": make_model(*SIMPLE).select(make_model(*SIMPLE).of(["0.05 m"])),
    "rigid": make_model(*SIMPLE).rebuild(with_rigid_holder),
    "stepped": make_model(*SIMPLE).rebuild(with_stepped_tool),
    "spindle": make_model(*SIMPLE).rebuild(in_spindle),
    "holder as data": make_model(*SIMPLE).rebuild(with_holder_as_data),
    "on springs": make_model("bending", "no joint", "ground springs", "FRFs"),
    "along its holder": make_model("axial", "point joint", "a spring along the holder", "FRFs"),
    "collet": make_model("bending", "collet", "a mass", "FRFs"),
    "spread joint": make_model("bending", "spread joint", "nothing", "FRFs"),
    "torsion": make_model("torsion", "no joint", "nothing", "natural frequencies"),
}


@pytest.mark.parametrize("name", ["rigid", "stepped", "spindle", "holder as data"])
def test_every_cause_on_other_structures(name: str) -> None:
    undecidable = check(CAUSES, MODELS[name])
    assert ("flexible_body" in undecidable) == (name != "rigid")
    assert ("spindle_mode" in undecidable) == (name not in ("spindle", "holder as data"))
    assert ("suspension" in undecidable) == (name in ("spindle", "holder as data"))


@pytest.mark.parametrize("name", MODELS)
def test_a_variant_of_another_model_acts_or_is_undecidable(name: str) -> None:
    """As held-out measurements and reduced sets of causes need it."""
    for cause in CAUSES:
        try:
            first, *others = cause.variants(MODELS[name])
        except UndecidableError:
            continue
        for variant in (first, *others[-2:]):
            for model in MODELS.values():
                with contextlib.suppress(UndecidableError):
                    assert transfer(model, [variant]).unknowns == model.unknowns
                with contextlib.suppress(UndecidableError):
                    assert len(variant.apply(model).unknowns) >= len(model.unknowns)


def test_springs_at_points_and_along_a_part_are_each_changed_where_they_are() -> None:
    """A taper that is pushed along its axis and across it: two assemblies of one diagnosis."""
    along = make_model("axial", "no joint", "a spring along the holder", "FRFs")
    points = make_model("bending", "no joint", "ground springs", "FRFs")
    renamed = points.rebuild(with_other_names)
    ends = [replace(one, address=one.address.replace("first", "big"), name="") for one in points.unknowns]
    both = Model((*along.observations, *renamed.observations), (*along.unknowns, *ends))
    variant = variant_of(both, "contact_distribution", "not at points, more at one end")
    for part, names in ((along, {"first"}), (renamed, {"big", "last"})):
        single = replace(both, observations=part.observations[:1])
        (changed,) = transfer(single, [variant]).observations
        pieces = {name.removeprefix("cause_").rpartition("_")[0] for name in changed.assembly.attachments}
        assert pieces - {""} == names


def with_other_names(assembly: Assembly) -> Assembly:
    first, last = assembly.attachments.values()
    return Assembly(assembly.elements.values(), [replace(first, name="big"), last])


def test_a_mass_of_the_collet_has_no_axial_spring_between_it_and_the_tool() -> None:
    model = make_model("axial", "axial spring", "nothing", "FRFs")
    extensions = CATALOGUE["collet_mass"].extensions(model)
    assert [variant.name for variant, _ in extensions] == ["on the tool", "on the holder"]


def test_diagnosis_of_an_axial_chain() -> None:
    """Blocks on springs that move along their axis: no cause ends the diagnosis."""
    block = replace(STEEL, youngs_modulus=1e15)
    blocks = [Part([Segment(length=0.02, outer_diameter=0.03, material=block)], name=f"m{i}") for i in range(3)]
    springs = [PointJoint(k_y=9e3, k_theta=1e5, name=f"s{i}") for i in range(2)]
    ground = GroundSpring(k_y=9e3, part="m2", position="end", name="ground")
    chain = Assembly([blocks[0], springs[0], blocks[1], springs[1], blocks[2]], [ground], motion="axial")
    modes = chain.natural_frequencies(1e3)[:3]
    data = Observation.from_modes(assembly=chain, frequency_hz=modes, standard_deviation_hz=3e-3 * modes, label="chain")
    also = {"s0.k_y": 1.0, "s1.k_y": 1.0}
    stiffness = Unknown(address="ground.k_y", lower=1e3, upper=1e5, also=also)
    verdict = diagnose([data], [stiffness], fast=True, max_causes=1)
    assert verdict.verdict in ("adequate", "undecided")
    assert verdict.undecidable["joint_spread"]


def test_a_cause_of_a_user_with_elements_that_the_motion_does_not_have_is_undecidable() -> None:
    absorber = Resonator(mass=1e-6, k_y=2e5, part="tool", position=0.0, name="absorber")

    def change(p: dict[str, Parameter], model: Model) -> Iterator[Variant]:
        yield Variant("on the tip", lambda model: model.attach(absorber))

    cause = Cause(id="absorber", group="structure", parameters=(), change=change, meaning="", remedy="")
    assert len(cause.extensions(make_model("axial", "no joint", "nothing", "FRFs"))) == 1
    with pytest.raises(UndecidableError, match=r"^attachments have no torsion motion$"):
        cause.extensions(make_model("torsion", "no joint", "nothing", "FRFs"))


def test_elements_without_a_motion() -> None:
    check_motion(ColletJoint, "bending", "joint")
    with pytest.raises(MotionError, match="joint is a ColletJoint, which has no axial motion") as raised:
        check_motion(ColletJoint, "axial", "joint")
    assert raised.value.reason == "a ColletJoint has no axial motion"
