"""The study as what JSON holds."""

from __future__ import annotations

import dataclasses
from typing import Any

from receptance.studies.er32.findings import findings
from receptance.studies.er32.study import ER32Study
from receptance.studies.er32.tables import SOURCE
from receptance.studies.er32.transfer import ModeError, SetVerdict
from receptance.studies.er32.trends import Step

__all__ = ["as_dict"]


def as_dict(study: ER32Study) -> dict[str, Any]:
    """Return the study as dictionaries, lists, text, numbers and None; an open end of an interval is None."""
    bias = study.bias
    return {
        "study": "er32",
        "source": SOURCE,
        "settings": dataclasses.asdict(study.settings),
        "seed": study.settings.seed,
        "versions": study.versions,
        "inferred": _inferred(study),
        "identified": [_joint(joint) for joint in study.identified],
        "published_predictions": {
            "rms_percent": study.published_predictions_rms_percent,
            "rows": [
                {
                    "diameter_mm": row.diameter_mm,
                    "overhang_mm": row.overhang_mm,
                    "mode": row.mode,
                    "published_hz": row.published_hz,
                    "predicted_hz": row.predicted_hz,
                    "difference_percent": row.against_published_percent,
                }
                for row in study.published_predictions
            ],
        },
        "transfer": {
            "rms_percent": study.transfer_rms_percent,
            "published_rms_percent": study.published_transfer_rms_percent,
            "rows": [
                dataclasses.asdict(row)
                | {"error_percent": row.error_percent, "published_error_percent": row.published_error_percent}
                for row in study.transfers
            ],
        },
        "parameter_sets": [_set(verdict) for verdict in study.parameter_sets],
        "trends": _trends(study),
        "long_first_mode_bias_percent": list(bias.percent),
        "long_first_mode_bias_p_value": bias.p_value,
        "long_first_mode_bias": dataclasses.asdict(bias)
        | {
            "simulation": dataclasses.asdict(study.simulation),
            "single_causes": [dataclasses.asdict(cause) for cause in study.causes],
            "overhang_scatter_mm": study.overhang_scatter_mm,
        },
        "disagreements": [dataclasses.asdict(item) for item in study.disagreements],
        "findings": [{"about": about, "text": text} for about, text in findings(study)],
    }


def _inferred(study: ER32Study) -> dict[str, Any]:
    consistency = study.consistency
    return {
        "what": "shape of the holder, modulus and density of the carbide",
        "how": study.model.inference,
        "frequencies": consistency.frequencies,
        "rms_percent": consistency.rms_percent,
        "quantities": [dataclasses.asdict(quantity) for quantity in consistency.quantities],
        "combinations_known": consistency.combinations_known,
        "known_within_percent": consistency.known_within_percent,
        "singular_values": list(consistency.singular_values),
    }


def _joint(joint: Any) -> dict[str, Any]:
    return dataclasses.asdict(joint) | {
        "k_y_interval": list(joint.k_y_interval),
        "k_theta_interval": list(joint.k_theta_interval),
        "k_y_difference_percent": joint.k_y_difference_percent,
        "k_theta_difference_percent": joint.k_theta_difference_percent,
    }


def _mode(error: ModeError | None) -> dict[str, Any] | None:
    return None if error is None else dataclasses.asdict(error) | {"error_percent": error.percent}


def _set(verdict: SetVerdict) -> dict[str, Any]:
    return {
        "set": verdict.name,
        "k_y": verdict.k_y,
        "k_theta": verdict.k_theta,
        "worst_error_percent": verdict.worst.percent,
        "worst": _mode(verdict.worst),
        "threshold_percent": verdict.threshold_percent,
        "betrayed": bool(verdict.betrayed_by),
        "betrayed_by": [_mode(error) for error in verdict.betrayed_by],
        "first_betrayal": _mode(verdict.first_betrayal()),
        "first_betrayal_of_first_mode": _mode(verdict.first_betrayal(1)),
        "errors": [_mode(error) for error in verdict.errors],
    }


def _step(step: Step) -> dict[str, Any]:
    return dataclasses.asdict(step) | {"interval": list(step.interval), "exceeds": step.exceeds}


def _trends(study: ER32Study) -> dict[str, Any]:
    return {
        "torque_range_nm": list(study.trends.torque_range_nm),
        "torque": [
            dataclasses.asdict(trend)
            | {
                "exceeds": trend.exceeds,
                "steps": [_step(step) for step in trend.steps],
                "end_values": _step(trend.end_values),
            }
            for trend in study.trends.torque
        ],
        "diameter": [
            dataclasses.asdict(law) | {"exceeds": law.exceeds, "steps": [_step(step) for step in law.steps]}
            for law in study.trends.diameter
        ],
    }
