"""VIRTUAL: high-speed steel against carbide with one and the same joint: what a fit takes for a change of the joint.

The inserted shank is a part of the holder's nose. Who reuses the nose of the carbide blank for a blank of steel puts
the difference into the joint, and so do a modulus, a density or an overhang that are a little off.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from receptance.assembly import Assembly
from receptance.beams import Part, Segment
from receptance.materials import Material
from receptance.studies.er32.holder import HolderModel
from receptance.studies.er32.joints import follow_joint
from receptance.studies.er32.tables import Published

__all__ = ["HSS", "ApparentChange", "MaterialStudy", "study_material"]

HSS = Material(youngs_modulus=2.25e11, density=8100.0, poisson_ratio=0.3, name="high-speed steel")
"""Assumed: high-speed steels have 200 to 235 GPa and 7,900 to 8,700 kg/m3."""
SLIPS = (
    ("shank of carbide in the nose", "nose", 1.0),
    ("modulus 3 % high", "youngs_modulus", 1.03),
    ("density 1 % high", "density", 1.01),
    ("overhang 0.1 mm long", "length", 1e-4),
    ("first frequency 0.1 % high", "reading", 1.001),
)
"""What is wrong in the model of the blank of steel, one at a time."""
CLAIMED_SHARE = 0.45
"""The paper: except for the 12.7 mm tool each difference of the rotational stiffness is over this."""
_FARTHEST = 0.3


@dataclass(frozen=True, kw_only=True)
class ApparentChange:
    """What one slip makes of the joint of one tool, with the same true joint for both materials."""

    diameter_mm: float
    slip: str
    k_y_percent: float
    k_theta_percent: float


@dataclass(frozen=True, kw_only=True)
class MaterialStudy:
    """All tools and slips.

    `control_percent` is the largest change without any slip, which should be none; `modulus_percent` the smallest error
    of the steel's modulus, by diameter in mm, that alone would change the identified k_theta by as much as is claimed.
    """

    changes: tuple[ApparentChange, ...]
    control_percent: float
    material: Material
    modulus_percent: dict[float, float]

    def largest(self, quantity: str) -> ApparentChange:
        """Return the largest apparent change of a stiffness."""
        return max(self.changes, key=lambda one: abs(getattr(one, f"{quantity}_percent")))


def study_material(holder: HolderModel, published: Published, *, say: Callable[[str], None]) -> MaterialStudy:
    """Simulate blanks of high-speed steel and identify their joints from two natural frequencies, as the paper does.

    The joints are those of table 5; frequencies are exact, so what is found is the slip's doing alone.
    """
    changes, control, needed = [], 0.0, {}
    for setup in published.machine:
        say(f"material: {setup.diameter_mm:g} mm")
        mount = published.mount(setup.diameter_mm)
        bare = holder.assembly(mount.diameter_mm, mount.overhang_mm, mount.holder_length_mm, setup.k_y, setup.k_theta)
        true = _with_shank(bare, blank=HSS, shank=HSS, inserted_by=holder.carbide)
        frequency = true.lowest_natural_frequencies(2)[0]
        for slip, what, size in (("none", "", 1.0), *SLIPS):
            model, read = _slipped(true, bare, holder.carbide, frequency, what, size)
            found = follow_joint(model, read)
            percent = 100.0 * (found / np.array([setup.k_y, setup.k_theta]) - 1.0)
            if slip == "none":
                control = max(control, float(np.abs(percent).max()))
                continue
            changes.append(
                ApparentChange(
                    diameter_mm=setup.diameter_mm,
                    slip=slip,
                    k_y_percent=float(percent[0]),
                    k_theta_percent=float(percent[1]),
                )
            )
        needed[setup.diameter_mm] = _needed_modulus(true, frequency, setup.k_theta)
    return MaterialStudy(changes=tuple(changes), control_percent=control, material=HSS, modulus_percent=needed)


def _needed_modulus(true: Assembly, frequency: np.ndarray, k_theta: float) -> float:
    """Return the least error of the modulus in percent, to either side, that changes k_theta by what is claimed."""
    address = "tool.segment[0].youngs_modulus"
    modulus, ends = true.get(address), []
    for side in (-1.0, 1.0):
        low, high = 0.0, _FARTHEST
        for _ in range(12):
            middle = 0.5 * (low + high)
            found = follow_joint(true.replace({address: modulus * (1.0 + side * middle)}), frequency)[1]
            low, high = (low, middle) if abs(found / k_theta - 1.0) >= CLAIMED_SHARE else (middle, high)
        ends.append(100.0 * side * high)
    return min(ends, key=abs)


def _slipped(
    true: Assembly, bare: Assembly, carbide: Material, frequency: np.ndarray, what: str, size: float
) -> tuple[Assembly, np.ndarray]:
    if what == "nose":
        return _with_shank(bare, blank=HSS, shank=carbide, inserted_by=carbide), frequency
    if what == "reading":
        return true, frequency * [size, 1.0]
    if what == "length":
        address = "tool.segment[0].length"
        return true.replace({address: true.get(address) + size}), frequency
    if what:
        address = f"tool.segment[0].{what}"
        return true.replace({address: true.get(address) * size}), frequency
    return true, frequency


def _with_shank(bare: Assembly, *, blank: Material, shank: Material, inserted_by: Material) -> Assembly:
    """Return the assembly with another blank, and another material in the bore of the nose.

    The inferred nose stands for collet, nut and the carbide shank together. What is around the shank is what is left of
    its bending stiffness and mass when those of the shank are taken off.
    """
    row = bare.elements
    tool, holder = row["tool"], row["holder"]
    assert isinstance(tool, Part)
    assert isinstance(holder, Part)
    nose = holder.segments[0]
    bore, outer = tool.segments[0].outer_diameter, nose.outer_diameter
    fourth, second = (bore / outer) ** 4, (bore / outer) ** 2
    around = replace(
        nose.material,
        youngs_modulus=(nose.material.youngs_modulus - inserted_by.youngs_modulus * fourth) / (1.0 - fourth),
        density=(nose.material.density - inserted_by.density * second) / (1.0 - second),
    )
    filled = Segment(length=nose.length, outer_diameter=outer, inner_diameter=bore, material=around, core=shank)
    parts = [
        Part([replace(tool.segments[0], material=blank)], name="tool"),
        row["joint"],
        Part([filled, *holder.segments[1:]], name="holder"),
    ]
    return Assembly(parts)
