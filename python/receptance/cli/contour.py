"""The command `contour`: what a drawing shows, to scale, with mass, assumptions and the lines of a campaign."""

from __future__ import annotations

import re
from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, cast

import typer

from receptance import drawing, units
from receptance._text import instead_of
from receptance.cli.files import NoWindow, open_figure
from receptance.cli.running import InputError, Targets, input_errors, takes_targets
from receptance.draft.pieces import parse_material
from receptance.errors import MissingExtraError
from receptance.io import FileFormatError
from receptance.model.beams import Material
from receptance.model.contour import TOLERANCE
from receptance.model.materials import MATERIALS
from receptance.model.materials import material as listed_material

_DRAWING = "Reading of drawings that do not state everything"
"""Group of options in the help."""
_WORD = re.compile(r"\W+")
_KEYS = ("layer", "bore_layer", "unit", "axis", "tip", "within")
"""Keys of a campaign, and arguments in Python, that messages on drawings name; the options have the same names."""


@takes_targets()
def contour(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="Drawing of a part, CSV or DXF.")],
    targets: Targets,
    layer: Annotated[
        list[str] | None,
        typer.Option(
            "--layer", metavar="NAME", rich_help_panel=_DRAWING, help="Layer of the profile; may be repeated."
        ),
    ] = None,
    bore_layer: Annotated[
        list[str] | None,
        typer.Option(
            "--bore-layer", metavar="NAME", rich_help_panel=_DRAWING, help="Layer of the bores; may be repeated."
        ),
    ] = None,
    unit: Annotated[
        str | None,
        typer.Option(
            "--unit", metavar="UNIT", rich_help_panel=_DRAWING, help="Unit of the coordinates, if the file has none."
        ),
    ] = None,
    axis: Annotated[
        str | None,
        typer.Option("--axis", metavar="LINE", rich_help_panel=_DRAWING, help='Axis: x, y, or such as "y = 12 mm".'),
    ] = None,
    tip: Annotated[
        str | None,
        typer.Option(
            "--tip", metavar="END", rich_help_panel=_DRAWING, help="End with the tip: left, right, bottom or top."
        ),
    ] = None,
    within: Annotated[
        str | None,
        typer.Option(
            "--within",
            metavar="LENGTH",
            rich_help_panel=_DRAWING,
            help=f"Largest distance of cones from a curve; by default {1e3 * TOLERANCE:g} mm.",
        ),
    ] = None,
    material: Annotated[
        str, typer.Option("--material", metavar="NAME", help='Material, or "NAME = MODULUS, DENSITY, POISSON".')
    ] = "steel",
    name: Annotated[
        str | None, typer.Option("--name", metavar="NAME", help="Name of the part; by default that of the file.")
    ] = None,
    campaign_lines: Annotated[
        bool, typer.Option("--campaign-lines", help="Print only the lines of a campaign.")
    ] = False,
    no_window: NoWindow = False,
) -> None:
    """Print and draw the contour of a part that a drawing shows, and the lines of a campaign.

    The figure is opened in the default viewer, or saved with --plot.
    """
    targets.protect(file, "the drawing to read")
    targets.require_new()
    written = dict(zip(_KEYS, (layer, bore_layer, unit, axis, tip, within), strict=True))
    keys: dict[str, Any] = {key: value for key, value in written.items() if value}
    options: dict[str, Any] = {key: value for key, value in keys.items() if key != "within"}
    if tip is not None and tip not in drawing.read.TIPS:
        raise InputError(f"--tip is {tip!r}{instead_of(tip, drawing.read.TIPS)}")
    if within is not None:
        try:
            options["tolerance"] = units.parse(within, units.LENGTH)
        except ValueError as error:
            raise InputError(f"--within {error}") from None
    try:
        with input_errors(OSError, TypeError, MissingExtraError):
            drawn = drawing.read_contour(file, **cast(drawing.DrawingOptions, options))
    except FileFormatError as error:
        text, option = _with_options(str(error)), _option(error.option)
        raise InputError(text if not error.option or option in text else f"{text} ({option})") from None
    except ValueError as error:
        raise InputError(_with_options(str(error))) from None
    drawn = replace(drawn, assumptions=tuple(map(_with_options, drawn.assumptions)))
    called = name or _WORD.sub("_", file.stem).strip("_") or "part"
    if not re.fullmatch(r"[^\W\d]\w*", called):
        raise InputError(f"--name is {called!r}, expected one word of letters, digits and underscores")
    report = drawing.ContourReport(file.as_posix(), drawn, _material(material), called, keys)
    console = targets.console()
    if campaign_lines:
        targets.write(report.to_dict, report.plot, html=report.to_html)
        console.print(report.campaign_lines(), soft_wrap=True)
        return
    targets.show(report)
    if not no_window and not targets.asked:
        open_figure(console, report.plot, file.stem)


def _option(key: str) -> str:
    return f"--{key.replace('_', '-')}"


def _with_options(text: str) -> str:
    """Return a message with the options of the command in place of the keys of a campaign that it names."""
    for key in _KEYS:
        text = text.replace(f"`{key}`", _option(key))
    return text


def _material(text: str) -> Material:
    """Return a material by its name, or from its numbers."""
    if "=" not in text:
        try:
            return listed_material(text)
        except ValueError:
            raise InputError(f"--material is {text!r}{instead_of(text, MATERIALS)}") from None
    try:
        return parse_material(text)
    except ValueError as error:
        raise InputError(f"--material {error}") from None
