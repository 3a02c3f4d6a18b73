"""Stiffness over torque and diameter (tables 1, 4, 5 of the paper) as power laws, with their evidence. Published."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.optimize import brentq
from scipy.special import ndtr

import er32_joints
import er32_tables
import receptance as rc
from er32_tables import BOUNDS, LENGTH
from receptance.fit import Law, Power, Tolerance, log_evidence

PUBLISHED = er32_tables.load()
SCATTERS = (0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.4)
"""Standard deviations of the individual part of a state, of the natural logarithm, all equally likely a priori."""
RECLAMPED_MM = 0.1
"""Standard deviation of an overhang if every state was clamped again."""
EXPONENT = {"torque": 2.0, "diameter": 6.0}
"""The prior of an exponent is uniform between minus and plus this."""


@dataclass(frozen=True)
class FittedLaw:
    """A power law against a constant, both with scatter of the states about them.

    Scatters are averaged with their evidence: `exponent` is the mean, `interval` the middle 95 % of the mixture of
    normal distributions; `scatter_percent` is the most likely scatter and `log_evidence` that of the power law less
    that of the constant.
    """

    quantity: str
    of: str
    exponent: float
    interval: tuple[float, float]
    scatter_percent: float
    log_evidence: float

    @property
    def significant(self) -> bool:
        """Whether the interval excludes a constant and the evidence is for the power law."""
        return (self.interval[0] > 0.0 or self.interval[1] < 0.0) and self.log_evidence > 0.0

    def change_percent(self, low: float, high: float) -> list[float]:
        """Return the change over a range, most likely and at the ends of the interval."""
        return [100.0 * ((high / low) ** n - 1.0) for n in (self.exponent, *self.interval)]

    def row(self, low: float, high: float) -> dict[str, Any]:
        """Return the law as a dictionary, with its change over a range."""
        return {
            "quantity": self.quantity,
            "of": self.of,
            "exponent": self.exponent,
            "interval": self.interval,
            "change_percent": self.change_percent(low, high),
            "scatter_percent": self.scatter_percent,
            "log_evidence_against_constant": self.log_evidence,
            "significant": self.significant,
        }


def state(joint: dict[str, Any], resolution: er32_joints.Resolution, name: str) -> rc.Observation:
    """Return the printed frequencies of a tool at a torque, on the assembly with the identified joint."""
    diameter, torque = joint["diameter_mm"], joint["torque_nm"]
    frequency = PUBLISHED.reading(diameter, torque).frequency_hz
    return rc.Observation.from_modes(
        assembly=er32_tables.assembly(diameter, PUBLISHED.mount(diameter).overhang_mm, joint["k_y"], joint["k_theta"]),
        frequency_hz=frequency,
        standard_deviation_hz=resolution.standard_deviation(frequency),
        configuration=name,
        conditions={"torque": torque, "diameter": 1e-3 * diameter},
    )


def fit_law(
    states: Sequence[rc.Observation], quantity: str, of: str, reference: float, *, reclamped: bool
) -> FittedLaw:
    """Fit the power law and the constant with every scatter, and average with their evidence."""
    tolerances = [
        Tolerance(
            name=f"overhang {one.configuration}",
            moves={LENGTH: 1e-3 * RECLAMPED_MM},
            configurations=(one.configuration,),
        )
        for one in states
        if reclamped
    ]

    def fit(scatter: float, powers: tuple[Power, ...]) -> rc.Identification:
        unknowns: list[rc.Unknown] = []
        for name, (lower, upper) in BOUNDS.items():
            address = f"joint.{name}"
            values = [one.assembly.get(address) for one in states]
            bounds: dict[str, Any] = {"address": address, "lower": lower, "upper": upper}
            if name == quantity:
                start = float(np.exp(np.mean(np.log(values))))
                unknowns.append(Law(**bounds, start=start, powers=powers, individual=scatter))
                continue
            # The other stiffness is free in every state.
            unknowns += [
                rc.Unknown(**bounds, start=value, configurations=(one.configuration,))
                for one, value in zip(states, values, strict=True)
            ]
        return rc.identify(states, unknowns, tolerances=tolerances, starts=1, noise="stated")

    power = Power(of=of, reference=reference, lower=-EXPONENT[of], upper=EXPONENT[of])
    fits = {grows: [fit(scatter, (power,) if grows else ()) for scatter in SCATTERS] for grows in (False, True)}
    evidence = {grows: np.nan_to_num([log_evidence(one) for one in own], nan=-np.inf) for grows, own in fits.items()}
    share = np.exp(evidence[True] - evidence[True].max())
    share /= share.sum()
    name = f"joint.{quantity} ~ {of}"
    means = np.array([one.values[name] for one in fits[True]])
    deviations = np.array([one.standard_errors[name] for one in fits[True]])
    ends = (float(np.min(means - 9.0 * deviations)), float(np.max(means + 9.0 * deviations)))
    low, high = (
        float(brentq(lambda x, p=p: share @ ndtr((x - means) / deviations) - p, *ends, xtol=1e-12))
        for p in (0.025, 0.975)
    )
    return FittedLaw(
        quantity=quantity,
        of=of,
        exponent=float(share @ means),
        interval=(low, high),
        scatter_percent=100.0 * SCATTERS[int(share.argmax())],
        log_evidence=float(np.logaddexp.reduce(evidence[True]) - np.logaddexp.reduce(evidence[False])),
    )


def study_torque(
    joints: Sequence[dict[str, Any]], trends: dict[str, Any], resolution: er32_joints.Resolution, diameter: float
) -> dict[str, Any]:
    """Return the growth of k_y over torque of one tool."""
    states = [state(j, resolution, f"{j['torque_nm']:g} N m") for j in joints if j["diameter_mm"] == diameter]
    own, again = (fit_law(states, "k_y", "torque", PUBLISHED.torque_nm, reclamped=on) for on in (False, True))
    trend = next(t for t in trends["torque"] if (t["quantity"], t["diameter_mm"]) == ("k_y", diameter))
    return {
        "diameter_mm": diameter,
        "change_percent": trend["change_percent"],
        "change_of_end_values_percent": trend["end_values"]["percent"],
        "interval_of_resolution": trend["interval"],
        "more_than_resolution": trend["exceeds"],
        "law": own.row(*trends["torque_range_nm"]),
        "law_if_reclamped": again.row(*trends["torque_range_nm"]),
    }
