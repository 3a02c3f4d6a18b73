"""The questions of a new campaign: what measured files do not state.

The module imports no numbers, because the command line declares an option for each question.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from receptance import campaign, draft, units
from receptance._reading import channel_units
from receptance._text import instead_of, shown
from receptance.model.materials import is_listed

Parse = Callable[[str, Mapping[str, Any]], Any]
"""Returns the answer of a text after other answers, or raises a ValueError whose message begins with "is"."""


@dataclass(frozen=True)
class Question:
    """What the files do not state: the name of its answer, the question, an example, and the reader of an answer.

    Examples
    --------
    >>> from receptance.draft import QUESTIONS
    >>> QUESTIONS["sensor"].parse("0.6 g", {})
    0.0006
    """

    name: str
    text: str
    example: str
    parse: Parse
    each: bool = False
    """Whether each file has an answer of its own."""

    @property
    def option(self) -> str:
        """The option of the command line."""
        return f"--{self.name.replace('_', '-')}"


def _quantity(quantity: units.Quantity, *none: str) -> Parse:
    expected = quantity.expected + (", or none" if none else "")
    return lambda text, _: 0.0 if text.lower() in none else units.parse(text, quantity, expected)


def _choice(*names: str) -> Parse:
    def parse(text: str, answers: Mapping[str, Any]) -> str:
        choices = names or answers["materials"]
        if text not in choices and (names or not is_listed(text)):
            raise ValueError(f"is {shown(text)}{instead_of(text, choices)}")
        return text

    return parse


def _averages(text: str, answers: Mapping[str, Any]) -> int:
    if not text.isdecimal() or int(text) < 2:
        raise ValueError(f"is {shown(text)}, expected a whole number of at least 2")
    return int(text)


def _deviation(text: str, answers: Mapping[str, Any]) -> str:
    campaign.values.parse_deviation_share(text)
    return text


def _place(text: str, answers: Mapping[str, Any]) -> draft.Place:
    return draft.parse_place(text)


def _holder(text: str, answers: Mapping[str, Any]) -> Any:
    return draft.parse_holder(text, answers.get("folder"))


def _with_shank(text: str, answers: Mapping[str, Any]) -> Any:
    insertion = _quantity(units.LENGTH, "none")(text, answers)
    tool, holder = answers["tool"], answers["holder"]
    if isinstance(holder, draft.DrawnHolder):
        return replace(holder, insertion=insertion)
    return draft.inserted(holder, insertion, tool[-1]) if tool and holder else None


READING_QUESTIONS = {
    question.name: question
    for question in (
        Question(
            "columns", "Header with units", "frequency [Hz],real [g/N],imag [g/N]", lambda text, _: text.split(",")
        ),
        Question(
            "unit",
            "Unit of the numbers",
            "m/s^2/N, or hammer=N, tip=g",
            lambda text, _: channel_units(re.split(r"\s*,\s*", text)),
        ),
    )
}
"""Options of reading that are asked for if a file cannot be read without them."""
OVERHANG = Question(
    "overhang", "Overhang of {file}, from the holder's face to the tip", "60 mm", _quantity(units.LENGTH), each=True
)
PLACES = (
    Question(
        "response", "Place of the sensor of {file}, PART@DISTANCE from the tip-side end", "tool@0 mm", _place, True
    ),
    Question("hit", "Place of the hits of {file}, PART@DISTANCE from the tip-side end", "holder@4 mm", _place, True),
)
"""Places of each file: at the tip unless they are stated. In a machine they are asked for."""
_OF_WEIGHTS = (
    Question("averages", "Number of averages of {file}, which does not state it", "10", _averages),
    Question("standard_deviation", "Standard deviation of {file}, which has no coherence", "2 %", _deviation),
)
_HOLDER = (
    "Pieces of the holder from its nose on, length x outer diameter/bore; or a CSV or TOML file of segments, FILE:NAME "
    "if it has several holders; or its drawing, a DXF file"
)
_OF_MODEL = (
    Question(
        "tool",
        "Diameter of the tool; or its pieces from the tip on, the shank last, '30 mm x 9.6 mm, 12 mm'",
        "20 mm",
        lambda text, _: draft.parse_pieces(text, shank=True),
    ),
    Question("tool_material", "Material of the tool, {materials}", "carbide", _choice()),
    Question("holder", _HOLDER, "48 mm x 50 mm, 90 mm x 44/16 mm", _holder),
    Question("holder_material", "Material of the holder, {materials}", "steel", _choice()),
    Question("insertion", "Length of the shank in the holder, or none", "48 mm", _with_shank),
    Question(
        "sensor", "Mass of the accelerometer, or none for a laser", "0.6 g", _quantity(units.MASS, "none", "laser", "0")
    ),
    Question(
        "support", "free for a holder that hangs free, spindle for one in a machine", "free", _choice("free", "spindle")
    ),
)
QUESTIONS = {question.name: question for question in (OVERHANG, *PLACES, *_OF_WEIGHTS, *_OF_MODEL)}
"""The questions by name."""
