"""Causes and explanations as objects: identity of their parameters, variants, and the order of a selection."""

from __future__ import annotations

import threading
from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from blank_in_holder import make_assembly
from limits import LIMIT_S
from receptance import (
    CARBIDE,
    STEEL,
    Assembly,
    ColletJoint,
    Coordinate,
    Observation,
    Part,
    PointJoint,
    Segment,
    Unknown,
)
from receptance.diagnosis import CATALOGUE, Cause, Model, Parameter, UndecidableError, Variant
from receptance.diagnosis.causes import extend, parameters_of, transfer
from receptance.diagnosis.explanation import Explanation, behind_limit
from receptance.diagnosis.fitting import explore, fit_base
from receptance.diagnosis.model import IndescribableError
from receptance.diagnosis.progress import in_parallel
from receptance.diagnosis.thresholds import COLLET_GYRATION
from receptance.fit import Law, Move, Tolerance
from receptance.fit.observation import altered
from variant_of_cause import extended_by, variant_of

LINES = np.linspace(200.0, 6000.0, 120)


def make_observations(overhang: float) -> Observation:
    assembly = make_assembly(overhang)
    return Observation(
        assembly=assembly,
        frequency_hz=LINES,
        receptance=assembly.receptance(LINES),
        standard_deviation=0.01,
        label=f"{1e3 * overhang:.0f} mm",
    )


JOINT = (
    Unknown(address="joint.k_y", lower=1e6, upper=1e11, start=6e8),
    Unknown(address="joint.k_theta", lower=1e2, upper=1e8, start=1e5),
)
MODEL = Model((make_observations(0.05), make_observations(0.08)), JOINT)


def moved_residual(model: Model, cause: str) -> np.ndarray:
    """Residuals of the lines with all variables off their starts, except those of a cause."""
    problem = model.task.problem()
    names = problem.variables.names
    x = problem.variables.start + 0.01 * np.array([not name.startswith(f"{cause}.") for name in names])
    return problem.residual(x)[: 2 * LINES.size * len(model.observations)].copy()


@pytest.mark.parametrize("name", sorted(CATALOGUE))
def test_every_new_unknown_of_a_cause_stands_for_one_of_its_parameters(name: str) -> None:
    try:
        extensions = CATALOGUE[name].extensions(MODEL)
    except UndecidableError:
        return
    declared = {one.key for one in CATALOGUE[name].parameters}
    for _, extended in extensions:
        own = parameters_of(extended.unknowns)
        assert {one.key for one in own.values()} <= declared
        assert {one.cause for one in own.values()} <= {name}
        assert set(own) == {u.name for u in extended.unknowns} - {u.name for u in JOINT}


def test_variants_have_different_names() -> None:
    for cause in CATALOGUE.values():
        try:
            names = [one.name for one in cause.variants(MODEL)]
        except UndecidableError:
            continue
        assert len(set(names)) == len(names), cause.id


def test_a_parameter_keeps_its_declaration_through_other_causes() -> None:
    """Flutes divide the tool and renumber unknowns; a sensor before them is still found."""
    variants = (
        variant_of(MODEL, "sensor_mass", "configuration 50 mm"),
        variant_of(MODEL, "fluted_part", "from the tip"),
    )
    model = extend(MODEL, variants)
    fit: Any = SimpleNamespace(model=model, values={u.name: 0.1 for u in model.unknowns})
    found = Explanation(variants, fit, 0.0, 0.0)
    assert list(found.sizes(variants[0].cause)) == ["sensor_mass.mass @ 50 mm"]
    assert [one.key for one in found.parameters.values()] == [
        "sensor_mass.mass",
        "fluted_part.log_diameter",
        "fluted_part.length",
    ]
    assert found.implausible == ("sensor_mass.mass @ 50 mm", "fluted_part.log_diameter")
    assert found.title == "mass of the sensor + fluted part"


def test_a_structure_without_a_joint_has_a_suspension_and_a_sensor_in_proportion() -> None:
    def observed(diameter: float) -> Observation:
        bar = Assembly([Part([Segment(length=1.0, outer_diameter=diameter, material=STEEL)], name="bar")])
        return Observation(
            assembly=bar, frequency_hz=LINES, receptance=bar.receptance(LINES), standard_deviation=0.01, label="bar"
        )

    loss = (Unknown(address="bar.segment[0].loss_factor", lower=1e-6, upper=0.1, start=1e-3),)
    for diameter, largest in ((0.005, 0.03), (0.04, 0.05 * 7850.0 * np.pi / 4.0 * 0.04**2)):
        model = Model((observed(diameter),), loss)
        ((_, sensed),) = CATALOGUE["sensor_mass"].extensions(model)
        mass = parameters_of(sensed.unknowns)["sensor_mass.mass"]
        assert mass.plausible == pytest.approx((0.0, largest))
        assert mass.upper >= 0.2
        ((first, hung), (second, _), *_) = CATALOGUE["suspension"].extensions(model)
        assert [first.name, second.name] == ["near 0 % of the structure", "near 0 % of the structure, with a loss"]
        assert hung.observations[0].assembly.get("cause_rope.k_y") == 0.0


def test_unknown_without_parameter_is_an_error() -> None:
    def add(model: Model) -> Model:
        return model.plus(Unknown(address="joint.c_y", lower=1.0, upper=1e4))

    def change(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
        yield Variant("all", add)

    odd = Cause(id="odd", group="structure", parameters=(), change=change, meaning="odd", remedy="none")
    (variant,) = odd.variants(MODEL)
    with pytest.raises(TypeError, match=r"Cause 'odd': the unknown 'joint.c_y' of 'all' is not made of one of its par"):
        variant.apply(MODEL)


def test_a_variant_needs_a_function() -> None:
    with pytest.raises(TypeError, match=r"Variant 'all': change is .*Model.*, expected a function of a model"):
        Variant("all", MODEL)  # type: ignore[arg-type]


def test_variants_of_the_same_cause_and_name_are_equal() -> None:
    """However they were listed: from the model, or from one with another cause."""
    (density,) = CATALOGUE["tool_density"].variants(MODEL)
    (other,) = CATALOGUE["tool_density"].variants(extended_by(MODEL, "fluted_part", "from the tip"))
    assert density == other
    assert {density: 1}[other] == 1
    assert density != density.of(replace(density.cause, id="another"))
    (modulus,) = CATALOGUE["tool_modulus"].variants(MODEL)
    assert modulus.name == density.name
    assert modulus != density


def test_a_variant_has_the_meaning_and_the_remedy_of_its_cause_by_default() -> None:
    cause = CATALOGUE["tool_material"]
    for variant in cause.variants(MODEL):
        assert f"the tool is of {variant.name}" in variant.meaning
        assert variant.cause is cause
    (density,) = CATALOGUE["tool_density"].variants(MODEL)
    assert (density.meaning, density.remedy) == (density.cause.meaning, density.cause.remedy)


def test_a_variant_listed_beside_another_cause_acts_without_it() -> None:
    """Addresses and rooms are those of the model on which it acts."""
    fluted = extended_by(MODEL, "fluted_part", "from the tip")
    overhang = variant_of(fluted, "overhang_error", "all")
    for model, segment in ((fluted, 1), (MODEL, 0)):
        assert overhang.apply(model).unknowns[-1].addresses == (f"tool.segment[{segment}].length",)


def test_a_cause_is_undecidable_where_none_of_its_variants_can_be_applied() -> None:
    def refuse(reason: str, model: Model) -> Model:
        raise UndecidableError(reason)

    def change(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
        yield Variant("first", partial(refuse, "for the first reason"))
        yield Variant("second", partial(refuse, "for the second reason"))
        if len(model.observations) > 1:
            yield Variant("third", Model.with_shared_assemblies)

    cause = Cause(id="odd", group="structure", parameters=(), change=change, meaning="odd", remedy="none")
    assert [variant.name for variant, _ in cause.extensions(MODEL)] == ["third"]
    with pytest.raises(UndecidableError, match="for the first reason"):
        cause.extensions(replace(MODEL, observations=MODEL.observations[:1]))


def test_other_observations_are_changed_as_far_as_they_have_the_cause() -> None:
    """Held-out configurations: with another overhang, without what varied, without the joint, without the place."""
    held_out = replace(MODEL, observations=(make_observations(0.065),))
    before = held_out.observations[0].assembly
    law = variant_of(MODEL, "joint_overhang_law", "tool.segment[0].length: k_theta")
    other = variant_of(MODEL, "overhang_error", "50 mm")
    for variant in (law, other):
        same = transfer(held_out, [variant])
        assert same.observations[0].assembly == before
        assert same.unknowns == held_out.unknowns
    collet = variant_of(MODEL, "collet_mass", "between tool and holder")
    assert isinstance(transfer(held_out, [collet]).observations[0].assembly.elements["joint"], ColletJoint)
    alone = Assembly([before.elements["holder"]])
    bare = replace(held_out, observations=(altered(held_out.observations[0], assembly=alone),))
    assert transfer(bare, [collet]).observations[0].assembly == alone
    hit = altered(held_out.observations[0], response=Coordinate("holder", 0.04))
    elsewhere = replace(held_out.with_witnesses(), observations=(hit,))
    with pytest.raises(IndescribableError, match="holder at 40 mm, where the diagnosed data have none"):
        transfer(elsewhere, [variant_of(MODEL, "joint_spread", "layer")])


def test_a_change_that_variants_share_is_made_once() -> None:
    variants = CATALOGUE["sensor_mass"].variants(MODEL)
    assert len({id(variant.apply(MODEL).shorter) for variant in variants}) == 1


def test_a_collet_of_no_mass_is_the_joint() -> None:
    """Laws, moves and tolerances of the joint apply to both springs, so the results are unchanged."""
    unknowns = (
        Law(address="joint.k_y", lower=1e6, upper=1e11, start=6e8, individual=0.05, follows={"joint.c_y": 0.5}),
        Move(address="both", lower=-1.0, upper=1.0, moves={"joint.k_theta": 1.0, "joint.c_theta": -1.0}, relative=True),
    )
    tolerances = (Tolerance(name="loss", moves={"joint.c_theta": 0.1}, relative=True),)
    model = Model(MODEL.observations, unknowns, tolerances)
    ((variant, collet), *_) = CATALOGUE["collet_mass"].extensions(model)
    assert variant.name == "between tool and holder"
    assert isinstance(collet.observations[0].assembly.elements["joint"], ColletJoint)
    before, after = (moved_residual(one, "collet_mass") for one in (model, collet))
    np.testing.assert_allclose(after, before, atol=1e-7)
    with pytest.raises(UndecidableError, match="has a collet"):
        CATALOGUE["collet_mass"].extensions(collet)


def test_a_law_of_the_overhang_is_tried_where_the_holder_was_measured_alone_as_well() -> None:
    holder = Assembly([MODEL.observations[0].assembly.elements["holder"]])
    alone = altered(MODEL.observations[0], assembly=holder, label="holder alone")
    model = replace(MODEL, observations=(*MODEL.observations, alone))
    names = [variant.name for variant in CATALOGUE["joint_overhang_law"].variants(MODEL)]
    assert [variant.name for variant, _ in CATALOGUE["joint_overhang_law"].extensions(model)] == names


@pytest.mark.parametrize("name", ["layer", "layer over the whole insertion"])
def test_the_order_of_two_causes_does_not_matter(name: str) -> None:
    """Flutes end before the holder: the shank within a spread joint keeps its diameter."""
    flutes = variant_of(MODEL, "fluted_part", "from the tip")
    spread = variant_of(MODEL, "joint_spread", name)
    models = [extend(MODEL, order) for order in ((flutes, spread), (spread, flutes))]
    values = {"fluted_part.log_diameter": -0.1, "fluted_part.length": 0.02, "joint_spread.length": 0.01}
    first, second = (one.problem.residual(one.task.variables.vector_of(values)) for one in models)
    assert np.abs(first).max() > 10.0
    np.testing.assert_allclose(second, first, atol=1e-6 * np.abs(first).max())


@pytest.mark.parametrize("field", ["youngs_modulus", "density", "outer_diameter"])
def test_an_unknown_of_the_tool_is_one_of_the_shank_in_a_spread_joint(field: str) -> None:
    stated = MODEL.observations[0].assembly.get(f"tool.segment[0].{field}")
    unknown = Unknown(address=f"tool.segment[*].{field}", lower=0.5 * stated, upper=2.0 * stated, start=stated)
    variant = variant_of(MODEL, "joint_spread", "layer")
    (as_unknown, as_tolerance) = (
        variant.apply(replace(MODEL, unknowns=(*JOINT, *unknowns), tolerances=tolerances))
        for unknowns, tolerances in (
            ((unknown,), ()),
            ((), (Tolerance(name="error", moves={unknown.address: 1.0}, relative=True),)),
        )
    )
    values = {"joint_spread.length": 0.01, unknown.name: stated * np.exp(0.1), "error": 0.1}
    first, second = (
        one.problem.residual(one.task.variables.vector_of(values))[: 4 * LINES.size]
        for one in (as_unknown, as_tolerance)
    )
    assert np.abs(first).max() > 10.0
    np.testing.assert_allclose(second, first, atol=1e-6 * np.abs(first).max())


def test_a_heavy_collet_has_a_moment_of_inertia_of_its_own() -> None:
    """One radius of gyration for all collets leaves a misfit far beyond the noise where a collet of 70 g differs."""
    inertia = 0.07 * (0.75 * 0.012) ** 2

    def observe(overhang: float) -> Observation:
        tool, _, holder = make_assembly(overhang).elements.values()
        half = PointJoint(k_y=1.2e9, k_theta=2e5, c_y=600.0, c_theta=2.0)
        true = Assembly([tool, ColletJoint(inner=half, outer=half, mass=0.07, inertia=inertia, name="joint"), holder])
        return altered(
            make_observations(overhang), receptance=true.receptance(LINES), standard_deviation=np.full(LINES.size, 1e-3)
        )

    model = Model((observe(0.05), observe(0.08)), JOINT)
    ((_, collet), *_) = CATALOGUE["collet_mass"].extensions(model)
    starts: list[dict[str, float]] = [{"collet_mass.mass": 0.09}, {"collet_mass.mass": 0.03}]
    fit = explore(fit_base(model), collet, starts).go_on([]).finish()
    assert fit is not None
    assert fit.misfit < 0.01
    assert fit.values["collet_mass.mass"] == pytest.approx(0.07, rel=1e-2)
    assert fit.values["collet_mass.log_inertia"] == pytest.approx(2.0 * np.log(0.75 / COLLET_GYRATION), abs=0.02)


def test_an_error_of_the_first_segment_lengthens_a_joint_along_the_whole_insertion() -> None:
    """What that joint leaves of the segment is shorter than an ordinary error, which would make it negative."""
    error = Tolerance(name="insertion", moves={"holder.segment[0].length": 1e-4})
    model = Model(tuple(map(observe_insertion, (0.05, 0.08))), JOINT, (error,))
    whole = [extended for one, extended in CATALOGUE["joint_spread"].extensions(model) if "whole insertion" in one.name]
    assert len(whole) == 6
    for extended in whole:
        problem = extended.task.problem()
        x = problem.variables.start.copy()
        at = problem.variables.names.index("insertion")
        lines = 2 * LINES.size
        before, after = (problem.residual(x + shift * np.eye(x.size)[at])[:lines].copy() for shift in (0.0, -3.0))
        assert np.isfinite(after).all()
        assert np.max(np.abs(after - before)) > 0.1


def observe_insertion(overhang: float) -> Observation:
    tool, joint, _ = make_assembly(overhang).elements.values()
    mouth = Segment(length=0.04, outer_diameter=0.03, inner_diameter=0.012, core=CARBIDE, material=STEEL)
    holder = Part([mouth, Segment(length=0.09, outer_diameter=0.045, material=STEEL)], name="holder")
    return altered(make_observations(overhang), assembly=Assembly([tool, joint, holder]))


def test_fits_in_the_background_end_after_an_interrupt() -> None:
    """Signals reach the main thread alone, so that fits in other threads need a flag of their own."""
    problem, begun, ended, enough = MODEL.problem, threading.Event(), threading.Event(), threading.Event()
    start = problem.variables.start + 0.3

    def endless() -> None:
        begun.set()
        try:
            while not enough.is_set():
                problem.fit_one(start)
        finally:
            ended.set()

    def interrupted() -> None:
        assert begun.wait(LIMIT_S)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        list(in_parallel([interrupted, endless], 2))
    went_on = not ended.wait(LIMIT_S)
    enough.set()
    assert not went_on, "the fit goes on"


def test_explanations_far_behind_the_best_one_are_not_fitted_on_all_lines() -> None:
    assert behind_limit(1000.0, [200.0, 700.0]) == pytest.approx(200.0 + 60.0 + 0.3 * 800.0)
    # Without a cause that gains, the model itself is the best one.
    assert behind_limit(1000.0, [1500.0]) == behind_limit(1000.0, []) == pytest.approx(1060.0)


@pytest.mark.parametrize("plausible", [(1.0,), (5.0, 1.0)])
def test_a_plausible_range_is_two_numbers_in_order(plausible: Any) -> None:
    with pytest.raises(ValueError, match=r"Parameter 'mass': plausible is .*, expected two numbers, the smaller one"):
        Parameter(name="mass", unit="kg", lower=0.0, upper=1.0, typical=0.1, plausible=plausible)
