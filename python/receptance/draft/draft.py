"""The draft of a campaign: made from measured files and answers, or what is missing and wrong."""

from __future__ import annotations

import tomllib
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from receptance.campaign.problems import CampaignError, path_text
from receptance.campaign.records import missing_records
from receptance.campaign.run import Campaign
from receptance.draft.answers import Answers, Asked, Texts, review
from receptance.draft.files import MeasuredFile, share_assemblies
from receptance.draft.pieces import MATERIALS
from receptance.draft.text import campaign_text
from receptance.model.beams import Material

_AT_TIP = "hit and response at the tip"
_ASSUMED = (
    "tolerances of dimensions and materials",
    "loss factors",
    "bounds of the joint",
    _AT_TIP,
)
_NAMES: tuple[tuple[tuple[str, ...], str], ...] = (
    (("parts", "tool"), "tool"),
    (("parts", "holder"), "holder"),
    (("materials",), "material"),
    (("sensors",), "sensor"),
    (("modal_parts",), "spindle_modes"),
    (("assemblies", "*", "insertion"), "insertion"),
    (("assemblies", "*", "set"), "overhang"),
    (("measurements", "*", "response"), "response"),
    (("measurements", "*", "excitation"), "hit"),
    (("measurements", "*", "averages"), "averages"),
    (("measurements", "*", "standard_deviation"), "standard_deviation"),
    (("measurements", "*", "force"), "force"),
    (("measurements", "*", "motion"), "motion"),
)
"""Beginnings of the keys of a new campaign, with any name for *, and the names of the answers that are there."""


@dataclass(frozen=True)
class Mistake:
    """A mistake of the campaign that the answers make."""

    name: str
    """Name of the answer, or a key of the campaign; empty for the whole."""
    is_answer: bool
    of: str
    """Name of the measurement or the assembly, empty for none."""
    text: str

    def __str__(self) -> str:
        return self.titled(self.name.replace("_", " ") if self.is_answer else self.name)

    def titled(self, name: str) -> str:
        """Return the mistake with another name of the answer."""
        return f"{name}{f' of {self.of}' if self.of else ''}: {self.text}" if name else self.text


class DraftError(ValueError):
    """Answers that are missing or wrong, or that make no campaign; the message lists all of them."""

    def __init__(self, *, asked: Sequence[Asked] = (), mistakes: Sequence[Mistake] = ()) -> None:
        self.asked, self.mistakes = tuple(asked), tuple(mistakes)
        lines = [f"{item.text}: {item.problem or 'is missing'}" for item in self.asked]
        super().__init__("\n".join([*lines, *map(str, self.mistakes)]))

    @property
    def missing(self) -> tuple[Asked, ...]:
        """The questions without an answer."""
        return tuple(item for item in self.asked if item.answer is None)

    @property
    def wrong(self) -> tuple[Asked, ...]:
        """The questions whose answer is wrong."""
        return tuple(item for item in self.asked if item.problem)


@dataclass(frozen=True)
class Draft:
    """A new campaign that is not written yet."""

    text: str
    """Content of the campaign file."""
    campaign: Campaign
    measurements: tuple[MeasuredFile, ...]
    assumed: tuple[str, ...]
    """What was assumed, and is commented in the text."""
    missing: tuple[str, ...] = field(default=())
    """Records that the model needs."""

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes of the campaign."""
        return self.campaign.notes


def make_draft(
    measurements: Sequence[MeasuredFile],
    texts: Texts,
    target: Path,
    *,
    materials: Mapping[str, Material] = MATERIALS,
    folder: Path | None = None,
    title: str = "",
    spindle_modes: int | Literal["auto"] = "auto",
    held_out: Collection[str] = (),
) -> Draft:
    """Return the campaign of measured files and answers; nothing is written.

    Parameters
    ----------
    measurements, texts, target, materials, folder
        As in `review`.
    title : str, optional
        By default the name of the folder of the target.
    spindle_modes : int or "auto", optional
        Modes of the spindle, if the answer to "support" is spindle.
    held_out : collection of str, optional
        Names of measurements that are compared with their prediction instead.

    Raises
    ------
    DraftError
        Answers are missing or wrong; all are listed.
    ValueError
        Answers do not fit each other, such as an overhang shorter than the flutes.
    """
    answers = review(measurements, texts, target, materials=materials, folder=folder)
    if answers.missing or answers.wrong:
        raise DraftError(asked=[item for item in answers.asked if item.problem or item.answer is None])
    for measurement in answers.measurements:
        measurement.held_out = measurement.name in held_out
    share_assemblies(answers.measurements)
    text = _text(answers, title or target.resolve().parent.name or "Campaign", spindle_modes)
    try:
        campaign = Campaign.from_contents(target, tomllib.loads(text), text)
    except CampaignError as error:
        raise DraftError(mistakes=[_mistake(issue.path, issue.text) for issue in error.problems]) from None
    assumed = tuple(words for words in _ASSUMED if words != _AT_TIP or not {"response", "hit"} & _names(answers))
    return Draft(text, campaign, tuple(answers.measurements), assumed, tuple(missing_records(campaign)))


def _names(answers: Answers) -> set[str]:
    return {item.question.name for item in answers.asked}


def _text(answers: Answers, title: str, spindle_modes: int | Literal["auto"]) -> str:
    assert answers.tool is not None
    assert answers.holder is not None
    assert answers.sensor is not None
    return campaign_text(
        title=title,
        tool=answers.tool,
        holder=answers.holder,
        measurements=answers.measurements,
        sensor=answers.sensor,
        spindle_modes=spindle_modes if answers.support == "spindle" else None,
        materials=answers.materials,
    )


def _mistake(path: Sequence[str | int], text: str) -> Mistake:
    """Return what a mistake of the campaign is about, because its file is not written."""
    for beginning, name in _NAMES:
        if len(path) >= len(beginning) and all(a in ("*", b) for a, b in zip(beginning, path, strict=False)):
            of = str(path[1]) if path[0] in ("assemblies", "measurements") and len(path) > 1 else ""
            return Mistake(name, True, of, text)
    return Mistake(path_text(tuple(path)) if path else "", False, "", text)
