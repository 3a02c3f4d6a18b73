"""The tables of Matthias et al. 2016 as printed, and assemblies of the packaged campaign `er32`.

The paper does not print the holder's shape. The holder of the campaign is inferred; see `INFERENCE`.
"""

from __future__ import annotations

import csv
import functools
import re
import tempfile
import tomllib
from dataclasses import dataclass, replace
from importlib import resources
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

from receptance.model.assembly import Assembly
from receptance.model.beams import Part, Segment
from receptance.model.joints import PointJoint

if TYPE_CHECKING:
    from receptance.campaign import Campaign

SOURCE = "Matthias, Ozsahin, Altintas, Denkena, CIRP J. Manuf. Sci. Technol. 2016, doi 10.1016/j.cirpj.2016.02.005"
INFERENCE = (
    "The paper gives the holder's length (table 1) but not its shape. Four steel sections and the carbide's modulus "
    "and density were fitted to 30 natural frequencies: the 20 PREDICTED ones of table 2 and the 10 measured at 135 "
    "N m of table 4, with the joint stiffnesses of table 5."
)
_Row = TypeVar("_Row")


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
    """Read the packaged tables.

    Examples
    --------
    >>> from receptance.studies import er32
    >>> er32.load().mount(12.7).overhang_mm
    62.3
    """
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
    return (resources.files("receptance.studies") / "data" / f"er32_{name}").read_text(encoding="utf-8")


def _rows(kind: type[_Row], name: str) -> tuple[_Row, ...]:
    """Return the rows of a table: columns are named as fields, but for the unit of joints and the number of a mode."""
    found = []
    for row in csv.DictReader(line for line in _read(f"{name}.csv").splitlines() if not line.startswith("#")):
        values: dict[str, Any] = {}
        for column, cell in row.items():
            field = re.sub("_(n_per_m|nm_per_rad|nms_per_rad)$", "", column)
            if re.search(r"_\d_hz$", field):
                values[f"{field[:-5]}_hz"] = (*values.get(f"{field[:-5]}_hz", ()), *([float(cell)] if cell else []))
            else:
                values[field] = cell if field == "name" else float(cell) if cell else None
        found.append(kind(**{field: values[field] for field in kind._fields}))  # type: ignore[attr-defined]
    return tuple(found)


@functools.cache
def campaign() -> Campaign:
    """Return the packaged campaign `er32`: inferred holder, blanks, and the measured natural frequencies."""
    from receptance import campaign as campaigns
    from receptance import examples

    with tempfile.TemporaryDirectory() as folder:
        examples.write("er32", folder)
        return campaigns.load(folder)


def assembly(diameter_mm: float, overhang_mm: float, k_y: float = 1e9, k_theta: float = 1e5) -> Assembly:
    """Return the freely suspended assembly of blank, point joint and inferred holder.

    Parameters
    ----------
    diameter_mm, overhang_mm : float
        Blank in mm; the holder's length is that of table 1 for this diameter.
    k_y, k_theta : float, optional
        Joint in N/m and N m/rad.

    Returns
    -------
    Assembly
        Of the elements "tool", "joint" and "holder".

    Examples
    --------
    >>> from receptance.studies import er32
    >>> er32.assembly(12.7, 113.2, 6.28e8, 1.04e5).natural_frequencies(6e3).round()
    array([1129., 4917.])
    """
    built = campaign().built
    *front, taper = built.parts["holder"].segments
    # The taper takes up the remainder of the holder's length.
    length = 1e-3 * load().mount(diameter_mm).holder_length_mm - sum(segment.length for segment in front)
    blank = Segment(length=1e-3 * overhang_mm, outer_diameter=1e-3 * diameter_mm, material=built.materials["carbide"])
    joint = PointJoint(k_y=k_y, k_theta=k_theta, name="joint")
    return Assembly([Part([blank], name="tool"), joint, Part([*front, replace(taper, length=length)], name="holder")])
