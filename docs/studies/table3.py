"""Table 3 of Matthias et al. 2016: four joints that match one tip response in the machine. VIRTUAL.

W. Matthias, O. Ozsahin, Y. Altintas, B. Denkena, CIRP J. Manuf. Sci. Technol. 2016, doi 10.1016/j.cirpj.2016.02.005.
The paper prints neither the spindle nor the measured response. All responses are simulated here: the joint taken as
true is the curve-fitted set of table 3 with an assumed c_y, the holder is inferred, the spindle is invented.

The script identifies the joint from the response in the machine alone, tests the four sets against it, ranks the tests
that could be made next, and adds the free-free test of the paper and the best-ranked one.

Run with `python docs/studies/table3.py [--coherence X] [--averages N] [--seed N] [--json FILE] [--plot FILE]`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from scipy.signal import find_peaks

import receptance as rc
from output import options, save
from receptance.fit import constrained_fit, profile_likelihoods
from table3_report import ENOUGH_PERCENT, draw, show
from table3_tests import (
    BANDS_HZ,
    FREE,
    MACHINE,
    MENU,
    SETS,
    STEP_HZ,
    STIFFNESSES,
    TRUTH,
    Measuring,
    damping_bounds,
    measure,
    tolerances,
    unknowns,
)

CONFIDENCE = 0.95


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
