"""What the study found, in sentences; each says what is the paper's and what is the virtual rig's."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from receptance.diagnosis import Candidate
    from receptance.studies.bt50.diagnosed import Diagnosed
    from receptance.studies.bt50.study import BT50Study

__all__ = ["PROVENANCE", "SOURCE", "damping_errors", "findings"]

SOURCE = (
    "C. Xu, J. Zhang, Z. Wu, D. Yu, P. Feng, Dynamic modeling and parameters identification of a spindle-holder taper "
    "joint, Springer-Verlag London, published online 10 November 2012"
)
PROVENANCE = (
    "The paper prints no FRFs, no dimensions and, in its text, only ranges. Everything measured here is virtual: an "
    "elastic BT50 holder by finite elements whose contact was made up so that the paper's ranges come about. Agreement "
    "with the paper is therefore no evidence; what the procedure makes of known data is."
)


def findings(study: BT50Study) -> tuple[tuple[str, str], ...]:
    """Return what each sentence is about, and the sentence."""
    return (
        *(("axial", text) for text in _axial(study)),
        *(("diagnosis", text) for one in study.diagnosed for text in _diagnosis(one)),
        *(("damping", text) for text in _damping(study)),
        *(("radial", text) for text in _radial(study)),
        *(("trends", text) for text in _trends(study)),
        *(("use", text) for text in _use(study)),
    )


def damping_errors(study: BT50Study) -> dict[str, dict[str, float]]:
    """Relative error of the axial damping ratio in percent, half-power and circle: mean, and rms about it.

    Over all forces, and over those at which the paper calls its damping unstable.
    """
    force = np.array([level.force_kn for level in study.axial])
    true = np.array([level.true_damping_ratio for level in study.axial])
    found: dict[str, dict[str, float]] = {}
    for name in ("half_power", "circle"):
        error = 100.0 * (np.array([getattr(level, name).damping_ratio for level in study.axial]) / true - 1.0)
        high = error[force > study.published["unstable_above_kn"]]
        found[name] = {
            "mean_percent": float(error.mean()),
            "scatter_percent": float(error.std()),
            "mean_above_percent": float(high.mean()),
            "scatter_above_percent": float(high.std()),
        }
    return found


def _axial(study: BT50Study) -> list[str]:
    low, high = study.published["axial_stiffness_n_per_m"]
    rigid, elastic = study.series["rigid k_z1"].values, study.series["elastic k_z1"].values
    off = 100.0 * (rigid / elastic - 1.0)
    left = study.left_out[0]
    rms = [level.rigid_rms for level in study.axial]
    own = [level.elastic.rms for level in study.axial]
    simulated = [100.0 * (level.simulated_hz / level.circle.frequency_hz - 1.0) for level in study.axial]
    return [
        f"Rigid holder, eq. 14: K_Z1 from {rigid[0]:.3g} to {rigid[-1]:.3g} N/m (paper: {low:.2g} to {high:.2g}; the "
        "rig was made so).",
        f"The FRF fitted with the rigid holder leaves {min(rms):.0f} to {max(rms):.0f} standard deviations; with the "
        f"elastic one {min(own):.1f} to {max(own):.1f}, and K_Z1 is then {elastic[0]:.3g} to {elastic[-1]:.3g} N/m: "
        f"the rigid one's is off by {off.min():+.1f} to {off.max():+.1f} %.",
        f"The rigid holder's K_Z1 in the elastic model, which is how the paper simulates, puts the first mode "
        f"{min(simulated):+.1f} to {max(simulated):+.1f} % off the experiment (paper: about "
        f"-{study.published['simulated_below_experiment_percent']:g} %).",
        f"Force levels left out ({len(left.force_kn)}), predicted from laws of the others: "
        f"{left.rigid_rms_percent:.2g} % rms before, {left.elastic_rms_percent:.2g} % after the model got the body's "
        "elasticity.",
    ]


def _diagnosis(one: Diagnosed) -> list[str]:
    """Say what the diagnosis says; which cause it is stands in its verdict alone."""
    verdict = one.verdict
    forces = ", ".join(f"{force:g}" for force in one.seen_kn)
    said = [
        f"`diagnose` was given the {one.motion} FRFs at {forces} kN, the rigid holder with its springs free at each of "
        f"them, and all causes of its catalogue. It answers: {verdict.verdict}. The rigid holder leaves "
        f"{verdict.adequacy.misfit:.3g} times what noise and floor explain"
        + ("." if verdict.adequacy_after is None else f", the best explanation {verdict.adequacy_after.misfit:.2f}.")
    ]
    if one.certain:
        causes = "; ".join(f"{cause.meaning} ({cause.id}, {_sizes(cause)})" for cause in one.certain)
        where = "In every explanation" if verdict.ambiguous_between else "The explanation"
        said.append(f"{where}: {causes}.")
    if verdict.ambiguous_between:
        said.append(
            "These data cannot tell what acts with it: " + ", ".join(verdict.ambiguous_between) + "."
            if one.certain
            else "These data cannot tell which: " + ", ".join(verdict.ambiguous_between) + "."
        )
    gains = "; ".join(
        f"{gain.metric}, {gain.held_out_before:.3g} before and {gain.held_out_after:.3g} after, better by "
        f"{gain.interval[0]:.3g} to {gain.interval[1]:.3g}"
        for gain in one.gains
    )
    if gains:
        said.append(
            f"At the {len(one.left_out_kn)} forces between, which it was not given (springs on straight lines between "
            f"those that it found): {gains}."
        )
    if verdict.next_measurement is not None:
        said.append(f"It would next {verdict.next_measurement.action}: {verdict.next_measurement.reason}.")
    return said


def _sizes(cause: Candidate) -> str:
    return ", ".join(
        f"{name.partition('.')[2]} {value:.3g} ({low:.3g} to {high:.3g})"
        for name, (value, low, high) in cause.parameters.items()
    )


def _damping(study: BT50Study) -> list[str]:
    errors = damping_errors(study)
    lines = [level.half_power.lines_in_band for level in study.axial]
    rough, fine = errors["half_power"], errors["circle"]
    above = study.published["unstable_above_kn"]
    return [
        f"At {study.published['spacing_hz']:g} Hz the axial half-power band holds {min(lines):.1f} to {max(lines):.1f} "
        f"lines. Half-power damping is {rough['mean_percent']:+.1f} % off on average and scatters by "
        f"{rough['scatter_percent']:.1f} % about that; a circle through the same hits, with an exponential window, by "
        f"{fine['scatter_percent']:.2f} % about {fine['mean_percent']:+.2f} %.",
        f"Above {above:g} kN, where the paper calls its damping unstable: half-power "
        f"{rough['mean_above_percent']:+.1f} % and a scatter of {rough['scatter_above_percent']:.1f} %, circle "
        f"{fine['mean_above_percent']:+.2f} % and "
        f"{fine['scatter_above_percent']:.2f} %. The virtual rig's damping rises smoothly there.",
        "The response has not died away when a block of 50 ms ends: without a window the estimate says so on most "
        "lines, and the paper states none.",
    ]


def _radial(study: BT50Study) -> list[str]:
    left = study.left_out[1]
    refused = sum(level.solutions.of_neither for level in study.radial)
    clear = sum(len(level.solutions.solutions) == 1 for level in study.radial)
    two = sum(len(level.solutions.solutions) == 2 for level in study.radial) - refused
    none = sum(not level.solutions.solutions for level in study.radial)
    own = [level.elastic.rms for level in study.radial]
    return [
        f"Rigid holder across: of {len(study.radial)} levels the mode shape chooses one joint at {clear}, leaves two "
        f"at {two}, refuses both at {refused}, and at {none} no real joint has the frequencies. At "
        f"{study.radial[-1].force_kn:g} kN "
        f"{study.radial[-1].solutions.statement}.",
        f"The elastic holder, its contact fading from both ends, leaves {min(own):.1f} to {max(own):.1f} standard "
        f"deviations. Left-out levels, both modes: {left.rigid_rms_percent:.2g} % rms with the rigid holder's springs "
        f"of the levels themselves, {left.elastic_rms_percent:.2g} % with laws of the elastic one's.",
    ]


def _trends(study: BT50Study) -> list[str]:
    """Say what each parameter does over force, and what becomes of the paper's claims."""
    said = [f"{series.sentence()}." for series in study.series.values()]
    claims = (
        ('stiffness rises with force in both directions (its "positive reinforce")', "k_", "rises", ("z1", "x1", "x2")),
        ("damping rises along the axis", "c_", "rises", ("z1",)),
        ("damping falls across", "c_", "falls", ("x1", "x2")),
    )
    for claim, kind, direction, ends in claims:
        own = {end: study.series[f"elastic {kind}{end}"].trend() for end in ends}
        shown = ", ".join(f"{kind}{end} {trend.direction} ({trend.rarity})" for end, trend in own.items())
        holds = all(trend.direction == direction for trend in own.values())
        said.append(
            f"The paper says: {claim}. On the virtual rig that {'holds' if holds else 'does not hold'}: {shown}."
        )
    return said


def _use(study: BT50Study) -> list[str]:
    said = []
    for one in study.damping_ignored:
        bands = ", ".join(f"{low:.0f} to {high:.0f}" for low, high in one.differs_hz)
        share = 100.0 * sum(high - low for low, high in one.differs_hz) / float(np.ptp(one.frequency_hz))
        said.append(
            f"Harmonic response at the tip, {one.motion}: without damping it is within 5 % except at {bands} Hz, "
            f"{share:.0f} % of the band to {one.frequency_hz[-1] / 1e3:.0f} kHz. There the paper's advice to ignore "
            "damping does not hold."
        )
    axial, radial = study.bonded_hz["axial"][0], study.bonded_hz["radial"][0]
    said.append(
        f"Bonded, the first modes lie at {axial:.0f} Hz (axial) and {radial:.0f} Hz (radial) whatever the force; the "
        f"experiment has {study.axial[-1].circle.frequency_hz:.0f} and {study.radial[-1].modes.frequency_hz[0]:.0f} Hz "
        f"at {study.axial[-1].force_kn:g} kN."
    )
    return said
