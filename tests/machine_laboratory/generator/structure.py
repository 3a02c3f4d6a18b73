"""From numbers to a machine of finite elements: tool, joint, holder, taper joint, shaft, bearings, housing.

All numbers of one overhang stand in one mapping with dotted names, in SI units. What is optional (flutes, an absorber)
is there when its names are.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from blind.generator.elements import ComplexArray, FloatArray, Poles, Ring, Structure, cowper
from blind.generator.rig import Row, resonator

Numbers = Mapping[str, float]
Place = tuple[str, float]
"""Part, and distance from its end on the side of the tip in m."""

STEP = 0.0026
"""Longest cylinder of a cone in m."""
REFINEMENT = 0.5
"""Of the mesh: elements of half a wave length."""
MODES = 26
"""Undamped modes in the basis of a response; the rest is static up to twice the highest line."""


def material(p: Numbers, kind: str, outer: float, inner: float = 0.0) -> Ring:
    """Return a ring of the tool's, the holder's or the spindle's material."""
    modulus, density, nu, loss = (p[f"{kind}.{name}"] for name in ("modulus", "density", "poisson", "loss"))
    return Ring(outer, inner, modulus, density, nu, loss, cowper(outer, inner, nu))


def section_count(p: Numbers) -> int:
    """Return the number of sections of the holder."""
    return sum(name.startswith("holder.") and name.endswith(".large") for name in p)


def fluted(p: Numbers) -> Ring:
    """Return a ring with the area and the second moment of the fluted section, given relative to the shank."""
    total, difference = p["flute.second"] / p["flute.area"], p["flute.area"]
    outer = p["tool.diameter"] * math.sqrt(0.5 * (total + difference))
    inner = p["tool.diameter"] * math.sqrt(max(0.5 * (total - difference), 0.0))
    return material(p, "tool", outer, inner)


def build(
    p: Numbers, places: Iterable[Place] = (), refinement: float = REFINEMENT
) -> tuple[Structure, dict[Place, int], int]:
    """Return the structure, the stations of places, and the station of the plane between holder and spindle."""
    s = Structure(refinement)
    wanted = list(places)
    tool = Row(s, [x for part, x in wanted if part == "tool"])
    flutes = p.get("flute.length", 0.0)
    if flutes:
        tool.go(flutes, [fluted(p)])
    tool.go(p["overhang"] - flutes, [material(p, "tool", p["tool.diameter"])])
    mouth = tool.at
    holder = Row(s, [x for part, x in wanted if part == "holder"])
    s.spring(mouth, holder.at, _springs(p, "joint"), _dashpots(p, "joint"))
    for number in range(section_count(p)):
        _section(holder, p, f"holder.{number}")
    rows = {"tool": tool, "holder": holder}
    stations = {(part, x): rows[part][x] for part, x in wanted}
    if "absorber.mass" in p:
        resonator(s, holder.at, p["absorber.mass"], p["absorber.hz"], p["absorber.zeta"])
    add_spindle(s, holder.at, p)
    return s, stations, holder.at


def _section(holder: Row, p: Numbers, name: str) -> None:
    """Add a cylinder, or a cone in short cylinders, with the shank in its bore where it has a core."""
    small, large, length = (p[f"{name}.{field}"] for field in ("small", "large", "length"))
    core = p.get(f"{name}.core", 0.0)
    inner = p["tool.diameter"] if core else p[f"{name}.inner"]
    count = 1 if small == large else math.ceil(length / STEP)
    for piece in range(count):
        outer = small + (large - small) * (piece + 0.5) / count
        shank = [material(p, "tool", inner)] if core else []
        holder.go(length / count, [material(p, "holder", outer, inner), *shank])


def add_spindle(s: Structure, plane: int, p: Numbers) -> None:
    """Add taper joint, shaft, two bearings with dashpots, and a housing on springs."""
    nose = s.station()
    s.spring(plane, nose, _springs(p, "taper"), _dashpots(p, "taper"))
    at = nose
    ends = []
    for number in range(3):
        ring = material(p, "spindle", p[f"shaft.{number}.outer"], p["shaft.bore"])
        at = s.beam(at, p[f"shaft.{number}.length"], [ring])
        ends.append(at)
    housing = s.station()
    s.mass(housing, p["housing.mass"], p["housing.inertia"])
    middle = 0.5 * p["shaft.1.length"]
    for name, end, offset in (("front", ends[0], -middle), ("rear", ends[1], middle)):
        # The housing is rigid and its centre lies between the bearings: its motion at a bearing is y + offset theta.
        _bearing(s, end, housing, offset, _springs(p, name), _dashpots(p, name))
    s.spring(housing, None, _springs(p, "housing"), _dashpots(p, "housing"))


def _springs(p: Numbers, name: str) -> ComplexArray:
    return np.diag([p[f"{name}.k_y"], p[f"{name}.k_theta"]]).astype(np.complex128)


def _dashpots(p: Numbers, name: str) -> FloatArray:
    return np.diag([p[f"{name}.c_y"], p[f"{name}.c_theta"]])


def _bearing(
    s: Structure, shaft: int, housing: int, offset: float, stiffness: ComplexArray, damping: FloatArray
) -> None:
    """Put a bearing between the shaft and a point of the rigid housing."""
    arm = np.array([[1.0, offset], [0.0, 1.0]])
    relative = np.hstack([np.eye(2), -arm])
    s.element((shaft, housing), relative.T @ stiffness @ relative, relative.T @ damping @ relative)


def receptances(
    p: Numbers, response: Place, hits: Sequence[Place], lines: NDArray[np.float64] | ComplexArray
) -> ComplexArray:
    """Return the receptance `(n, hits)` of the response to each hit, with the sensor's mass at the response."""
    found = poles(p, response, hits)
    return np.stack([found.receptance(lines, 0, force) for force in range(len(hits))], axis=1)


def poles(p: Numbers, response: Place, hits: Sequence[Place]) -> Poles:
    """Return the poles of the response to forces at some places, with the sensor's mass at the response."""
    s, stations, _ = build(p, [response, *hits])
    if p.get("sensor.mass", 0.0):
        s.mass(stations[response], p["sensor.mass"])
    unit = np.eye(s.size)
    return s.poles(unit[:, [2 * stations[hit] for hit in hits]], unit[:, [2 * stations[response]]], MODES)
