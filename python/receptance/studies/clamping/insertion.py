"""VIRTUAL: insertions of 40, 30 and 20 mm where the joint is the two springs in series of the paper's eq. 15.

Tool to collet (k2, over the insertion) and collet to holder (k1, over the whole collet) are two point joints with a
part between that is short and weighs nothing; the collet's own mass is in the inferred nose, as in the paper. Together
they are one joint of stiffness k1 k2 / (k1 + k2). Of the inner contact k_y goes with the length and k_theta with its
cube, as of a layer.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from receptance.assembly import Assembly
from receptance.beams import Part, Segment
from receptance.identification import (
    Floor,
    Identification,
    Law,
    MeasuredFRF,
    Power,
    Prior,
    Tolerance,
    Unknown,
    identify,
    log_evidence,
)
from receptance.joints import PointJoint
from receptance.materials import Material
from receptance.studies.er32.holder import HolderModel
from receptance.studies.er32.tables import Published

__all__ = ["Hypothesis", "InsertionCase", "InsertionStudy", "needed_ratio", "study_insertion"]

INSERTIONS_MM = (40.0, 30.0, 20.0)
DIAMETER_MM = 12.7
_GROWTH = {"k_y": 1.0, "k_theta": 3.0}
"""Exponents of a layer's stiffness over its length."""
_CERTAIN = 0.01
"""Standard deviation of an exponent that a hypothesis states."""
_LOSS = 0.01
"""Loss factor of the joints in the simulation and start of the fits."""
_STEP_HZ = 10.0
_BAND_HZ = (200.0, 12500.0)
_BOUNDS = {"k_y": (1e6, 1e13), "k_theta": (1e2, 1e9)}
_ADEQUATE = 1.1
"""Residuals up to this many standard deviations, as rms, are what the noise explains."""


@dataclass(frozen=True, kw_only=True)
class Hypothesis:
    """A law of the joint over the insertion, fitted to all three insertions together."""

    name: str
    fit: Identification
    log_evidence: float

    @property
    def adequate(self) -> bool:
        """Whether it explains the data within their noise."""
        return self.fit.rms <= _ADEQUATE


@dataclass(frozen=True, kw_only=True)
class InsertionCase:
    """One ratio of inner to outer stiffness at the full insertion.

    Attributes
    ----------
    ratio : float
        k2 / k1 at 40 mm.
    change_percent : dict of str to float
        Change of the total stiffness from 40 to 20 mm, eq. 15.
    frequency_percent : tuple of float
        Change of the first natural frequencies.
    hypotheses : tuple of Hypothesis
        The most likely first.
    """

    ratio: float
    change_percent: dict[str, float]
    frequency_percent: tuple[float, ...]
    hypotheses: tuple[Hypothesis, ...]

    @property
    def found(self) -> Hypothesis:
        """The most likely of those that explain the data; of all where none does."""
        good = [one for one in self.hypotheses if one.adequate]
        return (good or list(self.hypotheses))[0]

    @property
    def margin(self) -> float:
        """Difference of log evidence between the most likely law and the next."""
        return self.hypotheses[0].log_evidence - self.hypotheses[1].log_evidence

    def compliance_of_outer(self, quantity: str) -> tuple[float, float] | None:
        """Share of the compliance at full insertion that the collet's outer contact has, with its standard error."""
        fit = next(one.fit for one in self.hypotheses if one.name == SERIES)
        names = [f"outer.{quantity}", f"inner.{quantity}"]
        outer, inner = (fit.values[name] for name in names)
        index = [fit.addresses.index(name) for name in names]
        covariance = fit.covariance[np.ix_(index, index)] * np.log(10.0) ** 2
        if not np.isfinite(covariance).all():
            return None
        share = inner / (inner + outer)
        slope = share * (1.0 - share) * np.array([-1.0, 1.0])
        return share, float(np.sqrt(max(slope @ covariance @ slope, 0.0)))


@dataclass(frozen=True, kw_only=True)
class InsertionStudy:
    """All ratios."""

    cases: tuple[InsertionCase, ...]
    noise: float
    seed: int


SERIES = "two springs in series, the inner one grows"
ONE = "one spring, grows like a layer"
CONSTANT = "one spring, constant"
POWER = "one spring, powers of the insertion"


def needed_ratio(exponent: float, change: float = 0.1) -> float:
    """Return k2 / k1 from which on halving the insertion changes the total of eq. 15 by less than a share.

    Halved, the inner stiffness is 2^-n of what it was: (1 + r) / (2^n + r) = 1 - change.

    Examples
    --------
    >>> from receptance.studies.clamping.insertion import needed_ratio
    >>> round(needed_ratio(1.0)), round(needed_ratio(3.0))
    (8, 62)
    """
    kept = 1.0 - change
    return float((kept * 2.0**exponent - 1.0) / change)


def study_insertion(
    holder: HolderModel,
    published: Published,
    *,
    ratios: tuple[float, ...],
    noise: float,
    seed: int,
    say: Callable[[str], None],
) -> InsertionStudy:
    """Simulate and identify for several ratios of inner to outer stiffness.

    Parameters
    ----------
    holder, published
        Holder and tables of the ER32 study.
    ratios : tuple of float
        k2 / k1 at the full insertion.
    noise : float
        Standard deviation of the log response on every line, 10 Hz apart.
    seed : int
        Of noise and errors.
    say : callable
        Is told what is being done.
    """
    cases = []
    for number, ratio in enumerate(ratios):
        say(f"insertion: k2 = {ratio:g} k1")
        cases.append(_case(holder, published, ratio, noise, np.random.default_rng([seed, number])))
    return InsertionStudy(cases=tuple(cases), noise=noise, seed=seed)


def _case(
    holder: HolderModel, published: Published, ratio: float, noise: float, random: np.random.Generator
) -> InsertionCase:
    setup, mount = published.setup(DIAMETER_MM), published.mount(DIAMETER_MM)
    total = {"k_y": setup.k_y, "k_theta": setup.k_theta}
    outer = {name: k * (1.0 + 1.0 / ratio) for name, k in total.items()}
    inner = {name: k * (1.0 + ratio) for name, k in total.items()}
    bare = holder.assembly(DIAMETER_MM, mount.overhang_mm, mount.holder_length_mm, setup.k_y, setup.k_theta)

    def joints(insertion_mm: float) -> Assembly:
        share = insertion_mm / INSERTIONS_MM[0]
        inside = {name: k * share ** _GROWTH[name] for name, k in inner.items()}
        return _in_series(bare, inside, outer)

    lines = np.arange(_BAND_HZ[0], _BAND_HZ[1] + 0.5 * _STEP_HZ, _STEP_HZ)
    carbide = 1.0 + 0.01 * random.standard_normal()
    series: list[MeasuredFRF] = []
    single: list[MeasuredFRF] = []
    for insertion in INSERTIONS_MM:
        true = joints(insertion)
        length = true.get("tool.segment[0].length") + 1e-4 * random.standard_normal()
        modulus = true.get("tool.segment[0].youngs_modulus") * carbide
        true = true.replace({"tool.segment[0].length": length, "tool.segment[0].youngs_modulus": modulus})
        response = true.receptance(lines)
        spread = np.sqrt(noise**2 + Floor().variance(lines, response))
        scatter = random.standard_normal(lines.size) + 1j * random.standard_normal(lines.size)
        for kept, assembly in ((series, joints(INSERTIONS_MM[0])), (single, _single(bare))):
            kept.append(
                MeasuredFRF(
                    assembly=assembly,
                    frequency_hz=lines,
                    receptance=response * np.exp(spread * scatter),
                    standard_deviation=spread,
                    configuration=f"{insertion:g} mm",
                    conditions={"insertion": 1e-3 * insertion},
                )
            )
    hypotheses = [_fitted(name, single, laws) for name, laws in _single_laws(total).items()]
    hypotheses.append(_fitted(SERIES, series, _series_laws(inner, outer)))
    first, last = joints(INSERTIONS_MM[0]), joints(INSERTIONS_MM[-1])
    before, after = (one.lowest_natural_frequencies(2)[0] for one in (first, last))
    return InsertionCase(
        ratio=ratio,
        change_percent={name: _change(ratio, growth) for name, growth in _GROWTH.items()},
        frequency_percent=tuple((100.0 * (after / before - 1.0)).tolist()),
        hypotheses=tuple(sorted(hypotheses, key=lambda one: -one.log_evidence)),
    )


def _change(ratio: float, exponent: float) -> float:
    """Return the change of eq. 15's total in percent when the insertion is halved."""
    half = float((INSERTIONS_MM[-1] / INSERTIONS_MM[0]) ** exponent)
    return 100.0 * ((1.0 + 1.0 / ratio) / (1.0 + 1.0 / (ratio * half)) - 1.0)


def _in_series(bare: Assembly, inner: Mapping[str, float], outer: Mapping[str, float]) -> Assembly:
    row = bare.elements
    # Short and light: what bends is in the two joints.
    stub = Material(youngs_modulus=2.1e11, density=10.0, poisson_ratio=0.3, name="stub")
    collet = Part([Segment(length=1e-6, outer_diameter=0.03, material=stub)], name="collet")
    joints = [
        PointJoint(k_y=k["k_y"], k_theta=k["k_theta"], loss_factor=_LOSS, name=name)
        for name, k in (("inner", inner), ("outer", outer))
    ]
    return Assembly([row["tool"], joints[0], collet, joints[1], row["holder"]])


def _single(bare: Assembly) -> Assembly:
    """Return the paper's own model: one joint."""
    return bare.replace({"joint.loss_factor": _LOSS})


def _law(address: str, start: float, exponent: float | None = None, *, free: bool = False) -> Unknown:
    lower, upper = _BOUNDS[address.split(".")[1]]
    if exponent is None and not free:
        return Law(address=address, lower=lower, upper=upper, start=start)
    prior = None if exponent is None else Prior(mean=exponent, standard_deviation=_CERTAIN)
    power = Power(
        of="insertion", reference=1e-3 * INSERTIONS_MM[0], lower=-4.0, upper=4.0, start=exponent or 0.0, prior=prior
    )
    return Law(address=address, lower=lower, upper=upper, start=start, powers=(power,))


def _single_laws(total: Mapping[str, float]) -> dict[str, list[Unknown]]:
    loss = Unknown(address="joint.loss_factor", lower=1e-5, upper=0.5, start=_LOSS)
    named = [(f"joint.{name}", k, _GROWTH[name]) for name, k in total.items()]
    return {
        ONE: [*(_law(address, k, growth) for address, k, growth in named), loss],
        CONSTANT: [*(_law(address, k) for address, k, _ in named), loss],
        POWER: [*(_law(address, k, free=True) for address, k, _ in named), loss],
    }


def _series_laws(inner: Mapping[str, float], outer: Mapping[str, float]) -> list[Unknown]:
    losses = [Unknown(address=f"{j}.loss_factor", lower=1e-5, upper=0.5, start=_LOSS) for j in ("inner", "outer")]
    # Both contacts begin alike: where they end is for the data to say.
    both = {name: 2.0 / (1.0 / inner[name] + 1.0 / outer[name]) for name in inner}
    inside = [_law(f"inner.{name}", both[name], growth) for name, growth in _GROWTH.items()]
    return [*inside, *(_law(f"outer.{name}", both[name]) for name in _GROWTH), *losses]


def _fitted(name: str, observed: list[MeasuredFRF], laws: list[Unknown]) -> Hypothesis:
    tolerances = [
        Tolerance(name="carbide E", moves={"tool.segment[0].youngs_modulus": 0.01}, relative=True),
        *(
            Tolerance(
                name=f"overhang {o.configuration}",
                moves={"tool.segment[0].length": 1e-4},
                configurations=(o.configuration,),
            )
            for o in observed
        ),
    ]
    fit = identify(observed, laws, tolerances=tolerances, starts=1, max_evaluations=100)
    evidence = log_evidence(fit)
    return Hypothesis(name=name, fit=fit, log_evidence=evidence if np.isfinite(evidence) else -np.inf)
