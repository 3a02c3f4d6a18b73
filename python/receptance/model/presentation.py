"""Tables of an assembly: its segments, joints and attachments with their values."""

from __future__ import annotations

from dataclasses import fields, is_dataclass
from typing import TYPE_CHECKING, Any

from receptance.model.beams import Part
from receptance.report import Column, Table

if TYPE_CHECKING:
    from receptance.model.assembly import Assembly

__all__ = ["element_tables"]

_MM = 1e3


def element_tables(assembly: Assembly) -> list[Table]:
    """Return the segments of the parts, and the other elements with the values that are not zero."""
    segments: list[tuple[Any, ...]] = []
    others: list[tuple[str, str, str]] = []
    for name, element in {**assembly.elements, **assembly.attachments}.items():
        if isinstance(element, Part):
            for number, segment in enumerate(element.segments):
                segments.append(
                    (
                        name if number == 0 else "",
                        number,
                        _MM * segment.length,
                        _MM * segment.outer_diameter,
                        _MM * segment.inner_diameter,
                        segment.material.name,
                        segment.core.name if segment.core is not None else "",
                    )
                )
        else:
            others.append((name, type(element).__name__, _values(element)))
    columns = (
        "part",
        Column("segment", form="d"),
        Column("length", "mm"),
        Column("outer diameter", "mm"),
        Column("inner diameter", "mm"),
        "material",
        "core",
    )
    tables = [Table("Parts", columns, segments).without_empty()]
    if others:
        tables.append(Table("Joints and attachments, SI units", ("name", "kind", "values"), others))
    return tables


def _values(element: Any) -> str:
    found = []
    for one in fields(element) if is_dataclass(element) else ():
        value = getattr(element, one.name)
        if isinstance(value, bool) or not isinstance(value, (int, float)) or value == 0.0:
            continue
        found.append(f"{one.name} {value:.4g}")
    where = getattr(element, "position", None)
    if where is not None and f"position {where:.4g}" not in found if isinstance(where, float) else where == "end":
        found.append(f"position {where}")
    return ", ".join(found)
