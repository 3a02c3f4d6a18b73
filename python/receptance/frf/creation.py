"""The fields of an FRF, checked, and what its drive points say of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from receptance import _checks
from receptance.frf import arrays
from receptance.frf.drive_points import Reading, judge
from receptance.frf.forms import check_form
from receptance.frf.places import Unplaced, describe, places

if TYPE_CHECKING:
    from receptance.frf.record import Record

__all__ = ["SAID_OF_DRIVE_POINTS", "about_drive_points", "checked"]

SAID_OF_DRIVE_POINTS = "drive point "
"""How such a note begins; it goes when what it is about is changed."""


def checked(
    *,
    frequency_hz: Any,
    values: Any,
    form: Any,
    responses: Any,
    excitations: Any,
    decay_rate: Any,
    coherence: Any,
    averages: Any,
    log_variance: Any,
    degrees_of_freedom: Any,
    correlated_lines: Any,
    usable: Any,
    labels: Any,
    label: Any,
    source: Any,
    notes: Sequence[str],
) -> dict[str, Any]:
    """Return the fields of an FRF in the form they are kept in, or raise; see `receptance.FRF`."""
    owner = f"FRF {label!r}" if label else "FRF"
    lines = arrays.lines(owner, frequency_hz)
    kept = arrays.response_values(owner, values, lines)
    shape = kept.shape
    quality, clipped = arrays.coherences(owner, coherence, lines, shape)
    found: dict[str, Any] = {
        "frequency_hz": lines,
        "values": kept,
        "form": check_form(owner, form),
        "responses": places(owner, "responses", responses, shape[1]),
        "excitations": places(owner, "excitations", excitations, shape[2]),
        "decay_rate": _checks.not_negative(owner, "decay_rate", decay_rate, unit="1/s"),
        "coherence": quality,
        "averages": arrays.count(owner, "averages", averages),
        "log_variance": arrays.per_entry(owner, "log_variance", log_variance, shape, at_least=0.0),
        "degrees_of_freedom": arrays.per_entry(
            owner, "degrees_of_freedom", degrees_of_freedom, shape, at_least=0.0, above=True
        ),
        "correlated_lines": arrays.per_line(owner, "correlated_lines", correlated_lines, lines.size, at_least=1.0),
        "usable": arrays.mask(owner, usable, lines.size),
        "labels": arrays.text_pair(owner, labels, (shape[1], shape[2])),
        "label": "" if label is None else str(label),
        "source": "" if source is None else str(source),
        "notes": arrays.texts(owner, "notes", notes) + ((clipped,) if clipped else ()),
    }
    return arrays.without_bad_zero_line(owner, found)


def about_drive_points(frf: Record) -> list[str]:
    """Return what should be said of the drive points: one text for each that looks otherwise than declared."""
    said = []
    chosen = slice(None) if frf.usable is None else frf.usable
    for i, response in enumerate(frf.responses):
        for j, excitation in enumerate(frf.excitations):
            if isinstance(response, Unplaced) or response != excitation:
                continue
            verdict = judge(frf.frequency_hz[chosen], frf.values[chosen, i, j], frf.form)
            if not verdict.contradicted:
                continue
            looks = ", or like ".join(_in_words(reading, frf.form) for reading in verdict.readings)
            peaks = "its only clear peak looks" if verdict.peaks == 1 else f"its {verdict.peaks} clear peaks look"
            said.append(
                f"{SAID_OF_DRIVE_POINTS}{describe(response)}: {peaks} like {looks}; not like {frf.form}, as declared "
                "(a structure that gives off no energy, e^(+i w t)). Nothing was changed"
            )
    return said


def _in_words(reading: Reading, declared: str) -> str:
    remedies = []
    if reading.form != declared:
        remedies.append(f"form={reading.form!r}")
    if reading.flipped:
        remedies.append("a sensor or hammer that faces the other way, flipped()")
    if reading.conjugated:
        remedies.append("written for e^(-i w t), conjugated()")
    return f"{reading} ({'; '.join(remedies)})"
