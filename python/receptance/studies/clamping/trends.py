"""Published stiffness over torque and diameter (tables 1, 4, 5) as laws, with their evidence.

Law and scatter are fitted to the printed natural frequencies themselves. Every state has an individual part beside the
law, of a standard deviation that is not known: it is averaged over a range, so a law has to show above the scatter of
the states about it and not only above the resolution of the readings.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from receptance.identification import Identification, Law, MeasuredFrequencies, Power, Tolerance, identify, log_evidence
from receptance.identification.unknowns import Unknown
from receptance.studies.er32.holder import JOINT, HolderModel
from receptance.studies.er32.joints import BOUNDS, IdentifiedJoint, Resolution, joint_of
from receptance.studies.er32.tables import Published
from receptance.studies.er32.trends import TorqueTrend, Trends

__all__ = ["FittedLaw", "TorqueVerdict", "fit_diameter", "fit_torque"]

SCATTERS = (0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.4)
"""Standard deviations of an individual part, of the natural logarithm, all as likely beforehand."""
RECLAMPED_MM = 0.1
"""Standard deviation of an overhang, if every state was clamped anew."""
_EXPONENT = {"torque": 2.0, "diameter": 6.0}
"""Exponents are flat between minus and plus this, before the data."""
_POWERFUL = "joint.{} ~ {}"


@dataclass(frozen=True, kw_only=True)
class FittedLaw:
    """A power law against a constant, both with scatter of the states about them.

    Attributes
    ----------
    quantity, of : str
        Stiffness, and what it is a power of.
    exponent : float
        Mean over all scatters, by their evidence.
    interval : tuple of float
        Middle 95 % of it: its distribution is a normal one for each scatter, weighed by the evidence of the scatter.
    scatter_percent : float
        The most likely scatter about the power law.
    log_evidence : float
        Of the power law less that of the constant.
    reclamped : bool
        Whether every state has an overhang of its own.
    """

    quantity: str
    of: str
    exponent: float
    interval: tuple[float, float]
    scatter_percent: float
    log_evidence: float
    reclamped: bool

    @property
    def told(self) -> bool:
        """Whether the interval leaves out a constant and the evidence is for the power law."""
        low, high = self.interval
        return (low > 0.0 or high < 0.0) and self.log_evidence > 0.0

    def change_percent(self, low: float, high: float) -> tuple[float, float, float]:
        """Return the change over a range of what it is a power of: most likely, and the ends of its interval."""
        ends = [100.0 * float((high / low) ** n - 1.0) for n in (self.exponent, *self.interval)]
        return ends[0], ends[1], ends[2]


@dataclass(frozen=True, kw_only=True)
class TorqueVerdict:
    """Growth of k_y over torque for one tool.

    Attributes
    ----------
    diameter_mm : float
        Tool.
    trend : TorqueTrend
        Change with the ends that the resolution leaves open in the worst case.
    law, reclamped : FittedLaw
        As fitted with one overhang for all torques, and with an overhang of its own for every torque.
    """

    diameter_mm: float
    trend: TorqueTrend
    law: FittedLaw
    reclamped: FittedLaw


def fit_torque(
    holder: HolderModel,
    published: Published,
    joints: Sequence[IdentifiedJoint],
    trends: Trends,
    resolution: Resolution,
    *,
    say: Callable[[str], None],
) -> tuple[TorqueVerdict, ...]:
    """Return for every tool whether k_y grows over torque."""
    verdicts = []
    for mount in published.mounts:
        diameter = mount.diameter_mm
        say(f"torque: {diameter:g} mm")
        readings = [r for r in published.readings if r.diameter_mm == diameter]
        measured = [
            _measured(holder, published, joint_of(joints, diameter, r.torque_nm), resolution, f"{r.torque_nm:g} N m")
            for r in readings
        ]
        torque = published.recommended_torque_nm
        law, reclamped = (_compare(measured, "k_y", "torque", torque, again) for again in (False, True))
        trend = next(t for t in trends.torque if (t.quantity, t.diameter_mm) == ("k_y", diameter))
        verdicts.append(TorqueVerdict(diameter_mm=diameter, trend=trend, law=law, reclamped=reclamped))
    return tuple(verdicts)


def fit_diameter(
    holder: HolderModel,
    published: Published,
    joints: Sequence[IdentifiedJoint],
    resolution: Resolution,
    *,
    say: Callable[[str], None],
) -> tuple[FittedLaw, ...]:
    """Return the laws of both stiffnesses over diameter, at the recommended torque."""
    torque = published.recommended_torque_nm
    measured = [
        _measured(holder, published, joint_of(joints, m.diameter_mm, torque), resolution, f"{m.diameter_mm:g} mm")
        for m in published.mounts
    ]
    found = []
    for quantity in ("k_y", "k_theta"):
        say(f"diameter: {quantity}")
        found.append(_compare(measured, quantity, "diameter", 0.0127, True))
    return tuple(found)


def _measured(
    holder: HolderModel, published: Published, joint: IdentifiedJoint, resolution: Resolution, name: str
) -> MeasuredFrequencies:
    mount = published.mount(joint.diameter_mm)
    reading = published.reading(joint.diameter_mm, joint.torque_nm)
    assembly = holder.assembly(joint.diameter_mm, mount.overhang_mm, mount.holder_length_mm, joint.k_y, joint.k_theta)
    return MeasuredFrequencies(
        assembly=assembly,
        frequency_hz=reading.frequency_hz,
        standard_deviation_hz=resolution.standard_deviation(reading.frequency_hz),
        configuration=name,
        conditions={"torque": joint.torque_nm, "diameter": 1e-3 * joint.diameter_mm},
    )


def _compare(
    measured: Sequence[MeasuredFrequencies], quantity: str, of: str, reference: float, reclamped: bool
) -> FittedLaw:
    """Fit the power law and the constant for every scatter, and average by evidence."""
    fits = {}
    for grows in (False, True):
        fits[grows] = [_fit(measured, quantity, of, reference, grows, scatter, reclamped) for scatter in SCATTERS]
    evidence = {grows: np.array([_finite(log_evidence(fit)) for fit in own]) for grows, own in fits.items()}
    share = np.exp(evidence[True] - evidence[True].max())
    share /= share.sum()
    name = _POWERFUL.format(quantity, of)
    exponents = np.array([fit.values[name] for fit in fits[True]])
    deviations = np.array([fit.standard_errors[name] for fit in fits[True]])
    return FittedLaw(
        quantity=quantity,
        of=of,
        exponent=float(share @ exponents),
        interval=_middle(share, exponents, deviations),
        scatter_percent=100.0 * SCATTERS[int(share.argmax())],
        log_evidence=_mean(evidence[True]) - _mean(evidence[False]),
        reclamped=reclamped,
    )


def _fit(
    measured: Sequence[MeasuredFrequencies],
    quantity: str,
    of: str,
    reference: float,
    grows: bool,
    scatter: float,
    reclamped: bool,
) -> Identification:
    powers: tuple[Power, ...] = ()
    if grows:
        powers = (Power(of=of, reference=reference, lower=-_EXPONENT[of], upper=_EXPONENT[of]),)
    unknowns: list[Unknown] = []
    for address in JOINT:
        lower, upper = BOUNDS[address]
        start = float(np.exp(np.mean([np.log(one.assembly.get(address)) for one in measured])))
        if address == f"joint.{quantity}":
            law = Law(address=address, lower=lower, upper=upper, start=start, powers=powers, individual=scatter)
            unknowns.append(law)
            continue
        # The other stiffness may be what it likes in every state.
        unknowns += [
            Unknown(
                address=address,
                lower=lower,
                upper=upper,
                start=one.assembly.get(address),
                configurations=(one.configuration,),
            )
            for one in measured
        ]
    tolerances = [
        Tolerance(
            name=f"overhang {one.configuration}",
            moves={"tool.segment[0].length": 1e-3 * RECLAMPED_MM},
            configurations=(one.configuration,),
        )
        for one in measured
        if reclamped
    ]
    return identify(measured, unknowns, tolerances=tolerances, starts=1)


def _middle(share: np.ndarray, means: np.ndarray, deviations: np.ndarray) -> tuple[float, float]:
    """Return the ends of the middle 95 % of a mixture of normal distributions."""
    from scipy.special import ndtr  # the light part of scipy.stats

    ends = []
    for below in (0.025, 0.975):
        low, high = float(np.min(means - 9.0 * deviations)), float(np.max(means + 9.0 * deviations))
        for _ in range(60):
            middle = 0.5 * (low + high)
            inside = float(share @ ndtr((middle - means) / deviations)) < below
            low, high = (middle, high) if inside else (low, middle)
        ends.append(0.5 * (low + high))
    return ends[0], ends[1]


def _finite(value: float) -> float:
    return value if np.isfinite(value) else -np.inf


def _mean(evidence: np.ndarray) -> float:
    """Return the logarithm of the mean evidence."""
    most = float(evidence.max())
    return most + float(np.log(np.mean(np.exp(evidence - most))))
