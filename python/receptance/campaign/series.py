"""Series of a campaign: fits of each level, and parameters over the levels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np

from receptance.campaign.data import CampaignData
from receptance.campaign.schema import SeriesTable
from receptance.campaign.values import kind_of, parse_condition
from receptance.coupling import ForceSeries
from receptance.errors import ReceptanceError
from receptance.fit import Identification, identify
from receptance.fit.observation import Observation
from receptance.fit.unknowns import Law, Unknown, covered
from receptance.report import Column, Provenance, Results, Table
from receptance.report.table import Cell
from receptance.units import split

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
        for name, one in self.items():
            groups.setdefault((name.partition(".")[0], tuple(one.force)), []).append(one)
        tables = []
        for (owner, levels), group in groups.items():
            columns = [Column(self.over, self.unit, "g")]
            cells: list[list[Cell]] = [list(levels)]
            for one in group:
                half = 1.96 * one.standard_errors
                columns += [Column(one.name.partition(".")[2], kind_of(one.name).unit, ".5g")]
                columns += [Column("95 % interval", form=".5g")]
                cells += [one.values.tolist(), list(zip(one.values - half, one.values + half, strict=True))]
            tables.append(Table(f"{owner} over {self.over}", columns, list(zip(*cells, strict=True))))
        return [*tables, *super().tables()]

    def data(self) -> dict[str, Any]:
        """Return the parameters with their laws and trends."""
        return {
            "over": self.over,
            "unit": self.unit,
            "parameters": {name: one.data() for name, one in self.items()},
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
    found = {}
    for law in fit.task.parameters.given:
        if not isinstance(law, Law) or not law.free or law.along != table.over:
            continue
        rows = []
        for name, square in squares.items():
            title = law.name_in(name)
            if title in fit.values and np.isfinite(fit.standard_errors[title]):
                level = campaign.site(name).conditions[table.over] / factor
                left = max(float(np.sqrt(np.mean(square))), 1.0) if fit.known_scatter else 1.0
                rows.append((level, fit.values[title], fit.standard_errors[title] * left))
        rows.sort()
        columns = np.array(rows).T if len(rows) >= LEAST_LEVELS else None
        if columns is not None and np.all(np.diff(columns[0]) > 0.0) and columns[0, 0] >= 0.0:
            found[law.name] = ForceSeries(
                name=law.name, force=columns[0], values=columns[1], standard_errors=columns[2]
            )
    return LevelSeries(found, over=table.over, unit=unit, provenance=campaign.provenance())


def level_unit(table: SeriesTable) -> tuple[str, float]:
    """Return the unit of the levels in the file, and its value in SI units.

    Examples
    --------
    >>> from receptance.campaign.series import level_unit
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
