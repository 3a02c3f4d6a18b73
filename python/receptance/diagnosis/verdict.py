"""The answer of a diagnosis."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from receptance.diagnosis import wording
from receptance.diagnosis.averaging import Ensemble, Target, extension
from receptance.identification.observations import MeasuredFrequencies
from receptance.report import Column, Provenance, Result, Table

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from receptance.assembly import Assembly
    from receptance.diagnosis.adequacy import Adequacy
    from receptance.diagnosis.bias import Bias
    from receptance.diagnosis.by_mode import ModeResidual
    from receptance.diagnosis.explanation import Explanation, Selection
    from receptance.diagnosis.held_out import Improvement
    from receptance.identification.laws import Tolerance
    from receptance.identification.result import Identification
    from receptance.report.table import Cell

__all__ = ["Answer", "Candidate", "Gain", "NextMeasurement", "Verdict"]

_SHOWN = 6
"""Candidates and natural frequencies in the tables; `to_dict` has all of them."""

Answer = Literal["adequate", "undecided", "named", "suspected", "ambiguous", "unexplained"]


@dataclass(frozen=True, kw_only=True)
class Candidate:
    """One cause, fitted.

    Attributes
    ----------
    id, group, meaning, remedy : str
        The cause.
    variant : str
        The way in which it acts.
    parameters : dict of str to (float, float, float)
        Value, lower and upper end of the 95 % interval, in SI units.
    gain : float
        Decrease of chi-square by it; of all causes together where several act.
    evidence : float
        That, less the logarithm of the number of observed numbers for each unknown: a difference of 10 is strong.
    misfit : float
        What is left, as a multiple of what noise and floor explain.
    plausible, converged : bool
        Whether anyone would believe the sizes, and whether its fit has ended.
    together_with : tuple of str
        Other causes that act in the same fit.
    look_alikes : dict of str to float
        Causes that do the same to these data, and how nearly, up to 1.
    vetoed : str
        Which of its sizes are outside their plausible range, in words; empty where none is.
    held_out : float or None
        The first of the gains' metrics on data that no fit saw, if this cause were believed, whatever the verdict says.
    """

    id: str
    group: str
    variant: str
    parameters: dict[str, tuple[float, float, float]]
    gain: float
    evidence: float
    misfit: float
    plausible: bool
    converged: bool
    together_with: tuple[str, ...]
    look_alikes: dict[str, float]
    meaning: str
    remedy: str
    vetoed: str = ""
    held_out: float | None = None


@dataclass(frozen=True, kw_only=True)
class Gain:
    """What the extended model improves on data that its fit never saw.

    Attributes
    ----------
    metric : str
        What is counted.
    held_out_before, held_out_after : float
        The metric over all folds; errors as their root mean square, scores and metrics of one's own as their mean.
    interval : (float, float)
        95 % interval of the improvement, which is positive where the extended model does better; infinite where one
        configuration alone was held out, zero where nothing was extended.
    folds : tuple of dict
        By configuration: verdict and causes without it, the metric before and after.
    better : int
        In how many of the folds it improves.
    """

    metric: str
    held_out_before: float
    held_out_after: float
    interval: tuple[float, float]
    folds: tuple[dict[str, Any], ...] = ()
    better: int = 0


@dataclass(frozen=True, kw_only=True)
class NextMeasurement:
    """What to measure next, and why.

    Attributes
    ----------
    action, reason : str
        What to do, and what simulating it has shown.
    separates : tuple of str
        Ids of the causes whose presence it is expected to settle, whichever of the reported ones is the truth.
    resolves : float
        Share of the reported explanations that it would tell from all others, if they were the truth.
    cost : float
        Effort, in hits on the machine or so.
    """

    action: str
    reason: str
    separates: tuple[str, ...] = ()
    resolves: float = 0.0
    cost: float = 0.0


@dataclass(frozen=True, kw_only=True, eq=False)
class Verdict(Result):
    """Whether the model is adequate, and what it lacks if not.

    Attributes
    ----------
    verdict : {"adequate", "undecided", "named", "suspected", "ambiguous", "unexplained"}
        The answer.
    causes : tuple of Candidate
        The reported ones, the best evidence first; none where the model is adequate or nothing explains the data.
    candidates : tuple of Candidate
        Every cause alone, the best evidence first.
    ambiguous_between : tuple of str
        Ids of those that cannot be told apart.
    adequacy, adequacy_after : Adequacy
        What base and best explanation leave.
    vetoed : tuple of Candidate
        Causes that explain the data as well as all plausible ones, or better, and are not reported because their
        sizes are outside the plausible range: something else may be in their place.
    rivals : tuple of Candidate
        Changes that are no causes, fitted where a cause might have been reported, the best evidence first; see
        `receptance.diagnosis.rivals`.
    rival : Candidate or None
        The one of them for which causes were withheld: look there.
    threshold : float
        Evidence that chance alone reaches in one of a thousand diagnoses.
    base, extended : Identification
        The fitted models; no extended one where nothing is reported.
    gains : tuple of Gain
        Improvement on what was held out, where it was asked for: in the distance of the spectra, in natural
        frequencies, in the predictive log score, and in metrics of one's own.
    bias : Bias or None
        Held-out natural frequencies that the model as given has off the same way.
    held_out_modes, held_out_modes_after : tuple of ModeResidual
        What is left of the held-out modes, measured less predicted.
    next_measurement : NextMeasurement or None
        What would help most.
    undecidable : dict of str to str
        Causes that these data cannot speak about, and what is missing.
    final : bool
        False where the diagnosis was interrupted; `notes` and `settings["interrupted"]` say how far it had come. Where
        not all causes had been tried nothing is "named".
    notes : tuple of str
        What a person should know.
    settings : dict
        What reproduces the run.
    provenance : Provenance
        Campaign and versions of the software.
    """

    verdict: Answer
    causes: tuple[Candidate, ...]
    candidates: tuple[Candidate, ...]
    ambiguous_between: tuple[str, ...]
    adequacy: Adequacy
    adequacy_after: Adequacy | None
    threshold: float
    base: Identification
    extended: Identification | None
    gains: tuple[Gain, ...]
    next_measurement: NextMeasurement | None
    undecidable: dict[str, str]
    notes: tuple[str, ...]
    settings: dict[str, Any]
    selection: Selection = field(repr=False)
    final: bool = True
    vetoed: tuple[Candidate, ...] = ()
    rivals: tuple[Candidate, ...] = ()
    rival: Candidate | None = None
    bias: Bias | None = None
    held_out_modes: tuple[ModeResidual, ...] = field(default=(), repr=False)
    held_out_modes_after: tuple[ModeResidual, ...] = field(default=(), repr=False)
    explanation: Explanation | None = field(default=None, repr=False)
    provenance: Provenance = field(default_factory=Provenance, repr=False)

    heading = "Diagnosis"

    @property
    def gain(self) -> Gain | None:
        """The first of the gains: in the spectra, or in natural frequencies where only these were measured."""
        return self.gains[0] if self.gains else None

    def unfinished(self, how_far: Mapping[str, float], *, tried: bool) -> Verdict:
        """Return the verdict of a diagnosis that was interrupted; `tried` says whether all causes had been tried."""
        note = (
            f"interrupted after {how_far['seconds']:.0f} s in step {how_far['step']} of about {how_far['of_about']}: "
            "this answer is not final"
        )
        if tried:
            note += "; all causes were tried, what is missing is advice or improvement on held-out data"
        answer = self.verdict
        if not tried and answer in ("named", "unexplained"):
            # Causes that were not tried may explain the data, or explain them better.
            answer = "suspected" if answer == "named" else "undecided"
        settings = {**self.settings, "interrupted": dict(how_far)}
        return replace(self, final=False, verdict=answer, notes=(note, *self.notes), settings=settings)

    def improved(self, found: Improvement) -> Verdict:
        """Return the verdict with what was found on data that no fit has seen."""
        from receptance.diagnosis.bias import bias_of

        candidates = tuple(replace(one, held_out=found.rivals.get(one.id)) for one in self.candidates)
        return replace(
            self,
            gains=found.gains,
            candidates=candidates,
            bias=bias_of(found.modes, found.slenderness),
            held_out_modes=found.modes,
            held_out_modes_after=found.modes_after,
        )

    def extend(
        self,
        assembly: Assembly,
        *,
        configuration: str = "",
        conditions: Mapping[str, float] | None = None,
        tolerances: Sequence[Tolerance] | None = None,
    ) -> Assembly:
        """Return an assembly with what was found, identified values and the causes that belong to the structure.

        What belongs to the measurement, a sensor's mass say, is left out: it is not there when the machine works.
        """
        target = Target(assembly, configuration, conditions, tolerances)
        extended, model = extension(self.selection.base.model, self.explanation, self.extended or self.base, target)
        return extended.apply(
            model.observations[0].assembly,
            configuration=configuration,
            conditions=conditions,
            tolerances=None if tolerances is None else model.tolerances,
        )

    def predict_natural_frequencies(
        self,
        assembly: Assembly,
        upper_hz: float,
        *,
        configuration: str = "",
        conditions: Mapping[str, float] | None = None,
        tolerances: Sequence[Tolerance] | None = None,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Natural frequencies of an assembly through the extended model (the base where there is none).

        Parameters
        ----------
        assembly : Assembly
            As the base model describes it.
        upper_hz, configuration, conditions, tolerances
            As in `Identification.predict_natural_frequencies`.

        Returns
        -------
        frequency_hz, standard_error_hz : ndarray
            `(n_modes,)` each. The errors have in them what the other fitted models would make of it, with their
            probabilities; they are infinite where nothing explains the data.
        """
        target = Target(assembly, configuration, conditions, tolerances)
        found, errors = self._ensemble.natural_frequencies(
            self.explanation, self.extended or self.base, target, upper_hz
        )
        return found, np.full_like(errors, np.inf) if self.verdict == "unexplained" else errors

    @cached_property
    def _ensemble(self) -> Ensemble:
        return Ensemble(self.selection, int(self.settings["seed"]))

    def frequency_errors(self) -> list[dict[str, Any]]:
        """Return calculated less measured natural frequencies in percent, before and after, mode by mode."""
        rows = []
        for index, one in enumerate(self.selection.base.model.observations):
            if not isinstance(one, MeasuredFrequencies):
                continue
            before = self._percent(self.base, index)
            after = before if self.extended is None else self._percent(self.extended, index)
            rows += [
                {
                    "label": one.label or one.configuration,
                    "mode": mode,
                    "measured_hz": float(hz),
                    "before": b,
                    "after": a,
                }
                for mode, hz, b, a in zip(one.modes, one.frequency_hz, before, after, strict=True)
            ]
        return rows

    @staticmethod
    def _percent(found: Identification, index: int) -> list[float]:
        one = found.task.observed[index]
        if not isinstance(one, MeasuredFrequencies) or one.standard_deviation_hz is None:
            return []
        own = found.residuals[index][: one.frequency_hz.size]
        return [float(x) for x in 100.0 * own * one.standard_deviation_hz / one.frequency_hz]

    @property
    def measurements(self) -> tuple[str, ...]:
        """Labels of the observations that the verdict rests on."""
        return tuple(one.label for one in self.selection.base.model.observations)

    def tables(self) -> list[Table]:
        """Return candidates, the natural frequencies with the largest errors, and the improvement on held-out data."""
        return [table for table in (self._candidate_table(), self._frequency_table(), self._gain_table()) if table.rows]

    def sentences(self) -> list[str]:
        """Return the answer, the misfit, each reported cause, and the measurement that would help most."""
        lines = [f"{'verdict' if self.final else 'verdict so far, not final'}: {self.verdict}", wording.sentence(self)]
        after = self.adequacy_after
        left = f"; with the causes {after.misfit:.2f}" if after is not None else ""
        if self.final or self.selection.base.converged:
            lines.append(f"misfit: {self.adequacy.misfit:.2f} times what noise and floor explain{left}")
        else:
            lines.append("the base model is not fitted yet, so nothing is known of causes")
        times = wording.wanting(self) if self.final else None
        if self.verdict == "unexplained" and times is not None:
            lines.append(f"the model would be adequate if all standard deviations were {times:.2g} times as large")
        lines += wording.on_causes(self)
        if self.ambiguous_between:
            lines.append(f"cannot be told apart: {', '.join(self.ambiguous_between)}")
        if self.bias is not None:
            lines.append(f"held out: {self.bias}")
        if self.next_measurement is not None:
            lines.append(f"measure next: {self.next_measurement.action}; {self.next_measurement.reason}")
        return lines

    def data(self) -> dict[str, Any]:
        """Return answer, causes, candidates, improvement and residuals by mode."""
        from receptance.diagnosis.by_mode import residuals_by_mode

        best = self.explanation
        return {
            "measurements": self.measurements,
            "verdict": self.verdict,
            "final": self.final,
            "causes": [_as_dict(one) for one in self.causes],
            "ambiguous_between": self.ambiguous_between,
            "gain": self.gain,
            "gains": self.gains,
            "next_measurement": self.next_measurement,
            "candidates": [_as_dict(one) for one in self.candidates],
            "vetoed": [_as_dict(one) for one in self.vetoed],
            "rivals": [_as_dict(one) for one in self.rivals],
            "rival": None if self.rival is None else _as_dict(self.rival),
            "threshold": self.threshold,
            "adequacy": self.adequacy,
            "adequacy_after": self.adequacy_after,
            "base": self.base.values,
            "extended": None if self.extended is None else self.extended.values,
            "residuals_by_mode": {
                "before": residuals_by_mode(self.selection.base),
                "after": None if best is None else residuals_by_mode(best.fit),
            },
            "held_out_by_mode": {"before": self.held_out_modes, "after": self.held_out_modes_after},
            "bias": None if self.bias is None else {**asdict(self.bias), "text": str(self.bias)},
            "frequency_errors_percent": self.frequency_errors(),
            "undecidable": self.undecidable,
            "settings": self.settings,
        }

    def plot(self, ax: Axes | None = None) -> Figure:
        """Draw measured and modelled data before and after, and the evidence of the candidates; see `Result.plot`."""
        from receptance.plot.diagnosis import draw_diagnosis

        return draw_diagnosis(self, ax)

    def _candidate_table(self) -> Table:
        gain = self.gain if any(one.held_out is not None for one in self.candidates) else None
        rows: list[list[Cell]] = []
        for one in self.candidates[:_SHOWN]:
            held_out = None
            if gain is not None:
                held_out = (gain.held_out_before, gain.held_out_before if one.held_out is None else one.held_out)
            doubts = (() if one.converged else ("not converged",)) + (() if one.plausible else ("not plausible",))
            rows.append([one.id, one.evidence, one.misfit, held_out, ", ".join(doubts)])
        columns = (
            "candidate, alone",
            Column("evidence", form="+.1f"),
            Column("misfit left", form=".2f"),
            Column("held out\nif believed", form=".3g"),
            "but",
        )
        return Table("Candidates, each alone", columns, rows).without_empty()

    def _frequency_table(self) -> Table:
        errors = sorted(self.frequency_errors(), key=lambda row: -abs(row["before"]))[:_SHOWN]
        after = None if self.extended is None else "after"
        rows = [(r["label"], r["mode"], r["before"], r[after] if after else None) for r in errors]
        columns = (
            "measurement",
            Column("mode", form="d"),
            Column("before" if after else "fitted", "%", "+.2f"),
            Column("after", "%", "+.2f"),
        )
        title = "Natural frequencies with the largest errors, calculated less measured"
        return Table(title, columns, rows).without_empty()

    def _gain_table(self) -> Table:
        columns = ("metric", Column("before"), Column("after"), "improvement")
        rows = [(one.metric, one.held_out_before, one.held_out_after, wording.improved(one)) for one in self.gains]
        return Table("Held out", columns, rows)

    def __repr__(self) -> str:
        names = ", ".join(one.id for one in self.causes)
        open_ = "" if self.final else ", not final"
        return f"Verdict({self.verdict}{open_}{': ' + names if names else ''}; misfit {self.adequacy.misfit:.2f})"


def _as_dict(one: Candidate) -> dict[str, Any]:
    names = ("value", "lower", "upper")
    found = {name: dict(zip(names, numbers, strict=True)) for name, numbers in one.parameters.items()}
    return {**asdict(one), "parameters": found}
