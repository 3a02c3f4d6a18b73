"""Clamping of an ER32 collet holder (Matthias et al. 2016): insertion, material, damping, torque and diameter.

W. Matthias, O. Ozsahin, Y. Altintas, B. Denkena, CIRP J. Manuf. Sci. Technol. 2016, doi 10.1016/j.cirpj.2016.02.005.
Torque and diameter are published in tables 1, 4 and 5: laws are fitted to the printed natural frequencies. Insertion
(figures 12, 13), material (figure 15) and damping (figure 6) are printed as figures only. They are VIRTUAL studies of
simulated data, and no value is read off a figure; the claims of the paper are quoted.

Run with `python docs/studies/clamping.py [--resolution HZ] [--seed N] [--json FILE] [--plot FILE]`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.optimize import brentq
from scipy.special import ndtr

import er32_joints
import er32_tables
import receptance as rc
import table3
from output import options, print_table, save
from receptance.fit import Floor, Law, Power, Prior, Tolerance, log_evidence

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
BOUNDS = {"k_y": (1e6, 1e13), "k_theta": (1e2, 1e9)}
PUBLISHED = er32_tables.load()
E_TOOL, LENGTH = "tool.segment[0].youngs_modulus", "tool.segment[0].length"

# ---- VIRTUAL: insertions of 40, 30 and 20 mm, the joint being two springs in series (eq. 15)

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


# ---- VIRTUAL: high-speed steel against carbide with one joint; an error in the model looks like a change of the joint

HSS = rc.Material(youngs_modulus=2.25e11, density=8100.0, poisson_ratio=0.3, name="high-speed steel")
"""Assumed: high-speed steels have 200 to 235 GPa and 7,900 to 8,700 kg/m3."""
CLAIMED_SHARE = 0.45
ERRORS: dict[str, dict[str, float | None]] = {
    "shank of carbide in the nose": {},
    "modulus 3 % high": {E_TOOL: 1.03},
    "density 1 % high": {"tool.segment[0].density": 1.01},
    "overhang 0.1 mm long": {LENGTH: None},
    "first frequency 0.1 % high": {},
}
"""Errors of the model of the steel blank, one at a time, with the factors of its parameters; None adds 0.1 mm."""


def with_shank(own: rc.Assembly, shank: rc.Material) -> rc.Assembly:
    """Return the assembly with a blank of high-speed steel and a shank in the bore of the nose.

    The inferred nose represents collet, nut and carbide shank together. Without bending stiffness and mass of the
    carbide shank it is a ring around the bore.
    """
    tool, joint, holder = own.elements.values()
    assert isinstance(tool, rc.Part)
    assert isinstance(holder, rc.Part)
    nose, carbide = holder.segments[0], tool.segments[0].material
    bore = tool.segments[0].outer_diameter
    fourth, second = (bore / nose.outer_diameter) ** 4, (bore / nose.outer_diameter) ** 2
    ring = replace(
        nose.material,
        youngs_modulus=(nose.material.youngs_modulus - carbide.youngs_modulus * fourth) / (1.0 - fourth),
        density=(nose.material.density - carbide.density * second) / (1.0 - second),
    )
    filled = replace(nose, inner_diameter=bore, material=ring, core=shank)
    blank = rc.Part([replace(tool.segments[0], material=HSS)], name="tool")
    return rc.Assembly([blank, joint, rc.Part([filled, *holder.segments[1:]], name="holder")])


def study_material() -> dict[str, Any]:
    """Identify the joints of steel blanks from two exact natural frequencies, with one error of the model each."""
    changes, control, needed = [], 0.0, {}
    carbide = er32_tables.parts()[0].segments[0].material
    for setup in PUBLISHED.setups:
        joint = np.array([setup.k_y, setup.k_theta])
        bare = er32_tables.assembly(setup.diameter_mm, PUBLISHED.mount(setup.diameter_mm).overhang_mm, *joint.tolist())
        true = with_shank(bare, HSS)
        frequency = true.lowest_natural_frequencies(2)[0]
        control = max(control, float(np.max(np.abs(100.0 * (er32_joints.follow_joint(true, frequency) / joint - 1.0)))))
        for name, factors in ERRORS.items():
            model = with_shank(bare, carbide) if name.startswith("shank") else true
            model = model.replace(
                {a: model.get(a) + 1e-4 if factor is None else model.get(a) * factor for a, factor in factors.items()}
            )
            read = frequency * [1.001 if name.startswith("first") else 1.0, 1.0]
            k_y, k_theta = (100.0 * (er32_joints.follow_joint(model, read) / joint - 1.0)).tolist()
            changes.append(
                {"diameter_mm": setup.diameter_mm, "slip": name, "k_y_percent": k_y, "k_theta_percent": k_theta}
            )
        needed[f"{setup.diameter_mm:g} mm"] = needed_modulus(true, frequency, setup.k_theta)
    return {"virtual": True, "control_percent": control, "changes": changes, "modulus_percent": needed}


def needed_modulus(true: rc.Assembly, frequency: np.ndarray, k_theta: float) -> float:
    """Return the smallest error of the modulus in percent that alone changes k_theta by the claimed share."""

    def missing(error: float) -> float:
        moved = true.replace({E_TOOL: true.get(E_TOOL) * (1.0 + error)})
        return abs(er32_joints.follow_joint(moved, frequency)[1] / k_theta - 1.0) - CLAIMED_SHARE

    ends = [100.0 * brentq(missing, 0.0, side, xtol=1e-6) for side in (-0.3, 0.3) if missing(side) >= 0.0]
    return min(ends, key=abs)


# ---- VIRTUAL: damping at the interface neglected; the limit of stability goes with the least real part

FACTORS = (1.0, 3.0, 10.0, 30.0)
WORTH_PERCENT = 10.0
"""Error of the least real part that matters for the limit of stability."""
LARGEST_FACTOR = 1e3


def extremes(overhang_mm: float, free: bool, factor: float) -> np.ndarray:
    """Return the highest magnitude and the size of the least real part of the tip response."""
    own = table3.assembly(overhang_mm, free=free)
    own = own.replace({name: factor * table3.TRUTH[name] for name in ("joint.c_y", "joint.c_theta")})
    low, high = table3.BANDS_HZ[free]
    # Lines close to every mode contain the extremes for any damping.
    near = np.concatenate([[0.0], np.geomspace(1e-4, 0.05, 60)])
    close = [f * (1.0 + s * near) for f in own.natural_frequencies(high) for s in (-1.0, 1.0)]
    lines = np.unique(np.concatenate([np.linspace(low, high, 6000), *close]))
    response = own.receptance(lines[(lines >= low) & (lines <= high)])
    return np.array([np.abs(response).max(), -response.real.min()])


def error_without_damping(overhang_mm: float, free: bool, factor: float) -> list[float]:
    """Return by how many percent peak and least real part are too large if the damping is neglected."""
    error: list[float] = (
        100.0 * (extremes(overhang_mm, free, 0.0) / extremes(overhang_mm, free, factor) - 1.0)
    ).tolist()
    return error


def study_damping() -> dict[str, Any]:
    """Compare tip responses with and without damping at the interface."""
    cases, allowed = [], {}
    for overhang in table3.OVERHANGS_MM[:2]:
        for free in (False, True):
            test = f"{'free-free' if free else 'in the machine'}, {overhang:g} mm"
            for factor in FACTORS:
                peak, real = error_without_damping(overhang, free, factor)
                cases.append({"test": test, "factor": factor, "peak_percent": peak, "real_percent": real})

            def excess(logarithm: float, overhang: float = overhang, free: bool = free) -> float:
                return abs(error_without_damping(overhang, free, float(np.exp(logarithm)))[1]) - WORTH_PERCENT

            ends = (np.log(1e-4), np.log(LARGEST_FACTOR))
            allowed[test] = float(np.exp(brentq(excess, *ends, xtol=1e-7))) if excess(ends[1]) > 0.0 else float("inf")
    return {"virtual": True, "cases": cases, "allowed_factor": allowed}


# ---- Published: stiffness over torque and diameter (tables 1, 4, 5) as power laws, with their evidence

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


def study(resolution: er32_joints.Resolution | None = None, seed: int = 0) -> dict[str, Any]:
    """Return all results.

    Parameters
    ----------
    resolution : Resolution, optional
        Step in which the published frequencies are printed.
    seed : int, optional
        Seed of errors and noise.
    """
    resolution = resolution or er32_joints.Resolution()
    noise = table3.Measuring().noise
    joints = er32_joints.identify_joints(PUBLISHED, resolution, starts=1, seed=seed)
    trends = er32_joints.find_trends(joints, PUBLISHED.torque_nm)
    recommended = [joint for joint in joints if joint["torque_nm"] == PUBLISHED.torque_nm]
    states = [state(joint, resolution, f"{joint['diameter_mm']:g} mm") for joint in recommended]
    laws = [fit_law(states, name, "diameter", 0.0127, reclamped=True) for name in BOUNDS]
    insertion = [study_insertion(ratio, noise, np.random.default_rng([seed, i])) for i, ratio in enumerate(RATIOS)]
    return {
        "study": "clamping",
        "settings": {"seed": seed, "noise": noise, "resolution": resolution, "ratios": RATIOS},
        "claims": [{"about": about, "where": where, "text": text} for about, (where, text) in CLAIMS.items()],
        "insertion": {"virtual": True, "cases": insertion},
        "material": study_material(),
        "damping": study_damping(),
        "torque_range_nm": trends["torque_range_nm"],
        "torque": [study_torque(joints, trends, resolution, mount.diameter_mm) for mount in PUBLISHED.mounts],
        "diameter": [one.row(7.94e-3, 16e-3) for one in laws],
        "diameter_steps": trends["diameter"][0]["steps"],
        "diameter_scatter_percent": trends["diameter"][0]["scatter_percent"],
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
        f"\nc_theta {table3.TRUTH['joint.c_theta']:g} N m s/rad as printed, c_y {table3.TRUTH['joint.c_y']:g} N s/m "
        f"assumed, loss factors of the materials {table3.CARBIDE_LOSS:g} and {table3.STEEL_LOSS:g}. The result depends "
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


def draw(found: dict[str, Any]) -> Any:
    """Return a figure of the five studies."""
    from matplotlib.figure import Figure

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


if __name__ == "__main__":
    parser = options(__doc__)
    parser.add_argument("--resolution", metavar="HZ", type=float, default=1.0, help="step of printed frequencies")
    given = parser.parse_args()
    results = study(er32_joints.Resolution(given.resolution, 10.0 * given.resolution), given.seed)
    show(results)
    save(given.json, results)
    if given.plot:
        draw(results).savefig(given.plot)
