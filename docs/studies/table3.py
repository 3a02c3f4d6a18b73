"""Table 3 of Matthias et al. 2016: four joints that match one tip response in the machine. VIRTUAL.

W. Matthias, O. Ozsahin, Y. Altintas, B. Denkena, CIRP J. Manuf. Sci. Technol. 2016, doi 10.1016/j.cirpj.2016.02.005.
The paper prints neither the spindle nor the measured response. All responses are simulated here: the joint taken as
true is the curve-fitted set of table 3 with an assumed c_y, the holder is inferred, the spindle is invented.

The script identifies the joint from the response in the machine alone, tests the four sets against it, ranks the tests
that could be made next, and adds the free-free test of the paper and the best-ranked one.

Run with `python docs/studies/table3.py [--coherence X] [--averages N] [--seed N] [--json FILE] [--plot FILE]`.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.signal import find_peaks

import er32_tables
import receptance as rc
from output import options, print_table, save
from receptance.fit import Floor, Tolerance, constrained_fit, profile_likelihoods

DIAMETER_MM = 9.53
OVERHANGS_MM = (114.2, 62.6, 23.8)
"""Overhangs of this tool in tables 1 and 2; the first one is used in the machine."""
STEEL_LOSS, CARBIDE_LOSS = 0.002, 0.001
JOINT = ("joint.k_y", "joint.k_theta", "joint.c_y", "joint.c_theta")
STIFFNESSES = JOINT[:2]
TRUE_C_Y = 200.0
"""N s/m, assumed: the paper prints c_theta for the curve-fitted set, but no c_y."""
LARGEST_LOSS_FACTOR, TOOL_MODE_HZ = 0.12, 720.0
"""No metallic interface has a larger loss factor; with the mode of the tool it bounds the dampings."""
BANDS_HZ = {False: (100.0, 2000.0), True: (200.0, 12500.0)}
"""Band of a test in the machine and of a free-free test."""
STEP_HZ = 5.0
CONFIDENCE = 0.95
ENOUGH_PERCENT = 10.0

SETS = er32_tables.load().parameter_sets
TRUE_SET = next(one for one in SETS if one.name == "curve_fitted")
TRUTH: dict[str, float] = dict(
    zip(JOINT, (TRUE_SET.k_y, TRUE_SET.k_theta, TRUE_C_Y, TRUE_SET.c_theta or 0.0), strict=True)
)

TOLERANCES = (
    Tolerance(name="carbide E", moves={"tool.segment[0].youngs_modulus": 0.01}, relative=True),
    Tolerance(name="carbide density", moves={"tool.segment[0].density": 0.005}, relative=True),
    Tolerance(name="blank diameter", moves={"tool.segment[0].outer_diameter": 5e-6}),
    Tolerance(name="steel E", moves={"holder.segment[*].youngs_modulus": 0.01}, relative=True),
    Tolerance(name="holder turned", moves={"holder.segment[*].outer_diameter": 1e-4}),
    Tolerance(name="taper k_y", moves={"taper.k_y": 0.1}, relative=True),
    Tolerance(name="taper k_theta", moves={"taper.k_theta": 0.1}, relative=True),
    Tolerance(name="front bearing", moves={"front.k_y": 0.1}, relative=True),
    Tolerance(name="rear bearing", moves={"rear.k_y": 0.1}, relative=True),
)


@dataclass(frozen=True)
class Test:
    """A test of the tool at an overhang, free-free or in the machine."""

    name: str
    overhang_mm: float
    free: bool

    @property
    def assembly(self) -> rc.Assembly:
        """The assembly with the true joint."""
        return assembly(self.overhang_mm, free=self.free)


MACHINE = Test("in the machine", OVERHANGS_MM[0], free=False)
FREE = Test(f"free-free at {OVERHANGS_MM[0]:g} mm", OVERHANGS_MM[0], free=True)
MENU = (
    Test("the same once more", OVERHANGS_MM[0], free=False),
    *(Test(f"in the machine at {mm:g} mm", mm, free=False) for mm in OVERHANGS_MM[1:]),
    *(Test(f"free-free at {mm:g} mm", mm, free=True) for mm in OVERHANGS_MM),
)


@dataclass(frozen=True)
class Measuring:
    """Coherence and number of averages of every line of the simulated tests."""

    coherence: float = 0.98
    averages: int = 10

    def __post_init__(self) -> None:
        if not 0.0 < self.coherence < 1.0:
            raise ValueError(f"coherence is {self.coherence:g}, expected between 0 and 1")
        if self.averages < 2:
            raise ValueError(f"averages is {self.averages}, expected at least 2")

    @property
    def noise(self) -> float:
        """Standard deviation of real and imaginary part of the log response."""
        return float(np.sqrt((1.0 - self.coherence) / (2.0 * (self.averages - 1) * self.coherence)))


def assembly(overhang_mm: float, *, free: bool) -> rc.Assembly:
    """Return the tool in the holder with the true joint, free or in the simulated spindle."""
    own = er32_tables.assembly(DIAMETER_MM, overhang_mm).replace(
        {**TRUTH, "holder.segment[*].loss_factor": STEEL_LOSS, "tool.segment[0].loss_factor": CARBIDE_LOSS}
    )
    if free:
        return own
    steel = replace(er32_tables.parts()[1].segments[-1].material, loss_factor=STEEL_LOSS)
    shaft = [
        rc.Segment(length=length, outer_diameter=outer, inner_diameter=0.03, material=steel)
        for length, outer in ((0.08, 0.07), (0.25, 0.065))
    ]
    taper = rc.PointJoint(k_y=1.5e9, k_theta=2e6, loss_factor=0.02, name="taper")
    bearings = [
        rc.GroundSpring(k_y=3e8, k_theta=5e4, c_y=2e3, part="spindle", position=0.08, name="front"),
        rc.GroundSpring(k_y=2e8, c_y=2e3, part="spindle", position=0.30, name="rear"),
    ]
    return rc.Assembly([*own.elements.values(), taper, rc.Part(shaft, name="spindle")], bearings)


def damping_bounds() -> dict[str, tuple[float, float]]:
    """Return bounds of the dampings, from a thousandth of a per cent to the largest loss factor of the stiffness."""
    w = 2.0 * np.pi * TOOL_MODE_HZ
    return {
        c: (1e-5 * TRUTH[k] / w, LARGEST_LOSS_FACTOR * TRUTH[k] / w) for k, c in zip(JOINT[:2], JOINT[2:], strict=True)
    }


def unknowns(near: Mapping[str, float] | None = None) -> list[rc.Unknown]:
    """Return the joint within the range of table 3, its start near some values."""
    bounds = {"joint.k_y": (1e6, 1e13), "joint.k_theta": (1e2, 1e13), **damping_bounds()}
    return [
        rc.Unknown(address=a, lower=low, upper=high, start=None if near is None else float(np.clip(near[a], low, high)))
        for a, (low, high) in bounds.items()
    ]


def deviations_of(tolerance: Tolerance, own: rc.Assembly) -> dict[str, float]:
    """Return the parameters of an assembly that an error changes, with their standard deviations."""
    return {
        address: deviation
        for pattern, deviation in tolerance.moves.items()
        for address in own.parameters
        if address == pattern or re.sub(r"segment\[\d+\]", "segment[*]", address) == pattern
    }


def tolerances(tests: Mapping[str, rc.Assembly]) -> list[Tolerance]:
    """Return the errors of some tests; every clamping has an error of the overhang of its own."""
    shared = [one for one in TOLERANCES if any(deviations_of(one, own) for own in tests.values())]
    return shared + [
        Tolerance(name=f"overhang, {name}", moves={"tool.segment[0].length": 1e-4}, configurations=(name,))
        for name in tests
    ]


def measure(
    test: Test, measuring: Measuring, values: Mapping[str, float], random: np.random.Generator | None = None
) -> rc.Observation:
    """Simulate a measured tip response.

    Parameters
    ----------
    test : Test
        Name of the configuration, and assembly.
    measuring : Measuring
        Noise.
    values : mapping of str to float
        The joint by address, and errors by name of the tolerance in standard deviations (0 where absent).
    random : Generator, optional
        Source of noise; without it there is none, but the standard deviations are the same.
    """
    nominal = test.assembly
    true = nominal.replace({a: values[a] for a in JOINT})
    for tolerance in tolerances({test.name: nominal}):
        error = values.get(tolerance.name, 0.0)
        true = true.replace(
            {
                a: true.get(a) * np.exp(sd * error) if tolerance.relative else true.get(a) + sd * error
                for a, sd in deviations_of(tolerance, nominal).items()
            }
        )
    low, high = BANDS_HZ[test.free]
    lines = np.arange(low, high + 0.5 * STEP_HZ, STEP_HZ)
    response = true.receptance(lines)
    deviation = np.sqrt(measuring.noise**2 + Floor().variance(lines, response))
    if random is not None:
        scatter = random.standard_normal(lines.size) + 1j * random.standard_normal(lines.size)
        response = response * np.exp(deviation * scatter)
    return rc.Observation(
        assembly=nominal,
        frequency_hz=lines,
        receptance=response,
        standard_deviation=deviation,
        label=test.name,
        configuration=test.name,
    )


def fit(
    measured: Sequence[rc.Observation], near: Mapping[str, float] | None = None, *, staged: bool = True, seed: int = 0
) -> rc.Identification:
    """Identify the joint and all errors, from nearby values and in stages; return the better end."""
    errors = tolerances({one.configuration: one.assembly for one in measured})
    ends = []
    if near is not None:
        ends.append(rc.identify(measured, unknowns(near), tolerances=errors, starts=1, seed=seed))
    if staged:
        ends.append(rc.identify(measured, unknowns(), tolerances=errors, strategy="staged", starts=1, seed=seed))
    return min(ends, key=lambda end: end.starts[0].cost)


def half_width_percent(profile: Any) -> float:
    """Return the half-width of a profile interval in percent; infinite if a side is open."""
    return 100.0 * (float(np.sqrt(profile.upper / profile.lower)) - 1.0) if profile.bounded else float("inf")


def judge_sets(measured: rc.Observation, found: rc.Identification | None) -> list[dict[str, Any]]:
    """Compare every set of table 3 with a measurement: natural frequencies by hand, and the likelihood."""
    upper = float(measured.frequency_hz[-1])
    true = measured.assembly.natural_frequencies(upper)
    level = np.log(np.abs(measured.receptance))
    peaks, _ = find_peaks(level, prominence=np.maximum(1.0, 8.0 * measured.standard_deviation))
    seen = {int(np.abs(true - frequency).argmin()) for frequency in measured.frequency_hz.real[peaks]}
    rows = []
    for one in SETS:
        stiffness = {"joint.k_y": one.k_y, "joint.k_theta": one.k_theta}
        with_set = measured.assembly.replace(stiffness).natural_frequencies(3.0 * upper)[: true.size]
        percent = 100.0 * (with_set / true - 1.0)
        held = None if found is None else constrained_fit(found, stiffness)
        rows.append(
            {
                "name": one.name,
                "test": measured.label,
                "k_y": one.k_y,
                "k_theta": one.k_theta,
                "modes": [
                    {"mode": i + 1, "true_hz": t, "with_set_hz": w, "percent": p, "shows_as_peak": i in seen}
                    for i, (t, w, p) in enumerate(zip(true.tolist(), with_set.tolist(), percent.tolist(), strict=True))
                ],
                # By hand a set passes unless frequencies are read more accurately than this.
                "passes_by_hand_from_percent": max((abs(percent[i]) for i in seen), default=0.0),
                "over_all_modes_percent": float(np.max(np.abs(percent))),
                "rise": None if held is None else held.rise,
                "p_value": None if held is None else held.p_value,
                "rejected": None if held is None else held.rejected(CONFIDENCE),
            }
        )
    return rows


def expect(
    measured: rc.Observation, found: rc.Identification, profile: Any, measuring: Measuring
) -> list[dict[str, Any]]:
    """Return the half-widths expected after every test of the menu, the best test first.

    The interval depends on the true joint, which is unknown: each test is simulated without noise and fitted for the
    best fit and for both ends of the profile within its interval, and the widest interval counts.
    """
    inside = profile.paths[profile.rise <= profile.threshold]
    order = np.argsort(inside[:, found.addresses.index(profile.name)])
    points = [dict(found.values)]
    for x in (inside[order[0]], inside[order[-1]]):
        points.append(dict(zip(found.addresses, found.task.variables.to_values(x).tolist(), strict=True)))
    rows = []
    for test in MENU:
        widths = []
        for point in points:
            again = fit([measure(MACHINE, measuring, point), measure(test, measuring, point)], point, staged=False)
            profiles = profile_likelihoods(again, STIFFNESSES, level=CONFIDENCE)
            widths.append({name: half_width_percent(one) for name, one in profiles.items()})
        worst = {name: max(one[name] for one in widths) for name in STIFFNESSES}
        rows.append(
            {
                "name": test.name,
                "overhang_mm": test.overhang_mm,
                "free": test.free,
                "half_width_percent": worst,
                "half_width_percent_at_fit": widths[0],
            }
        )
    # No test bounds a joint that may be rigid; the best fit decides then.
    return sorted(
        rows, key=lambda r: (max(r["half_width_percent"].values()), max(r["half_width_percent_at_fit"].values()))
    )


def study(measuring: Measuring | None = None, seed: int = 0) -> dict[str, Any]:
    """Return all results; "fits" and "measured" hold the objects for further use.

    Parameters
    ----------
    measuring : Measuring, optional
        Noise of the simulated tests.
    seed : int, optional
        Seed of errors and noise, and of the starts.
    """
    measuring = measuring or Measuring()
    random = np.random.default_rng(seed)
    # All errors are drawn before anything is measured, so they do not depend on the tests that follow.
    places = {test.name: test.assembly for test in (MACHINE, FREE)}
    errors = {one.name: float(random.standard_normal()) for one in tolerances(places)}
    measured = measure(MACHINE, measuring, TRUTH | errors, random)
    alone = fit([measured], seed=seed)
    profiles = profile_likelihoods(alone, level=CONFIDENCE)
    expected = expect(measured, alone, profiles["joint.k_y"], measuring)
    free = measure(FREE, measuring, TRUTH | errors, random)
    both = fit([measured, free], alone.values, seed=seed)
    both_profiles = best_profiles = profile_likelihoods(both, level=CONFIDENCE)
    best = next(test for test in MENU if test.name == expected[0]["name"])
    if best != FREE:
        errors[f"overhang, {best.name}"] = float(random.standard_normal())
        added = measure(best, measuring, TRUTH | errors, random)
        best_profiles = profile_likelihoods(fit([measured, added], alone.values, seed=seed), level=CONFIDENCE)
    return {
        "study": "table3",
        "virtual": True,
        "settings": {
            "seed": seed,
            "level": CONFIDENCE,
            "coherence": measuring.coherence,
            "averages": measuring.averages,
            "noise": measuring.noise,
            "step_hz": STEP_HZ,
            "machine_hz": BANDS_HZ[False],
            "free_hz": BANDS_HZ[True],
        },
        "truth": TRUTH,
        "damping_bounds": damping_bounds(),
        "errors": errors,
        "machine_alone": profile_rows(profiles),
        "sets": [*judge_sets(measured, alone), *judge_sets(free, both)],
        "expected": expected,
        "with_free_free": profile_rows(both_profiles),
        "rms": both.rms,
        "closes": all(half_width_percent(both_profiles[name]) < ENOUGH_PERCENT for name in STIFFNESSES),
        "best": best.name,
        "with_best": profile_rows(best_profiles),
        "_figure": {"measured": (measured, free), "profiles": (profiles, both_profiles)},
    }


def profile_rows(profiles: Mapping[str, Any]) -> dict[str, dict[str, Any]]:
    """Return profile intervals with the simulated values."""
    return {
        name: {
            "simulated": TRUTH[name],
            "value": one.value,
            "interval": [None if one.lower_open else one.lower, None if one.upper_open else one.upper],
            "half_width_percent": half_width_percent(one) if name in STIFFNESSES else None,
            "statement": one.statement,
            "inside": one.lower <= TRUTH[name] <= one.upper,
        }
        for name, one in profiles.items()
    }


def show(found: dict[str, Any]) -> None:
    """Print the results."""
    own = found["settings"]
    print("VIRTUAL: all measurements are simulated, the spindle is invented, the holder is inferred and not published.")
    print(
        f"Noise: coherence {own['coherence']:g} from {own['averages']} averages, so {100 * own['noise']:.1f} % on "
        f"every line, {own['step_hz']:g} Hz apart, and a floor of 0.3 % and of 0.01 % of frequency; in the machine "
        f"{own['machine_hz'][0]:g} to {own['machine_hz'][1]:g} Hz, free {own['free_hz'][0]:g} to "
        f"{own['free_hz'][1]:g} Hz. Seed {own['seed']}."
    )
    print_table(
        "Tolerances: standard deviations, drawn for the simulation and fitted; every overhang 0.1 mm",
        [
            {"name": t.name, "size": f"{100 * sd:g} %" if t.relative else f"{1e6 * sd:g} um"}
            for t in TOLERANCES
            for sd in t.moves.values()
        ],
        {"error of": "name", "standard deviation": "size"},
    )
    upper = ", ".join(f"{name} {high:.3g}" for name, (_, high) in found["damping_bounds"].items())
    print(f"\nUpper bounds of the dampings: {upper}, a loss factor of {LARGEST_LOSS_FACTOR:g} of the true stiffness.")
    columns = {
        "parameter": "name",
        "simulated": "simulated:.3g",
        "found": "value:.3g",
        "95 % profile interval": "interval:.3g",
        "half-width [%]": "half_width_percent:.2g",
        "inside": "inside",
        "in words": "statement",
    }
    for key, title in (
        ("machine_alone", "From the response in the machine alone"),
        ("with_free_free", f"With {FREE.name}"),
        ("with_best", f"With {found['best']}, the best-ranked test, instead"),
    ):
        print_table(title, [{"name": name, **row} for name, row in found[key].items()], columns)
    for free, title in ((False, "In the machine"), (True, "Free, with both tests fitted")):
        sets = [one for one in found["sets"] if (one["test"] == FREE.name) is free]
        modes = {f"{m['true_hz']:.0f} Hz{'*' if m['shows_as_peak'] else ''}": i for i, m in enumerate(sets[0]["modes"])}
        print_table(
            f"{title}: errors of natural frequencies in percent; * shows as a peak",
            [
                {
                    **one,
                    **{f"mode {i}": one["modes"][i]["percent"] for i in modes.values()},
                    # The tails of the distribution are not known further out.
                    "p": f"{one['p_value']:.2g}" if one["p_value"] >= 1e-6 else "< 1e-6",
                }
                for one in sets
            ],
            {
                "set": "name",
                "k_y": "k_y:.3g",
                "k_theta": "k_theta:.3g",
                **{head: f"mode {i}:+.2f" for head, i in modes.items()},
                "passes by hand at [%]": "passes_by_hand_from_percent:.2g",
                "all modes [%]": "over_all_modes_percent:.2g",
                "rise of -2 log L": "rise:.3g",
                "p": "p",
                "rejected": "rejected",
            },
        )
    print_table(
        "Half-width in percent expected after a test: the widest of three joints that the data permit, and at the fit",
        [
            {
                "name": one["name"],
                **{f"{where} {name}": one[where][name] for where in one if "half" in where for name in STIFFNESSES},
            }
            for one in found["expected"]
        ],
        {
            "test": "name",
            **{f"{name}, widest": f"half_width_percent {name}:.2g" for name in STIFFNESSES},
            **{f"{name}, at the fit": f"half_width_percent_at_fit {name}:.2g" for name in STIFFNESSES},
        },
    )
    closes = "closes" if found["closes"] else "does not close"
    print(f"\nAdding {FREE.name} {closes} the intervals of both stiffnesses to under {ENOUGH_PERCENT:g} %.")


def draw(found: dict[str, Any]) -> Any:
    """Return a figure of the four sets beside both responses, and of the profiles without and with the free test."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(13.0, 9.0), layout="constrained")
    figure.suptitle("Table 3 found by the program: VIRTUAL, all measurements simulated")
    panels = figure.subplots(2, 2)
    for axes, measured in zip(panels[0], found["_figure"]["measured"], strict=True):
        lines = measured.frequency_hz.real
        axes.semilogy(
            lines, np.abs(measured.receptance), ".", color="0.6", markersize=3.0, label="simulated measurement"
        )
        for one, style in zip(SETS, ("-", "--", "-.", ":"), strict=True):
            own = measured.assembly.replace({"joint.k_y": one.k_y, "joint.k_theta": one.k_theta})
            axes.semilogy(lines, np.abs(own.receptance(lines)), style, linewidth=1.2, label=one.name)
        axes.set(title=measured.label, xlabel="frequency (Hz)", ylabel="tip receptance (m/N)")
        axes.legend(fontsize=8)
    for axes, name in zip(panels[1], STIFFNESSES, strict=True):
        for profiles, label in zip(found["_figure"]["profiles"], ("machine alone", f"with {FREE.name}"), strict=True):
            profile = profiles[name]
            axes.semilogx(profile.values, profile.rise, "o-", markersize=3.0, label=f"{label}: {profile.statement}")
        axes.axhline(profile.threshold, color="tab:red", linewidth=1.0)
        axes.axvline(TRUTH[name], color="k", linestyle=":", label=f"simulated: {TRUTH[name]:.3g}")
        axes.set(title=name, ylabel="rise of -2 log L", ylim=(-0.2, 3.0 * profile.threshold))
        axes.legend(fontsize=8)
    return figure


if __name__ == "__main__":
    parser = options(__doc__)
    parser.add_argument("--coherence", type=float, default=Measuring.coherence, help="of every line")
    parser.add_argument("--averages", type=int, default=Measuring.averages)
    given = parser.parse_args()
    results = study(Measuring(given.coherence, given.averages), given.seed)
    show(results)
    save(given.json, results)
    if given.plot:
        draw(results).savefig(given.plot)
