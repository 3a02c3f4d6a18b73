"""Predictions for a catalogue: receptance and modes of the tip of every tool, with their uncertainty."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from receptance import _checks
from receptance.campaign import CampaignError, predict_assembly
from receptance.campaign.prediction import beyond_spindle, lines_between, spindle_lines
from receptance.catalogue.building import Catalogue
from receptance.catalogue.rows import ToolRow, note_on_flutes
from receptance.errors import ReceptanceError
from receptance.fit import Identification, PredictedFRF
from receptance.fit.covariance import confidence_multiplier
from receptance.frf import FRF
from receptance.frf.plausibility import check_drive_point, low_frequency_rise
from receptance.model.assembly import Assembly
from receptance.model.terminals import MeasuredPart
from receptance.report import ACCEPTED, Rejection

_LINES = 2000
"""Number of lines if neither a step nor a measured spindle gives them."""
_SUBMITTED = 4
"""Largest number of tools in progress, for each worker thread."""


@dataclass(frozen=True, kw_only=True)
class ToolPrediction:
    """The predicted tip of one tool."""

    row: ToolRow
    """The tool."""
    assembly: Assembly
    """The tool in the machine, with the identified values."""
    tip: PredictedFRF = field(repr=False)
    """The receptance of the tip with its band. The band to first order is valid as long as no resonance moves by more
    than about half its width; the intervals of modes are valid beyond that."""
    modes: NDArray[np.float64]
    """`(k, 3)` of the modes with a distinct peak: natural frequency in Hz, damping ratio, dynamic stiffness in N/m."""
    modes_deviation: NDArray[np.float64]
    """`(k, 3)` standard deviations of their logarithms."""
    level: float
    """Level of the intervals."""
    rejection: Rejection = ACCEPTED
    """Rejection of the fit; false if it is accepted or there is none."""
    notes: tuple[str, ...] = ()

    @property
    def modes_interval(self) -> NDArray[np.float64]:
        """`(k, 3, 2)` lower and upper ends of the intervals of `modes`."""
        reach = np.exp(confidence_multiplier(self.level, self.tip.degrees_of_freedom) * self.modes_deviation)
        return np.stack([self.modes / reach, self.modes * reach], axis=-1)

    @property
    def most_flexible(self) -> int | None:
        """Index of the mode with the smallest dynamic stiffness; None without modes."""
        return int(np.argmin(self.modes[:, 2])) if len(self.modes) else None

    def as_frf(self) -> FRF:
        """Return the receptance as an FRF for other programs.

        It has no variance: the variance of an FRF is noise that is independent between lines, which errors of a
        prediction are not.
        """
        return FRF(
            frequency_hz=self.tip.frequency_hz,
            values=self.tip.receptance,
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
        identified = campaign.identify(profiles=())
    lines = _lines(catalogue)
    notes = _check_spindle(catalogue, lines)

    def predict(row: ToolRow) -> ToolPrediction:
        try:
            return _predict(catalogue, identified, row, lines, notes, draws, seed)
        except (ValueError, ReceptanceError) as error:
            text = f"line {row.line}, {row.name} cannot be predicted: {error}"
            raise CampaignError.about(catalogue.file, text) from error

    workers = _checks.worker_count(campaign.threads)
    running: deque[Future[ToolPrediction]] = deque()
    with ThreadPoolExecutor(workers) as pool:
        try:
            rows = iter(catalogue.tools)
            for number in range(len(catalogue)):
                while len(running) < _SUBMITTED * workers and (row := next(rows, None)) is not None:
                    running.append(pool.submit(predict, row))
                if number % 50 == 0:
                    campaign.progress(f"tool {number + 1} of {len(catalogue)}")
                yield running.popleft().result()
        finally:
            for future in running:
                future.cancel()


def _predict(
    catalogue: Catalogue,
    identified: Identification | None,
    row: ToolRow,
    lines: NDArray[np.float64],
    notes: Sequence[str],
    draws: int,
    seed: int,
) -> ToolPrediction:
    """Return the prediction of a tool; `notes` are those on the spindle, which all tools share."""
    tool, notes_of_tool = catalogue.assemble(row), list(notes)
    if text := note_on_flutes(row):
        notes_of_tool.append(f"{row.name}: {text}")
    predicted = predict_assembly(catalogue.campaign, identified, tool.site, tool.tolerances, row.name, notes_of_tool, 1)
    linear = predicted.linear(lines)
    modes, scatter = predicted.line_modes(lines, linear)
    return ToolPrediction(
        row=row,
        assembly=predicted.assembly,
        tip=predicted.receptance(lines, draws=draws, seed=seed, linear=linear, phase=False),
        modes=modes.values,
        modes_deviation=scatter.total.reshape(-1, 3),
        level=catalogue.campaign.table.prediction.level,
        rejection=ACCEPTED if identified is None else identified.rejection,
        notes=tuple(notes_of_tool),
    )


def _check_spindle(catalogue: Catalogue, lines: NDArray[np.float64]) -> tuple[str, ...]:
    """Raise CampaignError unless a measured spindle is that of a drive point; return a note on its lowest lines."""
    spindle = catalogue.spindle
    beyond = () if spindle is None else tuple(beyond_spindle(catalogue.campaign, spindle))
    if not isinstance(spindle, MeasuredPart):
        return beyond
    rows, name = np.isin(spindle.frequency_hz, lines), spindle.name or "the spindle"
    for i, entry in enumerate(("translation over force", "rotation over moment")):
        reason = check_drive_point(lines, spindle.matrix[rows, i, i], "receptance").reason
        if reason:
            text = f"the {entry} of {name} is that of a drive point, but {reason}"
            raise CampaignError.about(catalogue.campaign.file, text)
    rise = low_frequency_rise(lines, spindle.matrix[rows, 0, 0], drive_point=True)
    if rise is None:
        return beyond
    return (
        *beyond,
        f'{name}: {rise}. Leave these lines out, under [prediction] lower = "{rise.clear_hz:g} Hz"',
    )


def _lines(catalogue: Catalogue) -> NDArray[np.float64]:
    """Return the lines of the predictions: those of a measured spindle, else those of the table `prediction`."""
    campaign, spindle = catalogue.campaign, catalogue.spindle
    if spindle is not None and np.isfinite(spindle.edges_hz[1]):
        return spindle_lines(campaign, spindle, _LINES - 1)
    upper = campaign.highest_frequency
    if upper is None:
        raise CampaignError.about(
            campaign.file, "the highest frequency of predictions is not given, expected `prediction.upper`"
        )
    return lines_between(campaign, campaign.table.prediction.lower or upper / _LINES, upper, _LINES - 1)
