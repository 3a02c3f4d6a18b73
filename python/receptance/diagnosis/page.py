"""The report of a diagnosis: one HTML file with key figures, the answer, figures and tables, without scripts."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING, Any

from receptance.diagnosis import card
from receptance.diagnosis.by_mode import Curve, ModeResidual, curves
from receptance.diagnosis.figure import curve_figure, evidence_figure, frequencies_figure
from receptance.diagnosis.held_out_curves import held_out_curves
from receptance.diagnosis.screening import look_alike
from receptance.diagnosis.thresholds import LOOK_ALIKE
from receptance.diagnosis.wording import metric, names, of_metric, sentence, sizes
from receptance.report import Column, Table
from receptance.report.figure import as_svg
from receptance.report.html import facts_html, html_page, meta, shown, table_html
from receptance.report.table import number

if TYPE_CHECKING:
    from receptance.diagnosis import Verdict
    from receptance.report.table import Cell

_RECORDS = 12
"""Number of records that are drawn, those with the largest residuals first: a page of about 1 MB at most."""


def diagnosis_page(verdict: Verdict, title: str = "", measured: Sequence[Table] = ()) -> str:
    """Return a diagnosis as one HTML page: `Verdict.to_html`.

    Key figures, the answer, its effect, held-out and fitted records before and after with their ratio in decibels, all
    causes with their odds, residuals by mode, notes, settings and versions.
    """
    heading = title or verdict.title
    parts = [*_header(verdict, heading), *_answer(verdict), *_held_out(verdict), *_records(verdict), *_causes(verdict)]
    parts += [*_details(verdict), *(table_html(table) for table in measured), *_notes(verdict)]
    return html_page(heading, parts)


def _header(verdict: Verdict, heading: str) -> Iterable[str]:
    tiles = [
        f'<div class="tile"><b>{_unbroken(value)}</b><span>{shown(name)}</span></div>'
        for name, value in card.key_figures(verdict)
    ]
    yield f"<header><h1>{shown(heading)}</h1>"
    state = "" if verdict.final else " so far, not final"
    yield f'<p><span class="badge {verdict.verdict}">{verdict.verdict}</span>{state}</p>'
    yield f'<p class="lead">{shown(sentence(verdict))}</p>'
    yield meta(verdict, _data(verdict))
    if verdict.description:
        yield f'<p class="meta">{shown(verdict.description)}</p>'
    yield f'<div class="tiles">{"".join(tiles)}</div></header>'


def _unbroken(value: str) -> str:
    """Return a value, or values before and after, with line breaks only beside the arrow: 2.3e-4 has a hyphen."""
    return " → ".join(f"<span>{shown(part)}</span>" for part in value.split(" → "))


def _data(verdict: Verdict) -> str:
    """Return the number of records, lines and natural frequencies."""
    observed = verdict.selection.base.model.observations
    receptances = [one for one in observed if one.is_receptance]
    lines = sum(one.frequency_hz.size for one in receptances)
    frequencies = sum(one.frequency_hz.size for one in observed if not one.is_receptance)
    found = [f"{_count(len(receptances), 'receptance')} with {lines} lines"] if receptances else []
    found += [_count(frequencies, "natural frequency", "natural frequencies")] if frequencies else []
    return f"{' and '.join(found)} of {_count(len(verdict.selection.base.model.configurations), 'configuration')}"


def _count(number: int, one: str, several: str = "") -> str:
    return f"{number} {one if number == 1 else several or f'{one}s'}"


def _answer(verdict: Verdict) -> Iterable[str]:
    # The verdict itself is in the header.
    first, *others = verdict.facts()
    yield "<h2>Answer</h2>"
    yield "".join(f"<p>{shown(text)}</p>" for text in first.texts[1:])
    yield facts_html(others)
    if verdict.next_step:
        yield f"<p><b>Next step:</b> {shown(verdict.next_step)}.</p>"
    yield from (table_html(table) for table in card.effect(verdict))


def _before_and_after(verdict: Verdict, separator: str = " ") -> str:
    """Return that data are shown before and after the causes; empty where no cause is part of the model."""
    return "" if verdict.explanation is None else f"{separator}before and after"


def _held_out(verdict: Verdict) -> Iterable[str]:
    if not verdict.gains:
        return
    yield f"<h2>Held-out data{_before_and_after(verdict, ', ')}</h2>"
    own = "which were not fitted" if verdict.held_out is not None else "each left out of the fit"
    drawn = held_out_curves(verdict)
    if drawn:
        yield f'<p class="small">Records {own}: measured, and predicted by the model{_before_and_after(verdict)}.</p>'
        yield _figures([(f"held out: {one.label}", curve_figure(one, after)) for one, after in drawn])
    if verdict.bias is not None:
        yield f"<p>With the model as it is, {shown(str(verdict.bias))}.</p>"
    yield _folds(verdict)
    yield _mode_table("Held-out modes, predicted less measured", verdict.held_out_modes, verdict.held_out_modes_after)


def _folds(verdict: Verdict) -> str:
    gain = verdict.gains[0]
    if len(gain.folds) < 2:
        return ""
    rows = [
        (
            fold["configuration"],
            fold["verdict"],
            names(fold["causes"]) if fold["causes"] else "none",
            *(of_metric(gain.metric, fold[key]) if math.isfinite(fold[key]) else "" for key in ("before", "after")),
        )
        for fold in gain.folds
    ]
    columns = ("held out", "verdict without it", "causes", Column("before"), Column("after"))
    return table_html(Table(f"By configuration: {metric(gain.metric)[0]}", columns, rows))


def _records(verdict: Verdict) -> Iterable[str]:
    base, explanation = verdict.base_fit, verdict.explanation
    before = curves(base)
    after: list[Curve | None] = list(curves(explanation.fit)) if explanation is not None else [None] * len(before)
    receptances = [i for i, one in enumerate(base.model.observations) if one.is_receptance]
    largest = sorted(receptances, key=lambda i: -float((before[i].residual ** 2).mean()))[:_RECORDS]
    drawn = [(before[i].label or f"receptance {i + 1}", curve_figure(before[i], after[i])) for i in sorted(largest)]
    frequencies = [i for i in range(len(before)) if i not in receptances]
    if frequencies:
        extended = [curve for i in frequencies if (curve := after[i]) is not None]
        drawn.append(("natural frequencies", frequencies_figure([before[i] for i in frequencies], extended)))
    yield f"<h2>Fitted data{_before_and_after(verdict, ', ')}</h2>"
    if len(receptances) > len(largest):
        yield f'<p class="small">The {len(largest)} of {len(receptances)} records with the largest residuals.</p>'
    yield _figures(drawn)
    yield _mode_table("Residuals at each mode, modelled less measured", verdict.modes, verdict.modes_after)


def _figures(drawn: Sequence[tuple[str, Any]]) -> str:
    return (
        f'<div class="figures">{"".join(f"<figure>{as_svg(figure, title)}</figure>" for title, figure in drawn)}</div>'
    )


def _causes(verdict: Verdict) -> Iterable[str]:
    if not verdict.candidates:
        return
    yield "<h2>All causes</h2>"
    yield (
        '<p class="small">A cause is reported only if the model with it is adequate, whatever its odds. All adequate '
        "causes with odds above 1 : 150 to the best, left of the dashed line, are reported.</p>"
    )
    yield _figures([("odds of each cause alone to the best", evidence_figure(verdict))])
    table = card.alternatives(verdict, None)
    if table.rows:
        yield table_html(table)
    rows = [(one.title, one.variant, sizes(one)) for one in card.beyond_chance(verdict) if one.parameters]
    if rows:
        yield table_html(Table("Sizes with 95 % intervals", ("cause, alone", "place", "size"), rows))
    similar = _similar(verdict)
    if similar:
        columns = ("cause", "similar cause", Column("effect alike", "%", ".0f"))
        yield table_html(Table("Similar causes in these data", columns, similar))


def _similar(verdict: Verdict) -> list[tuple[str, str, float]]:
    """Return pairs of causes with similar effects after a refit of all other unknowns, to first order."""
    best: dict[str, Any] = {}
    for one in verdict.candidates[:_RECORDS]:
        own = [d for d in verdict.selection.directions if d.is_of(one.id, one.variant) and d.slopes.shape[1]]
        if own:
            best.setdefault(one.title, own[0])
    pairs = [(a, b, look_alike(best[a], best[b])) for i, a in enumerate(best) for b in list(best)[i + 1 :]]
    return [(a, b, 100.0 * cosine) for a, b, cosine in sorted(pairs, key=lambda pair: -pair[2]) if cosine >= LOOK_ALIKE]


def _details(verdict: Verdict) -> Iterable[str]:
    if verdict.undecidable:
        rows = [(names([id]), reason) for id, reason in verdict.undecidable.items()]
        yield f"<h2>Causes that these data cannot show</h2>{table_html(Table('', ('cause', 'reason'), rows))}"


def _mode_table(title: str, before: Sequence[ModeResidual], after: Sequence[ModeResidual]) -> str:
    """Return residuals by mode, before and after."""
    if not before:
        return ""
    other = {(one.label, one.mode): one for one in after}
    quantities = (
        (Column("frequency", "%"), "frequency_percent", "+.2f"),
        (Column("damping", "%"), "damping_percent", "+.1f"),
        (Column("level", "dB"), "level_db", "+.2f"),
        (Column("phase", "°"), "phase_deg", "+.1f"),
    )
    rows: list[list[Cell]] = []
    for one in before:
        found = other.get((one.label, one.mode))
        cells = [_change(getattr(one, field), getattr(found, field, math.nan), form) for _, field, form in quantities]
        cells[0] = cells[0] or "not in the model"
        rows.append([one.label, one.mode, one.measured_hz, *cells])
    columns: tuple[Column | str, ...] = (
        "configuration",
        Column("mode", form="d"),
        Column("measured", "Hz", ".1f"),
        *(own for own, *_ in quantities),
    )
    return table_html(Table(f"{title}{', before → after' if after else ''}", columns, rows).without_empty())


def _change(before: float, after: float, form: str) -> str:
    """Return a residual before and after; empty where the data do not show it."""
    return " → ".join(number(one, form) for one in (before, after) if math.isfinite(one))


def _notes(verdict: Verdict) -> Iterable[str]:
    if verdict.notes:
        items = "".join(f"<li>{shown(note)}</li>" for note in verdict.notes)
        yield f"<h2>Notes</h2><ul>{items}</ul>"
    rate = round(verdict.selection.evaluations_per_second)
    settings = {**verdict.settings, "model_evaluations_per_second": rate, "versions": dict(verdict.provenance.versions)}
    yield "<h2>Settings and versions</h2><details open><summary>of this run</summary>"
    yield f"{table_html(Table('', ('setting', 'value'), _rows(settings)))}</details>"


def _rows(settings: dict[str, Any]) -> list[tuple[str, str]]:
    rows: list[tuple[str, str]] = []
    for name, value in settings.items():
        if isinstance(value, dict):
            rows += [(f"{name}: {inner}", str(own)) for inner, own in value.items()]
        else:
            rows.append((name, ", ".join(map(str, value)) if isinstance(value, (list, tuple)) else str(value)))
    return rows
