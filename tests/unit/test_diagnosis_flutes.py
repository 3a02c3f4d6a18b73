"""Flutes with another core or of another length than stated: data by finite elements and an own section."""

from __future__ import annotations

import math

import numpy as np
import pytest
from numpy.typing import NDArray

from blank_in_holder import JOINT, UNKNOWNS, observe
from blind.generator.elements import Ring, Structure, cowper
from foreign_holder import FLUTE_SHEAR, fluted_polygon, integrals
from receptance import CARBIDE, STEEL, Assembly, Coordinate, Observation, Part, SectionShape, Segment
from receptance.diagnosis import CATALOGUE, Model, UndecidableError, diagnose
from receptance.diagnosis.causes import parameters_of
from receptance.diagnosis.model import IndescribableError
from variant_of_cause import extended_by

SEED = 20261139
LINES = np.linspace(300.0, 7000.0, 250)
OVERHANGS = (0.05, 0.065, 0.08)
DIAMETER, CORE, FLUTES, HOLDER = 0.012, 0.0072, 0.026, (0.13, 0.045)
FEW = ("fluted_part", "tip_diameter", "tool_density", "tool_modulus", "calibration_gain", "sensor_mass")


def described(overhang: float, core: float = CORE, flutes: float = FLUTES) -> Assembly:
    shape = SectionShape.fluted(4, diameter=DIAMETER, core_diameter=core)
    tool = [
        Segment(length=flutes, outer_diameter=DIAMETER, shape=shape, material=CARBIDE),
        Segment(length=overhang - flutes, outer_diameter=DIAMETER, material=CARBIDE),
    ]
    length, outer = HOLDER
    holder = Part([Segment(length=length, outer_diameter=outer, material=STEEL)], name="holder")
    return Assembly([Part(tool, name="tool"), JOINT, holder])


def true_receptance(overhang: float, core: float, flutes: float) -> NDArray[np.complex128]:
    """Return the tip receptance; nothing of it is computed by the package."""
    carbide = (580e9, 14500.0, 0.22, 0.0)
    steel = (210e9, 7850.0, 0.3, 0.0)
    area, second = integrals(fluted_polygon(core_mm=1e3 * core))
    circle = math.pi * DIAMETER**2 / 4.0, math.pi * DIAMETER**4 / 64.0
    ratio = second / circle[1]
    fluted = Ring(DIAMETER, 0.0, *carbide, FLUTE_SHEAR, area=area / circle[0], moment=ratio, inertia=ratio)
    model = Structure()
    tip = model.station()
    step = model.beam(tip, flutes, [fluted])
    mouth = model.beam(step, overhang - flutes, [Ring(DIAMETER, 0.0, *carbide, cowper(DIAMETER, 0.0, 0.22))])
    nose = model.station()
    model.beam(nose, HOLDER[0], [Ring(HOLDER[1], 0.0, *steel, cowper(HOLDER[1], 0.0, 0.3))])
    stiffness = np.diag([JOINT.k_y, JOINT.k_theta]).astype(np.complex128)
    model.spring(mouth, nose, stiffness, np.diag([JOINT.c_y, JOINT.c_theta]))
    stiffness, inertia, damping = model.matrices()
    load = np.zeros(model.size)
    load[2 * tip] = 1.0
    angular = 2.0 * np.pi * LINES
    return np.array([np.linalg.solve(stiffness + 1j * w * damping - w**2 * inertia, load)[2 * tip] for w in angular])


def measured(core: float, flutes: float) -> list[Observation]:
    rng = np.random.default_rng(SEED)
    print(f"seed {SEED}")
    return [observe(described(x), LINES, true_receptance(x, core, flutes), rng, f"{x}") for x in OVERHANGS]


def test_flutes_as_stated_are_adequate() -> None:
    verdict = diagnose(measured(CORE, FLUTES), UNKNOWNS, causes=FEW, max_causes=1, threads=1)
    assert verdict.verdict == "adequate"


@pytest.mark.parametrize("core", [0.93 * CORE, 1.1 * CORE])
def test_another_core_is_named_with_its_size(core: float) -> None:
    verdict = diagnose(measured(core, FLUTES), UNKNOWNS, causes=FEW, max_causes=1, threads=1)
    assert verdict.verdict == "named", verdict.summary(120)
    assert [(cause.id, cause.variant) for cause in verdict.causes] == [("fluted_part", "core of the flutes")]
    value, *_ = verdict.causes[0].parameters["fluted_part.log_core_diameter"]
    assert value == pytest.approx(math.log(core / CORE), rel=0.1)


@pytest.mark.parametrize("flutes", [FLUTES - 3e-3, FLUTES + 4e-3])
def test_another_length_of_flutes_is_named_with_its_size(flutes: float) -> None:
    verdict = diagnose(measured(CORE, flutes), UNKNOWNS, causes=FEW, max_causes=1, threads=1)
    assert verdict.verdict == "named", verdict.summary(120)
    assert [(cause.id, cause.variant) for cause in verdict.causes] == [("fluted_part", "length of the flutes")]
    value, *_ = verdict.causes[0].parameters["fluted_part.flute_length"]
    assert value == pytest.approx(flutes - FLUTES, abs=4e-4)


@pytest.mark.parametrize("number", [2, 3, 4, 6])
@pytest.mark.parametrize("core", [0.52, 0.6, 0.7])
def test_a_moved_core_acts_like_the_section_with_that_core(number: int, core: float) -> None:
    """The frequencies change as those of the section that is computed anew, to a tenth of the largest change."""

    def tool(ratio: float) -> Assembly:
        shape = SectionShape.fluted(number, diameter=DIAMETER, core_diameter=ratio * DIAMETER)
        parts = described(0.05).elements
        flutes = Segment(length=FLUTES, outer_diameter=DIAMETER, shape=shape, material=CARBIDE)
        return Assembly([Part([flutes, parts["tool"].segments[1]], name="tool"), JOINT, parts["holder"]])

    before = tool(core)
    observation = observe(before, LINES, before.receptance(LINES), np.random.default_rng(0), "50 mm")
    extended = extended_by(Model((observation,), tuple(UNKNOWNS)), "fluted_part", "core of the flutes")
    (move,) = [unknown for unknown in extended.unknowns if unknown.name == "fluted_part.log_core_diameter"]
    change = math.log(1.05)
    moved = before.replace({a: before.get(a) * math.exp(n * change) for a, n in move.moves.items()})
    exact = tool(1.05 * core).lowest_natural_frequencies(4)[0]
    shift = exact - before.lowest_natural_frequencies(4)[0]
    error = moved.lowest_natural_frequencies(4)[0] - exact
    assert np.abs(error / exact).max() < 0.1 * np.abs(shift / exact).max()
    assert moved.mass == pytest.approx(tool(1.05 * core).mass, rel=1e-3)
    limits = [SectionShape.fluted(number, diameter=1e-2, core_diameter=6e-3).core_limits[side] for side in (0, 1)]
    assert math.log(limits[0] / core) - 1e-9 <= move.lower < 0.0 < move.upper <= math.log(limits[1] / core) + 1e-9


def test_flutes_end_between_the_places_on_the_tool() -> None:
    place = Coordinate("tool", 0.03)
    assembly = described(0.05)

    def at(where: Coordinate) -> Model:
        values = assembly.receptance(LINES, response=where)
        one = Observation(
            assembly=assembly, frequency_hz=LINES, receptance=values, response=where, standard_deviation=0.01, label="a"
        )
        return Model((one,), tuple(UNKNOWNS))

    extended = extended_by(at(place), "fluted_part", "length of the flutes")
    (moved,) = [unknown for unknown in extended.unknowns if "flute_length" in unknown.name]
    assert moved.lower < -0.01
    assert 0.0 < moved.upper < 0.004
    assert parameters_of(extended.unknowns)[moved.name].is_plausible(-5e-3)
    with pytest.raises(IndescribableError, match="where the flutes end"):
        extended_by(at(Coordinate("tool", FLUTES)), "fluted_part", "length of the flutes")


def test_other_shapes_and_cylinders_keep_the_diameter_of_the_section() -> None:
    shape = SectionShape.polygon(fluted_polygon(60))
    for section in ({"shape": shape, "outer_diameter": shape.diameter}, {"outer_diameter": 0.01}):
        plain = described(0.05)
        flutes = Segment(length=FLUTES, material=CARBIDE, **section)  # type: ignore[arg-type]
        tool = Part([flutes, plain.parts["tool"].segments[1]], name="tool")
        assembly = Assembly([tool, JOINT, plain.parts["holder"]])
        observation = observe(assembly, LINES, assembly.receptance(LINES), np.random.default_rng(0), "50 mm")
        ((variant, extended),) = CATALOGUE["fluted_part"].extensions(Model((observation,), tuple(UNKNOWNS)))
        assert variant.name == "first section"
        assert "fluted_part.log_diameter" in [unknown.name for unknown in extended.unknowns]
    fluted = observe(described(0.05), LINES, described(0.05).receptance(LINES), np.random.default_rng(0), "50 mm")
    with pytest.raises(UndecidableError, match="section of flutes: see fluted_part"):
        CATALOGUE["tip_diameter"].variants(Model((fluted,), tuple(UNKNOWNS)))


def test_core_and_length_are_told_together() -> None:
    core, flutes = 1.1 * CORE, FLUTES - 4e-3
    verdict = diagnose(measured(core, flutes), UNKNOWNS, causes=FEW, max_causes=1, threads=1)
    assert verdict.verdict == "named", verdict.summary(120)
    assert [(cause.id, cause.variant) for cause in verdict.causes] == [("fluted_part", "core and length of the flutes")]
    values = verdict.causes[0].parameters
    assert values["fluted_part.log_core_diameter"][0] == pytest.approx(math.log(core / CORE), rel=0.1)
    assert values["fluted_part.flute_length"][0] == pytest.approx(flutes - FLUTES, abs=4e-4)
