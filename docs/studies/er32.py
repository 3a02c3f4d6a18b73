"""The joint of an ER32 collet holder from printed natural frequencies (Matthias et al. 2016).

W. Matthias, O. Ozsahin, Y. Altintas, B. Denkena, CIRP J. Manuf. Sci. Technol. 2016, doi 10.1016/j.cirpj.2016.02.005.
The joint of every tool at every torque (table 4), its prediction of other overhangs (table 2), the four parameter sets
of table 3, trends over torque and diameter, and the bias of the first mode of the long tools against chance.

Run with `python docs/studies/er32.py [--resolution HZ] [--overhang-error MM] [--draws N] [--seed N] [--json FILE]
[--plot FILE]`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

import er32_figure
import er32_report
from er32_bias import ChanceModel, find_bias, find_slopes, rank_causes, simulate_chance
from er32_joints import (
    SHARED,
    Resolution,
    find_trends,
    follow_joint,
    identify_joints,
    joint_of,
    mode_slopes,
    shared_value,
)
from er32_tables import INFERENCE, SOURCE, ParameterSet, Published, assembly, load, predict_transfers, rms
from output import options, save

AT_BOUNDS = ("carbide density", "nose diameter", "flange length")
"""Quantities that ended at a bound of the fit from which the holder was inferred."""
KNOWN_WITHIN_PERCENT = 10.0
STARTS = 4
REFUTATION = 3.0
"""A mode refutes a parameter set if its error exceeds this multiple of the rms error of the transfers."""


def study(
    resolution: Resolution | None = None, chance: ChanceModel | None = None, *, draws: int = 300, seed: int = 0
) -> dict[str, Any]:
    """Return all results; an open end of an interval is None.

    Parameters
    ----------
    resolution : Resolution, optional
        Steps in which the frequencies are printed. The paper does not state them; its tables look rounded to 1 Hz, and
        to 10 Hz from 10 kHz on.
    chance : ChanceModel, optional
        Definition of chance for the bias of the long tools.
    draws : int, optional
        Draws of the simulation of chance.
    seed : int, optional
        Seed of the starts and of the simulation.
    """
    if draws < 1:
        raise ValueError(f"draws is {draws}, expected at least 1")
    resolution, chance, published = resolution or Resolution(), chance or ChanceModel(), load()
    inferred, covariance = check_inference(published)
    joints = identify_joints(published, resolution, starts=STARTS, seed=seed)
    theirs = predict_transfers(published, {s.diameter_mm: (s.k_y, s.k_theta) for s in published.setups})
    ours = {j["diameter_mm"]: (j["k_y"], j["k_theta"]) for j in joints if j["torque_nm"] == published.torque_nm}
    transfers = predict_transfers(published, ours)
    error = rms([row["error_percent"] for row in transfers])
    slopes = find_slopes(published, joints)
    bias = find_bias(published, transfers, slopes, chance, resolution, covariance)
    bias["simulation"] = simulate_chance(
        published, ours, bias["mean_percent"], chance, resolution, draws=draws, seed=seed
    )
    bias["single_causes"] = rank_causes(published, ours, bias["percent"], slopes, chance)
    bias["overhang_scatter_mm"] = overhang_scatter(published)
    predictions = [
        {
            **{key: row[key] for key in ("diameter_mm", "overhang_mm", "mode", "published_hz", "predicted_hz")},
            "difference_percent": 100.0 * (row["predicted_hz"] / row["published_hz"] - 1.0),
        }
        for row in theirs
    ]
    return {
        "study": "er32",
        "source": SOURCE,
        "settings": {
            "resolution": asdict(resolution),
            "chance": asdict(chance),
            "starts": STARTS,
            "draws": draws,
            "seed": seed,
            "refutation": REFUTATION,
        },
        "seed": seed,
        "inferred": inferred,
        "identified": joints,
        "published_predictions": {
            "rms_percent": rms([row["difference_percent"] for row in predictions]),
            "rows": predictions,
        },
        "transfer": {
            "rms_percent": error,
            "published_rms_percent": rms([row["published_error_percent"] for row in transfers]),
            "rows": transfers,
        },
        "parameter_sets": [judge_set(published, row, REFUTATION * error) for row in published.parameter_sets],
        "trends": find_trends(joints, published.torque_nm),
        "long_first_mode_bias_percent": bias["percent"],
        "long_first_mode_bias_p_value": bias["p_value"],
        "long_first_mode_bias": bias,
        "inconsistencies": find_inconsistencies(published, joints),
    }


def check_inference(published: Published) -> tuple[dict[str, Any], NDArray[np.float64]]:
    """Return residuals and standard errors of the inferred holder, and the covariance of its logarithms.

    Standard errors are linear, with the scatter of the residuals as the error of a frequency. Quantities that ended at
    a bound count as free, so the errors are those from the frequencies alone. `combinations_known` counts the
    principal directions whose standard error is below `known_within_percent`.
    """
    fitted = [name for name in SHARED if not name.startswith("steel ")]
    cases = [(t.diameter_mm, t.overhang_mm, t.predicted_hz) for t in published.transfers]
    cases += [(m.diameter_mm, m.overhang_mm, published.reading(m.diameter_mm).frequency_hz) for m in published.mounts]
    residuals, rows = [], []
    for diameter, overhang, target in cases:
        setup = published.setup(diameter)
        model = assembly(diameter, overhang, setup.k_y, setup.k_theta)
        frequency, slopes, _, _ = mode_slopes(model, range(1, len(target) + 1), fitted)
        residuals.append(np.log(frequency / target))
        rows.append(slopes)
    residual, matrix = np.concatenate(residuals), np.concatenate(rows)
    count, unknowns = matrix.shape
    scatter = float(np.sqrt(np.sum(residual**2) / (count - unknowns)))
    _, singular, directions = np.linalg.svd(matrix, full_matrices=False)
    errors = scatter * directions / singular[:, None]
    covariance = errors.T @ errors
    quantities = []
    for name, error in zip(fitted, np.sqrt(np.diag(covariance)).tolist(), strict=True):
        value, unit = shared_value(name)
        quantities.append(
            {
                "name": name,
                "value": value,
                "unit": unit,
                "standard_error_percent": 100.0 * error,
                "at_bound": name in AT_BOUNDS,
            }
        )
    document = {
        "what": "shape of the holder, modulus and density of the carbide",
        "how": INFERENCE,
        "frequencies": count,
        "rms_percent": 100.0 * rms(np.expm1(residual).tolist()),
        "quantities": quantities,
        "combinations_known": int(np.sum(100.0 * scatter / singular < KNOWN_WITHIN_PERCENT)),
        "known_within_percent": KNOWN_WITHIN_PERCENT,
        "singular_values": singular.tolist(),
    }
    return document, covariance


def judge_set(published: Published, chosen: ParameterSet, threshold_percent: float) -> dict[str, Any]:
    """Return the errors of a set of table 3 at all measured overhangs of its tool, the longest first."""
    measured: dict[float, tuple[float, ...]] = {
        t.overhang_mm: t.measured_hz for t in published.transfers if t.diameter_mm == chosen.diameter_mm
    }
    measured[published.mount(chosen.diameter_mm).overhang_mm] = published.reading(chosen.diameter_mm).frequency_hz
    errors = []
    for overhang in sorted(measured, reverse=True):
        frequencies = measured[overhang]
        model = assembly(chosen.diameter_mm, overhang, chosen.k_y, chosen.k_theta)
        lowest = model.lowest_natural_frequencies(len(frequencies))[0].tolist()
        errors += [
            {
                "overhang_mm": overhang,
                "mode": mode,
                "measured_hz": value,
                "predicted_hz": predicted,
                "error_percent": 100.0 * (predicted / value - 1.0),
            }
            for mode, (value, predicted) in enumerate(zip(frequencies, lowest, strict=True), 1)
        ]
    refuted_by = [error for error in errors if abs(error["error_percent"]) > threshold_percent]
    worst = max(errors, key=lambda error: abs(error["error_percent"]))
    return {
        "set": chosen.name,
        "k_y": chosen.k_y,
        "k_theta": chosen.k_theta,
        "worst_error_percent": worst["error_percent"],
        "worst": worst,
        "threshold_percent": threshold_percent,
        "refuted": bool(refuted_by),
        "refuted_by": refuted_by,
        "first_refutation": next(iter(refuted_by), None),
        # A joint is usually matched to the first mode of a long tool.
        "first_refutation_of_first_mode": next((error for error in refuted_by if error["mode"] == 1), None),
        "errors": errors,
    }


def find_inconsistencies(published: Published, joints: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Return numbers that the paper prints twice and differently, with the effect on the joint where it is known."""
    inconsistencies = []

    def add(what: str, diameter: float, unit: str, first: float, where: str, second: float, elsewhere: str) -> None:
        entry: dict[str, Any] = {"what": what, "diameter_mm": diameter, "unit": unit, "first": first}
        entry |= {"first_source": where, "second": second, "second_source": elsewhere}
        inconsistencies.append({**entry, "k_y_change_percent": None, "k_theta_change_percent": None})

    for printed in published.text:
        setup = published.setup(printed.diameter_mm)
        for what, unit in (("k_y", "N/m"), ("k_theta", "N m/rad")):
            first, second = getattr(printed, what), getattr(setup, what)
            if first != second:
                add(what, printed.diameter_mm, unit, first, printed.where, second, "tables 4 and 5")
    for diameter, first, source, second in overhangs(published):
        if first == second:
            continue
        add("overhang", diameter, "mm", first, source, second, "table 5")
        if source == "table 1":
            joint = joint_of(joints, diameter, published.torque_nm)
            other = assembly(diameter, second, joint["k_y"], joint["k_theta"])
            followed = follow_joint(other, published.reading(diameter).frequency_hz).tolist()
            for name, value in zip(("k_y", "k_theta"), followed, strict=True):
                inconsistencies[-1][f"{name}_change_percent"] = 100.0 * (value / joint[name] - 1.0)
    return inconsistencies


def overhang_scatter(published: Published) -> float:
    """Return the standard deviation in mm of a printed overhang, from those printed twice."""
    differences = np.array([second - first for _, first, _, second in overhangs(published)])
    return float(np.sqrt(np.mean(differences**2) / 2.0))


def overhangs(published: Published) -> list[tuple[float, float, str, float]]:
    """Return overhangs printed twice: diameter, value in table 1 or 2, name of that table, value in table 5."""
    pairs = [
        (s.diameter_mm, published.mount(s.diameter_mm).overhang_mm, "table 1", s.overhang_medium_mm)
        for s in published.setups
    ]
    for transfer in published.long_tools:
        long = published.setup(transfer.diameter_mm).overhang_long_mm
        if long is not None:
            pairs.append((transfer.diameter_mm, transfer.overhang_mm, "table 2", long))
    return pairs


if __name__ == "__main__":
    parser = options(__doc__)
    parser.add_argument("--resolution", metavar="HZ", type=float, default=1.0, help="ten times that from 10 kHz on")
    parser.add_argument("--overhang-error", metavar="MM", type=float, default=0.1, help="standard deviation")
    parser.add_argument("--draws", metavar="N", type=int, default=300, help="simulations of the chance model")
    given = parser.parse_args()
    results = study(
        Resolution(given.resolution, 10.0 * given.resolution),
        ChanceModel(overhang_mm=given.overhang_error),
        draws=given.draws,
        seed=given.seed,
    )
    er32_report.show(results)
    save(given.json, results)
    if given.plot:
        er32_figure.draw(results).savefig(given.plot)
