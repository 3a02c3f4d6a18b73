"""Tools, holders and materials as text: answers of a new campaign."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from receptance import drawing, units
from receptance._text import instead_of, shown
from receptance.campaign.keys import ListOf, NamedTables, Place, element_keys
from receptance.campaign.listed_materials import MATERIAL_NUMBERS, listed_materials
from receptance.campaign.problems import CampaignError, Problems
from receptance.campaign.read import read_contents
from receptance.campaign.schema import PartTable
from receptance.catalogue.rows import HolderRow, read_holders
from receptance.model.beams import CARBIDE, STEEL, Material, Part, Segment
from receptance.model.insertion import insert
from receptance.units import parse

MATERIALS = listed_materials([material.name for material in (STEEL, CARBIDE)], {})
"""The two usual materials by name, those of the list."""
SIZES = {
    "length": units.LENGTH,
    "outer_diameter": units.LENGTH,
    "inner_diameter": units.LENGTH_OR_ZERO,
    "end_outer_diameter": units.LENGTH,
    "end_inner_diameter": units.LENGTH_OR_ZERO,
}
_TO = r"(?<![eE\s])\s*[-–]\s*"
"""Between the diameters at both ends of a cone; 5e-3 is one number."""
_PIECE = re.compile(
    r"(?:(?P<length>[^x×*]+?)\s*[x×*]\s*)?"
    rf"(?P<outer>[^/x×*]+?)(?:{_TO}(?P<end_outer>[^/x×*–-]+?))?\s*"
    rf"(?:/\s*(?P<inner>[^/x×*]+?)(?:{_TO}(?P<end_inner>[^/x×*–-]+?))?\s*)?"
)
_NUMBER = re.compile(units.NUMBER)
_COMMA = re.compile(r"\d,\d")


@dataclass(frozen=True)
class DrawnHolder:
    """A holder as a drawing, which the new campaign reads."""

    file: str
    """Path of the drawing."""
    keys: Mapping[str, Any] = field(default_factory=dict)
    """Keys of a campaign with which it is read, such as `unit`."""
    material: str = ""
    insertion: float = 0.0
    """Length of the shank in its bore in m."""


def parse_pieces(text: str, *, shank: bool = False) -> list[HolderRow]:
    """Return the pieces of a tool or a holder that are written as `LENGTH x DIAMETER/BORE`, separated by commas.

    They are listed from the tip-side end on. A cone has the diameters of both ends, `50-60` for 50 mm at the tip-side
    end and 60 mm at the other, and so may have a bore. A unit at the end of a piece applies to its numbers without a
    unit. With `shank` the last piece has no length, which is zero, because it reaches to the holder. The message of an
    error begins with "is".

    Examples
    --------
    >>> from receptance.draft import parse_pieces
    >>> [(piece.length, piece.outer_diameter, piece.inner_diameter) for piece in parse_pieces("48 mm x 50/20 mm")]
    [(0.048, 0.05, 0.02)]
    >>> (cone,) = parse_pieces("48 mm x 50-60/20 mm")
    >>> cone.outer_diameter, cone.end_outer_diameter, cone.inner_diameter, cone.end_inner_diameter
    (0.05, 0.06, 0.02, None)
    """
    expected = 'pieces such as "48 mm x 50/20 mm, 90 mm x 44/16 mm" (length x outer diameter/bore; 50-60 for a cone)'
    if shank:
        expected = 'a diameter such as "12.7 mm", or pieces with the shank last, "30 mm x 9.6 mm, 12 mm"'
    pieces = []
    items = text.split(",")
    for index, item in enumerate(map(str.strip, items), 1):
        match = _PIECE.fullmatch(item)
        is_shank = shank and index == len(items)
        if match is None or _COMMA.search(text) or is_shank != (match["length"] is None):
            problem = "has no length" if match and not is_shank else "is no shank" if is_shank else "is no piece"
            hint = "decimals are written with a point, and a comma with a blank separates pieces"
            raise ValueError(f"is {shown(text)}, where {shown(item)} {problem}, expected {expected}; {hint}")
        names = ("length", "outer", "inner", "end_outer", "end_inner")
        numbers = [(match[name] or "").strip() for name in names]
        in_order = [numbers[i] for i in (0, 1, 3, 2, 4)]
        unit = next((rest for number in reversed(in_order) if (rest := _NUMBER.sub("", number, count=1).strip())), "")
        length, outer, inner, end_outer, end_inner = (
            parse(f"{number} {unit}".strip() if _NUMBER.fullmatch(number) else number, quantity) if number else None
            for number, quantity in zip(numbers, SIZES.values(), strict=True)
        )
        piece = _piece(length or 0.0, outer or 0.0, inner or 0.0, end_outer=end_outer, end_inner=end_inner)
        if any(bore >= diameter for diameter, bore in _ends(piece)):
            raise ValueError(f"is {shown(text)}, where {shown(item)} has a bore that is not smaller than its diameter")
        pieces.append(piece)
    return pieces


def _piece(
    length: float,
    outer: float,
    inner: float,
    material: str = "",
    core: str = "",
    *,
    end_outer: float | None = None,
    end_inner: float | None = None,
) -> HolderRow:
    return HolderRow(
        holder="",
        line=0,
        length=length,
        outer_diameter=outer,
        inner_diameter=inner,
        material=material,
        core=core,
        end_outer_diameter=end_outer,
        end_inner_diameter=end_inner,
    )


def _ends(piece: HolderRow) -> tuple[tuple[float, float], tuple[float, float]]:
    """Return outer diameter and bore at both ends of a piece."""
    outer, inner = piece.end_outer_diameter, piece.end_inner_diameter
    end = (piece.outer_diameter if outer is None else outer, piece.inner_diameter if inner is None else inner)
    return (piece.outer_diameter, piece.inner_diameter), end


def parse_holder(text: str, folder: Path | None = None) -> list[HolderRow] | DrawnHolder:
    """Return the pieces of a holder, from their text or from a file, FILE:NAME if it has several holders.

    A DXF file is a drawing, which is read to find its mistakes. With a folder files are named from there, and none
    outside of it is read.
    """
    if text.lower().endswith(".dxf"):
        return _drawn_holder(_below(folder, text), folder=folder)
    path, name = _below(folder, text), ""
    if not path.is_file() and ":" in text:
        file, _, name = text.rpartition(":")
        path = _below(folder, file)
    ending = path.suffix.lower()
    if ending == ".csv" and path.is_file() and _is_profile(path):
        return _drawn_holder(path, folder=folder)
    if ending not in (".csv", ".toml"):
        if path.is_file():
            raise ValueError(f"is {shown(text)}, a file with the ending {ending or 'none'}, expected .csv or .toml")
        return parse_pieces(text)
    if not path.is_file():
        raise ValueError(f"is {shown(text)}, but there is no file {path}")
    try:
        holders = read_holders(path) if ending == ".csv" else _holders_of_toml(path, folder)
    except CampaignError as error:
        raise ValueError(f"names a file with mistakes: {error}") from None
    first = next(iter(holders))
    if not name and len(holders) > 1:
        raise ValueError(f"is {shown(text)}, which holds {', '.join(holders)}; expected one, such as {path}:{first}")
    if name and name not in holders:
        raise ValueError(f"is {shown(text)}, but {path} has no {shown(name)}{instead_of(name, holders)}")
    return holders[name or first]


def _below(folder: Path | None, text: str) -> Path:
    """Return the path of a file that a text names; in a folder it has to be below."""
    if folder is None:
        return Path(text)
    try:
        path = (folder / text).resolve()
        path.is_file()
    except (OSError, ValueError):  # pieces are no name of a file
        return folder / "none"
    if not path.is_relative_to(folder.resolve()):
        raise ValueError(f"is {shown(text)}, which is not below the folder that was opened")
    return path


def _is_profile(path: Path) -> bool:
    """Return whether a CSV file has the points of a contour: a column x and none of lengths."""
    with path.open(encoding="utf-8-sig", errors="replace") as file:
        head = next((line for line in file if line.strip() and not line.startswith("#")), "")
    names = [re.split(r"[\[(]", cell)[0].strip(' "').lower() for cell in re.split("[,;\t]", head)]
    return "x" in names and "length" not in names


def _drawn_holder(path: Path, table: PartTable | None = None, *, folder: Path | None = None) -> DrawnHolder:
    """Return a holder as a drawing that can be read, with the keys of a part of a campaign."""
    if not _below(folder, str(path)).is_file():
        raise ValueError(f"is {shown(str(path))}, but there is no file {path}")
    keys = {} if table is None else {key: getattr(table, key) for key in _OF_DRAWING if key in table.written}
    options: Any = {{"within": "tolerance"}.get(key, key): value for key, value in keys.items()}
    try:
        drawing.read_contour(path, **options)
    except ValueError as error:
        hint = (
            f"`receptance contour {path}` has options for what it does not state; --campaign-lines > FILE.toml prints "
            "them, and --holder FILE.toml reads that"
        )
        raise ValueError(f"names a drawing with mistakes: {error}; {hint}") from None
    if "within" in keys:
        keys["within"] = units.LENGTH.text(keys["within"])
    return DrawnHolder(str(path), keys, "" if table is None else table.material or "")


_OF_DRAWING = ("layer", "bore_layer", "unit", "axis", "tip", "within")
"""Keys of a part of a campaign that say how its drawing is read."""


class _HolderKeys(PartTable):
    """Segments as in a campaign; the materials are those of the new campaign, and may be missing."""

    segments = ListOf("", element_keys(Segment, defaults={"material": ""}), least=1).default([])


def _holders_of_toml(path: Path, folder: Path | None) -> dict[str, list[HolderRow] | DrawnHolder]:
    """Return the parts of a TOML file: `[[parts.NAME.segments]]`, or `[[segments]]` of the only one, or a contour."""
    data, text = read_contents(path)
    problems = Problems(text)
    place, keys = Place(problems, {"materials": []}, frozenset({"materials"}), None), _HolderKeys.keys()
    holders: dict[str, Any] = {}
    if "segments" in data:
        holders["holder"] = place.read(keys, {"segments": data["segments"]})
    if "parts" in data:
        holders |= place.at("parts").read(NamedTables("", keys), data["parts"])
    if problems.found:
        raise CampaignError(path, problems.in_file())
    if not holders:
        raise CampaignError.about(path, "has neither [[segments]] nor [[parts.NAME.segments]]")
    if empty := [name for name, part in holders.items() if not part.segments and part.contour is None]:
        raise CampaignError.about(path, f"parts.{empty[0]} has neither segments nor a contour")
    return {
        name: [
            _piece(
                row.length,
                row.outer_diameter,
                row.inner_diameter,
                row.material,
                row.core or "",
                end_outer=row.end_outer_diameter,
                end_inner=row.end_inner_diameter,
            )
            for row in part.segments
        ]
        if part.contour is None
        else _drawn_holder(path.parent / part.contour, part, folder=folder)
        for name, part in holders.items()
    }


def inserted(holder: Sequence[HolderRow], insertion: float, shank: HolderRow) -> list[HolderRow]:
    """Return the pieces of a holder with the shank of a tool in its bore over the insertion in m.

    The piece in which the insertion ends is divided. The material of the shank fills the bore, also of pieces that are
    described without one.
    """
    if not insertion:
        return list(holder)
    segments = [
        Segment(
            length=piece.length,
            outer_diameter=piece.outer_diameter,
            inner_diameter=piece.inner_diameter,
            end_outer_diameter=piece.end_outer_diameter,
            end_inner_diameter=piece.end_inner_diameter,
            material=STEEL,  # materials are names here
        )
        for piece in holder
    ]
    # The shank protrudes by any length, because the overhangs are those of the measurements.
    whole = Segment(
        length=2.0 * insertion,
        outer_diameter=shank.outer_diameter,
        inner_diameter=shank.inner_diameter,
        material=CARBIDE,
    )
    try:
        made = insert(Part([whole], name="tool"), Part(segments, name="holder"), insertion, bore_solid=True)
    except ValueError as error:
        text = str(error).removeprefix("insert: ").removeprefix(f"the insertion is {mm(insertion)}, ")
        raise ValueError(f"is {mm(insertion)}, {'' if text.startswith('longer') else 'but '}{text}") from None
    origins = {piece.made[1]: piece.drawn[1] for piece in made.pieces if piece.drawn[0] == "holder"}
    return [
        replace(
            holder[origins[index]],
            length=segment.length,
            outer_diameter=segment.outer_diameter,
            inner_diameter=segment.inner_diameter,
            end_outer_diameter=segment.end_outer_diameter,
            end_inner_diameter=segment.end_inner_diameter,
            core="" if segment.core is None else shank.material,
        )
        for index, segment in enumerate(made.holder.segments)
    ]


def parse_material(text: str) -> Material:
    """Return a material that is written as `NAME = MODULUS, DENSITY[, POISSON[, LOSS FACTOR]]`.

    Examples
    --------
    >>> from receptance.draft import parse_material
    >>> parse_material("aluminium = 70 GPa, 2700 kg/m^3, 0.33").youngs_modulus
    70000000000.0
    """
    name, _, rest = text.partition("=")
    texts = [value.strip() for value in rest.split(",")]
    numbers = {"poisson_ratio": 0.3, "loss_factor": 0.001}
    expected = 'expected "NAME = MODULUS, DENSITY, POISSON, LOSS", such as "brass = 100 GPa, 8400 kg/m^3, 0.34, 0.001"'
    if not name.strip() or not 2 <= len(texts) <= len(MATERIAL_NUMBERS):
        raise ValueError(f"is {shown(text)}, {expected}")
    try:
        for (key, quantity), value in zip(MATERIAL_NUMBERS.items(), texts, strict=False):
            numbers[key] = parse(value if quantity.unit else float(value), quantity)
        return Material(**numbers, name=name.strip())
    except ValueError as error:
        raise ValueError(f"is {shown(text)}: {error}; {expected}") from None


def mm(length: float) -> str:
    """Return a length in mm as text."""
    return str(units.LENGTH.readable(length))
