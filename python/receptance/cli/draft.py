"""A new campaign: tool in holder at one overhang or several, as the commented text of a campaign file."""

from __future__ import annotations

import os
import re
import textwrap
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from receptance import FRF, units
from receptance._text import instead_of, shown
from receptance.catalogue.rows import HolderRow
from receptance.io import TimeSeries
from receptance.io.files import FORMATS, file_format
from receptance.model.beams import CARBIDE, STEEL, Material
from receptance.model.fields import Number
from receptance.units import Quantity, parse

MATERIALS = {material.name: replace(material, loss_factor=0.001) for material in (STEEL, CARBIDE)}
"""Materials by name, with a small loss factor."""
_TOLERANCES = {
    "materials": {"youngs_modulus": "1 %", "density": "0.5 %", "loss_factor": "50 %"},
    "flutes": {"length": "0.1 mm", "outer_diameter": "3 %", "inner_diameter": "0.3 %"},  # an effective diameter
    "shank": {"length": "0.1 mm", "outer_diameter": "0.05 %", "inner_diameter": "0.3 %"},  # ground, h6
    "holder": {"length": "0.1 mm", "outer_diameter": "0.1 %", "inner_diameter": "0.3 %"},
    "sensors": {"mass": "2 %"},
}
"""Standard deviations that a new campaign assumes."""
_JOINT_BOUNDS = {
    "k_y": ("1e6 N/m", "1e11 N/m"),
    "k_theta": ("1e2 N m/rad", "1e7 N m/rad"),
    "c_y": ("1 N s/m", "1e5 N s/m"),
    "c_theta": ("1e-4 N m s/rad", "10 N m s/rad"),
}
"""Bounds of the unknowns of a joint, which contain all joints of tools."""
_SIZES = {"length": units.LENGTH, "outer_diameter": units.LENGTH, "inner_diameter": units.LENGTH_OR_ZERO}
_WIDTH = 110
_BARE = re.compile(r"[A-Za-z0-9_-]+")
_PIECE = re.compile(r"(?:(?P<length>[^x×*]+?)\s*[x×*]\s*)?(?P<outer>[^/x×*]+?)\s*(?:/\s*(?P<inner>[^/x×*]+?)\s*)?")
_NUMBER = re.compile(units.NUMBER)
_COMMA = re.compile(r"\d,\d")
_PIECE_EXAMPLE = '"48 mm x 50/20 mm, 90 mm x 44/16 mm" (length x outer diameter/bore)'


# Answers of the user --------------------------------------------------------------------------------------------------


def parse_pieces(text: str, *, material: str = "", shank: bool = False) -> list[HolderRow]:
    """Return the pieces of a tool or a holder that are written as `LENGTH x DIAMETER/BORE`, separated by commas.

    They are listed from the tip-side end on. A unit at the end of a piece applies to its numbers without a unit. With
    `shank` the last piece has no length, which is zero, because it reaches to the holder. The message of an error
    begins with "is".

    Examples
    --------
    >>> from receptance.cli.draft import parse_pieces
    >>> [(one.length, one.outer_diameter, one.inner_diameter) for one in parse_pieces("48 mm x 50/20 mm, 90x44 mm")]
    [(0.048, 0.05, 0.02), (0.09, 0.044, 0.0)]
    """
    expected = 'a diameter such as "12.7 mm", or pieces such as "30 mm x 9.6 mm, 12 mm"' if shank else _PIECE_EXAMPLE
    if _COMMA.search(text):
        raise ValueError(
            f"is {shown(text)}, expected {expected}; decimals are written with a point, pieces are separated by a "
            "comma and a blank"
        )
    items = [item.strip() for item in text.split(",")]
    found = []
    for index, item in enumerate(items):
        match = _PIECE.fullmatch(item)
        last = index == len(items) - 1
        if match is None or not item:
            raise ValueError(f"is {shown(text)}, expected {expected}")
        wants_length = not (shank and last)
        if wants_length != (match["length"] is not None):
            problem = "has no length" if wants_length else "has a length, but the last piece of a tool is its shank"
            raise ValueError(f"is {shown(text)}, where {shown(item)} {problem}, expected {expected}")
        numbers = [match[name] for name in ("length", "outer", "inner")]
        unit = next((rest for one in reversed(numbers) if one and (rest := _NUMBER.sub("", one, count=1).strip())), "")
        length, outer, inner = (
            parse(one if not _NUMBER.fullmatch(one.strip()) else f"{one} {unit}".strip(), quantity) if one else 0.0
            for one, quantity in zip(numbers, (units.LENGTH, units.LENGTH, units.LENGTH_OR_ZERO), strict=True)
        )
        if inner >= outer:
            raise ValueError(f"is {shown(text)}, where {shown(item)} has a bore that is not smaller than its diameter")
        found.append(_piece(length, outer, inner, material))
    return found


def _piece(length: float, outer: float, inner: float, material: str, core: str = "") -> HolderRow:
    return HolderRow(
        holder="", line=0, length=length, outer_diameter=outer, inner_diameter=inner, material=material, core=core
    )


def pieces_of(tables: Sequence[Any], where: str) -> list[HolderRow]:
    """Return the pieces of a list of segments as in a campaign file; `where` is the name of the list in messages."""
    found = []
    for index, table in enumerate(tables):
        place = f"{where}[{index}]"
        if not isinstance(table, Mapping):
            raise ValueError(f"{place} is {shown(table)}, expected a table with length, outer_diameter and material")
        sizes = []
        for key, quantity in _SIZES.items():
            if key not in table and key != "inner_diameter":
                raise ValueError(f'{place} has no {key}, expected such as {key} = "{quantity.example}"')
            try:
                sizes.append(parse(table.get(key, "0 m"), quantity))
            except ValueError as error:
                raise ValueError(f"{place}.{key} {error}") from None
        names = [table.get(key, "") for key in ("material", "core")]
        if wrong := [name for name in names if not isinstance(name, str)]:
            raise ValueError(f"{place} has the material {shown(wrong[0])}, expected its name as text")
        found.append(_piece(sizes[0], sizes[1], sizes[2], *names))
        if found[-1].inner_diameter >= found[-1].outer_diameter:
            raise ValueError(f"{place}.inner_diameter is not smaller than outer_diameter, expected a smaller bore")
    if not found:
        raise ValueError(f"{where} is empty, expected one segment or more")
    return found


def inserted(holder: Sequence[HolderRow], insertion: float, shank: HolderRow) -> list[HolderRow]:
    """Return the pieces of a holder with the shank of a tool in its bore over the insertion in m.

    The piece in which the insertion ends is divided. The material of the shank fills the bore.
    """
    found: list[HolderRow] = []
    rest, diameter = insertion, shank.outer_diameter
    for number, piece in enumerate(holder, 1):
        if rest <= 1e-9:
            found.append(piece)
            continue
        if piece.outer_diameter <= diameter:
            raise ValueError(
                f"is {_mm(insertion)}, but piece {number} of the holder is {_mm(piece.outer_diameter)} thick and "
                f"cannot contain the shank of {_mm(diameter)}"
            )
        if piece.inner_diameter and abs(piece.inner_diameter - diameter) > 0.01 * diameter:
            raise ValueError(
                f"is {_mm(insertion)}, but piece {number} of the holder has a bore of {_mm(piece.inner_diameter)} "
                f"there, expected that of the shank, {_mm(diameter)}, or none; a collet around the shank counts as "
                "holder"
            )
        inside = min(rest, piece.length)
        found.append(replace(piece, length=inside, inner_diameter=diameter, core=shank.material))
        if piece.length - inside > 1e-9:
            found.append(replace(piece, length=piece.length - inside))
        rest -= inside
    if rest > 1e-9:
        total = sum(piece.length for piece in holder)
        raise ValueError(f"is {_mm(insertion)}, longer than the holder of {_mm(total)}")
    return found


def parse_material(text: str) -> Material:
    """Return a material that is written as `NAME = MODULUS, DENSITY[, POISSON[, LOSS FACTOR]]`.

    Examples
    --------
    >>> from receptance.cli.draft import parse_material
    >>> parse_material("aluminium = 70 GPa, 2700 kg/m^3, 0.33").youngs_modulus
    70000000000.0
    """
    expected = '"NAME = MODULUS, DENSITY, POISSON, LOSS", such as "aluminium = 70 GPa, 2700 kg/m^3, 0.33, 0.001"'
    name, sign, rest = text.partition("=")
    values = [value.strip() for value in rest.split(",")]
    if not sign or not name.strip() or not 2 <= len(values) <= 4:
        raise ValueError(f"is {shown(text)}, expected {expected}")
    try:
        numbers = [float(value) for value in values[2:]]
    except ValueError:
        raise ValueError(f"is {shown(text)}, expected {expected}") from None
    try:
        return Material(
            youngs_modulus=parse(values[0], units.MODULUS),
            density=parse(values[1], units.DENSITY),
            poisson_ratio=parse(numbers[0] if numbers else 0.3, units.POISSON_RATIO),
            loss_factor=parse(numbers[1] if len(numbers) > 1 else 0.001, units.LOSS_FACTOR),
            name=name.strip(),
        )
    except ValueError as error:
        raise ValueError(f"is {shown(text)}: {error}; expected {expected}") from None


# The campaign ---------------------------------------------------------------------------------------------------------


@dataclass(kw_only=True)
class MeasuredFile:
    """An FRF or a time record in a file.

    `name` is that of the measurement and of its assembly, `table` are the keys of the campaign that read the file, and
    `overhang` is in m, from the holder's face to the tip.
    """

    file: Path
    name: str
    measured: FRF | TimeSeries
    table: dict[str, Any]
    overhang: float = 0.0
    held_out: bool = False

    @property
    def about(self) -> str:
        """Contents of the file in a sentence, for a comment."""
        name = FORMATS[self.table.get("format") or file_format(self.file)].title
        if not isinstance(self.measured, FRF):
            return f"{self.file.name} ({name}): {self.measured!r}"
        frf = self.measured
        text = f"{self.file.name} ({name}): {frf.form} in {frf.unit}, {lines_of(frf)}"
        if frf.averages is not None:
            text += f", {frf.averages} averages"
        return text + (f", median coherence {np.median(frf.coherence):.4f}" if frf.coherence is not None else "")


def lines_of(frf: FRF) -> str:
    """Return the number of lines of an FRF and their ends as text."""
    return f"{frf.frequency_hz.size} lines, {frf.frequency_hz[0]:g} to {frf.frequency_hz[-1]:g} Hz"


@dataclass(frozen=True, kw_only=True)
class Draft:
    """A tool in a holder, measured at one overhang or several.

    Pieces are listed from the tip on; the last one of the tool is its shank, which in the holder is the core of its
    pieces. `sensor` is the mass of the accelerometer on the tip in kg, and `spindle_modes` the number of modes of the
    spindle behind the holder; either is 0 without one. `folder` is that of the campaign file.
    """

    title: str
    tool: list[HolderRow]
    holder: list[HolderRow]
    folder: Path
    measurements: list[MeasuredFile]
    sensor: float = 0.0
    spindle_modes: int = 0
    materials: Mapping[str, Material] = field(default_factory=lambda: dict(MATERIALS))

    def text(self) -> str:
        """Return the text of the campaign file with comments; materials and overhangs are checked."""
        parts = [*self._head(), *self._materials(), *self._parts(), *self._assemblies(), *self._measurements()]
        return "\n".join([*parts, *self._unknowns()]) + "\n"

    def _head(self) -> Iterator[str]:
        yield from _comment(
            "Written by `receptance new`. Every value may be changed; `receptance check` reads the file again, says "
            "what is there and what is missing, and draws the assemblies to scale. All keys are in "
            "docs/campaign_keys.md."
        )
        yield ""
        yield f"title = {_value(self.title)}"
        yield ""

    def _materials(self) -> Iterator[str]:
        pieces = [*self.tool, *self.holder]
        used = dict.fromkeys(name for piece in pieces for name in (piece.material, piece.core) if name)
        yield from _comment(
            "Tolerances are standard deviations. Those of materials and dimensions below are assumed: replace them by "
            "your own. They are fitted as errors, so that they are not taken for another cause."
        )
        yield ""
        for name in used:
            if name not in self.materials:
                raise ValueError(f'the material is "{name}"{instead_of(name, self.materials)}')
            material = self.materials[name]
            yield f"[materials.{_key(name)}]"
            for key, declared in type(material).declared.items():
                if isinstance(declared, Number):
                    yield f"{key} = {_value(readable(getattr(material, key), declared.quantity))}"
            yield f"tolerance = {_value(_TOLERANCES['materials'])}"
            yield ""

    def _parts(self) -> Iterator[str]:
        before = sum(piece.length for piece in self.tool)
        for one in self.measurements:
            if one.overhang <= before:
                raise ValueError(
                    f"the overhang of {one.name} is {_mm(one.overhang)}, expected more than the {_mm(before)} of the "
                    "tool in front of its shank"
                )
        yield from _comment(
            "The tool outside the holder, from the tip on. The length of its last segment follows from the overhang "
            "of each assembly, and has an error of its own in each clamping."
        )
        shank = replace(self.tool[-1], length=self.measurements[0].overhang - before)
        if self.tool[:-1]:
            yield from _comment(
                "In front of the shank the diameter is an effective one, of the round bar as stiff as the flutes."
            )
        yield from self._part("tool", self.tool[:-1], "flutes")
        yield from self._part("tool", [shank], "shank")
        yield from _comment("The holder, from its nose on; `core` is the shank of the tool in its bore.")
        yield from self._part("holder", self.holder, "holder")

    def _part(self, name: str, pieces: Sequence[HolderRow], kind: str) -> Iterator[str]:
        for piece in pieces:
            segment = {key: readable(getattr(piece, key), units.LENGTH) for key in _SIZES if getattr(piece, key)}
            segment |= {key: getattr(piece, key) for key in ("material", "core") if getattr(piece, key)}
            yield f"[[parts.{name}.segments]]"
            yield from (f"{key} = {_value(value)}" for key, value in segment.items())
            known = {key: text for key, text in _TOLERANCES[kind].items() if key in segment}
            if "core" in segment:
                del known["inner_diameter"]  # the bore is that of its core
            yield f"tolerance = {_value(known)}"
            yield ""

    def _assemblies(self) -> Iterator[str]:
        yield from _comment("The joint between tool and holder. Its values are unknowns, see below.")
        yield "[joints.joint]"
        yield ""
        chain = ["tool", "joint", "holder"]
        if self.spindle_modes:
            yield from _comment(
                "The spindle behind the holder as modes, identified with the joint. Give as many as the FRFs show "
                "peaks of the machine."
            )
            yield "[modal_parts.spindle]"
            yield "identify = true"
            yield f"modes = {_value([{}] * self.spindle_modes)}"
            yield ""
            chain.append("spindle")
        if self.sensor:
            yield from _comment("The accelerometer, whose mass is part of the model while it measures.")
            yield "[sensors.accelerometer]"
            yield f"mass = {_value(readable(self.sensor, units.MASS))}"
            yield f"tolerance = {_value(_TOLERANCES['sensors'])}"
            yield ""
        before = sum(piece.length for piece in self.tool)
        address = f"tool.segment[{len(self.tool) - 1}].length"
        for one in self.measurements:
            yield f"[assemblies.{_key(one.name)}]"
            yield f"chain = {_value(chain)}"
            yield f"set = {_value({address: _mm(one.overhang - before)})}"
            yield f"conditions = {_value({'overhang': _mm(one.overhang)})}"
            yield ""

    def _measurements(self) -> Iterator[str]:
        yield from _comment(
            'Hit and measured at the tip. For other points add, for example, `response = { part = "holder", position '
            '= "0 mm" }` or `excitation = { position = "5 mm" }`; `direction = "-y"` turns a sign.'
        )
        if not self.sensor:
            yield from _comment(
                'No accelerometer: right for a laser. Else add [sensors.accelerometer] with `mass = "0.6 g"`, and '
                '`sensor = "accelerometer"` to the measurements.'
            )
        if not any(one.held_out for one in self.measurements):
            yield from _comment(
                'With `role = "hold out"` a measurement is left out of the fit and compared with its prediction.'
            )
        for one in self.measurements:
            yield ""
            yield from _comment(one.about)
            yield f"[measurements.{_key(one.name)}]"
            table = {"kind": one.table["kind"], "assembly": one.name}
            table |= {"role": "hold out"} if one.held_out else {}
            table |= {**one.table, "file": _relative(one.file, self.folder)}
            if "coherence" in table:
                table["coherence"] = _relative(table["coherence"], self.folder)
            table |= {"sensor": "accelerometer"} if self.sensor else {}
            yield from (f"{key} = {_value(value)}" for key, value in table.items())
        yield ""

    def _unknowns(self) -> Iterator[str]:
        yield from _comment("Bounds of the unknowns; they are fitted on a logarithmic scale.")
        yield "[unknowns]"
        for name, (lower, upper) in _JOINT_BOUNDS.items():
            yield f'"joint.{name}" = {_value({"lower": lower, "upper": upper})}'


def readable(value: float, kind: Quantity) -> str | float:
    """Return the text of a quantity in the unit of its example, with up to 10 digits.

    Examples
    --------
    >>> from receptance import units
    >>> from receptance.cli.draft import readable
    >>> readable(0.0127, units.LENGTH), readable(580e9, units.MODULUS)
    ('12.7 mm', '580 GPa')
    """
    if not kind.unit:
        return float(f"{value:.10g}")
    _, unit = units.split(kind.example, "")
    factor = parse(f"1 {unit}", replace(kind, least=-float("inf"), above=-float("inf"), most=float("inf")))
    return f"{value / factor:.10g} {unit}"


def _relative(file: Path, folder: Path) -> str:
    try:
        return Path(os.path.relpath(file.resolve(), folder.resolve())).as_posix()
    except ValueError:  # another drive
        return file.resolve().as_posix()


def _mm(length: float) -> str:
    return str(readable(length, units.LENGTH))


def _comment(text: str) -> Iterable[str]:
    return textwrap.wrap(text, _WIDTH, initial_indent="# ", subsequent_indent="# ", break_long_words=False)


def _key(name: str) -> str:
    return name if _BARE.fullmatch(name) else _value(name)


def _value(value: Any) -> str:
    """Return a value on one line of TOML."""
    if isinstance(value, Mapping):
        inside = ", ".join(f"{_key(key)} = {_value(one)}" for key, one in value.items())
        return f"{{ {inside} }}" if inside else "{}"
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(map(_value, value))}]"
    return tomli_w.dumps({"x": value}).removeprefix("x = ").rstrip("\n")
