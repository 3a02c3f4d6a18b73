"""Case studies 1 and 2 of Matthias et al. 2016: tools in two machines. VIRTUAL.

W. Matthias, O. Ozsahin, Y. Altintas, B. Denkena, CIRP J. Manuf. Sci. Technol. 2016, doi 10.1016/j.cirpj.2016.02.005.
The paper prints neither its spindles nor the measured responses. Both spindles are invented and their hammer tests
simulated; tools, overhangs and joints are those of table 5, the first holder is inferred, the second is another of the
same kind. Prediction and truth share holder and joint, so only the identified spindle is tested. Agreement with the
paper is no evidence.

The script identifies each spindle from hits on a gauge blank, predicts the tip responses of the tools of table 5, shows
how far up the spindle is known (short tools), and moves one mode of the spindle, which `diagnose` has to name.

Run with `python docs/studies/machines.py [--hits N] [--seed N] [--json FILE] [--plot FILE]`.
"""

from __future__ import annotations

from dataclasses import asdict
from typing import Any

import numpy as np
from scipy.signal import find_peaks

import receptance as rc
from machines_report import draw, show
from machines_rig import BAND_HZ, MACHINES, Machine, Tool, tools
from output import options, save
from receptance.coupling import SpindleModes, SpindleReceptance, fit_spindle, identify_spindle
from receptance.diagnosis import Verdict, diagnose
from receptance.fit import Tolerance

REACH_HZ = 9000.0
"""Upper end of the band in which the usable lines of the spindle are counted."""
MOVED_PERCENT = -3.0
"""Error of the mode of a spindle in the last part."""
CAUSES = (
    "spindle_mode",
    "joint_cross_term",
    "joint_spread",
    "collet_mass",
    "overhang_error",
    "tool_modulus",
    "tool_density",
    "holder_modulus",
    "holder_inertia",
    "calibration_gain",
)
"""Causes that are compared; the command `diagnose` takes the whole catalogue."""


def peaks_of(size: np.ndarray) -> np.ndarray:
    """Return the indices of peaks that stand out by 30 % and exceed a fifth of the highest one."""
    found, _ = find_peaks(np.log(size), prominence=np.log(1.3))
    return found[size[found] > 0.2 * size[found].max(initial=0.0)]


def compare(machine: Machine, tool: Tool, lines: np.ndarray, h: np.ndarray, deviation: np.ndarray) -> dict[str, Any]:
    """Compare a predicted tip response with the truth, peak by peak.

    Parameters
    ----------
    machine, tool
        The true assembly.
    lines, h, deviation : ndarray
        `(n,)`: frequencies in Hz, prediction, and standard deviation of its logarithm.
    """
    true = machine.in_spindle(machine.front(tool)).receptance(lines)
    other = peaks_of(np.abs(h))
    peaks = []
    for index in peaks_of(np.abs(true)):
        near = other[np.abs(lines[other] / lines[index] - 1.0) < 0.1]
        at = near[np.argmax(np.abs(h[near]))] if near.size else None
        peaks.append(
            {
                "true_hz": float(lines[index]),
                "predicted_hz": np.nan if at is None else float(lines[at]),
                "magnitude_percent": np.nan if at is None else 100.0 * float(abs(h[at]) / abs(true[index]) - 1.0),
                "frequency_percent": np.nan if at is None else 100.0 * float(lines[at] / lines[index] - 1.0),
                "deviation_percent": 100.0 * float(deviation[index]),
            }
        )
    return {"tool": tool, "peaks": peaks, "_curves": (lines, true, h, deviation)}


def predict_with_modes(machine: Machine, tool: Tool, spindle: SpindleModes) -> dict[str, Any]:
    """Predict a tool with the modes of the spindle on fine lines over their band."""
    assert spindle.part.band_hz is not None
    low, high = spindle.part.band_hz
    lines = np.arange(np.ceil(low), high, 2.0)
    own = rc.Assembly([*machine.front(tool), spindle.part])
    return compare(machine, tool, lines, own.receptance(lines), spindle.standard_deviation(own, lines))


def predict_by_line(machine: Machine, tool: Tool, spindle: SpindleReceptance) -> dict[str, Any]:
    """Predict a tool on the usable lines of the spindle, with its covariance."""
    own = spindle.part()
    names = [f"spindle.residual_{entry}" for entry in ("y", "theta", "ytheta")]
    h, slope = rc.Assembly([*machine.front(tool), own]).derivatives(own.frequency_hz, names)
    variance = np.einsum("ni,nij,nj->n", slope, own.covariance, slope.conj()).real
    return compare(machine, tool, own.frequency_hz, h, np.sqrt(np.maximum(variance, 0.0)) / np.abs(h))


def reach(spindle: SpindleReceptance) -> list[dict[str, float]]:
    """Return the share of usable lines and the median standard deviation of a spindle by kilohertz."""
    lines = np.asarray(spindle.frequency_hz).real
    relative = spindle.standard_deviation / size_of(spindle.matrix)
    rows = []
    for low in np.arange(0.0, lines[-1], 1000.0).tolist():
        own = (lines >= low) & (lines < low + 1000.0)
        if own.any():
            usable, deviation = float(spindle.usable[own].mean()), float(np.nanmedian(relative[own]))
            rows.append({"low_hz": low, "high_hz": low + 1000.0, "usable": usable, "deviation": deviation})
    return rows


def size_of(matrix: np.ndarray) -> np.ndarray:
    """Return the scale of each term of receptance matrices from their diagonals."""
    root = np.sqrt(np.abs(matrix[:, [0, 1], [0, 1]]))
    return root[:, :, None] * root[:, None, :]


def predict_short(machine: Machine, tool: Tool, spindle: SpindleReceptance) -> dict[str, Any]:
    """Return the highest peak of a short tool and its predicted height, if the spindle is known there."""
    fine = np.arange(2000.0, 12e3, 4.0)
    true = np.abs(machine.in_spindle(machine.front(tool)).receptance(fine))
    at = peaks_of(true)
    highest = at[np.argmax(true[at])]
    lines, _, h, deviation = predict_by_line(machine, tool, spindle)["_curves"]
    # Usable lines beside a peak without one on it do not show its height.
    spacing = float(np.diff(np.asarray(spindle.frequency_hz).real).min())
    near = np.flatnonzero(np.abs(lines - fine[highest]) <= spacing)
    row = {"tool": tool, "true_hz": float(fine[highest]), "known": bool(near.size)}
    if not near.size:
        return {**row, "magnitude_percent": np.nan, "deviation_percent": np.nan}
    best = near[np.argmax(np.abs(h[near]))]
    error = 100.0 * float(abs(h[best]) / true[highest] - 1.0)
    return {**row, "magnitude_percent": error, "deviation_percent": 100.0 * float(deviation[best])}


def study_machine(machine: Machine, hits: int, seed: int) -> dict[str, Any]:
    """Identify the spindle of a machine and predict its tools."""
    observed = machine.measure(hits, seed, BAND_HZ[1])
    found = identify_spindle(observed)
    modes = fit_spindle(observed)
    wide = identify_spindle(machine.measure(hits, seed, REACH_HZ), allow_mismatch=True)
    lines = np.asarray(found.frequency_hz).real
    true = machine.matrix(lines)
    error = np.abs(found.matrix - true) / size_of(true)
    error_of_modes = np.abs(modes.part.receptance(lines) - true) / size_of(true)
    return {
        "machine": machine.name,
        "spindle": found.data(),
        "usable": float(found.usable.mean()),
        "lines": int(lines.size),
        "low_hz": float(lines[0]),
        "high_hz": float(lines[-1]),
        "modes": [asdict(mode) for mode in modes.part.modes],
        "median_error": float(np.median(error[found.usable])),
        "median_error_of_modes": float(np.median(error_of_modes)),
        "tools": [predict_with_modes(machine, tool, modes) for tool in tools("medium", "long")],
        "tools_line_by_line": [predict_by_line(machine, tool, found) for tool in tools("medium", "long")],
        "reach": reach(wide),
        "short": [predict_short(machine, tool, wide) for tool in tools("short")],
        "_spindle": (found, modes),
    }


# ---- Two modes close together: the effect of an error of the mode of a spindle, and its diagnosis


def move_mode(spindle: rc.ModalPart, mode: int) -> rc.ModalPart:
    """Return a spindle with one mode moved."""
    name = f"mode[{mode}].frequency_hz"
    return spindle.with_values({name: spindle.modes[mode].frequency_hz * (1.0 + 0.01 * MOVED_PERCENT)})


def errors_with_moved_mode(machine: Machine, spindle: rc.ModalPart, mode: int) -> list[dict[str, Any]]:
    """Return the errors of all peaks when a mode of the spindle is moved."""
    fine = np.arange(200.0, 4500.0, 1.0)
    rows = []
    for tool in tools("medium", "long"):
        front = machine.front(tool)
        true, off = (np.abs(rc.Assembly([*front, one]).receptance(fine)) for one in (spindle, move_mode(spindle, mode)))
        other = peaks_of(off)
        for index in peaks_of(true):
            near = other[np.argmin(np.abs(other - index))]
            rows.append(
                {
                    "tool": tool,
                    "true_hz": float(fine[index]),
                    "apart_percent": 100.0 * float(fine[index] / spindle.modes[mode].frequency_hz - 1.0),
                    "frequency_percent": 100.0 * float(fine[near] / fine[index] - 1.0),
                    "magnitude_percent": 100.0 * float(off[near] / true[index] - 1.0),
                }
            )
    return rows


def diagnose_moved_mode(machine: Machine, spindle: rc.ModalPart, mode: int, seed: int) -> Verdict:
    """Diagnose tip and nose of two lengths of the 12.7 mm tool, measured with a mode of the spindle moved."""
    random = np.random.default_rng(seed)
    lines, noise = np.arange(200.0, 4500.0, 5.0), 0.02
    observed = []
    tolerances = [Tolerance(name="carbide", moves={"tool.segment[0].youngs_modulus": 0.01}, relative=True)]
    for tool in (one for one in tools("medium", "long") if one.diameter_mm == 12.7):
        overhang = {"tool.segment[0].length": 1e-4}
        tolerances.append(Tolerance(name=f"overhang, {tool.length}", moves=overhang, configurations=(tool.length,)))
        true, described = (rc.Assembly([*machine.front(tool), one]) for one in (spindle, move_mode(spindle, mode)))
        for place in (rc.Coordinate(), rc.Coordinate("holder", 0.0)):
            scatter = noise * (random.normal(size=lines.size) + 1j * random.normal(size=lines.size))
            observed.append(
                rc.Observation(
                    assembly=described,
                    frequency_hz=lines,
                    receptance=true.receptance(lines, response=place) * np.exp(scatter),
                    response=place,
                    standard_deviation=noise,
                    label=f"{tool.length}, {place.part or 'tip'}",
                    configuration=tool.length,
                )
            )
    unknowns = [
        rc.Unknown(address="joint.k_y", lower=1e7, upper=1e10),
        rc.Unknown(address="joint.k_theta", lower=1e3, upper=1e7),
        rc.Unknown(address="joint.loss_factor", lower=1e-3, upper=0.3),
    ]
    return diagnose(observed, unknowns, tolerances=tolerances, causes=CAUSES, seed=seed)


def study(hits: int = 10, seed: int = 0) -> dict[str, Any]:
    """Return all results; keys that begin with _ hold objects for figures and tests.

    Parameters
    ----------
    hits : int, optional
        Hammer hits of each test of a blank; at least 3, because the variance comes from their scatter.
    seed : int, optional
        Seed of all random numbers.
    """
    if hits < 3:
        raise ValueError(f"hits is {hits}, expected at least 3")
    cases = [study_machine(machine, hits, 2 * seed + number) for number, machine in enumerate(MACHINES)]
    spindle = cases[0]["_spindle"][1].part
    # The mode to which most peaks of the tools are close.
    peaks = np.array([peak["true_hz"] for one in cases[0]["tools"] for peak in one["peaks"]])
    near = [np.sum(np.abs(np.log(peaks / mode.frequency_hz)) < 0.1) for mode in spindle.modes]
    mode = int(np.argmax(near))
    verdict = diagnose_moved_mode(MACHINES[0], spindle, mode, seed)
    return {
        "study": "machines",
        "provenance": "VIRTUAL: spindles and measurements are simulated; agreement with the paper is no evidence.",
        "settings": {
            "hits": hits,
            "band_hz": BAND_HZ,
            "reach_hz": REACH_HZ,
            "moved_percent": MOVED_PERCENT,
            "seed": seed,
        },
        "virtual": cases,
        "moved_mode_hz": spindle.modes[mode].frequency_hz,
        "displaced": errors_with_moved_mode(MACHINES[0], spindle, mode),
        "diagnosis": verdict.to_dict(),
        "log_frequency_put_in": -float(np.log1p(0.01 * MOVED_PERCENT)),
    }


if __name__ == "__main__":
    parser = options(__doc__)
    parser.add_argument("--hits", type=int, default=10, help="hammer hits of each simulated test")
    given = parser.parse_args()
    results = study(given.hits, given.seed)
    show(results)
    save(given.json, results)
    if given.plot:
        draw(results).savefig(given.plot)
