"""What the clamping studies found, in sentences that follow from their numbers."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from receptance.studies.clamping.insertion import INSERTIONS_MM, SERIES, needed_ratio
from receptance.studies.clamping.material import CLAIMED_SHARE
from receptance.studies.clamping.trends import RECLAMPED_MM

if TYPE_CHECKING:
    from receptance.studies.clamping.insertion import InsertionCase
    from receptance.studies.clamping.study import ClampingStudy
    from receptance.studies.clamping.trends import FittedLaw, TorqueVerdict

__all__ = ["findings"]

_SETTLED = 3.0
"""Difference of log evidence, a factor of 20 in probability, below which two laws are not told apart."""


def findings(study: ClampingStudy) -> tuple[tuple[str, str], ...]:
    """Return pairs of subject and sentences."""
    return (
        *(("insertion", text) for text in _on_insertion(study)),
        *(("material", text) for text in _on_material(study)),
        *(("damping", text) for text in _on_damping(study)),
        *(("torque", text) for text in _on_torque(study)),
        *(("diameter", text) for text in _on_diameter(study)),
    )


def _on_insertion(study: ClampingStudy) -> Iterator[str]:
    yield (
        "VIRTUAL: a 12.7 mm blank in the inferred holder, joints in series, free-free responses simulated with "
        f"{100 * study.insertion.noise:.1f} % noise on lines 10 Hz apart (seed {study.insertion.seed}), carbide E 1 % "
        "and every overhang 0.1 mm uncertain; the inner contact is a layer (k_y as the insertion, k_theta as its cube)."
    )
    for case in study.insertion.cases:
        yield _on_case(case)
    last = INSERTIONS_MM[-1]
    yield (
        f"By eq. 15, {INSERTIONS_MM[0]:g} to {last:g} mm changes k_y by less than 10 % only where the inner contact is "
        f"at least {needed_ratio(1.0):.0f} times as stiff as the collet's outer one, and k_theta only from "
        f"{needed_ratio(3.0):.0f} times on: that k_theta hardly depends on the insertion asks for much more than k_y, "
        "or for a pressure that moves along."
    )


def _on_case(case: InsertionCase) -> str:
    shares = [case.compliance_of_outer(name) for name in ("k_y", "k_theta")]
    text = (
        f"k2 = {case.ratio:g} k1: over the insertions the total k_y changes by {case.change_percent['k_y']:+.0f} %, "
        f"k_theta by {case.change_percent['k_theta']:+.0f} %, the first two natural frequencies by "
        f"{case.frequency_percent[0]:+.1f} and {case.frequency_percent[1]:+.1f} %. {_which(case)} (log "
        f"evidence {_evidence(case.margin)} above the next, rms of its residuals {case.found.fit.rms:.2f})"
    )
    if case.found.name == SERIES and all(share is not None for share in shares):
        y, theta = (share for share in shares if share is not None)
        text += (
            f"; of the compliance {100 * y[0]:.0f} +- {100 * y[1]:.0f} % (y) and {100 * theta[0]:.1f} +- "
            f"{100 * theta[1]:.1f} % (theta) are the collet's outer contact, which the insertion does not change"
        )
    return text + "."


def _which(case: InsertionCase) -> str:
    if case.margin >= _SETTLED:
        return f"Most likely: {case.found.name}"
    first, second = (one.name for one in case.hypotheses[:2])
    return f"Not told apart: {first}, and {second}"


def _on_material(study: ClampingStudy) -> Iterator[str]:
    material = study.material
    yield (
        "VIRTUAL: blanks of high-speed steel (E "
        f"{material.material.youngs_modulus / 1e9:g} GPa, {material.material.density:g} kg/m3, assumed) with the "
        "joints of table 5, identified from two exact natural frequencies. Without a slip the joint comes back to "
        f"{max(material.control_percent, 1e-6):.0e} %."
    )
    for slip in dict.fromkeys(one.slip for one in material.changes):
        own = [one for one in material.changes if one.slip == slip]
        y, theta = ([getattr(one, f"{name}_percent") for one in own] for name in ("k_y", "k_theta"))
        yield (
            f"{slip}: the joint seems to change by {min(y):+.1f} to {max(y):+.1f} % in k_y and by {min(theta):+.1f} to "
            f"{max(theta):+.1f} % in k_theta."
        )
    shank = [one for one in material.changes if one.slip.startswith("shank")]
    y, theta = (max(abs(getattr(one, f"{name}_percent")) for one in shank) for name in ("k_y", "k_theta"))
    needed = ", ".join(f"{value:+.1f} % at {d:g} mm" for d, value in material.modulus_percent.items())
    share = 100.0 * CLAIMED_SHARE
    yield (
        f"The shank in the nose makes up to {y:.0f} % of k_y and {theta:.0f} % of k_theta, "
        f"{'less than' if theta < share else 'as much as'} the {share:g} % that are claimed of k_theta. A modulus of "
        f"the steel that is off by {needed} alone would make {share:g} %; the paper does not print the one that it "
        "used. Before a joint is said to depend on the tool's material, the bare blank has to be measured."
    )


def _on_damping(study: ClampingStudy) -> Iterator[str]:
    truth = study.damping.truth
    yield (
        f"VIRTUAL: interface damping as in table 3 (c_theta {truth['joint.c_theta']:g} N m s/rad; c_y is not printed, "
        f"{truth['joint.c_y']:g} N s/m assumed), a simulated machine, material loss factors 0.001 and 0.002."
    )
    for case in study.damping.of_published():
        allowed = study.damping.allowed[case.test]
        far = f"at {allowed:.2g} times" if np.isfinite(allowed) else "not even at a thousand times"
        yield (
            f"{case.test}: neglecting it makes the highest peak {case.peak_percent:+.1f} % and the least real part, "
            f"which decides the stability limit, {case.real_percent:+.1f} % too large; {study.damping.worth_percent:g} "
            f"% are reached {far} this damping."
        )
    fine = [c.test for c in study.damping.of_published() if abs(c.real_percent) < study.damping.worth_percent]
    bad = [c.test for c in study.damping.of_published() if c.test not in fine]
    yield (
        f"The claim that it may be neglected holds here for: {'; '.join(fine) or 'none'}. It does not for: "
        f"{'; '.join(bad) or 'none'}. How much depends on the damping of the rest of the machine."
    )


def _on_torque(study: ClampingStudy) -> Iterator[str]:
    resolution, (low, high) = study.settings.resolution, study.trends.torque_range_nm
    yield (
        f"Published: k_y over torque, {low:g} to {high:g} N m, from table 4's frequencies; steps of "
        f"{resolution.fine_hz:g} Hz below {resolution.change_hz / 1e3:g} kHz and {resolution.coarse_hz:g} Hz from "
        "there on."
    )
    for verdict in study.torque:
        yield _on_tool(verdict, low, high)
    yield (
        "A step of torque was done once: with every state clamped anew the overhang alone would scatter, and that is "
        f"what the second verdict allows for ({RECLAMPED_MM:g} mm each). Neither says what a second collet would give."
    )


def _on_tool(verdict: TorqueVerdict, low: float, high: float) -> str:
    ends = verdict.trend.interval
    first, last = ("open" if end is None else f"{end:+.1f}" for end in ends)
    change, least, most = verdict.law.change_percent(low, high)
    return (
        f"{verdict.diameter_mm:g} mm: {verdict.trend.change_percent:+.1f} % by a fitted line "
        f"({verdict.trend.end_values.percent:+.1f} % between the end values), {first} to {last} % by the resolution "
        f"alone: {'more than noise' if verdict.trend.exceeds else 'within the resolution'}. As a power law with the "
        f"scatter of its states, torque^{verdict.law.exponent:.2f}: {change:+.1f} % ({least:+.1f} to {most:+.1f} %), "
        f"log evidence {verdict.law.log_evidence:+.1f} against a constant: {_told(verdict.law)}. If clamped anew each "
        f"time: {verdict.reclamped.log_evidence:+.1f}, {_told(verdict.reclamped)}."
    )


def _told(law: FittedLaw) -> str:
    if law.told:
        return "more than scatter"
    low, high = law.interval
    if low > 0.0 or high < 0.0:
        return "suspected at most, zero is outside the interval but the evidence is not for a law"
    return "not told from scatter"


def _on_diameter(study: ClampingStudy) -> Iterator[str]:
    for law in study.diameter:
        low, high = law.interval
        yield (
            f"Published: {law.quantity} as d^{law.exponent:.2f} ({low:.2f} to {high:.2f}), scatter of the tools about "
            f"it {law.scatter_percent:.0f} %, log evidence {law.log_evidence:+.1f} against a constant: {_told(law)}. "
            "Five tools in one holder; each sits at another place of its collet's range."
        )
    published = next(one for one in study.trends.diameter if one.quantity == "k_y")
    first = published.steps[:2]
    text = " and ".join(f"{step.percent:+.1f} % from {step.start:g} to {step.end:g} mm" for step in first)
    both = "both" if all(step.exceeds for step in first) else "not both"
    less = "less" if all(abs(step.percent) < published.scatter_percent for step in first) else "not less"
    yield (
        f"The paper calls k_y of the first three diameters almost constant: here it changes by {text}, {both} by more "
        f"than the resolution, {less} than the {published.scatter_percent:.0f} % that tools scatter about a power law."
    )


def _evidence(value: float) -> str:
    return f"{value:.0f}" if np.isfinite(value) else "far"
