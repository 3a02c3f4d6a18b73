"""Transfer: identify on some configurations, predict the others, and compare with what was measured there."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from receptance.errors import ReceptanceError
from receptance.identification.fit import identify
from receptance.identification.laws import Law, Tolerance
from receptance.identification.mapping import Place
from receptance.identification.observations import MeasuredFRF
from receptance.identification.peaks import match_peaks
from receptance.identification.prediction import Forecast, PredictedReceptance
from receptance.identification.spread import quantile
from receptance.identification.task import Observation, place_of
from receptance.identification.transferred import Split, Transfer, TransferredFRF, TransferredMode
from receptance.identification.unknowns import Unknown, covered
from receptance.terminals import Terminal

if TYPE_CHECKING:
    from receptance.identification.result import Identification

__all__ = ["groups_of", "transfer"]

Splits = Literal["leave-one-out", "one-for-all"]
_PER_CENT = 100.0


def transfer(
    observations: Observation | Sequence[Observation],
    unknowns: Unknown | Sequence[Unknown],
    *,
    tolerances: Tolerance | Sequence[Tolerance] = (),
    splits: Splits | Iterable[Sequence[str]] = "leave-one-out",
    level: float = 0.95,
    draws: int = 200,
    seed: int = 0,
    progress: Callable[[str], None] | None = None,
    **options: Any,
) -> Transfer:
    """Identify on some configurations and predict the others, for every split.

    Observations of one configuration stay together: they are fitted, or held out. A configuration that is held out has
    its own errors, which the fit does not know, and they widen its intervals.

    Parameters
    ----------
    observations, unknowns, tolerances
        As in `identify`. Unknowns and tolerances that none of the fitted configurations has are left out of a fit.
    splits : {"leave-one-out", "one-for-all"} or iterable of sequence of str, optional
        What is held out: each configuration in turn, all but each in turn, or these groups of configurations.
    level : float, optional
        Level of the intervals.
    draws : int, optional
        Vectors that the bands of receptances are drawn from; with 0 they are linear, see
        `Identification.predict_receptance`.
    seed : int, optional
        Seed of these draws, and of the starts of the fits.
    progress : callable, optional
        Is told what is being done.
    **options
        Further options of `identify`: strategy, starts, objective and so on.

    Returns
    -------
    Transfer
        Predictions beside measurements, by split.

    Raises
    ------
    TypeError, ValueError
        As in `identify`; fewer than two configurations, or a group that leaves nothing to fit or names none of them.

    Examples
    --------
    >>> from receptance import STEEL, Assembly, MeasuredFrequencies, Part, PointJoint, Segment, Unknown
    >>> from receptance.identification import transfer
    >>> def pair(length):
    ...     tool = Part([Segment(length=length, outer_diameter=0.012, material=STEEL)], name="tool")
    ...     holder = Part([Segment(length=0.1, outer_diameter=0.04, material=STEEL)])
    ...     return Assembly([tool, PointJoint(k_y=1e8, k_theta=1e5), holder])
    >>> measured = [
    ...     MeasuredFrequencies(
    ...         assembly=pair(length),
    ...         frequency_hz=pair(length).natural_frequencies(2e4)[:2].round(),
    ...         standard_deviation_hz=0.3,
    ...         configuration=f"{1e3 * length:.0f} mm",
    ...     )
    ...     for length in (0.05, 0.07, 0.09)
    ... ]
    >>> transfer(measured, Unknown(address="joint.k_theta", lower=1e3, upper=1e7), starts=2)
    Transfer(3 splits, 6 modes predicted to 0.00554 % rms, +0.00 % on average, 6 of 6 in their 95 % intervals)
    """
    observed = (observations,) if isinstance(observations, Observation) else tuple(observations)
    for index, one in enumerate(observed):
        if not isinstance(one, Observation):
            raise TypeError(f"observations[{index}] is {one!r}, expected a MeasuredFRF or MeasuredFrequencies")
    wanted = (unknowns,) if isinstance(unknowns, Unknown) else tuple(unknowns)
    errors = (tolerances,) if isinstance(tolerances, Tolerance) else tuple(tolerances)
    quantile(level, None)
    _refuse_free(wanted)
    # Named before anything is left out: a name that comes from the number would be another one in each split.
    observed = tuple(o.configured(place_of(o, i).configuration, o.conditions) for i, o in enumerate(observed))
    names = tuple(dict.fromkeys(o.configuration for o in observed))
    say = progress or (lambda _: None)
    found = []
    for group in groups_of(splits, names):
        say(f"holding out {', '.join(group)}")
        kept = [o for o in observed if o.configuration not in group]
        held = [o for o in observed if o.configuration in group]
        found.append(_split(group, kept, held, wanted, errors, level, draws, seed, options))
    return Transfer(splits=tuple(found), level=level, seed=seed)


def groups_of(splits: Splits | Iterable[Sequence[str]], names: tuple[str, ...]) -> list[tuple[str, ...]]:
    """Return the groups of configurations that are held out in turn; see `transfer`."""
    if len(names) < 2:
        raise ValueError(f"there is only the configuration {', '.join(names)}, expected two or more to predict between")
    if splits == "leave-one-out":
        return [(name,) for name in names]
    if splits == "one-for-all":
        return [tuple(other for other in names if other != name) for name in names]
    if isinstance(splits, str):
        raise ValueError(f"splits is {splits!r}, expected 'leave-one-out', 'one-for-all' or groups of configurations")
    groups = [(group,) if isinstance(group, str) else tuple(group) for group in splits]
    for group in groups:
        if strange := [name for name in group if name not in names]:
            raise ValueError(f"splits: there is no configuration {strange[0]!r}; there are {', '.join(names)}")
        if not group or len(set(group)) == len(names):
            raise ValueError(f"splits: {group!r} must hold out some of {', '.join(names)} and leave some to fit")
    if not groups:
        raise ValueError("splits is empty, expected at least one group of configurations to hold out")
    return groups


def _refuse_free(wanted: Sequence[Unknown]) -> None:
    for unknown in wanted:
        if isinstance(unknown, Law) and unknown.free and not unknown.along:
            raise ValueError(
                f"{unknown.address} is free in each configuration, so nothing is known of it where it was not "
                "measured; give it one value, powers or an individual part to transfer it"
            )


def _split(
    group: tuple[str, ...],
    kept: Sequence[Observation],
    held: Sequence[Observation],
    wanted: Sequence[Unknown],
    errors: Sequence[Tolerance],
    level: float,
    draws: int,
    seed: int,
    options: dict[str, Any],
) -> Split:
    places = [place_of(o, i) for i, o in enumerate(kept)]
    here = [u for u in wanted if _there((u.address,), u.configurations, None, places)]
    near = [t for t in errors if _there(tuple(t.moves), t.configurations, t.labels, places)]
    lost = [u for u in wanted if u not in here]
    fit = None
    if here:
        fit = identify(kept, here, tolerances=near, seed=seed, **options)
    modes: list[TransferredMode] = []
    receptances: list[TransferredFRF] = []
    reasons: list[str] = []
    notes: list[str] = []
    for one in held:
        missing = [u.address for u in lost if _there((u.address,), u.configurations, None, [place_of(one, 0)])]
        shared = any(_there((u.address,), u.configurations, None, [place_of(one, 0)]) for u in here)
        if missing or not shared or fit is None:
            what = ", ".join(missing) or "none of the identified parameters"
            reasons.append(f"{one.configuration}: {what} {'is in' if missing else 'in'} no configuration that is left")
            continue
        try:
            place = Place(one.assembly, one.configuration, one.label, one.conditions)
            forecast = Forecast(fit, place, errors)
            if isinstance(one, MeasuredFRF):
                frf = _frf(one, fit, forecast, level, draws, seed, notes)
                receptances.append(frf)
                modes += _peaks(frf, forecast, fit, level)
            else:
                modes += _modes(one, forecast, fit, level)
        except (ValueError, ReceptanceError) as error:
            reasons.append(f"{one.configuration}: {error}")
    return Split(
        held_out=group,
        fitted=tuple(dict.fromkeys(o.configuration for o in kept)),
        identified=fit,
        modes=tuple(modes),
        frfs=tuple(receptances),
        not_predicted=tuple(dict.fromkeys(reasons)),
        notes=tuple(notes),
    )


def _there(
    addresses: tuple[str, ...],
    configurations: tuple[str, ...] | None,
    labels: tuple[str, ...] | str | None,
    places: Sequence[Place],
) -> bool:
    """Return whether some place has some of the addresses."""
    among = [place for place in places if place.among(configurations, labels)]
    return any(covered(address, place.assembly) for address in addresses for place in among)


def _modes(one: Any, forecast: Forecast, fit: Identification, level: float) -> list[TransferredMode]:
    found, scatter = forecast.modes(one.modes, float(one.frequency_hz[-1]))
    reading = one.standard_deviation_hz if fit.known_scatter else _estimated(fit, one.frequency_hz)
    return [
        TransferredMode(
            configuration=one.configuration,
            label=one.label,
            mode=mode,
            measured_hz=float(measured),
            predicted_hz=float(predicted),
            deviation_hz=float(deviation),
            reading_hz=float(spread),
            reach=fit.reach(level),
        )
        for mode, measured, predicted, deviation, spread in zip(
            one.modes, one.frequency_hz, found, scatter.total, reading, strict=True
        )
    ]


def _frf(
    one: MeasuredFRF,
    fit: Identification,
    forecast: Forecast,
    level: float,
    draws: int,
    seed: int,
    notes: list[str],
) -> TransferredFRF:
    def predict(draws: int) -> PredictedReceptance:
        return forecast.observed(one, draws=draws, seed=seed)

    try:
        predicted = predict(draws)
    except ReceptanceError as error:
        notes.append(f"{one.label or one.configuration}: its band is linear, because {error}")
        predicted = predict(0)
    noise = one.standard_deviation
    if noise is None or not fit.known_scatter:
        units = [unit for unit in fit.units if unit == "logarithm"]
        noise = np.full(one.frequency_hz.size, _scatter(fit) if units else 0.0)
    return TransferredFRF(
        configuration=one.configuration,
        label=one.label,
        measured=one.receptance,
        noise=noise,
        predicted=predicted,
        level=level,
    )


def _peaks(frf: TransferredFRF, forecast: Forecast, fit: Identification, level: float) -> list[TransferredMode]:
    """Return measured peaks beside predicted ones; a predicted one moves as the natural frequency nearest to it.

    An assembly with a spindle known by its receptances has no natural frequencies: its peaks have no interval.
    """
    lines, predicted = frf.predicted.frequency_hz, frf.predicted.receptance
    known = not any(isinstance(one, Terminal) for one in forecast.assembly.elements.values())
    found, deviation = np.empty(0), np.empty(0)
    if known:
        found, scatter = forecast.natural_frequencies(1.1 * float(lines[-1].real))
        deviation = scatter.total
    rows = []
    for peak in match_peaks(lines, frf.measured, predicted, frf.noise):
        if peak.measured_hz is None:
            continue
        near = None if peak.predicted_hz is None or not found.size else int(np.abs(found - peak.predicted_hz).argmin())
        rows.append(
            TransferredMode(
                configuration=frf.configuration,
                label=frf.label,
                mode=None if near is None else near + 1,
                measured_hz=peak.measured_hz,
                predicted_hz=peak.predicted_hz,
                deviation_hz=None if near is None else float(deviation[near]),
                reading_hz=peak.measured_deviation_hz,
                reach=fit.reach(level),
            )
        )
    return rows


def _scatter(fit: Identification) -> float:
    """Return the standard deviation of a residual that a fit without given standard deviations found."""
    total = float(sum(np.sum(np.square(r)) for r in fit.residuals))
    return float(np.sqrt(total / fit.degrees_of_freedom)) if fit.degrees_of_freedom > 0 else np.inf


def _estimated(fit: Identification, frequency_hz: Any) -> Any:
    share = _scatter(fit) / (_PER_CENT if "percent" in fit.units else 1.0)
    return share * frequency_hz
