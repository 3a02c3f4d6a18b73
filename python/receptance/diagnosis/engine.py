"""The diagnosis: selection of lines, selection of causes, judgement, advice, improvement on held-out data."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from receptance import _checks
from receptance.diagnosis.advice import ProposedMeasurement, advise
from receptance.diagnosis.catalogue import resolve_causes
from receptance.diagnosis.causes import Cause, extend
from receptance.diagnosis.discrepancy_search import select_with_discrepancy
from receptance.diagnosis.explanation import Explanation, Selection
from receptance.diagnosis.fitting import DiscrepancyFit, fit_discrepancy, refit, sufficient
from receptance.diagnosis.held_out import (
    FREQUENCIES,
    SCORE,
    SPECTRAL,
    Improvement,
    Metric,
    count_folds,
    cross_validate,
    doubted,
    improvement_on,
)
from receptance.diagnosis.judgement import Judgement, conclude, confirmed
from receptance.diagnosis.measured_data import contradictions, copies, select_lines, with_table_noise
from receptance.diagnosis.model import Model, UndecidableError
from receptance.diagnosis.progress import Progress
from receptance.diagnosis.search import select
from receptance.diagnosis.text import Reason
from receptance.diagnosis.thresholds import BEYOND_NOISE, EXPLORING_LINES
from receptance.diagnosis.truncation import record_ends
from receptance.diagnosis.unknown_spindle import ChooseModes
from receptance.diagnosis.verdict import Verdict
from receptance.errors import ReceptanceError
from receptance.fit.observation import Observation, altered
from receptance.fit.problem import one_blas_thread
from receptance.fit.unknowns import Tolerance, Unknowns, as_unknowns


@one_blas_thread()
def diagnose(
    observations: Observation | Sequence[Observation],
    unknowns: Unknowns,
    *,
    tolerances: Tolerance | Sequence[Tolerance] = (),
    causes: Iterable[Cause | str] | None = None,
    seed: int = 0,
    threads: int | None = None,
    held_out: bool | Model = False,
    fast: bool = False,
    max_causes: int = 2,
    metrics: Mapping[str, Metric] | None = None,
    progress: Callable[[str], None] | None = None,
    choose_modes: ChooseModes | None = None,
) -> Verdict:
    """Test whether a model is adequate for the measured data, and find the causes that explain them if it is not.

    Parameters
    ----------
    observations : sequence of Observation
        Measurements with standard deviations, best of several configurations; force levels are the condition "force".
    unknowns : sequence of Unknown and Law, or mapping of str to bounds
        Unknowns of the base model: the joint; as in `identify`.
    tolerances : sequence of Tolerance
        Errors of dimensions, materials and clampings, as in `identify`. Without them ordinary deviations are mistaken
        for causes.
    causes : sequence of Cause and str, optional
        Causes or their ids; by default the `CATALOGUE`.
    seed : int, optional
        Seed of all random numbers.
    threads : int, optional
        As in `Assembly.receptance`; it does not change the result.
    held_out : bool or Model, optional
        Whether the improvement is measured by cross-validation, with the choice among the explanations repeated without
        each configuration. With a model on its observations, which are not fitted, with its tolerances.
    fast : bool, optional
        Whether the tests that take most of the time are left out: configurations are not left out in turn, changes of
        the structure that imitate a cause are not fitted, and no model discrepancy is estimated. No cause is named.
    max_causes : int, optional
        Largest number of causes that act together.
    metrics : mapping of str to callable, optional
        With `held_out`: user-defined errors of a prediction, by name. Each gets a `receptance.diagnosis.HeldOut` and
        returns a number, smaller where the prediction is better.
    progress : callable, optional
        Called with one line of text at the start of each step: its number, the expected number of steps, the remaining
        time, the leading explanation, and the step. The expected number is an estimate that later steps correct.
    choose_modes : callable, optional
        Chooses the modes of unknown spindles: gets a model with causes, of which the unknowns have the modes that were
        chosen without one, and a choice (`unknown_spindle.MODE_CHOICES`), and returns it with those beside these
        causes. Modes chosen from records that a cause has changed hide it.

    Returns
    -------
    Verdict
        The answer, the reported causes with sizes and evidence, the fitted models, and advice. A KeyboardInterrupt ends
        the diagnosis with the results so far, and `Verdict.final` is then False. A second one is raised.

    Raises
    ------
    TypeError, ValueError
        As `identify`; observations without standard deviations; unknown causes.

    Examples
    --------
    >>> from receptance import CARBIDE, STEEL, Assembly, Observation, Part, PointJoint, PointMass, Segment
    >>> from receptance.diagnosis import diagnose
    >>> def assembled(overhang, *masses):
    ...     tool = Part([Segment(length=overhang, outer_diameter=0.012, material=CARBIDE)], name="tool")
    ...     holder = Part([Segment(length=0.13, outer_diameter=0.045, material=STEEL)], name="holder")
    ...     joint = PointJoint(k_y=6e8, k_theta=1e5, c_y=300.0, c_theta=1.0, name="joint")
    ...     return Assembly([tool, joint, holder], masses)
    >>> def measured(overhang):
    ...     true = assembled(overhang, PointMass(mass=1e-3)).natural_frequencies(15e3)[:2]
    ...     return Observation.from_modes(assembly=assembled(overhang), frequency_hz=true, standard_deviation_hz=1.0)
    >>> joint = {"joint.k_y": (1e6, 1e11), "joint.k_theta": (1e2, 1e8)}
    >>> observations = [measured(overhang) for overhang in (0.04, 0.05, 0.06, 0.07, 0.09)]
    >>> verdict = diagnose(observations, joint, causes=["sensor_mass", "tool_modulus"], max_causes=1)
    >>> verdict.verdict, [cause.id for cause in verdict.causes]
    ('named', ['sensor_mass'])
    """
    unknowns = as_unknowns(unknowns)
    tolerances = (tolerances,) if isinstance(tolerances, Tolerance) else tuple(tolerances)
    observed = _check_observations(observations)
    max_causes = _checks.whole_number("diagnose", "max_causes", max_causes)
    metrics = _check_metrics(metrics)
    catalogue = resolve_causes(causes)
    _checks.thread_count(threads)
    model, table_reasons = with_table_noise(Model(observed, unknowns, tolerances, seed=seed, threads=threads))
    model, line_reasons = select_lines(model)
    model = model.with_shared_assemblies().with_witnesses()
    report = Progress(progress)
    folds = count_folds(model) if held_out is True and not fast else 0
    report.plan("held out", folds)
    # 1. The outcome without a discrepancy, and with one where nothing explains the data to their noise.
    selection = select(model, catalogue, max_causes=max_causes, progress=report, fast=fast, choose_modes=choose_modes)
    outcome = plain = _Outcome.of(selection, report)
    if plain.judgement.answer == "unexplained" and not (plain.judgement.alternative or fast or plain.interrupted):
        outcome = _with_discrepancy(plain, catalogue, max_causes, report, threads)
    # 2. Its improvement on held-out data.
    improvement, interrupted = Improvement(), outcome.interrupted
    if not interrupted:
        if isinstance(held_out, Model):
            held_out = replace(
                outcome.selection.base.model,
                observations=held_out.observations,
                # Held-out records may end at another time, or not at all.
                ends=record_ends(held_out.receptances),
                tolerances=held_out.tolerances,
            )
            try:
                improvement = improvement_on(outcome.selection, held_out, metrics)
            except KeyboardInterrupt:
                improvement = Improvement(complete=False)
        elif folds:
            improvement = cross_validate(outcome.selection, metrics, report)
        if not improvement.complete:
            interrupted = Reason("interrupted", report.position)
    # 3. One verdict; a cause with a discrepancy that held-out data contradict is not reported.
    judgement = doubted(outcome.judgement, outcome.selection.base, improvement)
    if outcome.judgement.answer == "partly explained" and judgement.answer == "unexplained":
        judgement = replace(plain.judgement, reasons=(*plain.judgement.reasons, judgement.reasons[-1]))
        outcome = replace(plain, discrepancy_fit=outcome.discrepancy_fit)
    if outcome.selection.interrupted and judgement.answer in ("named", "unexplained"):
        # Another cause, which was not tried, may have more evidence.
        judgement = replace(judgement, answer="suspected" if judgement.answer == "named" else "undecided")
    return Verdict(
        judgement=judgement,
        selection=outcome.selection,
        adequacy=plain.selection.base.adequacy if outcome.selection.discrepancy else outcome.selection.base.adequacy,
        discrepancy_fit=outcome.discrepancy_fit,
        improvement=improvement,
        next_measurement=outcome.next_measurement,
        data_reasons=(
            *copies((*model.observations, *(held_out.observations if isinstance(held_out, Model) else ()))),
            *contradictions(model.observations),
            *table_reasons,
            *line_reasons,
        ),
        settings=_settings(outcome.selection, max_causes, interrupted),
        held_out=held_out if isinstance(held_out, Model) else None,
        interrupted=interrupted,
    )


@dataclass(frozen=True)
class _Outcome:
    """A selection, without a discrepancy or with one, and what follows from it; fields as of `Verdict`."""

    selection: Selection
    judgement: Judgement
    next_measurement: ProposedMeasurement | None = None
    discrepancy_fit: DiscrepancyFit | None = None
    interrupted: Reason | None = None

    @classmethod
    def of(cls, selection: Selection, report: Progress) -> _Outcome:
        """Return the outcome of a selection, with advice."""
        judgement = conclude(selection)
        if selection.interrupted:
            return cls(selection, judgement, interrupted=Reason("causes_not_tried", report.position))
        try:
            return cls(selection, judgement, advise(selection, judgement))
        except KeyboardInterrupt:
            return cls(selection, judgement, interrupted=Reason("interrupted", report.position))


def _check_metrics(metrics: Mapping[str, Metric] | None) -> dict[str, Metric]:
    for name, metric in (metrics or {}).items():
        if not isinstance(name, str) or not callable(metric):
            raise TypeError(f"metrics has {name!r}: {metric!r}, expected a name and a function")
        if name in (FREQUENCIES, SPECTRAL, SCORE):
            raise ValueError(f"the metric {name!r} exists already, expected another name")
    return dict(metrics or {})


def _check_observations(observations: Observation | Sequence[Observation]) -> tuple[Observation, ...]:
    checked = _checks.items("observations", observations, Observation, least=1)
    for observation in checked:
        if not observation.weighted:
            remedy = "give `standard_deviation` or `floor`, or coherence and `averages` of an FRF"
            raise ValueError(
                f"{observation!r} has no standard deviation, which the diagnosis needs to judge the residuals; "
                f"{observation.noise.unused_coherence or remedy}"
            )
    # Causes of single records need their names.
    return tuple(
        altered(each, configuration=each.site(i).configuration, label=each.title(i)) for i, each in enumerate(checked)
    )


def _with_discrepancy(
    plain: _Outcome, catalogue: Sequence[Cause], max_causes: int, report: Progress, threads: int | None
) -> _Outcome:
    """Return the outcome where no cause explains the data to their noise: with the discrepancy of the model.

    Fits that allow for a discrepancy have fewer local minima. Where the best cause explains the data to their noise
    after all, the selection without a discrepancy is repeated from it.
    """
    first, base, again = plain.selection, None, None
    try:
        base = fit_discrepancy(replace(first.base.model.resonant(), threads=threads), first.base.values)
        selection, base = select_with_discrepancy(base, first, catalogue, report)
        judgement = confirmed(conclude(selection), first)
        beginning = None if selection.interrupted else _fitted_to_the_noise(first, selection.best)
        if beginning is not None:
            again = select(first.base.model, catalogue, max_causes=max_causes, progress=report, beginning=beginning)
    except ReceptanceError:
        return plain
    except KeyboardInterrupt:
        return replace(plain, discrepancy_fit=base, interrupted=Reason("interrupted", report.position))
    if selection.interrupted or (again is not None and again.interrupted):
        return replace(plain, discrepancy_fit=base, interrupted=Reason("interrupted", report.position))
    if again is not None:
        repeated = _Outcome.of(again, report)
        if repeated.judgement.answer != "unexplained":
            return repeated
    if first.base.misfit >= BEYOND_NOISE and judgement.answer == "partly explained":
        return replace(_Outcome.of(selection, report), judgement=judgement, discrepancy_fit=base)
    reasons = plain.judgement.reasons
    if first.base.misfit >= BEYOND_NOISE:
        reasons = (*reasons, *(reason for reason in judgement.reasons if reason not in reasons))
    return replace(plain, judgement=replace(plain.judgement, reasons=reasons), discrepancy_fit=sufficient(base))


def _fitted_to_the_noise(first: Selection, best: Explanation | None) -> Explanation | None:
    """Return the best explanation beside a discrepancy, fitted without one.

    None is returned where it is not adequate, or was found without a discrepancy already.
    """
    if best is None or any(explanation.passed and explanation.ids == best.ids for explanation in first.explanations):
        return None
    try:
        explanation = first.explain(best.variants, refit(extend(first.base.model, best.variants), best.fit.values))
    except (ReceptanceError, UndecidableError):
        return None
    return explanation if explanation.passed else None


def _settings(selection: Selection, max_causes: int, interrupted: Reason | None) -> dict[str, Any]:
    """Return settings and amount of calculation, with the loss by the selection of few lines."""
    model = selection.base.model
    fits = [selection.base, *(explanation.fit for explanation in selection.explanations[:1])]
    return {
        "seed": model.seed,
        "max_causes": max_causes,
        "lines": sum(observation.frequency_hz.size for observation in model.observations),
        "lines_of_each_while_exploring": EXPLORING_LINES,
        "regained_on_all_lines": round(max(fit.regained for fit in fits), 1),
        "model_evaluations": selection.evaluations,
        "causes": sorted({direction.cause.id for direction in selection.directions} | set(selection.undecidable)),
        **({"fast": True} if selection.fast else {}),
        **({"interrupted": interrupted.values} if interrupted else {}),
    }
