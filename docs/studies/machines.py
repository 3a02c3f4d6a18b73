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

from collections.abc import Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np
from scipy.signal import find_peaks

import er32_tables
import receptance as rc
from output import options, print_table, save
from receptance.coupling import SpindleModes, SpindleReceptance, fit_spindle, identify_spindle
from receptance.diagnosis import Verdict, diagnose
from receptance.fit import Tolerance
from receptance.hammer import estimate_frf, find_hits, simulate_hits

STEEL = replace(rc.STEEL, loss_factor=0.002)
CARBIDE_LOSS, JOINT_LOSS = 0.001, 0.02
BAND_HZ = (150.0, 5000.0)
"""Band in which the spindles are fitted and the tools predicted."""
REACH_HZ = 9000.0
"""Upper end of the band in which the usable lines of the spindle are counted."""
MOVED_PERCENT = -3.0
"""Error of the mode of a spindle in the last part."""
CLOSE_PERCENT = 30.0
"""A peak is close to the mode of the spindle within this distance."""
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


@dataclass(frozen=True)
class Tool:
    """A blank of table 5 in a collet."""

    diameter_mm: float
    overhang_mm: float
    length: str
    k_y: float
    k_theta: float

    def __str__(self) -> str:
        return f"{self.diameter_mm:g} mm, {self.length} ({self.overhang_mm:g} mm)"


@dataclass(frozen=True)
class Machine:
    """A spindle on bearings, the part of a holder outside it, and a gauge blank.

    `shaft_mm` holds length and diameter by section, `bearings` position in m, stiffness in N/m and damping in N s/m,
    `holder_mm` length and diameter by section, None for the inferred holder.
    """

    name: str
    shaft_mm: Sequence[tuple[float, float]]
    bearings: Sequence[tuple[float, float, float]]
    taper: rc.PointJoint
    holder_mm: Sequence[tuple[float, float]] | None
    blank_mm: float = 100.0
    second_hit_mm: float = 70.0

    @property
    def spindle(self) -> rc.Assembly:
        """The true spindle: the inner part of the taper, its joint, the shaft."""
        inside = rc.Part([rc.Segment(length=0.004, outer_diameter=0.06, material=STEEL)], name="inside")
        grounds = [
            rc.GroundSpring(k_y=k, c_y=c, part="shaft", position=x, name=f"bearing_{i}")
            for i, (x, k, c) in enumerate(self.bearings)
        ]
        return rc.Assembly([inside, self.taper, part("shaft", self.shaft_mm, bore=0.03)], grounds)

    @property
    def blank(self) -> rc.Part:
        """The gauge blank."""
        segment = rc.Segment(length=1e-3 * self.blank_mm, outer_diameter=0.05, material=rc.STEEL)
        return rc.Part([segment], name="blank")

    def front(self, tool: Tool) -> list[Any]:
        """Return tool, joint and holder."""
        blank, joint, whole = er32_tables.assembly(
            tool.diameter_mm, tool.overhang_mm, tool.k_y, tool.k_theta
        ).elements.values()
        assert isinstance(blank, rc.Part)
        assert isinstance(joint, rc.PointJoint)
        assert isinstance(whole, rc.Part)
        holder = (
            part("holder", self.holder_mm or ())
            if self.holder_mm
            else lossy(rc.Part(whole.segments[:3], name="holder"))
        )
        return [lossy(blank, CARBIDE_LOSS), replace(joint, loss_factor=JOINT_LOSS), holder]

    def in_spindle(self, chain: Sequence[Any]) -> rc.Assembly:
        """Return parts in the true spindle."""
        spindle = self.spindle
        return rc.Assembly([*chain, *spindle.elements.values()], spindle.attachments.values())

    def matrix(self, lines: np.ndarray) -> np.ndarray:
        """Return the true receptance matrix of the spindle at its plane, `(n, 2, 2)`."""
        plane = [rc.Coordinate("inside", 0.0, "y"), rc.Coordinate("inside", 0.0, "theta")]
        return self.spindle.receptance(lines, response=plane, excitation=plane)

    def measure(self, hits: int, seed: int, high_hz: float) -> list[rc.Observation]:
        """Simulate hammer tests of the blank in the spindle: both drive points and the response between them."""
        tip, near = rc.Coordinate("blank", 0.0), rc.Coordinate("blank", 1e-3 * self.second_hit_mm)
        names = {tip: "tip", near: "near the spindle"}
        found = []
        for number, (excitation, responses) in enumerate(((tip, (tip, near)), (near, (near,)))):
            records = simulate_hits(
                self.in_spindle([self.blank]),
                response=responses,
                excitation=excitation,
                hits=hits,
                seed=2 * seed + number,
                duration_s=0.2,
                contact_s=1.5e-4,
                peak=400.0,
            )
            frf = estimate_frf(find_hits(records))
            found += [
                rc.Observation.from_frf(
                    rc.Assembly([self.blank]),
                    frf,
                    response=response,
                    excitation=excitation,
                    low_hz=BAND_HZ[0],
                    high_hz=high_hz,
                    label=f"{names[response]} from {names[excitation]}",
                )
                for response in responses
            ]
        return found


def part(name: str, sections_mm: Sequence[tuple[float, float]], bore: float = 0.0) -> rc.Part:
    """Return a part of steel from lengths and diameters in mm."""
    return rc.Part(
        [
            rc.Segment(length=1e-3 * length, outer_diameter=1e-3 * outer, inner_diameter=bore, material=STEEL)
            for length, outer in sections_mm
        ],
        name=name,
    )


def lossy(own: rc.Part, loss_factor: float = STEEL.loss_factor) -> rc.Part:
    """Return a part with a loss factor of its materials."""
    segments = [replace(s, material=replace(s.material, loss_factor=loss_factor)) for s in own.segments]
    return rc.Part(segments, name=own.name)


MACHINES = (
    Machine(
        name="Mori Seiki NT3150 DCG",
        shaft_mm=((60.0, 85.0), (300.0, 70.0)),
        bearings=((0.06, 3e8, 3e3), (0.09, 2e8, 2e3), (0.32, 2e8, 4e3)),
        taper=rc.PointJoint(k_y=1.5e9, k_theta=2e6, loss_factor=0.02, name="taper"),
        holder_mm=None,
    ),
    Machine(
        name="Quaser UX600",
        shaft_mm=((70.0, 95.0), (260.0, 80.0)),
        bearings=((0.05, 4e8, 3e3), (0.27, 2.5e8, 5e3)),
        taper=rc.PointJoint(k_y=2.5e9, k_theta=3.5e6, loss_factor=0.02, name="taper"),
        holder_mm=((16.0, 36.0), (30.0, 50.0), (24.0, 63.0)),
    ),
)


def tools(*lengths: str) -> list[Tool]:
    """Return the tools of the lengths "short" (tables 1 and 2), "medium" and "long" (table 5)."""
    published = er32_tables.load()
    found = []
    for row in published.setups:
        listed = [t.overhang_mm for t in published.transfers if t.diameter_mm == row.diameter_mm]
        shortest = min([*listed, published.mount(row.diameter_mm).overhang_mm])
        overhangs = {
            "short": shortest if shortest < 0.7 * row.overhang_medium_mm else None,
            "medium": row.overhang_medium_mm,
            "long": row.overhang_long_mm,
        }
        for length in lengths:
            overhang = overhangs[length]
            if overhang is not None:
                found.append(Tool(row.diameter_mm, overhang, length, row.k_y, row.k_theta))
    return found


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
    near = np.flatnonzero(np.abs(lines / fine[highest] - 1.0) < 0.01)
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
    modes = fit_spindle(observed, found)
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


def show(found: dict[str, Any]) -> None:
    """Print the results."""
    print(found["provenance"], f"Seed {found['settings']['seed']}, {found['settings']['hits']} hits a test.")
    print_table(
        "VIRTUAL: spindles from hits on a blank; errors in percent, as modes and line by line",
        [
            {
                **case,
                "percent": 100 * case["usable"],
                "by_line": 100 * case["median_error"],
                "as_modes": 100 * case["median_error_of_modes"],
                "hz": ", ".join(
                    f"{m['frequency_hz']:.0f}" for m in case["modes"] if m["frequency_hz"] < case["high_hz"]
                ),
            }
            for case in found["virtual"]
        ],
        {
            "machine": "machine",
            "from [Hz]": "low_hz:.0f",
            "to [Hz]": "high_hz:.0f",
            "lines": "lines:d",
            "usable [%]": "percent:.1f",
            "median error by line": "by_line:.1f",
            "as modes": "as_modes:.1f",
            "modes in the band [Hz]": "hz",
        },
    )
    for case in found["virtual"]:
        peaks = [peak for one in case["tools"] for peak in one["peaks"]]
        known = [peak for peak in peaks if np.isfinite(peak["predicted_hz"])]
        heights = [abs(peak["magnitude_percent"]) for peak in known]
        print_table(
            f"{case['machine']}, VIRTUAL: predicted tools against the truth",
            [{**peak, "tool": str(one["tool"])} for one in case["tools"] for peak in one["peaks"]],
            {
                "tool": "tool",
                "peak [Hz]": "true_hz:.0f",
                "frequency [%]": "frequency_percent:+.2f",
                "height [%]": "magnitude_percent:+.2f",
                "stated sd of the height [%]": "deviation_percent:.1f",
            },
        )
        print(
            f"\n{len(known)} of {len(peaks)} peaks of {len(case['tools'])} tools are predicted; frequencies within "
            f"{max(abs(peak['frequency_percent']) for peak in known):.2f} % (paper: 2 to 3 %), heights within "
            f"{max(heights):.0f} %, median {np.median(heights):.0f} % (paper: up to 100 %)."
        )
        print_table(
            f"{case['machine']}, VIRTUAL: usable lines of the spindle",
            [{**one, "percent": 100 * one["usable"], "sd": 100 * one["deviation"]} for one in case["reach"]],
            {
                "from [Hz]": "low_hz:.0f",
                "to [Hz]": "high_hz:.0f",
                "usable [%]": "percent:.0f",
                "median sd [%]": "sd:.1f",
            },
        )
        print_table(
            f"{case['machine']}, VIRTUAL: highest peaks of short tools; empty where no line of the spindle is usable",
            [{**one, "tool": str(one["tool"])} for one in case["short"]],
            {
                "tool": "tool",
                "peak [Hz]": "true_hz:.0f",
                "height [%]": "magnitude_percent:+.0f",
                "stated sd [%]": "deviation_percent:.0f",
            },
        )
    print_table(
        f"VIRTUAL: the mode of the spindle at {found['moved_mode_hz']:.0f} Hz moved by {MOVED_PERCENT:g} %",
        [
            {**one, "tool": str(one["tool"])}
            for one in sorted(found["displaced"], key=lambda one: abs(one["apart_percent"]))
        ],
        {
            "tool": "tool",
            "peak [Hz]": "true_hz:.0f",
            "from the mode [%]": "apart_percent:+.0f",
            "frequency [%]": "frequency_percent:+.2f",
            "height [%]": "magnitude_percent:+.2f",
        },
    )
    height, frequency, far = close_and_far(found)
    print(
        f"\nPeaks within {CLOSE_PERCENT:g} % of the mode have errors of up to {height:.0f} % in height and "
        f"{frequency:.1f} % in frequency, all others of at most {far:.0f} % in height."
    )
    own = found["diagnosis"]
    for cause in own["causes"]:
        sizes = ", ".join(
            f"{name.split('.')[1]} {one['value']:+.4f} ({one['lower']:+.4f} to {one['upper']:+.4f})"
            for name, one in cause["parameters"].items()
        )
        print(f"Diagnosis of tools measured there: {own['verdict']}, {cause['id']} ({cause['variant']}); {sizes}.")
    print(f"The simulated error is a log_frequency of {found['log_frequency_put_in']:+.4f}.")


def close_and_far(found: dict[str, Any]) -> tuple[float, float, float]:
    """Return the largest errors in percent: height and frequency close to the moved mode, height elsewhere."""
    near = [one for one in found["displaced"] if abs(one["apart_percent"]) < CLOSE_PERCENT]
    far = [one for one in found["displaced"] if abs(one["apart_percent"]) >= CLOSE_PERCENT]
    return (
        max(abs(one["magnitude_percent"]) for one in near),
        max(abs(one["frequency_percent"]) for one in near),
        max((abs(one["magnitude_percent"]) for one in far), default=0.0),
    )


def draw(found: dict[str, Any]) -> Any:
    """Return a figure of the tools on both machines, as figures 16 and 17 of the paper, and the usable lines."""
    from matplotlib.figure import Figure

    diameters = sorted({one["tool"].diameter_mm for one in found["virtual"][0]["tools"]})
    figure = Figure(figsize=(3.2 * (len(diameters) + 1), 7.0), layout="constrained")
    figure.suptitle("VIRTUAL: tools in two machines; grey: true, blue: medium and orange: long tool with 95 % bands")
    for row, case in zip(figure.subplots(2, len(diameters) + 1), found["virtual"], strict=True):
        for axes, diameter in zip(row, diameters, strict=False):
            for one in case["tools"]:
                if one["tool"].diameter_mm == diameter:
                    lines, true, h, deviation = one["_curves"]
                    colour = "tab:blue" if one["tool"].length == "medium" else "tab:orange"
                    band = np.exp(1.96 * deviation)
                    axes.semilogy(lines, np.abs(true), color="0.7", linewidth=3.0)
                    axes.fill_between(lines, np.abs(h) / band, np.abs(h) * band, color=colour, alpha=0.25)
                    axes.semilogy(lines, np.abs(h), color=colour, linewidth=1.0)
            title = f"{case['machine'].split()[0]}, {diameter:g} mm"
            axes.set(title=title, xlim=(0.0, 3500.0), xlabel="frequency (Hz)", ylabel="tip receptance (m/N)")
        places = [0.5 * (one["low_hz"] + one["high_hz"]) for one in case["reach"]]
        row[-1].bar(places, [one["usable"] for one in case["reach"]], width=850.0, color="tab:green", alpha=0.7)
        for one in case["short"]:
            row[-1].axvline(one["true_hz"], color="k", linestyle="-" if one["known"] else ":")
        row[-1].set(title="usable lines; short tools' peaks", xlabel="frequency (Hz)", ylabel="share")
    return figure


if __name__ == "__main__":
    parser = options(__doc__)
    parser.add_argument("--hits", type=int, default=10, help="hammer hits of each simulated test")
    given = parser.parse_args()
    results = study(given.hits, given.seed)
    show(results)
    save(given.json, results)
    if given.plot:
        draw(results).savefig(given.plot)
