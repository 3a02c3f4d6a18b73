"""Text of a diagnosis: reasons as codes with values, the sentence of each, names, sizes with units, ratios.

Decisions are made on codes and values; a sentence is made when it is shown.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from receptance._text import first_of, join_names
from receptance.diagnosis.catalogue import CATALOGUE
from receptance.diagnosis.causes import Parameter
from receptance.diagnosis.model import DATA_HOLDER, TABLE
from receptance.diagnosis.thresholds import LEAST_FREEDOM, LEAST_SHARE
from receptance.fit.line_selection import NOISIEST_LINE
from receptance.report.table import amount, amounts, percent


@dataclass(frozen=True)
class Reason:
    """A reason of an answer, or a limit of the data; its text is the sentence."""

    code: str
    """What it is, such as "near_threshold"."""
    values: Mapping[str, Any] = field(default_factory=dict)
    """Numbers in SI units, ids, and titles of explanations and places, by name."""

    def __str__(self) -> str:
        shown = {name: _shown(name, value) for name, value in self.values.items()}
        return SENTENCES[self.code].format(**shown, odds=odds(self.values.get("evidence", 0.0)))


def _shown(name: str, value: Any) -> Any:
    """Return a value of a reason for its sentence: several ones as text."""
    if name == "causes":
        return names(value)
    if isinstance(value, Mapping):
        return first_of([f"{key} = {size:.3g}" for key, size in value.items()])
    return join_names([*map(str, value)]) if isinstance(value, (list, tuple)) else value


# Names.


def title_of(id: str) -> str:
    """Return the name of a cause in texts and figures."""
    return CATALOGUE[id].title if id in CATALOGUE else id.replace("_", " ")


def names(ids: Sequence[str]) -> str:
    """Return the names of causes as a list in a sentence."""
    return join_names([title_of(id) for id in ids])


def capital(text: str) -> str:
    """Return a text with a capital first letter."""
    return text[:1].upper() + text[1:]


# Sizes with units.


@dataclass(frozen=True)
class Size:
    """A value of a parameter with a range: its 95 % interval, or what is plausible."""

    name: str
    """Name of the parameter without its cause, such as "log_density tool"."""
    unit: str
    value: float
    lower: float
    upper: float

    @classmethod
    def of(cls, name: str, parameter: Parameter, value: float, lower: float, upper: float) -> Size:
        """Return the size of an unknown by its name."""
        return cls(name.removeprefix(f"{parameter.cause}."), parameter.unit, value, lower, upper)

    def texts(self, digits: int) -> tuple[str, list[str], str]:
        """Return the name in words, the three numbers, and their unit with a space; logarithms in percent.

        Names in a campaign, such as k_y, are kept.
        """
        values = (self.value, self.lower, self.upper)
        word, *rest = self.name.removeprefix("log_").split(" ")
        words = " ".join([word if word.startswith(("k_", "c_")) else word.replace("_", " "), *rest])
        if self.name.startswith("log_"):
            return (
                words,
                [percent(math.expm1(min(value, 50.0)), 3, sign=True).removesuffix(" %") for value in values],
                " %",
            )
        texts, unit = amounts(values, self.unit, digits)
        return words, texts, f" {unit}" if unit else ""

    def __str__(self) -> str:
        words, (value, low, high), unit = self.texts(3)
        return f"{words} {value}{unit} (plausible: {low} to {high}{unit})"


def size_texts(
    values: Mapping[str, tuple[float, float, float]], parameters: Mapping[str, Parameter]
) -> list[tuple[str, str]]:
    """Return each value of a cause with its unit, such as "mass 1.99 g", and its 95 % interval, "1.98 to 2.00 g"."""
    texts = []
    for name, (value, *ends) in values.items():
        parameter = parameters[name]
        # An interval by the curvature may exceed the bounds of the parameter.
        low, high = (min(max(end, parameter.lower), parameter.upper) for end in ends)
        words, numbers, unit = Size.of(name, parameter, value, low, high).texts(_digits(value, high - low))
        texts.append((f"{words} {numbers[0]}{unit}", f"{numbers[1]} to {numbers[2]}{unit}"))
    return texts


_MOST_SIZES = 6
"""Most sizes of a cause in a text."""


def sizes(values: Mapping[str, tuple[float, float, float]], parameters: Mapping[str, Parameter]) -> str:
    """Return the sizes of a cause, with units and 95 % intervals; of many those that are the most significant."""

    def significance(name: str) -> float:
        value, low, high = values[name]
        return abs(value - parameters[name].null) / max(high - low, 1e-300)

    kept = sorted(values, key=significance, reverse=True)[:_MOST_SIZES]
    texts = size_texts({name: value for name, value in values.items() if name in kept}, parameters)
    shown = ", ".join(f"{size} (95 %: {interval})" for size, interval in texts)
    return shown if len(values) <= _MOST_SIZES else f"{shown}, and {len(values) - _MOST_SIZES} less significant ones"


def _digits(value: float, width: float) -> int:
    """Return the significant digits that the width of the interval justifies."""
    ratio = abs(value) / width if width > 0.0 else 0.0
    # Neither an underflow nor an open interval says anything of the digits.
    return min(max(math.floor(math.log10(ratio)) + 3, 2), 6) if math.isfinite(ratio) and ratio > 0.0 else 3


# Ratios.

_LARGEST_ODDS = 1e6


def odds(difference: float) -> str:
    """Return the odds of an explanation to one with more evidence, from the difference of both.

    Evidence is twice the logarithm of the odds.

    Examples
    --------
    >>> from receptance.diagnosis.text import odds
    >>> odds(0.0), odds(7.0), odds(4000.0)
    ('1 : 1', '1 : 33', '< 1 : 1e6')
    """
    ratio = math.exp(min(0.5 * max(difference, 0.0), 50.0))
    return "< 1 : 1e6" if ratio > _LARGEST_ODDS else f"1 : {amount(ratio, digits=2).removesuffix('.0')}"


def share(before: float, after: float, noise: float = 1.0) -> str:
    """Return the share of the misfit above the noise that is explained, in percent; empty where there is none.

    Misfits are chi-square divided by its expectation.

    Examples
    --------
    >>> from receptance.diagnosis.text import share
    >>> share(5.0, 2.0), share(5.0, 1.001), share(0.99, 0.98), share(1.04, 1.02, 1.02)
    ('75 %', '> 99 %', '', '100 %')
    """
    if before <= noise:
        return ""
    percent = 100.0 * min(max((before - after) / (before - noise), 0.0), 1.0)
    return "> 99 %" if 99.0 < percent < 99.99 else f"{percent:.0f} %"


# Sentences of reasons.

_FREEDOM = (
    "independent values: {values:.3g}, unknowns: {unknowns}, degrees of freedom: {freedom:.3g}, expected at least "
    f"{LEAST_FREEDOM}"
)
_DOUBTS = {
    "fast": "a fast diagnosis names no cause",
    "unusual_size": "its size is unusual: {sizes}; check the drawing or the stated value",
    "near_threshold": "its effect is near the detection threshold",
    "alternative_near": "{alternative} explains the data about as well",
    "few_degrees": _FREEDOM,
    "strained": "its errors of the tolerances are beyond the 1 % level, in standard deviations {errors}",
    "window_at_table": "an exponential window has a similar effect, and cannot be tried with a table of receptances",
    "one_configuration": "one configuration does not distinguish {sources}; measure {another}",
    "one_mode": "one mode does not distinguish the joint from the parts; measure up to a second one",
    "one_improved": (
        "it improves {configuration} alone, as an effect of that tool or clamping may; measure another configuration"
    ),
    "large_sizes": "{sizes} is large for a cause beside another one; an effect outside the catalogue may imitate both",
    "within_limit": "without one of them the misfit is within its limit; any other effect may explain the rest",
    "not_predicted": "it is in no prediction of configurations that were left out",
    "not_better": "held-out data are not predicted better ({metric}): {before:.4g} before, {after:.4g} after",
}
"""Doubts about an explanation, which follow its title."""
_SHARES = {
    "share_taken": "; the rest has no known cause",
    "share_unspecific": ", but other errors of the structure would have a similar effect",
    "share_of_some": ", but other errors of these records would have a similar effect",
    "share_small": f", expected at least {100.0 * LEAST_SHARE:.0f} %",
    "share_ambiguous": ", but these cannot be distinguished: {causes}",
    "share_uncertain": ", but this is not certain",
    "share_unconfirmed": ", but without a discrepancy {without} explains the data best",
}
"""What is said of the share of the misfit that an explanation takes with a model discrepancy."""
_INTERRUPTED = "interrupted after {seconds:.0f} s in step {step} of about {of_about}: this answer is not final"
SENTENCES = {
    **{code: f"{{title}} is not certain: {text}" for code, text in _DOUBTS.items()},
    **{
        code: f"with a model discrepancy of {{discrepancy}} {{title}} takes {{percent:.0f}} % of the misfit{text}"
        for code, text in _SHARES.items()
    },
    # The answer of the base, and explanations that are not reported.
    "base_inadequate": "the base model {adequacy.shortcoming}, and no cause improves it",
    "base_not_converged": "the fit of the base model has not converged",
    "too_few_values": f"the model cannot be judged ({_FREEDOM}): measure more modes, {{another}}, or an FRF",
    "rejected": "the best explanation, {title}, {adequacy.shortcoming}, so it is rejected",
    "vetoed": "{title} explains the data, but only with an implausible size: {sizes}: vetoed",
    "alternative_preferred": (
        "{title} explains the data, but {alternative}, a single change, is at least as likely (odds of the cause to it "
        "{odds}); it is not a known cause, so no cause is named: inspect that place"
    ),
    "not_converged": "the fit with {title} has not converged, so no cause is named on its own",
    # Limits of the run.
    "causes_not_tried": f"{_INTERRUPTED}, because not all causes were tried",
    "interrupted": f"{_INTERRUPTED}; all causes were tried, but advice or improvement on held-out data is missing",
    "fast_diagnosis": (
        "fast diagnosis: configurations were not left out in turn, changes that imitate a cause were not fitted, and "
        "no model discrepancy was estimated; diagnose without --fast before you rely on the cause"
    ),
    # Limits of the data.
    "contradiction": (
        "{first} and {second} contradict each other: they are of one structure at the same places, and {second} is "
        "{ratio:.3g} times {first} with a phase of {phase_deg:+.0f}° in the median; {percent:.0f} % of the lines "
        "differ, from {low_hz:.0f} to {high_hz:.0f} Hz, by {misfit:.3g} times the noise: "
        "repeat one of them"
    ),
    "same_values": "{first} and {second} have the same values, although they are of two configurations: one file was "
    "copied over the other",
    "no_tolerances": "there are no tolerances: an ordinary deviation may be mistaken for a cause",
    "single_configuration": "there is one configuration: measure {another} to distinguish {sources}",
    "single_mode": "there is one mode in each record: measure up to a second one to distinguish joint and parts",
    DATA_HOLDER: (
        "the holder is described by data, so these causes are not decided: {causes}; if the holder may have changed "
        "since it was measured, measure it again"
    ),
    TABLE: (
        "the model ends with a table of receptances, so these causes are not decided: {causes}; describe that part by "
        "modes to decide them"
    ),
    "frequencies_alone": "there are natural frequencies alone: they do not show {hidden}",
    "frequencies_and_frfs": "natural frequencies do not show gain, delay, window and hits: the FRFs alone do",
    "lines_left_out": (
        "{lost} of {total} lines are not used: the standard deviation of their logarithm, or of that of another record "
        f"of the configuration, is above {NOISIEST_LINE:g} (antiresonances, or a low coherence)"
    ),
    "records_left_out": (
        f"not used: too few lines with a standard deviation up to {NOISIEST_LINE:g}: {{records}}; the coherence is too "
        "low there: hit harder, or average more hits"
    ),
    "table_without_covariance": (
        "the table {table!r} has no covariance: its noise counts as an error of the model; give `covariance`, or read "
        "it with `receptance.coupling.read_spindle` from a file with variances"
    ),
    "spindle_errors": "{errors}",
    # What a campaign adds.
    "held_out_used": (
        "{values:.3g} measured values for {unknowns} unknowns are too few to test the model, so held-out measurements "
        "are used in the diagnosis; improvement is computed for assemblies left out in turn"
    ),
    "held_out_error": "without held-out measurements the rms error of their natural frequencies is {percent:.2f} %",
    "bias": "without held-out measurements {bias}",
    "imitated_by_modes": (
        "these data do not show causes of typical size that the joint and the {modes} unknown modes imitate: {causes}; "
        "measure another overhang, or the spindle alone, to decide them"
    ),
    "all_modes_fitted": "more modes of {part} do not explain the rest: the fit has as many as the records show",
    "modes_shown": "more modes of {part} do not explain the rest: the records show {modes}",
    "each_mode_improves": (
        "each of the {modes} modes of {part} improves the description, the last one by {criterion:.3g} of the "
        'criterion: before a cause is searched for, try `modes = "auto"`, which adds modes as long as they do'
    ),
    "one_mode_stated": 'one mode of {part} may be too few: before a cause is searched for, try `modes = "auto"`',
}
"""The sentence of each reason by its code, with the values of the reason in braces."""
