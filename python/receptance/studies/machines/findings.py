"""What the study found, in sentences, and as what JSON holds; every output says that the machines are simulated."""

from __future__ import annotations

import dataclasses
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance.report.plain import plain

if TYPE_CHECKING:
    from receptance.studies.machines.study import MachineCase, MachinesStudy
    from receptance.studies.machines.tips import Tip

__all__ = ["PROVENANCE", "as_dict", "close_and_far", "findings"]

PROVENANCE = (
    "VIRTUAL: the paper prints neither its spindles nor the measured responses. Both machines' spindles are made up, "
    "and their hammer tests are simulated; tools, overhangs and joints are those of its table 5, the first holder is "
    "inferred from its tables, the second is another of the same kind with the same joints. Prediction and truth share "
    "holder and joint, so that what is compared is what the identified spindle does. Agreement with the paper is no "
    "evidence."
)
_WELL = 0.9
_CLOSE_PERCENT = 30.0
"""A peak is close to the spindle's mode within this; the paper's two modes are."""


def findings(study: MachinesStudy) -> tuple[tuple[str, str], ...]:
    """Return what each sentence is about, and the sentence."""
    return (
        ("virtual", PROVENANCE),
        *(("spindle", text) for case in study.cases for text in _spindle(case)),
        *(("tools", _tools(case)) for case in study.cases),
        *(("short", _short(case)) for case in study.cases),
        *(("close", text) for text in _close(study)),
    )


def _spindle(case: MachineCase) -> list[str]:
    found = case.found
    lines = np.asarray(found.frequency_hz).real
    share = 100.0 * float(found.usable.mean())
    modes = ", ".join(f"{mode.frequency_hz:.0f}" for mode in case.modes.part.modes if mode.frequency_hz < lines[-1])
    return [
        f"{case.machine.name} (VIRTUAL): from simulated hits on a blank of {case.machine.blank_mm:g} mm, {share:.1f} % "
        f"of {lines.size} lines from {lines[0]:.0f} to {lines[-1]:.0f} Hz are usable; the median error of its terms is "
        f"{100.0 * case.error:.1f} % line by line and {100.0 * case.error_of_modes:.1f} % as modes (at {modes} Hz, and "
        "one above the band)."
    ]


def _tools(case: MachineCase) -> str:
    peaks = [peak for peak in case.peaks if np.isfinite(peak.predicted_hz)]
    frequency = np.array([abs(peak.frequency_percent) for peak in peaks])
    magnitude = np.array([abs(peak.magnitude_percent) for peak in peaks])
    return (
        f"{case.machine.name} (VIRTUAL): {len(peaks)} of {len(case.peaks)} peaks of {len(case.tips)} medium and long "
        f"tools are predicted; frequencies within {frequency.max():.2f} % (paper: 2 to 3 %), heights within "
        f"{magnitude.max():.0f} %, median {np.median(magnitude):.0f} % (paper: up to 100 %)."
    )


def _short(case: MachineCase) -> str:
    unknown = [one for one in case.short if not one.known]
    known = [one for one in case.short if one.known]
    top = next((one for one in reversed(case.reach) if one.usable >= _WELL), case.reach[0])
    places = ", ".join(f"{one.true_hz:.0f}" for one in case.short)
    text = (
        f"{case.machine.name} (VIRTUAL): short tools have their highest peaks at {places} Hz; above "
        f"{top.high_hz:.0f} Hz in no band {100.0 * _WELL:.0f} % of the spindle's lines are usable. Of "
        f"{len(unknown)} of {len(case.short)} tools nothing can be predicted, as no line near their peak is"
    )
    if known:
        off = ", ".join(
            f"{one.magnitude_percent:+.0f} % (stated standard deviation {one.deviation_percent:.0f} %)" for one in known
        )
        text += f"; of the others the height is off by {off}"
    return text + "."


def close_and_far(study: MachinesStudy) -> tuple[float, float, float]:
    """Return the largest errors in percent of a displaced mode: height and frequency near it, height elsewhere."""
    near = [one for one in study.displaced if abs(one.apart_percent) < _CLOSE_PERCENT]
    far = [one for one in study.displaced if abs(one.apart_percent) >= _CLOSE_PERCENT]
    return (
        max(abs(one.magnitude_percent) for one in near),
        max(abs(one.frequency_percent) for one in near),
        max((abs(one.magnitude_percent) for one in far), default=0.0),
    )


def _close(study: MachinesStudy) -> list[str]:
    case, verdict = study.cases[0], study.verdict
    mode = case.modes.part.modes[study.mode]
    height, frequency, far = close_and_far(study)
    named = ", ".join(f"{one.id} ({one.variant})" for one in verdict.causes) or "no cause"
    sizes = [
        f"{name.split('.')[1]} {value:+.4f} ({low:+.4f} to {high:+.4f})"
        for one in verdict.causes
        for name, (value, low, high) in one.parameters.items()
    ]
    way = "low" if study.settings.moved_percent < 0.0 else "high"
    put_in = -float(np.log1p(0.01 * study.settings.moved_percent))
    return [
        f"The spindle's mode at {mode.frequency_hz:.0f} Hz put {abs(study.settings.moved_percent):g} % too {way}: "
        f"peaks within {_CLOSE_PERCENT:g} % of it are off by up to {height:.0f} % in height and {frequency:.1f} % in "
        f"frequency, those further away by at most {far:.0f} % in height. Two modes close together share what is "
        "between them: that is where the paper misses heights.",
        f"Tools measured there, with the joint as what is identified: the answer is {verdict.verdict}, {named}; "
        f"{', '.join(sizes)}; put in was a log_frequency of {put_in:+.4f}.",
    ]


def as_dict(study: MachinesStudy) -> dict[str, Any]:
    """Return everything in plain numbers and texts; what is no number is null."""
    result: dict[str, Any] = plain(_whole(study))
    return result


def _whole(study: MachinesStudy) -> dict[str, Any]:
    return {
        "study": "machines",
        "provenance": PROVENANCE,
        "settings": dataclasses.asdict(study.settings),
        "versions": study.versions,
        "virtual": [
            {
                "machine": case.machine.name,
                "spindle": case.found.to_dict(),
                "modes": [dataclasses.asdict(mode) for mode in case.modes.part.modes],
                "median_error": case.error,
                "median_error_of_modes": case.error_of_modes,
                "tools": [_tip(tip) for tip in case.tips],
                "tools_line_by_line": [_tip(tip) for tip in case.by_line],
                "reach": [dataclasses.asdict(one) for one in case.reach],
                "short": [dataclasses.asdict(one) for one in case.short],
            }
            for case in study.cases
        ],
        "displaced": [dataclasses.asdict(one) for one in study.displaced],
        "diagnosis": study.verdict.to_dict(),
        "findings": [{"about": about, "text": text} for about, text in findings(study)],
    }


def _tip(tip: Tip) -> dict[str, Any]:
    return {
        "tool": dataclasses.asdict(tip.tool),
        "peaks": [{**dataclasses.asdict(peak), "frequency_percent": peak.frequency_percent} for peak in tip.peaks],
    }
