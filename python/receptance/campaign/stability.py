"""Stability of the cuts of a campaign: receptances of their tool tips, lobes, and the error of the stable depth."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property, partial
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from receptance import modal
from receptance._text import did_you_mean
from receptance.campaign.cuts import CampaignCut, Tip
from receptance.campaign.data import CampaignData
from receptance.campaign.identification import identify_campaign
from receptance.campaign.prediction import beyond_spindle, predict_assembly, prediction_lines, source_of
from receptance.campaign.problems import errors_about
from receptance.diagnosis import HeldOut, Metric
from receptance.fit import Identification, Observation
from receptance.fit.predictor import PredictedAssembly
from receptance.frf import FRF
from receptance.frf.plausibility import low_frequency_rise
from receptance.modal import ModeEstimate
from receptance.model.assembly import Assembly
from receptance.model.modes import damped_modes
from receptance.model.terminals import RESIDUALS, MeasuredPart, ModalPart, Terminal
from receptance.report import ACCEPTED, Rejection
from receptance.stability import (
    Lobes,
    Milling,
    Stability,
    TipModes,
    Turning,
    critical_depths,
    receptance_draws,
    receptance_matrix,
    rotated_receptance,
    semi_discretised_lobes,
    stability_lobes,
)
from receptance.stability.lobes import limited_above, with_rejection, without_limits
from receptance.stability.tip import beyond_lines

_Value = TypeVar("_Value")


class Tips:
    """The tip of a cut in the direction of feed and across it, or rotated from it; None for a rigid one.

    `lines` are `(n,)` frequency lines in Hz, and `uncertain` is whether the errors of at least one tip are known.
    """

    def __init__(
        self,
        campaign: CampaignData,
        identified: Identification | None,
        tips: Sequence[Tip | None],
        rotation_deg: float = 0.0,
    ) -> None:
        self.notes: list[str] = []
        self._rotation_deg = rotation_deg
        # The same tip in both directions has the same draws.
        several = [tip for tip in tips if tip is not None]
        each = [tip for i, tip in enumerate(several) if not any(tip is other for other in several[:i])]
        predicted = [_predicted_tip(campaign, identified, tip, self.notes) for tip in each]
        measured = [tip.frf for tip in each if tip.frf is not None]
        if measured:
            self.lines = receptance_matrix(measured[0], measured[-1])[0]
        else:
            self.lines = prediction_lines(campaign, next(p.assembly for p in predicted if p is not None))
        self._spindles = [end for p in predicted if p is not None and isinstance(end := _end_of(p.assembly), Terminal)]
        for spindle in self._spindles:
            self.notes += beyond_spindle(campaign, spindle)
            self.lines = self.lines[spindle.covers(self.lines)]
            if not self.lines.size:
                raise ValueError(f"the spindle {source_of(spindle)} is known on none of the lines of the other tip")
        self._draws, self._seed = campaign.table.stability.number_of_draws, campaign.table.stability.seed
        self._threads, self._measured_band = campaign.threads, campaign.measured_band
        self._sources: list[PredictedAssembly | _MeasuredTip] = []
        for tip, prediction in zip(each, predicted, strict=True):
            if prediction is not None:
                self._sources.append(prediction)
            elif tip.frf is not None:
                self._sources.append(_MeasuredTip(tip, tip.frf, self.lines, campaign, self.notes))
        self._has_modes = bool(predicted) and all(one is not None and one.has_uncertain_modes for one in predicted)
        if self._has_modes and campaign.table.prediction.step is None:
            self.lines = self._resolved(self.lines)
        self._directions = [None if t is None else next(i for i, o in enumerate(each) if o is t) for t in tips]
        self.uncertain = any(source.uncertain for source in self._sources)

    def receptance(self) -> NDArray[np.complex128]:
        """Return the receptance of the tip in m/N, `(n, d, d)` for d directions of the cut."""
        return self._matrix(self._nominal)

    @cached_property
    def _nominal(self) -> list[NDArray[np.complex128]]:
        """The receptance of each source."""
        return [s.values() if isinstance(s, _MeasuredTip) else self._receptance_of(s.assembly) for s in self._sources]

    def above_lines(self, cut: Milling | Turning) -> tuple[float, float] | None:
        """Return the least depth in m at which the model chatters above the lines, and the frequency in Hz.

        None where the tip does not end with modes that were identified. Measurements do not show modes above their
        lines, but a tool has some, and in lobes of much depth they chatter first. Modes of the spindle above what was
        measured stand for all others, and their resonances are not those of the machine: what counts is a mode that the
        tip has with their receptances and with their static ones, at the larger one of the two depths.
        """
        if not self._has_modes:
            return None
        lines = np.geomspace(self.lines[-1], _ABOVE * self.lines[-1], _LINES_ABOVE)
        fitted = [_beyond_band(source.assembly) for source in self._predicted]
        static = [
            _static_above(assembly, self._highest_measured(source.assembly))
            for assembly, source in zip(fitted, self._predicted, strict=True)
        ]
        limits = []
        for assemblies in (fitted, static):
            receptances = [assembly.receptance(lines, threads=self._threads) for assembly in assemblies]
            depth = critical_depths(cut, lines, self._matrix(receptances))[0].min(axis=1)
            limits.append((float(depth.min()), float(lines[np.argmin(depth)])))
        return max(limits)

    def _highest_measured(self, assembly: Assembly) -> float:
        """Return the highest frequency in Hz at which the modes at the end of a tip were measured."""
        band = _end_of(assembly).band_hz or self._measured_band
        return float(self.lines[-1]) if band is None else float(band[1])

    @property
    def _predicted(self) -> list[PredictedAssembly]:
        return [source for source in self._sources if not isinstance(source, _MeasuredTip)]

    def _resolved(self, lines: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return as many lines between the same ends, dense where the logarithm of a tip changes fast.

        Between lines limits are interpolated: where a resonance has few lines, they are too high.
        """
        dense = np.linspace(lines[0], lines[-1], _DENSER * lines.size)
        path = np.zeros(dense.size - 1)
        for source in self._predicted:
            steps = np.abs(np.diff(np.log(source.assembly.receptance(dense, threads=self._threads))))
            path += steps + np.mean(steps)
        length = np.concatenate([[0.0], np.cumsum(path)])
        return np.asarray(np.interp(np.linspace(0.0, length[-1], lines.size), length, dense), dtype=np.float64)

    def beyond_lines(self) -> tuple[str, ...]:
        """Return for each direction of the tips that the lines do not contain its mode, and what to do."""
        measured = [isinstance(source, _MeasuredTip) for source in self._sources]
        remedies = ["a wider measurement, or wider `bands`"] if any(measured) else []
        remedies += [] if all(measured) else ["`lower` and `upper` under [prediction]"]
        texts = beyond_lines(self.lines, self._diagonal(self._nominal))
        return tuple(f"{text} ({' or '.join(remedies)})" for text in texts)

    def receptances(self) -> tuple[NDArray[np.complex128], NDArray[np.bool_]]:
        """Return valid draws of the receptance `(m, n, d, d)`, and a mask of the valid draws."""
        drawn, good = self._valid(
            [
                s.drawn_values()
                if isinstance(s, _MeasuredTip)
                else s.drawn_receptances(self._receptance_of, s.linear(self.lines), self._draws, self._seed)
                for s in self._sources
            ]
        )
        return self._matrix([np.array(values) for values in drawn]), good

    def beside_gaps(self, receptance: NDArray[np.complex128]) -> tuple[str, ...]:
        """Return why limits may be too high: the largest response of a tip lies beside lines without a spindle."""
        gaps = [(s, gap) for s in self._spindles if isinstance(s, MeasuredPart) for gap in s.gaps_hz]
        if not gaps:
            return ()
        texts = []
        for spindle, (low, high) in gaps:
            at = np.searchsorted(self.lines, low)
            edges = [i for i in (at, at + 1) if i < self.lines.size]
            size = np.abs(np.einsum("nii->ni", receptance))
            if edges and np.any(size[edges].max(axis=0) > _BESIDE_GAP * size.max(axis=0)):
                texts.append(
                    f"the spindle {source_of(spindle)} is not known between {low:g} and {high:g} Hz, beside the "
                    "largest response of the tip: a lower limit may lie there. Identify its modes, "
                    "`receptance spindle CAMPAIGN --modes auto`"
                )
        lost = sum(high - low for _, (low, high) in gaps)
        self.notes.append(
            f"the spindle is not known in {len(gaps)} gaps of {lost:.0f} Hz together; a limit by chatter in one of "
            "them is not seen"
        )
        return tuple(texts)

    def modes(self) -> TipModes:
        """Return the modes in x and y."""
        return self._joined(
            [s.modes() if isinstance(s, _MeasuredTip) else self._modes_of(s.assembly) for s in self._sources]
        )

    def drawn_modes(self) -> tuple[list[TipModes], NDArray[np.bool_]]:
        """Return valid draws of the modes, and a mask of the valid draws."""
        drawn, good = self._drawn(_MeasuredTip.drawn_modes, self._modes_of)
        for source, modes in zip(self._sources, drawn, strict=True):
            if not isinstance(source, _MeasuredTip):
                modes[:] = [
                    one.with_errors(*source.model_errors(one.frequency_hz.size, number, self._seed))
                    for number, one in zip(np.flatnonzero(good).tolist(), modes, strict=True)
                ]
        return [self._joined(list(each)) for each in zip(*drawn, strict=True)], good

    def require_modes(self) -> None:
        """Raise unless the modes of every tip can be computed."""
        for spindle in self._spindles:
            raise ValueError(
                f"the spindle {source_of(spindle)} is given as data, and semi-discretisation needs the modes of a tip, "
                'which are those of beams or of a measured tip; expected `method = "mean force"` under [stability]'
            )

    def _drawn(
        self, measured: Callable[[_MeasuredTip], Sequence[_Value]], predicted: Callable[[Assembly], _Value]
    ) -> tuple[list[list[_Value]], NDArray[np.bool_]]:
        """Return a value of each source for all draws that can be evaluated, and a mask of these."""
        return self._valid(
            [
                measured(s) if isinstance(s, _MeasuredTip) else s.draw(predicted, self._draws, self._seed)
                for s in self._sources
            ]
        )

    def _valid(self, drawn: Sequence[Sequence[_Value | None]]) -> tuple[list[list[_Value]], NDArray[np.bool_]]:
        """Return the values of draws that all sources have, and a mask of these."""
        good = np.array([all(value is not None for value in each) for each in zip(*drawn, strict=True)])
        lost = int(np.count_nonzero(~good))
        if lost:
            self.notes.append(
                f"{lost} of {good.size} draws cannot be evaluated (for example with a joint that is not passive) and "
                "are left out"
            )
        if 2 * lost > good.size:
            raise ValueError(f"only {good.size - lost} of {good.size} draws can be evaluated; give smaller tolerances")
        kept = np.flatnonzero(good).tolist()
        return [[value for i in kept if (value := values[i]) is not None] for values in drawn], good

    def _receptance_of(self, assembly: Assembly) -> NDArray[np.complex128]:
        return assembly.receptance(self.lines, threads=self._threads)

    def _modes_of(self, assembly: Assembly) -> TipModes:
        modes = damped_modes(assembly, float(self.lines[-1]), threads=self._threads)
        constant = modes.modal_constant.real
        seen = constant > 1e-9 * np.max(constant, initial=0.0)
        return TipModes(
            frequency_hz=modes.frequency_hz[seen],
            damping_ratio=modes.damping_ratio[seen],
            shapes=np.stack([np.sqrt(constant[seen]), np.zeros(np.count_nonzero(seen))], axis=1),
        )

    def _matrix(self, values: list[NDArray[np.complex128]]) -> NDArray[np.complex128]:
        """Return the matrix in the directions of the cut."""
        matrix = self._diagonal(values)
        return rotated_receptance(matrix, self._rotation_deg) if self._rotation_deg else matrix

    def _diagonal(self, values: list[NDArray[np.complex128]]) -> NDArray[np.complex128]:
        """Return the matrix in the directions of the tips."""
        size = len(self._directions)
        matrix = np.zeros((*values[0].shape, size, size), np.complex128)
        for i, source in enumerate(self._directions):
            if source is not None:
                matrix[..., i, i] = values[source]
        return matrix

    def _joined(self, modes: list[TipModes]) -> TipModes:
        """Return the modes of all directions from sources with shapes in x."""
        chosen = [(i, modes[source]) for i, source in enumerate(self._directions) if source is not None]
        joined = TipModes(
            frequency_hz=np.concatenate([own.frequency_hz for _, own in chosen]),
            damping_ratio=np.concatenate([own.damping_ratio for _, own in chosen]),
            shapes=np.concatenate([np.roll(own.shapes, i, axis=1) for i, own in chosen]),
        )
        return joined.rotated(self._rotation_deg) if self._rotation_deg else joined


def _predicted_tip(
    campaign: CampaignData, identified: Identification | None, tip: Tip, notes: list[str]
) -> PredictedAssembly | None:
    if not tip.assembly:
        return None
    tolerances = campaign.tolerances.get(tip.assembly, ())
    return predict_assembly(campaign, identified, campaign.site(tip.assembly), tolerances, tip.assembly, notes)


def _static_above(assembly: Assembly, highest_hz: float) -> Assembly:
    """Return an assembly whose spindle has the static receptance of its modes above a frequency in place of them."""
    spindle = _end_of(assembly)
    residual = dict.fromkeys(RESIDUALS, 0.0)
    changes: dict[str, float] = {}
    for i, mode in enumerate(spindle.modes):
        if mode.frequency_hz > highest_hz:
            static = mode.entries(np.array([_STATIC * highest_hz]))[0].real
            residual = {name: value + float(more) for (name, value), more in zip(residual.items(), static, strict=True)}
            changes |= {f"{spindle.name}.mode[{i}].{name}": 0.0 for name in _SHAPE}
    changes |= {f"{spindle.name}.{name}": getattr(spindle, name) + value for name, value in residual.items()}
    return assembly.replace(changes)


def _end_of(assembly: Assembly) -> Any:
    return next(reversed(assembly.elements.values()))


def _beyond_band(assembly: Assembly) -> Assembly:
    """Return an assembly whose modes at its end have values on all lines: those above represent what is there."""
    *chain, end = assembly.elements.values()
    if not isinstance(end, ModalPart) or end.band_hz is None:
        return assembly
    return Assembly([*chain, replace(end, band_hz=None)], assembly.attachments.values(), motion=assembly.motion)


class _MeasuredTip:
    """A tip that was measured."""

    def __init__(
        self, tip: Tip, frf: FRF, lines: NDArray[np.float64], campaign: CampaignData, notes: list[str]
    ) -> None:
        receptance = frf.masked().to("receptance")
        self._frf = receptance.with_(usable=np.isin(receptance.frequency_hz, lines)).masked()
        self._progress = campaign.progress
        self._draws, self._seed = campaign.table.stability.number_of_draws, campaign.table.stability.seed
        self.uncertain = frf.log_variance is not None
        if not self.uncertain:
            key = "`averages` or `standard_deviation`" if tip.file else "the measurement a standard deviation"
            notes.append(f"{tip.name}: the FRF has no variance and is treated as exact; give {key}")
        rise = low_frequency_rise(self._frf.frequency_hz, self.values(), drive_point=True)
        if rise is not None:
            notes.append(
                f"{tip.name}: {rise}. Limits that depend on these lines are then wrong; leave them out, "
                f'bands = [["{rise.clear_hz:g} Hz", "{self._frf.frequency_hz[-1]:g} Hz"]]'
            )

    def values(self) -> NDArray[np.complex128]:
        return np.asarray(self._frf.values[:, 0, 0])

    def drawn_values(self) -> list[NDArray[np.complex128]]:
        if not self.uncertain:
            return [self.values()] * self._draws
        return list(receptance_draws(self._frf, draws=self._draws, seed=self._seed)[:, :, 0, 0])

    def modes(self) -> TipModes:
        return TipModes.from_estimates(self._estimates())

    def drawn_modes(self) -> list[TipModes]:
        if not self.uncertain:
            return [self.modes()] * self._draws
        return list(TipModes.drawn_from_estimates(self._estimates(), draws=self._draws, seed=self._seed))

    def _estimates(self) -> list[ModeEstimate]:
        found = modal.fit_modes(self._frf, progress=self._progress)
        return [one for one in map(found.mode, range(found.frequency_hz.size)) if one.modal_constant.real > 0.0]


_DENSER = 10
"""Lines among which those of a tip are chosen, by their number."""
_ABOVE, _LINES_ABOVE = 2.5, 3000
"""Highest frequency of modes that are not measured, over that of the lines, and the number of lines up to it."""
_STATIC = 1e-3
"""Frequency of the receptance that is called static, over that of the highest line."""
_SHAPE = ("y", "theta", "y_imaginary", "theta_imaginary")
_BESIDE_GAP = 0.5
"""Share of the largest magnitude of a tip above which a limit may lie in a gap beside the line."""
_SEARCH_RATIO = 10.0
"""Largest depth of semi-discretisation, over the smallest depth by the mean force, by default."""


def stability_of_campaign(
    campaign: CampaignData,
    identified: Identification | None,
    *,
    cuts: Sequence[str] = (),
) -> Stability:
    """Return the stability of the cuts of a campaign; see `Campaign.stability`."""
    chosen = campaign.select_cuts(cuts)
    settings = campaign.table.stability
    speeds = campaign.spindle_speeds()
    if not any(cut.is_predicted for cut in chosen):
        identified = None
    elif identified is None and campaign.unknowns:
        identified = identify_campaign(campaign)
    found = {}
    provenance = campaign.provenance(settings=settings.data())
    for number, cut in enumerate(chosen, 1):
        campaign.progress(f"lobes of {cut.name}, {number} of {len(chosen)}")
        directions = (cut.x, cut.y) if isinstance(cut.cut, Milling) else (cut.x,)
        with errors_about(campaign.file, f"cuts.{cut.name}: "):
            of_fit = identified.rejection if identified is not None and cut.is_predicted else ACCEPTED
            if of_fit.unusable:
                lobes = cut.label(without_limits(cut.cut, speeds, of_fit))
            else:
                tips = Tips(campaign, identified, directions, cut.rotation_deg)
                lobes = with_rejection(_lobes(campaign, cut, tips, speeds), of_fit)
            found[cut.name] = replace(lobes, provenance=provenance)
    notes = [*(campaign.notes if identified is None else identified.notes)]
    notes += [f"{name}: {note}" for name, one in found.items() for note in one.notes]
    return Stability(found, identified=identified, provenance=provenance, notes=notes)


def _lobes(campaign: CampaignData, cut: CampaignCut, tips: Tips, speeds: NDArray[np.float64]) -> Lobes:
    settings = campaign.table.stability
    several = cut.drawn(settings.number_of_draws, settings.seed)
    uncertain = tips.uncertain or several is not None
    receptance = tips.receptance()
    if reasons := (*tips.beyond_lines(), *tips.beside_gaps(receptance)):
        lobes = without_limits(cut.cut, speeds, Rejection(unusable=reasons).of(f"cuts.{cut.name}"))
        return replace(cut.label(lobes), notes=tuple(dict.fromkeys(tips.notes)))
    if settings.method == "mean force":
        draws, good = tips.receptances() if tips.uncertain else (None, np.ones(settings.number_of_draws, np.bool_))
        lobes = stability_lobes(
            cut.cut,
            tips.lines,
            receptance,
            speeds_rpm=speeds,
            draws=draws,
            cuts=_selected(several, good),
        )
        if above := tips.above_lines(cut.cut):
            lobes = limited_above(lobes, *above, float(tips.lines[-1]), settings.seed)
    else:
        assert isinstance(cut.cut, Milling)
        tips.require_modes()
        most = settings.largest_depth
        if most is None:
            most = _SEARCH_RATIO * float(critical_depths(cut.cut.even, tips.lines, receptance)[0].min())
        modes, good = tips.drawn_modes() if tips.uncertain else (None, np.ones(settings.number_of_draws, np.bool_))
        lobes = semi_discretised_lobes(
            cut.cut,
            tips.modes(),
            speeds_rpm=speeds,
            most=most,
            draws=modes,
            cuts=_selected(several, good),
            threads=campaign.threads,
            progress=campaign.progress,
        )
    notes = [*tips.notes, *lobes.notes]
    if not uncertain:
        notes.append("there is no band, because errors of tip and coefficients are not known: give tolerances")
    return replace(
        cut.label(lobes),
        probability=settings.probability if uncertain else None,
        notes=tuple(dict.fromkeys(notes)),
    )


def _selected(cuts: Sequence[Any] | None, good: NDArray[np.bool_]) -> list[Any] | None:
    return None if cuts is None else [cut for cut, kept in zip(cuts, good, strict=True) if kept]


_METRICS = ("stable_depth",)
"""Names of metrics."""


def named_metrics(campaign: CampaignData, names: Sequence[str]) -> dict[str, Metric]:
    """Return metrics by name, for `Campaign.diagnose`.

    `stable_depth` is the error in percent, for each cut of the campaign, of the depth that is stable at every speed. It
    is computed from held-out FRFs of a tip, which replace the tip of the cut in both directions, or in x if y is rigid.
    """
    found: dict[str, Metric] = {}
    for name in names:
        if name not in _METRICS:
            raise campaign.error(
                f'there is no metric "{name}"; there are {", ".join(_METRICS)}{did_you_mean(name, _METRICS)}'
            )
        if not campaign.cuts:
            raise campaign.error(f"there is no cut for the metric {name}, expected [cuts.NAME]")
        for cut in campaign.cuts.values():
            if isinstance(cut.cut, Milling):
                with errors_about(campaign.file, f"the metric {name} uses the mean force: "):
                    cut.cut.require_even(f"cuts.{cut.name}")
        if not any(_is_tip_receptance(observation) for observation in campaign.measurements.values()):
            text = f"no measurement can be used for {name}, expected an FRF with response and excitation at one place, "
            text += "both along y"
            raise campaign.error(text)
        for cut in campaign.cuts.values():
            found[f"stable depth of {cut.name}, error in percent"] = partial(_error_of_depth, cut)
    return found


def _is_tip_receptance(observation: Observation) -> bool:
    """Return whether an observation is a drive-point FRF of translation without an exponential window."""
    if not observation.is_receptance or observation.frequency_hz.dtype.kind == "c":
        return False
    response, excitation = observation.response, observation.excitation
    same = (response.part, response.position) == (excitation.part, excitation.position)
    return same and response.direction == excitation.direction == "y"


def _error_of_depth(cut: CampaignCut, one: HeldOut) -> float:
    seen = one.observation
    if not seen.is_receptance or one.receptance is None or not _is_tip_receptance(seen):
        return math.nan
    lines = seen.frequency_hz.real
    measured, predicted = (
        _always_stable_depth(cut, lines, receptance) for receptance in (seen.receptance, one.receptance)
    )
    return 100.0 * abs(predicted / measured - 1.0) if math.isfinite(measured) else math.nan


def _always_stable_depth(cut: CampaignCut, lines: NDArray[np.float64], receptance: NDArray[np.complex128]) -> float:
    """Return the depth in m that is stable at all speeds; NaN if the lines do not contain the mode."""
    matrix = receptance[:, None, None] * np.diag([1.0, 0.0 if cut.y is None else 1.0])
    if isinstance(cut.cut, Turning):
        matrix = receptance[:, None, None]
    elif cut.rotation_deg:
        matrix = rotated_receptance(matrix, cut.rotation_deg)
    if beyond_lines(lines, matrix):
        return math.nan
    return float(critical_depths(cut.cut, lines, matrix)[0].min())
