"""Tables and sentences of the ER32 study; every number in them comes from the document that `run` returns."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from receptance.report import Table
from receptance.studies.er32.tables import SOURCE, Published, load
from receptance.studies.report import ReportSection, table

_UNLIKELY = 0.05
"""P value below which chance is called an unlikely explanation."""
_SMALLEST_P = 1e-4
"""Smallest p value that is printed, because the tails of the assumed distributions are uncertain."""
_CAUSES = 6
"""Rows of the table of single causes."""


def findings(results: dict[str, Any]) -> list[dict[str, str]]:
    """Return the sentences with their subjects."""
    subjects = {
        "holder": _on_holder,
        "joint": _on_joints,
        "transfer": _on_transfer,
        "parameter sets": _on_sets,
        "trends": _on_trends,
        "bias": _on_bias,
        "paper": _on_paper,
    }
    return [{"about": about, "text": text} for about, write in subjects.items() for text in write(results)]


def sections(results: dict[str, Any]) -> list[ReportSection]:
    """Return the printed sections."""
    texts: dict[str, list[str]] = {}
    for item in results["findings"]:
        texts.setdefault(item["about"], []).append(item["text"])
    return [
        ReportSection("ER32 collet holder: the joint from printed natural frequencies", [], [SOURCE + "."]),
        ReportSection("The inferred holder", [_holder(results)], texts["holder"]),
        ReportSection("The joint of every tool at every torque (table 4)", [_joints(results)], texts["joint"]),
        ReportSection("Other overhangs (table 2)", [_transfers(results)], texts["transfer"]),
        ReportSection(
            "Four joints that match the tip FRF in the machine (table 3)", [_sets(results)], texts["parameter sets"]
        ),
        ReportSection("Stiffness over torque and diameter", _trends(results), texts["trends"]),
        ReportSection("The first mode of the long tools", _bias(results), texts["bias"]),
        ReportSection("Numbers printed in the paper", [], texts["paper"]),
        ReportSection("Summary", [], _summary(results)),
    ]


def _state(joint: dict[str, Any]) -> str:
    return f"{joint['diameter_mm']:g} mm at {joint['torque_nm']:g} N m"


def _worst(rows: Sequence[dict[str, Any]], key: str) -> dict[str, Any]:
    return max(rows, key=lambda row: abs(row[key]))


def _on_holder(results: dict[str, Any]) -> Iterator[str]:
    inferred = results["inferred"]
    at_bounds = ", ".join(q["name"] for q in inferred["quantities"] if q["at_bound"])
    yield f"The holder is inferred, not published. {inferred['how']}"
    yield (
        f"It reproduces these {inferred['frequencies']} frequencies to {inferred['rms_percent']:.2f} % rms. Agreement "
        "in frequencies and stiffnesses that were used to infer it is consistency, not validation."
    )
    limit = inferred["known_within_percent"]
    known = [q for q in inferred["quantities"] if q["standard_error_percent"] < limit]
    names = ", ".join(f"{q['name']} to {q['standard_error_percent']:.1f} %" for q in known)
    yield (
        f"The frequencies determine {inferred['combinations_known']} combinations of the "
        f"{len(inferred['quantities'])} fitted quantities within {limit:g} %"
        + (f", and of the quantities themselves only {names}" if known else "")
        + f". The rest of the shape follows from the bounds of that fit (at a bound: {at_bounds}): the holder has the "
        "right receptance at the nose, but it is not the holder of the drawing."
    )


def _on_joints(results: dict[str, Any]) -> Iterator[str]:
    joints = results["identified"]
    y, theta = (_worst(joints, f"{name}_difference_percent") for name in ("k_y", "k_theta"))
    yield (
        f"All {len(joints)} joints of table 4 are identified from two natural frequencies each. The largest difference "
        f"from the paper is {y['k_y_difference_percent']:+.1f} % in k_y ({_state(y)}) and "
        f"{theta['k_theta_difference_percent']:+.1f} % in k_theta ({_state(theta)})."
    )
    not_converged = [_state(j) for j in joints if not j["converged"]]
    others = [
        f"{_state(j)} ({j['starts_agreeing']} of {j['starts']})" for j in joints if j["starts_agreeing"] < j["starts"]
    ]
    if not_converged:
        yield f"Not converged: {', '.join(not_converged)}."
    if others:
        yield f"Not all starts agree: {', '.join(others)}."
    steps = results["settings"]["resolution"]
    yield (
        "The intervals contain every joint whose frequencies would be printed like the measured ones: steps of "
        f"{steps['fine_hz']:g} Hz below {steps['change_hz'] / 1e3:g} kHz and of {steps['coarse_hz']:g} Hz from there "
        "on (the paper states no resolution). They contain neither the error of the model nor the scatter between "
        "clampings."
    )
    error = results["settings"]["chance"]["overhang_mm"]
    spans = []
    for name in ("k_y", "k_theta"):
        changes = [error * abs(j[f"{name}_percent_per_mm"]) for j in joints]
        spans.append(f"{name} by {min(changes):.1f} to {max(changes):.1f} %")
    yield f"An error of {error:g} mm of the overhang moves {' and '.join(spans)}, at the same frequencies."


def _on_transfer(results: dict[str, Any]) -> Iterator[str]:
    theirs, ours = results["published_predictions"], results["transfer"]
    yield (
        f"With the paper's stiffnesses (table 5) the model reproduces the {len(theirs['rows'])} frequencies predicted "
        f"in table 2 to {theirs['rms_percent']:.2f} % rms (consistency: they were used to infer the holder)."
    )
    worst = _worst(ours["rows"], "error_percent")
    yield (
        f"With the joint identified at {load().torque_nm:g} N m it predicts the {len(ours['rows'])} measured ones to "
        f"{ours['rms_percent']:.2f} % rms; the paper's predictions reach {ours['published_rms_percent']:.2f} %. The "
        f"largest error is {worst['error_percent']:+.2f} %, of mode {worst['mode']} of the {worst['diameter_mm']:g} mm "
        f"tool at {worst['overhang_mm']:g} mm."
    )


def _on_sets(results: dict[str, Any]) -> Iterator[str]:
    threshold = results["parameter_sets"][0]["threshold_percent"]
    yield (
        f"A mode refutes a set if its error exceeds {threshold:.1f} %, {results['settings']['refutation']:g} times the "
        "rms error of the transfers above."
    )
    for chosen in results["parameter_sets"]:
        error = chosen["first_refutation_of_first_mode"]
        if error is not None:
            yield f"The first mode refutes {chosen['set']} from an overhang of {error['overhang_mm']:g} mm down."


def _on_trends(results: dict[str, Any]) -> Iterator[str]:
    for quantity in ("k_y", "k_theta"):
        steps = [s for trend in results["trends"]["torque"] if trend["quantity"] == quantity for s in trend["steps"]]
        up = sum(step["exceeds"] and step["percent"] > 0.0 for step in steps)
        down = sum(step["exceeds"] and step["percent"] < 0.0 for step in steps)
        yield (
            f"In the {len(steps)} single steps of torque {quantity} rises {up} times and falls {down} times by more "
            f"than the resolution; {len(steps) - up - down} steps are within it."
        )
    yield (
        "Each state was clamped once. The scatter between clampings is not published, so a trend that exceeds the "
        "resolution need not exceed the repeatability."
    )


def _p(value: float) -> str:
    return f"p = {value:.2g}" if value >= _SMALLEST_P else f"p < {_SMALLEST_P:g}"


def _on_bias(results: dict[str, Any]) -> Iterator[str]:
    bias, chance = results["long_first_mode_bias"], results["settings"]["chance"]
    percent, mean = bias["percent"], bias["mean_percent"]
    same_sign = len({np.sign(p) for p in percent}) == 1
    yield (
        f"First mode of the long tools, 100 (predicted / measured - 1): {', '.join(f'{p:+.2f}' for p in percent)} %, "
        f"mean {mean:+.2f} %"
        + (f"; predicted too {'low' if mean < 0.0 else 'high'} for all {len(percent)} diameters." if same_sign else ".")
    )
    sources = ", ".join(f"{name} {value:.2f}" for name, value in bias["deviations_percent"].items())
    yield (
        f"Definition of chance: readings uniform over the printed step; overhangs {chance['overhang_mm']:g} mm "
        f"(standard deviation; those printed twice differ by {bias['overhang_scatter_mm']:.2f} mm); shared by all "
        f"tools: carbide E {chance['carbide_modulus_percent']:g} % and density {chance['carbide_density_percent']:g} "
        f"%, steel E {chance['steel_modulus_percent']:g} % and density {chance['steel_density_percent']:g} %, every "
        f"dimension of the holder {chance['holder_dimension_percent']:g} %, nose factors "
        f"{chance['nose_factor_percent']:g} %. Standard deviation of the mean bias in %: {sources}; together "
        f"{bias['mean_deviation_percent']:.2f}."
    )
    verdict = "is too large for chance" if bias["p_value"] < _UNLIKELY else "cannot be distinguished from chance"
    simulation = bias["simulation"]
    yield (
        f"Two-sided p = {bias['p_value']:.3g} for the mean: the bias {verdict} under this model. {simulation['draws']} "
        f"simulations of the whole procedure (seed {simulation['seed']}) have a standard deviation of "
        f"{simulation['deviation_percent']:.2f} %, and {100 * simulation['share_as_large']:.1f} % of them a mean as "
        "large."
    )
    yield (
        "The answer depends on the errors that all tools share: readings and overhangs alone give "
        f"{_p(bias['p_value_without_shared'])}; with the standard errors of the inference "
        f"({bias['inference_deviation_percent']:.2f} % of the mean) in place of the tolerances of carbide and holder "
        f"{_p(bias['p_value_with_inference'])}, but these describe how well the paper's own model is known, not how "
        "well that model fits the real parts."
    )
    count = len(percent)
    # Variance of a mean of equally correlated numbers against that of independent ones.
    effective = count / (1.0 + (count - 1) * bias["mean_correlation"])
    yield (
        f"Sign test: p = {bias['sign_test_p_value']:.3g}. It assumes independent tools; under the model their errors "
        f"have a mean correlation of {bias['mean_correlation']:.2f}, so {count} tools count as {effective:.1f} "
        "independent ones."
    )
    yield _on_causes(results)


def _on_causes(results: dict[str, Any]) -> str:
    before = results["transfer"]["rms_percent"]
    causes = results["long_first_mode_bias"]["single_causes"]
    least = causes[0]
    after = least["rms_percent"]
    values = {q["name"]: q for q in results["inferred"]["quantities"]}
    value = ""
    if least["name"] in values:
        nominal = values[least["name"]]
        value = f"{nominal['value'] * (1.0 + 0.01 * least['change']):.4g} {nominal['unit']}, "
    text = (
        f"The least unlikely single cause is {least['name']} {least['change']:+.1f} {least['unit']} ({value}"
        f"{least['deviations'] or 0.0:.1f} standard deviations)"
    )
    if after is not None:
        text += f"; the rms error of table 2 then changes from {before:.2f} to {after:.2f} %"
    better = [c for c in causes if c["rms_percent"] is not None and c["rms_percent"] < before]
    if not better:
        return text + ". No single cause removes the bias without a larger error of table 2 as a whole."
    names = "; ".join(f"{c['name']} {c['change']:+.1f} {c['unit']} ({c['rms_percent']:.2f} %)" for c in better)
    torque = max(abs(t["change_percent"]) for t in results["trends"]["torque"] if t["quantity"] == "k_theta")
    return (
        f"{text}. Of all single causes only these reduce the error of table 2 as a whole: {names}; over the whole "
        f"range of torque k_theta changes by at most {torque:.1f} % (fitted line). No cause is named."
    )


def _on_paper(results: dict[str, Any]) -> Iterator[str]:
    for item in results["inconsistencies"]:
        article = "" if item["first_source"].startswith("table") else "the "
        text = (
            f"Inconsistent numbers in the paper: {item['what']} of the {item['diameter_mm']:g} mm tool is "
            f"{item['first']:g} {item['unit']} in {article}{item['first_source']}, {item['second']:g} {item['unit']} "
            f"in {item['second_source']}."
        )
        if item["k_y_change_percent"] is not None:
            text += (
                f" The latter changes the identified k_y by {item['k_y_change_percent']:+.1f} %, k_theta by "
                f"{item['k_theta_change_percent']:+.1f} %."
            )
        yield text
    published: Published = load()
    steps = results["settings"]["resolution"]
    coarse = [f for r in (*published.readings,) for f in r.frequency_hz if f >= steps["change_hz"]]
    coarse += [f for t in published.transfers for f in t.measured_hz if f >= steps["change_hz"]]
    odd = sorted({f for f in coarse if not np.isclose(f % steps["coarse_hz"], 0.0)})
    if odd:
        yield (
            f"Of {len(coarse)} measured frequencies from {steps['change_hz'] / 1e3:g} kHz on all but "
            f"{', '.join(f'{f:g} Hz' for f in odd)} are multiples of {steps['coarse_hz']:g} Hz."
        )
    yield (
        "Not reproduced, because the paper prints figures only: insertion lengths of 40, 30 and 20 mm (figures 12, "
        "13), high-speed steel against carbide (figure 15), damping over diameter (figure 6), and the tip FRFs in the "
        "machine (figures 7, 16, 17)."
    )


def _summary(results: dict[str, Any]) -> list[str]:
    theirs, ours, bias = results["published_predictions"], results["transfer"], results["long_first_mode_bias"]
    y, theta = (
        abs(_worst(results["identified"], f"{name}_difference_percent")[f"{name}_difference_percent"])
        for name in ("k_y", "k_theta")
    )
    refuted = ", ".join(chosen["set"] for chosen in results["parameter_sets"] if chosen["refuted"])
    return [
        f"published predictions: {theirs['rms_percent']:.2f} % rms; measured transfers: {ours['rms_percent']:.2f} % "
        f"rms (paper {ours['published_rms_percent']:.2f} %)",
        f"identified joints against the paper's: k_y within {y:.1f} %, k_theta within {theta:.1f} %",
        f"parameter sets refuted by some mode: {refuted or 'none'}",
        f"first mode of the long tools: {bias['mean_percent']:+.2f} % on average, p = {bias['p_value']:.2g} under "
        "the stated chance",
    ]


def _holder(results: dict[str, Any]) -> Table:
    return table(
        f"Inferred from {results['inferred']['frequencies']} frequencies; standard errors from these alone",
        results["inferred"]["quantities"],
        {
            "quantity": "name",
            "value": "value:.5g",
            "unit": "unit",
            "standard error [%]": "standard_error_percent:.3g",
            "at a bound of the fit": "at_bound",
        },
    )


def _joints(results: dict[str, Any]) -> Table:
    columns = {"d\n[mm]": "diameter_mm:g", "torque\n[N m]": "torque_nm:g"}
    for name, unit in (("k_y", "N/m"), ("k_theta", "N m/rad")):
        columns |= {
            f"{name}\n[{unit}]": f"{name}:.3e",
            f"interval\nof {name}": f"{name}_interval:.3e",
            f"{name} in\nthe paper": f"published_{name}:.2e",
            f"difference\nof {name} [%]": f"{name}_difference_percent:+.1f",
        }
    return table("Identified from two natural frequencies each", results["identified"], columns)


def _transfers(results: dict[str, Any]) -> Table:
    pairs = zip(results["transfer"]["rows"], results["published_predictions"]["rows"], strict=True)
    return table(
        "Natural frequencies, free assembly",
        [{**ours, "theirs": theirs} for ours, theirs in pairs],
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


def _sets(results: dict[str, Any]) -> Table:
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
    return table("Predicted with each set; * refutes it", rows, columns)


def _trends(results: dict[str, Any]) -> list[Table]:
    def with_steps(rows: list[dict[str, Any]]) -> tuple[list[dict[str, Any]], dict[str, str]]:
        names = [f"{step['start']:g} to\n{step['end']:g} [%] " for step in rows[0]["steps"]]
        extended = []
        for row in rows:
            steps = [f"{step['percent']:+.1f}{' ' if step['exceeds'] else '~'}" for step in row["steps"]]
            extended.append({**row, **dict(zip(names, steps, strict=True))})
        return extended, {name: f"{name}:>" for name in names}

    low, high = results["trends"]["torque_range_nm"]
    torque, torque_steps = with_steps(results["trends"]["torque"])
    diameter, diameter_steps = with_steps(results["trends"]["diameter"])
    return [
        table(
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
        ),
        table(
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
        ),
    ]


def _bias(results: dict[str, Any]) -> list[Table]:
    bias = results["long_first_mode_bias"]
    keys = ("diameter_mm", "overhang_mm", "percent", "published_percent", "tool_deviation_percent")
    rows = [dict(zip(keys, values, strict=True)) for values in zip(*(bias[key] for key in keys), strict=True)]
    mean = (None, None, bias["mean_percent"], float(np.mean(bias["published_percent"])), bias["mean_deviation_percent"])
    causes = bias["single_causes"]
    return [
        table(
            "100 (predicted / measured - 1) of mode 1; the last row is the mean",
            [*rows, dict(zip(keys, mean, strict=True))],
            {
                "d\n[mm]": "diameter_mm:g",
                "overhang\n[mm]": "overhang_mm:g",
                "ours\n[%]": "percent:+.2f",
                "paper\n[%]": "published_percent:+.2f",
                "chance, standard\ndeviation [%]": "tool_deviation_percent:.2f",
            },
        ),
        table(
            f"Single causes that would remove the mean bias, the {_CAUSES} least unlikely and the joint (the rms error "
            f"of table 2 is {results['transfer']['rms_percent']:.2f} % without them)",
            [*causes[:_CAUSES], *(c for c in causes[_CAUSES:] if c["deviations"] is None)],
            {
                "cause": "name",
                "change": "change:+.3g",
                "unit": "unit",
                "in standard\ndeviations": "deviations:.1f",
                "rms error of\ntable 2 [%]": "rms_percent:.2f",
            },
        ),
    ]
