"""Errors of clamping and suspension: how the holder hangs, what touches it, and what differs between the clampings.

Sizes are from no change to:

- a vice with 3e7 N/m at two places near the end of the holder; foam along the holder on which it bounces at 80 Hz; a
  rope of 60 Hz on the tool; a hand of 0.25 kg that is damped like 40 % of critical at 50 Hz;
- a hose with 1e6 N/m and 5 N s/m where it sticks to the holder, and 10 N s/m where it slides;
- a sensor of 3 g on the tool at the higher force level only;
- foam at the tip with 2e5 N/m and 5 N s/m; a cable tie of 2.5 g and 3 N s/m on the tool; a rubber ring of 4 g on the
  tool, with a resonance at 0.5 to 2.5 kHz; a magnet of 150 g on the holder; a stop screw of 20 g behind the shank;
- a table on which the holder leans in one configuration, with 5e5 N/m;
- one mode with a damping ratio larger by 0.01;
- grease on the shank of one configuration: damping larger by a factor of 4, stiffness lower by 10 %;
- inserts lost in one configuration: 12 % of the section of the first 8 mm; a sleeve of steel that protrudes by 8 mm, as
  thick as 15 % of the tool's diameter; flutes of 25 to 35 mm whose two bending stiffnesses are 25 % above and below
  the mean, turned anew in each clamping;
- a chip in the bore of one configuration: rotational stiffness lower by half, the other one by 30 %, and a coupling of
  up to 0.2; a nut not tightened in one configuration: stiffness lower by half, damping larger by a factor of 2.5; a
  collet of another size in one: stiffer by 60 % across, softer by 30 % in rotation;
- a nut left off, a quarter of the diameter over 12 mm; balancing holes that take a fifth of 8 mm of the flange; coolant
  that fills the bores of the holder;
- clampings repeated between the force levels that scatter by 12 % (standard deviation); a joint that settles by 25 %
  from the first configuration to the last one; a tool that slips by 0.6 mm at one level of one configuration;
- moduli lower by 2 % in one configuration (80 K of steel), by up to 1.2 % with the order of the measurements;
- another holder of the same type in one configuration: diameters off by 2 %, lengths by 0.5 mm (standard deviations).
"""

from __future__ import annotations

import numpy as np

from blind.generator.effects import Numbers, Where

from .kind import Change, Draw, Kind, added, in_configuration, patch, point, times

WATER = 1000.0
"""Density of coolant in kg/m3."""
MASS = 1.5
"""Rounded mass of holder and tool in kg, to which frequencies of bouncing refer."""
MODULI = ("tool.modulus", "holder.modulus")


def bouncing_stiffness(hz: float) -> float:
    """Return the stiffness in N/m on which holder and tool bounce at a frequency."""
    return MASS * (2.0 * np.pi * hz) ** 2


def length_of_holder(d: Draw) -> float:
    """Return the length of the holder in m."""
    return sum(d.numbers[f"holder.{i}.length"] for i in range(3))


def springs(d: Draw, places: list[float], each: float, zeta: float) -> Change:
    """Hold the holder by equal springs at shares of its length."""
    damping = 2.0 * zeta * np.sqrt(each * MASS / len(places))
    numbers: dict[str, float] = {}
    for i, share in enumerate(places):
        numbers |= point(f"spring{i}", "holder", share * length_of_holder(d), k=each, c=damping)
    return Change(structure=added(numbers))


def _vice(d: Draw) -> Change:
    return springs(d, [d.within(0.65, 0.75), d.within(0.85, 0.95)], 3e7 * d.u, 0.02)


def _foam(d: Draw) -> Change:
    places = [0.06 + 0.11 * i for i in range(9)]
    return springs(d, places, bouncing_stiffness(80.0 * d.u) / len(places), 0.2)


def _rope_on_tool(d: Draw) -> Change:
    k = bouncing_stiffness(60.0 * d.u)
    damping = 0.06 * np.sqrt(k * MASS)
    return Change(structure=added(point("rope", "tool", d.within(0.5, 0.9) * d.shortest, k=k, c=damping)))


def _hand(d: Draw) -> Change:
    place = d.within(0.4, 0.9) * length_of_holder(d)
    # A hand so light that it is negligible, where none holds.
    mass = max(0.25 * d.u, 1e-7)
    return Change(structure=added(point("hand", "holder", place, mass=mass, hz=50.0, zeta=0.4)))


def _touched_tip(d: Draw) -> Change:
    return Change(structure=added(point("foam", "tool", 0.0, k=2e5 * d.u, c=5.0 * d.u)))


def _cable_tie(d: Draw) -> Change:
    place = d.within(0.2, 0.7) * d.shortest
    return Change(structure=added(point("tie", "tool", place, mass=2.5e-3 * d.u, c=3.0 * d.u)))


def _rubber_ring(d: Draw) -> Change:
    numbers = {"hz": float(np.exp(d.within(np.log(500.0), np.log(2500.0)))), "zeta": d.within(0.1, 0.3)}
    place = d.within(0.2, 0.7) * d.shortest
    return Change(structure=added(point("ring", "tool", place, mass=max(4e-3 * d.u, 1e-9), **numbers)))


def _magnet_on_holder(d: Draw) -> Change:
    mass, place = 0.15 * d.u, d.within(0.3, 0.8) * length_of_holder(d)
    return Change(structure=added(point("magnet", "holder", place, mass=mass, inertia=2e-4 * mass)))


def _stop_screw(d: Draw) -> Change:
    return Change(structure=added(point("screw", "holder", d.numbers["holder.0.length"], mass=0.02 * d.u)))


def _leaning_holder(d: Draw) -> Change:
    here, place = in_configuration(d.configuration()), d.within(0.4, 0.9) * length_of_holder(d)

    def structure(p: Numbers, where: Where) -> None:
        if here(where):
            p |= point("table", "holder", place, k=5e5 * d.u, c=10.0 * d.u)

    return Change(structure=structure)


def _sticking_hose(d: Draw) -> Change:
    place = d.within(0.3, 0.8) * length_of_holder(d)

    def structure(p: Numbers, where: Where) -> None:
        sticks = {"k": 1e6 * d.u, "c": 5.0 * d.u}
        p |= point("hose", "holder", place, **({"c": 10.0 * d.u} if where.level == d.upper else sticks))

    return Change(structure=structure)


def _forgotten_sensor(d: Draw) -> Change:
    place = d.within(0.3, 0.7) * d.shortest

    def structure(p: Numbers, where: Where) -> None:
        p |= point("forgotten", "tool", place, mass=3e-3 * d.u * float(where.level == d.upper))

    return Change(structure=structure)


def _grease_on_shank(d: Draw) -> Change:
    factors = {"joint.k_y": 1.0 - 0.1 * d.u, "joint.k_theta": 1.0 - 0.1 * d.u}
    factors |= {"joint.c_y": 1.0 + 3.0 * d.u, "joint.c_theta": 1.0 + 3.0 * d.u}
    return Change(structure=times(factors, in_configuration(d.configuration())))


def _lost_inserts(d: Draw) -> Change:
    here, left = in_configuration(d.configuration()), 1.0 - 0.12 * d.u

    def structure(p: Numbers, where: Where) -> None:
        # Everywhere a head of its own, so that all meshes are alike.
        factor = left if here(where) else 1.0
        p |= patch("head", "tool", 0.0, 0.008, density=factor, modulus=factor)

    return Change(structure=structure)


def _protruding_sleeve(d: Draw) -> Change:
    ratio = 1.0 + 0.3 * d.u
    tool = [d.numbers[f"tool.{name}"] for name in ("modulus", "density")]
    holder = [d.numbers[f"holder.{name}"] for name in ("modulus", "density")]
    # A ring of the holder's steel around the tool, as one material over both.
    modulus, density = (
        (1.0 + metal / carbide * (ratio**power - 1.0)) / ratio**power
        for carbide, metal, power in zip(tool, holder, (4, 2), strict=True)
    )

    def structure(p: Numbers, where: Where) -> None:
        begin = p["tool.overhang"] - 0.008
        p |= patch("sleeve", "tool", begin, begin + 1.0, outer=ratio, modulus=modulus, density=density)

    return Change(structure=structure)


def _turned_flutes(d: Draw) -> Change:
    length = d.within(0.025, 0.035)
    angles = {c: np.pi * d.rng.random() for c in d.names}

    def structure(p: Numbers, where: Where) -> None:
        factor = 1.0 + 0.25 * d.u * float(np.cos(2.0 * angles[where.configuration]))
        p |= patch("flutes", "tool", 0.0, length, modulus=factor)

    return Change(structure=structure)


def _lossy_mode(d: Draw) -> Change:
    return Change(structure=added({"lossy.mode": float(d.rng.integers(2)), "lossy.zeta": 0.01 * d.u}))


def _chip_in_bore(d: Draw) -> Change:
    here, coupling = in_configuration(d.configuration()), 0.2 * d.u * d.sign()

    def structure(p: Numbers, where: Where) -> None:
        if here(where):
            p["joint.k_theta"] *= 1.0 - 0.5 * d.u
            p["joint.k_y"] *= 1.0 - 0.3 * d.u
            p["joint.k_ytheta"] += coupling * float(np.sqrt(p["joint.k_y"] * p["joint.k_theta"]))

    return Change(structure=structure)


def _loose_nut(d: Draw) -> Change:
    factors = {"joint.k_y": 1.0 - 0.5 * d.u, "joint.k_theta": 1.0 - 0.5 * d.u}
    factors |= {"joint.c_y": 1.0 + 1.5 * d.u, "joint.c_theta": 1.0 + 1.5 * d.u}
    return Change(structure=times(factors, in_configuration(d.configuration())))


def _other_collet(d: Draw) -> Change:
    factors = {"joint.k_y": 1.0 + 0.6 * d.u, "joint.k_theta": 1.0 - 0.3 * d.u}
    return Change(structure=times(factors, in_configuration(d.configuration())))


def _nut_left_off(d: Draw) -> Change:
    return Change(structure=added(patch("nut", "holder", 0.0, 0.012, outer=1.0 - 0.25 * d.u)))


def _balancing_holes(d: Draw) -> Change:
    middle = d.numbers["holder.0.length"] + 0.5 * d.numbers["holder.1.length"]
    factor = 1.0 - 0.2 * d.u
    return Change(
        structure=added(patch("holes", "holder", middle - 0.004, middle + 0.004, density=factor, modulus=factor))
    )


def _coolant_in_holder(d: Draw) -> Change:
    numbers: dict[str, float] = {}
    begin = d.numbers["holder.0.length"]
    for i in (1, 2):
        outer, inner, length = (d.numbers[f"holder.{i}.{name}"] for name in ("outer", "inner", "length"))
        share = WATER / d.numbers["holder.density"] * inner**2 / (outer**2 - inner**2)
        numbers |= patch(f"filled{i}", "holder", begin, begin + length, density=1.0 + d.u * share)
        begin += length
    return Change(structure=added(numbers))


def _clamped_again(d: Draw) -> Change:
    names = ("joint.k_y", "joint.k_theta", "joint.c_y", "joint.c_theta")
    factors = {c: np.exp(0.12 * d.u * d.rng.standard_normal(len(names))) for c in d.names}

    def structure(p: Numbers, where: Where) -> None:
        if where.level == d.upper:
            for name, factor in zip(names, factors[where.configuration], strict=True):
                p[name] *= float(factor)

    return Change(structure=structure)


def _settling_joint(d: Draw) -> Change:
    order = d.order()

    def structure(p: Numbers, where: Where) -> None:
        for name in ("joint.k_y", "joint.k_theta"):
            p[name] *= 1.0 + 0.25 * d.u * float(order[where.configuration])

    return Change(structure=structure)


def _slipped_tool(d: Draw) -> Change:
    here, slip = in_configuration(d.configuration()), 6e-4 * d.u * d.sign()

    def structure(p: Numbers, where: Where) -> None:
        if here(where) and where.level == d.upper:
            p["tool.overhang"] += slip

    return Change(structure=structure)


def _hot_configuration(d: Draw) -> Change:
    return Change(structure=times(dict.fromkeys(MODULI, 1.0 - 0.02 * d.u), in_configuration(d.configuration())))


def _drifting_temperature(d: Draw) -> Change:
    order = d.order()

    def structure(p: Numbers, where: Where) -> None:
        for name in MODULI:
            p[name] *= 1.0 - 0.012 * d.u * float(order[where.configuration])

    return Change(structure=structure)


def _other_holder(d: Draw) -> Change:
    here = in_configuration(d.configuration())
    outer, length = (d.u * size * d.rng.standard_normal(3) for size in (0.02, 5e-4))

    def structure(p: Numbers, where: Where) -> None:
        if here(where):
            for i in range(3):
                p[f"holder.{i}.outer"] *= 1.0 + float(outer[i])
                p[f"holder.{i}.length"] += float(length[i])

    return Change(structure=structure)


CLAMPING_ERRORS = (
    Kind("vice", "clamping", "The holder is gripped in a vice and described as free.", _vice, right=("suspension",)),
    Kind("foam", "clamping", "The holder lies on foam that is too hard.", _foam, right=("suspension",)),
    Kind("rope_on_tool", "clamping", "One rope is around the tool.", _rope_on_tool, right=("suspension",)),
    Kind("hand", "clamping", "Somebody holds the holder.", _hand, right=("suspension",)),
    Kind("touched_tip", "clamping", "Something soft touches the tip.", _touched_tip),
    Kind("cable_tie", "clamping", "A cable tie is around the tool.", _cable_tie),
    Kind("rubber_ring", "clamping", "A rubber ring is around the tool.", _rubber_ring),
    Kind("magnet_on_holder", "clamping", "The magnet of a dial gauge is on the holder.", _magnet_on_holder),
    Kind("stop_screw", "clamping", "A stop screw is in the bore behind the shank.", _stop_screw),
    Kind("leaning_holder", "clamping", "In one configuration the holder leans on a table.", _leaning_holder,
         right=("suspension",)),
    Kind("sticking_hose", "clamping", "A hose touches the holder, sticks in weak hits and slides in strong ones.",
         _sticking_hose, right=("suspension",)),
    Kind("forgotten_sensor", "clamping", "A second sensor was on the tool during the stronger hits only.",
         _forgotten_sensor),
    Kind("grease_on_shank", "clamping", "In one configuration the shank was clamped with grease on it.",
         _grease_on_shank),
    Kind("lost_inserts", "clamping", "In one configuration inserts are missing from the head.", _lost_inserts),
    Kind("protruding_sleeve", "clamping", "A sleeve in the bore protrudes from the holder and holds the tool there.",
         _protruding_sleeve, right=("collet_mass",)),
    Kind("turned_flutes", "clamping", "The two flutes lie in another direction in every clamping.", _turned_flutes),
    Kind("lossy_mode", "clamping", "One mode loses energy into something beside the holder.", _lossy_mode),
    Kind("chip_in_bore", "clamping", "In one configuration a chip is in the bore.", _chip_in_bore),
    Kind("loose_nut", "clamping", "In one configuration the nut was not tightened.", _loose_nut),
    Kind("other_collet", "clamping", "One configuration has the collet of another size.", _other_collet),
    Kind("nut_left_off", "clamping", "The nut that is described as a part of the holder was left off.", _nut_left_off),
    Kind("balancing_holes", "clamping", "The holder was balanced by holes in its flange.", _balancing_holes),
    Kind("coolant_in_holder", "clamping", "The bore of the holder is full of coolant.", _coolant_in_holder,
         right=("holder_inertia",)),
    Kind("clamped_again", "clamping", "The tool was clamped again between the force levels.", _clamped_again),
    Kind("settling_joint", "clamping", "The joint settles from one configuration to the next.", _settling_joint),
    Kind("slipped_tool", "clamping", "In one configuration the tool slipped before the higher force level.",
         _slipped_tool, right=("overhang_error",)),
    Kind("hot_configuration", "clamping", "One configuration was measured while tool and holder were hot.",
         _hot_configuration),
    Kind("drifting_temperature", "clamping", "Tool and holder become warmer from one configuration to the next.",
         _drifting_temperature),
    Kind("other_holder", "clamping", "One configuration is in another holder of the same type.", _other_holder),
)  # fmt: skip
