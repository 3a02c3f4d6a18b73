"""Errors of the description: numbers that are copied wrongly, and what the drawing of tool or holder leaves out.

Sizes are from no change to:

- a chamfer that takes 15 % of the diameter of the first 5 mm of the holder; a pull stud of 0.1 kg at its end;
- another grade of carbide in the longer tools: 4 % stiffer, 2 % lighter;
- 20 mm of steel at the tip of a carbide tool; all of steel behind half of the shortest overhang, down to the mouth;
- an insertion that is shorter by 60 % of the bore;
- a coolant channel of 40 % of the tool's diameter; a shank thicker by 10 %, from 40 to 80 % of the overhang on; a neck
  of 12 to 30 mm thinner by 10 %; a drill's point from 40 % of the diameter on, as long as 80 % of it;
- flutes over 25 to 40 mm with a bending stiffness lower by 30 % and a mass lower by 10 %; flutes described at the tip,
  which are in fact at the mouth, 15 % thinner;
- a diameter off by 5 %, as of an inch series; overhangs read with a ruler, off by 0.6 mm each (standard deviation);
- a step of the holder off by 6 mm; a holder longer by 12 mm; a bore of its last section that the drawing leaves out; a
  groove for the gripper, 5 mm deep and 8 mm wide; a last section of heavy alloy or aluminium, for smaller sizes of
  something between it and steel;
- an insert with its screw, 5 g, 4 to 10 mm behind the tip; a chip that takes half of the first 2 to 5 mm of the tool;
- a tool that was ground again: 0.8 mm shorter, and 4 % thinner over its first 20 to 30 mm;
- a thread that holds the head, 20 to 35 mm behind the tip: 1 mm that is softer by a factor of 13;
- 12 mm of tool or holder heavier or lighter by 30 or 50 %; 15 mm stiffer or softer by 40 or 60 %;
- another blank under the same name at one force level of one configuration: 4 % stiffer, 3 % lighter, 0.3 mm longer;
- eight times the number of averages stated; clampings that scatter by 10 % (standard deviation) more than stated.

The length of the flutes, 65 to 85 % of the overhang, in place of it, and exchanged sections have no size.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from blind.generator import Nominal
from blind.generator.effects import Numbers, Where
from blind.generator.records import Estimate

from .kind import Change, Draw, Kind, added, in_configuration, patch, point, stated, times

STEEL = (210e9, 7850.0)
OTHER_METALS = ((360e9, 17600.0), (70e9, 2750.0))
"""Moduli and densities of tungsten heavy alloy and of aluminium."""
BEYOND = 1.0
"""A place in m behind the end of every part."""
POINT_STEPS = 6
"""Cylinders that stand for a drill's point."""


def _nose_chamfer(d: Draw) -> Change:
    return Change(structure=added(patch("chamfer", "holder", 0.0, 0.005, outer=1.0 - 0.15 * d.u)))


def _pull_stud(d: Draw) -> Change:
    whole = sum(d.numbers[f"holder.{i}.length"] for i in range(3))
    return Change(structure=added(point("stud", "holder", 0.98 * whole, mass=0.1 * d.u)))


def _two_grades(d: Draw) -> Change:
    middle = float(np.median([c.overhang for c in d.bench.nominal.configurations]))
    factors = {"tool.modulus": 1.0 + 0.04 * d.u, "tool.density": 1.0 - 0.02 * d.u}
    return Change(structure=times(factors, lambda where: where.overhang > middle))


def _of_steel(d: Draw, start: float, end: float) -> Change:
    modulus, density = STEEL[0] / d.numbers["tool.modulus"], STEEL[1] / d.numbers["tool.density"]
    return Change(structure=added(patch("steel", "tool", start, end, modulus=modulus, density=density)))


def _steel_head(d: Draw) -> Change:
    return _of_steel(d, 0.0, 0.02 * d.u)


def _steel_shank(d: Draw) -> Change:
    # The head is the same at all overhangs: without steel it is longer than any of them.
    longest = max(c.overhang for c in d.bench.nominal.configurations)
    return _of_steel(d, (1.0 - d.u) * (longest + 0.002) + 0.5 * d.u * d.shortest, BEYOND)


def _short_insertion(d: Draw) -> Change:
    bore = d.numbers["holder.0.length"]
    return Change(structure=added(patch("empty", "holder", bore * (1.0 - 0.6 * d.u), bore, core=0.0)))


def _coolant_channel(d: Draw) -> Change:
    return Change(structure=added({"tool.bore": 0.4 * d.u * d.numbers["tool.diameter"]}))


def _thicker_shank(d: Draw) -> Change:
    begin = d.within(0.4, 0.8) * d.shortest
    return Change(structure=added(patch("shank", "tool", begin, BEYOND, outer=1.0 + 0.1 * d.u)))


def _neck(d: Draw) -> Change:
    begin = d.within(0.15, 0.4) * d.shortest
    return Change(structure=added(patch("neck", "tool", begin, begin + d.within(0.012, 0.03), outer=1.0 - 0.1 * d.u)))


def _drill_point(d: Draw) -> Change:
    length = 0.8 * d.u * d.numbers["tool.diameter"]
    numbers: dict[str, float] = {}
    for i in range(POINT_STEPS):
        ends = (i * length / POINT_STEPS, (i + 1) * length / POINT_STEPS)
        numbers |= patch(f"point{i}", "tool", *ends, outer=0.4 + 0.6 * (i + 0.5) / POINT_STEPS)
    return Change(structure=added(numbers))


def _flutes_of_two_diameters(d: Draw) -> Change:
    end = d.within(0.025, 0.04)
    return Change(structure=added(patch("flutes", "tool", 0.0, end, modulus=1.0 - 0.3 * d.u, density=1.0 - 0.1 * d.u)))


def _turned_bar(d: Draw) -> Change:
    length, ratio = d.within(0.015, 0.025), 1.0 - 0.15 * d.u

    def structure(p: Numbers, where: Where) -> None:
        p["flute.ratio"] = 1.0
        p |= patch("flutes", "tool", p["tool.overhang"] - length, BEYOND, outer=ratio)

    return Change(common={"flute.length": length, "flute.ratio": ratio}, structure=structure)


def _inch_diameter(d: Draw) -> Change:
    factor = 1.0 + 0.05 * d.u * d.sign()
    # The bore is as wide as the shank.
    return Change(structure=times({"tool.diameter": factor, "holder.0.inner": factor}))


def _step_of_holder(d: Draw) -> Change:
    away = 6e-3 * d.u * d.sign()

    def structure(p: Numbers, where: Where) -> None:
        p["holder.1.length"] += away
        p["holder.2.length"] -= away

    return Change(structure=structure)


def _longer_holder(d: Draw) -> Change:
    longer = 0.012 * d.u * d.sign()

    def structure(p: Numbers, where: Where) -> None:
        p["holder.2.length"] += longer

    return Change(structure=structure)


def _omitted_bore(d: Draw) -> Change:
    return Change(describe=stated(holder__2__inner=d.numbers["holder.2.inner"] * (1.0 - d.u)))


def _gripper_groove(d: Draw) -> Change:
    middle = d.numbers["holder.0.length"] + 0.5 * d.numbers["holder.1.length"]
    outer = 1.0 - 0.01 * d.u / d.numbers["holder.1.outer"]
    return Change(structure=added(patch("groove", "holder", middle - 0.004, middle + 0.004, outer=outer)))


def _section_of_other_metal(d: Draw) -> Change:
    begin = d.numbers["holder.0.length"] + d.numbers["holder.1.length"]
    modulus, density = OTHER_METALS[int(d.rng.integers(2))]
    factors = {"modulus": (modulus / d.numbers["holder.modulus"]) ** d.u,
               "density": (density / d.numbers["holder.density"]) ** d.u}  # fmt: skip
    return Change(structure=added(patch("metal", "holder", begin, BEYOND, **factors)))


def _insert_and_screw(d: Draw) -> Change:
    return Change(structure=added(point("insert", "tool", d.within(0.004, 0.01), mass=5e-3 * d.u)))


def _chipped_tool(d: Draw) -> Change:
    left = 1.0 - 0.5 * d.u
    return Change(structure=added(patch("chip", "tool", 0.0, d.within(0.002, 0.005), density=left, modulus=left)))


def _ground_again(d: Draw) -> Change:
    flutes = patch("flutes", "tool", 0.0, d.within(0.02, 0.03), outer=1.0 - 0.04 * d.u)

    def structure(p: Numbers, where: Where) -> None:
        p["tool.overhang"] -= 8e-4 * d.u
        p |= flutes

    return Change(structure=structure)


def _screwed_head(d: Draw) -> Change:
    begin = d.within(0.02, 0.035)
    return Change(structure=added(patch("thread", "tool", begin, begin + 1e-3, modulus=1.0 / (1.0 + 12.0 * d.u))))


def _flutes_for_overhang(d: Draw) -> Change:
    name, share = d.configuration(), d.within(0.65, 0.85)

    def describe(nominal: Nominal) -> Nominal:
        told = [replace(c, overhang=c.overhang * share) if c.name == name else c for c in nominal.configurations]
        return replace(nominal, configurations=tuple(told))

    return Change(describe=describe)


def _exchanged_sections(d: Draw) -> Change:
    first, second = (d.numbers[f"holder.{i}.length"] for i in (1, 2))
    return Change(describe=stated(holder__1__length=second, holder__2__length=first))


def _somewhere(d: Draw, field: str, length: float, on_tool: float, on_holder: float) -> Change:
    """Change a short piece of tool or holder, at a place that is the same in all configurations."""
    sign = d.sign()
    if d.rng.random() < 0.5:
        begin, share, part = d.within(0.15, 0.7) * d.shortest, on_tool, "tool"
    else:
        whole = sum(d.numbers[f"holder.{i}.length"] for i in range(3))
        begin, share, part = d.within(0.3, 0.85) * whole, on_holder, "holder"
    factor = {field: 1.0 + sign * share * d.u}
    return Change(structure=added(patch("piece", part, begin, begin + length, **factor)))


def _mass_somewhere(d: Draw) -> Change:
    return _somewhere(d, "density", 0.012, 0.3, 0.5)


def _stiffness_somewhere(d: Draw) -> Change:
    return _somewhere(d, "modulus", 0.015, 0.4, 0.6)


def _two_blanks(d: Draw) -> Change:
    here, sign = in_configuration(d.configuration()), d.sign()

    def structure(p: Numbers, where: Where) -> None:
        if here(where) and where.level == d.upper:
            p["tool.modulus"] *= 1.0 + 0.04 * d.u * sign
            p["tool.density"] *= 1.0 - 0.03 * d.u * sign
            p["tool.overhang"] += 3e-4 * d.u * sign

    return Change(structure=structure)


def _overstated_averages(d: Draw) -> Change:
    factor = 1.0 + 7.0 * d.u

    def analysis(e: Estimate, p: Numbers, where: Where) -> Estimate:
        hits = round(e.averages * factor)
        return replace(
            e, averages=hits, log_variance=e.log_variance * e.averages / hits,
            degrees_of_freedom=e.degrees_of_freedom * (hits - 1) / (e.averages - 1),
        )  # fmt: skip

    return Change(analysis=analysis)


def _scattered_clampings(d: Draw) -> Change:
    names = ("joint.k_y", "joint.k_theta")
    factors = {c: np.exp(0.1 * d.u * d.rng.standard_normal(len(names))) for c in d.names}

    def structure(p: Numbers, where: Where) -> None:
        for name, factor in zip(names, factors[where.configuration], strict=True):
            p[name] *= float(factor)

    return Change(structure=structure)


def _overhangs_by_ruler(d: Draw) -> Change:
    errors = {c: 6e-4 * d.u * float(d.rng.standard_normal()) for c in d.names}

    def structure(p: Numbers, where: Where) -> None:
        p["tool.overhang"] += errors[where.configuration]

    return Change(structure=structure)


DESCRIPTION_ERRORS = (
    Kind("nose_chamfer", "description", "The drawing of the holder leaves out a chamfer at its nose.", _nose_chamfer),
    Kind("pull_stud", "description", "The pull stud is not described.", _pull_stud, right=("holder_inertia",)),
    Kind("two_grades", "description", "The longer tools are of another grade of carbide.", _two_grades),
    Kind("steel_head", "description", "The head of the carbide tool is of steel.", _steel_head),
    Kind("steel_shank", "description", "Behind its carbide head the tool is of steel.", _steel_shank),
    Kind("short_insertion", "description", "The shank ends before the bottom of the bore.", _short_insertion),
    Kind("coolant_channel", "description", "The tool has a channel for coolant that the drawing leaves out.",
         _coolant_channel, right=("tool_density",)),
    Kind("thicker_shank", "description", "The shank is thicker than the cutting diameter, which is stated for all.",
         _thicker_shank),
    Kind("neck", "description", "The tool has a neck behind its head that is not described.", _neck),
    Kind("drill_point", "description", "The tool ends with a point and is described as a cylinder.", _drill_point,
         right=("fluted_part",)),
    Kind("flutes_of_two_diameters", "description", "The flutes take more stiffness than mass away.",
         _flutes_of_two_diameters, right=("fluted_part",)),
    Kind("turned_bar", "description", "The thinner end of the bar is in the holder and not at the tip.", _turned_bar),
    Kind("inch_diameter", "description", "The tool is of an inch series and described by the next metric diameter.",
         _inch_diameter),
    Kind("step_of_holder", "description", "A step of the holder is at another place than drawn.", _step_of_holder),
    Kind("longer_holder", "description", "The holder is of the next length of its series.", _longer_holder),
    Kind("omitted_bore", "description", "The drawing of the holder leaves out a bore.", _omitted_bore,
         right=("holder_inertia",)),
    Kind("gripper_groove", "description", "The drawing of the holder leaves out the groove of the gripper.",
         _gripper_groove),
    Kind("section_of_other_metal", "description", "The last section of the holder is of another metal.",
         _section_of_other_metal),
    Kind("insert_and_screw", "description", "Insert and screw are not described.", _insert_and_screw),
    Kind("chipped_tool", "description", "A piece of the tool's tip is broken off.", _chipped_tool,
         right=("fluted_part",)),
    Kind("ground_again", "description", "The tool was ground again, and the file has the numbers of a new one.",
         _ground_again, right=("fluted_part", "overhang_error")),
    Kind("screwed_head", "description", "The head is screwed to the shank, and the tool is described as one piece.",
         _screwed_head),
    Kind("flutes_for_overhang", "description", "One configuration has the length of the flutes as its overhang.",
         _flutes_for_overhang, right=("overhang_error",), sized=False),
    Kind("exchanged_sections", "description", "The lengths of two sections of the holder are exchanged.",
         _exchanged_sections, sized=False),
    Kind("mass_somewhere", "description", "A short piece of tool or holder is heavier or lighter than described.",
         _mass_somewhere),
    Kind("stiffness_somewhere", "description", "A short piece of tool or holder is stiffer or softer than described.",
         _stiffness_somewhere),
    Kind("two_blanks", "description", "Two blanks have one name, and one record is of the other.", _two_blanks),
    Kind("overstated_averages", "description", "The stated number of averages is too large.", _overstated_averages),
    Kind("scattered_clampings", "description", "Clampings scatter more than stated.", _scattered_clampings),
    Kind("overhangs_by_ruler", "description", "The overhangs were read with a ruler and not with a caliper.",
         _overhangs_by_ruler, right=("overhang_error",)),
)  # fmt: skip
