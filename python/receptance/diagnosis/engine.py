"""The diagnosis: selection of lines, selection of causes, judgement, advice, improvement on held-out data."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from receptance import _checks
from receptance.diagnosis.advice import advise
from receptance.diagnosis.beside_discrepancy import select_beside
from receptance.diagnosis.catalogue import resolve_causes
from receptance.diagnosis.causes import Cause, Variant, extend
from receptance.diagnosis.contradictions import contradictions
from receptance.diagnosis.explanation import Explanation, Selection
from receptance.diagnosis.findings import CandidateCause
from receptance.diagnosis.fitting import fit_discrepancy, refit, sufficient
from receptance.diagnosis.held_out import FREQUENCIES, SCORE, SPECTRAL, Metric, count_folds, cross_validate
from receptance.diagnosis.judgement import Judgement, conclude
from receptance.diagnosis.line_selection import select_lines
from receptance.diagnosis.model import DATA_HOLDER, TABLE, Model, UndecidableError
from receptance.diagnosis.progress import Progress
from receptance.diagnosis.screening import Direction, look_alike
from receptance.diagnosis.search import select
from receptance.diagnosis.table_noise import with_table_noise
from receptance.diagnosis.thresholds import (
    BEYOND_NOISE,
    EXPLORING_LINES,
    KEPT_ON_INTERRUPT,
    LISTED,
    LOOK_ALIKE,
    MARGIN,
)
from receptance.diagnosis.unknown_spindle import ChooseModes
from receptance.diagnosis.verdict import Verdict
from receptance.diagnosis.wording import implausible
from receptance.errors import ReceptanceError
from receptance.fit.observation import Observation, altered
from receptance.fit.problem import one_blas_thread
from receptance.fit.unknowns import Tolerance, Unknowns, as_unknowns

_FAST = (
    "fast diagnosis: configurations were not left out in turn, changes that imitate a cause were not fitted, and no "
    "discrepancy was estimated; diagnose without --fast before you rely on the cause"
)


@one_blas_thread()
def diagnose(
    observations: Observation | Sequence[Observation],
    unknowns: Unknowns,
    *,
    tolerances: Tolerance | Sequence[Tolerance] = (),
    causes: Iterable[Cause | str] | None = None,
    seed: int = 0,
    threads: int | None = None,
    held_out: bool = False,
    fast: bool = False,
    most: int = 2,
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
    held_out : bool, optional
        Whether the improvement is measured by cross-validation, with the choice among the explanations repeated without
        each configuration.
    fast : bool, optional
        Whether the tests that take most of the time are left out: configurations are not left out in turn, changes of
        the structure that imitate a cause are not fitted, and no discrepancy is estimated. No cause is named then.
    most : int, optional
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
    >>> import numpy as np
    >>> from receptance import CARBIDE, STEEL, Assembly, Observation, Part, PointJoint, PointMass, Segment, Unknown
    >>> from receptance.diagnosis import diagnose
    >>> lines = np.linspace(200.0, 6000.0, 400)
    >>> def assembled(overhang, *masses):
    ...     tool = Part([Segment(length=overhang, outer_diameter=0.012, material=CARBIDE)], name="tool")
    ...     holder = Part([Segment(length=0.13, outer_diameter=0.045, material=STEEL)], name="holder")
    ...     joint = PointJoint(k_y=6e8, k_theta=1e5, c_y=300.0, c_theta=1.0, name="joint")
    ...     return Assembly([tool, joint, holder], masses)
    >>> rng = np.random.default_rng(1)
    >>> observations = [
    ...     Observation(
    ...         assembly=assembled(overhang),
    ...         frequency_hz=lines,
    ...         receptance=assembled(overhang, PointMass(mass=1e-3)).receptance(lines)
    ...         * np.exp(0.01 * (rng.normal(size=400) + 1j * rng.normal(size=400))),
    ...         standard_deviation=0.01,
    ...         label=f"{overhang}",
    ...     )
    ...     for overhang in (0.05, 0.07, 0.09)
    ... ]
    >>> joint = [
    ...     Unknown(address="joint.k_y", lower=1e6, upper=1e11),
    ...     Unknown(address="joint.k_theta", lower=1e2, upper=1e8),
    ...     Unknown(address="joint.c_y", lower=1e-1, upper=1e6),
    ...     Unknown(address="joint.c_theta", lower=1e-4, upper=1e3),
    ... ]
    >>> verdict = diagnose(observations, joint, causes=["sensor_mass", "calibration_gain", "tool_modulus"], most=1)
    >>> verdict.verdict, [one.id for one in verdict.causes]
    ('named', ['sensor_mass'])
    """
    unknowns = as_unknowns(unknowns)
    tolerances = (tolerances,) if isinstance(tolerances, Tolerance) else tuple(tolerances)
    observed = _check_observations(observations)
    if isinstance(most, bool) or not isinstance(most, (int, np.integer)) or most < 1:
        raise ValueError(f"most is {most!r}, expected a whole number of at least 1")
    metrics = _check_metrics(metrics)
    catalogue = resolve_causes(causes)
    _checks.thread_count(threads)
    model, table_notes = with_table_noise(Model(observed, unknowns, tolerances, seed=seed, threads=threads))
    model, line_notes = select_lines(model)
    line_notes = (*table_notes, *line_notes)
    model = model.with_shared_assemblies().with_witnesses()
    report = Progress(progress)
    held_out = held_out and not fast
    report.plan("held out", count_folds(model) if held_out else 0)
    selection = select(model, catalogue, most=most, progress=report, fast=fast, choose_modes=choose_modes)
    verdict = _verdict(selection, conclude(selection), most, line_notes, report)
    if verdict.verdict == "unexplained" and verdict.final and not fast and verdict.alternative is None:
        verdict = _beside_discrepancy(verdict, catalogue, most, line_notes, report, model.threads)
        selection = verdict.selection
    # No model explains both of two records that contradict each other.
    verdict = replace(verdict, notes=(*map(str, contradictions(model.observations)), *verdict.notes))
    if not held_out or not verdict.final:
        return verdict
    improvement = cross_validate(selection, metrics=metrics, progress=report)
    if not improvement.complete:
        verdict = verdict.interrupt(report.position, tried=True)
    return verdict.with_improvement(improvement)


def _check_metrics(metrics: Mapping[str, Metric] | None) -> dict[str, Metric]:
    given = dict(metrics or {})
    for name, metric in given.items():
        if not isinstance(name, str) or not callable(metric):
            raise TypeError(f"metrics has {name!r}: {metric!r}, expected a name and a function")
        if name in (FREQUENCIES, SPECTRAL, SCORE):
            raise ValueError(f"the metric {name!r} exists already, expected another name")
    return given


def _check_observations(observations: Observation | Sequence[Observation]) -> tuple[Observation, ...]:
    given = (observations,) if isinstance(observations, Observation) else tuple(observations)
    if not given:
        raise ValueError("observations is empty, expected at least one Observation")
    for index, one in enumerate(given):
        if not isinstance(one, Observation):
            raise TypeError(f"observations[{index}] is {one!r}, expected an Observation")
        if not one.weighted:
            remedy = "give `standard_deviation` or `floor`, or coherence and `averages` of an FRF"
            raise ValueError(
                f"{one!r} has no standard deviation, which the diagnosis needs to judge the residuals; "
                f"{one.noise.unused_coherence or remedy}"
            )
    # Causes of single records need their names.
    return tuple(
        altered(one, configuration=one.site(i).configuration, label=one.title(i)) for i, one in enumerate(given)
    )


def _beside_discrepancy(
    verdict: Verdict,
    catalogue: Sequence[Cause],
    most: int,
    line_notes: Sequence[str],
    report: Progress,
    threads: int | None,
) -> Verdict:
    """Return the verdict where no cause explains the data to their noise: with the discrepancy of the model.

    Fits that allow for a discrepancy have fewer local minima. Where the best cause explains the data to their noise
    after all, the selection without a discrepancy is repeated from it.
    """
    first, base = verdict.selection, None
    try:
        base = fit_discrepancy(replace(first.base.model.resonant(), threads=threads), first.base.values)
        selection, base = select_beside(base, first, catalogue, report)
        judgement = conclude(selection)
        known = None if selection.interrupted else _fitted_to_the_noise(first, selection.best)
        again = None
        if known is not None:
            again = select(first.base.model, catalogue, most=most, progress=report, known=known)
    except ReceptanceError:
        return verdict
    except KeyboardInterrupt:
        verdict = verdict.interrupt(report.position, tried=True)
        return verdict if base is None else replace(verdict, discrepancy=base.discrepancy, base_fit=base.fit)
    if selection.interrupted or (again is not None and again.interrupted):
        verdict = verdict.interrupt(report.position, tried=True)
        return replace(verdict, discrepancy=base.discrepancy, base_fit=base.fit)
    if again is not None:
        repeated = _verdict(again, conclude(again), most, line_notes, report)
        if repeated.verdict != "unexplained":
            return repeated
    posterior = sufficient(base)
    unexplained = replace(verdict, discrepancy=posterior.discrepancy, base_fit=posterior.fit)
    if first.base.misfit < BEYOND_NOISE:
        return unexplained
    notes = tuple(dict.fromkeys((*verdict.notes, *judgement.notes)))
    if judgement.answer != "partly explained":
        return replace(unexplained, notes=notes)
    # Reasons against causes without a discrepancy may contradict the answer beside it.
    overruled = conclude(first).notes
    notes = tuple(note for note in notes if note not in overruled)
    found = _verdict(selection, replace(judgement, notes=notes), 1, (), report)
    return replace(
        found,
        adequacy=verdict.adequacy,
        base_fit=base.fit,
        discrepancy=base.discrepancy,
        discrepancy_after=selection.discrepancy,
        without_discrepancy=verdict,
    )


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


def _verdict(
    selection: Selection, judgement: Judgement, most: int, line_notes: Sequence[str], report: Progress
) -> Verdict:
    interrupted = selection.interrupted
    next_measurement = None
    if not interrupted:
        try:
            next_measurement = advise(selection, judgement)
        except KeyboardInterrupt:
            interrupted = True
    reported: dict[str, CandidateCause] = {}
    for one in judgement.reported:
        for variant in one.variants:
            if variant.cause.id not in reported:
                reported[variant.cause.id] = _candidate(selection, one, variant)
    alternatives = {
        alternative: _candidate(selection, alternative, alternative.variants[-1])
        for alternative in selection.alternatives
    }
    singles = selection.singles[: KEPT_ON_INTERRUPT if interrupted else None]
    verdict = Verdict(
        verdict=judgement.answer,
        adequacy=selection.base.adequacy,
        base_fit=selection.base,
        causes=tuple(reported.values()),
        candidates=tuple(_candidate(selection, single, single.variants[0]) for single in singles),
        ambiguous_between=judgement.ambiguous_between,
        next_measurement=next_measurement,
        notes=(*([_FAST] if selection.fast else []), *judgement.notes, *_data_notes(selection), *line_notes),
        settings=_settings(selection, most),
        selection=selection,
        vetoed=tuple(_candidate(selection, one, variant) for one, variant in _vetoed(selection, judgement.reported)),
        alternatives=tuple(alternatives.values()),
        alternative=None if judgement.alternative is None else alternatives[judgement.alternative],
        explanation=judgement.reported[0] if judgement.reported else None,
    )
    return verdict.interrupt(report.position, tried=not selection.interrupted) if interrupted else verdict


def _vetoed(selection: Selection, reported: Sequence[Explanation]) -> list[tuple[Explanation, Variant]]:
    """Return implausible causes with at least the evidence of the best plausible explanation, less the margin.

    Each cause is returned once, in its best explanation, and only the best few are. Those that are reported with an
    unusual size are not among them.
    """
    plausible = max(
        (explanation.evidence for explanation in selection.explanations if not explanation.implausible), default=0.0
    )
    least = max(selection.threshold, plausible - MARGIN, 0.0)
    found: dict[str, tuple[Explanation, Variant]] = {}
    ids = frozenset().union(*(one.ids for one in reported))
    for one in selection.explanations:
        for variant in one.variants if one.evidence > least else ():
            if variant.cause.id not in ids and set(one.sizes(variant.cause)) & set(one.implausible):
                found.setdefault(variant.cause.id, (one, variant))
    return list(found.values())[:LISTED]


def _candidate(selection: Selection, one: Explanation, variant: Variant) -> CandidateCause:
    cause = variant.cause
    sizes = one.sizes(cause)
    declared = {name: one.parameters[name] for name in sizes}
    outside = {name: size for name, size in sizes.items() if name in one.implausible}
    return CandidateCause(
        id=cause.id,
        group=cause.group,
        variant=variant.name,
        explanation=one,
        gain=one.gain,
        evidence=one.evidence,
        misfit=one.fit.misfit,
        plausible=not outside,
        vetoed=implausible(declared, outside),
        converged=one.fit.converged,
        together_with=tuple(other.cause.id for other in one.variants if other.cause.id != cause.id),
        look_alikes=_look_alikes(selection.directions, variant),
        meaning=variant.meaning,
        remedy=(one.fit.model.in_spindle and cause.remedy_in_spindle) or variant.remedy,
        declared=declared,
    )


def _look_alikes(directions: Sequence[Direction], variant: Variant) -> dict[str, float]:
    """Return the causes with a similar effect, and the largest cosine of each, in descending order."""
    own = next((direction for direction in directions if direction.variant == variant), None)
    if own is None:
        return {}
    cosines: dict[str, float] = {}
    for other in directions:
        if other.cause.id != variant.cause.id and other.slopes.shape[1] <= own.slopes.shape[1]:
            cosines[other.cause.id] = max(cosines.get(other.cause.id, 0.0), look_alike(own, other))
    similar = sorted(cosines.items(), key=lambda pair: -pair[1])
    return {other: round(cosine, 4) for other, cosine in similar if cosine >= LOOK_ALIKE}


def _data_notes(selection: Selection) -> list[str]:
    model = selection.base.model
    notes = []
    if not model.tolerances:
        notes.append(
            "there are no tolerances: an ordinary deviation of a dimension or a material may be mistaken for a cause"
        )
    if len(model.configurations) == 1:
        sources, another = model.separable
        notes.append(f"there is one configuration: measure {another} to distinguish {sources}")
    if selection.base.one_mode:
        notes.append("there is one mode in each record: measure up to a second one to distinguish joint and parts")
    for reason, remedy in (
        (DATA_HOLDER, "if the holder may have changed since it was measured, measure it again"),
        (TABLE, "describe that part by modes to decide them"),
    ):
        not_decided = [id for id, error in selection.undecidable.items() if error.shared == reason]
        if not_decided:
            notes.append(f"{reason}, so these causes are not decided: {', '.join(not_decided)}; {remedy}")
    frequencies = [observation for observation in model.observations if not observation.is_receptance]
    if len(frequencies) == len(model.observations):
        hidden = (
            "gain, delay and hits"
            if any(observation.damped.size for observation in frequencies)
            else "damping, gain, delay and hits"
        )
        notes.append(f"there are natural frequencies alone: they do not show {hidden}")
    elif frequencies:
        notes.append("gain, delay, window and hits are judged by the FRFs alone: natural frequencies do not show them")
    return notes


def _settings(selection: Selection, most: int) -> dict[str, Any]:
    """Return settings and amount of calculation, with the loss by the selection of few lines."""
    model = selection.base.model
    fits = [selection.base, *(explanation.fit for explanation in selection.explanations[:1])]
    return {
        "seed": model.seed,
        "most": most,
        "lines": sum(observation.frequency_hz.size for observation in model.observations),
        "lines_of_each_while_exploring": EXPLORING_LINES,
        "regained_on_all_lines": round(max(fit.regained for fit in fits), 1),
        "model_evaluations": selection.evaluations,
        "causes": sorted({direction.cause.id for direction in selection.directions} | set(selection.undecidable)),
        **({"fast": True} if selection.fast else {}),
    }
