"""Identification, inverse coupling, transfer, next measurement and diagnosis of a campaign.

Each function passes the measurements of a campaign to a function of the library, and returns its result with the
campaign as provenance. Mistakes are reported with the file and the key.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal

from receptance._text import did_you_mean, one_of
from receptance.campaign.problems import CampaignError, Problem
from receptance.campaign.quantities import parse_share
from receptance.campaign.series import LEAST_LEVELS, over_levels, started_by_level
from receptance.campaign.tolerances import tolerances_of, tolerances_of_measurements
from receptance.errors import ReceptanceError
from receptance.identification import (
    Candidate,
    Identification,
    InverseCoupling,
    InverseCouplings,
    MeasuredFRF,
    NextMeasurement,
    Transfer,
    Unknown,
    identify,
    invert_coupling,
    next_measurement,
    transfer,
)
from receptance.identification.laws import Law
from receptance.identification.observations import Observation
from receptance.identification.pointwise_joint import TERMS
from receptance.model.joints import PointJoint
from receptance.model.terminals import ModalPart

if TYPE_CHECKING:
    from receptance.campaign.campaign import Campaign
    from receptance.campaign.measurements import Measurement
    from receptance.diagnosis import Cause, Metric, Verdict
    from receptance.diagnosis.model import Model
    from receptance.identification import Identification
    from receptance.identification.laws import Tolerance
    from receptance.identification.next_measurement import Target

__all__ = [
    "campaign_model",
    "diagnose_campaign",
    "fit_options",
    "identify_campaign",
    "invert_campaign",
    "observed_unknowns",
    "rank_candidates",
    "transfer_campaign",
    "weighable_tolerances",
]

_ORDER = ("k_theta", "k_y", "k_ytheta")
"""Terms of a joint in the order in which they are solved for if there are fewer FRFs than terms."""


def identify_campaign(
    campaign: Campaign, *, threads: int | None = None, progress: Callable[[str], None] | None = None
) -> Identification:
    """Identify the unknowns of a campaign; see `Campaign.identify`."""
    say = progress or (lambda _: None)
    seen = campaign.to_identify
    if not campaign.unknowns:
        raise CampaignError.about(campaign.file, "there are no unknowns, expected `unknowns`")
    if not seen:
        text = 'there is no measurement for identification, expected one with the role "identify"'
        raise CampaignError.about(campaign.file, text)
    unknowns, left_out = observed_unknowns(campaign, seen)
    settings = campaign.table.settings
    tolerances = weighable_tolerances(campaign, seen)
    observations = [measured.observation for measured in seen.values()]
    lines = sum(o.frequency_hz.size for o in observations)
    by_level, unknowns, options = fit_options(campaign, observations, unknowns, threads=threads, say=say)
    say(f"fitting {len(unknowns)} parameters to {lines} lines and modes from {options['starts']} starts")
    try:
        fit = identify(observations, unknowns, tolerances=tolerances, seed=settings.seed, **options)
    except ValueError as error:
        raise CampaignError.about(campaign.file, str(error)) from error
    fit = replace(
        fit,
        series=over_levels(campaign, fit),
        groups=campaign.templates,
        provenance=campaign.provenance(seed=settings.seed, settings=settings.model_dump()),
    )
    notes = [*campaign.notes, *left_out, *(n for n in fit.notes if not any(o.endswith(n) for o in campaign.notes))]
    if fit.errors:
        notes.append(f"{len(fit.errors)} errors of dimensions and materials are fitted with their tolerances as priors")
    if by_level:
        notes.append(
            "each level was fitted separately first, then all together from these values; profile intervals are not "
            "computed for a series"
        )
        if not fit.series:
            notes.append(
                f"trends and laws are not fitted: they need at least {LEAST_LEVELS} different levels, none negative"
            )
    profiled = None
    if settings.profiles and not by_level and fit.known_scatter and settings.objective == "log":
        profiled = fit.profiles(progress=say)
    return replace(fit, notes=notes, profiled=profiled)


def fit_options(
    campaign: Campaign,
    observations: Sequence[Observation],
    unknowns: Sequence[Unknown],
    *,
    threads: int | None,
    say: Callable[[str], None],
) -> tuple[bool, list[Unknown], dict[str, Any]]:
    """Return whether the levels of a series are fitted separately first, unknowns with start values, and options."""
    settings = campaign.table.settings
    by_level = campaign.table.series is not None and any(isinstance(one, Law) and one.free for one in unknowns)
    started = list(unknowns)
    if by_level:
        started = started_by_level(observations, unknowns, settings, threads=threads, say=say)
    return (
        by_level,
        started,
        {
            "objective": settings.objective,
            "band_width_percent": 100.0 * parse_share(settings.band_width, 'a percentage such as "5 %"'),
            "starts": 1 if by_level else settings.starts,
            "max_evaluations": settings.max_evaluations,
            "threads": threads,
            "strategy": "direct" if by_level else settings.strategy,
        },
    )


def weighable_tolerances(campaign: Campaign, seen: Mapping[str, Measurement]) -> list[Tolerance]:
    """Return the errors of all measurements.

    Raises
    ------
    CampaignError
        The objective has no likelihood, or a measurement has no standard deviation.
    """
    tolerances = tolerances_of_measurements(seen)
    if not tolerances:
        return []
    if campaign.table.settings.objective == "percentage":
        raise CampaignError(
            campaign.file,
            [
                Problem(
                    ("settings", "objective"),
                    'is "percentage", which has no likelihood, so that errors of dimensions and materials cannot be '
                    'fitted; expected "log", or no tolerances',
                )
            ],
        )
    bare = [name for name, measured in seen.items() if not measured.observation.weighted]
    if bare:
        expected = (
            "has no standard deviation, which a fit of errors of dimensions and materials needs; expected "
            '`standard_deviation`, such as "2 %", or no tolerances'
        )
        raise CampaignError(campaign.file, [Problem(("measurements", name), expected) for name in bare])
    return tolerances


def observed_unknowns(campaign: Campaign, seen: Mapping[str, Measurement]) -> tuple[list[Unknown], list[str]]:
    """Return the unknowns that some fitted measurement depends on, and notes on the others."""
    places = [measured.observation.site(index) for index, measured in enumerate(seen.values())]
    kept, notes = [], []
    for unknown in campaign.unknowns:
        own = [place for place in places if place.among(unknown.configurations)]
        if any(place.covered(address) for place in own for address in unknown.addresses):
            kept.append(unknown)
        else:
            notes.append(f"{unknown.address} is not identified: no measurement of its assemblies is for identification")
    if not kept:
        raise CampaignError.about(campaign.file, "no measurement for identification depends on an unknown")
    return kept, notes


def invert_campaign(
    campaign: Campaign,
    *,
    joint: str | None = None,
    limit: float = 0.2,
    threads: int | None = None,
    progress: Callable[[str], None] | None = None,
) -> InverseCouplings:
    """Solve for the joints of a campaign on each line; see `Campaign.invert`."""
    say = progress or (lambda _: None)
    groups = _groups(campaign, joint)
    found: dict[str, InverseCoupling] = {}
    notes: list[str] = []
    provenance = campaign.provenance()
    for name, (owner, measured) in groups.items():
        say(f"solving for {name}")
        wanted = [t for t in _ORDER if f"{owner}.{t}" in campaign.table.unknowns]
        terms = wanted[: len(measured)]
        if len(terms) < len(wanted):
            left = ", ".join(f"{owner}.{term}" for term in wanted[len(terms) :])
            notes.append(
                f"{name}: {len(measured)} FRF{'' if len(measured) == 1 else 's'} can determine as many terms on each "
                f"line; {left} is fixed at its start value"
            )
        seen = [one.observation for one in measured.values() if isinstance(one.observation, MeasuredFRF)]
        try:
            one = invert_coupling(
                seen,
                joint=owner,
                terms=[term for term in TERMS if term in terms],
                tolerances=tolerances_of_measurements(measured),
                limit=limit,
                threads=threads,
            )
        except ValueError as error:
            raise CampaignError.about(campaign.file, f"{name}: {error}") from error
        found[name] = replace(one, name=name, provenance=provenance)
        notes += [f"{name}: {note}" for note in one.notes]
    return InverseCouplings(found, provenance=provenance, notes=tuple(dict.fromkeys(notes)))


def _groups(campaign: Campaign, joint: str | None) -> dict[str, tuple[str, dict[str, Measurement]]]:
    """Return by name a joint and its FRFs; joints that differ between assemblies are listed for each assembly."""
    unknown = campaign.table.unknowns
    owners = list(dict.fromkeys(a.split(".", 1)[0] for a in unknown if a.split(".", 1)[-1] in TERMS))
    owners = [name for name in owners if joint is None or name == joint]
    groups: dict[str, tuple[str, dict[str, Measurement]]] = {}
    for owner in owners:
        own = [unknown[a] for a in unknown if a.startswith(f"{owner}.")]
        changing = any(one.free or one.power_of or one.individual for one in own)
        for name, one in campaign.to_identify.items():
            if not isinstance(one.observation, MeasuredFRF):
                continue
            if not isinstance(one.observation.assembly.elements.get(owner), PointJoint):
                continue
            ends = [name for name, end in one.observation.assembly.elements.items() if isinstance(end, ModalPart)]
            if any(address.startswith(f"{ends[0]}.") for u in campaign.unknowns for address in u.addresses if ends):
                raise CampaignError.about(
                    campaign.file,
                    f"{ends[0]}, the modal part behind {owner}, has unknowns, but inverse coupling needs its "
                    "receptance; identify the campaign instead, or write the identified modes into the file "
                    "and remove them from the unknowns",
                )
            title = f"{owner} @ {one.assembly}" if changing else owner
            groups.setdefault(title, (owner, {}))[1][name] = one
    if not groups:
        which = "point joint" if joint is None else f'joint "{joint}"'
        raise CampaignError.about(
            campaign.file, f"no {which} with unknown stiffnesses was measured with an FRF for identification"
        )
    return groups


def transfer_campaign(
    campaign: Campaign,
    *,
    splits: Literal["leave-one-out", "one-for-all"] = "leave-one-out",
    draws: int = 200,
    threads: int | None = None,
    progress: Callable[[str], None] | None = None,
) -> Transfer:
    """Predict every measured assembly from the others; see `Campaign.transfer`."""
    if not campaign.unknowns:
        raise CampaignError.about(campaign.file, "there are no unknowns, expected `unknowns`")
    if len({one.assembly for one in campaign.measurements.values()}) < 2:
        text = "fewer than two assemblies were measured, expected at least two, to predict one from the others"
        raise CampaignError.about(campaign.file, text)
    notes = list(campaign.notes)
    if any(one.held_out for one in campaign.measurements.values()):
        notes.append('the role "hold out" is ignored, because each assembly is held out once')
    measured, settings = campaign.measurements, campaign.table.settings
    tolerances = weighable_tolerances(campaign, measured)
    observations = [one.observation.configured(one.assembly, one.observation.conditions) for one in measured.values()]
    say = progress or (lambda _: None)
    _, unknowns, options = fit_options(campaign, observations, campaign.unknowns, threads=threads, say=say)
    try:
        found = transfer(
            observations,
            unknowns,
            tolerances=tolerances,
            splits=splits,
            level=campaign.table.prediction.level,
            draws=draws,
            seed=settings.seed,
            progress=progress,
            **options,
        )
    except ValueError as error:
        raise CampaignError.about(campaign.file, str(error)) from error
    provenance = campaign.provenance(settings=settings.model_dump())
    return replace(found, campaign_notes=tuple(dict.fromkeys(notes)), provenance=provenance)


def campaign_model(campaign: Campaign, seen: Mapping[str, Measurement]) -> tuple[Model, list[str]]:
    """Return the model of a campaign for a diagnosis, and notes on unknowns that are left out."""
    from receptance.diagnosis.model import Model

    unknowns, left_out = observed_unknowns(campaign, seen)
    observations = tuple(one.observation for one in seen.values())
    tolerances = tuple(tolerances_of_measurements(seen))
    return Model(observations, tuple(unknowns), tolerances, seed=campaign.table.settings.seed), left_out


def diagnose_campaign(
    campaign: Campaign,
    *,
    causes: Iterable[Cause | str] | None = None,
    metrics: Mapping[str, Metric] | None = None,
    threads: int | None = None,
    progress: Callable[[str], None] | None = None,
) -> Verdict:
    """Diagnose a campaign; see `Campaign.diagnose`."""
    from receptance.diagnosis import diagnose
    from receptance.diagnosis.held_out import improvement
    from receptance.diagnosis.thresholds import LEAST_FREEDOM

    if not campaign.unknowns:
        raise CampaignError.about(campaign.file, "there are no unknowns, expected `unknowns`")
    if not campaign.measurements:
        raise CampaignError.about(campaign.file, "there are no measurements, expected `measurements`")
    notes = list(campaign.notes)
    seen, held_out = dict(campaign.to_identify), dict(campaign.held_out)
    numbers = sum(one.observation.independent_values for one in seen.values())
    if held_out and numbers - len(campaign.unknowns) < LEAST_FREEDOM:
        notes.append(
            f"{numbers:.3g} measured values for {len(campaign.unknowns)} unknowns are too few to test the model, so "
            "held-out measurements are used in the diagnosis; improvement is computed for assemblies left out in turn"
        )
        notes += _held_out_error(campaign)
        seen, held_out = dict(campaign.measurements), {}
    if not seen:
        text = 'there is no measurement for the diagnosis, expected one with the role "identify"'
        raise CampaignError.about(campaign.file, text)
    model, left_out = campaign_model(campaign, seen)
    settings = campaign.table.settings
    try:
        verdict = diagnose(
            model.observations,
            model.unknowns,
            tolerances=model.tolerances,
            causes=causes,
            seed=settings.seed,
            threads=threads,
            held_out=not held_out,
            metrics=metrics,
            progress=progress,
        )
    except ValueError as error:
        raise CampaignError.about(campaign.file, str(error)) from error
    if held_out and verdict.final:
        found = improvement(
            verdict.selection,
            verdict.explanation,
            [one.observation for one in held_out.values()],
            tolerances_of_measurements(held_out),
            metrics,
        )
        verdict = verdict.with_improvement(found)
    notes += [*left_out, *verdict.notes]
    return replace(verdict, notes=tuple(dict.fromkeys(notes)), provenance=campaign.provenance())


def _held_out_error(campaign: Campaign) -> list[str]:
    """Return a note on the error of the base model for the held-out measurements."""
    from receptance.diagnosis.by_mode import bias_of, slenderness_of
    from receptance.diagnosis.fitting import fit_base
    from receptance.diagnosis.held_out import FREQUENCIES, metrics_of

    model, _ = campaign_model(campaign, campaign.to_identify)
    out = replace(
        model,
        observations=tuple(one.observation for one in campaign.held_out.values()),
        tolerances=tuple(tolerances_of_measurements(campaign.held_out)),
    )
    try:
        errors, modes = metrics_of(fit_base(model), out, scored=False)
    except (ValueError, ReceptanceError):
        return []
    if FREQUENCIES not in errors:
        return []
    bias = bias_of(modes, slenderness_of(out))
    text = "identified without the held-out measurements, the model predicts their natural frequencies with an rms "
    return [f"{text}error of {errors[FREQUENCIES]:.2f} %" + ("" if bias is None else f"; {bias}")]


def rank_candidates(
    campaign: Campaign,
    identified: Identification | None,
    *,
    targets: Sequence[str] = (),
    threads: int | None = None,
    progress: Callable[[str], None] | None = None,
) -> NextMeasurement:
    """Rank the candidates of a campaign; see `Campaign.next_measurement`."""
    if not campaign.candidates:
        raise CampaignError.about(campaign.file, "no candidates to rank, expected `candidates`")
    known = identified or identify_campaign(campaign, threads=threads, progress=progress)
    chosen = [_target(name, campaign, known) for name in targets]
    try:
        found = next_measurement(
            known,
            list(campaign.candidates.values()),
            targets=chosen or None,
            level=campaign.table.prediction.level,
            profiles=known.profiled or {},
            progress=progress,
        )
    except ValueError as error:
        raise CampaignError.about(campaign.file, str(error)) from error
    return replace(found, provenance=campaign.provenance(seed=known.seed))


def _target(name: str, campaign: Campaign, fit: Identification) -> Target:
    """Return the name of an unknown, or the natural frequencies of an assembly up to `highest_frequency`."""
    if name in fit.values:
        return name
    if name not in campaign.assemblies:
        choices = [*(n for n in fit.addresses if n not in fit.errors), *campaign.assemblies]
        text = f'the target "{name}" is neither an identified parameter nor an assembly, expected {one_of(choices)}'
        raise CampaignError.about(campaign.file, text + did_you_mean(name, choices))
    errors = tuple(tolerances_of(campaign.effects.get(name, {})))
    conditions = {key: one.value for key, one in campaign.conditions.get(name, {}).items()}
    assembly = fit.apply(campaign.assemblies[name], configuration=name, conditions=conditions, tolerances=errors)
    upper = campaign.highest_frequency
    assert upper is not None  # a fit has measurements
    modes = assembly.natural_frequencies(upper)
    if not modes.size:
        raise CampaignError.about(campaign.file, f'the target "{name}" has no natural frequency below {upper:g} Hz')
    return Candidate(
        label=name,
        assembly=campaign.assemblies[name],
        modes=tuple(range(1, modes.size + 1)),
        tolerances=errors,
        configuration=name,
        conditions=conditions,
    )
