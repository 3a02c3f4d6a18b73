"""The cuts of a campaign, and the tips that they need."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

import numpy as np

from receptance.campaign.build import Builder, Mistake
from receptance.campaign.keys import ElementTable
from receptance.campaign.measurements import MeasurementReader, read_entry, restrict_to_bands
from receptance.campaign.problems import KeyPath
from receptance.campaign.schema import TipTable
from receptance.fit import Observation
from receptance.frf import FRF
from receptance.frf.frf import with_variance
from receptance.stability import Lobes, Milling, Turning
from receptance.stability.cutting import CLOSED_DEG
from receptance.stability.tip import require_drive_point


@dataclass(frozen=True, kw_only=True)
class Tip:
    """Source of the receptance of a tool tip in one direction."""

    name: str
    """Free-text label."""
    assembly: str = ""
    """Name of the assembly that is predicted; empty for a measured tip."""
    frf: FRF | None = None
    """Measured FRF."""
    file: str = ""
    """File of the FRF; empty for a measurement of the campaign and for a predicted tip."""


@dataclass(frozen=True, kw_only=True)
class CampaignCut:
    """A cut of a campaign."""

    name: str
    """Name in the file."""
    cut: Milling | Turning
    """The cut."""
    x: Tip
    """Tip in the direction of feed, in turning of the chip thickness."""
    y: Tip | None = None
    """Tip across it; None if it is rigid."""
    spread: dict[str, float] = field(default_factory=dict)
    """Standard deviations of the logarithms of the coefficients."""
    rotation_deg: float = 0.0
    """Angle in degrees from the feed to the direction of `x`."""
    radial_depth: float | None = None
    """Radial depth in m, if the file states it as a length."""

    @property
    def tips(self) -> tuple[Tip, ...]:
        """Tips that are not rigid."""
        return (self.x,) if self.y is None else (self.x, self.y)

    @property
    def is_predicted(self) -> bool:
        """Whether a tip is that of an assembly."""
        return any(tip.assembly for tip in self.tips)

    def label(self, lobes: Lobes) -> Lobes:
        """Return lobes with the name, the tips and the coefficients of this cut."""
        rotated = f", {self.rotation_deg:g} deg from the feed" if self.rotation_deg else ""
        tips = {"x": f"{self.x.name}{rotated}", "y": None if self.y is None else self.y.name}
        return replace(lobes, name=self.name, tips=tips, spread=self.spread)

    def with_tool(self, teeth: int | None, diameter: float) -> CampaignCut:
        """Return the cut with a tool of another number of teeth, if it is known, and of another diameter in m.

        Raises
        ------
        ValueError
            Teeth that differ in pitch or helix.
        """
        if not isinstance(self.cut, Milling):
            return self
        self.cut.require_even(f"cuts.{self.name}")
        immersion = self.cut.immersion if self.radial_depth is None else min(self.radial_depth / diameter, 1.0)
        return replace(self, cut=replace(self.cut, teeth=teeth or self.cut.teeth, immersion=immersion))

    def drawn(self, draws: int, seed: int) -> tuple[Milling, ...] | tuple[Turning, ...] | None:
        """Return cuts with drawn coefficients; None if the coefficients are exact."""
        if not any(self.spread.values()):
            return None
        return self.cut.drawn(draws, **self.spread, seed=seed)


def build_cut(name: str, reader: MeasurementReader, measurements: Mapping[str, Observation]) -> CampaignCut:
    """Return a cut."""
    own, path, builder = reader.campaign.cuts[name], ("cuts", name), reader.builder
    spread = {
        key: deviation.of(getattr(own, key)) / getattr(own, key)
        for key, deviation in own.tolerance.items()
        if getattr(own, key) > 0.0
    }
    made_from = {"angle_deg": own.angle} if own.kind == "turning" else _of_cutter(own, path, builder)
    tips = {"x": own.x} if own.kind == "turning" or isinstance(own.y, str) else {"x": own.x, "y": own.y}
    cut, *made = builder.together(
        (
            partial(builder.element, own, path, **made_from),
            *(partial(_tip, (*path, key), table, reader, measurements) for key, table in tips.items()),
        )
    )
    builder.require(path)
    rigid = own.kind == "turning" or own.y == "rigid"
    tip = CampaignCut(name=name, cut=cut, spread=spread, x=made[0], y=None if rigid else made[-1])
    if own.kind == "turning":
        return tip
    if own.rotation and own.y == "as x":
        builder.note((*path, "rotation"), 'has no effect with y = "as x": the tip is then the same in all directions')
    depth, is_length = own.radial_depth
    return replace(tip, rotation_deg=own.rotation, radial_depth=depth if is_length else None)


def _of_cutter(own: ElementTable, path: KeyPath, builder: Builder) -> dict[str, Any]:
    """Return the fields of a milling cut that its keys state in other terms; mistakes are added."""
    depth, is_length = own.radial_depth
    at = (*path, "radial_depth")
    if is_length and own.diameter is None:
        text = f"is {1e3 * depth:g} mm, but the cut has no diameter, expected that of the cutter beside it, such as "
        builder.problems.add(at, f'{text}`diameter = "12 mm"`, or a share of it such as 0.5')
    elif is_length and depth > own.diameter:
        text = f"is {1e3 * depth:g} mm, more than the diameter of the cutter, {1e3 * own.diameter:g} mm"
        builder.problems.add(at, f"{text}, expected at most the diameter, which is a slot")
    pitch, helix = own.pitch or (), own.helix or 0.0
    for key, angles in (("pitch", pitch), ("helix", helix)):
        if isinstance(angles, list) and len(angles) != own.teeth:
            number = f"{len(angles)} angle{'s' if len(angles) > 1 else ''}"
            builder.problems.add((*path, key), f"has {number}, expected {own.teeth}, one for each of the teeth")
    if pitch and len(pitch) == own.teeth and abs(sum(pitch) - 360.0) > CLOSED_DEG:
        text = f"has the sum {sum(pitch):.6g} deg, expected 360 deg, a turn"
        builder.problems.add((*path, "pitch"), text)
    if np.any(helix) and own.diameter is None:
        text = 'is given without the diameter of the cutter, expected `diameter = "12 mm"` beside it'
        builder.problems.add((*path, "helix"), text)
    builder.require(path)
    immersion = depth / own.diameter if is_length else depth
    return {
        "immersion": immersion,
        "pitch_deg": tuple(pitch),
        "helix_deg": tuple(helix) if isinstance(helix, list) else helix,
    }


def _tip(path: KeyPath, table: TipTable, reader: MeasurementReader, measurements: Mapping[str, Observation]) -> Tip:
    builder = reader.builder
    given = [key for key in ("assembly", "measurement", "file") if getattr(table, key) is not None]
    if len(given) != 1:
        found = " and ".join(given) or "neither an assembly, a measurement nor a file"
        builder.fail(path, f"has {found}, expected one of the three")
    if table.file is None:
        for key in sorted(table.written - {"assembly", "measurement", "bands"}):
            where = "" if table.measurement is None else f" or in [measurements.{table.measurement}]"
            text = f"is given without `file`, whose contents it describes, expected it there{where}"
            builder.problems.add((*path, key), text)
    if table.assembly is not None and table.bands is not None:
        text = "is given for a predicted tip, expected `lower` and `upper` under [prediction] instead"
        builder.problems.add((*path, "bands"), text)
    builder.require(path)
    if table.assembly is not None:
        if table.assembly not in builder.built.assemblies:
            raise Mistake
        return Tip(name=f"predicted, {table.assembly}", assembly=table.assembly)
    if table.measurement is None:
        frf = builder.make((*path, "file"), lambda: with_variance(read_entry(table, reader.folder)))
        for note in (*frf.notes, *frf.contradictions):
            builder.note(path, note)
    elif table.measurement not in measurements:
        raise Mistake
    else:
        frf = builder.make((*path, "measurement"), _measured, measurements[table.measurement])
        sensor = reader.campaign.measurements[table.measurement].sensor
        if sensor is not None:
            builder.note(path, f"the receptance includes the mass of the sensor {sensor}")
    if table.bands is not None:
        frf = builder.make((*path, "bands"), restrict_to_bands, frf, table.bands)
    builder.make(path, require_drive_point, "the FRF", frf.masked())
    name = f"measured, {table.measurement or table.file}"
    return Tip(name=name, frf=frf.to("receptance"), file=str(table.file or ""))


def _measured(seen: Observation) -> FRF:
    """Return the FRF of a measurement."""
    if not seen.is_receptance:
        raise ValueError(f'is "{seen.label}", natural frequencies; expected a measured FRF')
    if seen.frequency_hz.dtype.kind == "c":
        raise ValueError(f'is "{seen.label}", with an exponential window; expected an FRF without one')
    if "theta" in (seen.response.direction, seen.excitation.direction):
        raise ValueError(f'is "{seen.label}", a rotation or caused by a moment; expected a translation over a force')
    # The variance of an FRF is that of one line.
    variance = None if seen.standard_deviation is None else seen.standard_deviation**2 / seen.correlated_lines
    return FRF(
        frequency_hz=seen.frequency_hz,
        values=seen.receptance,
        log_variance=variance,
        correlated_lines=seen.correlated_lines,
        label=seen.label,
    )
