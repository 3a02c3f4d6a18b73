"""What a verdict shows: facts, tables, next step, and the sections of its page; `receptance.report` renders them."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from receptance import diagnosis
from receptance.diagnosis.by_mode import ModeResidual
from receptance.diagnosis.held_out import FREQUENCIES, SCORE, SPECTRAL, Gain
from receptance.diagnosis.text import capital, names, odds, share, size_texts
from receptance.diagnosis.thresholds import MARGIN
from receptance.diagnosis.verdict import CandidateCause, Verdict
from receptance.fit.adequacy import times
from receptance.fit.result import Identification
from receptance.report import Column, Fact, PageSection, Table
from receptance.report.table import Cell, amount, amount_interval, number, percent

_ANSWERS = {
    "adequate": "noise, floor and tolerances explain the residuals.",
    "undecided": "the model cannot be judged: too few degrees of freedom are left.",
    "named": "the model is inadequate, and the data identify the cause.",
    "suspected": "the model may be inadequate; one cause is suspected.",
    "ambiguous": "the model is inadequate; these data cannot distinguish between several causes.",
    "partly explained": "the model is inadequate; a cause explains most of the error, and the rest has no known cause.",
    "unexplained": "the model is inadequate, and no known cause explains the misfit.",
}
_PARAMETERS = 8
"""Rows of parameters in the table of the effect; the result has all of them."""
_MOST_LINES = 30
"""Lines for the campaign file that are shown; more are only counted."""
_LONGEST = 6
"""Causes and modes in tables of a terminal; the page and `to_dict` have all of them."""
_HELD_OUT = 4
"""Number of held-out records that are drawn."""
_RECORDS = 12
"""Number of records that are drawn, those with the largest residuals: a page of about 1 MB at most."""


# Facts.


def facts(verdict: Verdict) -> list[Fact]:
    """Return the verdict, each reported cause with its size and its remedy, and what else was found."""
    shown = [Fact("Verdict", tuple(_answer(verdict)))]
    count = len(verdict.causes)
    for position, cause in enumerate(verdict.causes, 1):
        beside = f" It acts together with the {names(cause.together_with)}." if cause.together_with else ""
        label = f"Cause {position} of {count}" if count > 1 else "Cause"
        shown.append(Fact(label, (f"{capital(cause.title)}: {cause.meaning}{_at(cause)}.{beside}",)))
        shown += _size_and_remedy(cause)
    if verdict.explanation is not None and (lines := verdict.campaign.lines):
        added = f"add the {names([variant.cause.id for variant in verdict.explanation.variants])} to the model"
        text, copied = f"These lines {added}:", lines
        if len(lines) > _MOST_LINES:
            text, copied = f"{len(lines)} lines {added}; the option --extended writes them.", ()
        shown.append(Fact("Campaign file", (text,), copied))
    for cause in verdict.vetoed:
        text = (
            f"With the {names((cause.id, *cause.together_with))} the residuals fall from "
            f"{times(verdict.adequacy.misfit)} to {times(cause.misfit)} times the noise, more than with any plausible "
            f"cause, but only with an implausible size: {cause.vetoed}."
        )
        shown.append(Fact("Vetoed", (text, f"Remedy: {cause.remedy}.")))
    if (other := verdict.alternative) is not None:
        text = f"{capital(other.meaning)} {other.variant} explains the data; it is not a known cause."
        shown += [Fact("Place", (text,)), *_size_and_remedy(other)]
    elif verdict.verdict == "unexplained":
        # A wrong cause with a plausible size is no better than the right one with an unusual size.
        near = next((cause for cause in verdict.candidates if cause.evidence > verdict.threshold), None)
        if near is not None:
            doubt = "" if near.plausible else f" It is doubted because of its size: {near.vetoed}."
            text = (
                f"{capital(near.title)}{_at(near)} comes nearest: {near.meaning}. It leaves "
                f"{_residuals_of(verdict, near.misfit)}.{doubt}"
            )
            shown += [Fact("Nearest cause", (text,)), Fact("Size", (f"{near.sizes or 'no parameter'}.",))]
    if verdict.bias is not None:
        shown.append(Fact("Held out", (f"{capital(str(verdict.bias))}.",)))
    return shown


def _answer(verdict: Verdict) -> Iterator[str]:
    if verdict.interrupted is None:
        yield f"{verdict.verdict}: {_ANSWERS[verdict.verdict]}"
    else:
        yield f"{verdict.verdict}, not final: {verdict.interrupted}."
    if not _is_fitted(verdict):
        yield "The base model is not fitted yet, so no cause was tried."
        return
    adequacy = verdict.adequacy
    if not adequacy.passed and verdict.verdict != "undecided":
        if adequacy.worst:
            yield f"The largest residuals are in {adequacy.worst[0]}."
        factor = math.sqrt(max(adequacy.misfit / adequacy.limit, adequacy.smooth / adequacy.smooth_limit))
        if verdict.verdict == "unexplained" and verdict.final and factor > 1.0:
            larger = amount(factor, digits=2)
            yield f"The model would be adequate if all standard deviations were {larger} times as large."
    if verdict.candidates and not beyond_chance(verdict):
        likely = verdict.candidates[0]
        yield (
            f"None of the {len(verdict.candidates)} causes explains more than noise does by chance; the most likely is "
            f"{likely.title} (odds {odds(verdict.best_evidence - likely.evidence)} to the model as it is)."
        )


def _size_and_remedy(cause: CandidateCause) -> list[Fact]:
    size = [Fact("Size", (f"{cause.sizes}.",))] if cause.parameters else []
    return [*size, Fact("How to fix", (f"{capital(cause.remedy)}.",))]


def _at(cause: CandidateCause) -> str:
    """Return where or how a cause acts in brackets; empty if it acts everywhere."""
    return "" if cause.variant == "all" else f" ({cause.variant})"


def _residuals_of(verdict: Verdict, misfit: float) -> str:
    beside = "noise and model discrepancy" if verdict.discrepancy is not None and verdict.causes else "the noise"
    return f"residuals of {times(misfit)} times {beside}"


def _is_fitted(verdict: Verdict) -> bool:
    """Return whether the base was fitted before an interruption."""
    return verdict.final or verdict.selection.base.converged


def next_step(verdict: Verdict) -> str:
    """Return what to do next."""
    file = verdict.campaign.path or verdict.provenance.file or "CAMPAIGN"
    if not verdict.final:
        return "let the diagnosis end: not all causes were tried"
    if verdict.next_measurement is not None:
        return f"{verdict.next_measurement.action}; {verdict.next_measurement.reason}"
    if verdict.campaign.lines:
        return f"`receptance diagnose {file} --extended extended.toml`, then `receptance identify extended.toml`"
    if verdict.verdict == "adequate":
        return f"none is needed: `receptance predict {file}` uses this model"
    return ""


# Metrics of held-out data.

_METRICS = {
    SPECTRAL: ("distance of the spectra", 20.0 / math.log(10.0), "dB"),
    FREQUENCIES: ("natural frequencies, rms error", 1.0, "%"),
    SCORE: ("predictive log score", 1.0, "nats"),
}
"""Name of each metric in a text, the factor to the unit in which it is shown, and this unit."""


def metric_name(metric: str) -> str:
    """Return the name of a metric of held-out data in a text; that of a user-defined one is kept."""
    return _METRICS.get(metric, (metric,))[0]


def of_metric(metric: str, value: float, digits: int = 3) -> str:
    """Return the value of a metric of held-out data in the unit in which it is shown.

    Examples
    --------
    >>> from receptance.diagnosis.held_out import FREQUENCIES, SCORE
    >>> from receptance.diagnosis.presentation import of_metric
    >>> of_metric(SCORE, -760123.0), of_metric(FREQUENCIES, 2.2e-4), of_metric("worst error", 0.5)
    ('-760,000 nats', '< 0.001 %', '0.500')
    """
    _, scale, unit = _METRICS.get(metric, ("", 1.0, ""))
    if unit == "%":
        return percent(0.01 * value, digits)
    if unit == "nats" and math.isfinite(value) and abs(value) >= 1e3:
        return f"{float(f'{value:.{digits}g}'):,.0f} nats"
    return amount(scale * value, unit, digits)


def improvement_text(gain: Gain) -> str:
    """Return the interval of an improvement as text, in the unit of the metric."""
    low, high = gain.interval
    if low == high == 0.0:
        return "none: no cause is added to the model"
    if not math.isfinite(low):
        return "no interval: one configuration was held out"
    _, scale, unit = _METRICS.get(gain.metric, ("", 1.0, ""))
    units = ""
    if gain.units > len(gain.folds):
        units = f", from {gain.units} {gain.unit} with a correlation of {gain.correlation:.2f} within a fold"
    low, high = scale * low, scale * high
    change = f"between {amount(-low, unit)} worse and {amount(high, unit)} better"
    if not low < 0.0 < high:
        ends = (-high, -low) if high <= 0.0 else (low, high)
        change = f"{'worse' if high <= 0.0 else 'better'} by {amount_interval(ends, unit, 3)}"
    return f"{change} (95 %{units}), in {gain.better} of {len(gain.folds)} folds"


# Tables.


def tables(verdict: Verdict) -> list[Table]:
    """Return effect and alternatives of the causes, the largest errors of modes, and causes that were not tried."""
    modes = _mode_table(
        "Modes with the largest errors, modelled less measured", verdict.modes, verdict.modes_after, _LONGEST
    )
    shown = (*_effect(verdict), alternatives(verdict, _LONGEST), modes, _not_tried(verdict))
    return [table for table in shown if table.rows]


def _not_tried(verdict: Verdict) -> Table:
    """Return the causes that the data cannot show, by reason."""
    by_reason: dict[str, list[str]] = {}
    for cause, reason in verdict.undecidable.items():
        by_reason.setdefault(reason, []).append(cause)
    rows = [(names(causes), reason) for reason, causes in by_reason.items()]
    return Table("Causes that these data cannot show", ("not tried", "reason"), rows)


_Row = tuple[str, str, str | None, str]
"""Name, value before and after, and change."""


def _effect(verdict: Verdict) -> list[Table]:
    """Return residuals and held-out errors, and the parameters, before and after the cause is part of the model."""
    held_out, note = _held_out(verdict), ""
    if len(held_out) > 1 and all(row[-1] == held_out[0][-1] for row in held_out):
        note, held_out = f"Held out: {held_out[0][-1]}.", [(*row[:3], "") for row in held_out]
    rows, columns = [*_residuals(verdict), *held_out], [Column("before"), Column("after")]
    if verdict.explanation is None:
        shown = [
            Table("The model as it is", ("quantity", Column("value")), [row[:2] for row in rows]),
            Table("Its parameters", ("parameter", Column("value")), [row[:2] for row in _parameters(verdict)]),
        ]
    else:
        by = "the cause" if len(verdict.causes) == 1 else "the best explanation"
        changes: list[str | Column] = ["parameter", *columns, Column("change")]
        shown = [
            Table(f"Effect of {by}", ("quantity", *columns, "change"), rows, note),
            Table(f"Parameters without and with {by}", changes, [*_parameters(verdict)]),
        ]
    return [table.without_empty() for table in shown if table.rows]


def _residuals(verdict: Verdict) -> Iterator[_Row]:
    before, after = verdict.adequacy, verdict.adequacy_after
    if _is_fitted(verdict):
        rest, change = None, ""
        if after is not None:
            rest, level = f"{times(after.misfit)} times", "within" if after.passed else "above"
            change = f"{_decibel(before.misfit**0.5, after.misfit**0.5)}, the rest is {level} noise"
        yield "residuals over noise, rms", f"{times(before.misfit)} times", rest, change
    shares = [("natural frequencies, rms error", _rms(verdict.modes), _rms(verdict.modes_after))]
    if verdict.discrepancy is not None:
        pair = (verdict.discrepancy, verdict.discrepancy_after)
        for name, field in (("damping", "damping"), ("level", "relative"), ("natural frequencies", "frequency")):
            size, left = (getattr(discrepancy, field, None) for discrepancy in pair)
            shares.insert(0, (f"model discrepancy, {name}", size, left))
    for name, size, left in shares:
        if size is not None:
            yield name, percent(size), None if left is None else percent(left), _decibel(size, left)


def _held_out(verdict: Verdict) -> list[_Row]:
    return [
        (
            f"held out: {metric_name(gain.metric)}",
            of_metric(gain.metric, gain.held_out_before),
            of_metric(gain.metric, gain.held_out_after),
            improvement_text(gain),
        )
        for gain in verdict.gains
    ]


def held_out_table(verdict: Verdict) -> Table:
    """Return the errors on held-out data before and after the causes are part of the model; empty without such data."""
    columns = ("quantity", Column("before"), Column("after"), "change")
    return Table("Improvement on held-out data", columns, _held_out(verdict))


def _parameters(verdict: Verdict) -> Iterator[_Row]:
    base, extended = verdict.base, verdict.extended
    shown = [name for name in base.values if name not in base.errors] if _is_fitted(verdict) else []
    if extended is not None:
        # Of many parameters, those of levels for example, the ones that change most.
        common = [name for name in shown if name in extended.values]
        shown = sorted(common, key=lambda name: -_change(base.values[name], extended.values[name]))
    largest = shown[:_PARAMETERS]
    for name in (name for name in base.values if name in largest):
        after = None if extended is None else _with_interval(extended, name)
        change = "" if extended is None else _ratio(base.values[name], extended.values[name])
        yield name, _with_interval(base, name), after, change


def _change(before: float, after: float) -> float:
    """Return the size of a change, on a logarithmic scale where that is possible."""
    ratio = after / before if before else 0.0
    return abs(math.log(ratio)) if 0.0 < ratio < math.inf else abs(after - before)


def _ratio(before: float, after: float) -> str:
    """Return a change in percent, or as a factor where it is large."""
    ratio = after / before if before else 0.0
    if not 0.0 < ratio < math.inf:
        return ""
    return percent(ratio - 1.0, sign=True) if 0.5 < ratio < 2.0 else f"× {amount(ratio, digits=2)}"


def _with_interval(fit: Identification, name: str) -> str:
    """Return a value with the half width of its 95 % interval, or with the factor of a wide one."""
    unknown, value = fit.unknowns[fit.index(name)], fit.values[name]
    low, high = fit.interval(name)
    if not fit.determined(name) or not math.isfinite(high - low):
        return f"{amount(value, unknown.unit)} (open)"
    if unknown.scale == "linear" or value == 0.0:
        return f"{amount(value, unknown.unit)} ± {amount(0.5 * (high - low), unknown.unit, 2)}"
    factor = high / value
    if factor > 1.5:
        return f"{amount(value, unknown.unit)} ×/÷ {amount(factor, digits=2)}"
    return f"{amount(value, unknown.unit)} ± {amount(50.0 * (high - low) / value, digits=2)} %"


def _decibel(before: float, after: float | None) -> str:
    if not before or not after or not 0.0 < (ratio := after / before) < math.inf:
        return ""
    return f"{number(20.0 * math.log10(ratio), '+.2g')} dB"


def _rms(modes: Sequence[ModeResidual]) -> float | None:
    errors = np.array([mode.frequency_percent for mode in modes])
    errors = errors[np.isfinite(errors)]
    return 0.01 * float(np.sqrt(np.mean(errors**2))) if errors.size else None


def alternatives(verdict: Verdict, most: int | None = None) -> Table:
    """Return every cause alone: how much it explains, how likely it is beside the best, and why it is not the answer.

    With `most` the table has that many causes, and counts the others.
    """
    best, likely = verdict.best_evidence, beyond_chance(verdict)
    gain = verdict.gain if any(cause.held_out is not None for cause in verdict.candidates) else None
    before = None if gain is None else of_metric(gain.metric, gain.held_out_before)
    rows: list[list[Cell]] = [["none: the model as it is", "", odds(best), before, ""]]
    for cause in likely[:most]:
        held_out = None if gain is None or cause.held_out is None else of_metric(gain.metric, cause.held_out)
        behind = odds(best - cause.evidence)
        rows.append([cause.title, _share(verdict, cause), behind, held_out, _why_not(verdict, cause)])
    columns = ("cause, alone", Column("share\nexplained"), Column("odds to\nthe best"), Column("held out"), "why not")
    notes = [] if gain is None else [f"Held out: {metric_name(gain.metric)}."]
    if less := len(likely) - len(likely[:most]):
        notes.append(f"{less} more: --report and --json have all of them.")
    if others := len(verdict.candidates) - len(likely):
        notes.append(f"No more than noise by chance: {others} other cause{'s' if others > 1 else ''}.")
    return Table("Alternatives", columns, rows if likely else [], " ".join(notes)).without_empty()


def beyond_chance(verdict: Verdict) -> list[CandidateCause]:
    """Return the causes that are reported, or explain more than noise does by chance."""
    reported, least = {cause.id for cause in verdict.causes}, max(verdict.threshold, 0.0)
    return [cause for cause in verdict.candidates if cause.evidence > least or cause.id in reported]


def _share(verdict: Verdict, cause: CandidateCause) -> str:
    """Return the share that a cause explains of the misfit above noise, which an adequate explanation shows."""
    selection, best = verdict.selection, verdict.explanation
    if selection.beside is not None:
        return share(1.0, 1.0 - selection.share(cause.explanation), 0.0)
    noise = 1.0 if best is None or not best.passed else best.fit.misfit
    return share(selection.base.misfit, cause.misfit, noise)


def _why_not(verdict: Verdict, cause: CandidateCause) -> str:
    """Return why a cause is not reported, or that it is."""
    together = {other.id: other.together_with for other in verdict.causes}
    if cause.id in together:
        return f"reported, together with {names(together[cause.id])}" if together[cause.id] else "reported"
    reasons = [] if cause.plausible else [cause.vetoed]
    if cause.misfit > verdict.adequacy.limit and not reasons:
        reasons.append(f"leaves {_residuals_of(verdict, cause.misfit)}")
    if not cause.converged:
        reasons.append("fit not converged")
    if not reasons and verdict.best_evidence - cause.evidence <= MARGIN:
        reasons.append("rejected, see the notes")
    if not reasons:
        alike = max((other.look_alikes.get(cause.id, 0.0) for other in verdict.causes), default=0.0)
        reasons.append(f"less likely; effect {100.0 * alike:.0f} % alike" if alike else "less likely")
    return "; ".join(reasons)


_QUANTITIES = (
    (Column("frequency", "%"), "frequency_percent", "+.2f"),
    (Column("damping", "%"), "damping_percent", "+.1f"),
    (Column("level", "dB"), "level_db", "+.2f"),
    (Column("phase", "°"), "phase_deg", "+.1f"),
)
"""Columns of the errors of modes."""


def _mode_table(
    title: str, before: Sequence[ModeResidual], after: Sequence[ModeResidual], most: int | None = None
) -> Table:
    """Return errors by mode, before and after; with `most` the largest errors of the frequency, and of the damping."""
    quantities = _QUANTITIES if most is None else _QUANTITIES[:2]
    other = {(mode.label, mode.mode): mode for mode in after}
    rows: list[list[Cell]] = []
    # Of a mode that is not in the model the error is not a number.
    by_error = sorted(before, key=lambda mode: -np.nan_to_num(abs(mode.frequency_percent), nan=np.inf))
    for mode in before if most is None else by_error[:most]:
        pair = [mode, other[mode.label, mode.mode]] if (mode.label, mode.mode) in other else [mode]
        cells = [
            " → ".join(number(value, form) for each in pair if math.isfinite(value := getattr(each, field)))
            for _, field, form in quantities
        ]
        rows.append([mode.label, mode.mode, mode.measured_hz, cells[0] or "not in the model", *cells[1:]])
    columns: list[Column | str] = [
        "measurement", Column("mode", form="d"), Column("measured", "Hz", ".1f"), *(each[0] for each in quantities)
    ]  # fmt: skip
    return Table(f"{title}{', before → after' if after else ''}", columns, rows).without_empty()


# Page.


def key_figures(verdict: Verdict) -> list[tuple[str, Sequence[str]]]:
    """Return the few numbers that a reader looks for first: names, and values before and after."""
    figures: list[tuple[str, Sequence[str]]] = []
    for cause in verdict.causes[:1]:
        texts = size_texts(cause.parameters, cause.explanation.parameters)
        figures += [(f"size: {cause.title}", [size]) for size, _ in texts[:1]]
    held_out = [row for gain, row in zip(verdict.gains, _held_out(verdict), strict=True) if gain.metric != SCORE]
    for name, before, after, _ in (*_residuals(verdict), *held_out):
        figures.append((name, [before] if after is None or after == before else [before, after]))
    return figures


def sections(verdict: Verdict) -> list[PageSection]:
    """Return held-out and fitted data before and after, all causes, those that the data cannot show, and settings."""
    shown = [*_section_of_held_out_data(verdict), _section_of_fitted_data(verdict), *_section_of_causes(verdict)]
    if verdict.undecidable:
        table = _not_tried(verdict)
        shown.append(PageSection(table.title, tables=[replace(table, title="")]))
    return [*shown, _section_of_settings(verdict)]


def _section_of_held_out_data(verdict: Verdict) -> Iterator[PageSection]:
    if not verdict.gains:
        return
    fitted = "which were not fitted" if verdict.held_out is not None else "each left out of the fit"
    drawn = [
        (f"held out: {before.label}", diagnosis.figure.curve_figure(before, after if verdict.causes else None))
        for before, after in verdict.improvement.curves[:_HELD_OUT]
    ]
    texts = [f"Records {fitted}: measured, and predicted."] if drawn else []
    gain = verdict.gains[0]
    folds = [
        (
            fold["configuration"],
            fold["verdict"],
            names(fold["causes"]) if fold["causes"] else "none",
            *(of_metric(gain.metric, fold[key]) if math.isfinite(fold[key]) else "" for key in ("before", "after")),
        )
        for fold in gain.folds
    ]
    columns = ("held out", "verdict without it", "causes", Column("before"), Column("after"))
    by_fold = Table(f"By configuration: {metric_name(gain.metric)}", columns, folds if len(folds) > 1 else [])
    improvement = verdict.improvement
    modes = _mode_table("Held-out modes, predicted less measured", improvement.modes, improvement.modes_after)
    yield PageSection("Held-out data", texts, drawn, [table for table in (by_fold, modes) if table.rows])


def _section_of_fitted_data(verdict: Verdict) -> PageSection:
    model = verdict.selection.base.model
    records, frequencies = diagnosis.figure.fitted_curves(verdict, _RECORDS)
    drawn = [(before.label, diagnosis.figure.curve_figure(before, after)) for before, after in records]
    if frequencies:
        drawn.append(("natural frequencies", diagnosis.figure.frequencies_figure(frequencies)))
    counts = {
        "receptances": len(model.receptances),
        "lines": sum(observation.frequency_hz.size for observation in model.receptances),
        "natural frequencies": sum(before.frequency_hz.size for before, _ in frequencies),
        "configurations": len(model.configurations),
    }
    texts = [f"Number of {', '.join(f'{name}: {count}' for name, count in counts.items() if count)}."]
    if len(model.receptances) > len(records):
        texts.append(f"The {len(records)} receptances with the largest residuals are drawn.")
    modes = _mode_table("Residuals at each mode, modelled less measured", verdict.modes, verdict.modes_after)
    return PageSection("Fitted data", texts, drawn, [modes] if modes.rows else [])


def _section_of_causes(verdict: Verdict) -> Iterator[PageSection]:
    if not verdict.candidates:
        return
    text = (
        "A cause is reported only if the model with it is adequate, whatever its odds. All adequate causes with odds "
        "above 1 : 150 to the best, left of the dashed line, are reported."
    )
    likely = beyond_chance(verdict)
    rows = []
    for cause in likely:
        alike = [f"{names([id])} {100.0 * cosine:.0f} %" for id, cosine in cause.look_alikes.items()]
        rows.append((cause.title, cause.variant, cause.sizes, ", ".join(alike)))
    columns = ("cause, alone", "place", "size, with 95 % interval", "similar effect")
    every = [alternatives(verdict)] if len(likely) > _LONGEST else []
    every += [Table("Sizes, and causes with a similar effect on these data", columns, rows)] if rows else []
    figure = ("odds of each cause alone to the best", diagnosis.figure.evidence_figure(verdict))
    yield PageSection("All causes", [text], [figure], [table.without_empty() for table in every])


def _section_of_settings(verdict: Verdict) -> PageSection:
    settings = {**verdict.settings, "model_evaluations_per_second": round(verdict.selection.evaluations_per_second)}
    rows: list[tuple[str, str]] = []
    for name, value in {**settings, "versions": verdict.provenance.versions}.items():
        pairs = {f"{name}: {key}": inner for key, inner in value.items()} if isinstance(value, dict) else {name: value}
        rows += [(key, ", ".join(map(str, v)) if isinstance(v, (list, tuple)) else str(v)) for key, v in pairs.items()]
    return PageSection("Settings and versions", tables=[Table("", ("setting", "value"), rows)])
