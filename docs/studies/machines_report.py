"""Tables, sentences and the figure of the study of two machines."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from output import print_table

CLOSE_PERCENT = 30.0
"""A peak is close to the mode of the spindle within this distance."""


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
        f"VIRTUAL: the mode of the spindle at {found['moved_mode_hz']:.0f} Hz moved by "
        f"{found['settings']['moved_percent']:g} %",
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


def draw(found: dict[str, Any]) -> Figure:
    """Return a figure of the tools on both machines, as figures 16 and 17 of the paper, and the usable lines."""
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
