"""Materials that a campaign names without a table: those of the list, with their scatter as tolerance."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from typing import Any

from receptance.campaign.problems import path_text
from receptance.campaign.values import Deviation
from receptance.model.beams import Material
from receptance.model.fields import Number
from receptance.model.materials import LOSS_FACTOR, LOSS_SCATTER, grade, is_listed

_OWNERS = ("parts", "joints")
"""Sections with references to materials."""
MATERIAL_NUMBERS = {key: number.quantity for key, number in Material.declared.items() if isinstance(number, Number)}
"""Quantities of a material."""
_REFERENCES = ("material", "core")
"""Keys that name a material."""


def with_listed_materials(data: Mapping[str, Any]) -> tuple[dict[str, Any], tuple[str, ...]]:
    """Return the contents of a campaign file with a table for each listed material that it only names, and their names.

    A table of the file with the same name takes precedence. References to unknown materials are left as they are.

    Examples
    --------
    >>> from receptance.campaign.listed_materials import with_listed_materials
    >>> data, names = with_listed_materials({"parts": {"tool": {"segments": [{"material": "carbide-10co"}]}}})
    >>> names, data["materials"]["carbide-10co"]["tolerance"]["density"]
    (('carbide-10co',), '0.6112 %')
    """
    stated = data.get("materials", {})
    if not isinstance(stated, dict):
        return dict(data), ()
    references = dict.fromkeys(name for section in _OWNERS for name in _named(data.get(section)))
    names = tuple(name for name in references if name not in stated and is_listed(name))
    if not names:
        return dict(data), ()
    return {**data, "materials": {**stated, **{name: listed_table(name) for name in names}}}, names


def _named(written: Any) -> Iterator[str]:
    """Yield the names of materials in tables and lists of a file."""
    for key, value in written.items() if isinstance(written, dict) else ():
        if key in _REFERENCES and isinstance(value, str):
            yield value
        else:
            yield from _named(value)
    for value in written if isinstance(written, list) else ():
        yield from _named(value)


def listed_table(name: str) -> dict[str, Any]:
    """Return the table of a listed material, as a campaign file could state it.

    Examples
    --------
    >>> from receptance.campaign.listed_materials import listed_table
    >>> listed_table("steel")["tolerance"]
    {'youngs_modulus': '2 %', 'density': '0.5 %', 'poisson_ratio': 0.01, 'loss_factor': '50 %'}
    """
    listed = grade(name)
    made = listed.material(LOSS_FACTOR)
    numbers = {key: quantity.readable(getattr(made, key)) for key, quantity in MATERIAL_NUMBERS.items()}
    tolerance: dict[str, Any] = {
        "youngs_modulus": f"{100.0 * listed.modulus_scatter:.4g} %",
        "density": f"{100.0 * listed.density_scatter:.4g} %",
        "poisson_ratio": listed.poisson_scatter,
        "loss_factor": f"{100.0 * LOSS_SCATTER:g} %",
    }
    return {**numbers, "tolerance": tolerance}


def note_on_listed(name: str) -> str:
    """Return what a user is told about a listed material that has no table in the file."""
    listed = grade(name)
    return (
        f"from the list of materials, {listed.title}: {listed.about}, loss factor {LOSS_FACTOR:g} +- "
        f"{100.0 * LOSS_SCATTER:g} %; these scatters are its tolerance. Source: {listed.source}. A table "
        f"[{path_text(('materials', name))}] takes precedence"
    )


def listed_materials(names: Iterable[str], stated: Mapping[str, Material]) -> dict[str, Material]:
    """Return the materials of a list of names that a campaign does not state, but the list has."""
    return {name: grade(name).material(LOSS_FACTOR) for name in names if name not in stated and is_listed(name)}


def listed_deviations(name: str) -> dict[str, Deviation]:
    """Return the standard deviations of a listed material by field; equal names make them one error in all parts.

    Examples
    --------
    >>> from receptance.campaign.listed_materials import listed_deviations
    >>> listed_deviations("steel")["density"]
    Deviation(amount=39.25, relative=False, name='materials.steel.density')
    """
    amounts = {**grade(name).deviations, "loss_factor": LOSS_SCATTER * LOSS_FACTOR}
    return {field: Deviation(amount, False, path_text(("materials", name, field))) for field, amount in amounts.items()}
