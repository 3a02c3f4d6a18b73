"""Identification of the unknowns of a campaign, parameters over levels, and joints line by line."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from receptance._text import did_you_mean, first_of, one_of
from receptance.campaign.data import CampaignData
from receptance.campaign.problems import CampaignError, Issue, errors_about
from receptance.campaign.schema import AutomaticModes, SeriesTable
from receptance.campaign.values import kind_of, parse_condition
from receptance.coupling import ForceSeries, InverseCoupling, InverseCouplings, invert_coupling
from receptance.coupling.line_equations import TERMS
from receptance.coupling.stabilisation import Stabilisation, Stabilisations
from receptance.coupling.unknown_modes import FEWEST_MODES, ModeChoice, start_modes
from receptance.errors import ReceptanceError
from receptance.fit import Identification, Tolerance, Unknown, identify, profile_likelihoods
from receptance.fit.observation import Observation
from receptance.fit.unknowns import Law, covered
from receptance.report import Column, Provenance, Results, Table
from receptance.report.table import Cell
from receptance.units import split

_TOLERANCE_OF_MODES = 1e-6
"""Relative change at which a fit of unknown modes has converged: along its flat valleys the cost falls for long by
amounts that are small beside 1."""
_MODE_OF = re.compile(r"mode\[(\d+)\]")
_EVALUATIONS_OF_PROFILE = 20
"""Expected number of evaluations of a profile: about eight constrained fits from neighbouring ones."""
_EVALUATIONS_OF_PROFILES = 200
"""Evaluations of all profiles that are allowed after the shortest fit."""


def identify_campaign(campaign: CampaignData, profiles: Sequence[str] | None = ()) -> Identification:
    """Identify the unknowns on the measurements that are not held out; see `Campaign.identify`.

    Without `profiles`, which analyses do not need, only the fit is made.
    """
    unknowns, left_out, tolerances = fit_inputs(campaign)
    settings = campaign.table.settings
    observations = list(campaign.to_identify.values())
    lines = sum(o.frequency_hz.size for o in observations)
    by_level, unknowns, tolerances, options, stabilised = fit_options(campaign, observations, unknowns, tolerances)
    campaign.progress(f"fitting {len(unknowns)} parameters to {lines} lines and modes from {options['starts']} starts")
    with errors_about(campaign.file):
        fit = identify(observations, unknowns, tolerances=tolerances, seed=settings.seed, **options)
    series = None
    if campaign.table.series is not None:
        series = over_levels(campaign, fit)
    fit = replace(
        fit,
        series=series,
        stabilised=stabilised.with_provenance(campaign.provenance()) if stabilised else None,
        groups=campaign.templates,
        provenance=campaign.provenance(seed=settings.seed, settings=settings.data()),
    )
    notes = [*campaign.notes, *left_out, *(n for n in fit.notes if not any(o.endswith(n) for o in campaign.notes))]
    if fit.errors:
        notes.append(f"{len(fit.errors)} errors of dimensions and materials are fitted with their tolerances as priors")
    if by_level:
        notes.append(
            "each level was fitted separately first, then all together from these values; profile intervals are "
            "not computed for a series"
        )
        if not fit.series:
            notes.append(
                f"trends and laws are not fitted: they need at least {LEAST_LEVELS} different levels, none negative"
            )
    fit = replace(fit, notes=notes)
    if profiles is None:
        # The valleys of unknown modes are flat and long, so that profiles along them take many fits.
        by_default = settings.profiles and not (by_level or parts_to_start(campaign))
        by_default &= fit.known_scatter and settings.objective == "log"
        most = max(fit.evaluations, _EVALUATIONS_OF_PROFILES)
        return _with_profiles(campaign, fit, _of_joints(campaign, fit), most) if by_default else fit
    return _with_profiles(campaign, fit, _check_profiles(campaign, fit, profiles), None) if profiles else fit


def _of_joints(campaign: CampaignData, fit: Identification) -> list[str]:
    """Return the parameters of joints in a fit, or all but errors where it has none."""
    names = [name for name in fit.addresses if name not in fit.errors]
    return [name for name in names if name.split(".", 1)[0] in campaign.table.joints] or names


def _check_profiles(campaign: CampaignData, fit: Identification, names: Sequence[str]) -> list[str]:
    """Return the parameters that are to be profiled; raise for one that was not identified, or without likelihood."""
    choices = [name for name in fit.addresses if name not in fit.errors]
    for name in names:
        if name not in choices:
            text = f'there is no identified parameter "{name}" to profile, expected {one_of(choices)}'
            raise campaign.error(text + did_you_mean(name, choices))
    if campaign.table.settings.objective != "log":
        text = 'is "percentage", which has no likelihood and so no profiles; expected "log"'
        raise campaign.error(text, "settings", "objective")
    return list(dict.fromkeys(names))


def _with_profiles(
    campaign: CampaignData, fit: Identification, names: Sequence[str], most: int | None
) -> Identification:
    """Return the fit with profile likelihoods; with `most` evaluations, those that are expected to need no more.

    The fit is the one that was profiled, which may be restarted from a better optimum.
    """
    notes, left_out, profiles = [], list(names), None
    if most is None or _EVALUATIONS_OF_PROFILE * len(names) <= most:
        campaign.progress(f"profiling {', '.join(names)}")
        try:
            profiles = profile_likelihoods(fit, names, most=most, progress=campaign.progress)
            fit, left_out = profiles.fit or fit, list(profiles.unfinished)
        except ReceptanceError as error:
            # The fit is a result without profiles as well; its linear intervals remain.
            notes.append(f"profile intervals are not computed: {error}")
            left_out = []
    if left_out:
        notes.append(
            f"profile intervals of {first_of(left_out)} are not computed, because they take longer than the fit: "
            "`receptance identify --profile ADDRESS` computes that of one parameter"
        )
    return replace(fit, notes=[*fit.notes, *notes], profiled=profiles or None)


def fit_inputs(campaign: CampaignData) -> tuple[list[Unknown], list[str], list[Tolerance]]:
    """Return the unknowns of a fit, notes on those that are left out, and the errors.

    Raises
    ------
    CampaignError
        There are no unknowns or no measurements, or measurements have no weights.
    """
    seen = campaign.to_identify
    check_unknowns(campaign)
    if not seen:
        raise campaign.error('there is no measurement for identification, expected one with the role "identify"')
    unknowns, left_out = observed_unknowns(campaign, seen)
    return unknowns, left_out, weighted_tolerances(campaign, seen)


def transfer_errors(campaign: CampaignData) -> list[Tolerance]:
    """Return the errors of all measurements, whose assemblies a transfer predicts; raise if it cannot."""
    check_unknowns(campaign)
    if len({observation.configuration for observation in campaign.measurements.values()}) < 2:
        raise campaign.error(
            "fewer than two assemblies were measured, expected at least two, to predict one from the others"
        )
    return weighted_tolerances(campaign, campaign.measurements)


def check_unknowns(campaign: CampaignData) -> None:
    """Raise if there are no unknowns."""
    if not campaign.unknowns:
        raise campaign.error("there are no unknowns, expected `unknowns`")


def fit_options(
    campaign: CampaignData,
    observations: Sequence[Observation],
    unknowns: Sequence[Unknown],
    tolerances: Sequence[Tolerance],
) -> tuple[bool, list[Unknown], list[Tolerance], dict[str, Any], Stabilisations]:
    """Return how a fit starts: whether levels of a series are fitted separately first, unknowns and errors, options.

    The last result has the modes of unknown spindles by their number.
    """
    settings = campaign.table.settings
    stabilised = Stabilisations({})
    by_level = campaign.table.series is not None and any(
        isinstance(unknown, Law) and unknown.free for unknown in unknowns
    )
    by_mode = bool(parts_to_start(campaign))
    if by_mode:
        unknowns, tolerances, stabilised = started_by_mode(campaign, observations, unknowns, tolerances)
    elif by_level:
        unknowns = started_by_level(campaign, observations, unknowns)
    return (
        by_level,
        list(unknowns),
        list(tolerances),
        {
            "objective": settings.objective,
            "band_width_percent": 100.0 * settings.band_width,
            "starts": 1 if by_level or by_mode else settings.starts,
            # The one start by modes has the evaluations of all starts.
            "max_evaluations": settings.max_evaluations * (settings.starts if by_mode else 1),
            **({"tolerance": _TOLERANCE_OF_MODES} if by_mode else {}),
            "threads": campaign.threads,
            "strategy": "direct" if by_level or by_mode else settings.strategy,
        },
        stabilised,
    )


def parts_to_start(campaign: CampaignData) -> list[str]:
    """Return the modal parts whose modes are unknown. A mode with a row among the unknowns has the start of the row."""
    table, names = campaign.table, []
    for name, part in table.modal_parts.items():
        given = {match[1] for address in table.unknowns if (match := _MODE_OF.match(address.removeprefix(f"{name}.")))}
        if part.identify and len(given) < len(part.modes):
            names.append(name)
    return names


def started_by_mode(
    campaign: CampaignData,
    observations: Sequence[Observation],
    unknowns: Sequence[Unknown],
    tolerances: Sequence[Tolerance],
    *,
    choice: ModeChoice = FEWEST_MODES,
) -> tuple[list[Unknown], list[Tolerance], Stabilisations]:
    """Return unknowns and errors with the starts of a fit to which the modes of modal parts were added.

    `choice` is that of modes whose number the records choose. The last result has the modes of unknown spindles by
    their number.
    """
    settings = campaign.table.settings
    begun, errors = list(unknowns), list(tolerances)
    stabilised: dict[str, Stabilisation] = {}
    for name in parts_to_start(campaign):
        modes = campaign.table.modal_parts[name].modes
        by_evidence = isinstance(modes, AutomaticModes)
        campaign.progress(f"adding {'' if by_evidence else f'the {len(modes)} '}modes of {name} one at a time")
        with errors_about(campaign.file):
            begun, errors, chosen = start_modes(
                observations,
                begun,
                name,
                by_evidence=by_evidence,
                choice=choice,
                tolerances=errors,
                starts=settings.starts,
                seed=settings.seed,
                threads=campaign.threads,
            )
        if chosen is not None:
            stabilised[name] = chosen
    return begun, errors, Stabilisations(stabilised)


def weighted_tolerances(campaign: CampaignData, seen: Mapping[str, Observation]) -> list[Tolerance]:
    """Return the errors of all measurements; the objective must have a likelihood, and measurements weights."""
    tolerances = campaign.errors_of(seen)
    if not tolerances:
        return []
    if campaign.table.settings.objective == "percentage":
        text = (
            'is "percentage", which has no likelihood, so that errors of dimensions and materials cannot be fitted; '
            'expected "log", or no tolerances'
        )
        raise campaign.error(text, "settings", "objective")
    unweighted = [name for name, measured in seen.items() if not measured.weighted]
    if unweighted:
        expected = (
            "has no standard deviation, which a fit of errors of dimensions and materials needs; expected "
            '`standard_deviation`, such as "2 %", or no tolerances'
        )
        raise CampaignError(campaign.file, [Issue(("measurements", name), expected) for name in unweighted])
    return tolerances


def observed_unknowns(campaign: CampaignData, seen: Mapping[str, Observation]) -> tuple[list[Unknown], list[str]]:
    """Return the unknowns that some fitted measurement depends on, and notes on the others."""
    places = [measured.site(index) for index, measured in enumerate(seen.values())]
    kept, notes = [], []
    for unknown in campaign.unknowns:
        reached = [place for place in places if place.among(unknown.configurations, unknown.labels)]
        if any(place.covered(address) for place in reached for address in unknown.addresses):
            kept.append(unknown)
        else:
            notes.append(f"{unknown.address} is not identified: no measurement of its assemblies is for identification")
    if not kept:
        raise campaign.error("no measurement for identification depends on an unknown")
    return kept, notes


# Series: parameters over levels ---------------------------------------------------------------------------------------

LEAST_LEVELS = 6
"""Smallest number of levels to which laws are fitted."""
_WORSE = 1.5
"""Ratio of rms residuals to the neighbouring level from which on a level is also fitted from several starts."""


class LevelSeries(Results[ForceSeries]):
    """Parameters over the levels of a series by name; `over` is the condition, and levels are in `unit`."""

    heading = "Parameters over levels"
    key = "parameters"
    plotted_by = "receptance.campaign.figure:draw_series"

    def __init__(
        self, items: Mapping[str, ForceSeries], *, over: str, unit: str, provenance: Provenance | None = None
    ) -> None:
        super().__init__(items, provenance=provenance)
        self.over, self.unit = over, unit

    def tables(self) -> list[Table]:
        """Return the values at each level, a table for each joint, and the trends."""
        groups: dict[tuple[str, tuple[float, ...]], list[ForceSeries]] = {}
        for name, series in self.items():
            groups.setdefault((name.partition(".")[0], tuple(series.force)), []).append(series)
        tables = []
        for (owner, levels), group in groups.items():
            columns = [Column(self.over, self.unit, "g")]
            cells: list[list[Cell]] = [list(levels)]
            for series in group:
                half = 1.96 * series.standard_errors
                columns += [Column(series.name.partition(".")[2], kind_of(series.name).unit, ".5g")]
                columns += [Column("95 % interval", form=".5g")]
                cells += [series.values.tolist(), list(zip(series.values - half, series.values + half, strict=True))]
            tables.append(Table(f"{owner} over {self.over}", columns, list(zip(*cells, strict=True))))
        return [*tables, *super().tables()]

    def data(self) -> dict[str, Any]:
        """Return the parameters with their laws and trends."""
        return {
            "over": self.over,
            "unit": self.unit,
            "parameters": {name: series.data() for name, series in self.items()},
        }


def started_by_level(
    campaign: CampaignData, observations: Sequence[Observation], unknowns: Sequence[Unknown]
) -> list[Unknown]:
    """Return the unknowns with start values of free ones from separate fits of each configuration.

    A joint fit of many levels has too many free values to converge from distant starts. The first level of each kind of
    assembly is fitted from several starts, the others from the values of the previous level.
    """
    starts = campaign.table.settings.starts
    groups: dict[str, list[Observation]] = {}
    for observation in observations:
        groups.setdefault(observation.configuration, []).append(observation)
    found: dict[str, dict[str, float]] = {}
    last: dict[tuple[str, ...], tuple[dict[str, float], float]] = {}
    for name, group in groups.items():
        present = [u for u in unknowns if any(covered(u.address, observation.assembly) for observation in group)]
        if not present:
            continue
        campaign.progress(f"fitting {name}, {len(found) + 1} of {len(groups)}")
        kind = tuple(unknown.address for unknown in present)
        values, rms = last.get(kind, ({}, np.inf))
        fits = []
        if values:
            fits.append(_fitted(campaign, group, present, values, starts=1, staged=False))
        if not values or fits[0] is None or fits[0].rms > _WORSE * rms:
            fits.append(_fitted(campaign, group, present, {}, starts=starts, staged=True))
        ended = [fit for fit in fits if fit is not None]
        if not ended:
            continue
        best = min(ended, key=lambda fit: fit.rms)
        last[kind] = best.values, max(best.rms, 1.0)
        for unknown in present:
            found.setdefault(unknown.address, {})[name] = best.values[unknown.address]
    return [
        replace(unknown, starts=found.get(unknown.address, {}))
        if isinstance(unknown, Law) and unknown.free
        else unknown
        for unknown in unknowns
    ]


def _fitted(
    campaign: CampaignData,
    observations: Sequence[Observation],
    unknowns: Sequence[Unknown],
    values: Mapping[str, float],
    *,
    starts: int,
    staged: bool,
) -> Identification | None:
    settings = campaign.table.settings
    plain = [
        Unknown(
            address=unknown.address,
            lower=unknown.lower,
            upper=unknown.upper,
            start=values.get(unknown.address, unknown.start),
            scale=unknown.scale,
            prior=unknown.prior,
        )
        for unknown in unknowns
    ]
    weighed = all(observation.weighted for observation in observations)
    try:
        return identify(
            observations,
            plain,
            objective=settings.objective,
            starts=starts,
            seed=settings.seed,
            max_evaluations=settings.max_evaluations,
            threads=campaign.threads,
            strategy="staged" if staged and weighed and settings.objective == "log" else "direct",
            noise="stated",
        )
    except (ReceptanceError, ValueError):
        return None  # the fit of all levels reports the error


def over_levels(campaign: CampaignData, fit: Identification) -> LevelSeries:
    """Return every free parameter over the levels of the series.

    Parameters at fewer than `LEAST_LEVELS` levels are left out. Standard errors are those from the scatter of the data,
    multiplied by the rms residual of the level if that exceeds the noise. Errors of dimensions and materials are common
    to all levels and do not contribute.
    """
    table = campaign.table.series
    assert table is not None
    unit, factor = level_unit(table)
    squares: dict[str, list[float]] = {}
    for measured, residual in zip(campaign.to_identify.values(), fit.residuals, strict=True):
        squares.setdefault(measured.configuration, []).extend(np.square(residual).tolist())
    series = {}
    for law in fit.task.parameters.given:
        if not isinstance(law, Law) or not law.free or law.along != table.over:
            continue
        rows = []
        for name, square in squares.items():
            title = law.name_in(name)
            if title in fit.values and np.isfinite(fit.standard_errors[title]):
                level = campaign.site(name).conditions[table.over] / factor
                is_stated = fit.known_scatter and fit.discrepancy is None
                left = max(float(np.sqrt(np.mean(square))), 1.0) if is_stated else 1.0
                rows.append((level, fit.values[title], fit.standard_errors[title] * left))
        rows.sort()
        columns = np.array(rows).T if len(rows) >= LEAST_LEVELS else None
        if columns is not None and np.all(np.diff(columns[0]) > 0.0) and columns[0, 0] >= 0.0:
            series[law.name] = ForceSeries(
                name=law.name, force=columns[0], values=columns[1], standard_errors=columns[2]
            )
    return LevelSeries(series, over=table.over, unit=unit, provenance=campaign.provenance())


def level_unit(table: SeriesTable) -> tuple[str, float]:
    """Return the unit of the levels in the file, and its value in SI units.

    Examples
    --------
    >>> from receptance.campaign.identification import level_unit
    >>> from receptance.campaign.schema import SeriesTable
    >>> level_unit(SeriesTable(over="drawbar force", levels=["0 kN", "5 kN"]))
    ('kN', 1000.0)
    """
    for level in table.levels:
        with suppress(ValueError):  # a plain number, or a name
            number, unit = split(level, "a level")
            if number and unit:
                return unit, parse_condition(level) / number
    return "", 1.0


# Inverse coupling -----------------------------------------------------------------------------------------------------

_ORDER = ("k_theta", "k_y", "k_ytheta")
"""Terms of a joint in the order in which they are solved for if there are fewer FRFs than terms."""


def invert_campaign(campaign: CampaignData, joint: str | None, limit: float) -> InverseCouplings:
    """Solve for the stiffness of joints on each frequency line; see `Campaign.invert`."""
    groups = joints_to_invert(campaign, joint)
    inversions: dict[str, InverseCoupling] = {}
    notes: list[str] = []
    provenance = campaign.provenance()
    for name, (owner, measured) in groups.items():
        campaign.progress(f"solving for {name}, {len(inversions) + 1} of {len(groups)}")
        unknown = [t for t in _ORDER if f"{owner}.{t}" in campaign.table.unknowns]
        terms = unknown[: len(measured)]
        if len(terms) < len(unknown):
            left = ", ".join(f"{owner}.{term}" for term in unknown[len(terms) :])
            count = f"{len(measured)} FRF{'' if len(measured) == 1 else 's'}"
            notes.append(
                f"{name}: {count} can determine as many terms on each line; {left} is fixed at its start value"
            )
        with errors_about(campaign.file, f"{name}: "):
            inversion = invert_coupling(
                list(measured.values()),
                joint=owner,
                terms=[term for term in TERMS if term in terms],
                tolerances=campaign.errors_of(measured),
                limit=limit,
                threads=campaign.threads,
            )
        inversions[name] = replace(inversion, name=name, provenance=provenance)
        notes += [f"{name}: {note}" for note in inversion.notes]
    return InverseCouplings(inversions, provenance=provenance, notes=tuple(dict.fromkeys(notes)))


def joints_to_invert(campaign: CampaignData, joint: str | None = None) -> dict[str, tuple[str, dict[str, Observation]]]:
    """Return by name a joint and its FRFs; joints that differ between assemblies are listed for each assembly."""
    unknown = campaign.table.unknowns
    owners = list(dict.fromkeys(a.split(".", 1)[0] for a in unknown if a.split(".", 1)[-1] in TERMS))
    joints = campaign.table.joints
    owners = [name for name in owners if name in joints and (joint is None or name == joint)]
    groups: dict[str, tuple[str, dict[str, Observation]]] = {}
    for owner in owners:
        own = [unknown[a] for a in unknown if a.startswith(f"{owner}.")]
        changing = any(one.free or one.power_of or one.individual for one in own)
        for name, one in campaign.to_identify.items():
            if not one.is_receptance or owner not in one.assembly.elements or joints[owner].kind != "point":
                continue
            ends = [name for name in one.assembly.elements if name in campaign.table.modal_parts]
            if any(address.startswith(f"{ends[0]}.") for u in campaign.unknowns for address in u.addresses if ends):
                raise campaign.error(
                    f"{ends[0]}, the modal part behind {owner}, has unknowns, but inverse coupling needs its "
                    "receptance; identify the campaign instead, or write the identified modes into the file "
                    "and remove them from the unknowns",
                )
            title = f"{owner} @ {one.configuration}" if changing else owner
            groups.setdefault(title, (owner, {}))[1][name] = one
    if not groups:
        which = "point joint" if joint is None else f'joint "{joint}"'
        raise campaign.error(f"no {which} with unknown stiffnesses was measured with an FRF for identification")
    return groups
