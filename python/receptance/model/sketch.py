"""Assemblies laid out to scale in mm from the tip: sections, joints, attachments, points of measurement and labels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from receptance.model.addresses import ChainElement, place_on, points_of
from receptance.model.assembly import Assembly
from receptance.model.beams import Material, Part, Section, Segment, SpreadJoint
from receptance.model.coordinates import Coordinate
from receptance.model.joints import GroundSpring, PointMass, Resonator
from receptance.report.colours import COLOURS, INK

_ROW = 0.19
"""Height of a row of labels in inches."""
_CHARACTER = 0.068
"""Width of a character of a label in inches."""
_FILLS = ("#C9D3DC", "#8E9AA6", "#E3D3B4", "#B9CDB5", "#D8BFD0")
"""Fills of materials in the order in which they occur."""
_MM = 1e3
_MOST_LABELLED = 8
"""Most segments of a part that are all labelled; of a part of more, as from a contour, only the long ones are."""
_SHORT = 0.08
"""Largest share of the length of such a part up to which a segment has no label and a thin outline."""


@dataclass(frozen=True)
class Mark:
    """A labelled point: motion ("response"), a triangle below, or load ("excitation"), an arrow from above."""

    text: str
    at: Coordinate
    kind: str


@dataclass(frozen=True)
class Drawing:
    """An assembly to draw, with its title and points of measurement."""

    assembly: Assembly
    title: str = ""
    marks: tuple[Mark, ...] = ()


def extent(assembly: Assembly) -> float:
    """Return the length of a drawing in mm, with a box for a spindle."""
    return _MM * assembly.length + _spindle_length(assembly)


def _length(element: ChainElement) -> float:
    """Return the length of an element of the chain in mm; zero for one at a point."""
    return _MM * float(getattr(element, "length", 0.0))


def _spindle_length(assembly: Assembly) -> float:
    last = list(assembly.elements.values())[-1]
    return 0.5 * _largest(assembly) if last.role == "spindle" else 0.0


def _largest(assembly: Assembly) -> float:
    """Return the largest outer diameter in mm."""
    segments = [segment for part in assembly.parts.values() for segment in part.segments]
    return _MM * max(outer for segment in segments for outer, _ in segment.ends)


class _LabelRows:
    """Labels in rows above or below a drawing; a label goes to the first row in which it has room."""

    def __init__(self, start: float, step: float, scale: float, ends: tuple[float, float]) -> None:
        self._start, self._step, self._scale, self._ends = start, step, scale, ends
        self._taken: list[list[tuple[float, float]]] = []

    def place(self, x: float, text: str, least: int = 0) -> tuple[float, float]:
        """Return the centre of a label as close to x as the ends of the axes allow."""
        half = 0.5 * (_CHARACTER * len(text) + 0.1) * self._scale
        x = min(max(x, self._ends[0] + half), max(self._ends[1] - half, self._ends[0] + half))
        row = least
        while True:
            while row >= len(self._taken):
                self._taken.append([])
            if all(x + half <= low or x - half >= high for low, high in self._taken[row]):
                self._taken[row].append((x - half, x + half))
                return x, self._start + (row + 0.5) * self._step
            row += 1

    @property
    def count(self) -> int:
        """Number of rows in use."""
        return len(self._taken)

    @property
    def end(self) -> float:
        """Height of the end of the last row."""
        return self._start + len(self._taken) * self._step


class Body(NamedTuple):
    """A body of revolution in mm, a cylinder or a cone."""

    x: float
    length: float
    near: float
    """Radius at x."""
    far: float
    """Radius at the other end."""
    fill: str
    hatch: str = ""
    edge: float = 0.8
    """Width of the outline in points."""
    element: str = ""
    """Name of the element that it belongs to."""

    def corners(self) -> list[tuple[float, float]]:
        """Return the corners of the section, counterclockwise from that below x."""
        end = self.x + self.length
        return [(self.x, -self.near), (end, -self.far), (end, self.far), (self.x, self.near)]

    def radius_at(self, x: float) -> float:
        """Return the radius at a place in it."""
        share = (x - self.x) / self.length
        return self.near + min(max(share, 0.0), 1.0) * (self.far - self.near)


@dataclass(frozen=True)
class _Label:
    """A text with its centre, and the point to which its leader goes."""

    text: str
    centre: tuple[float, float]
    colour: str = INK
    leader: tuple[float, float] | None = None


class Sketch:
    """Shapes and labels of one assembly in mm; `scale` is the number of mm in an inch."""

    def __init__(self, drawing: Drawing, scale: float, ends: tuple[float, float], fills: dict[str, str]) -> None:
        self.drawing, self.scale, self.ends, self.fills = drawing, scale, ends, fills
        self.radius = 0.5 * _largest(drawing.assembly)
        gap = 0.12 * scale
        self.above = _LabelRows(self.radius + gap, _ROW * scale, scale, ends)
        self.below = _LabelRows(-self.radius - gap, -_ROW * scale, scale, ends)
        self.bodies: list[Body] = []
        self.joints: list[tuple[float, float, float, str]] = []
        """x, length, radius, name."""
        self.labels: list[_Label] = []
        self.spans: list[tuple[float, float, float]] = []
        """Ends and height of a dimension line."""
        self.symbols: list[tuple[float, float, str, str, str]] = []
        """x, y, kind, colour, and the name of an attachment or the text of a mark."""
        self.starts: dict[str, float] = {}
        self._lay_out()

    @property
    def height(self) -> float:
        """Height with all labels in mm."""
        return self.above.end - self.below.end

    def _lay_out(self) -> None:
        assembly = self.drawing.assembly
        x = 0.0
        names: list[tuple[float, float, str]] = []
        joints: list[tuple[float, str, float]] = []
        for name, element in assembly.elements.items():
            self.starts[name] = x
            length = _length(element)
            first_body = len(self.bodies)
            if isinstance(element, Part):
                self._add_part(x, element)
                names.append((x, x + length, name))
            elif isinstance(element, SpreadJoint):
                for section in (element.sleeve, element.shank):
                    diameters = (section.outer_diameter, section.inner_diameter)
                    self._add_section(x, length, section, (diameters, diameters))
                self._label_below(x, length, f"{length:.4g}")
                half = 0.5 * _MM * element.shank.outer_diameter
                self.joints.append((x, length, half, name))
                joints.append((x + 0.5 * length, name, half))
            elif element.role == "spindle":
                width = _spindle_length(assembly)
                self.bodies.append(Body(x, width, self.radius, self.radius, "white", "////"))
                names.append((x, x + width, name))
            else:
                half = self._radius_at(x)
                self.joints.append((x, 0.0, half, name))
                joints.append((x, name, half))
            self.bodies[first_body:] = [body._replace(element=name) for body in self.bodies[first_body:]]
            x += length
        first = self.below.count
        for low, high, name in names:
            self.labels.append(_Label(name, self.below.place(0.5 * (low + high), name, first)))
        for at, name, half in joints:
            self._label(at, half, name, COLOURS[1])
        self._add_attachments()
        for mark in self.drawing.marks:
            self._add_mark(mark)

    def _add_part(self, x: float, part: Part) -> None:
        start, least = x, _SHORT * part.length if len(part.segments) > _MOST_LABELLED else 0.0
        labelled = 0
        for segment in part.segments:
            length, is_long = _MM * segment.length, segment.length > least
            self._add_section(x, length, segment, segment.ends, 0.8 if is_long else 0.2)
            if is_long:
                labelled += 1
                self._label(x + 0.5 * length, 0.5 * _MM * segment.at(0.5)[0], _diameters(segment), INK)
                self._label_below(x, length, f"{length:.4g}")
            x += length
        if not labelled:
            for at, (outer, inner) in ((start, part.segments[0].ends[0]), (x, part.segments[-1].ends[1])):
                bore = f"/{_MM * inner:.4g}" if inner else ""
                self._label(at, 0.5 * _MM * outer, f"ø{_MM * outer:.4g}{bore}", INK)
            self._label_below(start, x - start, f"{x - start:.4g}")

    def _add_section(
        self,
        x: float,
        length: float,
        section: Segment | Section,
        ends: tuple[tuple[float, float], tuple[float, float]],
        edge: float = 0.8,
    ) -> None:
        (outer, inner), (end_outer, end_inner) = ends
        half = 0.5 * _MM
        if isinstance(section, Segment) and section.shape is not None and section.shape.outline:
            # As seen across the deflection; what is left of the flutes is hatched, and the core is plain.
            height, core = 2.0 * max(abs(y) for _, y in section.shape.outline), _inscribed(section.shape.outline)
            fill, fluted = self._fill(section.material), "flutes" in dict(section.shape.recipe)
            sizes = [(height, "" if not fluted else "////"), *([(core, "")] if fluted else [])]
            for size, hatch in sizes:
                self.bodies.append(Body(x, length, half * size * outer, half * size * end_outer, fill, hatch, edge))
            return
        self.bodies.append(Body(x, length, half * outer, half * end_outer, self._fill(section.material), "", edge))
        if inner or end_inner:
            fill = self._fill(section.core) if section.core is not None else "white"
            self.bodies.append(Body(x, length, half * inner, half * end_inner, fill, "", edge))

    def _fill(self, material: Material) -> str:
        return self.fills.setdefault(material.name, _FILLS[len(self.fills) % len(_FILLS)])

    def _radius_at(self, x: float) -> float:
        """Return the radius of a point joint: that of the slimmer of its neighbours, but visible."""
        near = [body.radius_at(x) for body in self.bodies if body.x - 1e-9 <= x <= body.x + body.length + 1e-9]
        return max(near, default=self.radius)

    def _label(self, x: float, y: float, text: str, colour: str) -> None:
        """Add a label with a leader to a point, above it or below it."""
        rows = self.above if y >= 0.0 else self.below
        self.labels.append(_Label(text, rows.place(x, text), colour, (x, y)))

    def _label_below(self, x: float, length: float, text: str) -> None:
        self.labels.append(_Label(text, self.below.place(x + 0.5 * length, text)))
        self.spans.append((x, x + length, -self.radius - 0.06 * self.scale))

    def _place(self, part: str, position: float | str) -> tuple[float, float]:
        """Return position and radius of a point in mm."""
        elements = self.drawing.assembly.elements
        name, along = place_on(elements, "drawing", part, position)
        radius, edge = 0.0, 0.0
        for segment in elements[name].segments:  # type: ignore[union-attr]
            share = min((along - edge) / segment.length, 1.0)
            radius = 0.5 * _MM * segment.at(share)[0]
            edge += segment.length
            if along < edge - 1e-9:
                break
        return self.starts[name] + _MM * along, radius

    def _add_attachments(self) -> None:
        assembly = self.drawing.assembly
        for name, attachment in assembly.attachments.items():
            part, along = points_of(assembly.elements, name, attachment)
            middle, half = self._place(part, sum(along) / len(along))
            if isinstance(attachment, GroundSpring):
                for point in along:
                    at, radius = self._place(part, point)
                    self.symbols.append((at, -radius, "ground", COLOURS[2], name))
                self._label(middle, -half, name, COLOURS[2])
                continue
            text = f"{name} {_grams(attachment.mass)}" if isinstance(attachment, (PointMass, Resonator)) else name
            self.symbols.append((middle, half, "mass", COLOURS[3], name))
            self._label(middle, half, text, COLOURS[3])

    def _add_mark(self, mark: Mark) -> None:
        x, half = self._place(mark.at.part, mark.at.position)
        # The sensor is opposite to the hit, so that both are visible at one coordinate.
        y = half if mark.kind == "excitation" else -half
        self.symbols.append((x, y, mark.kind, COLOURS[0], mark.text))
        self._label(x, y, mark.text, COLOURS[0])


def _inscribed(outline: Sequence[tuple[float, float]]) -> float:
    """Return the diameter of the largest circle about the origin within an outline."""
    points = np.array(outline)
    along = np.roll(points, -1, axis=0) - points
    share = -np.sum(points * along, axis=1) / np.maximum(np.sum(along**2, axis=1), np.finfo(float).tiny)
    nearest = points + np.clip(share, 0.0, 1.0)[:, None] * along
    return 2.0 * float(np.min(np.hypot(*nearest.T)))


def _diameters(segment: Segment) -> str:
    """Return the outer diameter and that of the bore in mm, both ends of a cone."""
    outer, inner = (
        f"{_MM * near:.4g}" if near == far else f"{_MM * near:.4g}–{_MM * far:.4g}"
        for near, far in zip(*segment.ends, strict=True)
    )
    text = f"ø{outer}{'' if inner == '0' else f'/{inner}'}"
    if segment.shape is None:
        return text
    if flutes := dict(segment.shape.recipe).get("flutes"):
        return f"{text}, {flutes} flutes"
    if not segment.shape.outline or segment.is_conical:
        return f"{text}, not round"
    sides = np.ptp(np.array(segment.shape.outline), axis=0) * _MM * segment.outer_diameter
    return f"{sides[0]:.4g} x {sides[1]:.4g}"


def _grams(mass: float) -> str:
    return f"{mass:.3g} kg" if mass >= 1.0 else f"{_MM * mass:.3g} g"
