"""Tables, sentences and the figure of the study of table 3."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from output import print_table
from table3_tests import FREE, LARGEST_LOSS_FACTOR, SETS, STIFFNESSES, TOLERANCES, TRUTH

ENOUGH_PERCENT = 10.0
"""A test closes the intervals if both stiffnesses are known within this."""


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


def draw(found: dict[str, Any]) -> Figure:
    """Return a figure of the four sets beside both responses, and of the profiles without and with the free test."""
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
