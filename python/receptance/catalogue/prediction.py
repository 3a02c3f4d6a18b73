"""Predictions for a catalogue: receptance and modes of the tip of every tool, with their uncertainty."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from receptance import _checks
from receptance.campaign import CampaignError, forecast_of
from receptance.campaign.prediction import lines_between
from receptance.catalogue.line_modes import line_modes
from receptance.errors import ReceptanceError
from receptance.frf import FRF
from receptance.frf.plausibility import check_drive_point, low_frequency_rise
from receptance.identification.covariance import confidence_multiplier
from receptance.model.terminals import RESIDUALS, MeasuredPart, ModalPart

if TYPE_CHECKING:
    from receptance.catalogue.building import Catalogue, ToolAssembly
    from receptance.catalogue.rows import ToolRow
    from receptance.identification import Identification
    from receptance.identification.prediction import Forecast
    from receptance.model.assembly import Assembly

_LINES = 2000
"""Number of lines if neither a step nor a measured spindle gives them."""
_SUBMITTED = 4
"""Largest number of tools in progress, for each worker thread."""


@dataclass(frozen=True, kw_only=True)
class ToolPrediction:
    """The predicted tip of one tool.

    Attributes
    ----------
    row : ToolRow
        The tool.
    assembly : Assembly
        The tool in the machine, with the identified values.
    frequency_hz, receptance : ndarray
        `(n,)` lines and the receptance of the tip in m/N.
    deviation : ndarray
        `(n,)` standard deviation of the logarithm of its magnitude, to first order.
    drawn : ndarray
        `(draws, n)` complex receptances, samples of the posterior; empty without draws.
    modes : ndarray
        `(k, 3)` of the modes with a distinct peak: natural frequency in Hz, damping ratio, dynamic stiffness in N/m.
    modes_deviation : ndarray
        `(k, 3)` standard deviations of their logarithms.
    level : float
        Level of the intervals.
    rejection : tuple of str
        Rejection of the fit; empty if it is accepted or there is none.
    notes : tuple of str
        Notes for the user.
    """

    row: ToolRow
    assembly: Assembly
    frequency_hz: NDArray[np.float64]
    receptance: NDArray[np.complex128]
    deviation: NDArray[np.float64]
    modes: NDArray[np.float64]
    modes_deviation: NDArray[np.float64]
    level: float
    drawn: NDArray[np.complex128] = field(repr=False)
    rejection: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    @property
    def modes_interval(self) -> NDArray[np.float64]:
        """`(k, 3, 2)` lower and upper ends of the intervals of `modes`."""
        reach = np.exp(confidence_multiplier(self.level, None) * self.modes_deviation)
        return np.stack([self.modes / reach, self.modes * reach], axis=-1)

    @property
    def most_flexible(self) -> int | None:
        """Index of the mode with the smallest dynamic stiffness; None without modes."""
        return int(np.argmin(self.modes[:, 2])) if len(self.modes) else None

    def band(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return lower and upper magnitude, each `(n,)`: quantiles of the draws, or to first order without draws.

        The first-order band is valid as long as no resonance moves by more than about half its width. The intervals of
        modes are valid beyond that.
        """
        log_size = np.log(np.abs(self.receptance))
        if len(self.drawn):
            low, high = np.quantile(
                np.log(np.abs(self.drawn)), [0.5 - 0.5 * self.level, 0.5 + 0.5 * self.level], axis=0
            )
            return np.exp(np.minimum(low, log_size)), np.exp(np.maximum(high, log_size))
        half_width = confidence_multiplier(self.level, None) * self.deviation
        with np.errstate(over="ignore"):
            return np.exp(log_size - half_width), np.exp(log_size + half_width)

    def as_frf(self) -> FRF:
        """Return the receptance as an FRF for other programs.

        It has no variance: the variance of an FRF is noise that is independent between lines, which errors of a
        prediction are not.
        """
        return FRF(
            frequency_hz=self.frequency_hz,
            values=self.receptance,
            label=self.row.name,
            source="predicted by receptance",
            notes=("predicted, not measured", *self.rejection),
        )


def predict_catalogue(
    catalogue: Catalogue,
    identified: Identification | None = None,
    *,
    draws: int = 0,
    seed: int = 0,
) -> Iterator[ToolPrediction]:
    """Predict the tip of every tool of a catalogue, one after the other in its order.

    As many tools are computed at the same time as the campaign has threads.

    Parameters
    ----------
    catalogue : Catalogue
        Tools, holders and machine.
    identified : Identification, optional
        Result of `Campaign.identify`; computed if it is not given and there are unknowns.
    draws : int, optional
        Number of draws for the band of the receptance; 0 for a band to first order. Intervals of modes are always to
        first order in the logarithms.
    seed : int, optional
        Seed of the draws.

    Yields
    ------
    ToolPrediction
        Predictions in the order of the catalogue; only a few are in memory at the same time.

    Raises
    ------
    CampaignError
        The highest frequency is not given; a tool cannot be predicted, which the message names; or as in
        `Campaign.identify`.
    """
    campaign = catalogue.campaign
    if identified is None and campaign.unknowns:
        identified = campaign.identify()
    predictor = _ToolPredictor(catalogue, identified, draws, seed)
    workers = _checks.worker_count(campaign.threads)
    running: deque[Future[ToolPrediction]] = deque()
    with ThreadPoolExecutor(workers) as pool:
        try:
            rows = iter(catalogue.tools)
            for number in range(len(catalogue)):
                while len(running) < _SUBMITTED * workers and (row := next(rows, None)) is not None:
                    running.append(pool.submit(predictor.predict, row))
                if number % 50 == 0:
                    campaign.progress(f"tool {number + 1} of {len(catalogue)}")
                yield running.popleft().result()
        finally:
            for future in running:
                future.cancel()


class _ToolPredictor:
    """Prediction of a tool, and the data that all tools share."""

    def __init__(self, catalogue: Catalogue, identified: Identification | None, draws: int, seed: int) -> None:
        self.catalogue, self.identified, self.draws, self.seed = catalogue, identified, draws, seed
        self.lines = _lines(catalogue)
        self.level = catalogue.campaign.table.prediction.level
        spindle = catalogue.spindle
        self.residuals: tuple[str, ...] = ()
        self.notes: tuple[str, ...] = ()
        if isinstance(spindle, MeasuredPart):
            rows = np.isin(spindle.frequency_hz, self.lines)
            for i, entry in enumerate(("translation over force", "rotation over moment")):
                reason = check_drive_point(self.lines, spindle.matrix[rows, i, i], "receptance").reason
                if reason:
                    text = f"the {entry} of {spindle.name or 'the spindle'} is that of a drive point, but {reason}"
                    raise CampaignError.about(catalogue.campaign.file, text)
            rise = low_frequency_rise(spindle.frequency_hz[rows], spindle.matrix[rows, 0, 0], drive_point=True)
            if rise is not None:
                self.notes = (
                    f"{spindle.name or 'the spindle'}: {rise}. Leave these lines out, under [prediction] "
                    f'lower = "{rise.clear_hz:g} Hz"',
                )
            if spindle.covariance is not None:
                self.residuals = tuple(f"{spindle.name or 'part'}.{quantity}" for quantity in RESIDUALS)
                self.covariance = spindle.covariance[rows]

    def predict(self, row: ToolRow) -> ToolPrediction:
        try:
            return self._predict(self.catalogue.assemble(row))
        except (ValueError, ReceptanceError) as error:
            text = f"line {row.line}, {row.name} cannot be predicted: {error}"
            raise CampaignError.about(self.catalogue.file, text) from error

    def _predict(self, tool: ToolAssembly) -> ToolPrediction:
        notes = list(self.notes)
        forecast = forecast_of(
            self.catalogue.campaign, self.identified, tool.site, tool.tolerances, tool.row.name, notes
        )
        addresses = [*forecast.addresses, *self.residuals]
        receptance, slopes = forecast.assembly.derivatives(self.lines, addresses, threads=1)
        slope, spindle_slope = np.split(slopes, [len(forecast.addresses)], axis=1)
        # Variance of real and imaginary part, each, from the errors of a measured spindle.
        variance = np.zeros(self.lines.size)
        if self.residuals:
            variance = np.einsum("ni,nij,nj->n", spindle_slope, self.covariance, spindle_slope.conj()).real
        modes = line_modes(self.lines, receptance, variance)
        deviation = forecast.scatter((slope / receptance[:, None]).real).total
        modes_deviation = forecast.scatter(
            modes.log_slopes(slope).reshape(3 * len(modes), slope.shape[1])
        ).total.reshape(-1, 3)
        return ToolPrediction(
            row=tool.row,
            assembly=forecast.assembly,
            frequency_hz=self.lines,
            receptance=receptance,
            deviation=np.hypot(deviation, np.sqrt(variance) / np.abs(receptance)),
            modes=modes.values,
            modes_deviation=np.sqrt(modes_deviation**2 + modes.log_variances(variance)),
            level=self.level,
            drawn=self._drawn(tool.row, forecast, np.sqrt(variance)),
            rejection=() if self.identified is None else self.identified.rejection,
            notes=tuple(notes),
        )

    def _drawn(self, row: ToolRow, forecast: Forecast, noise: NDArray[np.float64]) -> NDArray[np.complex128]:
        """Return draws of the receptance; errors of a measured spindle are drawn for each line, to first order."""
        if not self.draws:
            return np.zeros((0, self.lines.size), np.complex128)
        random = np.random.default_rng([self.seed, row.line])
        drawn = []
        for assembly in forecast.drawn(self.draws, self.seed):
            if assembly is not None:
                real, imaginary = random.standard_normal((2, self.lines.size))
                drawn.append(assembly.receptance(self.lines, threads=1) + noise * (real + 1j * imaginary))
        if 2 * len(drawn) < self.draws:
            raise ReceptanceError(f"only {len(drawn)} of {self.draws} draws can be evaluated")
        return np.array(drawn)


def _lines(catalogue: Catalogue) -> NDArray[np.float64]:
    """Return the lines of the predictions: those of a measured spindle, else those of the table `prediction`."""
    campaign = catalogue.campaign
    settings = campaign.table.prediction
    spindle = catalogue.spindle
    if isinstance(spindle, MeasuredPart):
        lines = np.asarray(spindle.frequency_hz)
        low, high = settings.lower or 0.0, settings.upper or np.inf
        return np.asarray(lines[(lines >= low) & (lines <= high)])
    band = spindle.band_hz if isinstance(spindle, ModalPart) else None
    upper = band[1] if band and settings.upper is None else campaign.highest_frequency
    if upper is None:
        raise CampaignError.about(
            campaign.file, "the highest frequency of predictions is not given, expected `prediction.upper`"
        )
    lower = settings.lower or (band[0] if band else upper / _LINES)
    return lines_between(campaign, lower, upper, _LINES - 1)
