"""Tables and sentences of the ER32 study; every number in them comes from the results of `er32.study`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from er32_tables import SOURCE, load
from output import print_table

UNLIKELY = 0.05
"""P value below which chance is called an unlikely explanation."""
SMALLEST_P = 1e-4
"""Smallest p value that is printed, because the tails of the assumed distributions are uncertain."""
CAUSES = 6
"""Rows of the table of single causes."""
STIFFNESSES = (("k_y", "N/m"), ("k_theta", "N m/rad"))


def show(results: dict[str, Any]) -> None:
    """Print all results."""
    print(f"ER32 collet holder: the joint from printed natural frequencies\n{SOURCE}. Seed {results['seed']}.")
    for part in (show_holder, show_joints, show_transfers, show_sets, show_trends, show_bias, show_causes, show_paper):
        part(results)


def worst(rows: Sequence[dict[str, Any]], key: str) -> dict[str, Any]:
    """Return the row with the largest absolute value."""
    return max(rows, key=lambda row: abs(row[key]))


def p_text(value: float) -> str:
    """Return a p value as text."""
    return f"p = {value:.2g}" if value >= SMALLEST_P else f"p < {SMALLEST_P:g}"


def show_holder(results: dict[str, Any]) -> None:
    """Print how well the inferred holder is determined."""
    inferred = results["inferred"]
    print_table(
        f"The holder, inferred from {inferred['frequencies']} frequencies; standard errors from these alone",
        inferred["quantities"],
        {
            "quantity": "name",
            "value": "value:.5g",
            "unit": "unit",
            "standard error [%]": "standard_error_percent:.3g",
            "at a bound of the fit": "at_bound",
        },
    )
    print(
        f"\nThe holder is inferred, not published. {inferred['how']} It reproduces these frequencies to "
        f"{inferred['rms_percent']:.2f} % rms, which is consistency, not validation. They determine "
        f"{inferred['combinations_known']} combinations of the {len(inferred['quantities'])} fitted quantities within "
        f"{inferred['known_within_percent']:g} %. The rest of the shape follows from the bounds of that fit: the "
        "holder has the right receptance at the nose, but it is not the holder of the drawing."
    )


def show_joints(results: dict[str, Any]) -> None:
    """Print the joint of every tool at every torque."""
    joints, settings = results["identified"], results["settings"]
    columns = {"d\n[mm]": "diameter_mm:g", "torque\n[N m]": "torque_nm:g"}
    for name, unit in STIFFNESSES:
        columns |= {
            f"{name}\n[{unit}]": f"{name}:.3e",
            f"interval\nof {name}": f"{name}_interval:.3e",
            f"{name} in\nthe paper": f"published_{name}:.2e",
            f"difference\nof {name} [%]": f"{name}_difference_percent:+.1f",
        }
    print_table("Table 4: the joint, identified from two natural frequencies each", joints, columns)
    steps, error = settings["resolution"], settings["chance"]["overhang_mm"]
    print(
        "\nThe intervals contain every joint whose frequencies would be printed like the measured ones: steps of "
        f"{steps['fine_hz']:g} Hz below {steps['change_hz'] / 1e3:g} kHz and of {steps['coarse_hz']:g} Hz from there "
        "on (the paper states no resolution). They contain neither the error of the model nor the scatter between "
        "clampings."
    )
    for name, _ in STIFFNESSES:
        largest = worst(joints, f"{name}_difference_percent")
        changes = [error * abs(joint[f"{name}_percent_per_mm"]) for joint in joints]
        print(
            f"{name} differs from the paper by at most {largest[f'{name}_difference_percent']:+.1f} % "
            f"({largest['diameter_mm']:g} mm at {largest['torque_nm']:g} N m); {error:g} mm of the overhang "
            f"change it by {min(changes):.1f} to {max(changes):.1f} %."
        )
    for joint in joints:
        if not joint["converged"] or joint["starts_agreeing"] < joint["starts"]:
            print(
                f"{joint['diameter_mm']:g} mm at {joint['torque_nm']:g} N m: converged {joint['converged']}, "
                f"{joint['starts_agreeing']} of {joint['starts']} starts agree."
            )


def show_transfers(results: dict[str, Any]) -> None:
    """Print the frequencies of table 2."""
    ours, theirs = results["transfer"], results["published_predictions"]
    print_table(
        "Table 2: natural frequencies at other overhangs, free assembly",
        [{**row, "theirs": other} for row, other in zip(ours["rows"], theirs["rows"], strict=True)],
        {
            "d\n[mm]": "diameter_mm:g",
            "overhang\n[mm]": "overhang_mm:g",
            "mode": "mode:d",
            "measured\n[Hz]": "measured_hz:.0f",
            "paper\n[Hz]": "published_hz:.0f",
            "error of\npaper [%]": "published_error_percent:+.2f",
            "ours\n[Hz]": "predicted_hz:.1f",
            "our error\n[%]": "error_percent:+.2f",
            "with the paper's\njoint [Hz]": "theirs.predicted_hz:.1f",
            "against its\nprediction [%]": "theirs.difference_percent:+.2f",
        },
    )
    print(
        f"\nWith the paper's stiffnesses (table 5) the model reproduces its predictions to {theirs['rms_percent']:.2f} "
        "% rms (consistency: they were used to infer the holder). With the joint identified at "
        f"{load().torque_nm:g} N m it predicts the measured ones to {ours['rms_percent']:.2f} % rms; the paper's "
        f"predictions reach {ours['published_rms_percent']:.2f} %."
    )


def show_sets(results: dict[str, Any]) -> None:
    """Print the errors of the parameter sets of table 3."""
    sets = results["parameter_sets"]
    rows = []
    for errors in zip(*(chosen["errors"] for chosen in sets), strict=True):
        row = dict(errors[0])
        for chosen, error in zip(sets, errors, strict=True):
            name, mark = chosen["set"], "*" if error in chosen["refuted_by"] else " "
            row |= {name: error["predicted_hz"], f"{name} error": f"{error['error_percent']:+.1f}{mark}"}
        rows.append(row)
    columns = {"overhang\n[mm]": "overhang_mm:g", "mode": "mode:d", "measured\n[Hz]": "measured_hz:.0f"}
    for name in (chosen["set"] for chosen in sets):
        columns |= {f"{name}\n[Hz]": f"{name}:.0f", f"{name}\nerror [%] ": f"{name} error:>"}
    print_table("Table 3: four joints that match the tip FRF in the machine; * refutes a set", rows, columns)
    print(
        f"\nA mode refutes a set if its error exceeds {sets[0]['threshold_percent']:.1f} %, "
        f"{results['settings']['refutation']:g} times the rms error of the transfers above."
    )
    for chosen in sets:
        error = chosen["first_refutation_of_first_mode"]
        if error is not None:
            print(f"The first mode refutes {chosen['set']} from an overhang of {error['overhang_mm']:g} mm down.")


def show_trends(results: dict[str, Any]) -> None:
    """Print trends over torque and diameter."""

    def with_steps(rows: list[dict[str, Any]]) -> tuple[list[dict[str, Any]], dict[str, str]]:
        names = [f"{step['start']:g} to\n{step['end']:g} [%] " for step in rows[0]["steps"]]
        texts = [[f"{s['percent']:+.1f}{' ' if s['exceeds'] else '~'}" for s in row["steps"]] for row in rows]
        extended = [{**row, **dict(zip(names, text, strict=True))} for row, text in zip(rows, texts, strict=True)]
        return extended, {name: f"{name}:>" for name in names}

    low, high = results["trends"]["torque_range_nm"]
    torque, torque_steps = with_steps(results["trends"]["torque"])
    diameter, diameter_steps = with_steps(results["trends"]["diameter"])
    print_table(
        f"From {low:g} to {high:g} N m: line fitted to the values at all torques, change between the end values; "
        "intervals from the resolution alone; ~ marks a step within it",
        torque,
        {
            "": "quantity",
            "d\n[mm]": "diameter_mm:g",
            "fitted\nline [%]": "change_percent:+.1f",
            "interval": "interval:+.1f",
            "exceeds it": "exceeds",
            "end values\n[%]": "end_values.percent:+.1f",
            **torque_steps,
        },
    )
    print_table(
        f"Over diameter [mm] at {diameter[0]['torque_nm']:g} N m, as a power law",
        diameter,
        {
            "": "quantity",
            "exponent": "exponent:.2f",
            "from the\nresolution": "interval:.2f",
            "95 %, from\nthe scatter": "scatter_interval:.2f",
            "scatter\n[%]": "scatter_percent:.0f",
            "exceeds\nboth": "exceeds",
            **diameter_steps,
        },
    )
    print()
    for name, _ in STIFFNESSES:
        steps = [step for trend in torque if trend["quantity"] == name for step in trend["steps"]]
        up, down = (sum(s["exceeds"] and sign * s["percent"] > 0.0 for s in steps) for sign in (1.0, -1.0))
        print(
            f"In the {len(steps)} single steps of torque {name} rises {up} times and falls {down} times by more than "
            f"the resolution; {len(steps) - up - down} steps are within it."
        )
    print(
        "Each state was clamped once. The scatter between clampings is not published, so a trend that exceeds the "
        "resolution need not exceed the repeatability."
    )


def show_bias(results: dict[str, Any]) -> None:
    """Print the bias of the first mode of the long tools under chance."""
    bias, chance, simulation = results["long_first_mode_bias"], results["settings"]["chance"], None
    simulation = bias["simulation"]
    keys = ("diameter_mm", "overhang_mm", "percent", "published_percent", "tool_deviation_percent")
    rows = [dict(zip(keys, values, strict=True)) for values in zip(*(bias[key] for key in keys), strict=True)]
    mean = (None, None, bias["mean_percent"], float(np.mean(bias["published_percent"])), bias["mean_deviation_percent"])
    print_table(
        "First mode of the long tools: 100 (predicted / measured - 1); the last row is the mean",
        [*rows, dict(zip(keys, mean, strict=True))],
        {
            "d\n[mm]": "diameter_mm:g",
            "overhang\n[mm]": "overhang_mm:g",
            "ours\n[%]": "percent:+.2f",
            "paper\n[%]": "published_percent:+.2f",
            "chance, standard\ndeviation [%]": "tool_deviation_percent:.2f",
        },
    )
    sources = ", ".join(f"{name} {value:.2f}" for name, value in bias["deviations_percent"].items())
    verdict = "is too large for chance" if bias["p_value"] < UNLIKELY else "cannot be distinguished from chance"
    count = len(rows)
    # Variance of a mean of equally correlated numbers against that of independent ones.
    effective = count / (1.0 + (count - 1) * bias["mean_correlation"])
    print(
        f"\nDefinition of chance: readings uniform over the printed step; overhangs {chance['overhang_mm']:g} mm "
        f"(standard deviation; those printed twice differ by {bias['overhang_scatter_mm']:.2f} mm); shared by all "
        f"tools: carbide E {chance['carbide_modulus_percent']:g} % and density {chance['carbide_density_percent']:g} "
        f"%, steel E {chance['steel_modulus_percent']:g} % and density {chance['steel_density_percent']:g} %, every "
        f"dimension of the holder {chance['holder_dimension_percent']:g} %, nose factors "
        f"{chance['nose_factor_percent']:g} %. Standard deviation of the mean bias in %: {sources}; together "
        f"{bias['mean_deviation_percent']:.2f}.\n"
        f"Two-sided p = {bias['p_value']:.3g} for the mean: the bias {verdict} under this model. {simulation['draws']} "
        f"simulations of the whole procedure (seed {simulation['seed']}) have a standard deviation of "
        f"{simulation['deviation_percent']:.2f} %, and {100 * simulation['share_as_large']:.1f} % of them a mean as "
        "large.\n"
        "The answer depends on the errors that all tools share: readings and overhangs alone give "
        f"{p_text(bias['p_value_without_shared'])}; with the standard errors of the inference "
        f"({bias['inference_deviation_percent']:.2f} % of the mean) in place of the tolerances of carbide and holder "
        f"{p_text(bias['p_value_with_inference'])}, but these describe how well the paper's own model is known, not "
        "how well that model fits the real parts.\n"
        f"Sign test: p = {bias['sign_test_p_value']:.3g} for independent tools; under the model their errors have a "
        f"mean correlation of {bias['mean_correlation']:.2f}, so {count} tools count as {effective:.1f}."
    )


def show_causes(results: dict[str, Any]) -> None:
    """Print the single causes that would remove the bias."""
    causes, before = results["long_first_mode_bias"]["single_causes"], results["transfer"]["rms_percent"]
    print_table(
        f"Single causes that would remove the mean bias, the {CAUSES} least unlikely and the joint (the rms error of "
        f"table 2 is {before:.2f} % without them)",
        [*causes[:CAUSES], *(c for c in causes[CAUSES:] if c["deviations"] is None)],
        {
            "cause": "name",
            "change": "change:+.3g",
            "unit": "unit",
            "in standard\ndeviations": "deviations:.1f",
            "rms error of\ntable 2 [%]": "rms_percent:.2f",
        },
    )
    better = [c for c in causes if c["rms_percent"] is not None and c["rms_percent"] < before]
    names = "; ".join(f"{c['name']} {c['change']:+.1f} {c['unit']} ({c['rms_percent']:.2f} %)" for c in better)
    torque = max(abs(t["change_percent"]) for t in results["trends"]["torque"] if t["quantity"] == "k_theta")
    print(
        f"\nOf all single causes these reduce the error of table 2 as a whole: {names or 'none'}. Over the whole range "
        f"of torque k_theta changes by at most {torque:.1f} % (fitted line). No cause is named."
    )


def show_paper(results: dict[str, Any]) -> None:
    """Print what the paper prints inconsistently."""
    print_table(
        "Numbers that the paper prints twice and differently, and the effect of the second on the joint",
        results["inconsistencies"],
        {
            "what": "what",
            "d [mm]": "diameter_mm:g",
            "first": "first:g",
            "unit": "unit",
            "in": "first_source",
            "second": "second:g",
            "also in": "second_source",
            "k_y [%]": "k_y_change_percent:+.1f",
            "k_theta [%]": "k_theta_change_percent:+.1f",
        },
    )
    published, steps = load(), results["settings"]["resolution"]
    measured = [f for row in (*published.readings,) for f in row.frequency_hz]
    measured += [f for transfer in published.transfers for f in transfer.measured_hz]
    coarse = [f for f in measured if f >= steps["change_hz"]]
    odd = ", ".join(f"{f:g} Hz" for f in sorted(set(coarse)) if not np.isclose(f % steps["coarse_hz"], 0.0))
    print(
        f"\nOf {len(coarse)} measured frequencies from {steps['change_hz'] / 1e3:g} kHz on all but {odd or 'none'} are "
        f"multiples of {steps['coarse_hz']:g} Hz. The figures are not reproduced: see clamping.py and machines.py."
    )
