"""A contour as a result: pieces, mass, centre of gravity, what was assumed, and the lines of a campaign."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import tomli_w

from receptance import units
from receptance.drawing.read import DrawnContour
from receptance.model.beams import Material
from receptance.model.contour import Contour
from receptance.model.materials import MATERIALS
from receptance.report import Column, Fact, Provenance, Result, Table
from receptance.report.table import amount

_MM = 1e3


@dataclass(frozen=True)
class ContourReport(Result):
    """What was read from a drawing, as `receptance contour` prints and draws it.

    Examples
    --------
    >>> from receptance import STEEL
    >>> from receptance.drawing import ContourReport, DrawnContour
    >>> from receptance.model.contour import Contour
    >>> drawn = DrawnContour(Contour([(0.0, 0.02), (0.05, 0.03)]), ())
    >>> report = ContourReport("nose.csv", drawn, STEEL, name="holder")
    >>> f"{report.mass:.4f} kg"
    '0.1952 kg'
    >>> print(report.campaign_lines())
    [parts.holder]
    contour = "nose.csv"
    material = "steel"
    """

    file: str
    """Path of the drawing, as the campaign names it."""
    drawn: DrawnContour
    """The contour, and what was assumed."""
    material: Material
    """Material of the part."""
    name: str = "part"
    """Name of the part in a campaign."""
    keys: Mapping[str, Any] = field(default_factory=dict)
    """Keys of the part in a campaign that say how the drawing is read."""
    provenance: Provenance = field(default_factory=Provenance)

    heading = "Contour"
    plotted_by = "receptance.drawing.figure:draw_contour"

    @property
    def title(self) -> str:
        """Name of the file."""
        return f"{self.file}: contour"

    @property
    def notes(self) -> tuple[str, ...]:
        """What was assumed, and what was left out."""
        return self.drawn.assumptions

    @property
    def contour(self) -> Contour:
        """The contour."""
        return self.drawn.contour

    @property
    def mass(self) -> float:
        """Mass in kg."""
        return self.material.density * self.contour.volume

    def facts(self) -> list[Fact]:
        """Return length, largest diameter, mass and centre of gravity."""
        contour = self.contour
        cones = sum(not piece.is_cylindrical for piece in contour.pieces)
        count = len(contour.pieces)
        return [
            Fact("Length", (f"{_MM * contour.length:.7g} mm",)),
            Fact("Diameter", (f"{_MM * contour.largest_diameter:.7g} mm at most",)),
            Fact("Mass", (f"{amount(self.mass, 'kg', 4)} of {self.material.name or 'the material'}",)),
            Fact("Gravity", (f"centre {_MM * contour.centre_of_gravity:.5g} mm from the tip-side end",)),
            Fact("Pieces", (f"{count}; cones: {cones}; bores: {len(contour.bores)}",)),
        ]

    def tables(self) -> list[Table]:
        """Return the pieces."""
        rows = [
            (
                str(index),
                _MM * piece.start,
                _MM * piece.length,
                _diameters(piece.outer_diameter, piece.end_outer_diameter),
                _diameters(piece.inner_diameter, piece.end_inner_diameter),
            )
            for index, piece in enumerate(self.contour.pieces)
        ]
        columns = (
            "segment",
            Column("from", "mm", ".6g"),
            Column("length", "mm", ".6g"),
            "diameter\n[mm]",
            "bore\n[mm]",
        )
        return [Table("Pieces from the tip-side end on", columns, rows).without_empty()]

    def data(self) -> dict[str, Any]:
        """Return the pieces, mass and centre of gravity in SI units."""
        return {
            "drawing": self.file,
            "length_m": self.contour.length,
            "volume_m3": self.contour.volume,
            "mass_kg": self.mass,
            "centre_of_gravity_m": self.contour.centre_of_gravity,
            "material": self.material.name,
            "pieces": list(self.contour.pieces),
            "campaign": self.campaign_lines(),
        }

    def campaign_lines(self) -> str:
        """Return the tables of material and part as the text of a campaign; listed materials need no table."""
        made = self.material
        material: dict[str, Any] = {
            "youngs_modulus": units.MODULUS.readable(made.youngs_modulus),
            "density": units.DENSITY.readable(made.density),
            "poisson_ratio": made.poisson_ratio,
        }
        if made.loss_factor:
            material["loss_factor"] = made.loss_factor
        name = self.material.name or "material"
        part = {"contour": self.file, "material": name, **self.keys}
        listed = name in MATERIALS and MATERIALS[name].material() == made
        materials = {} if listed else {"materials": {name: material}}
        return tomli_w.dumps({**materials, "parts": {self.name: part}}).strip()


def _diameters(near: float, far: float) -> str:
    """Return the diameters at both ends in mm as text; one for a cylinder, none without a bore."""
    if near == far:
        return f"{_MM * near:.6g}" if near else ""
    return f"{_MM * near:.6g} to {_MM * far:.6g}"
