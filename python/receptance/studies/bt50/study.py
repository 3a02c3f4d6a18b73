"""The study: the procedure of the paper on the virtual rig, the same with an elastic holder, and a diagnosis."""

from __future__ import annotations

import tempfile
import tomllib
import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from receptance import _checks
from receptance.errors import ReceptanceWarning
from receptance.examples import EXAMPLES, virtual_rig
from receptance.examples.simulated import taper_files
from receptance.examples.virtual_rig import DECAY_RATE, HITS, SAMPLE_RATE_HZ, SPACING_HZ, VirtualRig, load_rig
from receptance.identification.covariance import confidence_multiplier
from receptance.modal import circle_fit, fit_modes, half_power
from receptance.report import versions
from receptance.report.result import plain
from receptance.studies.bt50.report import PROVENANCE, RESPONSE_HZ, SOURCE, findings
from receptance.taper import (
    ForceSeries,
    Holder,
    RadialSolution,
    Shape,
    axial_from_mode,
    fit_laws,
    fit_taper,
    radial_from_modes,
)

if TYPE_CHECKING:
    from receptance.campaign import Campaign
    from receptance.frf import FRF
    from receptance.identification import Observation
    from receptance.modal import ModeEstimate
    from receptance.taper import AxialSolution, TaperFit

_PUBLISHED: dict[str, Any] = {
    "forces_kn": [0.0, 25.0],
    "sample_rate_hz": 20480.0,
    "spacing_hz": 20.0,
    "impacts": 10,
    "axial_stiffness_n_per_m": [4.8e9, 5.0e9],
    "axial_damping_ns_per_m": [1000.0, 2000.0],
    "unstable_above_kn": 10.0,
    "simulated_below_experiment_percent": 10.0,
}
"""Statements of the paper in its text (sections 4 to 6); values in its figures are not read off."""
_BANDS_HZ = {"axial": (3000.0, 6200.0), "radial": (500.0, 6200.0)}
_SPRINGS: dict[str, tuple[str, ...]] = {
    "axial": ("taper",),
    "radial": ("big_end", "small_end"),
    "both": ("taper", "big_end", "small_end"),
}
_SHOWN_KN = 20.0
"""Force of the paper's figure 9."""
_SAME = 0.05
"""Relative difference up to which two magnitudes are equal."""


def run(step_kn: int = 1, seed: int = 0, *, progress: Callable[[str], None] | None = None) -> dict[str, Any]:
    """Measure the virtual rig at all forces, identify, predict the levels that were left out, and diagnose.

    Parameters
    ----------
    step_kn : int, optional
        Step of the drawbar force from 0 to 25 kN: 1 as in the paper, or 2.
    seed : int, optional
        Seed of hits and noise.
    progress : callable, optional
        Called with a line of text before each step.

    Returns
    -------
    dict
        All results as JSON holds them; all measurements in it are virtual.

    Raises
    ------
    ValueError
        Another step, or a negative seed.
    """
    say = progress or (lambda _: None)
    holder, levels = virtual_rig.holder(), _levels(step_kn, seed)
    rows: dict[str, list[dict[str, Any]]] = {"axial": [], "radial": []}
    for rig, level_seed in levels:
        say(f"{rig.force_kn:g} kN, {rig.motion}")
        previous = rows[rig.motion][-1]["elastic"]["values"] if rows[rig.motion] else None
        identify = _axial if rig.motion == "axial" else _radial
        rows[rig.motion].append(identify(holder, rig, level_seed, previous))
    say("series, laws and predictions")
    series = _series(rows["axial"], rows["radial"])
    shown = int(np.argmin([abs(level["force_kn"] - _SHOWN_KN) for level in rows["axial"]]))
    bonded = holder.bonded("axial").get("taper.k_y")
    results: dict[str, Any] = {
        "study": "bt50",
        "source": SOURCE,
        "provenance": PROVENANCE,
        "settings": {
            "step_kn": step_kn,
            "seed": seed,
            "sample_rate_hz": SAMPLE_RATE_HZ,
            "spacing_hz": SPACING_HZ,
            "hits": HITS,
            "exponential_window_per_s": DECAY_RATE,
        },
        "versions": versions(),
        "published": _PUBLISHED,
        "virtual": {
            "holder": {**asdict(holder.body), "z1": holder.z1, "z2": holder.z2},
            **rows,
            "trends": plain({name: parameter.data() for name, parameter in series.items()}),
            "damping_errors": _damping_errors(rows["axial"]),
            "bonded_hz": {"axial": _axial_hz(holder, bonded), "radial": _radial_hz(holder, bonded, bonded)},
            "left_out": _left_out(holder, rows["axial"][1::2], rows["radial"][1::2], series),
            "diagnosis": [_diagnose_rigid(motion, step_kn, seed, say) for motion in rows],
            "damping_matters_hz": {
                motion: _bands_with_damping(motion, motion_rows[shown]["elastic"]["values"])
                for motion, motion_rows in rows.items()
            },
        },
    }
    return {**results, "findings": findings(results)}


def _levels(step_kn: int, seed: int) -> list[tuple[VirtualRig, int]]:
    """Return the rig at all levels with the seed of each measurement."""
    if isinstance(step_kn, bool) or not isinstance(step_kn, int) or step_kn not in (1, 2):
        raise ValueError(f"bt50: step_kn is {step_kn!r}, expected 1 or 2: laws need six levels, and as many between")
    _checks.whole_number("bt50", "seed", seed, least=0)
    return [
        (rig, int(np.random.SeedSequence([seed, number]).generate_state(1)[0]))
        for number, rig in enumerate(load_rig())
        if round(rig.force_kn) % step_kn == 0
    ]


def _half_power(frf: FRF, low_hz: float, high_hz: float) -> ModeEstimate:
    with warnings.catch_warnings():
        # The small number of lines in the half-power band is a result of the study.
        warnings.filterwarnings("ignore", ".*lines in the half-power band", ReceptanceWarning)
        return half_power(frf, low_hz=low_hz, high_hz=high_hz)


def _mode(mode: ModeEstimate) -> dict[str, Any]:
    names = ("frequency_hz", "frequency_standard_error_hz", "damping_ratio", "damping_standard_error", "lines_in_band")
    return {name: getattr(mode, name) for name in names}


def _estimate(solution: AxialSolution | RadialSolution, names: Sequence[str]) -> dict[str, Any]:
    joint = solution.joint if isinstance(solution, RadialSolution) else solution
    values = {name: getattr(joint, name) for name in names}
    return {"values": values, "intervals": {name: list(ends) for name, ends in solution.intervals.items()}}


def _fit_values(fit: TaperFit) -> dict[str, Any]:
    intervals = {name: list(ends) for name, ends in fit.intervals.items()}
    return {"values": dict(fit.values), "intervals": intervals, "rms": fit.rms, "errors": dict(fit.standard_errors)}


def _axial(holder: Holder, rig: VirtualRig, seed: int, start: Mapping[str, float] | None) -> dict[str, Any]:
    """Identify one axial level.

    The first mode from half-power points, as in the paper, and from a circle; K_Z1 and C_Z1 of eqs. 14 and 15 from
    either; the elastic and the rigid holder fitted to the FRF, the first from the values of the level before.
    """
    plain, windowed, left_out = rig.measure(seed)
    low, high = _BANDS_HZ["axial"]
    modes = {
        "half_power": _half_power(plain, low, high),
        "circle": circle_fit(windowed, low_hz=low, high_hz=high),
    }
    rigid_half_power, rigid = (
        axial_from_mode(
            holder.body,
            mode.frequency_hz,
            mode.damping_ratio,
            frequency_standard_error_hz=mode.frequency_standard_error_hz,
            damping_standard_error=mode.damping_standard_error,
        )
        for mode in modes.values()
    )
    band: dict[str, Any] = {"motion": "axial", "low_hz": low, "high_hz": high}
    first = {"k_z1": rigid.k_z1, "c_z1": max(rigid.c_z1, 1.0)}
    elastic = fit_taper(holder, windowed, **band, start=start or first, left_out=left_out)
    names = ("k_z1", "c_z1")
    return {
        "force_kn": rig.force_kn,
        **{name: _mode(mode) for name, mode in modes.items()},
        "rigid_half_power": _estimate(rigid_half_power, names),
        "rigid": _estimate(rigid, names),
        "rigid_rms": fit_taper(holder, windowed, body="rigid", contact="ends", **band, start=first).rms,
        "elastic": _fit_values(elastic),
        "experiment_hz": modes["circle"].frequency_hz,
        "simulated_hz": _axial_hz(holder, rigid.k_z1)[0],
        "elastic_hz": _axial_hz(holder, elastic.values["k_z1"])[0],
        "truth": {"frequency_hz": float(rig.frequency_hz[0]), "damping_ratio": float(rig.damping_ratio[0])},
    }


def _radial(holder: Holder, rig: VirtualRig, seed: int, start: Mapping[str, float] | None) -> dict[str, Any]:
    """Identify one radial level: both modes, the joints of the rigid holder, and the elastic holder's four values."""
    plain, windowed, left_out = rig.measure(seed)
    low, high = _BANDS_HZ["radial"]
    modes = fit_modes(windowed.select(low_hz=low, high_hz=high), 2)
    # Ratio of the constants at both points for the one hit, with its standard error to first order.
    first, second = modes.modal_constant[:, 0, 0], modes.modal_constant[:, 1, 0]
    ratio = first / second
    errors = np.hypot(
        np.abs(modes.modal_constant_standard_error[:, 0, 0] / second),
        np.abs(modes.modal_constant_standard_error[:, 1, 0] * ratio / second),
    )
    points = [holder.body.position(float(coordinate.position)) for coordinate in rig.seen]
    rigid = radial_from_modes(
        holder.body,
        holder.z1,
        holder.z2,
        modes.frequency_hz,
        modes.damping_ratio,
        frequency_standard_error_hz=modes.frequency_standard_error_hz,
        damping_standard_error=modes.damping_standard_error,
        shape=Shape(
            first=points[0],
            second=points[1],
            ratio=(complex(ratio[0]), complex(ratio[1])),
            standard_error=(float(errors[0]), float(errors[1])),
        ),
    )
    names = ("k_x1", "k_x2", "c_x1", "c_x2")
    simulated: tuple[float, ...] = ()
    if rigid.nearest is not None:
        joint = rigid.solutions[rigid.nearest].joint
        simulated = _radial_hz(holder, joint.k_x1, joint.k_x2)
        start = start or {name: max(getattr(joint, name), 1.0) for name in names}
    band: dict[str, Any] = {"motion": "bending", "low_hz": low, "high_hz": high}
    elastic = fit_taper(holder, windowed, contact="fading", **band, start=start, left_out=left_out)
    half_powers: list[dict[str, Any] | None] = []
    for frequency in modes.frequency_hz.tolist():
        try:
            mode = _half_power(plain.select(responses=0), 0.8 * frequency, 1.2 * frequency)
            half_powers.append(_mode(mode))
        except ValueError:  # no half-power points
            half_powers.append(None)
    return {
        "force_kn": rig.force_kn,
        "half_power": half_powers,
        "modes": [_mode(modes.mode(i)) for i in range(len(modes.frequency_hz))],
        "rigid": {
            "statement": rigid.statement,
            "of_neither": rigid.of_neither,
            "discriminant": rigid.discriminant,
            "discriminant_standard_error": rigid.discriminant_standard_error,
            "nearest": rigid.nearest,
            "solutions": [
                {
                    **_estimate(solution, names),
                    "exact": solution.exact and {name: getattr(solution.exact, name) for name in names},
                    "notes": list(solution.notes),
                }
                for solution in rigid.solutions
            ],
        },
        "elastic": _fit_values(elastic),
        "experiment_hz": modes.frequency_hz.tolist(),
        "simulated_hz": list(simulated),
        "elastic_hz": list(_radial_hz(holder, elastic.values["k_x1"], elastic.values["k_x2"])),
        "truth": {"frequency_hz": rig.frequency_hz[:2].tolist(), "damping_ratio": rig.damping_ratio[:2].tolist()},
    }


def _axial_hz(holder: Holder, k_z1: float) -> tuple[float, ...]:
    """Return the first mode of the elastic holder."""
    return tuple(holder.axial(k_z1).lowest_natural_frequencies(1)[0].tolist())


def _radial_hz(holder: Holder, k_x1: float, k_x2: float) -> tuple[float, ...]:
    """Return the first two modes of the elastic holder."""
    return tuple(holder.radial(k_x1, k_x2, contact="fading").lowest_natural_frequencies(2)[0].tolist())


def _series(axial: Sequence[dict[str, Any]], radial: Sequence[dict[str, Any]]) -> dict[str, ForceSeries]:
    """Return every parameter over force; residuals above the noise increase the standard errors."""
    force = np.array([level["force_kn"] for level in axial])
    width = 2.0 * confidence_multiplier(0.95, None)
    columns = {}
    for title, key in (("rigid", "rigid"), ("half-power", "rigid_half_power")):
        for name in ("k_z1", "c_z1"):
            errors = [np.ptp(level[key]["intervals"][name]) / width for level in axial]
            columns[f"{title} {name}"] = ([level[key]["values"][name] for level in axial], errors)
    for levels in (axial, radial):
        fits = [level["elastic"] for level in levels]
        for name in fits[0]["values"]:
            errors = [fit["errors"][name] * max(fit["rms"], 1.0) for fit in fits]
            columns[f"elastic {name}"] = ([fit["values"][name] for fit in fits], errors)
    return {
        name: ForceSeries(name=name, force=force, values=np.array(values), standard_errors=np.array(errors))
        for name, (values, errors) in columns.items()
    }


def _law_between(series: ForceSeries) -> list[float]:
    """Return the values at every second level from the law of the others."""
    laws = fit_laws(series.force[::2], series.values[::2], series.standard_errors[::2])
    return list(min(laws, key=lambda law: law.criterion).at(series.force[1::2]))


def _left_out(
    holder: Holder,
    axial: Sequence[dict[str, Any]],
    radial: Sequence[dict[str, Any]],
    series: Mapping[str, ForceSeries],
) -> list[dict[str, Any]]:
    """Return the errors of natural frequencies at levels that were left out, from laws of the others."""
    rigid, elastic = (
        [_axial_hz(holder, k) for k in _law_between(series[f"{model} k_z1"])] for model in ("rigid", "elastic")
    )
    springs = zip(*(_law_between(series[f"elastic {name}"]) for name in ("k_x1", "k_x2")), strict=True)
    # The rigid holder has the springs of the level itself, its best case; a level without a rigid joint has none.
    best_case = [tuple(level["simulated_hz"]) for level in radial]
    return [
        _frequency_errors("axial", axial, rigid, elastic),
        _frequency_errors("radial", radial, best_case, [_radial_hz(holder, *k) for k in springs]),
    ]


def _frequency_errors(
    motion: str,
    levels: Sequence[dict[str, Any]],
    rigid: Iterable[tuple[float, ...]],
    elastic: Iterable[tuple[float, ...]],
) -> dict[str, Any]:
    def errors(predicted: Iterable[tuple[float, ...]]) -> list[list[float]]:
        return [
            (100.0 * (np.array(frequencies) / level["experiment_hz"] - 1.0)).tolist()
            for frequencies, level in zip(predicted, levels, strict=True)
            if frequencies
        ]

    before, after = errors(rigid), errors(elastic)
    return {
        "motion": motion,
        "force_kn": [level["force_kn"] for level in levels],
        "rigid_percent": before,
        "elastic_percent": after,
        "before_rms_percent": float(np.sqrt(np.mean(np.square(before)))),
        "after_rms_percent": float(np.sqrt(np.mean(np.square(after)))),
    }


def _damping_errors(axial: Sequence[dict[str, Any]]) -> dict[str, dict[str, float]]:
    """Return mean and scatter of the relative error of the axial damping ratio in percent.

    At all forces, and at those at which the paper calls its damping unstable.
    """
    high = np.array([level["force_kn"] for level in axial]) > _PUBLISHED["unstable_above_kn"]
    errors = {}
    for name in ("half_power", "circle"):
        ratio = [level[name]["damping_ratio"] / level["truth"]["damping_ratio"] for level in axial]
        error = 100.0 * (np.array(ratio) - 1.0)
        errors[name] = {
            "mean_percent": float(error.mean()),
            "scatter_percent": float(error.std()),
            "mean_above_percent": float(error[high].mean()),
            "scatter_above_percent": float(error[high].std()),
        }
    return errors


def response_without_damping(
    motion: str, values: Mapping[str, float]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return frequencies in Hz and the magnitude at the tip with and without damping, `(n,)` each."""
    holder, lines = virtual_rig.holder(), np.arange(RESPONSE_HZ[0], RESPONSE_HZ[1] + 2.5, 5.0)
    stiffness = [value for name, value in values.items() if name[0] == "k"]
    damping = [value for name, value in values.items() if name[0] == "c"]

    def magnitude(damping: Sequence[float]) -> NDArray[np.float64]:
        if motion == "axial":
            return np.abs(holder.axial(*stiffness, *damping).receptance(lines))
        return np.abs(holder.radial(*stiffness, *damping, contact="fading").receptance(lines))

    return lines, magnitude(damping), magnitude([])


def _bands_with_damping(motion: str, values: Mapping[str, float]) -> list[list[float]]:
    """Return the bands in Hz in which the response without damping is wrong."""
    lines, damped, undamped = response_without_damping(motion, values)
    differs = np.abs(undamped / damped - 1.0) > _SAME
    edges = np.flatnonzero(np.diff(np.concatenate([[0], differs.astype(int), [0]])))
    return [[float(lines[a]), float(lines[b - 1])] for a, b in zip(edges[::2], edges[1::2], strict=True)]


def rigid_campaign(motion: str, step_kn: int = 1, seed: int = 0, *, levels: int = 3) -> Campaign:
    """Return the packaged campaign `taper` with the holder of the paper: rigid, with springs at the ends of the taper.

    The FRFs are those of `run`. A few forces, evenly spaced from the lowest on, are for identification; those between
    are held out. Axially, the position of the spring makes no difference on a rigid holder, so it lies along the taper.

    Parameters
    ----------
    motion : {"axial", "radial", "both"}
        Motions; with "both" one body has the springs of either.
    step_kn, seed : int, optional
        As in `run`.
    levels : int, optional
        Number of forces for identification; at least two.

    Raises
    ------
    ValueError
        An unknown motion; levels that are not from two to their number.

    Examples
    --------
    >>> from receptance.studies import bt50
    >>> bt50.rigid_campaign("axial", 2)
    Campaign('BT50 taper over drawbar force (simulated)', 13 assemblies, 13 measurements, 10 held out)
    """
    from receptance.campaign import Campaign

    if motion not in _SPRINGS:
        raise ValueError(f"bt50: motion is {motion!r}, expected one of {', '.join(_SPRINGS)}")
    motions = ("axial", "radial") if motion == "both" else (motion,)
    measured = [(rig, level_seed) for rig, level_seed in _levels(step_kn, seed) if rig.motion in motions]
    forces = sorted({rig.force_kn for rig, _ in measured})
    if isinstance(levels, bool) or not isinstance(levels, int) or not 2 <= levels <= len(forces):
        raise ValueError(f"bt50: levels is {levels!r}, expected from 2 to the {len(forces)} that are measured")
    identified = forces[:: (len(forces) - 1) // (levels - 1)][:levels]
    forces = [force for force in forces if force <= identified[-1]]  # levels above the last one are not predicted
    data = tomllib.loads(EXAMPLES["taper"].campaign)
    data["parts"]["holder"]["rigid"] = True
    for end, position in (("big_end", "83 mm"), ("small_end", "184.8 mm")):
        data["attachments"][end] = {"kind": "ground", "position": position}
    data["series"]["levels"] = [f"{force:g} kN" for force in forces]
    data["series"]["hold_out"] = [f"{force:g} kN" for force in forces if force not in identified]
    for section in ("assemblies", "measurements"):
        data[section] = {name: table for name, table in data[section].items() if name.startswith(motions)}
    data["unknowns"] = {name: table for name, table in data["unknowns"].items() if name.startswith(_SPRINGS[motion])}
    for table in data["measurements"].values():
        table["floor"] = "0.3 %"
    with tempfile.TemporaryDirectory() as folder:
        for name, content in taper_files(pair for pair in measured if pair[0].force_kn in forces).items():
            Path(folder, name).write_bytes(content)
        return Campaign.from_contents(Path(folder, "campaign.toml"), data)


def _diagnose_rigid(motion: str, step_kn: int, seed: int, say: Callable[[str], None]) -> dict[str, Any]:
    """Return the verdict on the rigid holder, with the improvement at the forces that are held out."""
    campaign = rigid_campaign(motion, step_kn, seed)
    verdict = replace(campaign, progress=lambda text: say(f"diagnosis: {text}")).diagnose()
    if not verdict.final:
        raise KeyboardInterrupt  # a study has no preliminary result
    return {
        "motion": motion,
        "model": "rigid holder",
        "seen_kn": _forces_kn(campaign.to_identify),
        "left_out_kn": _forces_kn(campaign.held_out),
        "in_every_explanation": [cause.id for cause in verdict.causes if cause.id not in verdict.ambiguous_between],
        **verdict.to_dict(),
    }


def _forces_kn(measurements: Mapping[str, Observation]) -> list[float]:
    conditions = (observation.conditions for observation in measurements.values())
    return list(dict.fromkeys(1e-3 * condition["drawbar force"] for condition in conditions))
