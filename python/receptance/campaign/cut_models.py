"""What a campaign file may hold: cuts, and how their stability is asked for."""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Discriminator, Field, Tag

from receptance import units
from receptance._text import shown
from receptance.campaign.file_models import Band, FileFields
from receptance.campaign.models import Table
from receptance.campaign.quantities import Amount, Deviation, Spread

__all__ = ["CutTable", "MillingTable", "StabilityTable", "TipTable", "TurningTable"]

_Coefficient = Annotated[float, Amount(units.CUTTING_COEFFICIENT)]
_CoefficientOrZero = Annotated[float, Amount(units.CUTTING_COEFFICIENT_OR_ZERO)]
_CoefficientSpread = Annotated[Deviation | None, Spread(units.CUTTING_COEFFICIENT)]
_Speed = Annotated[float, Amount(units.SPINDLE_SPEED)]
_Tooth = Annotated[int, Field(ge=1, le=1000)]


class TipTable(FileFields):
    """The receptance of the tool tip in one direction: one of an assembly, a measurement or a file."""

    file: str | None = None  # type: ignore[assignment]
    """file beside the campaign with the FRF of the tip"""
    assembly: str | None = None
    """name of an assembly instead, whose tip is predicted"""
    measurement: str | None = None
    """name of a measured FRF of the campaign instead"""
    bands: Annotated[list[Band], Field(min_length=1)] | None = None
    """bands of frequency in which limits are looked for, of a file or a measurement, `[["300 Hz", "4 kHz"]]`; by
    default all usable lines"""


def _across(value: Any) -> Any:
    """Say what was expected before pydantic names the members of a union in turn."""
    if isinstance(value, (dict, TipTable)) or value in ("as x", "rigid"):
        return value
    raise ValueError(f'is {shown(value)}, expected a table, "as x" or "rigid"')


class MillingSpread(Table):
    """Standard deviations of the cutting coefficients, which are drawn log-normal and independent."""

    k_t: _CoefficientSpread = None
    """of the tangential coefficient"""
    k_n: _CoefficientSpread = None
    """of the normal coefficient"""


class TurningSpread(Table):
    """Standard deviation of the cutting coefficient, which is drawn log-normal."""

    k: _CoefficientSpread = None
    """of the coefficient"""


class MillingTable(Table):
    """A milling cut with straight teeth at equal distances."""

    kind: Literal["milling"]
    """`"milling"`"""
    teeth: _Tooth
    """number of teeth"""
    immersion: Annotated[float, Amount(units.IMMERSION)] = 1.0
    """width of cut over diameter of the tool, up to 1, a slot"""
    feed: Literal["up", "down"] = "down"
    """up-milling (conventional) or down-milling (climb)"""
    k_t: _Coefficient
    """tangential cutting coefficient: force over depth and chip thickness"""
    k_n: _CoefficientOrZero
    """normal (radial) cutting coefficient"""
    tolerance: MillingSpread = MillingSpread()
    """standard deviations of the coefficients, by the same keys"""
    x: TipTable
    """receptance of the tip in the direction of feed"""
    y: Annotated[TipTable | Literal["as x", "rigid"], BeforeValidator(_across)] = "as x"
    """receptance across it; `"as x"` the same, `"rigid"` none"""


class TurningTable(Table):
    """A turning cut: one tooth, always in the cut."""

    kind: Literal["turning"]
    """`"turning"`"""
    k: _Coefficient
    """cutting coefficient: force over depth and chip thickness"""
    angle: Annotated[float, Amount(units.DIRECTION)] = 0.0
    """between the force and the direction of the chip's thickness"""
    tolerance: TurningSpread = TurningSpread()
    """standard deviation of the coefficient"""
    x: TipTable
    """receptance of the tip in the direction of the chip's thickness"""


CutTable = Annotated[
    Annotated[MillingTable, Tag("milling")] | Annotated[TurningTable, Tag("turning")], Discriminator("kind")
]


class StabilityTable(Table):
    """At which speeds cuts are looked at, and how sure a depth is to be."""

    speeds: Annotated[list[_Speed], Field(min_length=2, max_length=2)] | None = None
    """lowest and highest spindle speed, `["4000 rpm", "24000 rpm"]`"""
    step: _Speed | None = None
    """distance of the speeds; by default a four-hundredth of their range, a thirtieth with semi-discretisation"""
    probability: Annotated[float, Field(gt=0.0, lt=1.0)] = 0.95
    """with which recommended depths are stable"""
    draws: Annotated[int, Field(ge=20)] | None = None
    """how many receptances and coefficients are drawn; by default 200, with semi-discretisation 40"""
    seed: Annotated[int, Field(ge=0)] = 0
    """of what is drawn"""
    method: Literal["mean force", "semi-discretisation"] = "mean force"
    """mean of the force over a tooth pitch (zeroth order), or the force as it is, for interrupted cuts"""
    largest_depth: Annotated[float, Amount(units.LENGTH)] | None = None
    """up to which semi-discretisation looks; by default ten times the lowest limit of the mean force"""

    @property
    def number_of_draws(self) -> int:
        """How many draws there are."""
        return self.draws or (200 if self.method == "mean force" else 40)
