"""What looks like a change of the joint: errors in the model of a steel blank, and neglected damping. VIRTUAL."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from scipy.optimize import brentq

import er32_joints
import er32_tables
import receptance as rc
import table3_tests
from er32_tables import E_TOOL, LENGTH

PUBLISHED = er32_tables.load()

# ---- High-speed steel against carbide with one joint


HSS = rc.Material(youngs_modulus=2.25e11, density=8100.0, poisson_ratio=0.3, name="high-speed steel")
"""Assumed: high-speed steels have 200 to 235 GPa and 7,900 to 8,700 kg/m3."""
CLAIMED_SHARE = 0.45
ERRORS: dict[str, dict[str, float | None]] = {
    "shank of carbide in the nose": {},
    "modulus 3 % high": {E_TOOL: 1.03},
    "density 1 % high": {"tool.segment[0].density": 1.01},
    "overhang 0.1 mm long": {LENGTH: None},
    "first frequency 0.1 % high": {},
}
"""Errors of the model of the steel blank, one at a time, with the factors of its parameters; None adds 0.1 mm."""


def with_shank(own: rc.Assembly, shank: rc.Material) -> rc.Assembly:
    """Return the assembly with a blank of high-speed steel and a shank in the bore of the nose.

    The inferred nose represents collet, nut and carbide shank together. Without bending stiffness and mass of the
    carbide shank it is a ring around the bore.
    """
    tool, joint, holder = own.elements.values()
    assert isinstance(tool, rc.Part)
    assert isinstance(holder, rc.Part)
    nose, carbide = holder.segments[0], tool.segments[0].material
    bore = tool.segments[0].outer_diameter
    fourth, second = (bore / nose.outer_diameter) ** 4, (bore / nose.outer_diameter) ** 2
    ring = replace(
        nose.material,
        youngs_modulus=(nose.material.youngs_modulus - carbide.youngs_modulus * fourth) / (1.0 - fourth),
        density=(nose.material.density - carbide.density * second) / (1.0 - second),
    )
    filled = replace(nose, inner_diameter=bore, material=ring, core=shank)
    blank = rc.Part([replace(tool.segments[0], material=HSS)], name="tool")
    return rc.Assembly([blank, joint, rc.Part([filled, *holder.segments[1:]], name="holder")])


def study_material() -> dict[str, Any]:
    """Identify the joints of steel blanks from two exact natural frequencies, with one error of the model each."""
    changes, control, needed = [], 0.0, {}
    carbide = er32_tables.parts()[0].segments[0].material
    for setup in PUBLISHED.setups:
        joint = np.array([setup.k_y, setup.k_theta])
        bare = er32_tables.assembly(setup.diameter_mm, PUBLISHED.mount(setup.diameter_mm).overhang_mm, *joint.tolist())
        true = with_shank(bare, HSS)
        frequency = true.lowest_natural_frequencies(2)[0]
        control = max(control, float(np.max(np.abs(100.0 * (er32_joints.follow_joint(true, frequency) / joint - 1.0)))))
        for name, factors in ERRORS.items():
            model = with_shank(bare, carbide) if name.startswith("shank") else true
            model = model.replace(
                {a: model.get(a) + 1e-4 if factor is None else model.get(a) * factor for a, factor in factors.items()}
            )
            read = frequency * [1.001 if name.startswith("first") else 1.0, 1.0]
            k_y, k_theta = (100.0 * (er32_joints.follow_joint(model, read) / joint - 1.0)).tolist()
            changes.append(
                {"diameter_mm": setup.diameter_mm, "slip": name, "k_y_percent": k_y, "k_theta_percent": k_theta}
            )
        needed[f"{setup.diameter_mm:g} mm"] = needed_modulus(true, frequency, setup.k_theta)
    return {"virtual": True, "control_percent": control, "changes": changes, "modulus_percent": needed}


def needed_modulus(true: rc.Assembly, frequency: np.ndarray, k_theta: float) -> float:
    """Return the smallest error of the modulus in percent that alone changes k_theta by the claimed share."""

    def missing(error: float) -> float:
        moved = true.replace({E_TOOL: true.get(E_TOOL) * (1.0 + error)})
        return abs(er32_joints.follow_joint(moved, frequency)[1] / k_theta - 1.0) - CLAIMED_SHARE

    ends = [100.0 * brentq(missing, 0.0, side, xtol=1e-6) for side in (-0.3, 0.3) if missing(side) >= 0.0]
    return min(ends, key=abs)


# ---- Damping at the interface neglected; the limit of stability goes with the least real part

FACTORS = (1.0, 3.0, 10.0, 30.0)
WORTH_PERCENT = 10.0
"""Error of the least real part that matters for the limit of stability."""
LARGEST_FACTOR = 1e3


def extremes(overhang_mm: float, free: bool, factor: float) -> np.ndarray:
    """Return the highest magnitude and the size of the least real part of the tip response."""
    own = table3_tests.assembly(overhang_mm, free=free)
    own = own.replace({name: factor * table3_tests.TRUTH[name] for name in ("joint.c_y", "joint.c_theta")})
    low, high = table3_tests.BANDS_HZ[free]
    # Lines close to every mode contain the extremes for any damping.
    near = np.concatenate([[0.0], np.geomspace(1e-4, 0.05, 60)])
    close = [f * (1.0 + s * near) for f in own.natural_frequencies(high) for s in (-1.0, 1.0)]
    lines = np.unique(np.concatenate([np.linspace(low, high, 6000), *close]))
    response = own.receptance(lines[(lines >= low) & (lines <= high)])
    return np.array([np.abs(response).max(), -response.real.min()])


def error_without_damping(overhang_mm: float, free: bool, factor: float) -> list[float]:
    """Return by how many percent peak and least real part are too large if the damping is neglected."""
    error: list[float] = (
        100.0 * (extremes(overhang_mm, free, 0.0) / extremes(overhang_mm, free, factor) - 1.0)
    ).tolist()
    return error


def study_damping() -> dict[str, Any]:
    """Compare tip responses with and without damping at the interface."""
    cases, allowed = [], {}
    for overhang in table3_tests.OVERHANGS_MM[:2]:
        for free in (False, True):
            test = f"{'free-free' if free else 'in the machine'}, {overhang:g} mm"
            for factor in FACTORS:
                peak, real = error_without_damping(overhang, free, factor)
                cases.append({"test": test, "factor": factor, "peak_percent": peak, "real_percent": real})

            def excess(logarithm: float, overhang: float = overhang, free: bool = free) -> float:
                return abs(error_without_damping(overhang, free, float(np.exp(logarithm)))[1]) - WORTH_PERCENT

            ends = (np.log(1e-4), np.log(LARGEST_FACTOR))
            allowed[test] = float(np.exp(brentq(excess, *ends, xtol=1e-7))) if excess(ends[1]) > 0.0 else float("inf")
    return {"virtual": True, "cases": cases, "allowed_factor": allowed}
