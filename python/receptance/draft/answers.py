"""The questions that measured files leave open, in the order in which they are asked, with their answers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, Literal, TypeAlias

from receptance.campaign.listed_materials import listed_materials
from receptance.catalogue.rows import HolderRow
from receptance.draft.files import MeasuredFile, Place, relative_path
from receptance.draft.pieces import MATERIALS, DrawnHolder
from receptance.draft.questions import OVERHANG, PLACES, QUESTIONS, Question
from receptance.model.beams import Material

Texts: TypeAlias = Mapping[str, "str | Mapping[str, str]"]
"""Answers as text by the name of their question; of a question for each file a mapping by measurement."""


@dataclass(frozen=True)
class Asked:
    """A question that is asked of a campaign, about a measurement if it is named, with its answer."""

    question: Question
    file: str
    """Name of the measurement, empty for a question about all."""
    text: str
    """The question with its names."""
    suggested: str | None
    """The probable answer."""
    answer: str | None
    """The answer as text; None where it is missing."""
    problem: str = ""
    """What is wrong with the answer, a text that begins with "is"."""
    value: Any = None
    context: Mapping[str, Any] = field(default_factory=dict, repr=False)
    """Values of the answers before."""

    def parsed(self, text: str) -> Any:
        """Return the value of another answer, or raise a ValueError whose message begins with "is"."""
        return self.question.parse(text.strip(), self.context)


@dataclass(kw_only=True)
class Answers:
    """Answers with their values; those that are missing or wrong are None."""

    asked: list[Asked]
    measurements: list[MeasuredFile]
    """Copies with the answers about each file."""
    materials: dict[str, Material]
    tool: list[HolderRow] | None = None
    holder: list[HolderRow] | DrawnHolder | None = None
    """Pieces with the shank in their bore, or the drawing with its insertion."""
    sensor: float | None = None
    """Mass in kg."""
    support: Literal["free", "spindle"] | None = None

    @property
    def missing(self) -> list[Asked]:
        """The questions without an answer."""
        return [asked for asked in self.asked if asked.answer is None]

    @property
    def wrong(self) -> list[Asked]:
        """The questions whose answer is wrong."""
        return [asked for asked in self.asked if asked.problem]


class _Reader:
    """Reads texts in the order of their questions, because some questions follow from answers."""

    def __init__(self, texts: Texts, materials: Mapping[str, Material], folder: Path | None) -> None:
        self.texts, self.asked = texts, list[Asked]()
        self.values: dict[str, Any] = {"materials": tuple(materials), "folder": folder}

    def ask(self, question: Question, file: str = "", suggested: str | None = None) -> Any:
        """Return the value of an answer."""
        text = self.texts.get(question.name)
        if isinstance(text, Mapping):
            text = text.get(file)
        words = question.text.format(file=file, materials=" or ".join(self.values["materials"]))
        asked = Asked(question, file if question.each else "", words, suggested, text, context=dict(self.values))
        if text is not None:
            try:
                asked = replace(asked, value=asked.parsed(text))
            except (ValueError, OSError) as error:
                problem = f"cannot be read: {error}" if isinstance(error, OSError) else str(error)
                asked = replace(asked, problem=problem)
        self.asked.append(asked)
        return asked.value

    def once(self, name: str, file: str = "") -> Any:
        """Return the value of an answer that is the same for all files."""
        if name not in self.values:
            self.values[name] = self.ask(QUESTIONS[name], file)
        return self.values[name]

    def of_each(self, question: Question, measurements: Sequence[MeasuredFile]) -> list[Any]:
        """Return the values of the answers about each measurement."""
        return [self.ask(question, item.name, item.suggested(question.name)) for item in measurements]


def review(
    measurements: Sequence[MeasuredFile],
    texts: Texts,
    target: Path,
    *,
    materials: Mapping[str, Material] = MATERIALS,
    folder: Path | None = None,
) -> Answers:
    """Return all questions that measurements and answers leave open, with the values of the answers.

    Parameters
    ----------
    measurements : sequence of MeasuredFile
        As `read_file` and `measured_files` return them.
    texts : mapping
        Answers by the name of their question.
    target : Path
        File of the new campaign, to which the path of a drawing is relative.
    materials : mapping, optional
        Materials by name, by default steel and carbide; those of the list are known as well.
    folder : Path, optional
        Folder of the files that answers name; no file outside of it is read. Without it they are named as in a shell.

    Examples
    --------
    >>> from pathlib import Path
    >>> from receptance.draft import review
    >>> answers = review([], {"tool": "20 mm", "sensor": "2"}, Path("campaign.toml"))
    >>> [asked.question.name for asked in answers.missing]
    ['tool_material', 'holder', 'holder_material', 'insertion', 'support']
    >>> [asked.problem for asked in answers.wrong]
    ['is "2", without a unit, expected a mass as text with a unit, such as "0.6 g", or none']
    """
    reader = _Reader(texts, materials, folder)
    measured = [replace(item, table=dict(item.table)) for item in measurements]
    _add_weights(measured, reader)
    for measurement, overhang in zip(measured, reader.of_each(OVERHANG, measured), strict=True):
        measurement.overhang = overhang or 0.0
    tool, of_tool = reader.once("tool"), reader.once("tool_material")
    tool = tool and [replace(piece, material=of_tool or "") for piece in tool]
    reader.values["tool"], holder = tool, reader.once("holder")
    drawn = holder if isinstance(holder, DrawnHolder) else None
    if drawn is not None:
        file = relative_path(drawn.file, target.parent)
        holder = replace(drawn, file=file, material=drawn.material or reader.once("holder_material") or "")
    elif not holder or not all(piece.material for piece in holder):
        of_holder = reader.once("holder_material")
        holder = holder and [replace(piece, material=piece.material or of_holder or "") for piece in holder]
    reader.values["holder"] = holder
    # The material of a drawing is that before its insertion is added.
    names = [
        name for piece in (*(tool or ()), *(() if drawn else holder or ())) for name in (piece.material, piece.core)
    ]
    names += [holder.material] if drawn else []
    if drawn or not holder or not any(piece.core for piece in holder):
        holder = reader.once("insertion") or holder
    sensor, support = reader.once("sensor"), reader.once("support")
    for question in PLACES:
        if support == "spindle" or question.name in texts:
            for measurement, place in zip(measured, reader.of_each(question, measured), strict=True):
                setattr(measurement, question.name, place or Place())
    return Answers(
        asked=reader.asked,
        measurements=measured,
        materials={**materials, **listed_materials(names, materials)},
        tool=tool,
        holder=holder,
        sensor=sensor,
        support=support,
    )


def _add_weights(measurements: Sequence[MeasuredFile], reader: _Reader) -> None:
    """Add what the standard deviation of FRFs needs: averages, or the deviation itself."""
    for measurement in measurements:
        frf, name = measurement.frf, "averages"
        if frf is None or frf.log_variance is not None or "standard_deviation" in measurement.table:
            continue
        if frf.coherence is None:
            name = "standard_deviation"
        elif frf.averages is not None:
            continue
        measurement.table[name] = reader.once(name, measurement.name)
