"""Cuts of a campaign: coefficients with their uncertainty, and the source of the receptance of the tip."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

from receptance.campaign.data_files import (
    parse_deviation_share,
    read_entry,
    restrict_to_bands,
    with_stated_variance,
)
from receptance.frf import FRF
from receptance.identification import MeasuredFRF
from receptance.stability import Lobes, Milling, Turning

if TYPE_CHECKING:
    from collections.abc import Mapping

    from receptance.campaign.build import Builder
    from receptance.campaign.measurements import Measurement
    from receptance.campaign.problems import KeyPath
    from receptance.campaign.schema import CampaignTable, TipTable

__all__ = ["CampaignCut", "Tip", "build_cut"]


@dataclass(frozen=True, kw_only=True)
class Tip:
    """Source of the receptance of a tool tip in one direction.

    Attributes
    ----------
    name : str
        Free-text label.
    assembly : str
        Name of the assembly that is predicted; empty for a measured tip.
    frf : FRF or None
        Measured FRF.
    file : str
        File of the FRF; empty for a measurement of the campaign and for a predicted tip.
    """

    name: str
    assembly: str = ""
    frf: FRF | None = None
    file: str = ""


@dataclass(frozen=True, kw_only=True)
class CampaignCut:
    """A cut of a campaign.

    Attributes
    ----------
    name : str
        Name in the file.
    cut : Milling or Turning
        The cut.
    spread : dict of str to float
        Standard deviations of the logarithms of the coefficients.
    x, y : Tip
        Tip in the direction of feed (in turning, of the chip thickness) and across it; y is None if it is rigid.
    """

    name: str
    cut: Milling | Turning
    x: Tip
    y: Tip | None = None
    spread: dict[str, float] = field(default_factory=dict)

    def label(self, lobes: Lobes) -> Lobes:
        """Return lobes with the name, the tips and the coefficients of this cut."""
        tips = {"x": self.x.name, "y": None if self.y is None else self.y.name}
        return replace(lobes, name=self.name, tips=tips, spread=self.spread)

    def drawn(self, draws: int, seed: int) -> tuple[Milling, ...] | tuple[Turning, ...] | None:
        """Return cuts with drawn coefficients; None if the coefficients are exact."""
        if not any(self.spread.values()):
            return None
        return self.cut.drawn(draws, **self.spread, seed=seed)


def build_cut(
    name: str,
    table: CampaignTable,
    assemblies: Mapping[str, object],
    measurements: Mapping[str, Measurement],
    folder: Path,
    builder: Builder,
) -> CampaignCut | None:
    """Return a cut, or None after its mistakes are added."""
    own, path = table.cuts[name], ("cuts", name)
    cut = builder.element(own, path, **({} if own.kind == "milling" else {"angle_deg": own.angle}))
    spread = {
        key: deviation.of(getattr(own, key)) / getattr(own, key)
        for key, deviation in own.tolerance
        if deviation is not None and getattr(own, key) > 0.0
    }
    x = _tip((*path, "x"), own.x, assemblies, measurements, folder, builder)
    y = x if own.kind == "milling" else None
    if own.kind == "milling" and own.y == "rigid":
        y = None
    elif own.kind == "milling" and not isinstance(own.y, str):
        y = _tip((*path, "y"), own.y, assemblies, measurements, folder, builder)
    if cut is None or x is None or builder.problems.at(path):
        return None
    return CampaignCut(name=name, cut=cut, spread=spread, x=x, y=y)


def _tip(
    path: KeyPath,
    table: TipTable,
    assemblies: Mapping[str, object],
    measurements: Mapping[str, Measurement],
    folder: Path,
    builder: Builder,
) -> Tip | None:
    given = [key for key in ("assembly", "measurement", "file") if getattr(table, key) is not None]
    if len(given) != 1:
        found = " and ".join(given) or "neither an assembly, a measurement nor a file"
        builder.problems.add(path, f"has {found}, expected one of the three")
        return None
    if table.assembly is not None:
        if table.bands is not None:
            builder.problems.add(
                (*path, "bands"),
                "is given for a predicted tip, expected `lower` and `upper` under [prediction] instead",
            )
            return None
        return (
            Tip(name=f"predicted, {table.assembly}", assembly=table.assembly) if table.assembly in assemblies else None
        )
    if table.measurement is not None:
        if table.measurement not in measurements:
            return None
        frf = builder.make((*path, "measurement"), _measured, measurements[table.measurement], builder, path)
        frf = _within(path, table, frf, builder)
        return None if frf is None else Tip(name=f"measured, {table.measurement}", frf=frf)
    if builder.problems.at(path):
        return None
    frf = builder.make((*path, "file"), _read, table, folder)
    if frf is None:
        return None
    for note in frf.notes:
        builder.note(path, note)
    frf = _within(path, table, frf, builder)
    return None if frf is None else Tip(name=f"measured, {table.file}", frf=frf, file=str(table.file))


def _within(path: KeyPath, table: TipTable, frf: FRF | None, builder: Builder) -> FRF | None:
    """Return the FRF with only the lines of the bands usable, or None after a mistake is added."""
    if frf is None or table.bands is None:
        return frf
    return builder.make((*path, "bands"), restrict_to_bands, frf, table.bands)


def _measured(measured: Measurement, builder: Builder, path: KeyPath) -> FRF:
    """Return the FRF of a measurement."""
    seen = measured.observation
    if not isinstance(seen, MeasuredFRF):
        raise ValueError(f'is "{measured.name}", natural frequencies; expected a measured FRF')
    if seen.frequency_hz.dtype.kind == "c":
        raise ValueError(f'is "{measured.name}", with an exponential window; expected an FRF without one')
    if "theta" in (seen.response.direction, seen.excitation.direction):
        raise ValueError(f'is "{measured.name}", a rotation or caused by a moment; expected a translation over a force')
    if measured.sensor is not None:
        builder.note(path, f"the receptance includes the mass of the sensor {measured.sensor}")
    # The variance of an FRF is that of one line.
    variance = None if seen.standard_deviation is None else seen.standard_deviation**2 / seen.correlated_lines
    return FRF(
        frequency_hz=seen.frequency_hz,
        values=seen.receptance,
        log_variance=variance,
        correlated_lines=seen.correlated_lines,
        label=measured.name,
    )


def _read(table: TipTable, folder: Path) -> FRF:
    share = parse_deviation_share(table.standard_deviation)
    return with_stated_variance(read_entry(table, folder), share).to("receptance")
