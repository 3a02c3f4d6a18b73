"""The tables of Matthias et al. 2016 as they were printed, in their units."""

from __future__ import annotations

from dataclasses import dataclass

from receptance.studies._data import Row, number, number_or_none, read_table, read_toml

__all__ = ["MachineSetup", "Mount", "ParameterSet", "PrintedStiffness", "Published", "Reading", "Transfer", "load"]

SOURCE = "Matthias, Ozsahin, Altintas, Denkena, CIRP J. Manuf. Sci. Technol. 2016, doi 10.1016/j.cirpj.2016.02.005"


@dataclass(frozen=True)
class Mount:
    """One line of table 1: an assembly whose joint is identified."""

    diameter_mm: float
    overhang_mm: float
    insertion_mm: float
    holder_length_mm: float


@dataclass(frozen=True)
class Transfer:
    """One line of table 2: another overhang, natural frequencies measured and as the paper predicts them."""

    diameter_mm: float
    overhang_mm: float
    measured_hz: tuple[float, ...]
    predicted_hz: tuple[float, ...]


@dataclass(frozen=True)
class ParameterSet:
    """One line of table 3: a joint that matches the tip FRF on the machine."""

    name: str
    diameter_mm: float
    k_y: float
    k_theta: float


@dataclass(frozen=True)
class Reading:
    """One line of table 4: two natural frequencies at a clamping torque, and the paper's stiffnesses."""

    diameter_mm: float
    torque_nm: float
    frequency_hz: tuple[float, float]
    k_y: float
    k_theta: float


@dataclass(frozen=True)
class MachineSetup:
    """One line of table 5: stiffnesses used on the machine, with overhangs."""

    diameter_mm: float
    overhang_medium_mm: float
    overhang_long_mm: float | None
    k_y: float
    k_theta: float


@dataclass(frozen=True)
class PrintedStiffness:
    """Stiffnesses that the running text gives."""

    where: str
    diameter_mm: float
    k_y: float
    k_theta: float


@dataclass(frozen=True)
class Published:
    """All that the paper prints and the study uses."""

    mounts: tuple[Mount, ...]
    transfers: tuple[Transfer, ...]
    parameter_sets: tuple[ParameterSet, ...]
    readings: tuple[Reading, ...]
    machine: tuple[MachineSetup, ...]
    text: tuple[PrintedStiffness, ...]
    recommended_torque_nm: float

    def mount(self, diameter_mm: float) -> Mount:
        """Return table 1's line for a tool."""
        return next(mount for mount in self.mounts if mount.diameter_mm == diameter_mm)

    def setup(self, diameter_mm: float) -> MachineSetup:
        """Return table 5's line for a tool."""
        return next(setup for setup in self.machine if setup.diameter_mm == diameter_mm)

    def reading(self, diameter_mm: float, torque_nm: float) -> Reading:
        """Return table 4's line for a tool and a torque."""
        return next(r for r in self.readings if (r.diameter_mm, r.torque_nm) == (diameter_mm, torque_nm))

    @property
    def long_tools(self) -> tuple[Transfer, ...]:
        """Table 2's lines with the longer overhang of each tool."""
        longest = {t.diameter_mm: t for t in sorted(self.transfers, key=lambda t: t.overhang_mm)}
        return tuple(longest[diameter] for diameter in sorted(longest))

    def long_overhang(self, diameter_mm: float) -> float:
        """Return the longer of table 2's overhangs of a tool, in mm."""
        return next(t.overhang_mm for t in self.long_tools if t.diameter_mm == diameter_mm)


def load() -> Published:
    """Read the packaged tables 1 to 5.

    Examples
    --------
    >>> from receptance.studies.er32.tables import load
    >>> load().mount(12.7).overhang_mm
    62.3
    """
    text = read_toml("er32_text.toml")
    return Published(
        mounts=tuple(
            Mount(*(number(r, c) for c in ("diameter_mm", "overhang_mm", "insertion_mm", "holder_length_mm")))
            for r in read_table("er32_table1_assemblies.csv")
        ),
        transfers=tuple(
            Transfer(number(r, "diameter_mm"), number(r, "overhang_mm"), _modes(r, "measured"), _modes(r, "predicted"))
            for r in read_table("er32_table2_transfer.csv")
        ),
        parameter_sets=tuple(
            ParameterSet(r["set"], number(r, "diameter_mm"), *_stiffness(r))
            for r in read_table("er32_table3_parameter_sets.csv")
        ),
        readings=tuple(
            Reading(
                number(r, "diameter_mm"),
                number(r, "torque_nm"),
                (number(r, "mode_1_hz"), number(r, "mode_2_hz")),
                *_stiffness(r),
            )
            for r in read_table("er32_table4_torque.csv")
        ),
        machine=tuple(
            MachineSetup(
                number(r, "diameter_mm"),
                number(r, "overhang_medium_mm"),
                number_or_none(r, "overhang_long_mm"),
                *_stiffness(r),
            )
            for r in read_table("er32_table5_parameters.csv")
        ),
        text=tuple(
            PrintedStiffness(t["where"], t["diameter_mm"], t["k_y_n_per_m"], t["k_theta_nm_per_rad"])
            for t in text["stiffness"]
        ),
        recommended_torque_nm=float(text["recommended_torque_nm"]),
    )


def _modes(row: Row, kind: str) -> tuple[float, ...]:
    found = (number_or_none(row, f"{kind}_{mode}_hz") for mode in (1, 2, 3))
    return tuple(value for value in found if value is not None)


def _stiffness(row: Row) -> tuple[float, float]:
    return number(row, "k_y_n_per_m"), number(row, "k_theta_nm_per_rad")
