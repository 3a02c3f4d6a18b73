"""A taper joint over drawbar force: the procedure of Xu et al. 2012 on a virtual rig, and its errors. VIRTUAL.

C. Xu, J. Zhang, Z. Wu, D. Yu, P. Feng, Dynamic modeling and parameters identification of a spindle-holder taper joint,
Springer-Verlag London, published online 10 November 2012. The paper prints no FRFs and no dimensions. The rig is an
elastic BT50 holder by finite elements that are independent of the library. The script identifies the joint at every
force with the rigid holder of the paper and with an elastic one, predicts levels that are left out, compares estimates
of the damping, and diagnoses the rigid holder (the model of the packaged campaign `bt50`).

Run with `python docs/studies/bt50.py [--step KN] [--seed N] [--json FILE] [--plot FILE]`.
"""

from __future__ import annotations

import tempfile
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm

import bt50_figure
import bt50_report
from bt50_levels import axial_hz, axial_level, radial_hz, radial_level
from bt50_report import PROVENANCE, RESPONSE_HZ, SOURCE
from output import options, save
from receptance.campaign import Campaign
from receptance.coupling import ForceSeries, Holder, fit_laws
from receptance.examples import EXAMPLES, virtual_rig
from receptance.examples.simulated import taper_files
from receptance.examples.virtual_rig import DECAY_RATE, HITS, SAMPLE_RATE_HZ, SPACING_HZ, VirtualRig, load_rig

PUBLISHED: dict[str, Any] = {
    "forces_kn": [0.0, 25.0],
    "sample_rate_hz": 20480.0,
    "spacing_hz": 20.0,
    "impacts": 10,
    "axial_stiffness_n_per_m": [4.8e9, 5.0e9],
    "axial_damping_ns_per_m": [1000.0, 2000.0],
    "unstable_above_kn": 10.0,
    "simulated_below_experiment_percent": 10.0,
}
"""Statements of the paper in its text (sections 4 to 6); values in its figures are not read off."""
MOTIONS = ("axial", "radial")
SHOWN_KN = 20.0
"""Force of the paper's figure 9."""
SAME = 0.05
"""Relative difference up to which two magnitudes are equal."""


def study(step_kn: int = 1, seed: int = 0) -> dict[str, Any]:
    """Measure the virtual rig at all forces, identify, predict the levels that were left out, and diagnose.

    Parameters
    ----------
    step_kn : int, optional
        Step of the drawbar force from 0 to 25 kN: 1 as in the paper, or 2.
    seed : int, optional
        Seed of hits and noise.
    """
    holder = virtual_rig.holder()
    rows: dict[str, list[dict[str, Any]]] = {motion: [] for motion in MOTIONS}
    for rig, level_seed in measured_levels(step_kn, seed):
        previous = rows[rig.motion][-1]["elastic"]["values"] if rows[rig.motion] else None
        identify = axial_level if rig.motion == "axial" else radial_level
        rows[rig.motion].append(identify(holder, rig, level_seed, previous))
    series = series_over_force(rows["axial"], rows["radial"])
    shown = int(np.argmin([abs(level["force_kn"] - SHOWN_KN) for level in rows["axial"]]))
    bonded = holder.bonded("axial").get("taper.k_y")
    return {
        "study": "bt50",
        "source": SOURCE,
        "provenance": PROVENANCE,
        "settings": {
            "step_kn": step_kn,
            "seed": seed,
            "sample_rate_hz": SAMPLE_RATE_HZ,
            "spacing_hz": SPACING_HZ,
            "hits": HITS,
            "exponential_window_per_s": DECAY_RATE,
        },
        "published": PUBLISHED,
        "virtual": {
            "holder": {**asdict(holder.body), "z1": holder.z1, "z2": holder.z2},
            **rows,
            "trends": {name: parameter.data() for name, parameter in series.items()},
            "damping_errors": damping_errors(rows["axial"]),
            "bonded_hz": {"axial": axial_hz(holder, bonded), "radial": radial_hz(holder, bonded, bonded)},
            "left_out": left_out(holder, rows["axial"][1::2], rows["radial"][1::2], series),
            "diagnosis": [diagnose_rigid(motion, step_kn, seed) for motion in MOTIONS],
            "damping_matters_hz": {
                motion: bands_with_damping(motion, levels[shown]["elastic"]["values"])
                for motion, levels in rows.items()
            },
        },
        "_series": series,
    }


def measured_levels(step_kn: int, seed: int) -> list[tuple[VirtualRig, int]]:
    """Return the rig at all levels with the seed of each measurement."""
    if step_kn not in (1, 2):
        raise ValueError(f"the step is {step_kn} kN, expected 1 or 2: laws need six levels, and as many between")
    return [
        (rig, int(np.random.SeedSequence([seed, number]).generate_state(1)[0]))
        for number, rig in enumerate(load_rig())
        if round(rig.force_kn) % step_kn == 0
    ]


def series_over_force(axial: Sequence[dict[str, Any]], radial: Sequence[dict[str, Any]]) -> dict[str, ForceSeries]:
    """Return every parameter over force; residuals above the noise increase the standard errors."""
    force = np.array([level["force_kn"] for level in axial])
    width = 2.0 * float(norm.ppf(0.975))
    columns = {}
    for title, key in (("rigid", "rigid"), ("half-power", "rigid_half_power")):
        for name in ("k_z1", "c_z1"):
            errors = [np.ptp(level[key]["intervals"][name]) / width for level in axial]
            columns[f"{title} {name}"] = ([level[key]["values"][name] for level in axial], errors)
    for levels in (axial, radial):
        fits = [level["elastic"] for level in levels]
        for name in fits[0]["values"]:
            errors = [fit["errors"][name] * max(fit["rms"], 1.0) for fit in fits]
            columns[f"elastic {name}"] = ([fit["values"][name] for fit in fits], errors)
    return {
        name: ForceSeries(name=name, force=force, values=np.array(values), standard_errors=np.array(errors))
        for name, (values, errors) in columns.items()
    }


def law_between(series: ForceSeries) -> list[float]:
    """Return the values at every second level from the law of the others."""
    laws = fit_laws(series.force[::2], series.values[::2], series.standard_errors[::2])
    return list(min(laws, key=lambda law: law.criterion).at(series.force[1::2]))


def left_out(
    holder: Holder,
    axial: Sequence[dict[str, Any]],
    radial: Sequence[dict[str, Any]],
    series: Mapping[str, ForceSeries],
) -> list[dict[str, Any]]:
    """Return the errors of natural frequencies at levels that were left out, from laws of the others."""
    rigid, elastic = (
        [axial_hz(holder, k) for k in law_between(series[f"{model} k_z1"])] for model in ("rigid", "elastic")
    )
    springs = zip(*(law_between(series[f"elastic {name}"]) for name in ("k_x1", "k_x2")), strict=True)
    # The rigid holder has the springs of the level itself, its best case; a level without a rigid joint has none.
    best_case = [tuple(level["simulated_hz"]) for level in radial]
    return [
        frequency_errors("axial", axial, rigid, elastic),
        frequency_errors("radial", radial, best_case, [radial_hz(holder, *k) for k in springs]),
    ]


def frequency_errors(
    motion: str,
    levels: Sequence[dict[str, Any]],
    rigid: Iterable[tuple[float, ...]],
    elastic: Iterable[tuple[float, ...]],
) -> dict[str, Any]:
    """Return the errors of predicted natural frequencies, with springs of the rigid and of the elastic holder."""

    def errors(predicted: Iterable[tuple[float, ...]]) -> list[list[float]]:
        return [
            (100.0 * (np.array(frequencies) / level["experiment_hz"] - 1.0)).tolist()
            for frequencies, level in zip(predicted, levels, strict=True)
            if frequencies
        ]

    before, after = errors(rigid), errors(elastic)
    return {
        "motion": motion,
        "force_kn": [level["force_kn"] for level in levels],
        "rigid_percent": before,
        "elastic_percent": after,
        "before_rms_percent": float(np.sqrt(np.mean(np.square(before)))),
        "after_rms_percent": float(np.sqrt(np.mean(np.square(after)))),
    }


def damping_errors(axial: Sequence[dict[str, Any]]) -> dict[str, dict[str, float]]:
    """Return mean and scatter of the relative error of the axial damping ratio in percent.

    At all forces, and at those at which the paper calls its damping unstable.
    """
    high = np.array([level["force_kn"] for level in axial]) > PUBLISHED["unstable_above_kn"]
    errors = {}
    for name in ("half_power", "circle"):
        ratio = [level[name]["damping_ratio"] / level["truth"]["damping_ratio"] for level in axial]
        error = 100.0 * (np.array(ratio) - 1.0)
        errors[name] = {
            "mean_percent": float(error.mean()),
            "scatter_percent": float(error.std()),
            "mean_above_percent": float(error[high].mean()),
            "scatter_above_percent": float(error[high].std()),
        }
    return errors


def response_without_damping(
    motion: str, values: Mapping[str, float]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return frequencies in Hz and the magnitude at the tip with and without damping, `(n,)` each."""
    holder, lines = virtual_rig.holder(), np.arange(RESPONSE_HZ[0], RESPONSE_HZ[1] + 2.5, 5.0)
    stiffness = [value for name, value in values.items() if name[0] == "k"]
    damping = [value for name, value in values.items() if name[0] == "c"]

    def magnitude(damping: Sequence[float]) -> NDArray[np.float64]:
        if motion == "axial":
            return np.abs(holder.axial(*stiffness, *damping).receptance(lines))
        return np.abs(holder.radial(*stiffness, *damping, contact="fading").receptance(lines))

    return lines, magnitude(damping), magnitude([])


def bands_with_damping(motion: str, values: Mapping[str, float]) -> list[list[float]]:
    """Return the bands in Hz in which the response without damping is wrong."""
    lines, damped, undamped = response_without_damping(motion, values)
    differs = np.abs(undamped / damped - 1.0) > SAME
    edges = np.flatnonzero(np.diff(np.concatenate([[0], differs.astype(int), [0]])))
    return [[float(lines[a]), float(lines[b - 1])] for a, b in zip(edges[::2], edges[1::2], strict=True)]


def rigid_campaign(motion: str, step_kn: int, seed: int, *, levels: int = 3) -> Campaign:
    """Return the packaged campaign `bt50` with the FRFs of this study.

    A few forces, evenly spaced from the lowest on, are for identification; those between are held out.

    Parameters
    ----------
    motion : {"axial", "radial", "both"}
        Motions of the campaign.
    step_kn, seed : int
        As in `study`.
    levels : int, optional
        Number of forces for identification.
    """
    motions = MOTIONS if motion == "both" else (motion,)
    measured = [(rig, level_seed) for rig, level_seed in measured_levels(step_kn, seed) if rig.motion in motions]
    forces = sorted({rig.force_kn for rig, _ in measured})
    identified = forces[:: (len(forces) - 1) // (levels - 1)][:levels]
    forces = [force for force in forces if force <= identified[-1]]  # levels above the last one are not predicted
    data = tomllib.loads(EXAMPLES["bt50"].campaign)
    data["series"]["levels"] = [f"{force:g} kN" for force in forces]
    data["series"]["hold_out"] = [f"{force:g} kN" for force in forces if force not in identified]
    for section in ("assemblies", "measurements"):
        data[section] = {name: table for name, table in data[section].items() if name.startswith(motions)}
    springs = {spring for table in data["assemblies"].values() for spring in table["attachments"]}
    data["unknowns"] = {name: table for name, table in data["unknowns"].items() if name.partition(".")[0] in springs}
    with tempfile.TemporaryDirectory() as folder:
        for name, content in taper_files(pair for pair in measured if pair[0].force_kn in forces).items():
            Path(folder, name).write_bytes(content)
        return Campaign.from_contents(Path(folder, "campaign.toml"), data)


def diagnose_rigid(motion: str, step_kn: int, seed: int) -> dict[str, Any]:
    """Return the verdict on the rigid holder, with the improvement at the forces that are held out."""
    campaign = rigid_campaign(motion, step_kn, seed)
    verdict = campaign.diagnose()
    forces = [
        [1e-3 * measurement.conditions["drawbar force"] for measurement in measurements.values()]
        for measurements in (campaign.to_identify, campaign.held_out)
    ]
    return {
        "motion": motion,
        "model": "rigid holder",
        "seen_kn": list(dict.fromkeys(forces[0])),
        "left_out_kn": list(dict.fromkeys(forces[1])),
        "in_every_explanation": [cause.id for cause in verdict.causes if cause.id not in verdict.ambiguous_between],
        **verdict.to_dict(),
    }


if __name__ == "__main__":
    parser = options(__doc__)
    parser.add_argument("--step", metavar="KN", type=int, default=1, help="step of the drawbar force, 1 or 2")
    given = parser.parse_args()
    results = study(given.step, given.seed)
    bt50_report.show(results)
    save(given.json, results)
    if given.plot:
        bt50_figure.draw(results).savefig(given.plot)
