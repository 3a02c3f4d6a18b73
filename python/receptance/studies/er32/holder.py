"""The inferred holder, and the free assembly of tool, joint and holder."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance.assembly import Assembly
from receptance.beams import Part, Segment
from receptance.joints import PointJoint
from receptance.materials import Material
from receptance.studies._data import read_toml

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["JOINT", "HolderModel", "Section", "load_holder", "mode_slopes"]

JOINT = ("joint.k_y", "joint.k_theta")
_MATERIALS = ("carbide", "steel")
_FACTORS = ("modulus factor", "density factor")


@dataclass(frozen=True)
class Section:
    """A section of the holder; without a length it takes up what is left of the holder's."""

    name: str
    length_mm: float | None
    outer_mm: float
    inner_mm: float
    modulus_factor: float
    density_factor: float
    has_factors: bool


@dataclass(frozen=True)
class HolderModel:
    """The inferred holder's sections, the two materials, and how they were inferred."""

    sections: tuple[Section, ...]
    steel: Material
    carbide: Material
    inference: str
    fitted_at_torque_nm: float
    at_bounds_of_fit: tuple[str, ...]

    def assembly(
        self, diameter_mm: float, overhang_mm: float, holder_length_mm: float, k_y: float, k_theta: float
    ) -> Assembly:
        """Free assembly of blank, point joint and holder; the blank is as long as its overhang.

        Parameters
        ----------
        diameter_mm, overhang_mm, holder_length_mm : float
            Blank and holder in mm.
        k_y, k_theta : float
            Joint in N/m and N m/rad.

        Examples
        --------
        >>> from receptance.studies.er32.holder import load_holder
        >>> load_holder().assembly(12.7, 113.2, 129.0, 6.28e8, 1.04e5).natural_frequencies(6e3).round()
        array([1129., 4917.])
        """
        rest = holder_length_mm - sum(section.length_mm or 0.0 for section in self.sections)
        holder = [
            Segment(
                length=1e-3 * (rest if section.length_mm is None else section.length_mm),
                outer_diameter=1e-3 * section.outer_mm,
                inner_diameter=1e-3 * section.inner_mm,
                material=replace(
                    self.steel,
                    youngs_modulus=self.steel.youngs_modulus * section.modulus_factor,
                    density=self.steel.density * section.density_factor,
                ),
            )
            for section in self.sections
        ]
        blank = Segment(length=1e-3 * overhang_mm, outer_diameter=1e-3 * diameter_mm, material=self.carbide)
        joint = PointJoint(k_y=k_y, k_theta=k_theta, name="joint")
        return Assembly([Part([blank], name="tool"), joint, Part(holder, name="holder")])

    @property
    def shared(self) -> tuple[str, ...]:
        """Names of what all assemblies share: the two materials and the holder's shape."""
        names = [f"{material} {quantity}" for material in _MATERIALS for quantity in ("modulus", "density")]
        for section in self.sections:
            names += [f"{section.name} length"] if section.length_mm is not None else []
            names += [f"{section.name} diameter"]
            names += [f"{section.name} bore"] if section.inner_mm else []
            names += [f"{section.name} {factor}" for factor in _FACTORS] if section.has_factors else []
        return tuple(names)

    @property
    def fitted(self) -> tuple[str, ...]:
        """What the inference fitted: everything shared but the steel, which it took as it is."""
        return tuple(name for name in self.shared if not name.startswith("steel "))

    def value(self, name: str) -> tuple[float, str]:
        """Value of a shared quantity and its unit."""
        owner, quantity = name.split(" ", 1)
        if owner in _MATERIALS:
            material: Material = getattr(self, owner)
            return (material.youngs_modulus / 1e9, "GPa") if quantity == "modulus" else (material.density, "kg/m3")
        return float(getattr(self._section(owner), _FIELD[quantity])), "" if quantity in _FACTORS else "mm"

    def varied(self, factors: Mapping[str, float]) -> HolderModel:
        """Return the model with shared quantities multiplied by factors."""
        model = self
        for name, factor in factors.items():
            owner, quantity = name.split(" ", 1)
            if owner in _MATERIALS:
                field = "youngs_modulus" if quantity == "modulus" else "density"
                material: Material = getattr(model, owner)
                changes: dict[str, Any] = {owner: replace(material, **{field: getattr(material, field) * factor})}
            else:
                section = model._section(owner)
                changed: dict[str, Any] = {_FIELD[quantity]: getattr(section, _FIELD[quantity]) * factor}
                changes = {
                    "sections": tuple(replace(s, **changed) if s is section else s for s in model.sections),
                }
            model = replace(model, **changes)
        return model

    def entries(self, name: str) -> list[tuple[str, float]]:
        """Addresses that a shared quantity moves, with their change in SI units per relative change of the quantity."""
        owner, quantity = name.split(" ", 1)
        if owner == "carbide":
            field = "youngs_modulus" if quantity == "modulus" else "density"
            return [(f"tool.segment[0].{field}", getattr(self.carbide, field))]
        if owner == "steel" or quantity in _FACTORS:
            field = "youngs_modulus" if quantity.startswith("modulus") else "density"
            factor = "modulus_factor" if field == "youngs_modulus" else "density_factor"
            return [
                (f"holder.segment[{i}].{field}", getattr(self.steel, field) * getattr(section, factor))
                for i, section in enumerate(self.sections)
                if owner in ("steel", section.name)
            ]
        index = next(i for i, section in enumerate(self.sections) if section.name == owner)
        size = 1e-3 * getattr(self.sections[index], _FIELD[quantity])
        field = {"length": "length", "diameter": "outer_diameter", "bore": "inner_diameter"}[quantity]
        entries = [(f"holder.segment[{index}].{field}", size)]
        if quantity == "length":
            # The holder's length is published: what one section gains the last one loses.
            entries += [
                (f"holder.segment[{i}].length", -size) for i, s in enumerate(self.sections) if s.length_mm is None
            ]
        return entries

    def _section(self, name: str) -> Section:
        return next(section for section in self.sections if section.name == name)


_FIELD = {
    "length": "length_mm",
    "diameter": "outer_mm",
    "bore": "inner_mm",
    "modulus factor": "modulus_factor",
    "density factor": "density_factor",
}


def load_holder() -> HolderModel:
    """Read the packaged holder. It is inferred, not published."""
    data = read_toml("er32_holder_inferred.toml")
    sections = tuple(
        Section(
            name=s["name"],
            length_mm=None if s["length_mm"] == "rest" else float(s["length_mm"]),
            outer_mm=float(s["outer_mm"]),
            inner_mm=float(s["inner_mm"]),
            modulus_factor=float(s.get("E_factor", 1.0)),
            density_factor=float(s.get("density_factor", 1.0)),
            has_factors="E_factor" in s or "density_factor" in s,
        )
        for s in data["sections"]
    )
    steel, carbide = (
        Material(
            youngs_modulus=1e9 * data[name]["E_gpa"],
            density=float(data[name]["density_kg_m3"]),
            poisson_ratio=data[name]["poisson"],
            name=name,
        )
        for name in ("steel", "carbide")
    )
    return HolderModel(
        sections=sections,
        steel=steel,
        carbide=carbide,
        inference=data["inference"],
        fitted_at_torque_nm=float(data["fitted_at_torque_nm"]),
        at_bounds_of_fit=tuple(data["at_bounds_of_fit"]),
    )


def mode_slopes(
    model: HolderModel, assembly: Assembly, modes: Sequence[int], names: Sequence[str]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Natural frequencies of an assembly and how they move, all to first order.

    Parameters
    ----------
    model : HolderModel
        The model that the assembly was built from.
    modes : sequence of int
        Mode numbers from 1.
    names : sequence of str
        Shared quantities.

    Returns
    -------
    frequency_hz : ndarray
        `(m,)`.
    shared : ndarray
        `(m, n)` relative change of the frequency per relative change of the quantity.
    joint : ndarray
        `(m, 2)` the same for k_y and k_theta.
    overhang : ndarray
        `(m,)` relative change per mm of overhang.
    """
    pairs = [model.entries(name) for name in names]
    addresses = [*JOINT, "tool.segment[0].length", *dict.fromkeys(address for pair in pairs for address, _ in pair)]
    frequency, slope = assembly.lowest_natural_frequencies(max(modes), addresses)
    rows = [mode - 1 for mode in modes]
    frequency, relative = frequency[rows], slope[rows] / frequency[rows, None]
    column = {address: relative[:, i] for i, address in enumerate(addresses)}
    shared = np.zeros((len(rows), len(names)))
    for i, pair in enumerate(pairs):
        for address, change in pair:
            shared[:, i] += change * column[address]
    joint = relative[:, :2] * [assembly.get(address) for address in JOINT]
    return frequency, shared, joint, 1e-3 * column["tool.segment[0].length"]
