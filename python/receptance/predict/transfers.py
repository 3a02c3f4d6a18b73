"""Transfer: a fit of some configurations predicts the others, and is compared with the measurements of these."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, Literal, Unpack

import numpy as np
from numpy.typing import NDArray

from receptance import _checks
from receptance.errors import ReceptanceError
from receptance.fit.covariance import UNINFORMATIVE, confidence_multiplier
from receptance.fit.identification import FitKeywords, identify
from receptance.fit.observation import Observation, altered, as_observations
from receptance.fit.parameters import Site
from receptance.fit.peaks import PredictedMode
from receptance.fit.prediction import PredictedFRF
from receptance.fit.predictor import PredictedAssembly
from receptance.fit.problem import one_blas_thread
from receptance.fit.result import Identification
from receptance.fit.unknowns import Law, Tolerance, Unknown, Unknowns, as_unknowns, covered
from receptance.report import ACCEPTED, Column, Provenance, Rejection, Result, Table
from receptance.report.table import Cell

Splits = Literal["leave-one-out", "one-for-all"]
_NUMBER = re.compile(r"[-+]?\d[\d.]*(?:e[-+]?\d+)?")


@dataclass(frozen=True, kw_only=True)
class Split:
    """One fit and its predictions."""

    held_out: tuple[str, ...]
    """Configurations that are predicted."""
    fitted: tuple[str, ...]
    """Configurations that are fitted."""
    identified: Identification | None = field(repr=False)
    """The fit; None where none of the unknowns is in the fitted configurations."""
    modes: tuple[PredictedMode, ...]
    """Measured natural frequencies and peaks, and their predictions."""
    frfs: tuple[PredictedFRF, ...]
    """Receptances."""
    not_predicted: tuple[str, ...]
    """Configurations that could not be predicted, and the reasons."""
    notes: tuple[str, ...] = ()


@dataclass(frozen=True, kw_only=True)
class Transfer(Result):
    """Predictions of configurations that were not fitted, compared with their measurements."""

    splits: tuple[Split, ...]
    """The splits, with one fit each."""
    level: float
    """Level of the intervals."""
    seed: int
    """Seed of starts and draws."""
    campaign_notes: tuple[str, ...] = field(default=(), repr=False)
    """Notes of the campaign."""
    provenance: Provenance = field(default_factory=Provenance, repr=False)

    heading = "Transfer"
    plotted_by = "receptance.predict.figure:draw_transfer"

    @property
    def modes(self) -> tuple[PredictedMode, ...]:
        """Natural frequencies and peaks of all splits."""
        return tuple(mode for split in self.splits for mode in split.modes)

    @property
    def frfs(self) -> tuple[PredictedFRF, ...]:
        """Receptances of all splits."""
        return tuple(frf for split in self.splits for frf in split.frfs)

    @property
    def not_predicted(self) -> tuple[str, ...]:
        """Configurations that could not be predicted, and the reasons."""
        return tuple(dict.fromkeys(reason for split in self.splits for reason in split.not_predicted))

    @property
    def advice(self) -> dict[str, int]:
        """Advice of the fits with the number of splits; texts that differ in numbers alone count as the first."""
        texts = [text for split in self.splits if split.identified is not None for text in split.identified.warnings()]
        alike = [_NUMBER.sub("", text) for text in texts]
        return {texts[alike.index(one)]: alike.count(one) for one in dict.fromkeys(alike)}

    @property
    def rejection(self) -> Rejection:
        """Rejections of the fits, each with the assemblies that were predicted by the fit."""
        fits = [(", ".join(split.held_out), split.identified) for split in self.splits]
        return sum((fit.rejection.of(name) for name, fit in fits if fit is not None), ACCEPTED)

    @property
    def rms_percent(self) -> float | None:
        """Root mean square error of the natural frequencies; None where none was predicted."""
        errors = [mode.error_percent for mode in self.modes if mode.error_percent is not None]
        return float(np.sqrt(np.mean(np.square(errors)))) if errors else None

    @property
    def bias_percent(self) -> float | None:
        """Mean error of the natural frequencies."""
        errors = [mode.error_percent for mode in self.modes if mode.error_percent is not None]
        return float(np.mean(errors)) if errors else None

    @property
    def inside(self) -> tuple[int, int]:
        """Number of natural frequencies in their intervals, and number of those with a useful interval."""
        known = [inside for mode in self.modes if (inside := _is_inside(mode, self.level)) is not None]
        return sum(known), len(known)

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes of the campaign, of the splits and on the intervals."""
        return tuple(dict.fromkeys([*self.campaign_notes, *(note for split in self.splits for note in split.notes)]))

    @property
    def identified(self) -> dict[str, list[float | None]]:
        """Identified values by name, one for each split; errors of tolerances left out, None where it has none."""
        fits = [split.identified for split in self.splits]
        names = dict.fromkeys(name for fit in fits if fit for name in fit.values if name not in fit.errors)
        return {name: [None if fit is None else fit.values.get(name) for fit in fits] for name in names}

    def tables(self) -> list[Table]:
        """Return natural frequencies and FRFs with their measurements, and identified values over the splits."""
        tables = [self._mode_table(), self._frf_table(), self._value_table()]
        return [table for table in tables if table.rows]

    def sentences(self) -> list[str]:
        """Return errors, the share of intervals that hold the measured values, and the configurations not predicted."""
        return [f"{self._headline()}.", *(f"not predicted: {reason}." for reason in self.not_predicted)]

    def warnings(self) -> list[str]:
        """Return the advice of the fits, with the number of splits."""
        return [f"{text} (in {count} of {len(self.splits)} splits)" for text, count in self.advice.items()]

    def data(self) -> dict[str, Any]:
        """Return all predictions with their measurements, by split."""
        return {
            "level": self.level,
            "seed": self.seed,
            "rms_percent": self.rms_percent,
            "bias_percent": self.bias_percent,
            "inside": self.inside[0],
            "modes": len(self.modes),
            "intervals_uninformative": len(self.modes) - self.inside[1],
            "splits": [_split_as_dict(split, self.level) for split in self.splits],
        }

    def _mode_table(self) -> Table:
        columns = (
            "held out",
            Column("mode", form="d"),
            Column("measured", "Hz", ".1f"),
            Column("predicted", "Hz", ".1f"),
            Column("error", "%", "+.2f"),
            Column("interval", "Hz", ".1f"),
            Column("inside"),
        )
        rows: list[list[Cell]] = [
            [
                mode.label or mode.configuration,
                "-" if mode.mode is None else mode.mode,
                mode.measured_hz,
                "none" if mode.predicted_hz is None else mode.predicted_hz,
                mode.error_percent,
                UNINFORMATIVE if mode.uninformative(self.level) else _interval(mode, self.level),
                _is_inside(mode, self.level),
            ]
            for mode in self.modes
        ]
        return Table(f"Natural frequencies held out, {100.0 * self.level:g} % intervals", columns, rows)

    def _frf_table(self) -> Table:
        columns = ("held out", Column("log-spectral\ndistance", "dB", ".2f"), Column("lines in\nthe band", "%", ".0f"))
        rows: list[list[Cell]] = []
        for frf in self.frfs:
            share = frf.share_within(self.level)
            rows.append([frf.name, frf.rms_decibel, UNINFORMATIVE if share is None else 100.0 * share])
        return Table("Frequency responses held out", columns, rows)

    def _value_table(self) -> Table:
        rows: list[list[Cell]] = []
        for name, values in self.identified.items():
            known = sorted(value for value in values if value is not None)
            apart = 100.0 * (known[-1] / known[0] - 1.0) if known[0] > 0.0 else None
            rows.append([name, len(known), known[0], known[-1], apart])
        extent = (Column("least"), Column("most"), Column("apart", "%", ".2g"))
        return Table("Identified over the splits, SI units", ("parameter", Column("splits", form="d"), *extent), rows)

    def __repr__(self) -> str:
        return f"Transfer({self._headline()})"

    def _headline(self) -> str:
        parts = [f"{len(self.splits)} splits"]
        if self.rms_percent is not None:
            hits, count = self.inside
            parts.append(f"{len(self.modes)} modes predicted to {self.rms_percent:.3g} % rms")
            parts.append(f"{self.bias_percent:+.2f} % on average")
            parts.append(f"{hits} of {count} in their {100.0 * self.level:g} % intervals")
            if len(self.modes) > count:
                parts.append(f"{len(self.modes) - count} without an interval, or with one too wide to be useful")
        if self.frfs:
            worst = max(frf.rms_decibel or 0.0 for frf in self.frfs)
            parts.append(f"{len(self.frfs)} FRFs at most {worst:.3g} dB off")
        return ", ".join(parts)


@one_blas_thread()
def transfer(
    observations: Observation | Sequence[Observation],
    unknowns: Unknowns,
    *,
    tolerances: Tolerance | Sequence[Tolerance] = (),
    splits: Splits | Iterable[Sequence[str]] = "leave-one-out",
    level: float = 0.95,
    draws: int = 200,
    seed: int = 0,
    progress: Callable[[str], None] | None = None,
    **options: Unpack[FitKeywords],
) -> Transfer:
    """Identify on some configurations and predict the others, for every split.

    Observations of one configuration stay together: they are fitted, or held out. A configuration that is held out has
    its own errors, which are not in the fit, and they widen its intervals.

    Parameters
    ----------
    observations, unknowns, tolerances
        As in `identify`. Unknowns and tolerances that none of the fitted configurations has are left out of a fit.
    splits : {"leave-one-out", "one-for-all"} or iterable of sequence of str, optional
        Configurations held out: each in turn, all but each in turn, or these groups.
    level : float, optional
        Level of the intervals.
    draws : int, optional
        Number of vectors for the bands of receptances; with 0 they are linear, see `PredictedAssembly.receptance`.
    seed : int, optional
        Seed of these draws, and of the starts of the fits.
    progress : callable, optional
        Called with a text at each step.
    **options
        Further options of `identify`, such as strategy, starts and objective.

    Returns
    -------
    Transfer
        Predictions with measurements, by split.

    Raises
    ------
    TypeError, ValueError
        As in `identify`; fewer than two configurations, or a group that leaves no data to fit or names none of them.

    Examples
    --------
    >>> from receptance import STEEL, Assembly, Observation, Part, PointJoint, Segment, Unknown
    >>> from receptance.predict import transfer
    >>> def pair(length):
    ...     tool = Part([Segment(length=length, outer_diameter=0.012, material=STEEL)], name="tool")
    ...     holder = Part([Segment(length=0.1, outer_diameter=0.04, material=STEEL)])
    ...     return Assembly([tool, PointJoint(k_y=1e8, k_theta=1e5), holder])
    >>> measured = [
    ...     Observation.from_modes(
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
    observed = as_observations(observations)
    given = as_unknowns(unknowns)
    errors = _checks.items("tolerances", tolerances, Tolerance, least=0)
    confidence_multiplier(level, None)
    _refuse_free(given)
    # Observations without a name are named by their number, which must be the same in every split.
    observed = tuple(altered(o, configuration=o.site(i).configuration) for i, o in enumerate(observed))
    names = tuple(dict.fromkeys(o.configuration for o in observed))
    found: list[Split] = []
    groups = list(groups_of(splits, names))
    for group in groups:
        if progress is not None:
            progress(f"holding out {', '.join(group)}, {len(found) + 1} of {len(groups)}")
        sites = [o.site(i) for i, o in enumerate(observed) if o.configuration not in group]
        here = [u for u in given if _in_some((u.address,), u.configurations, u.labels, sites)]
        near = [t for t in errors if _in_some(tuple(t.moves), t.configurations, t.labels, sites)]
        kept = [o for o in observed if o.configuration not in group]
        fit = identify(kept, here, tolerances=near, seed=seed, **options) if here else None
        lost = [u for u in given if u not in here]
        split = Split(
            held_out=group,
            fitted=tuple(dict.fromkeys(o.configuration for o in kept)),
            identified=fit,
            modes=(),
            frfs=(),
            not_predicted=(),
        )
        for observation in observed:
            if observation.configuration in group:
                split = _with_prediction(split, observation, lost, errors, draws, seed)
        found.append(split)
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


def _refuse_free(unknowns: Sequence[Unknown]) -> None:
    for unknown in unknowns:
        if isinstance(unknown, Law) and unknown.free and not unknown.along:
            raise ValueError(
                f"{unknown.address} is free in each configuration, so its value in other configurations is unknown; "
                "give it one value, powers or an individual part to transfer it"
            )


def _in_some(
    addresses: tuple[str, ...],
    configurations: tuple[str, ...] | None,
    labels: tuple[str, ...] | str | None,
    sites: Sequence[Site],
) -> bool:
    """Return whether some site has some of the addresses."""
    among = [site for site in sites if site.among(configurations, labels)]
    return any(covered(address, site.assembly) for address in addresses for site in among)


def _with_prediction(
    split: Split,
    observation: Observation,
    lost: Sequence[Unknown],
    tolerances: Sequence[Tolerance],
    draws: int,
    seed: int,
) -> Split:
    """Return a split with the prediction of an observation, or the reason why there is none.

    `lost` are the unknowns that the fit does not have.
    """
    fit, site = split.identified, replace(observation.site(0), factors=())
    given = () if fit is None else fit.task.parameters.given
    missing = [u.address for u in lost if _in_some((u.address,), u.configurations, u.labels, [site])]
    shared = any(_in_some((u.address,), u.configurations, u.labels, [site]) for u in given)
    if missing or not shared or fit is None:
        names = ", ".join(missing) or "none of the identified parameters"
        reason = f"{names} {'is in' if missing else 'in'} no configuration that is left"
    else:
        try:
            predicted = fit.predictor.at(site, tolerances)
            if not observation.is_receptance:
                modes = predicted.observed_modes(observation, _readings(observation, fit)).modes
                return replace(split, modes=(*split.modes, *modes))
            frf, notes = _predicted_frf(observation, fit, predicted, draws, seed)
            peaks = tuple(peak for peak in frf.peaks if peak.measured_hz is not None)
            return replace(split, frfs=(*split.frfs, frf), modes=split.modes + peaks, notes=(*split.notes, *notes))
        except (ValueError, ReceptanceError) as error:
            reason = str(error)
    reasons = dict.fromkeys([*split.not_predicted, f"{observation.configuration}: {reason}"])
    return replace(split, not_predicted=tuple(reasons))


def _predicted_frf(
    observation: Observation, fit: Identification, predicted: PredictedAssembly, draws: int, seed: int
) -> tuple[PredictedFRF, list[str]]:
    """Return the prediction of a receptance, and a note where its band is linear for want of models."""
    noise = observation.standard_deviation
    if noise is None or not fit.known_scatter:
        deviation = _residual_deviation(fit) if "logarithm" in fit.units else 0.0
        noise = np.full(observation.frequency_hz.size, deviation)
    try:
        return predicted.observed(observation, noise, draws=draws, seed=seed), []
    except ReceptanceError as error:
        note = f"{observation.label or observation.configuration}: its band is linear, because {error}"
        return predicted.observed(observation, noise, seed=seed), [note]


def _residual_deviation(fit: Identification) -> float:
    """Return the standard deviation of a residual that was estimated by a fit."""
    return float(np.sqrt(fit.residual_variance)) if fit.degrees_of_freedom > 0 else np.inf


def _readings(measured: Observation, fit: Identification) -> NDArray[np.float64] | None:
    """Return the standard deviations of natural frequencies, from the residuals of the fit if none were given."""
    if fit.known_scatter:
        return measured.standard_deviation
    return _residual_deviation(fit) / (100.0 if "percent" in fit.units else 1.0) * measured.frequency_hz.real


def _interval(mode: PredictedMode, level: float) -> tuple[float, float] | None:
    """Return the interval of the measured frequency, from prediction and measurement."""
    return mode.interval_hz(level, mode.measured_deviation_hz)


def _is_inside(mode: PredictedMode, level: float) -> bool | None:
    """Return whether a measured frequency was predicted within its interval; None without a useful interval."""
    return False if mode.predicted_hz is None else mode.within(level)


def _split_as_dict(split: Split, level: float) -> dict[str, Any]:
    fit = split.identified
    return {
        "held_out": split.held_out,
        "fitted": split.fitted,
        "identified": None
        if fit is None
        else {name: {"value": value, "interval": fit.interval(name, level)} for name, value in fit.values.items()},
        "converged": None if fit is None else fit.converged,
        "rms": None if fit is None else fit.rms,
        "advice": [] if fit is None else fit.advice,
        "modes": [
            {
                "configuration": mode.configuration,
                "label": mode.label,
                "mode": mode.mode,
                "measured_hz": mode.measured_hz,
                "predicted_hz": mode.predicted_hz,
                "standard_error_hz": mode.deviation_hz,
                "reading_deviation_hz": mode.measured_deviation_hz,
                "interval_hz": _interval(mode, level),
                "error_percent": mode.error_percent,
                "inside": _is_inside(mode, level),
            }
            for mode in split.modes
        ],
        "frfs": [frf.data(level) for frf in split.frfs],
        "not_predicted": split.not_predicted,
    }
