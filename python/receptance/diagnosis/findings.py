"""Findings of a diagnosis: the answer, the causes with their evidence, and the improvement on held-out data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Any, Self

import numpy as np

from receptance.diagnosis.averaging import AveragedAssembly
from receptance.diagnosis.by_mode import Bias, ModeResidual, residuals_by_mode, residuals_of_frequencies
from receptance.diagnosis.causes import Parameter
from receptance.diagnosis.explanation import Explanation, Selection
from receptance.diagnosis.fitting import Fit, fit_discrepancy, sufficient
from receptance.diagnosis.held_out import Gain, Improvement, doubt_prediction
from receptance.diagnosis.judgement import Answer
from receptance.diagnosis.model import Model
from receptance.diagnosis.wording import sizes, title_of
from receptance.errors import ReceptanceError
from receptance.fit.adequacy import Adequacy
from receptance.fit.discrepancy import Discrepancy
from receptance.fit.likelihood import interval_within_bounds
from receptance.fit.parameters import Site
from receptance.fit.result import Identification
from receptance.fit.unknowns import Tolerance
from receptance.model.assembly import Assembly
from receptance.report import Provenance


@dataclass(frozen=True, kw_only=True)
class CandidateCause:
    """A fitted cause."""

    id: str
    """Identifier of the cause."""
    group: str
    """Group of the cause."""
    variant: str
    """The variant in which it acts."""
    explanation: Explanation = field(repr=False)
    """The fit with the cause."""
    gain: float
    """Decrease of chi-square, of all causes together where several act."""
    evidence: float
    """The gain less the logarithm of the number of observed numbers for each unknown: a difference of 10 is strong."""
    misfit: float
    """Chi-square with it, divided by its expectation from noise and floor."""
    plausible: bool
    """Whether the sizes are plausible."""
    converged: bool
    """Whether the fit has converged."""
    together_with: tuple[str, ...]
    """Other causes in the same fit."""
    look_alikes: dict[str, float]
    """Causes with a similar effect on these data, and the cosine of the effects, up to 1."""
    meaning: str
    """What the cause is."""
    remedy: str
    """What to do about it."""
    vetoed: str = ""
    """The sizes outside their plausible range, as text; empty where there is none."""
    held_out: float | None = None
    """First metric of the gains on held-out data with this cause alone, whatever the verdict."""
    declared: Mapping[str, Parameter] = field(default_factory=dict, repr=False)
    """Declaration of each parameter, by the names in `parameters`."""

    @cached_property
    def parameters(self) -> dict[str, tuple[float, float, float]]:
        """Value, lower and upper end of the 95 % interval of each parameter, in SI units."""
        # Most causes are far behind, and their intervals take as long as a fit.
        fit = self.explanation.fit.identification
        interval = partial(interval_within_bounds, fit) if self.evidence > 0.0 else fit.interval
        return {name: (fit.values[name], *interval(name)) for name in self.declared}

    @property
    def sizes(self) -> str:
        """The sizes, with units and 95 % intervals."""
        return sizes(self.parameters, self.declared)

    @property
    def title(self) -> str:
        """Name of the cause in texts and figures."""
        return title_of(self.id)


@dataclass(frozen=True, kw_only=True)
class ProposedMeasurement:
    """The measurement that is proposed next."""

    action: str
    """The measurement."""
    reason: str
    """Result of its simulation."""
    separates: tuple[str, ...] = ()
    """Ids of the causes whose presence it is expected to decide, whichever reported explanation is true."""
    resolves: float = 0.0
    """Share of the reported explanations that it distinguishes from all others, if they are true."""
    cost: float = 0.0
    """Effort, in hits on the machine."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Findings:
    """Whether the model is adequate, and the causes that explain the data if it is not; shown as a `Verdict`."""

    verdict: Answer
    """The answer. "partly explained" is a cause that takes at least half of the misfit."""
    causes: tuple[CandidateCause, ...]
    """The reported causes, the highest evidence first; none where the model is adequate or unexplained."""
    candidates: tuple[CandidateCause, ...]
    """Every cause alone, the highest evidence first."""
    ambiguous_between: tuple[str, ...]
    """Ids of the causes between which the data do not decide."""
    next_measurement: ProposedMeasurement | None
    """The measurement that is proposed next."""
    notes: tuple[str, ...]
    settings: dict[str, Any]
    """Settings that reproduce the run."""
    selection: Selection = field(repr=False)
    """All fits. Where the data are partly explained these allow for the discrepancy."""
    adequacy: Adequacy = field(repr=False)
    """Adequacy of the base, without a discrepancy."""
    base_fit: Fit = field(repr=False)
    """The base; it allows for the discrepancy, if there is one."""
    discrepancy: Discrepancy | None = None
    """Error of the base beside the noise, where no cause explains the data to the noise."""
    discrepancy_after: Discrepancy | None = None
    """The same of the extended model."""
    gains: tuple[Gain, ...] = ()
    """Improvement on held-out data, if requested: in the distance of the spectra, in natural frequencies, in the
    predictive log score, and in user-defined metrics."""
    final: bool = True
    """False after an interruption; `notes` and `settings["interrupted"]` state the step. If not all causes were tried,
    none is "named"."""
    vetoed: tuple[CandidateCause, ...] = ()
    """Causes with at least the evidence of all plausible ones that are not reported because their sizes are outside the
    plausible range: another effect may act in their place."""
    alternatives: tuple[CandidateCause, ...] = ()
    """Changes that are not causes, fitted where a cause may be reported, the highest evidence first; see
    `receptance.diagnosis.alternatives`."""
    alternative: CandidateCause | None = None
    """The alternative because of which no cause is reported; it shows where the model is wrong."""
    bias: Bias | None = None
    """Held-out natural frequencies in which the errors of the base have a common sign."""
    held_out_modes: tuple[ModeResidual, ...] = field(default=(), repr=False)
    """Held-out modes, predicted less measured."""
    held_out_modes_after: tuple[ModeResidual, ...] = field(default=(), repr=False)
    """The same of the extended model."""
    explanation: Explanation | None = field(default=None, repr=False)
    """The best of the reported explanations."""
    provenance: Provenance = field(default_factory=Provenance, repr=False)
    without_discrepancy: Self | None = field(default=None, repr=False)
    """Where the data are partly explained: the answer of the fits to the noise, which is given if held-out data
    contradict the cause."""
    held_out: Model | None = field(default=None, repr=False)
    """Held-out measurements with their tolerances, if separate ones are used; then the fits do not include them."""
    campaign_lines: tuple[str, ...] = field(default=(), repr=False)
    """Lines that add the best of the reported explanations to the campaign file; empty without a campaign, or where a
    campaign file cannot describe it."""
    campaign_path: str = field(default="", repr=False)
    """The campaign as it was named on the command line, for the commands of the next step; empty elsewhere."""

    @property
    def adequacy_after(self) -> Adequacy | None:
        """Adequacy of the best of the reported explanations; None beside a discrepancy, with which every fit is."""
        return None if self.explanation is None or self.discrepancy is not None else self.explanation.adequacy

    @cached_property
    def base(self) -> Identification:
        """The fitted base as `identify` states it: where it is not adequate, its intervals include the discrepancy."""
        if self.discrepancy is None:
            return _judged(self.base_fit)
        identification = self.base_fit.identification
        return replace(identification, task=replace(identification.task, discrepancy=self.discrepancy))

    @property
    def extended(self) -> Identification | None:
        """The fitted model of the best of the reported explanations; None where no cause is reported."""
        return None if self.explanation is None else self.explanation.fit.identification

    @property
    def threshold(self) -> float:
        """Evidence that the best cause reaches by chance in one of a thousand diagnoses of an adequate model."""
        return self.selection.threshold

    @property
    def undecidable(self) -> dict[str, str]:
        """Causes that these data cannot show, and the reasons."""
        return {id: str(error) for id, error in self.selection.undecidable.items()}

    @property
    def gain(self) -> Gain | None:
        """The first of the gains: of the spectra, or of natural frequencies where only these were measured."""
        return self.gains[0] if self.gains else None

    def interrupt(self, position: Mapping[str, float], *, tried: bool) -> Self:
        """Return the verdict of an interrupted diagnosis; `tried` is true if all causes had been tried."""
        note = (
            f"interrupted after {position['seconds']:.0f} s in step {position['step']} of about "
            f"{position['of_about']}: this answer is not final"
        )
        if tried:
            note += "; all causes were tried, but advice or improvement on held-out data is missing"
        answer = self.verdict
        if not tried and answer in ("named", "unexplained"):
            # Another cause, which was not tried, may have more evidence.
            answer = "suspected" if answer == "named" else "undecided"
        settings = {**self.settings, "interrupted": dict(position)}
        return replace(self, final=False, verdict=answer, notes=(note, *self.notes), settings=settings)

    def with_improvement(self, found: Improvement) -> Self:
        """Return the verdict with its improvement on held-out data; without one a named cause is suspected only."""
        doubt, answer = None, self.verdict
        if answer in ("named", "partly explained") and self.explanation is not None and found.complete and found.gains:
            doubt = doubt_prediction(self.selection.base, self.explanation, found.gains[0])
        notes = self.notes
        if doubt is not None:
            answer = "suspected" if answer == "named" else "unexplained"
            notes = (*notes, f"{answer}: {doubt}")
        if answer == "unexplained" and self.without_discrepancy is not None:
            plain = replace(
                self.without_discrepancy, discrepancy=self.discrepancy, base_fit=self.base_fit, final=self.final
            )
            return replace(plain, notes=(*plain.notes, notes[-1])).with_improvement(found)
        candidates = tuple(
            replace(candidate, held_out=found.singles.get(candidate.id)) for candidate in self.candidates
        )
        return replace(
            self,
            verdict=answer,
            notes=notes,
            gains=found.gains,
            candidates=candidates,
            bias=found.bias,
            held_out_modes=found.modes,
            held_out_modes_after=found.modes_after,
        )

    @cached_property
    def _predicting(self) -> Identification:
        """The fit of the predictions: of the best of the reported explanations, or of the base."""
        if self.explanation is None:
            return self.base
        return _judged(self.explanation.fit) if self.discrepancy is None else self.explanation.fit.identification

    def at(
        self,
        assembly: Assembly,
        *,
        configuration: str = "",
        conditions: Mapping[str, float] | None = None,
        tolerances: Sequence[Tolerance] | None = None,
    ) -> AveragedAssembly:
        """Return an assembly of the base model as the extended model predicts it, with errors by all fitted models.

        Causes of the structure are included. Those of the measurement, a sensor's mass for example, are left out: they
        do not act when the machine works. Parameters are as of `Identification.at`. Where the verdict is "unexplained"
        and a discrepancy could not be estimated, standard errors are infinite.

        Returns
        -------
        AveragedAssembly
            With the attribute `assembly` and the method `natural_frequencies`.
        """
        left, identified = self.discrepancy_after or self.discrepancy, self._predicting
        relative = np.inf if self.verdict == "unexplained" else 0.0
        if identified.discrepancy is not None:
            left, relative = None, 0.0  # its predictions have the discrepancy
        return AveragedAssembly(
            self.selection,
            self.explanation,
            identified,
            Site(assembly, configuration, "", conditions or {}),
            tolerances,
            relative if left is None else left.frequency,
        )

    def frequency_errors(self) -> list[dict[str, Any]]:
        """Return modelled less measured natural frequencies in percent, before and after, by mode."""
        before = residuals_of_frequencies(self.base_fit)
        after = before if self.explanation is None else residuals_of_frequencies(self.explanation.fit)
        return [
            {
                "label": one.label,
                "mode": one.mode,
                "measured_hz": one.measured_hz,
                "before": one.frequency_percent,
                "after": other.frequency_percent,
            }
            for one, other in zip(before, after, strict=True)
        ]

    @property
    def measurements(self) -> tuple[str, ...]:
        """Labels of the observations that the verdict rests on."""
        return tuple(observation.label for observation in self.selection.base.model.observations)

    @property
    def causes_together(self) -> tuple[str, ...]:
        """Ids of the causes of the best of the reported explanations."""
        return () if self.explanation is None else tuple(variant.cause.id for variant in self.explanation.variants)

    @property
    def best_evidence(self) -> float:
        """Highest evidence of all explanations, that of the base (0) included."""
        return max([0.0, *(one.evidence for one in (*self.candidates, *self.causes))])

    @cached_property
    def modes(self) -> tuple[ModeResidual, ...]:
        """Residuals of the base by mode; empty after an interruption, because fits of circles take seconds."""
        return residuals_by_mode(self.base_fit) if self.final else ()

    @cached_property
    def modes_after(self) -> tuple[ModeResidual, ...]:
        """Residuals of the best of the reported explanations by mode; empty where none is, and as `modes`."""
        return residuals_by_mode(self.explanation.fit) if self.final and self.explanation is not None else ()


def _judged(fit: Fit) -> Identification:
    """Return a fit as `identify` states it: it allows for a discrepancy where its data do not show that it has none."""
    if fit.adequacy.needs_discrepancy and fit.converged:
        try:
            found = sufficient(fit_discrepancy(fit.model.resonant(), fit.values))
        except ReceptanceError:
            return fit.identification
        identification = found.fit.identification
        return replace(identification, task=replace(identification.task, discrepancy=found.discrepancy))
    return fit.identification
