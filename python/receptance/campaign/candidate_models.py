"""What a campaign file may hold: measurements that could be taken next."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Discriminator, Field, Tag

from receptance import units
from receptance.campaign.models import CoordinateTable, Table, Written
from receptance.campaign.quantities import Amount, OneOf

__all__ = ["CandidateFRFTable", "CandidateFrequenciesTable", "CandidateTable"]

_Frequency = Annotated[float, Amount(units.FREQUENCY)]


class _Possible(Table):
    assembly: str
    """name of the assembly that would be measured; one that was measured is the same clamping"""
    sensor: str | None = None
    """name of the sensor that would sit at the response coordinate; none for a laser"""
    response: CoordinateTable = CoordinateTable()
    """where motion would be seen"""
    conditions: dict[str, Written] = Field(default={})
    """numbers with units that describe the measurement"""
    cost: Annotated[float, Field(gt=0.0)] = 1.0
    """what it costs, in any unit, the same for all candidates"""


class CandidateFRFTable(_Possible):
    """A frequency response function that could be measured."""

    kind: Literal["frf"]
    """`"frf"`"""
    excitation: CoordinateTable = CoordinateTable()
    """where the load would act"""
    lower: _Frequency | None = None
    """lowest line; by default `step`"""
    upper: _Frequency
    """highest line"""
    step: _Frequency
    """distance of the lines, which count as independent"""
    standard_deviation: str
    """expected of the FRF on every line, such as `"2 %"`"""
    floor: str | None = None
    """what no noise model covers, as a standard deviation added in squares on every line, such as `"0.3 %"`"""


class CandidateFrequenciesTable(_Possible):
    """Natural frequencies that could be measured."""

    kind: Literal["natural frequencies"]
    """`"natural frequencies"`"""
    modes: Annotated[list[Annotated[int, Field(ge=1)]], Field(min_length=1)]
    """which elastic modes, the lowest is 1"""
    standard_deviation: Annotated[
        str | list[str], OneOf(str, list, what='a standard deviation such as "5 Hz", or a list of them')
    ]
    """expected of the frequencies, `"5 Hz"` or `"0.1 %"`, one for all or one for each"""


CandidateTable = Annotated[
    Annotated[CandidateFRFTable, Tag("frf")] | Annotated[CandidateFrequenciesTable, Tag("natural frequencies")],
    Discriminator("kind"),
]
