"""The text of a new campaign, with comments: a tool in a holder at one overhang or several."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any, Literal

import tomli_w

from receptance import units
from receptance._text import instead_of
from receptance.campaign.listed_materials import MATERIAL_NUMBERS, listed_materials, listed_table
from receptance.catalogue.rows import HolderRow
from receptance.draft.files import MeasuredFile
from receptance.draft.pieces import SIZES, DrawnHolder, mm
from receptance.model.beams import Material

_TOLERANCES = {
    "flutes": {"length": "0.1 mm", "outer_diameter": "3 %", "inner_diameter": "0.3 %"},  # an effective diameter
    "shank": {"length": "0.1 mm", "outer_diameter": "0.05 %", "inner_diameter": "0.3 %"},  # ground, h6
    "holder": {"length": "0.1 mm", "outer_diameter": "0.1 %", "inner_diameter": "0.3 %"},
}
"""Standard deviations of dimensions that a new campaign assumes."""
_OF_OTHER_MATERIALS = {"youngs_modulus": "1 %", "density": "0.5 %", "loss_factor": "50 %"}
"""Likewise of a material with stated values; those of a listed one are its scatter."""
_WIDTH = 110
_BARE = re.compile(r"[A-Za-z0-9_-]+")
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
