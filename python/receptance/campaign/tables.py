"""From materials, parts, joints, attachments and unknowns back to the tables of a campaign file."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

from receptance.beams import Part, Section, Segment
from receptance.campaign.addresses import FIELDS, SPRING_FIELDS, kind_of
from receptance.campaign.quantities import KINDS, Kind
from receptance.collet import ColletJoint
from receptance.identification.laws import Law, Move
from receptance.identification.priors import Prior
from receptance.identification.unknowns import Unknown
from receptance.joints import GroundSpring, PointJoint, PointMass, Resonator
from receptance.materials import Material
from receptance.modal_parts import ModalPart, Mode
from receptance.spread import SpreadJoint
from receptance.terminals import RESIDUALS

__all__ = ["Materials", "attachment_table", "element_table", "quantity", "quantity_at", "unknown_table"]

_MATERIAL = ("youngs_modulus", "density", "poisson_ratio", "loss_factor")


def quantity(value: float, kind: Kind) -> str | float:
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
        self.added[name] = {field: quantity(getattr(material, field), FIELDS[field]) for field in _MATERIAL}
        return name


def element_table(element: Any, materials: Materials) -> dict[str, Any]:
    """Return the table of a part, a joint or a modal part, without tolerances.

    Raises
    ------
    ValueError
        A kind of joint that no cause makes.
    """
    if isinstance(element, Part):
        return {"segments": [_section(one, materials) for one in element.segments]}
    if isinstance(element, SpreadJoint):
        fields = {name: quantity(getattr(element, name), FIELDS[name]) for name in SpreadJoint.columns_of}
        sections = {name: _section(getattr(element, name), materials) for name in ("shank", "sleeve")}
        points = {} if element.points is None else {"points": element.points}
        return {"kind": "spread", **fields, **points, **sections}
    if type(element) is PointJoint:
        return _spring(element)
    if isinstance(element, ColletJoint):
        own = {name: quantity(getattr(element, name), FIELDS[name]) for name in ColletJoint.columns_of}
        return {"kind": "collet", **own, **{name: _spring(getattr(element, name)) for name in ColletJoint.joints_of}}
    if isinstance(element, ModalPart):
        if element.band_hz is not None:
            raise ValueError(f"{element!r} has a band, which campaigns do not have for modal parts, and is not written")
        modes = [{n: quantity(getattr(mode, n), FIELDS[n]) for n in Mode.columns_of} for mode in element.modes]
        return {"modes": modes, **{name: quantity(getattr(element, name), FIELDS[name]) for name in RESIDUALS}}
    raise ValueError(f"{element!r} cannot be written as a table of a campaign")


def _section(one: Segment | Section, materials: Materials) -> dict[str, Any]:
    names = (*(("length",) if isinstance(one, Segment) else ()), "outer_diameter", "inner_diameter")
    table = {name: quantity(getattr(one, name), KINDS["a length"]) for name in names}
    table["material"] = materials.name_of(one.material)
    if one.core is not None:
        table["core"] = materials.name_of(one.core)
    return {**table, "shear": one.shear}


def _spring(one: PointJoint | GroundSpring) -> dict[str, Any]:
    return {name: quantity(getattr(one, name), FIELDS[name]) for name in SPRING_FIELDS if getattr(one, name)}


def attachment_table(point: PointMass | GroundSpring | Resonator) -> dict[str, Any]:
    """Return the table of a mass, a resonator or a ground spring at a point.

    Raises
    ------
    ValueError
        A ground spring along a stretch, which campaigns do not have.
    """
    position = point.position if isinstance(point.position, str) else quantity(point.position, KINDS["a length"])
    placed = {"part": point.part, "position": position}
    if isinstance(point, (PointMass, Resonator)):
        kind = "mass" if isinstance(point, PointMass) else "resonator"
        return {"kind": kind, **placed, **{n: quantity(getattr(point, n), FIELDS[n]) for n in point.columns_of}}
    if point.length:
        raise ValueError(f"{point!r} acts along a stretch and cannot be written as a table of a campaign")
    return {"kind": "ground", **placed, **_spring(point)}


def unknown_table(unknown: Unknown, start: float) -> dict[str, Any]:
    """Return the table of an unknown, which begins at a value; laws across assemblies are not among them."""
    if isinstance(unknown, Law):
        raise ValueError(f"{unknown!r} cannot be written as a table of a campaign")
    plain = isinstance(unknown, Move) or unknown.multiple != 1.0
    kind = Kind("a number", "", "0.02", "any") if plain else kind_of(unknown.address)
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


def _prior(prior: Prior, logarithmic: bool, kind: Kind) -> dict[str, Any]:
    spread = f"{100.0 * prior.standard_deviation!r} %" if logarithmic else quantity(prior.standard_deviation, kind)
    return {"value": quantity(prior.mean, kind), "spread": spread}
