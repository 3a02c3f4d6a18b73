"""From materials, parts, joints, attachments and unknowns back to the tables of a campaign file."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import MISSING
from typing import Any

from receptance import units
from receptance.beams import Part
from receptance.campaign.addresses import kind_of
from receptance.campaign.element_tables import PLAIN_NUMBER
from receptance.collet import ColletJoint
from receptance.fields import Choice, Count, Element, Member, Number
from receptance.identification.laws import Law, Move
from receptance.identification.unknowns import Prior, Unknown
from receptance.joints import GroundSpring, PointJoint, PointMass, Resonator
from receptance.materials import Material
from receptance.modal_parts import ModalPart
from receptance.spread import SpreadJoint
from receptance.units import Quantity

__all__ = ["Materials", "attachment_table", "element_table", "quantity", "quantity_at", "unknown_table"]


def quantity(value: float, kind: Quantity) -> str | float:
    """Return a number in SI units as a campaign writes it, with all its digits."""
    return f"{float(value)!r} {kind.unit}" if kind.unit else float(value)


def quantity_at(address: str, value: float) -> str | float:
    """Return the value of an address as a campaign writes it."""
    return quantity(value, kind_of(address))


class Materials:
    """The materials of a file by name; those that are met and not among them are added.

    Parameters
    ----------
    known : iterable of str
        Names of those that the file has.
    """

    def __init__(self, known: Iterable[str]) -> None:
        self._known = set(known)
        self._made: list[tuple[Material, str]] = []
        self.added: dict[str, dict[str, Any]] = {}

    def name_of(self, material: Material) -> str:
        """Return the name under which a material stands in the file; an assembly may set its values differently."""
        if material.name in self._known:
            return material.name
        for made, name in self._made:
            if made == material:
                return name
        base = name = material.name or "material"
        number = 2
        while name in self._known or name in self.added:
            name, number = f"{base} {number}", number + 1
        self._made.append((material, name))
        self.added[name] = _fields(material, self)
        return name


def element_table(element: Any, materials: Materials) -> dict[str, Any]:
    """Return the table of a part, a joint or a modal part, without tolerances.

    Raises
    ------
    ValueError
        A kind of joint that no cause makes.
    """
    if isinstance(element, Part):
        return {"segments": [_fields(one, materials) for one in element.segments]}
    if isinstance(element, SpreadJoint):
        return {"kind": "spread", **_fields(element, materials)}
    if type(element) is PointJoint:
        return _fields(element, materials)
    if isinstance(element, ColletJoint):
        return {"kind": "collet", **_fields(element, materials)}
    if isinstance(element, ModalPart):
        if element.band_hz is not None:
            raise ValueError(f"{element!r} has a band, which campaigns do not have for modal parts, and is not written")
        return {"modes": [_fields(mode, materials) for mode in element.modes], **_fields(element, materials)}
    raise ValueError(f"{element!r} cannot be written as a table of a campaign")


def attachment_table(point: PointMass | GroundSpring | Resonator) -> dict[str, Any]:
    """Return the table of a mass, a resonator or a ground spring at a point.

    Raises
    ------
    ValueError
        A ground spring along a stretch, which is not written.
    """
    if isinstance(point, GroundSpring) and point.length:
        raise ValueError(f"{point!r} acts along a stretch and cannot be written as a table of a campaign")
    position = point.position if isinstance(point.position, str) else quantity(point.position, units.LENGTH)
    kind = {PointMass: "mass", GroundSpring: "ground", Resonator: "resonator"}[type(point)]
    return {"kind": kind, "part": point.part, "position": position, **_fields(point, Materials(()))}


def _fields(element: Element, materials: Materials) -> dict[str, Any]:
    """Return the numbers and members of an element that are not at their defaults."""
    table: dict[str, Any] = {}
    for name, field in element.declared.items():
        value = getattr(element, name)
        if value == getattr(type(element), name, MISSING):
            continue
        if isinstance(field, Number):
            table[name] = quantity(value, field.quantity)
        elif isinstance(field, Member):
            table[name] = materials.name_of(value) if field.kind is Material else _fields(value, materials)
        elif isinstance(field, (Choice, Count)):
            table[name] = value
    return table


def unknown_table(unknown: Unknown, start: float) -> dict[str, Any]:
    """Return the table of an unknown, which begins at a value; laws across assemblies are not among them."""
    if isinstance(unknown, Law):
        raise ValueError(f"{unknown!r} cannot be written as a table of a campaign")
    plain = isinstance(unknown, Move) or unknown.multiple != 1.0
    kind = PLAIN_NUMBER if plain else kind_of(unknown.address)
    start = min(max(start, unknown.lower), unknown.upper)
    table: dict[str, Any] = {
        key: quantity(value, kind) for key, value in (("lower", unknown.lower), ("upper", unknown.upper))
    }
    table |= {"start": quantity(start, kind), "scale": unknown.scale}
    if unknown.prior is not None:
        table["prior"] = _prior(unknown.prior, unknown.scale == "log", kind)
    if unknown.configurations is not None:
        table["assemblies"] = list(unknown.configurations)
    if isinstance(unknown, Move):
        table |= {"moves": dict(unknown.moves), "relative": unknown.relative}
        return {**table, **({"power_of": unknown.of, "reference": unknown.reference} if unknown.of else {})}
    if unknown.name != unknown.address:
        table["name"] = unknown.name
    if unknown.multiple != 1.0:
        table["multiple"] = unknown.multiple
    return {**table, **({"also": dict(unknown.also)} if unknown.also else {})}


def _prior(prior: Prior, logarithmic: bool, kind: Quantity) -> dict[str, Any]:
    spread = f"{100.0 * prior.standard_deviation!r} %" if logarithmic else quantity(prior.standard_deviation, kind)
    return {"value": quantity(prior.mean, kind), "spread": spread}
