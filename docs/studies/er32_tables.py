"""The tables of Matthias et al. 2016 as printed, and assemblies of the packaged campaign `er32`.

The paper does not print the holder's shape. The holder of the campaign is inferred; see `INFERENCE`.
"""

from __future__ import annotations

import csv
import functools
import re
import tempfile
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

import numpy as np

import receptance as rc
from receptance import campaign, examples

DATA = Path(__file__).parent / "data"
SOURCE = "Matthias, Ozsahin, Altintas, Denkena, CIRP J. Manuf. Sci. Technol. 2016, doi 10.1016/j.cirpj.2016.02.005"
INFERENCE = (
    "The paper gives the holder's length (table 1) but not its shape. Four steel sections and the carbide's modulus "
    "and density were fitted to 30 natural frequencies: the 20 PREDICTED ones of table 2 and the 10 measured at 135 "
    "N m of table 4, with the joint stiffnesses of table 5."
)
E_TOOL, LENGTH = "tool.segment[0].youngs_modulus", "tool.segment[0].length"
"""Addresses of the modulus and of the overhang of the blank."""
BOUNDS = {"k_y": (1e6, 1e13), "k_theta": (1e2, 1e9)}
"""Bounds of the stiffnesses when they are fitted."""
_Row = TypeVar("_Row")
Stiffness = Mapping[float, Sequence[float]]
"""(k_y, k_theta) by diameter in mm."""


class Mount(NamedTuple):
    """A row of table 1: the assembly on which a joint is identified."""

    diameter_mm: float
    overhang_mm: float
    insertion_mm: float
    holder_length_mm: float


class PrintedTransfer(NamedTuple):
    """A row of table 2: natural frequencies at another overhang, measured and as predicted in the paper."""

    diameter_mm: float
    overhang_mm: float
    measured_hz: tuple[float, ...]
    predicted_hz: tuple[float, ...]


class ParameterSet(NamedTuple):
    """A row of table 3: a joint that reproduces the tip FRF in the machine."""

    name: str
    diameter_mm: float
    k_y: float
    k_theta: float
    c_theta: float | None


class Reading(NamedTuple):
    """A row of table 4: two natural frequencies at a clamping torque, and the stiffnesses identified in the paper."""

    diameter_mm: float
    torque_nm: float
    frequency_hz: tuple[float, float]
    k_y: float
    k_theta: float


class Setup(NamedTuple):
    """A row of table 5: overhangs and stiffnesses used in the machine."""

    diameter_mm: float
    overhang_medium_mm: float
    overhang_long_mm: float | None
    k_y: float
    k_theta: float


class PrintedStiffness(NamedTuple):
    """Stiffnesses printed in the running text."""

    where: str
    diameter_mm: float
    k_y: float
    k_theta: float


@dataclass(frozen=True)
class Published:
    """The tables, row by row."""

    mounts: tuple[Mount, ...]
    transfers: tuple[PrintedTransfer, ...]
    parameter_sets: tuple[ParameterSet, ...]
    readings: tuple[Reading, ...]
    setups: tuple[Setup, ...]
    text: tuple[PrintedStiffness, ...]
    torque_nm: float
    """Recommended clamping torque."""

    def mount(self, diameter_mm: float) -> Mount:
        """Return the row of table 1 of a tool."""
        return next(mount for mount in self.mounts if mount.diameter_mm == diameter_mm)

    def setup(self, diameter_mm: float) -> Setup:
        """Return the row of table 5 of a tool."""
        return next(setup for setup in self.setups if setup.diameter_mm == diameter_mm)

    def reading(self, diameter_mm: float, torque_nm: float | None = None) -> Reading:
        """Return the row of table 4 of a tool at a torque, by default the recommended one."""
        wanted = (diameter_mm, self.torque_nm if torque_nm is None else torque_nm)
        return next(r for r in self.readings if (r.diameter_mm, r.torque_nm) == wanted)

    @property
    def long_tools(self) -> tuple[PrintedTransfer, ...]:
        """The rows of table 2 with the longest overhang of each tool."""
        longest = {t.diameter_mm: t for t in sorted(self.transfers, key=lambda t: t.overhang_mm)}
        return tuple(longest[diameter] for diameter in sorted(longest))


@functools.cache
def load() -> Published:
    """Read the printed tables."""
    text = tomllib.loads(_read("text.toml"))
    return Published(
        mounts=_rows(Mount, "table1_assemblies"),
        transfers=_rows(PrintedTransfer, "table2_transfer"),
        parameter_sets=_rows(ParameterSet, "table3_parameter_sets"),
        readings=_rows(Reading, "table4_torque"),
        setups=_rows(Setup, "table5_parameters"),
        text=tuple(PrintedStiffness(**printed) for printed in text["stiffness"]),
        torque_nm=float(text["recommended_torque_nm"]),
    )


def _read(name: str) -> str:
    return (DATA / f"er32_{name}").read_text(encoding="utf-8")


def _rows(kind: type[_Row], name: str) -> tuple[_Row, ...]:
    """Return the rows of a table: columns are named as fields, but for the unit of joints and the number of a mode."""
    rows = []
    for row in csv.DictReader(line for line in _read(f"{name}.csv").splitlines() if not line.startswith("#")):
        values: dict[str, Any] = {}
        for column, cell in row.items():
            field = re.sub("_(n_per_m|nm_per_rad|nms_per_rad)$", "", column)
            if re.search(r"_\d_hz$", field):
                values[f"{field[:-5]}_hz"] = (*values.get(f"{field[:-5]}_hz", ()), *([float(cell)] if cell else []))
            else:
                values[field] = cell if field == "name" else float(cell) if cell else None
        rows.append(kind(**{field: values[field] for field in kind._fields}))
    return tuple(rows)


@functools.cache
def parts() -> tuple[rc.Part, rc.Part]:
    """Return a blank and the inferred holder of the packaged campaign `er32`."""
    with tempfile.TemporaryDirectory() as folder:
        examples.write("er32", folder)
        blank, _, holder = campaign.load(folder).assemblies["d12_medium"].elements.values()
    assert isinstance(blank, rc.Part)
    assert isinstance(holder, rc.Part)
    return blank, holder


def assembly(diameter_mm: float, overhang_mm: float, k_y: float = 1e9, k_theta: float = 1e5) -> rc.Assembly:
    """Return the free assembly of "tool", "joint" and inferred "holder", whose length is that of table 1."""
    blank, holder = parts()
    *front, taper = holder.segments
    # The taper takes up the remainder of the holder's length.
    length = 1e-3 * load().mount(diameter_mm).holder_length_mm - sum(segment.length for segment in front)
    tool = replace(blank.segments[0], length=1e-3 * overhang_mm, outer_diameter=1e-3 * diameter_mm)
    joint = rc.PointJoint(k_y=k_y, k_theta=k_theta, name="joint")
    return rc.Assembly(
        [rc.Part([tool], name="tool"), joint, rc.Part([*front, replace(taper, length=length)], name="holder")]
    )


def rms(values: Sequence[float]) -> float:
    """Return the root of the mean square."""
    return float(np.sqrt(np.mean(np.square(values))))


def predict_transfers(published: Published, stiffness: Stiffness) -> list[dict[str, Any]]:
    """Predict the natural frequencies of table 2, one dictionary for each mode."""
    rows = []
    for transfer in published.transfers:
        model = assembly(transfer.diameter_mm, transfer.overhang_mm, *stiffness[transfer.diameter_mm])
        predicted = model.lowest_natural_frequencies(len(transfer.measured_hz))[0].tolist()
        for mode, (measured, paper, ours) in enumerate(
            zip(transfer.measured_hz, transfer.predicted_hz, predicted, strict=True), 1
        ):
            rows.append(
                {
                    "diameter_mm": transfer.diameter_mm,
                    "overhang_mm": transfer.overhang_mm,
                    "mode": mode,
                    "measured_hz": measured,
                    "published_hz": paper,
                    "predicted_hz": ours,
                    "error_percent": 100.0 * (ours / measured - 1.0),
                    "published_error_percent": 100.0 * (paper / measured - 1.0),
                }
            )
    return rows
