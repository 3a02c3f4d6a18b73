"""Tables and sentences of the BT50 study; every number in them comes from the results of `bt50.study`."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

from rich.console import Console

from output import WIDTH, print_table
from receptance.report import terminal

SOURCE = (
    "C. Xu, J. Zhang, Z. Wu, D. Yu, P. Feng, Dynamic modeling and parameters identification of a spindle-holder taper "
    "joint, Springer-Verlag London, published online 10 November 2012"
)
PROVENANCE = (
    "The paper prints no FRFs, no dimensions and, in its text, only ranges. Everything measured here is VIRTUAL: an "
    "elastic BT50 holder by finite elements, with a contact invented to give the ranges of the paper. Agreement with "
    "the paper is therefore no evidence. The results show the accuracy of the procedure on known data."
)
RESPONSE_HZ = (100.0, 7995.0)
"""First and last line of the harmonic response."""
_CLAIMS = (
    ('stiffness rises with force in both directions (its "positive reinforce")', "rises", ("k_z1", "k_x1", "k_x2")),
    ("damping rises along the axis", "rises", ("c_z1",)),
    ("damping falls across", "falls", ("c_x1", "c_x2")),
)


def show(results: dict[str, Any]) -> None:
    """Print all results."""
    print(f"BT50 taper over drawbar force. {SOURCE}.\n{PROVENANCE} Seed {results['settings']['seed']}.")
    virtual = results["virtual"]
    _axial(virtual["axial"])
    _say(_on_axial(results))
    print("\nDiagnosis of the rigid holder")
    _say(_on_diagnosis(results))
    _damping(virtual["axial"])
    _say(_on_damping(results))
    _radial(virtual["radial"])
    _say(_on_radial(results))
    for series in results["_series"].values():
        for table in series.tables():
            terminal.print_table(Console(width=WIDTH), table)
    _say(_on_trends(results))
    _say(_on_use(results))


def _say(sentences: Iterator[str]) -> None:
    print()
    for sentence in sentences:
        print(sentence)


def _percent(value: float, reference: float) -> float:
    return 100.0 * (value / reference - 1.0)


def _span(values: list[float], form: str) -> str:
    return f"{min(values):{form}} to {max(values):{form}}"


def _on_axial(results: dict[str, Any]) -> Iterator[str]:
    levels, published = results["virtual"]["axial"], results["published"]
    rigid = [level["rigid"]["values"]["k_z1"] for level in levels]
    elastic = [level["elastic"]["values"]["k_z1"] for level in levels]
    low, high = published["axial_stiffness_n_per_m"]
    yield (
        f"Rigid holder, eq. 14: K_Z1 from {rigid[0]:.3g} to {rigid[-1]:.3g} N/m (paper: {low:.2g} to {high:.2g}; the "
        "rig was made for this range)."
    )
    yield (
        f"The residuals of the FRF are {_span([level['rigid_rms'] for level in levels], '.0f')} standard deviations "
        f"with the rigid holder, {_span([level['elastic']['rms'] for level in levels], '.1f')} with the elastic one. "
        f"Its K_Z1 is {elastic[0]:.3g} to {elastic[-1]:.3g} N/m; that of the rigid holder is wrong by "
        f"{_span([_percent(a, b) for a, b in zip(rigid, elastic, strict=True)], '+.1f')} %."
    )
    simulated = [_percent(level["simulated_hz"], level["experiment_hz"]) for level in levels]
    yield (
        "The K_Z1 of the rigid holder in the elastic model, which is how the paper simulates, gives an error of the "
        f"first mode of {_span(simulated, '+.1f')} % (paper: about "
        f"-{published['simulated_below_experiment_percent']:g} %)."
    )
    left = results["virtual"]["left_out"][0]
    yield (
        f"Force levels left out ({len(left['force_kn'])}), predicted from laws of the others: "
        f"{left['before_rms_percent']:.2g} % rms with the rigid body, {left['after_rms_percent']:.2g} % with the "
        "elastic one."
    )


def _on_diagnosis(results: dict[str, Any]) -> Iterator[str]:
    for diagnosis in results["virtual"]["diagnosis"]:
        after = diagnosis["adequacy_after"]
        forces = ", ".join(f"{force:g}" for force in diagnosis["seen_kn"])
        yield (
            f"Diagnosis of the {diagnosis['motion']} FRFs at {forces} kN, with the rigid holder, its springs free at "
            f"each force, and all causes of the catalogue. Verdict: {diagnosis['verdict']}. The misfit of the rigid "
            f"holder is {diagnosis['adequacy']['misfit']:.3g} times that of noise and floor"
            + ("." if after is None else f", that of the best explanation {after['misfit']:.2f} times.")
        )
        certain = [cause for cause in diagnosis["causes"] if cause["id"] in diagnosis["in_every_explanation"]]
        ambiguous = ", ".join(diagnosis["ambiguous_between"])
        if certain:
            causes = "; ".join(f"{cause['meaning']} ({cause['id']}, {_sizes(cause)})" for cause in certain)
            yield f"{'In every explanation' if ambiguous else 'The explanation'}: {causes}."
        if ambiguous:
            yield f"These data cannot distinguish {'a second cause' if certain else 'between'}: {ambiguous}."
        gains = "; ".join(
            f"{gain['metric']}, {gain['held_out_before']:.3g} before and {gain['held_out_after']:.3g} after, better by "
            f"{gain['interval'][0]:.3g} to {gain['interval'][1]:.3g}"
            for gain in diagnosis["gains"]
        )
        if gains:
            yield (
                f"At the {len(diagnosis['left_out_kn'])} forces between, which are held out (springs interpolated "
                f"linearly): {gains}."
            )
        advice = diagnosis["next_measurement"]
        if advice is not None:
            yield f"Next measurement: {advice['action']}: {advice['reason']}."


def _sizes(cause: dict[str, Any]) -> str:
    return ", ".join(
        f"{name.partition('.')[2]} {size['value']:.3g} ({size['lower']:.3g} to {size['upper']:.3g})"
        for name, size in cause["parameters"].items()
    )


def _on_damping(results: dict[str, Any]) -> Iterator[str]:
    rough, fine = (results["virtual"]["damping_errors"][name] for name in ("half_power", "circle"))
    lines = [level["half_power"]["lines_in_band"] for level in results["virtual"]["axial"]]
    yield (
        f"At {results['published']['spacing_hz']:g} Hz the axial half-power band contains {_span(lines, '.1f')} lines. "
        f"Half-power damping has a mean error of {rough['mean_percent']:+.1f} % and a scatter of "
        f"{rough['scatter_percent']:.1f} %; a circle through the same hits, with an exponential window, "
        f"{fine['mean_percent']:+.2f} % and {fine['scatter_percent']:.2f} %."
    )
    yield (
        f"Above {results['published']['unstable_above_kn']:g} kN, where the paper calls its damping unstable: "
        f"half-power {rough['mean_above_percent']:+.1f} % with a scatter of {rough['scatter_above_percent']:.1f} %, "
        f"circle {fine['mean_above_percent']:+.2f} % with {fine['scatter_above_percent']:.2f} %. The damping of the "
        "virtual rig rises smoothly there."
    )
    yield (
        "The response has not decayed at the end of a block of 50 ms: without a window the estimate warns of this on "
        "most lines, and the paper states no window."
    )


def _on_radial(results: dict[str, Any]) -> Iterator[str]:
    levels, left = results["virtual"]["radial"], results["virtual"]["left_out"][1]
    counts = [len(level["rigid"]["solutions"]) for level in levels]
    refused = sum(level["rigid"]["of_neither"] for level in levels)
    last = levels[-1]
    yield (
        f"Rigid holder across: of {len(levels)} levels the mode shape selects one joint at {counts.count(1)}, permits "
        f"two at {counts.count(2) - refused}, rejects both at {refused}, and at {counts.count(0)} no real joint has "
        f"the frequencies. At {last['force_kn']:g} kN {last['rigid']['statement']}."
    )
    yield (
        "The residuals of the elastic holder, its contact fading from both ends, are "
        f"{_span([level['elastic']['rms'] for level in levels], '.1f')} standard deviations. Levels left out, both "
        f"modes: {left['before_rms_percent']:.2g} % rms with the rigid holder's springs of the levels themselves, "
        f"{left['after_rms_percent']:.2g} % with laws of the elastic holder's."
    )


def _on_trends(results: dict[str, Any]) -> Iterator[str]:
    parameters = results["_series"]
    for series in parameters.values():
        yield f"{series.sentence()}."
    for claim, direction, names in _CLAIMS:
        trends = {name: parameters[f"elastic {name}"].trend() for name in names}
        text = ", ".join(f"{name} {trend.direction} ({trend.significance})" for name, trend in trends.items())
        holds = all(trend.direction == direction for trend in trends.values())
        yield f"Claim of the paper: {claim}. On the virtual rig this {'holds' if holds else 'does not hold'}: {text}."


def _on_use(results: dict[str, Any]) -> Iterator[str]:
    virtual = results["virtual"]
    for motion, bands in virtual["damping_matters_hz"].items():
        ranges = ", ".join(f"{low:.0f} to {high:.0f}" for low, high in bands)
        low, high = RESPONSE_HZ
        share = 100.0 * sum(b - a for a, b in bands) / (high - low)
        yield (
            f"Harmonic response at the tip, {motion}: without damping it is within 5 % except at {ranges} Hz, "
            f"{share:.0f} % of the band to {high / 1e3:.0f} kHz. There the paper's advice to ignore damping does not "
            "hold."
        )
    axial, radial = virtual["axial"][-1], virtual["radial"][-1]
    bonded = virtual["bonded_hz"]
    yield (
        f"Bonded, the first modes are at {bonded['axial'][0]:.0f} Hz (axial) and {bonded['radial'][0]:.0f} Hz (radial) "
        f"for any force; the experiment has {axial['experiment_hz']:.0f} and {radial['experiment_hz'][0]:.0f} Hz at "
        f"{axial['force_kn']:g} kN."
    )


def _axial(levels: list[dict[str, Any]]) -> None:
    print_table(
        "Virtual experiment; simulated: the elastic holder on the rigid holder's spring",
        [
            {
                **level,
                "simulated_percent": _percent(level["simulated_hz"], level["experiment_hz"]),
                "elastic_percent": _percent(level["elastic_hz"], level["experiment_hz"]),
            }
            for level in levels
        ],
        {
            "force\n[kN]": "force_kn:g",
            "experiment\n[Hz]": "experiment_hz:.1f",
            "K_Z1 rigid\n[N/m]": "rigid.values.k_z1:.4e",
            "K_Z1 elastic\n[N/m]": "elastic.values.k_z1:.4e",
            "interval": "elastic.intervals.k_z1:.4e",
            "simulated\n[Hz]": "simulated_hz:.1f",
            "its error\n[%]": "simulated_percent:+.2f",
            "elastic\n[Hz]": "elastic_hz:.1f",
            "error\n[%]": "elastic_percent:+.3f",
        },
    )


def _damping(levels: list[dict[str, Any]]) -> None:
    estimates = ("half_power", "circle", "truth")
    print_table(
        "Damping ratio, and the damping of eq. 15 from it",
        [{**level, **{f"{n} %": 100.0 * level[n]["damping_ratio"] for n in estimates}} for level in levels],
        {
            "force\n[kN]": "force_kn:g",
            "lines in\nthe band": "half_power.lines_in_band:.1f",
            "half-power\n[%]": "half_power %:.3f",
            "circle\n[%]": "circle %:.3f",
            "of the rig\n[%]": "truth %:.3f",
            "C_Z1 half-power\n[N s/m]": "rigid_half_power.values.c_z1:.0f",
            "C_Z1 circle\n[N s/m]": "rigid.values.c_z1:.0f",
            "interval": "rigid.intervals.c_z1:.0f",
        },
    )


def _radial(levels: list[dict[str, Any]]) -> None:
    rows = []
    for level in levels:
        simulated = level["simulated_hz"] or [None, None]
        rows.append(
            {
                **level,
                "measured": dict(zip("12", level["experiment_hz"], strict=True)),
                "simulated": dict(zip("12", simulated, strict=True)),
            }
        )
    print_table(
        "Elastic holder; simulated: on the rigid holder's springs",
        rows,
        {
            "force\n[kN]": "force_kn:g",
            **{f"mode {i}\n[Hz]": f"measured.{i}:.1f" for i in "12"},
            "K_X1\n[N/m]": "elastic.values.k_x1:.3e",
            "interval\nof K_X1": "elastic.intervals.k_x1:.3e",
            "K_X2\n[N/m]": "elastic.values.k_x2:.3e",
            "interval\nof K_X2": "elastic.intervals.k_x2:.3e",
            **{f"C_X{i}\n[N s/m]": f"elastic.values.c_x{i}:.0f" for i in "12"},
            **{f"simulated\n{i} [Hz]": f"simulated.{i}:.1f" for i in "12"},
        },
    )
