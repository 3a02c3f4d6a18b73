"""From the cuts of a campaign to coefficients with their spread, and to where the receptance of the tip is from."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path as FilePath
from typing import TYPE_CHECKING

from receptance.frf import FRF
from receptance.identification import MeasuredFRF
from receptance.stability import Milling, Turning

if TYPE_CHECKING:
    from collections.abc import Mapping

    from receptance.campaign.builder import Builder
    from receptance.campaign.format import CampaignTable, TipTable
    from receptance.campaign.lines import Path
    from receptance.campaign.observations import Measurement

__all__ = ["CampaignCut", "Tip", "build_cut"]


@dataclass(frozen=True, kw_only=True)
class Tip:
    """Where the receptance of a tool tip in one direction comes from.

    Attributes
    ----------
    name : str
        For people.
    assembly : str
        Name of the assembly that is predicted; empty where the tip was measured.
    frf : FRF or None
        What was measured.
    file : str
        Name of the file that it was read from; empty where it is a measurement of the campaign or predicted.
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
        Its name in the file.
    cut : Milling or Turning
        The cut.
    spread : dict of str to float
        Standard deviations of the logarithms of its coefficients.
    x, y : Tip
        The tip in the direction of feed (the chip's thickness in turning) and across it; y is None where it is rigid.
    """

    name: str
    cut: Milling | Turning
    x: Tip
    y: Tip | None = None
    spread: dict[str, float] = field(default_factory=dict)

    def drawn(self, draws: int, seed: int) -> tuple[Milling, ...] | tuple[Turning, ...] | None:
        """Return cuts that may be the true one; None where the coefficients are exact."""
        if not any(self.spread.values()):
            return None
        return self.cut.drawn(draws, **self.spread, seed=seed)


def build_cut(
    name: str,
    table: CampaignTable,
    assemblies: Mapping[str, object],
    measurements: Mapping[str, Measurement],
    folder: FilePath,
    builder: Builder,
) -> CampaignCut | None:
    """Return a cut, or None after its mistakes are added."""
    own, path = table.cuts[name], ("cuts", name)
    if own.kind == "milling":
        cut = builder.element(Milling, own, path)
    else:
        cut = builder.element(Turning, own, path, angle_deg=own.angle)
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
    path: Path,
    table: TipTable,
    assemblies: Mapping[str, object],
    measurements: Mapping[str, Measurement],
    folder: FilePath,
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
                (*path, "bands"), "belongs to a file or a measurement, expected `lower` and `upper` under [prediction]"
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


def _within(path: Path, table: TipTable, frf: FRF | None, builder: Builder) -> FRF | None:
    """Return the FRF with the lines of the bands alone usable, or None after a mistake is added."""
    from receptance.campaign import frf_files

    if frf is None or table.bands is None:
        return frf
    return builder.make((*path, "bands"), frf_files.within, frf, table.bands)


def _measured(measured: Measurement, builder: Builder, path: Path) -> FRF:
    """Return a measured FRF of the campaign on the lines that count."""
    seen = measured.observation
    if not isinstance(seen, MeasuredFRF):
        raise ValueError(f'is "{measured.name}", natural frequencies, expected a measured FRF')
    if seen.frequency_hz.dtype.kind == "c":
        raise ValueError(f'is "{measured.name}", with an exponential window, so it is no receptance of the tip')
    if "theta" in (seen.response.direction, seen.excitation.direction):
        raise ValueError(f'is "{measured.name}", a rotation or of a moment, expected a translation over a force')
    if measured.sensor is not None:
        builder.note(path, f"the mass of {measured.sensor} is in it, which was on the tip when it was measured")
    # The variance of an FRF is that of each line alone.
    variance = None if seen.standard_deviation is None else seen.standard_deviation**2 / seen.correlated_lines
    return FRF(
        frequency_hz=seen.frequency_hz,
        values=seen.receptance,
        log_variance=variance,
        correlated_lines=seen.correlated_lines,
        label=measured.name,
    )


def _read(table: TipTable, folder: FilePath) -> FRF:
    from receptance.campaign import frf_files

    return frf_files.weighed(frf_files.read(table, folder), frf_files.deviation_share(table.standard_deviation)).to(
        "receptance"
    )
