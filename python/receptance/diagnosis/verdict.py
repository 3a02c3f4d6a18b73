"""The verdict of a diagnosis: the answer, the causes with their evidence, and the improvement on held-out data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field, fields, replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from receptance import diagnosis
from receptance.diagnosis.advice import ProposedMeasurement
from receptance.diagnosis.by_mode import Bias, ModeResidual, residuals_by_mode
from receptance.diagnosis.causes import Variant
from receptance.diagnosis.explanation import Explanation, Selection
from receptance.diagnosis.fitting import DiscrepancyFit, Fit, fit_discrepancy, sufficient
from receptance.diagnosis.held_out import Gain, Improvement
from receptance.diagnosis.judgement import Answer, Judgement, limits_of
from receptance.diagnosis.measured_data import DOUBTFUL_DATA
from receptance.diagnosis.model import Model
from receptance.diagnosis.prediction import AveragedAssembly
from receptance.diagnosis.screening import look_alikes
from receptance.diagnosis.text import Reason, Size, sizes, title_of
from receptance.diagnosis.thresholds import LEADING_CAUSES, LISTED, MARGIN
from receptance.errors import ReceptanceError
from receptance.fit.adequacy import Adequacy
from receptance.fit.discrepancy import Discrepancy
from receptance.fit.likelihood import interval_within_bounds
from receptance.fit.parameters import Site
from receptance.fit.result import Identification
from receptance.fit.unknowns import Tolerance
from receptance.model.assembly import Assembly
from receptance.report import Fact, PageSection, Provenance, Result, Table


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
    implausible: tuple[Size, ...]
    """The sizes outside their plausible range, with this range."""
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
    held_out: float | None = None
    """First metric of the gains on held-out data with this cause alone, whatever the verdict."""

    @property
    def plausible(self) -> bool:
        """Whether the sizes are plausible."""
        return not self.implausible

    @property
    def vetoed(self) -> str:
        """The sizes outside their plausible range, as text; empty where there is none."""
        return ", ".join(map(str, self.implausible))

    @cached_property
    def parameters(self) -> dict[str, tuple[float, float, float]]:
        """Value, lower and upper end of the 95 % interval of each parameter, in SI units."""
        # Most causes are far behind, and their intervals take as long as a fit.
        fit, parameters = self.explanation.fit.identification, self.explanation.parameters
        names = (name for name, parameter in parameters.items() if parameter.cause == self.id)
        interval = partial(interval_within_bounds, fit) if self.evidence > 0.0 else fit.interval
        return {name: (fit.values[name], *interval(name)) for name in names}

    @property
    def sizes(self) -> str:
        """The sizes, with units and 95 % intervals."""
        return sizes(self.parameters, self.explanation.parameters)

    @property
    def title(self) -> str:
        """Name of the cause in texts and figures."""
        return title_of(self.id)

    def data(self) -> dict[str, Any]:
        """Return the values for JSON."""
        left_out = ("explanation", "implausible")
        values = {each.name: getattr(self, each.name) for each in fields(self) if each.name not in left_out}
        names = ("value", "lower", "upper")
        parameters = {name: dict(zip(names, numbers, strict=True)) for name, numbers in self.parameters.items()}
        return {**values, "plausible": self.plausible, "vetoed": self.vetoed, "parameters": parameters}


@dataclass(frozen=True, kw_only=True)
class CampaignTexts:
    """What a campaign adds to what is shown of a verdict."""

    notes: tuple[str, ...] = ()
    """Notes on its files and unknowns."""
    lines: tuple[str, ...] = ()
    """Lines that add the best of the reported explanations to the file; empty where it cannot describe this."""
    path: str = ""
    """The campaign as it was named on the command line, for the commands of the next step."""


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class Verdict(Result):
    """Whether the model is adequate, and the causes that explain the data if it is not."""

    judgement: Judgement
    """The answer, the reported explanations and the reasons."""
    selection: Selection
    """All fits. Where the data are partly explained these allow for the discrepancy."""
    adequacy: Adequacy
    """Adequacy of the base, without a discrepancy."""
    discrepancy_fit: DiscrepancyFit | None = None
    """The base with its discrepancy, where no cause explains the data to the noise."""
    improvement: Improvement = field(default_factory=Improvement)
    """Improvement on held-out data, if requested."""
    next_measurement: ProposedMeasurement | None = None
    """The measurement that is proposed next."""
    data_reasons: tuple[Reason, ...] = ()
    """What is left out of the data, and what is said about them."""
    settings: dict[str, Any]
    """Settings that reproduce the run."""
    held_out: Model | None = None
    """Held-out measurements with their tolerances, if separate ones are used; then the fits do not include them."""
    interrupted: Reason | None = None
    """The step in which it was interrupted. If not all causes were tried, none is "named"."""
    provenance: Provenance = field(default_factory=Provenance)
    campaign: CampaignTexts = field(default_factory=CampaignTexts)
    """What its campaign adds."""

    heading = "Diagnosis"
    plotted_by = "receptance.diagnosis.figure:draw_diagnosis"

    @property
    def verdict(self) -> Answer:
        """The answer. "partly explained" is a cause that takes at least half of the misfit."""
        return self.judgement.answer

    @property
    def final(self) -> bool:
        """False after an interruption."""
        return self.interrupted is None

    @cached_property
    def reasons(self) -> tuple[Reason, ...]:
        """Reasons of the answer, and limits of the data."""
        run = [self.interrupted] if self.interrupted else []
        run += [Reason("fast_diagnosis")] if self.selection.fast else []
        return (*run, *self.judgement.reasons, *limits_of(self.selection), *self.data_reasons)

    def warnings(self) -> list[str]:
        """Return which records contradict each other or are copies, which makes everything else doubtful."""
        return [str(reason) for reason in self.reasons if reason.code in DOUBTFUL_DATA]

    @property
    def notes(self) -> tuple[str, ...]:
        """The other reasons, and the notes of the campaign, a sentence each."""
        others = (str(reason) for reason in self.reasons if reason.code not in DOUBTFUL_DATA)
        return tuple(dict.fromkeys([*others, *self.campaign.notes]))

    # Explanations.

    @property
    def explanation(self) -> Explanation | None:
        """The best of the reported explanations."""
        return next(iter(self.judgement.reported), None)

    @property
    def ambiguous_between(self) -> tuple[str, ...]:
        """Ids of the causes between which the data do not decide."""
        return self.judgement.ambiguous_between

    @cached_property
    def causes(self) -> tuple[CandidateCause, ...]:
        """The reported causes, the highest evidence first; none where the model is adequate or unexplained."""
        return self._causes_of(self.judgement.reported)

    @cached_property
    def candidates(self) -> tuple[CandidateCause, ...]:
        """Every cause alone, the highest evidence first."""
        singles = self._causes_of(self.selection.singles[: LEADING_CAUSES if self.selection.interrupted else None])
        return tuple(replace(cause, held_out=self.improvement.singles.get(cause.id)) for cause in singles)

    @cached_property
    def vetoed(self) -> tuple[CandidateCause, ...]:
        """Causes with at least the evidence of all plausible ones that are not reported for an implausible size.

        Another effect may act in their place. Each has its best explanation, and only the best few are listed. Those
        that are reported with an unusual size are not among them.
        """
        explanations = self.selection.explanations
        plausible = max((fitted.evidence for fitted in explanations if not fitted.implausible), default=0.0)
        least = max(self.threshold, plausible - MARGIN, 0.0)
        likely = [fitted for fitted in explanations if fitted.evidence > least and fitted.implausible]
        reported = {cause.id for cause in self.causes}
        return tuple(c for c in self._causes_of(likely, implausible=True) if c.id not in reported)[:LISTED]

    def _causes_of(
        self, explanations: Sequence[Explanation], *, implausible: bool = False
    ) -> tuple[CandidateCause, ...]:
        """Return each cause in its first explanation: all, or in the first one in which its size is implausible."""
        first: dict[str, CandidateCause] = {}
        for explanation in explanations:
            for variant in explanation.variants:
                id = variant.cause.id
                if id not in first and (not implausible or explanation.implausible_sizes(variant.cause)):
                    first[id] = _candidate(self.selection, explanation, variant)
        return tuple(first.values())

    @cached_property
    def alternatives(self) -> tuple[CandidateCause, ...]:
        """Changes that are not causes, the highest evidence first; see `receptance.diagnosis.catalogue`."""
        changes = self.selection.alternatives
        return tuple(_candidate(self.selection, change, change.variants[-1]) for change in changes)

    @property
    def alternative(self) -> CandidateCause | None:
        """The alternative because of which no cause is reported; it shows where the model is wrong."""
        preferred = self.judgement.alternative
        return next((cause for cause in self.alternatives if cause.explanation is preferred), None)

    @property
    def best_evidence(self) -> float:
        """Highest evidence of all explanations, that of the base (0) included."""
        return max([0.0, *(cause.evidence for cause in (*self.candidates, *self.causes))])

    @property
    def threshold(self) -> float:
        """Evidence that the best cause reaches by chance in one of a thousand diagnoses of an adequate model."""
        return self.selection.threshold

    @property
    def undecidable(self) -> dict[str, str]:
        """Causes that these data cannot show, and the reasons."""
        return {id: str(error) for id, error in self.selection.undecidable.items()}

    # Fits.

    @property
    def base_fit(self) -> Fit:
        """The base; it allows for the discrepancy, if there is one."""
        return self.selection.base if self.discrepancy_fit is None else self.discrepancy_fit.fit

    @property
    def discrepancy(self) -> Discrepancy | None:
        """Error of the base beside the noise, where no cause explains the data to the noise."""
        return None if self.discrepancy_fit is None else self.discrepancy_fit.discrepancy

    @property
    def discrepancy_after(self) -> Discrepancy | None:
        """The same of the extended model."""
        return self.selection.discrepancy

    @property
    def adequacy_after(self) -> Adequacy | None:
        """Adequacy of the best of the reported explanations; None with a discrepancy, with which every fit is."""
        return None if self.explanation is None or self.discrepancy is not None else self.explanation.adequacy

    @cached_property
    def base(self) -> Identification:
        """The fitted base as `identify` states it: where it is not adequate, its intervals include the discrepancy."""
        fit = self.discrepancy_fit
        return _allowing_for_discrepancy(self.base_fit) if fit is None else _with_discrepancy(fit)

    @property
    def extended(self) -> Identification | None:
        """The fitted model of the best of the reported explanations; None where no cause is reported."""
        return None if self.explanation is None else self.explanation.fit.identification

    @cached_property
    def _predicting(self) -> Identification:
        """The fit of the predictions: of the best of the reported explanations, or of the base."""
        if self.explanation is None:
            return self.base
        fit = self.explanation.fit
        return _allowing_for_discrepancy(fit) if self.discrepancy is None else fit.identification

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
        identified, discrepancy = self._predicting, self.discrepancy_after or self.discrepancy
        relative = np.inf if self.verdict == "unexplained" else 0.0
        if identified.discrepancy is not None:
            relative = 0.0  # its predictions have the discrepancy
        elif discrepancy is not None:
            relative = discrepancy.frequency
        return AveragedAssembly(
            selection=self.selection,
            reported=self.explanation,
            identified=identified,
            site=Site(assembly, configuration, "", conditions or {}),
            tolerances=tolerances,
            discrepancy=relative,
        )

    # Errors.

    @property
    def gains(self) -> tuple[Gain, ...]:
        """Improvement on held-out data, if requested: of spectra, frequencies, log score and user-defined metrics."""
        return self.improvement.gains

    @property
    def gain(self) -> Gain | None:
        """The first of the gains: of the spectra, or of natural frequencies where only these were measured."""
        return next(iter(self.gains), None)

    @property
    def bias(self) -> Bias | None:
        """Held-out natural frequencies in which the errors of the base have a common sign."""
        return self.improvement.bias

    @cached_property
    def modes(self) -> tuple[ModeResidual, ...]:
        """Residuals of the base by mode; empty after an interruption, because fits of circles take seconds."""
        return residuals_by_mode(self.base_fit) if self.final else ()

    @cached_property
    def modes_after(self) -> tuple[ModeResidual, ...]:
        """Residuals of the best of the reported explanations by mode; empty where none is, and as `modes`."""
        return residuals_by_mode(self.explanation.fit) if self.final and self.explanation is not None else ()

    def frequency_errors(self) -> list[dict[str, Any]]:
        """Return modelled less measured natural frequencies in percent, before and after, by mode."""
        before = residuals_by_mode(self.base_fit, of_receptances=False)
        after = before if self.explanation is None else residuals_by_mode(self.explanation.fit, of_receptances=False)
        names = ("label", "mode", "measured_hz", "before", "after")
        return [
            dict(zip(names, (b.label, b.mode, b.measured_hz, b.frequency_percent, a.frequency_percent), strict=True))
            for b, a in zip(before, after, strict=True)
        ]

    # What `receptance.report` renders.

    @property
    def badge(self) -> str:
        """The answer."""
        return self.verdict if self.final else f"{self.verdict} (not final)"

    def facts(self) -> list[Fact]:
        """Return the answer: verdict, causes with sizes and remedies."""
        return diagnosis.presentation.facts(self)

    def key_figures(self) -> list[tuple[str, Sequence[str]]]:
        """Return the size of the first cause, and errors before and after."""
        return diagnosis.presentation.key_figures(self)

    def tables(self) -> list[Table]:
        """Return the effect of the causes, the alternatives, and the modes with the largest errors."""
        return diagnosis.presentation.tables(self)

    def sections(self) -> list[PageSection]:
        """Return held-out and fitted data, before and after, all causes, and settings."""
        return diagnosis.presentation.sections(self)

    @property
    def next_step(self) -> str:
        """The measurement or the command that follows."""
        return diagnosis.presentation.next_step(self)

    def data(self) -> dict[str, Any]:
        """Return answer, reasons, causes, candidates, improvement and residuals by mode."""
        same = ["verdict", "final", "reasons", "ambiguous_between", "gain", "gains", "next_measurement", "threshold"]
        same += ["adequacy", "adequacy_after", "undecidable", "settings"]
        lists = ("causes", "candidates", "vetoed", "alternatives")
        return {
            "measurements": [observation.label for observation in self.selection.base.model.observations],
            **{name: getattr(self, name) for name in same},
            **{name: [cause.data() for cause in getattr(self, name)] for name in lists},
            "alternative": None if self.alternative is None else self.alternative.data(),
            "discrepancy": {"before": self.discrepancy, "after": self.discrepancy_after},
            "base": self.base.values,
            "extended": None if self.extended is None else self.extended.values,
            "residuals_by_mode": {"before": self.modes, "after": self.modes_after if self.explanation else None},
            "held_out_by_mode": {"before": self.improvement.modes, "after": self.improvement.modes_after},
            "bias": None if self.bias is None else {**asdict(self.bias), "text": str(self.bias)},
            "frequency_errors_percent": self.frequency_errors(),
        }

    def __repr__(self) -> str:
        names = ", ".join(cause.id for cause in self.causes)
        open_ = "" if self.final else ", not final"
        return f"Verdict({self.verdict}{open_}{': ' + names if names else ''}; misfit {self.adequacy.misfit:.2f})"


def _candidate(selection: Selection, explanation: Explanation, variant: Variant) -> CandidateCause:
    """Return a cause of an explanation."""
    cause, fit = variant.cause, explanation.fit
    return CandidateCause(
        id=cause.id,
        group=cause.group,
        variant=variant.name,
        explanation=explanation,
        gain=explanation.gain,
        evidence=explanation.evidence,
        misfit=fit.misfit,
        implausible=tuple(explanation.implausible_sizes(cause)),
        converged=fit.converged,
        together_with=tuple(other.cause.id for other in explanation.variants if other.cause.id != cause.id),
        look_alikes=look_alikes(selection.directions, variant),
        meaning=variant.meaning,
        remedy=(fit.model.in_spindle and cause.remedy_in_spindle) or variant.remedy,
    )


def _allowing_for_discrepancy(fit: Fit) -> Identification:
    """Return a fit as `identify` states it: with a discrepancy where its data do not show that it has none."""
    if not (fit.adequacy.needs_discrepancy and fit.converged):
        return fit.identification
    try:
        return _with_discrepancy(sufficient(fit_discrepancy(fit.model.resonant(), fit.values)))
    except ReceptanceError:
        return fit.identification


def _with_discrepancy(widened: DiscrepancyFit) -> Identification:
    identification = widened.fit.identification
    return replace(identification, task=replace(identification.task, discrepancy=widened.discrepancy))
