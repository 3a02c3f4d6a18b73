"""Insertions of 40, 30 and 20 mm, the joint being two springs in series (eq. 15 of `clamping.py`). VIRTUAL."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

import er32_tables
import receptance as rc
from er32_tables import BOUNDS, E_TOOL, LENGTH
from receptance.fit import Floor, Law, Power, Prior, Tolerance, log_evidence

PUBLISHED = er32_tables.load()
INSERTIONS_MM = (40.0, 30.0, 20.0)
GROWTH = {"k_y": 1.0, "k_theta": 3.0}
"""Exponents of the stiffness of a layer over its length."""
RATIOS = (0.001, 1.0, 5.0, 25.0)
"""Stiffness of the inner contact over that of the outer one at full insertion; the first case is a control."""
LOSS = 0.01
BAND_HZ = (200.0, 12500.0)
ONE, CONSTANT = "one spring, grows like a layer", "one spring, constant"
POWER, SERIES = "one spring, powers of the insertion", "two springs in series, the inner one grows"


def needed_ratio(exponent: float, change: float = 0.1) -> float:
    """Return k2 / k1 above which halving the insertion changes the total of eq. 15 by less than a share.

    Halved, the inner stiffness is 2^-n of its value: (1 + r) / (2^n + r) = 1 - change.
    """
    return ((1.0 - change) * 2.0**exponent - 1.0) / change


def law(address: str, start: float, exponent: float | None = None, *, free: bool = False) -> Law:
    """Return a stiffness that is constant, a given power of the insertion, or a free one."""
    lower, upper = BOUNDS[address.split(".")[1]]
    powers: tuple[Power, ...] = ()
    if free or exponent is not None:
        prior = None if exponent is None else Prior(mean=exponent, standard_deviation=0.01)
        reference = 1e-3 * INSERTIONS_MM[0]
        powers = (
            Power(of="insertion", reference=reference, lower=-4.0, upper=4.0, start=exponent or 0.0, prior=prior),
        )
    return Law(address=address, lower=lower, upper=upper, start=start, powers=powers)


def hypothesis(name: str, observed: list[rc.Observation], laws: Sequence[rc.Unknown]) -> dict[str, Any]:
    """Fit a law to all insertions; "_fit" is the identification."""
    joints = ("inner", "outer") if name == SERIES else ("joint",)
    losses = [rc.Unknown(address=f"{j}.loss_factor", lower=1e-5, upper=0.5, start=LOSS) for j in joints]
    tolerances = [Tolerance(name="carbide E", moves={E_TOOL: 0.01}, relative=True)]
    tolerances += [
        Tolerance(name=f"overhang {o.configuration}", moves={LENGTH: 1e-4}, configurations=(o.configuration,))
        for o in observed
    ]
    fit = rc.identify(observed, [*laws, *losses], tolerances=tolerances, starts=1, max_evaluations=100, noise="stated")
    evidence = log_evidence(fit)
    return {
        "name": name,
        "log_evidence": evidence if np.isfinite(evidence) else -np.inf,
        "rms": fit.rms,
        "adequate": fit.rms <= 1.1,
        "values": dict(fit.values),
        "_fit": fit,
    }


def study_insertion(ratio: float, noise: float, random: np.random.Generator) -> dict[str, Any]:
    """Simulate three insertions of a 12.7 mm blank, fit four laws to them and compare their evidence."""
    setup, mount = PUBLISHED.setup(12.7), PUBLISHED.mount(12.7)
    total = {"k_y": setup.k_y, "k_theta": setup.k_theta}
    outer = {name: k * (1.0 + 1.0 / ratio) for name, k in total.items()}
    inner = {name: k * (1.0 + ratio) for name, k in total.items()}
    single = er32_tables.assembly(12.7, mount.overhang_mm, **total).replace({"joint.loss_factor": LOSS})

    def joints(insertion_mm: float) -> rc.Assembly:
        # The part between is short and light: the collet's mass belongs to the inferred nose.
        stub = rc.Material(youngs_modulus=2.1e11, density=10.0, poisson_ratio=0.3, name="stub")
        collet = rc.Part([rc.Segment(length=1e-6, outer_diameter=0.03, material=stub)], name="collet")
        inside = {name: k * (insertion_mm / INSERTIONS_MM[0]) ** GROWTH[name] for name, k in inner.items()}
        contacts = [
            rc.PointJoint(**k, loss_factor=LOSS, name=name) for name, k in (("inner", inside), ("outer", outer))
        ]
        row = single.elements
        return rc.Assembly([row["tool"], contacts[0], collet, contacts[1], row["holder"]])

    lines = np.arange(BAND_HZ[0], BAND_HZ[1] + 5.0, 10.0)
    carbide = 1.0 + 0.01 * random.standard_normal()
    observed: dict[str, list[rc.Observation]] = {"single": [], "series": []}
    for insertion in INSERTIONS_MM:
        true = joints(insertion)
        length = true.get(LENGTH) + 1e-4 * random.standard_normal()
        response = true.replace({LENGTH: length, E_TOOL: true.get(E_TOOL) * carbide}).receptance(lines)
        deviation = np.sqrt(noise**2 + Floor().variance(lines, response))
        scatter = random.standard_normal(lines.size) + 1j * random.standard_normal(lines.size)
        for name, model in (("single", single), ("series", joints(INSERTIONS_MM[0]))):
            observed[name].append(
                rc.Observation(
                    assembly=model,
                    frequency_hz=lines,
                    receptance=response * np.exp(deviation * scatter),
                    standard_deviation=deviation,
                    configuration=f"{insertion:g} mm",
                    conditions={"insertion": 1e-3 * insertion},
                )
            )
    # Both contacts start with the same stiffness.
    both = {name: 2.0 / (1.0 / inner[name] + 1.0 / outer[name]) for name in GROWTH}
    laws: dict[str, list[Law]] = {
        ONE: [law(f"joint.{name}", k, GROWTH[name]) for name, k in total.items()],
        CONSTANT: [law(f"joint.{name}", k) for name, k in total.items()],
        POWER: [law(f"joint.{name}", k, free=True) for name, k in total.items()],
        SERIES: [law(f"inner.{name}", k, GROWTH[name]) for name, k in both.items()]
        + [law(f"outer.{name}", k) for name, k in both.items()],
    }
    found = [hypothesis(name, observed["series" if name == SERIES else "single"], own) for name, own in laws.items()]
    found.sort(key=lambda one: -one["log_evidence"])
    series = next(one["_fit"] for one in found if one["name"] == SERIES)
    modes = [joints(insertion).lowest_natural_frequencies(2)[0] for insertion in INSERTIONS_MM]
    half = {name: (INSERTIONS_MM[-1] / INSERTIONS_MM[0]) ** growth for name, growth in GROWTH.items()}
    return {
        "ratio": ratio,
        "change_percent": {
            name: 100.0 * ((1.0 + 1.0 / ratio) / (1.0 + 1.0 / (ratio * half[name])) - 1.0) for name in GROWTH
        },
        "frequency_percent": 100.0 * (modes[-1] / modes[0] - 1.0),
        "found": next((one for one in found if one["adequate"]), found[0])["name"],
        "hypotheses": found,
        "compliance_of_outer": {name: outer_share(series, name) for name in GROWTH},
    }


def outer_share(fit: rc.Identification, quantity: str) -> tuple[float, float] | None:
    """Return the share of the outer contact in the compliance at full insertion, with its standard error."""
    names = [f"outer.{quantity}", f"inner.{quantity}"]
    index = [fit.addresses.index(name) for name in names]
    covariance = fit.covariance[np.ix_(index, index)] * np.log(10.0) ** 2
    if not np.isfinite(covariance).all():
        return None
    outer, inner = (fit.values[name] for name in names)
    share = inner / (inner + outer)
    slope = share * (1.0 - share) * np.array([-1.0, 1.0])
    return share, float(np.sqrt(max(slope @ covariance @ slope, 0.0)))
