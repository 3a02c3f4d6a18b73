"""The report of a diagnosis: one HTML file with a summary in sentences, figures and their code."""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from receptance import _files
from receptance.diagnosis.by_mode import Curve, ModeResidual, curves, residuals_by_mode
from receptance.diagnosis.report import figures
from receptance.diagnosis.screening import look_alike
from receptance.diagnosis.wording import improvement_interval, remarks, report_sentences, sentence, sizes
from receptance.identification.observations import MeasuredFRF

if TYPE_CHECKING:
    import os

    from plotly.graph_objects import Figure

    from receptance.diagnosis import Verdict

__all__ = ["diagnosis_html", "write_diagnosis"]

_SIMILAR = 12
"""Number of causes in the figure of similar causes."""


def diagnosis_html(verdict: Verdict, *, title: str = "Diagnosis") -> str:
    """Return a diagnosis as one HTML page that needs no network.

    Parameters
    ----------
    verdict : Verdict
        Result of `diagnose`.
    title : str, optional
        Heading; special characters are escaped.

    Returns
    -------
    str
        Measured against simulated before and after, which can be zoomed; residuals by mode; evidence of the
        candidates and similar causes; improvement; next measurement; settings and versions.
    """
    from jinja2 import Environment, PackageLoader, StrictUndefined
    from plotly.offline import get_plotlyjs

    environment = Environment(
        loader=PackageLoader("receptance.diagnosis.report", "templates"),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    base, explanation = verdict.base_fit, verdict.explanation
    rate = round(verdict.selection.evaluations_per_second)
    settings = {**verdict.settings, "model_evaluations_per_second": rate}
    before, after = residuals_by_mode(base), residuals_by_mode(explanation.fit) if explanation is not None else ()
    rows = {(one.label, one.mode): one for one in after}
    return environment.get_template("diagnosis.html").render(
        title=title,
        verdict=verdict,
        sentence=sentence(verdict),
        sentences=report_sentences(verdict, before, after),
        remarks=remarks,
        curves=_curves(verdict),
        modes=[(one, rows.get((one.label, one.mode))) for one in before],
        columns=_columns([*before, *after]),
        extended=explanation is not None,
        receptances=bool(base.model.receptances),
        held_out_modes=_held_out_modes(verdict),
        # Of a cause that is reported together with another one its size there.
        sizes={one.id: sizes(one) for one in (*verdict.candidates, *verdict.causes)},
        evidence=_html(figures.evidence_figure(verdict), "evidence") if verdict.candidates else "",
        similar=_similarity(verdict),
        interval=improvement_interval,
        settings=_rows({**settings, "versions": dict(verdict.provenance.versions)}),
        library=get_plotlyjs(),
    )


def write_diagnosis(path: str | os.PathLike[str], verdict: Verdict, *, title: str = "Diagnosis") -> Path:
    """Write the report of a diagnosis, whole or not at all.

    Parameters
    ----------
    path : path-like
        Where to.
    verdict, title
        As for `diagnosis_html`.

    Returns
    -------
    Path
        The file.
    """
    target = Path(path)
    text = diagnosis_html(verdict, title=title)
    _files.write_whole({target: text.encode("utf-8")})
    return target


def _columns(modes: Sequence[ModeResidual]) -> list[tuple[str, str, str]]:
    """Return the columns of the table of modes: field, heading and format."""
    every = (
        ("frequency_percent", "frequency (%)", "%+.2f"),
        ("damping_percent", "damping (%)", "%+.1f"),
        ("level_db", "level (dB)", "%+.2f"),
        ("phase_deg", "phase (°)", "%+.1f"),
    )
    return [one for one in every if any(math.isfinite(getattr(mode, one[0])) for mode in modes)]


def _held_out_modes(verdict: Verdict) -> list[tuple[ModeResidual, ModeResidual | None]]:
    """Return held-out modes before and after."""
    after = {(one.label, one.mode): one for one in verdict.held_out_modes_after}
    return [(one, after.get((one.label, one.mode))) for one in verdict.held_out_modes]


def _html(figure: Figure, name: str) -> str:
    from plotly.io import to_html

    config = {"displaylogo": False, "responsive": True, "scrollZoom": True, "showSendToCloud": False}
    return str(to_html(figure, include_plotlyjs=False, full_html=False, div_id=f"figure-{name}", config=config))


def _curves(verdict: Verdict) -> list[tuple[str, str]]:
    """Return each receptance with its figure, and all natural frequencies in one."""
    base, explanation = verdict.base_fit, verdict.explanation
    before = curves(base)
    after: list[Curve | None] = list(curves(explanation.fit)) if explanation is not None else [None] * len(before)
    complete = []
    frequencies = []
    for number, one in enumerate(base.model.observations):
        if isinstance(one, MeasuredFRF):
            html = _html(figures.curve_figure(before[number], after[number]), f"curve-{number}")
            complete.append((before[number].label or f"receptance {number + 1}", html))
        else:
            frequencies.append(number)
    if frequencies:
        extended = [curve for i in frequencies if (curve := after[i]) is not None]
        figure = figures.frequencies_figure([before[i] for i in frequencies], extended)
        complete.append(("natural frequencies", _html(figure, "frequencies")))
    return complete


def _similarity(verdict: Verdict) -> str:
    """Return the similarity of the effects of the best candidates."""
    best: dict[str, Any] = {}
    for one in verdict.candidates:
        own = [d for d in verdict.selection.directions if d.is_of(one.id, one.variant) and d.slopes.shape[1]]
        if own:
            best.setdefault(one.id, own[0])
    names = list(best)[:_SIMILAR]
    if len(names) < 2:
        return ""
    cosines = [[look_alike(best[a], best[b]) for b in names] for a in names]
    return _html(figures.similarity_figure(names, cosines), "similar")


def _rows(settings: dict[str, Any]) -> list[tuple[str, str]]:
    rows = []
    for name, value in settings.items():
        if isinstance(value, dict):
            rows += [(f"{name}: {inner}", str(own)) for inner, own in value.items()]
        else:
            rows.append((name, ", ".join(map(str, value)) if isinstance(value, (list, tuple)) else str(value)))
    return rows
