"""The tool tip of a cut, measured or predicted: receptances and modes, and draws of both."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from receptance.campaign.prediction import forecast_of, prediction_lines
from receptance.complex_modes import damped_modes
from receptance.frf.low_frequency import low_frequency_rise
from receptance.stability import TipModes, receptance_draws, receptance_matrix

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.assembly import Assembly
    from receptance.campaign.campaign import Campaign
    from receptance.campaign.cuts import Tip
    from receptance.frf import FRF
    from receptance.identification import Identification
    from receptance.identification.prediction import Forecast
    from receptance.modal import ModeEstimate

__all__ = ["Tips"]


class Tips:
    """The tip of a cut in one or two directions.

    Parameters
    ----------
    campaign : Campaign
        What it belongs to.
    identified : Identification or None
        What predictions rest on.
    draws : int
        Number of draws of all that is uncertain in them.
    seed : int
        Seed of the draws.
    tips : sequence of Tip or None
        In the direction of feed, and across it; None where it is rigid.
    threads : int or None
        As in `Assembly.receptance`.

    Attributes
    ----------
    lines : ndarray
        `(n,)` in Hz.
    uncertain : bool
        Whether something is known of the errors of one of them.
    notes : list of str
        What a person should know.
    """

    def __init__(
        self,
        campaign: Campaign,
        identified: Identification | None,
        draws: int,
        seed: int,
        tips: Sequence[Tip | None],
        threads: int | None,
    ) -> None:
        self.notes: list[str] = []
        # One tip in both directions is the same draw in both.
        given = [tip for tip in tips if tip is not None]
        own = [tip for i, tip in enumerate(given) if not any(tip is other for other in given[:i])]
        predicted = [_predicted(campaign, identified, tip, self.notes) for tip in own]
        measured = [tip.frf for tip in own if tip.frf is not None]
        if measured:
            self.lines = receptance_matrix(measured[0], measured[-1])[0]
        else:
            self.lines = prediction_lines(campaign, next(p.assembly for p in predicted if p is not None))
        self._sources: list[_Source] = []
        for tip, made in zip(own, predicted, strict=True):
            if made is not None:
                self._sources.append(_Predicted(made, self.lines, draws, seed, threads))
            elif tip.frf is not None:
                self._sources.append(_Measured(tip, tip.frf, self.lines, draws, seed, self.notes))
        self._directions = [None if t is None else next(i for i, o in enumerate(own) if o is t) for t in tips]
        self.uncertain = any(source.uncertain for source in self._sources)

    def receptance(self) -> NDArray[np.complex128]:
        """`(n, d, d)` in m/N, for d directions."""
        return self._matrix([source.values() for source in self._sources])

    def receptances(self) -> tuple[NDArray[np.complex128], NDArray[np.bool_]]:
        """Draws that have a model `(m, n, d, d)`, and which they are."""
        drawn = [source.drawn_values() for source in self._sources]
        good = np.all([np.isfinite(values).all(axis=1) for values in drawn], axis=0)
        self._count(good)
        return self._matrix([values[good] for values in drawn]), good

    def modes(self) -> TipModes:
        """Modes in x and y."""
        return self._modes([source.modes() for source in self._sources])

    def drawn_modes(self) -> tuple[list[TipModes], NDArray[np.bool_]]:
        """Draws of the modes that have a model, and which they are."""
        drawn = [source.drawn_modes() for source in self._sources]
        together = list(zip(*drawn, strict=True))
        good = np.array([all(one is not None for one in each) for each in together])
        self._count(good)
        return [self._modes([m for m in each if m is not None]) for each in together if None not in each], good

    def _count(self, good: NDArray[np.bool_]) -> None:
        lost = int(np.count_nonzero(~good))
        if lost:
            self.notes.append(
                f"{lost} of {good.size} draws have no model (a joint that is not passive, say) and are left out"
            )

    def _matrix(self, values: list[NDArray[np.complex128]]) -> NDArray[np.complex128]:
        size = len(self._directions)
        matrix = np.zeros((*values[0].shape, size, size), np.complex128)
        for i, source in enumerate(self._directions):
            if source is not None:
                matrix[..., i, i] = values[source]
        return matrix

    def _modes(self, modes: list[TipModes]) -> TipModes:
        """Modes of all directions; each source has its shapes in x."""
        chosen = [(i, modes[source]) for i, source in enumerate(self._directions) if source is not None]
        return TipModes(
            frequency_hz=np.concatenate([own.frequency_hz for _, own in chosen]),
            damping_ratio=np.concatenate([own.damping_ratio for _, own in chosen]),
            shapes=np.concatenate([np.roll(own.shapes, i, axis=1) for i, own in chosen]),
        )


def _predicted(campaign: Campaign, identified: Identification | None, tip: Tip, notes: list[str]) -> Forecast | None:
    if not tip.assembly:
        return None
    effects = campaign.effects.get(tip.assembly, {})
    return forecast_of(campaign, identified, campaign.place_of(tip.assembly), effects, tip.assembly, notes)


class _Predicted:
    """A tip that the model predicts."""

    def __init__(
        self, forecast: Forecast, lines: NDArray[np.float64], draws: int, seed: int, threads: int | None
    ) -> None:
        self._forecast, self._lines, self._draws, self._seed = forecast, lines, draws, seed
        self._threads = threads
        self.uncertain = forecast.uncertain

    def values(self) -> NDArray[np.complex128]:
        return self._forecast.assembly.receptance(self._lines, threads=self._threads)

    def drawn_values(self) -> NDArray[np.complex128]:
        nothing = np.full(self._lines.size, np.nan, np.complex128)
        assemblies = self._forecast.drawn(self._draws, self._seed)
        return np.array(
            [nothing if one is None else one.receptance(self._lines, threads=self._threads) for one in assemblies]
        )

    def modes(self) -> TipModes:
        return self._modes_of(self._forecast.assembly)

    def drawn_modes(self) -> list[TipModes | None]:
        assemblies = self._forecast.drawn(self._draws, self._seed)
        return [None if one is None else self._modes_of(one) for one in assemblies]

    def _modes_of(self, assembly: Assembly) -> TipModes:
        found = damped_modes(assembly, float(self._lines[-1]), threads=self._threads)
        constant = found.modal_constant.real
        seen = constant > 1e-9 * np.max(constant, initial=0.0)
        return TipModes(
            frequency_hz=found.frequency_hz[seen],
            damping_ratio=found.damping_ratio[seen],
            shapes=np.stack([np.sqrt(constant[seen]), np.zeros(np.count_nonzero(seen))], axis=1),
        )


class _Measured:
    """A tip that was measured."""

    def __init__(self, tip: Tip, frf: FRF, lines: NDArray[np.float64], draws: int, seed: int, notes: list[str]) -> None:
        receptance = frf.masked().to("receptance")
        self._frf = receptance.with_(usable=np.isin(receptance.frequency_hz, lines)).masked()
        self._draws, self._seed = draws, seed
        self.uncertain = frf.log_variance is not None
        if not self.uncertain:
            key = "`averages` or `standard_deviation`" if tip.file else "the measurement a standard deviation"
            notes.append(f"{tip.name}: it has no variance, so it is taken as exact; give {key}")
        rise = low_frequency_rise(self._frf.frequency_hz, self.values(), drive_point=True)
        if rise is not None:
            notes.append(
                f"{tip.name}: {rise}. Limits that these lines decide are wrong then; leave them out, "
                f'bands = [["{rise.clear_hz:g} Hz", "{self._frf.frequency_hz[-1]:g} Hz"]]'
            )

    def values(self) -> NDArray[np.complex128]:
        return np.asarray(self._frf.values[:, 0, 0])

    def drawn_values(self) -> NDArray[np.complex128]:
        if not self.uncertain:
            return np.repeat(self.values()[None], self._draws, axis=0)
        return receptance_draws(self._frf, draws=self._draws, seed=self._seed)[:, :, 0, 0]

    def modes(self) -> TipModes:
        return TipModes.from_estimates(self._estimates())

    def drawn_modes(self) -> list[TipModes | None]:
        if not self.uncertain:
            return [self.modes()] * self._draws
        return list(TipModes.drawn_from_estimates(self._estimates(), draws=self._draws, seed=self._seed))

    def _estimates(self) -> list[ModeEstimate]:
        from receptance.modal import fit_modes

        found = fit_modes(self._frf)
        return [one for one in map(found.mode, range(found.frequency_hz.size)) if one.modal_constant.real > 0.0]


_Source = _Measured | _Predicted
