"""Measured files of a new campaign: what each contains, and where its sensor and its hits are."""

from __future__ import annotations

import os
import re
import shlex
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, cast

import numpy as np

from receptance import units
from receptance._reading import ReadingOptions, campaign_keys
from receptance._text import instead_of, one_of, shown
from receptance.draft.pieces import mm
from receptance.draft.questions import READING_QUESTIONS
from receptance.frf import FRF
from receptance.io import FileFormatError, TimeSeries
from receptance.io.contents import FileContents
from receptance.io.files import FORMATS, file_format

_LEAST_COHERENCE = 0.9
"""Median coherence of neighbouring lines below which the ends of the band are left out."""
_NEIGHBOURS = 9
"""Number of neighbouring lines of that median."""
_CHANNELS = {"force": ("force",), "motion": ("displacement", "velocity", "acceleration")}
_LENGTH = re.compile(r"(?<![\d.])(\d+(?:\.\d+)?)\s*_?mm(?![a-z])", re.IGNORECASE)
"""An overhang in the name of a file, which a question suggests."""
_PARTS = ("tool", "holder")
_WORDS = {"tip": ("tool", "0 mm"), "nose": ("holder", "0 mm")}
"""Names of places."""
_PLACE = re.compile(r"\s*(?P<part>\w+)\s*@\s*(?P<position>.*?)\s*", re.DOTALL)
_DIRECTION = re.compile(
    r"(?<!\w)(?:(?P<before>[+-])(?P<first>[XYZ]|(?<=:[+-])[123])|(?P<last>[XYZ])(?P<after>[+-]))(?!\w)", re.IGNORECASE
)
"""A direction as analysers write it, as in `1:+Z`, `Point 1 X-`, `holder@4 mm -Y`, and `1:-3` of universal files."""

# Places ---------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Place:
    """Where a sensor is, or where hits are: distance in m from the tip-side end of a part, and direction.

    The sign is that in which the channel counts, empty if it is not stated; so is the axis, X, Y or Z.
    """

    part: str = "tool"
    position: float | str = 0.0
    sign: str = ""
    axis: str = ""

    @property
    def distance(self) -> str:
        """The position with its unit."""
        return self.position if isinstance(self.position, str) else mm(self.position)

    @property
    def text(self) -> str:
        """The place as `parse_place` reads it."""
        return f"{self.part}@{self.distance}" + (f" {self.sign}{self.axis}" if self.axis else "")

    def table(self) -> dict[str, str]:
        """Return the keys of a coordinate of a campaign; none for the tip."""
        turned = {"direction": "-y"} if self.sign == "-" else {}
        is_tip = (self.part, self.position) == ("tool", 0.0)
        return turned if is_tip else {"part": self.part, "position": self.distance} | turned


def parse_place(text: str) -> Place:
    """Return a place from `PART@DISTANCE`, `tip` or `nose`, with a direction such as `-Z` or without.

    Examples
    --------
    >>> from receptance.draft import parse_place
    >>> parse_place("holder@4 mm -Z")
    Place(part='holder', position=0.004, sign='-', axis='Z')
    >>> parse_place("tip").text
    'tool@0 mm'
    """
    expected = 'expected a place such as "tool@0 mm", "holder@4 mm" or "holder@end", with a direction such as "-Z" if '
    expected += "it is not that of the other channel"
    directions = list(_DIRECTION.finditer(text))
    plain = (text[: directions[0].start()] if directions else text).strip()
    part, position = _WORDS.get(plain.lower(), ("", ""))
    if match := _PLACE.fullmatch(plain):
        part, position = match["part"], match["position"]
    if not part or len(directions) > 1 or (directions and text[directions[0].end() :].strip()):
        raise ValueError(f"is {shown(text)}, {expected}")
    if part not in _PARTS:
        raise ValueError(f"is {shown(text)}, which names {shown(part)}{instead_of(part, _PARTS)}")
    at: float | str = "end"
    if position != "end":
        try:
            at = units.parse(position, units.LENGTH_OR_ZERO)
        except ValueError as error:
            raise ValueError(
                f"is {shown(text)}, whose distance {str(error).partition(', expected')[0]}, {expected}"
            ) from None
    sign, axis = _direction(directions[0]) if directions else ("", "")
    return Place(part, at, sign, axis)


def _direction(match: re.Match[str]) -> tuple[str, str]:
    axis = (match["first"] or match["last"]).upper()
    return match["before"] or match["after"], {"1": "X", "2": "Y", "3": "Z"}.get(axis, axis)


# Measured files -------------------------------------------------------------------------------------------------------


@dataclass(kw_only=True)
class MeasuredFile:
    """An FRF or a time record in a file.

    `name` is that of the measurement and of its assembly, `table` are the keys of the campaign that read the file, and
    `overhang` is in m, from the holder's face to the tip.
    """

    file: Path
    name: str
    measured: FRF | TimeSeries
    table: dict[str, Any]
    overhang: float = 0.0
    held_out: bool = False
    response: Place = Place()
    hit: Place = Place()
    assembly: str = ""
    """Name of its assembly, by default that of the measurement."""

    def suggested(self, question: str) -> str | None:
        """Return the probable answer to a question about the file."""
        if question != "overhang":
            return Place().text
        lengths = _LENGTH.findall(self.name)
        return f"{lengths[0]} mm" if len(lengths) == 1 else None

    def sides(self) -> dict[str, Place]:
        """Return the places of response and excitation; directions that are not stated are those of the file."""
        named = "" if self.frf is None or self.frf.labels is None else " ".join(sum(self.frf.labels, ()))
        in_file = [_direction(match) for match in _DIRECTION.finditer(named)]
        stated = dict(zip(("response", "excitation"), in_file, strict=False)) if len(in_file) == 2 else {}
        sides = {}
        for side, place in (("response", self.response), ("excitation", self.hit)):
            sign, axis = stated.get(side, ("", ""))
            sides[side] = place if place.axis else replace(place, sign=sign, axis=axis)
        axes = {side: place.axis for side, place in sides.items() if place.axis}
        if len(set(axes.values())) > 1:
            raise ValueError(
                f"{self.name}: the response is along {axes['response']} and the hits along {axes['excitation']}, "
                "expected one axis, y of the model; leave the file out, or state the directions, as in --hit "
                f"'{self.hit.part}@4 mm +{axes['response']}'"
            )
        return sides

    @property
    def frf(self) -> FRF | None:
        """The FRF, None for a time record."""
        return self.measured if isinstance(self.measured, FRF) else None

    @property
    def about(self) -> str:
        """Contents of the file in a sentence, for a comment."""
        name = FORMATS[self.table.get("format") or file_format(self.file)].title
        if (frf := self.frf) is None:
            return f"{self.file.name} ({name}): {self.measured!r}"
        lines = frf.frequency_hz
        text = f"{self.file.name} ({name}): {frf.form} in {frf.unit}, {lines.size} lines, "
        text += f"{lines[0]:g} to {lines[-1]:g} Hz"
        text += "" if frf.averages is None else f", {frf.averages} averages"
        return text + ("" if frf.coherence is None else f", median coherence {np.median(frf.coherence):.4f}")


class ChannelError(ValueError):
    """Several channels, or none, may be the force or the motion; `option` is "force" or "motion"."""

    def __init__(self, text: str, option: str) -> None:
        super().__init__(text)
        self.option = option


def read_file(
    file: Path, reading: ReadingOptions, answers: Mapping[str, str] | None = None
) -> tuple[FileContents, ReadingOptions]:
    """Return the contents of a file and the options that read it.

    `answers` are texts for `READING_QUESTIONS`, which are used where the file cannot be read without them.

    Raises
    ------
    FileFormatError
        A file that cannot be read; its `option` names the question that has no answer.
    OSError
        A file that cannot be opened.
    """
    while True:
        try:
            return FileContents.read(file, **reading), reading
        except FileFormatError as error:
            text = (answers or {}).get(error.option)
            if text is None or error.option in reading or error.file != file.name:
                raise
            question = READING_QUESTIONS[error.option]
            try:
                reading = cast(ReadingOptions, {**reading, error.option: question.parse(text, {})})
            except ValueError as wrong:
                raise FileFormatError(f"{question.option} {wrong}", file.name, option=error.option) from None


def with_different_names(measurements: Iterable[MeasuredFile]) -> list[MeasuredFile]:
    """Return measurements, of which those with the name of another one get a number."""
    named: list[MeasuredFile] = []
    for measurement in measurements:
        base, number = measurement.name, 2
        while measurement.name in [other.name for other in named]:
            measurement.name, number = f"{base} {number}", number + 1
        named.append(measurement)
    return named


def share_assemblies(measurements: Sequence[MeasuredFile]) -> None:
    """Give files of one overhang one assembly if hits or sensors differ: they rove in one clamping."""
    for measurement in measurements:
        measurement.assembly = measurement.name
        places = (measurement.response, measurement.hit)
        others = [other for other in measurements if other.overhang == measurement.overhang]
        if any((other.response, other.hit) != places for other in others):
            measurement.assembly = f"overhang {mm(measurement.overhang)}"


def relative_path(file: str | Path, folder: Path) -> str:
    """Return the path of a file relative to a folder."""
    place = Path(file).resolve()
    try:
        return Path(os.path.relpath(place, folder.resolve())).as_posix()
    except ValueError:  # another drive
        return place.as_posix()


def measured_files(
    file: Path, contents: Sequence[Any], reading: ReadingOptions, channels: Mapping[str, str | None], folder: Path
) -> list[MeasuredFile]:
    """Return the FRFs of a file, or the hammer hits, as measurements of a campaign in a folder.

    `reading` are the options that read its contents, and `channels` those of hammer hits that are not the only ones of
    their kind.
    """
    frfs = [item for item in contents if isinstance(item, FRF)]
    records = [item for item in contents if isinstance(item, TimeSeries)]
    names = campaign_keys(records=not frfs)
    keys: dict[str, Any] = {names[name]: value for name, value in reading.items() if name in names}
    if "sample_rate_hz" in reading:
        keys["sample_rate"] = f"{reading['sample_rate_hz']:.15g} Hz"
    keys |= {
        key: relative_path(path, folder) for key, path in (("file", file), ("coherence", keys.get("coherence"))) if path
    }
    if frfs:
        return [
            MeasuredFile(
                file=file,
                name=file.stem if len(frfs) == 1 else f"{file.stem} {index + 1}",
                measured=item,
                table=_frf_keys(file, item, keys | ({"entry": {"number": index}} if len(frfs) > 1 else {})),
            )
            for index, item in enumerate(frfs)
        ]
    if not records:
        words = f"expected the file of its FRF with --coherence {shlex.quote(str(file))}"
        raise ValueError(f"{file} holds {contents[0]!r} and no FRF, {words}")
    if len({(record.channels, record.units, record.sample_rate_hz) for record in records}) > 1:
        words = f"split it with receptance convert {shlex.quote(str(file))} OUT --number N"
        raise ValueError(f"{file} holds {len(records)} time records with different channels; {words}")
    # Several records of the same channels are hits of one measurement.
    table = _hammer_keys(file, records[0], channels) | keys
    return [MeasuredFile(file=file, name=file.stem, measured=records[0], table=table)]


def _frf_keys(file: Path, measured: FRF, keys: Mapping[str, Any]) -> dict[str, Any]:
    """Return the keys of an FRF in a file, with the band without ends of low coherence."""
    if measured.values[0].size > 1:
        raise ValueError(
            f"{file} holds an FRF with {measured.shape[1]} responses and {measured.shape[2]} excitations, expected "
            "files with one of each; write the entry that belongs to the tip with receptance.io, or write its campaign "
            "by hand with `entry`"
        )
    table = {"kind": "frf", **keys}
    lines = measured.frequency_hz
    if measured.coherence is not None and lines.size > _NEIGHBOURS:
        padded = np.pad(measured.coherence[:, 0, 0], _NEIGHBOURS // 2, mode="edge")
        median = np.median(np.lib.stride_tricks.sliding_window_view(padded, _NEIGHBOURS), axis=1)
        good = lines[median >= _LEAST_COHERENCE]
        if good.size and (good[0] > lines[0] or good[-1] < lines[-1]):
            table["bands"] = [[f"{good[0]:.6g} Hz", f"{good[-1]:.6g} Hz"]]
    return table


def _hammer_keys(file: Path, record: TimeSeries, channels: Mapping[str, str | None]) -> dict[str, Any]:
    """Return the keys of a file with hammer hits; the channels follow from their units."""
    table: dict[str, Any] = {"kind": "hammer records"}
    for key, kinds in _CHANNELS.items():
        channel = channels[key]
        fitting = [name for name, kind in zip(record.channels, record.quantities, strict=True) if kind in kinds]
        if channel is not None and channel not in record.channels:
            words = f"--{key} is {shown(channel)}{instead_of(channel, record.channels)}, a channel of {file}"
            raise ChannelError(words, key)
        if channel is None and len(fitting) != 1:
            raise ChannelError(
                f"{file} has {len(fitting) or 'no'} channels with the unit of a {key}, expected --{key} CHANNEL, "
                f"{one_of(fitting or record.channels)}",
                key,
            )
        table[key] = channel or fitting[0]
    return table
