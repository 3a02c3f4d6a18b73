"""The clamping studies as plain values."""

from __future__ import annotations

from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance.studies.clamping.findings import findings

if TYPE_CHECKING:
    from receptance.studies.clamping.study import ClampingStudy
    from receptance.studies.clamping.trends import FittedLaw

__all__ = ["as_dict"]


def as_dict(study: ClampingStudy) -> dict[str, Any]:
    """Return the result as what JSON holds: what is not finite is None."""
    low, high = study.trends.torque_range_nm
    return {
        "study": "clamping",
        "settings": {
            "seed": study.settings.seed,
            "noise": study.settings.measuring.noise,
            "resolution": asdict(study.settings.resolution),
            "ratios": list(study.settings.ratios),
        },
        "claims": [asdict(claim) for claim in study.claims],
        "insertion": {
            "virtual": True,
            "cases": [
                {
                    "ratio": case.ratio,
                    "change_percent": case.change_percent,
                    "frequency_percent": list(case.frequency_percent),
                    "found": case.found.name,
                    "hypotheses": [
                        {
                            "name": one.name,
                            "log_evidence": _finite(one.log_evidence),
                            "rms": one.fit.rms,
                            "adequate": one.adequate,
                            "values": dict(one.fit.values),
                        }
                        for one in case.hypotheses
                    ],
                    "compliance_of_outer": {name: case.compliance_of_outer(name) for name in ("k_y", "k_theta")},
                }
                for case in study.insertion.cases
            ],
        },
        "material": {
            "virtual": True,
            "control_percent": study.material.control_percent,
            "changes": [asdict(one) for one in study.material.changes],
            "modulus_percent": {f"{d:g} mm": value for d, value in study.material.modulus_percent.items()},
        },
        "damping": {
            "virtual": True,
            "cases": [asdict(one) for one in study.damping.cases],
            "allowed_factor": {test: _finite(value) for test, value in study.damping.allowed.items()},
        },
        "torque": [
            {
                "diameter_mm": one.diameter_mm,
                "change_percent": one.trend.change_percent,
                "change_of_end_values_percent": one.trend.end_values.percent,
                "interval_of_resolution": list(one.trend.interval),
                "more_than_resolution": one.trend.exceeds,
                "law": _law(one.law, low, high),
                "law_if_reclamped": _law(one.reclamped, low, high),
            }
            for one in study.torque
        ],
        "diameter": [_law(one, 7.94e-3, 16e-3) for one in study.diameter],
        "findings": [{"about": about, "text": text} for about, text in findings(study)],
        "versions": dict(study.versions),
    }


def _law(law: FittedLaw, low: float, high: float) -> dict[str, Any]:
    return {
        "quantity": law.quantity,
        "of": law.of,
        "exponent": law.exponent,
        "interval": list(law.interval),
        "change_percent": list(law.change_percent(low, high)),
        "scatter_percent": law.scatter_percent,
        "log_evidence_against_constant": _finite(law.log_evidence),
        "told": law.told,
    }


def _finite(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None
