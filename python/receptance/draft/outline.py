"""Tool and holder as assemblies that are drawn while the other answers are still missing."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

from receptance import drawing
from receptance.catalogue.rows import HolderRow
from receptance.draft.answers import Answers
from receptance.draft.pieces import SIZES, DrawnHolder, mm
from receptance.model.assembly import Assembly
from receptance.model.beams import CARBIDE, STEEL, Material, Part, Segment
from receptance.model.insertion import insert
from receptance.model.joints import PointJoint

_SHOWN_OVERHANG = 3.0
"""Overhang in diameters of the shank that is drawn as long as none is stated."""
_ANY_JOINT = {"k_y": 1e8, "k_theta": 1e5, "c_y": 0.0, "c_theta": 0.0}
"""Values of a joint that is only drawn."""


def outlines(answers: Answers, folder: Path) -> dict[str, Assembly]:
    """Return the assembly at each overhang by its title, as far as it is stated; none before tool and holder are.

    `folder` is that of the new campaign. A ValueError says why they do not fit.

    Examples
    --------
    >>> from pathlib import Path
    >>> from receptance.draft import outlines, review
    >>> answers = review([], {"tool": "20 mm", "holder": "48 mm x 50 mm"}, Path("campaign.toml"))
    >>> {title: list(assembly.elements) for title, assembly in outlines(answers, Path()).items()}
    {'overhang not stated': ['tool', 'joint', 'holder']}
    """
    tool, holder = answers.tool, answers.holder
    if not tool or not holder:
        return {}
    front = sum(piece.length for piece in tool)
    overhangs = dict.fromkeys(item.overhang for item in answers.measurements if item.overhang > front)
    titles = {f"overhang {mm(overhang)}": overhang for overhang in overhangs}
    titles = titles or {"overhang not stated": front + _SHOWN_OVERHANG * tool[-1].outer_diameter}
    return {title: _assembly(answers, tool, holder, overhang - front, folder) for title, overhang in titles.items()}


def _assembly(
    answers: Answers, tool: list[HolderRow], holder: list[HolderRow] | DrawnHolder, shank: float, folder: Path
) -> Assembly:
    joint = PointJoint(name="joint", **_ANY_JOINT)
    inside = holder.insertion if isinstance(holder, DrawnHolder) else 0.0
    pieces = [*tool[:-1], replace(tool[-1], length=shank + inside)]
    of_tool = Part([_segment(answers, piece, CARBIDE) for piece in pieces], name="tool")
    if not isinstance(holder, DrawnHolder):
        return Assembly([of_tool, joint, Part([_segment(answers, piece, STEEL) for piece in holder], name="holder")])
    options: Any = {{"within": "tolerance"}.get(key, key): value for key, value in holder.keys.items()}
    contour = drawing.read_contour(folder / holder.file, **options).contour
    drawn = Part.from_contour(contour, material=_material(answers, holder.material, STEEL), name="holder")
    if not inside:
        return Assembly([of_tool, joint, drawn])
    fitted = insert(of_tool, drawn, inside)
    return Assembly([fitted.tool, joint, fitted.holder])


def _segment(answers: Answers, piece: HolderRow, usual: Material) -> Segment:
    sizes = {key: getattr(piece, key) for key in SIZES}
    core = _material(answers, piece.core, CARBIDE) if piece.core else None
    return Segment(**sizes, material=_material(answers, piece.material, usual), core=core)


def _material(answers: Answers, name: str, usual: Material) -> Material:
    """Return a material by name; before it is stated, the usual one without a name, which no legend shows."""
    return answers.materials.get(name) or replace(usual, name="")
