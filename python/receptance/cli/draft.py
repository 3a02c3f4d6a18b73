"""A new campaign, a tool in a holder at one overhang or several: its measured files, and the text of its file."""

from __future__ import annotations

import os
import re
import shlex
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import tomli_w

from receptance import units
from receptance._reading import ReadingOptions, campaign_keys
from receptance._text import instead_of, one_of, shown
from receptance.campaign.listed_materials import MATERIAL_NUMBERS, listed_materials, listed_table
from receptance.catalogue.rows import HolderRow
from receptance.cli.pieces import SIZES, DrawnHolder, mm
from receptance.cli.running import InputError
from receptance.frf import FRF
from receptance.io import TimeSeries
from receptance.io.files import FORMATS, file_format
from receptance.model.beams import Material

_TOLERANCES = {
    "flutes": {"length": "0.1 mm", "outer_diameter": "3 %", "inner_diameter": "0.3 %"},  # an effective diameter
    "shank": {"length": "0.1 mm", "outer_diameter": "0.05 %", "inner_diameter": "0.3 %"},  # ground, h6
    "holder": {"length": "0.1 mm", "outer_diameter": "0.1 %", "inner_diameter": "0.3 %"},
}
"""Standard deviations of dimensions that a new campaign assumes."""
_OF_OTHER_MATERIALS = {"youngs_modulus": "1 %", "density": "0.5 %", "loss_factor": "50 %"}
"""Likewise of a material with stated values; those of a listed one are its scatter."""
_LEAST_COHERENCE = 0.9
"""Median coherence of neighbouring lines below which the ends of the band are left out."""
_NEIGHBOURS = 9
"""Number of neighbouring lines of that median."""
_CHANNELS = {"force": ("force",), "motion": ("displacement", "velocity", "acceleration")}
_WIDTH = 110
_BARE = re.compile(r"[A-Za-z0-9_-]+")
_LENGTH = re.compile(r"(?<![\d.])(\d+(?:\.\d+)?)\s*_?mm(?![a-z])", re.IGNORECASE)
"""An overhang in the name of a file, which a question suggests."""
_PARTS = ("tool", "holder")
_WORDS = {"tip": ("tool", "0 mm"), "nose": ("holder", "0 mm")}
"""Names of places."""
_PLACE = re.compile(r"\s*(?P<part>\w+)\s*@\s*(?P<position>.*?)\s*", re.DOTALL)
_DIRECTION = re.compile(
    r"(?<!\w)(?:(?P<before>[+-])(?P<first>[XYZ]|(?<=:[+-])[123])|(?P<last>[XYZ])(?P<after>[+-]))(?!\w)", re.IGNORECASE
)
"""A direction as analysers write it, as in `1:+Z`, `Point 1 X-`, `holder@4 mm -Y`, and `1:-3` of universal files."""

# Places ---------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Place:
    """Where a sensor is, or where hits are: distance in m from the tip-side end of a part, and direction.

    The sign is that in which the channel counts, empty if it is not stated; so is the axis, X, Y or Z.
    """

    part: str = "tool"
    position: float | str = 0.0
    sign: str = ""
    axis: str = ""

    @property
    def distance(self) -> str:
        """The position with its unit."""
        return self.position if isinstance(self.position, str) else mm(self.position)

    @property
    def text(self) -> str:
        """The place as `parse_place` reads it."""
        return f"{self.part}@{self.distance}" + (f" {self.sign}{self.axis}" if self.axis else "")

    def table(self) -> dict[str, str]:
        """Return the keys of a coordinate of a campaign; none for the tip."""
        turned = {"direction": "-y"} if self.sign == "-" else {}
        is_tip = (self.part, self.position) == ("tool", 0.0)
        return turned if is_tip else {"part": self.part, "position": self.distance} | turned


def parse_place(text: str) -> Place:
    """Return a place from `PART@DISTANCE`, `tip` or `nose`, with a direction such as `-Z` or without.

    Examples
    --------
    >>> from receptance.cli.draft import parse_place
    >>> parse_place("holder@4 mm -Z")
    Place(part='holder', position=0.004, sign='-', axis='Z')
    >>> parse_place("tip").text
    'tool@0 mm'
    """
    expected = 'expected a place such as "tool@0 mm", "holder@4 mm" or "holder@end", with a direction such as "-Z" if '
    expected += "it is not that of the other channel"
    directions = list(_DIRECTION.finditer(text))
    plain = (text[: directions[0].start()] if directions else text).strip()
    part, position = _WORDS.get(plain.lower(), ("", ""))
    if match := _PLACE.fullmatch(plain):
        part, position = match["part"], match["position"]
    if not part or len(directions) > 1 or (directions and text[directions[0].end() :].strip()):
        raise ValueError(f"is {shown(text)}, {expected}")
    if part not in _PARTS:
        raise ValueError(f"is {shown(text)}, which names {shown(part)}{instead_of(part, _PARTS)}")
    at: float | str = "end"
    if position != "end":
        try:
            at = units.parse(position, units.LENGTH_OR_ZERO)
        except ValueError as error:
            raise ValueError(
                f"is {shown(text)}, whose distance {str(error).partition(', expected')[0]}, {expected}"
            ) from None
    sign, axis = _direction(directions[0]) if directions else ("", "")
    return Place(part, at, sign, axis)


def _direction(match: re.Match[str]) -> tuple[str, str]:
    axis = (match["first"] or match["last"]).upper()
    return match["before"] or match["after"], {"1": "X", "2": "Y", "3": "Z"}.get(axis, axis)


# Measured files -------------------------------------------------------------------------------------------------------


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
    response: Place = Place()
    hit: Place = Place()
    assembly: str = ""

    def __post_init__(self) -> None:
        self.assembly = self.name

    def suggested(self, question: str) -> str | None:
        """Return the probable answer to a question about the file."""
        if question != "overhang":
            return Place().text
        lengths = _LENGTH.findall(self.name)
        return f"{lengths[0]} mm" if len(lengths) == 1 else None

    def sides(self) -> dict[str, Place]:
        """Return the places of response and excitation; directions that are not stated are those of the file."""
        named = "" if self.frf is None or self.frf.labels is None else " ".join(sum(self.frf.labels, ()))
        in_file = [_direction(match) for match in _DIRECTION.finditer(named)]
        stated = dict(zip(("response", "excitation"), in_file, strict=False)) if len(in_file) == 2 else {}
        sides = {}
        for side, place in (("response", self.response), ("excitation", self.hit)):
            sign, axis = stated.get(side, ("", ""))
            sides[side] = place if place.axis else replace(place, sign=sign, axis=axis)
        axes = {side: place.axis for side, place in sides.items() if place.axis}
        if len(set(axes.values())) > 1:
            raise InputError(
                f"{self.name}: the response is along {axes['response']} and the hits along {axes['excitation']}, "
                "expected one axis, y of the model; leave the file out, or state the directions, as in --hit "
                f"'{self.hit.part}@4 mm +{axes['response']}'"
            )
        return sides

    @property
    def frf(self) -> FRF | None:
        """The FRF, None for a time record."""
        return self.measured if isinstance(self.measured, FRF) else None

    @property
    def about(self) -> str:
        """Contents of the file in a sentence, for a comment."""
        name = FORMATS[self.table.get("format") or file_format(self.file)].title
        if (frf := self.frf) is None:
            return f"{self.file.name} ({name}): {self.measured!r}"
        lines = frf.frequency_hz
        text = f"{self.file.name} ({name}): {frf.form} in {frf.unit}, {lines.size} lines, "
        text += f"{lines[0]:g} to {lines[-1]:g} Hz"
        text += "" if frf.averages is None else f", {frf.averages} averages"
        return text + ("" if frf.coherence is None else f", median coherence {np.median(frf.coherence):.4f}")


def share_assemblies(measurements: Sequence[MeasuredFile]) -> None:
    """Give files of one overhang one assembly if hits or sensors differ: they rove in one clamping."""
    for measurement in measurements:
        places = (measurement.response, measurement.hit)
        others = [other for other in measurements if other.overhang == measurement.overhang]
        if any((other.response, other.hit) != places for other in others):
            measurement.assembly = f"overhang {mm(measurement.overhang)}"


def relative_path(file: str | Path, folder: Path) -> str:
    """Return the path of a file relative to a folder."""
    place = Path(file).resolve()
    try:
        return Path(os.path.relpath(place, folder.resolve())).as_posix()
    except ValueError:  # another drive
        return place.as_posix()


def measured_files(
    file: Path, contents: Sequence[Any], reading: ReadingOptions, channels: Mapping[str, str | None], folder: Path
) -> list[MeasuredFile]:
    """Return the FRFs of a file, or the hammer hits, as measurements of a campaign in a folder.

    `reading` are the options that read its contents, and `channels` those of hammer hits that are not the only ones of
    their kind.
    """
    frfs = [item for item in contents if isinstance(item, FRF)]
    records = [item for item in contents if isinstance(item, TimeSeries)]
    names = campaign_keys(records=not frfs)
    keys: dict[str, Any] = {names[name]: value for name, value in reading.items() if name in names}
    if "sample_rate_hz" in reading:
        keys["sample_rate"] = f"{reading['sample_rate_hz']:.15g} Hz"
    keys |= {
        key: relative_path(path, folder) for key, path in (("file", file), ("coherence", keys.get("coherence"))) if path
    }
    if frfs:
        return [
            MeasuredFile(
                file=file,
                name=file.stem if len(frfs) == 1 else f"{file.stem} {index + 1}",
                measured=item,
                table=_frf_keys(file, item, keys | ({"entry": {"number": index}} if len(frfs) > 1 else {})),
            )
            for index, item in enumerate(frfs)
        ]
    if not records:
        words = f"expected the file of its FRF with --coherence {shlex.quote(str(file))}"
        raise InputError(f"{file} holds {contents[0]!r} and no FRF, {words}")
    if len({(record.channels, record.units, record.sample_rate_hz) for record in records}) > 1:
        words = f"split it with receptance convert {shlex.quote(str(file))} OUT --number N"
        raise InputError(f"{file} holds {len(records)} time records with different channels; {words}")
    # Several records of the same channels are hits of one measurement.
    table = _hammer_keys(file, records[0], channels) | keys
    return [MeasuredFile(file=file, name=file.stem, measured=records[0], table=table)]


def _frf_keys(file: Path, measured: FRF, keys: Mapping[str, Any]) -> dict[str, Any]:
    """Return the keys of an FRF in a file, with the band without ends of low coherence."""
    if measured.values[0].size > 1:
        raise InputError(
            f"{file} holds an FRF with {measured.shape[1]} responses and {measured.shape[2]} excitations, expected "
            "files with one of each; write the entry that belongs to the tip with receptance.io, or write its campaign "
            "by hand with `entry`"
        )
    table = {"kind": "frf", **keys}
    lines = measured.frequency_hz
    if measured.coherence is not None and lines.size > _NEIGHBOURS:
        padded = np.pad(measured.coherence[:, 0, 0], _NEIGHBOURS // 2, mode="edge")
        median = np.median(np.lib.stride_tricks.sliding_window_view(padded, _NEIGHBOURS), axis=1)
        good = lines[median >= _LEAST_COHERENCE]
        if good.size and (good[0] > lines[0] or good[-1] < lines[-1]):
            table["bands"] = [[f"{good[0]:.6g} Hz", f"{good[-1]:.6g} Hz"]]
    return table


def _hammer_keys(file: Path, record: TimeSeries, channels: Mapping[str, str | None]) -> dict[str, Any]:
    """Return the keys of a file with hammer hits; the channels follow from their units."""
    table: dict[str, Any] = {"kind": "hammer records"}
    for key, kinds in _CHANNELS.items():
        channel = channels[key]
        fitting = [name for name, kind in zip(record.channels, record.quantities, strict=True) if kind in kinds]
        if channel is not None and channel not in record.channels:
            raise InputError(f"--{key} is {shown(channel)}{instead_of(channel, record.channels)}, a channel of {file}")
        if channel is None and len(fitting) != 1:
            raise InputError(
                f"{file} has {len(fitting) or 'no'} channels with the unit of a {key}, expected --{key} CHANNEL, "
                f"{one_of(fitting or record.channels)}"
            )
        table[key] = channel or fitting[0]
    return table


# The file -------------------------------------------------------------------------------------------------------------

_TEXT = """\
# Written by `receptance new`. Every value may be changed; `receptance check` reads the file again, says what is
# there and what is missing, and draws the assemblies to scale. All keys are in docs/campaign_keys.md.

title = {title}

# Tolerances are standard deviations. Those of materials and dimensions below are assumed: replace them by your
# own. They are fitted as errors, so that they are not taken for another cause.

{materials}
{about_tool}
{flutes}{shank}
{about_holder}
{holder}
# The joint between tool and holder. Its values are unknowns, see below.
[joints.joint]

{spindle}{sensor}{assemblies}
# Hit and measured at the tip unless `response` or `excitation` states another place, for example
# `response = {{ part = "holder", position = "0 mm" }}` or `excitation = {{ position = "5 mm" }}`; `direction = "-y"`
# turns a sign.
{no_sensor}{no_hold_out}
{measurements}
# Bounds of the unknowns; they are fitted on a logarithmic scale.
[unknowns]
"joint.k_y" = {{ lower = "1e6 N/m", upper = "1e11 N/m" }}
"joint.k_theta" = {{ lower = "1e2 N m/rad", upper = "1e7 N m/rad" }}
"joint.c_y" = {{ lower = "1 N s/m", upper = "1e5 N s/m" }}
"joint.c_theta" = {{ lower = "1e-4 N m s/rad", upper = "10 N m s/rad" }}
"""
_TOOL = """\
# The tool outside the holder, from the tip on. The length of its last segment follows from the overhang of each
# assembly, and has an error of its own in each clamping."""
_WHOLE_TOOL = """\
# The tool as it is, from the tip on. The length of its last segment is that outside of the holder, which follows
# from the overhang of each assembly and has an error of its own in each clamping, and the `insertion`."""
_HOLDER = "# The holder, from its nose on; `core` is the shank of the tool in its bore."
_DRAWN_HOLDER = """\
# The holder, from its drawing; `receptance contour` shows what is read of it. One tolerance is that of all diameters
# together, one that of the whole length."""
_FLUTES = "# In front of the shank the diameter is an effective one, of the round bar as stiff as the flutes.\n"
_SPINDLE = """\
# The spindle behind the holder as modes, identified with the joint. With "auto" there are as many as the records
# show; a number states them.
"""
_SENSOR = "# The accelerometer, whose mass is part of the model while it measures.\n"
_NO_SENSOR = """\
# No accelerometer: right for a laser. Else add [sensors.accelerometer] with `mass = "0.6 g"`, and
# `sensor = "accelerometer"` to the measurements.
"""
_NO_HOLD_OUT = '# With `role = "hold out"` a measurement is left out of the fit and compared with its prediction.\n'


def campaign_text(
    *,
    title: str,
    tool: Sequence[HolderRow],
    holder: Sequence[HolderRow] | DrawnHolder,
    measurements: Sequence[MeasuredFile],
    sensor: float,
    spindle_modes: int | Literal["auto"] | None,
    materials: Mapping[str, Material],
) -> str:
    """Return the text of the campaign file with comments.

    Pieces are listed from the tip on; the last one of the tool is its shank, which in the holder is the core of its
    pieces. `sensor` is the mass of the accelerometer on the tip in kg, 0 without one, and `spindle_modes` the number of
    modes of the spindle behind the holder, None without one.
    """
    front = sum(piece.length for piece in tool)
    for measurement in measurements:
        if measurement.overhang <= front:
            raise ValueError(
                f"the overhang of {measurement.name} is {mm(measurement.overhang)}, expected more than the {mm(front)} "
                "of the tool in front of its shank"
            )
    drawn = holder if isinstance(holder, DrawnHolder) else None
    rows = () if isinstance(holder, DrawnHolder) else holder
    names = dict.fromkeys(name for piece in (*tool, *rows) for name in (piece.material, piece.core) if name)
    names |= {} if drawn is None else {drawn.material: None}
    for name in names:
        if name not in materials:
            raise ValueError(f'the material is "{name}"{instead_of(name, materials)}')
    *flutes, shank = tool
    # Beside a drawing the tool has its whole length.
    front -= 0.0 if drawn is None else drawn.insertion
    shank = replace(shank, length=measurements[0].overhang - front)
    chain = ["tool", "joint", "holder", *([] if spindle_modes is None else ["spindle"])]
    address = f"tool.segment[{len(flutes)}].length"
    mass = {"mass": units.MASS.readable(sensor), "tolerance": {"mass": "2 %"}}
    return _TEXT.format(
        title=_value(title),
        materials="\n".join(_material(name, materials[name]) for name in names),
        flutes=_FLUTES + _segments("tool", flutes, "flutes") + "\n" if flutes else "",
        shank=_segments("tool", [shank], "shank"),
        about_tool=_TOOL if drawn is None else _WHOLE_TOOL,
        about_holder=_HOLDER if drawn is None else _DRAWN_HOLDER,
        holder=_segments("holder", rows, "holder") if drawn is None else _drawn(drawn),
        spindle=""
        if spindle_modes is None
        else f"{_SPINDLE}{_table('modal_parts.spindle', {'identify': True, 'modes': spindle_modes})}\n",
        sensor=f"{_SENSOR}{_table('sensors.accelerometer', mass)}\n" if sensor else "",
        assemblies="\n".join(
            _table(
                f"assemblies.{_key(name)}",
                {
                    "chain": chain,
                    **({"insertion": mm(drawn.insertion)} if drawn is not None and drawn.insertion else {}),
                    "set": {address: mm(overhang - front)},
                    "conditions": {"overhang": mm(overhang)},
                },
            )
            for name, overhang in {measurement.assembly: measurement.overhang for measurement in measurements}.items()
        ),
        no_sensor="" if sensor else _NO_SENSOR,
        no_hold_out="" if any(measurement.held_out for measurement in measurements) else _NO_HOLD_OUT,
        measurements="\n".join(_measurement(measurement, bool(sensor)) for measurement in measurements),
    )


def _material(name: str, material: Material) -> str:
    numbers = {key: quantity.readable(getattr(material, key)) for key, quantity in MATERIAL_NUMBERS.items()}
    tolerance = _OF_OTHER_MATERIALS
    if listed_materials([name], {}).get(name) == material:
        tolerance = listed_table(name)["tolerance"]
    return _table(f"materials.{_key(name)}", {**numbers, "tolerance": tolerance})


def _segments(part: str, pieces: Iterable[HolderRow], kind: str) -> str:
    tables = []
    for piece in pieces:
        sizes = {key: getattr(piece, key) for key in SIZES}
        # A bore may end in a point.
        segment = {key: mm(size) for key, size in sizes.items() if size or (size == 0.0 and key.startswith("end_"))}
        tolerances = _TOLERANCES[kind]
        tolerance = {key: tolerances[key.removeprefix("end_")] for key in segment if sizes[key]}
        if piece.core:
            del tolerance["inner_diameter"]  # the bore is that of its core
        segment |= {key: getattr(piece, key) for key in ("material", "core") if getattr(piece, key)}
        tables.append(_table(f"[parts.{part}.segments]", {**segment, "tolerance": tolerance}))
    return "\n".join(tables)


def _drawn(holder: DrawnHolder) -> str:
    tolerances = _TOLERANCES["holder"]
    tolerance = {
        "diameter": tolerances["outer_diameter"], "bore": tolerances["inner_diameter"], "length": tolerances["length"]
    }  # fmt: skip
    table = {"contour": holder.file, "material": holder.material, **holder.keys, "tolerance": tolerance}
    return _table("parts.holder", table)


def _measurement(measurement: MeasuredFile, sensor: bool) -> str:
    table = {"kind": measurement.table["kind"], "assembly": measurement.assembly}
    table |= {"role": "hold out"} if measurement.held_out else {}
    table |= measurement.table
    table |= {"sensor": "accelerometer"} if sensor else {}
    table |= {side: place.table() for side, place in measurement.sides().items() if place.table()}
    wrapped = textwrap.wrap(
        measurement.about, _WIDTH, initial_indent="# ", subsequent_indent="# ", break_long_words=False
    )
    return "\n".join([*wrapped, _table(f"measurements.{_key(measurement.name)}", table)])


def _table(head: str, values: Mapping[str, Any]) -> str:
    return f"[{head}]\n" + "".join(f"{_key(key)} = {_value(value)}\n" for key, value in values.items())


def _key(name: str) -> str:
    return name if _BARE.fullmatch(name) else _value(name)


def _value(value: Any) -> str:
    """Return a value on one line of TOML."""
    if isinstance(value, Mapping):
        inside = ", ".join(f"{_key(key)} = {_value(item)}" for key, item in value.items())
        return f"{{ {inside} }}" if inside else "{}"
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(map(_value, value))}]"
    return tomli_w.dumps({"x": value}).removeprefix("x = ").rstrip("\n")
