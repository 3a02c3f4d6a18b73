"""Claims of the paper, tables, sentences and the figure of the clamping study."""

from __future__ import annotations

from typing import Any

import numpy as np
from matplotlib.figure import Figure

from clamping_errors import CLAIMED_SHARE, ERRORS, FACTORS, HSS, WORTH_PERCENT
from clamping_insertion import CONSTANT, GROWTH, ONE, POWER, SERIES, needed_ratio
from clamping_laws import RECLAMPED_MM
from output import print_table
from table3_tests import CARBIDE_LOSS, STEEL_LOSS, TRUTH

CLAIMS = {
    "insertion": (
        "figures 12 and 13, text",
        "For a tool diameter of 9.53 mm, 11.11 mm, 12.7 mm and 16 mm the stiffness is almost constant [over insertions "
        "of 40, 30 and 20 mm]. A reason for this is that the clamping interface can be modeled as two springs in "
        "series.",
    ),
    "material": (
        "figure 15, text",
        "The difference between both materials [carbide, high-speed steel] varies between 10% for the 9.54 mm tool and "
        "31% for 12.70 mm tool. The rotational stiffness shows even a bigger deviation. Except for the 12.7 mm tool, "
        "each difference is over 45%.",
    ),
    "damping": (
        "figure 6, text",
        "due to the fact that magnitude is varying and damping is low enough that it does not affect the modeling of "
        "spindle-holder-tool assembly, we neglect the damping in further research",
    ),
    "torque": (
        "table 4, text",
        "the influence of clamping torque is low for this holder and tool connection. Although the change of "
        "eigenvalues is low, the percentage difference for stiffness parameters is huge.",
    ),
    "diameter": (
        "figure 6, text",
        "The almost constant translational stiffness of the first three diameters can be explained by various clamping "
        "conditions.",
    ),
}


def show(found: dict[str, Any]) -> None:
    """Print the results."""

    def head(about: str, title: str) -> None:
        where, text = CLAIMS[about]
        print(f'\n==== {title}\nClaim ({where}): "{text}"')

    noise = 100 * found["settings"]["noise"]
    head("insertion", "VIRTUAL: insertions of 40, 30 and 20 mm with two springs in series (eq. 15)")
    print_table(
        f"Laws fitted to all insertions, {noise:.1f} % noise, lines 10 Hz apart, seed {found['settings']['seed']}",
        [
            {**one, "ratio": case["ratio"], "behind": case["hypotheses"][0]["log_evidence"] - one["log_evidence"]}
            for case in found["insertion"]["cases"]
            for one in case["hypotheses"]
        ],
        {
            "k2 / k1": "ratio:g",
            "law of the joint over the insertion": "name",
            "log evidence behind the best": "behind:.0f",
            "rms": "rms:.2f",
            "explains the noise": "adequate",
        },
    )
    print_table(
        "Change from 40 to 20 mm in percent, and share of the outer contact in the compliance with its standard error",
        [
            {
                "ratio": case["ratio"],
                **case["change_percent"],
                **dict(zip(("f1", "f2"), case["frequency_percent"], strict=True)),
                **{
                    f"share {name}": "" if share is None else f"{100 * share[0]:.1f} +- {100 * share[1]:.1f} %"
                    for name, share in case["compliance_of_outer"].items()
                },
            }
            for case in found["insertion"]["cases"]
        ],
        {
            "k2 / k1": "ratio:g",
            **{name: f"{name}:+.0f" for name in GROWTH},
            "mode 1": "f1:+.1f",
            "mode 2": "f2:+.1f",
            **{f"share in {name}": f"share {name}" for name in GROWTH},
        },
    )
    print(
        f"\nBy eq. 15 halving the insertion changes k_y by less than 10 % above k2 / k1 = {needed_ratio(1.0):.0f}, and "
        f"k_theta, if it grows with the cube of the length, above {needed_ratio(3.0):.0f}."
    )
    head("material", "VIRTUAL: high-speed steel against carbide with the same joint")
    material = found["material"]
    tools = list(dict.fromkeys(one["diameter_mm"] for one in material["changes"]))
    print_table(
        "Apparent change of k_y / k_theta in percent through an error in the model of the steel blank",
        [
            {
                "error": error,
                **{
                    f"{one['diameter_mm']:g}": f"{one['k_y_percent']:+.1f} / {one['k_theta_percent']:+.1f}"
                    for one in material["changes"]
                    if one["slip"] == error
                },
            }
            for error in ERRORS
        ],
        {"error": "error", **{f"{d:g} mm": f"{d:g}" for d in tools}},
    )
    needed = ", ".join(f"{value:+.1f} % ({tool})" for tool, value in material["modulus_percent"].items())
    print(
        f"\nHSS: E {HSS.youngs_modulus / 1e9:g} GPa, {HSS.density:g} kg/m3, assumed; the paper prints neither. Without "
        f"an error the joint is reproduced to {max(material['control_percent'], 1e-6):.0e} %. An error of the modulus "
        f"of {needed} alone changes k_theta by the claimed {100 * CLAIMED_SHARE:g} %. The bare blank has to be "
        "measured before a joint can be said to depend on the material of the tool."
    )
    head("damping", "VIRTUAL: damping at the interface neglected")
    damping = found["damping"]
    print_table(
        "Error of the least real part in percent if x times the damping of table 3 is neglected",
        [
            {
                "test": test,
                "allowed": allowed if np.isfinite(allowed) else None,
                "peak": next(c["peak_percent"] for c in damping["cases"] if (c["test"], c["factor"]) == (test, 1.0)),
                **{f"{c['factor']:g}": c["real_percent"] for c in damping["cases"] if c["test"] == test},
            }
            for test, allowed in damping["allowed_factor"].items()
        ],
        {
            "test": "test",
            **{f"x = {x:g}": f"{x:g}:+.1f" for x in FACTORS},
            f"x for {WORTH_PERCENT:g} % (empty: > 1000)": "allowed:.2g",
            "highest peak, x = 1": "peak:+.1f",
        },
    )
    print(
        f"\nc_theta {TRUTH['joint.c_theta']:g} N m s/rad as printed, c_y {TRUTH['joint.c_y']:g} N s/m "
        f"assumed, loss factors of the materials {CARBIDE_LOSS:g} and {STEEL_LOSS:g}. The result depends "
        "on the damping of the rest of the machine."
    )
    low, high = found["torque_range_nm"]
    head("torque", "Published: k_y over clamping torque (table 4)")
    print_table(
        f"Growth of k_y from {low:g} to {high:g} N m in percent",
        [
            {
                **one,
                "exponent": one["law"]["exponent"],
                "growth": one["law"]["change_percent"][0],
                "interval": one["law"]["change_percent"][1:],
                **{f"{key} {name}": one[name][key] for name in ("law", "law_if_reclamped") for key in one["law"]},
            }
            for one in found["torque"]
        ],
        {
            "d [mm]": "diameter_mm:g",
            "end values": "change_of_end_values_percent:+.1f",
            "fitted line": "change_percent:+.1f",
            "by the resolution": "interval_of_resolution:+.1f",
            "more than that": "more_than_resolution",
            "exponent": "exponent:.2f",
            "power law": "growth:+.1f",
            "95 %": "interval:+.1f",
            "log evidence": "log_evidence_against_constant law:+.1f",
            "more than scatter": "significant law",
            "log evidence if reclamped": "log_evidence_against_constant law_if_reclamped:+.1f",
            "if reclamped": "significant law_if_reclamped",
        },
    )
    print(
        "\nEvery state has an individual part, so a law has to exceed their scatter about it; if reclamped, each "
        f"state also has an error of the overhang of {RECLAMPED_MM:g} mm. Neither describes a second collet."
    )
    head("diameter", "Published: stiffness over diameter (tables 1, 4, 5)")
    print_table(
        "Power laws of the diameter against constants; five tools in one holder",
        found["diameter"],
        {
            "": "quantity",
            "exponent": "exponent:.2f",
            "95 %": "interval:.2f",
            "scatter [%]": "scatter_percent:.0f",
            "log evidence": "log_evidence_against_constant:+.1f",
            "more than scatter": "significant",
        },
    )
    steps = " and ".join(
        f"{s['percent']:+.1f} % from {s['start']:g} to {s['end']:g} mm ({'more' if s['exceeds'] else 'less'} than the "
        "resolution)"
        for s in found["diameter_steps"][:2]
    )
    print(f"\nk_y changes by {steps}; the tools scatter {found['diameter_scatter_percent']:.0f} % about a power law.")


def draw(found: dict[str, Any]) -> Figure:
    """Return a figure of the five studies."""
    figure = Figure(figsize=(16.0, 9.0), layout="constrained")
    figure.suptitle("Clamping of an ER32 collet holder")
    (series, evidence, material), (damping, torque, diameter) = figure.subplots(2, 3)
    ratio = np.geomspace(0.1, 1000.0, 200)
    for name, growth in GROWTH.items():
        change = 100.0 * ((1.0 + 1.0 / ratio) / (1.0 + 2.0**growth / ratio) - 1.0)
        series.semilogx(ratio, change, label=f"{name}, length to the power {growth:g}")
    series.axhline(-10.0, color="tab:red", linestyle=":")
    series.set(title="VIRTUAL: eq. 15, insertion halved", xlabel="k2 / k1 at full insertion", ylabel="change (%)")
    cases = found["insertion"]["cases"]
    for name in (ONE, CONSTANT, POWER, SERIES):
        behind = [
            next(
                case["hypotheses"][0]["log_evidence"] - h["log_evidence"]
                for h in case["hypotheses"]
                if h["name"] == name
            )
            for case in cases
        ]
        evidence.plot(range(len(cases)), behind, "o", label=name)
    evidence.set_yscale("symlog", linthresh=1.0)
    evidence.set_xticks(range(len(cases)), [f"{case['ratio']:g}" for case in cases])
    evidence.set(title="VIRTUAL: laws of the insertion", xlabel="k2 / k1", ylabel="log evidence behind the best")
    for error in ERRORS:
        own = [one for one in found["material"]["changes"] if one["slip"] == error]
        material.plot([o["diameter_mm"] for o in own], [o["k_theta_percent"] for o in own], "o-", label=error)
    material.set(title="VIRTUAL: errors of the steel blank", xlabel="diameter (mm)", ylabel="change of k_theta (%)")
    for test in found["damping"]["allowed_factor"]:
        own = [c for c in found["damping"]["cases"] if c["test"] == test]
        damping.loglog([c["factor"] for c in own], [max(c["real_percent"], 1e-3) for c in own], "o-", label=test)
    damping.set(title="VIRTUAL: damping neglected", xlabel="times table 3's", ylabel="error of the least real part (%)")
    for shift, key, label in ((-0.1, "law", "one clamping"), (0.1, "law_if_reclamped", "clamped again each time")):
        changes = np.array([one[key]["change_percent"] for one in found["torque"]])
        ends = [changes[:, 0] - changes[:, 1], changes[:, 2] - changes[:, 0]]
        torque.errorbar(np.arange(len(changes)) + shift, changes[:, 0], ends, fmt="o", capsize=3, label=label)
    torque.set_xticks(range(len(found["torque"])), [f"{one['diameter_mm']:g}" for one in found["torque"]])
    torque.set(title="Published: growth of k_y over torque", xlabel="diameter (mm)", ylabel="change (%)")
    for row, one in enumerate(found["diameter"]):
        diameter.plot(one["interval"], [row, row], linewidth=3.0, label=one["quantity"])
        diameter.plot(one["exponent"], row, "ko")
    diameter.set(title="Published: exponent of the diameter", xlabel="exponent", yticks=[])
    for axes in figure.axes:
        axes.legend(fontsize=8)
    return figure
