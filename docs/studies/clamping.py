"""Clamping of an ER32 collet holder (Matthias et al. 2016): insertion, material, damping, torque and diameter.

W. Matthias, O. Ozsahin, Y. Altintas, B. Denkena, CIRP J. Manuf. Sci. Technol. 2016, doi 10.1016/j.cirpj.2016.02.005.
Torque and diameter are published in tables 1, 4 and 5: laws are fitted to the printed natural frequencies. Insertion
(figures 12, 13), material (figure 15) and damping (figure 6) are printed as figures only. They are VIRTUAL studies of
simulated data, and no value is read off a figure; the claims of the paper are quoted.

Run with `python docs/studies/clamping.py [--resolution HZ] [--seed N] [--json FILE] [--plot FILE]`.
"""

from __future__ import annotations

from typing import Any

import numpy as np

import er32_joints
from clamping_errors import study_damping, study_material
from clamping_insertion import RATIOS, study_insertion
from clamping_laws import PUBLISHED, fit_law, state, study_torque
from clamping_report import CLAIMS, draw, show
from er32_tables import BOUNDS
from output import options, save
from table3_tests import Measuring


def study(resolution: er32_joints.Resolution | None = None, seed: int = 0) -> dict[str, Any]:
    """Return all results.

    Parameters
    ----------
    resolution : Resolution, optional
        Step in which the published frequencies are printed.
    seed : int, optional
        Seed of errors and noise.
    """
    resolution = resolution or er32_joints.Resolution()
    noise = Measuring().noise
    joints = er32_joints.identify_joints(PUBLISHED, resolution, starts=1, seed=seed)
    trends = er32_joints.find_trends(joints, PUBLISHED.torque_nm)
    recommended = [joint for joint in joints if joint["torque_nm"] == PUBLISHED.torque_nm]
    states = [state(joint, resolution, f"{joint['diameter_mm']:g} mm") for joint in recommended]
    laws = [fit_law(states, name, "diameter", 0.0127, reclamped=True) for name in BOUNDS]
    insertion = [study_insertion(ratio, noise, np.random.default_rng([seed, i])) for i, ratio in enumerate(RATIOS)]
    return {
        "study": "clamping",
        "settings": {"seed": seed, "noise": noise, "resolution": resolution, "ratios": RATIOS},
        "claims": [{"about": about, "where": where, "text": text} for about, (where, text) in CLAIMS.items()],
        "insertion": {"virtual": True, "cases": insertion},
        "material": study_material(),
        "damping": study_damping(),
        "torque_range_nm": trends["torque_range_nm"],
        "torque": [study_torque(joints, trends, resolution, mount.diameter_mm) for mount in PUBLISHED.mounts],
        "diameter": [one.row(7.94e-3, 16e-3) for one in laws],
        "diameter_steps": trends["diameter"][0]["steps"],
        "diameter_scatter_percent": trends["diameter"][0]["scatter_percent"],
    }


if __name__ == "__main__":
    parser = options(__doc__)
    parser.add_argument("--resolution", metavar="HZ", type=float, default=1.0, help="step of printed frequencies")
    given = parser.parse_args()
    results = study(er32_joints.Resolution(given.resolution, 10.0 * given.resolution), given.seed)
    show(results)
    save(given.json, results)
    if given.plot:
        draw(results).savefig(given.plot)
