"""The study as what JSON holds."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

from receptance.report.plain import plain
from receptance.studies.bt50.findings import PROVENANCE, SOURCE, damping_errors, findings
from receptance.studies.bt50.rig import DECAY_RATE, HITS, SAMPLE_RATE_HZ, SPACING_HZ

if TYPE_CHECKING:
    from receptance.modal import ModeEstimate
    from receptance.studies.bt50.levels import AxialLevel, RadialLevel
    from receptance.studies.bt50.study import BT50Study
    from receptance.taper import RadialSolution, TaperFit

__all__ = ["as_dict"]


def as_dict(study: BT50Study) -> dict[str, Any]:
    """Return everything in plain numbers and texts; what is published and what is virtual lies apart."""
    return {
        "study": "bt50",
        "source": SOURCE,
        "provenance": PROVENANCE,
        "settings": {
            **dataclasses.asdict(study.settings),
            "sample_rate_hz": SAMPLE_RATE_HZ,
            "spacing_hz": SPACING_HZ,
            "hits": HITS,
            "exponential_window_per_s": DECAY_RATE,
        },
        "versions": study.versions,
        "published": study.published,
        "virtual": {
            "holder": {**dataclasses.asdict(study.holder.body), "z1": study.holder.z1, "z2": study.holder.z2},
            "axial": [_axial(level) for level in study.axial],
            "radial": [_radial(level) for level in study.radial],
            "trends": plain({name: series.data() for name, series in study.series.items()}),
            "damping_errors": damping_errors(study),
            "bonded_hz": {name: list(values) for name, values in study.bonded_hz.items()},
            "left_out": [
                {
                    **dataclasses.asdict(one),
                    "before_rms_percent": one.rigid_rms_percent,
                    "after_rms_percent": one.elastic_rms_percent,
                }
                for one in study.left_out
            ],
            "diagnosis": [
                {
                    "motion": one.motion,
                    "model": "rigid holder",
                    "seen_kn": list(one.seen_kn),
                    "left_out_kn": list(one.left_out_kn),
                    "in_every_explanation": [cause.id for cause in one.certain],
                    **one.verdict.to_dict(),
                    "gains": [dataclasses.asdict(gain) for gain in one.gains],
                }
                for one in study.diagnosed
            ],
            "damping_matters_hz": {
                one.motion: [list(band) for band in one.differs_hz] for one in study.damping_ignored
            },
        },
        "findings": [{"about": about, "text": text} for about, text in findings(study)],
    }


def _mode(mode: ModeEstimate | None) -> dict[str, Any] | None:
    if mode is None:
        return None
    names = ("frequency_hz", "frequency_standard_error_hz", "damping_ratio", "damping_standard_error", "lines_in_band")
    return {name: getattr(mode, name) for name in names}


def _axial(level: AxialLevel) -> dict[str, Any]:
    def joint(solution: Any) -> dict[str, Any]:
        values = {name: getattr(solution.joint, name) for name in ("k_z1", "c_z1")}
        return {"values": values, "intervals": {name: list(ends) for name, ends in solution.intervals.items()}}

    return {
        "force_kn": level.force_kn,
        "half_power": _mode(level.half_power),
        "circle": _mode(level.circle),
        "rigid_half_power": joint(level.rigid_half_power),
        "rigid": joint(level.rigid),
        "rigid_rms": level.rigid_rms,
        "elastic": _fit(level.elastic),
        "experiment_hz": level.circle.frequency_hz,
        "simulated_hz": level.simulated_hz,
        "elastic_hz": level.elastic_hz,
        "truth": {"frequency_hz": level.true_frequency_hz, "damping_ratio": level.true_damping_ratio},
    }


def _radial(level: RadialLevel) -> dict[str, Any]:
    return {
        "force_kn": level.force_kn,
        "half_power": [_mode(mode) for mode in level.half_power],
        "modes": [_mode(level.modes.mode(i)) for i in range(len(level.modes.frequency_hz))],
        "rigid": {
            "statement": level.solutions.statement,
            "discriminant": level.solutions.discriminant,
            "discriminant_standard_error": level.solutions.discriminant_standard_error,
            "nearest": level.solutions.nearest,
            "solutions": [_solution(one) for one in level.solutions.solutions],
        },
        "elastic": _fit(level.elastic),
        "experiment_hz": level.modes.frequency_hz.tolist(),
        "simulated_hz": list(level.simulated_hz),
        "elastic_hz": list(level.elastic_hz),
        "truth": {"frequency_hz": list(level.true_frequency_hz), "damping_ratio": list(level.true_damping_ratio)},
    }


def _solution(one: RadialSolution) -> dict[str, Any]:
    names = ("k_x1", "k_x2", "c_x1", "c_x2")
    exact = None if one.exact is None else {name: getattr(one.exact, name) for name in names}
    return {
        "values": {name: getattr(one.joint, name) for name in names},
        "exact": exact,
        "intervals": {name: list(ends) for name, ends in one.intervals.items()},
        "notes": list(one.notes),
    }


def _fit(fit: TaperFit) -> dict[str, Any]:
    intervals = {name: list(ends) for name, ends in fit.intervals.items()}
    return {"values": fit.values, "intervals": intervals, "rms": fit.rms}
