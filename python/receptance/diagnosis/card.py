"""The answer of a diagnosis as a card: verdict, cause, size, remedy, effect, alternatives and next step."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from receptance.diagnosis import wording
from receptance.diagnosis.thresholds import MARGIN
from receptance.report import Column, Fact, Table
from receptance.report.table import amount, number, percent

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from receptance.diagnosis.by_mode import ModeResidual
    from receptance.diagnosis.verdict import CandidateCause, Verdict
    from receptance.identification.result import Identification
    from receptance.report.table import Cell

_PARAMETERS = 8
"""Rows of parameters in the table of the effect; the result has all of them."""
_MOST_LINES = 30
"""Lines for the campaign file that are shown; more are only counted."""
_ALTERNATIVES = 6
"""Causes in the table of alternatives on a terminal; `to_dict` has all of them."""


def facts(verdict: Verdict) -> list[Fact]:
    """Return the verdict, each reported cause with its size and its remedy, and what else was found."""
    known = _is_fitted(verdict)
    sentence = wording.sentence(verdict)
    texts = [f"{verdict.verdict}{'' if verdict.final else ', not final'}: {sentence[:1].lower()}{sentence[1:]}"]
    texts += wording.where(verdict) if known else ["The base model is not fitted yet, so no cause was tried."]
    if known and verdict.candidates and not beyond_chance(verdict):
        likely = verdict.candidates[0]
        odds = wording.odds(verdict.best_evidence - likely.evidence)
        texts.append(
            f"None of the {len(verdict.candidates)} causes explains more than noise does by chance; the most likely is "
            f"{likely.title} (odds {odds} to the model as it is)."
        )
    found = [Fact("Verdict", tuple(texts))]
    count = len(verdict.causes)
    for position, one in enumerate(verdict.causes, 1):
        found += _of_cause(one, f" {position} of {count}" if count > 1 else "")
    if verdict.campaign_lines:
        added = f"add the {wording.names(verdict.causes_together)} to the model"
        if len(verdict.campaign_lines) > _MOST_LINES:
            text = f"{len(verdict.campaign_lines)} lines {added}; the option --extended writes them."
            found.append(Fact("Campaign file", (text,)))
        else:
            found.append(Fact("Campaign file", (f"These lines {added}:",), verdict.campaign_lines))
    found += [Fact("Vetoed", (f"{wording.veto(verdict, one)}.", f"Remedy: {one.remedy}.")) for one in verdict.vetoed]
    if (other := verdict.alternative) is not None:
        text = f"{wording.capital(other.meaning)} {other.variant} explains the data; it is not a known cause."
        found.append(Fact("Place", (text,)))
        found.append(Fact("Size", (f"{wording.sizes(other)}.",)))
        found.append(Fact("How to fix", (f"{wording.capital(other.remedy)}.",)))
    elif verdict.verdict == "unexplained" and (near := _nearest(verdict)) is not None:
        text = (
            f"{wording.capital(near.title)}{_at(near)} comes nearest: {near.meaning}. It leaves "
            f"{wording.residual(verdict, near.misfit)}."
        )
        found += [Fact("Nearest cause", (text,)), Fact("Size", (f"{wording.sizes(near) or 'no parameter'}.",))]
    if verdict.bias is not None:
        found.append(Fact("Held out", (f"{wording.capital(str(verdict.bias))}.",)))
    return found


def _of_cause(one: CandidateCause, number: str) -> list[Fact]:
    beside = f" It acts together with the {wording.names(one.together_with)}." if one.together_with else ""
    found = [Fact(f"Cause{number}", (f"{wording.capital(one.title)}: {one.meaning}{_at(one)}.{beside}",))]
    if one.parameters:
        found.append(Fact("Size", (f"{wording.sizes(one)}.",)))
    return [*found, Fact("How to fix", (f"{wording.capital(one.remedy)}.",))]


def _at(one: CandidateCause) -> str:
    """Return where or how a cause acts in brackets; empty if it acts everywhere."""
    return f" ({wording.place(one)})" if wording.place(one) else ""


def _nearest(verdict: Verdict) -> CandidateCause | None:
    """Return the plausible cause with the highest evidence above the detection threshold."""
    return next((one for one in verdict.candidates if one.plausible and one.evidence > verdict.threshold), None)


def next_step(verdict: Verdict) -> str:
    """Return what to do next."""
    file = verdict.campaign_path or verdict.provenance.file or "CAMPAIGN"
    if not verdict.final:
        return "let the diagnosis end: not all causes were tried"
    if verdict.next_measurement is not None:
        return f"{verdict.next_measurement.action}; {verdict.next_measurement.reason}"
    if verdict.campaign_lines:
        return f"`receptance diagnose {file} --extended extended.toml`, then `receptance identify extended.toml`"
    if verdict.verdict == "adequate":
        return f"none is needed: `receptance predict {file}` uses this model"
    if verdict.verdict == "undecided":
        return f"measure more modes, {verdict.selection.base.model.separable[1]}, or an FRF"
    return ""


def _is_fitted(verdict: Verdict) -> bool:
    """Return whether the base was fitted before an interruption."""
    return verdict.final or verdict.selection.base.converged


def effect(verdict: Verdict) -> list[Table]:
    """Return residuals and held-out errors, and the parameters, before and after the cause is part of the model."""
    errors, improvements = [*_residuals(verdict), *_held_out(verdict)], {row[3] for row in _held_out(verdict)}
    note = ""
    if len(improvements) == 1 and len(verdict.gains) > 1:
        # The same for every metric.
        note = f"Held out: {improvements.pop()}."
        errors = [(*row[:3], "") if row[0].startswith("held out") else row for row in errors]
    parts = [errors, [*_parameters(verdict)]]
    if verdict.explanation is None:
        tables = [
            Table("The model as it is", ("quantity", Column("value")), [row[:2] for row in parts[0]]),
            Table("Its parameters", ("parameter", Column("value")), [row[:2] for row in parts[1]]),
        ]
    else:
        by = "the cause" if len(verdict.causes) == 1 else "the best explanation"
        numbers = (Column("before"), Column("after"))
        tables = [
            Table(f"Effect of {by}", ("quantity", *numbers, "change"), parts[0], note),
            Table(f"Parameters without and with {by}", ("parameter", *numbers, Column("change")), parts[1]),
        ]
    return [table.without_empty() for table in tables if table.rows]


_Row = tuple[str, str, str | None, str]
"""Name, value before and after, and change."""


def _residuals(verdict: Verdict) -> Iterable[_Row]:
    before, after = verdict.adequacy, verdict.adequacy_after
    if _is_fitted(verdict):
        change = "" if after is None else f"{_decibel(before.misfit**0.5, after.misfit**0.5)}, "
        if after is not None:
            change += "the rest is within noise" if after.passed else "the rest is above noise"
        yield (
            "residuals over noise, rms",
            f"{wording.times(before.misfit)} times",
            None if after is None else f"{wording.times(after.misfit)} times",
            change,
        )
    if (found := verdict.discrepancy) is not None:
        other = verdict.discrepancy_after
        for name, field in (("natural frequencies", "frequency"), ("level", "relative"), ("damping", "damping")):
            size, left = getattr(found, field), getattr(other, field, None)
            if size is not None:
                yield f"model error beside noise, {name}", _percent(size), _percent_or_none(left), _decibel(size, left)
    if (size := _rms(verdict.modes)) is not None:
        left = _rms(verdict.modes_after)
        yield "natural frequencies, rms error", _percent(size), _percent_or_none(left), _decibel(size, left)


def _held_out(verdict: Verdict) -> Iterable[_Row]:
    for gain in verdict.gains:
        name, *_ = wording.metric(gain.metric)
        before, after = (wording.of_metric(gain.metric, value) for value in (gain.held_out_before, gain.held_out_after))
        yield f"held out: {name}", before, after, wording.improvement_interval(gain)


def _parameters(verdict: Verdict) -> Iterable[_Row]:
    base, extended = verdict.base, verdict.extended
    if not _is_fitted(verdict):
        return
    names = [name for name in base.values if name not in base.errors]
    if extended is not None:
        names = [name for name in names if name in extended.values]
    # Of many parameters, those of levels for example, the ones that change most.
    largest = sorted(names, key=lambda name: -_change(base, extended, name))[:_PARAMETERS]
    for name in (name for name in names if name in largest):
        after = None if extended is None else _with_interval(extended, name)
        change = "" if extended is None else _ratio(base.values[name], extended.values[name])
        yield name, _with_interval(base, name), after, change


def _change(base: Identification, extended: Identification | None, name: str) -> float:
    """Return the size of a change on the scale of the fit, relative to the error of the base."""
    if extended is None:
        return 0.0
    before, after = base.values[name], extended.values[name]
    ratio = after / before if before else 0.0
    return abs(math.log(ratio)) if 0.0 < ratio < math.inf else abs(after - before)


def _ratio(before: float, after: float) -> str:
    """Return a change in percent, or as a factor where it is large."""
    ratio = after / before if before else 0.0
    if not 0.0 < ratio < math.inf:
        return ""
    return percent(ratio - 1.0, sign=True) if 0.5 < ratio < 2.0 else f"× {amount(ratio, digits=2)}"


def _with_interval(found: Identification, name: str) -> str:
    """Return a value with the half width of its 95 % interval, or with the factor of a wide one."""
    unknown, value = found.unknowns[found.index(name)], found.values[name]
    low, high = found.interval(name)
    if not found.determined(name) or not math.isfinite(high - low):
        return f"{amount(value, unknown.unit)} (open)"
    if unknown.scale == "linear" or value == 0.0:
        return f"{amount(value, unknown.unit)} ± {amount(0.5 * (high - low), unknown.unit, 2)}"
    factor = high / value
    if factor > 1.5:
        return f"{amount(value, unknown.unit)} ×/÷ {amount(factor, digits=2)}"
    return f"{amount(value, unknown.unit)} ± {amount(50.0 * (high - low) / value, digits=2)} %"


def _percent(size: float) -> str:
    return percent(size)


def _percent_or_none(size: float | None) -> str | None:
    return None if size is None else _percent(size)


def _decibel(before: float, after: float | None) -> str:
    if not before or not after or not 0.0 < (ratio := after / before) < math.inf:
        return ""
    return f"{number(20.0 * math.log10(ratio), '+.2g')} dB"


def _rms(modes: Sequence[ModeResidual]) -> float | None:
    errors = np.array([one.frequency_percent for one in modes])
    known = errors[np.isfinite(errors)]
    return 0.01 * float(np.sqrt(np.mean(known**2))) if known.size else None


def alternatives(verdict: Verdict, most: int | None = _ALTERNATIVES) -> Table:
    """Return every cause alone: how much it explains, how likely it is beside the best, and why it is not the answer.

    Parameters
    ----------
    verdict : Verdict
        The verdict.
    most : int or None
        Largest number of causes; None for all.
    """
    best, gain = verdict.best_evidence, verdict.gain
    metric = gain.metric if gain is not None else ""
    is_held_out = gain is not None and any(one.held_out is not None for one in verdict.candidates)
    before = wording.of_metric(metric, gain.held_out_before) if gain is not None and is_held_out else None
    rows: list[list[Cell]] = [["none: the model as it is", "", wording.odds(best), before, ""]]
    likely = beyond_chance(verdict)
    for one in likely[:most]:
        own = wording.of_metric(metric, one.held_out) if one.held_out is not None and is_held_out else None
        odds = wording.odds(best - one.evidence)
        rows.append([one.title, _share(verdict, one), odds, own, _why_not(verdict, one)])
    columns = ("cause, alone", Column("share\nexplained"), Column("odds to\nthe best"), Column("held out"), "why not")
    notes = [f"Held out: {wording.metric(metric)[0]}."] if is_held_out else []
    less = len(likely) - len(likely[:most])
    notes += [f"{less} more: --report and --json have all of them."] if less else []
    others = len(verdict.candidates) - len(likely)
    notes += [f"No more than noise by chance: {others} other cause{'s' if others > 1 else ''}."] if others else []
    return Table("Alternatives", columns, rows if likely else [], " ".join(notes)).without_empty()


def beyond_chance(verdict: Verdict) -> list[CandidateCause]:
    """Return the causes that are reported, or explain more than noise does by chance."""
    reported, least = {one.id for one in verdict.causes}, max(verdict.threshold, 0.0)
    return [one for one in verdict.candidates if one.evidence > least or one.id in reported]


def _share(verdict: Verdict, one: CandidateCause) -> str:
    """Return the share that a cause explains of the misfit above noise, which an adequate explanation shows."""
    selection = verdict.selection
    if selection.beside is not None:
        return wording.share(1.0, 1.0 - selection.share(one.explanation), 0.0)
    before, found = selection.base.misfit, verdict.explanation
    noise = 1.0 if found is None or not found.passed else found.fit.misfit
    return wording.share(before, one.misfit, noise)


def _why_not(verdict: Verdict, one: CandidateCause) -> str:
    """Return why a cause is not reported, or that it is."""
    together = {other.id: other.together_with for other in verdict.causes}
    if one.id in together:
        return f"reported, together with {wording.names(together[one.id])}" if together[one.id] else "reported"
    reasons = [one.vetoed] if one.vetoed else [] if one.plausible else ["implausible size"]
    if one.misfit > verdict.adequacy.limit and not reasons:
        reasons.append(f"leaves {wording.residual(verdict, one.misfit)}")
    if not one.converged:
        reasons.append("fit not converged")
    if not reasons and verdict.best_evidence - one.evidence <= MARGIN:
        reasons.append("rejected, see the notes")
    if not reasons:
        alike = max((other.look_alikes.get(one.id, 0.0) for other in verdict.causes), default=0.0)
        reasons.append(f"less likely; effect {100.0 * alike:.0f} % alike" if alike else "less likely")
    return "; ".join(reasons)


def key_figures(verdict: Verdict) -> list[tuple[str, str]]:
    """Return the few numbers that a reader looks for first, each with its name."""
    found = []
    for one in verdict.causes[:1]:
        if one.parameters:
            found.append((f"size: {one.title}", wording.sizes(one).split(" (95 %", 1)[0]))
    for name, before, after, *_ in (*_residuals(verdict), *_held_out(verdict)):
        if "score" not in str(name):
            found.append((str(name), str(before) if after is None or after == before else f"{before} → {after}"))
    return found
