"""What the study of table 3 found, in sentences and as plain values; all follows from its numbers."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance.studies.er32.tables import SOURCE
from receptance.studies.table3.candidates import STIFFNESSES, half_width_percent
from receptance.studies.table3.machine import damping_bounds

if TYPE_CHECKING:
    from receptance.identification.profiles import Profile
    from receptance.studies.table3.sets import SetVerdict
    from receptance.studies.table3.study import Table3Study

__all__ = ["as_dict", "findings"]

_NONE = 1e-3
_CERTAIN = 1e-6
"""Nobody knows the tails of these distributions further out than this."""


def findings(study: Table3Study) -> tuple[tuple[str, str], ...]:
    """Return pairs of subject and sentences."""
    return (
        *(("virtual", text) for text in _on_simulation(study)),
        *(("machine", text) for text in _on_machine(study)),
        *(("sets", text) for text in _on_sets(study)),
        *(("next", text) for text in _on_next(study)),
    )


def _on_simulation(study: Table3Study) -> Iterator[str]:
    measuring, truth = study.settings.measuring, study.machine.truth
    yield (
        "VIRTUAL: every response here is simulated, the spindle is our own, the holder is inferred and not published; "
        f"the joint taken as true is table 3's curve-fitted set (k_y {truth['joint.k_y']:.3g} N/m, k_theta "
        f"{truth['joint.k_theta']:.3g} N m/rad, c_theta {truth['joint.c_theta']:.3g} N m s/rad) with an assumed c_y of "
        f"{truth['joint.c_y']:g} N s/m. Source of the sets: {SOURCE}."
    )
    bounds = damping_bounds(truth["joint.k_y"], truth["joint.k_theta"])
    yield (
        f"Noise: coherence {measuring.coherence:g} from {measuring.averages} averages, so {100 * measuring.noise:.1f} "
        f"% on every line, {measuring.step_hz:g} Hz apart, with a floor of 0.3 % and of 0.01 % of frequency; in the "
        f"machine {measuring.machine_hz[0]:g} to {measuring.machine_hz[1]:g} Hz, free {measuring.free_hz[0]:g} to "
        f"{measuring.free_hz[1]:g} Hz. Tolerances (standard deviations, drawn for the simulation and fitted): carbide "
        "E 1 % and density 0.5 %, blank 5 um, steel E 1 %, holder 0.1 mm, every overhang 0.1 mm, taper and bearings 10 "
        f"%. Bounds of the dampings: c_y up to {bounds['joint.c_y'][1]:.3g} N s/m, c_theta up to "
        f"{bounds['joint.c_theta'][1]:.2g} N m s/rad, a loss factor of 0.12 of the true stiffness at the tool's mode."
    )


def _on_machine(study: Table3Study) -> Iterator[str]:
    for name, profile in study.profiles.items():
        yield f"{name}: {_said(profile)}."


def _on_sets(study: Table3Study) -> Iterator[str]:
    level = 100.0 * study.settings.level
    for one in study.sets:
        verdict = "rejected" if one.rejected(study.settings.level) else "not rejected"
        yield (
            f"{one.name}: by hand it passes in the machine unless frequencies are read better than to "
            f"{_small(one.reading_percent)} (with modes that show no peak {_small(one.all_modes_percent)}); "
            f"at the stated noise, everything else fitted again, it is {verdict} at {level:g} % ({_p(one)})."
        )
    for one in study.free_sets:
        worst = max((mode for mode in one.modes if mode.peak), key=lambda mode: abs(mode.percent), default=None)
        if worst is not None and one.name != "curve_fitted":
            first = one.modes[0]
            yield (
                f"{one.name} free: mode {first.mode} {first.percent:+.1f} %, worst mode {worst.mode} "
                f"{worst.percent:+.1f} %; it would pass a reading of {_small(one.reading_percent)}."
            )


def _on_next(study: Table3Study) -> Iterator[str]:
    alone = {name: half_width_percent(study.profiles[name]) for name in STIFFNESSES}
    unknown = max(alone, key=lambda name: alone[name])
    best = study.expected[0]
    yield (
        f"Known worst is {unknown} ({_percent(alone[unknown])}). Of {len(study.expected)} tests, simulated for three "
        f"joints that the data allow, {best.candidate.name} promises most ({_both(best.percent)}); "
        + "; ".join(f"{e.candidate.name}: {_both(e.percent)}" for e in study.expected[1:])
        + "."
    )
    useless = [e.candidate.name for e in study.expected if not np.isfinite(e.worst_percent)]
    if useless:
        yield f"These leave a side open for some joint that the data allow: {', '.join(useless)}."
    both = {name: half_width_percent(study.both_profiles[name]) for name in STIFFNESSES}
    verdict = "closes" if study.closes else "does not close"
    truth = study.holds_truth(study.both_profiles)
    yield (
        f"Adding {study.chosen.name}, measured with noise and errors, {verdict} both intervals to under 10 %: "
        f"{_both(both)}; the simulated values are inside: {', '.join(f'{n} {_yes(truth[n])}' for n in STIFFNESSES)}."
    )
    if study.best != study.chosen:
        found = {name: half_width_percent(study.best_profiles[name]) for name in STIFFNESSES}
        yield f"Adding {study.best.name} instead: {_both(found)}."
    after = [one.name for one in study.free_sets if one.rejected(study.settings.level)]
    yield f"With it these sets are rejected at {100.0 * study.settings.level:g} %: {', '.join(after) or 'none'}."


def _said(profile: Profile) -> str:
    if profile.bounded:
        return f"{profile.statement} ({profile.lower:.3g} to {profile.upper:.3g})"
    return profile.statement


def _p(one: SetVerdict) -> str:
    if one.held is None:
        return ""
    p = one.held.p_value
    return f"rise of -2 log L {one.held.rise:.3g}, " + (f"p = {p:.2g}" if p >= _CERTAIN else f"p < {_CERTAIN:g}")


def _small(percent: float) -> str:
    return f"{percent:.2g} %" if percent >= _NONE else "0 %"


def _percent(value: float) -> str:
    return f"{value:.2g} %" if np.isfinite(value) else "open"


def _both(percent: dict[str, float]) -> str:
    return ", ".join(f"{name.removeprefix('joint.')} {_percent(value)}" for name, value in percent.items())


def _yes(value: bool) -> str:
    return "yes" if value else "no"


def as_dict(study: Table3Study) -> dict[str, Any]:
    """Return the result as what JSON holds: an open end is None."""
    measuring = study.settings.measuring
    return {
        "study": "table3",
        "virtual": True,
        "settings": {
            "seed": study.settings.seed,
            "level": study.settings.level,
            "coherence": measuring.coherence,
            "averages": measuring.averages,
            "noise": measuring.noise,
            "step_hz": measuring.step_hz,
            "machine_hz": list(measuring.machine_hz),
            "free_hz": list(measuring.free_hz),
        },
        "truth": dict(study.machine.truth),
        "errors": dict(study.errors),
        "machine_alone": _profiles(study.profiles),
        "sets": [_set(one, study.settings.level) for one in (*study.sets, *study.free_sets)],
        "expected": [
            {
                "name": one.candidate.name,
                "overhang_mm": one.candidate.overhang_mm,
                "free": one.candidate.free,
                "half_width_percent": {name: _finite(value) for name, value in one.percent.items()},
                "half_width_percent_at_fit": {name: _finite(value) for name, value in one.at_fit.items()},
            }
            for one in study.expected
        ],
        "with_free_free": _profiles(study.both_profiles),
        "closes": study.closes,
        "best": study.best.name,
        "with_best": _profiles(study.best_profiles),
        "findings": [{"about": about, "text": text} for about, text in findings(study)],
        "versions": dict(study.versions),
    }


def _profiles(profiles: dict[str, Profile]) -> dict[str, Any]:
    return {
        name: {
            "value": one.value,
            "interval": [None if one.lower_open else one.lower, None if one.upper_open else one.upper],
            "half_width_percent": _finite(half_width_percent(one)) if "k_" in name else None,
            "statement": one.statement,
        }
        for name, one in profiles.items()
    }


def _set(one: SetVerdict, level: float) -> dict[str, Any]:
    return {
        "name": one.name,
        "test": one.test,
        "k_y": one.k_y,
        "k_theta": one.k_theta,
        "modes": [
            {
                "mode": m.mode,
                "true_hz": m.true_hz,
                "with_set_hz": m.with_set_hz,
                "percent": m.percent,
                "shows_as_peak": m.peak,
            }
            for m in one.modes
        ],
        "passes_by_hand_from_percent": one.reading_percent,
        "over_all_modes_percent": one.all_modes_percent,
        "rise": None if one.held is None else _finite(one.held.rise),
        "p_value": None if one.held is None else one.held.p_value,
        "rejected": one.rejected(level),
    }


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
