"""Inverse coupling of receptances from a reference of fifty digits."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from oracle import exact
from oracle.tables import joint, make, segment
from receptance import Assembly, Coordinate, Material, Observation, Part, PointJoint, Segment, identify
from receptance.coupling import invert_coupling
from simulated_campaigns import BOUNDS, simulate_campaign

SEED = 20261122
CAMPAIGNS = 5
CARBIDE, STEEL = (580e9, 14500.0, 0.24), (205e9, 7850.0, 0.29)
LOSSES = (0.001, 0.003)
SPRING = (4.1e8, 6.3e4, 1.7e6, 300.0, 0.09, 1.2)
"""k_y, k_theta, k_ytheta, c_y, c_theta, c_ytheta."""
LINES_HZ = np.array([180.0, 640.0, 1730.0, 3200.0, 5900.0, 9400.0])
TIP, NOSE = (0, 0), (2, 0)
PLACES = {TIP: Coordinate("tool", 0.0), NOSE: Coordinate("holder", 0.0)}


def make_model() -> Assembly:
    """Return the assembly with wrong values of all joint parameters."""
    carbide, steel = (
        Material(youngs_modulus=e, density=rho, poisson_ratio=nu, loss_factor=loss)
        for (e, rho, nu), loss in zip((CARBIDE, STEEL), LOSSES, strict=True)
    )
    tool = Part([Segment(length=0.062, outer_diameter=0.012, material=carbide)], name="tool")
    sections = [Segment(length=length, outer_diameter=d, material=steel) for length, d in ((0.05, 0.035), (0.07, 0.05))]
    return Assembly([tool, PointJoint(k_y=1e10, k_theta=1e7, name="joint"), Part(sections, name="holder")])


def test_reference_joint_is_recovered() -> None:
    tables = make(
        [
            segment(0, 1, 0.062, 0.012, CARBIDE, loss_factor=LOSSES[0]),
            segment(2, 3, 0.05, 0.035, STEEL, loss_factor=LOSSES[1]),
            segment(3, 4, 0.07, 0.05, STEEL, loss_factor=LOSSES[1]),
        ],
        [joint(1, 2, *SPRING[:3], c=SPRING[3:])],
    )
    points = list(PLACES)
    w = 2.0 * np.pi * LINES_HZ
    h = exact.receptance_complex128(tables, w, points, points)
    pairs = [(0, 0), (1, 0), (1, 1)]
    found = invert_coupling([
        Observation(
            assembly=make_model(),
            frequency_hz=LINES_HZ,
            receptance=h[:, r, e],
            response=PLACES[points[r]],
            excitation=PLACES[points[e]],
            standard_deviation=1e-6,
        )
        for r, e in pairs
    ])  # fmt: skip
    k = np.array([[SPRING[0], SPRING[2]], [SPRING[2], SPRING[1]]])
    c = np.array([[SPRING[3], SPRING[5]], [SPRING[5], SPRING[4]]])
    true = k + 1j * w[:, None, None] * c
    size = np.sqrt(np.abs(np.einsum("nii->ni", true)))
    off = np.abs(found.stiffness - true) / (size[:, :, None] * size[:, None, :])
    # Errors of the core and the reference, times the condition number.
    assert np.all(off <= 1e-12 * found.condition[:, None, None]), off / found.condition[:, None, None]
    assert off.max() < 1e-8


@pytest.mark.slow
def test_one_start_converges_to_the_optimum(summarise: Callable[[str, str, object], None]) -> None:
    """Three tips, the errors of all parts unknown to the inversion: the fit ends where that from the truth does."""
    rows = []
    for number in range(CAMPAIGNS):
        campaign = simulate_campaign(np.random.default_rng([SEED, number]), overhangs=3)
        found = invert_coupling(campaign.observations)
        start = {name: float(np.clip(value, *BOUNDS[name])) for name, value in found.start().items() if name in BOUNDS}
        most = 0.99 * np.sqrt(start["joint.k_y"] * start["joint.k_theta"])
        start["joint.k_ytheta"] = float(np.clip(start["joint.k_ytheta"], -most, most))
        ends = [
            identify(campaign.observations, campaign.unknowns(given), tolerances=campaign.tolerances, starts=1).rms
            for given in (start, {name: campaign.truth[name] for name in BOUNDS})
        ]
        rows.append((found.rms, ends[0] <= ends[1] * (1.0 + 1e-4)))
    reached = sum(good for _, good in rows)
    text = f"one start from inverse coupling reached the optimum in {reached} of {CAMPAIGNS} campaigns, seed {SEED}"
    summarise("inverse coupling", text, {"reached": reached, "of": CAMPAIGNS})
    print(text, rows)
    assert reached >= CAMPAIGNS - 1
    # A fit that ends elsewhere has a note.
    assert all(good or rms > 3.0 for rms, good in rows)
