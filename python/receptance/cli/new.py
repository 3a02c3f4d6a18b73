"""The command `new`: a campaign from measurement files and a few answers."""

from __future__ import annotations

import re
import shlex
import sys
import tomllib
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, cast

import typer

from receptance import campaign, cli, io, report, units
from receptance._files import check_target, created_folder, write_whole
from receptance._reading import ReadingOptions
from receptance._text import instead_of, printable, shown
from receptance.campaign.listed_materials import listed_materials
from receptance.cli.files import named_values, reading_of, takes_reading
from receptance.cli.running import (
    InputError,
    Json,
    Overwrite,
    Targets,
    count_of_modes,
    input_errors,
    takes_options,
)
from receptance.errors import ReceptanceWarning
from receptance.model.materials import is_listed
from receptance.report.terminal import print_list

_AT_TIP = "hit and response at the tip"
_ASSUMED = (
    "tolerances of dimensions and materials",
    "loss factors",
    "bounds of the joint",
    _AT_TIP,
)

# Questions ------------------------------------------------------------------------------------------------------------

_Parse = Callable[[str, Mapping[str, Any]], Any]
"""Returns the answer of a text after other answers, or raises a ValueError whose message begins with "is"."""


@dataclass(frozen=True)
class Question:
    """What the files do not state: the name of its option, the question, an example, and the reader of an answer."""

    name: str
    text: str
    example: str
    parse: _Parse
    each: bool = False
    """Whether each file has an answer of its own."""

    @property
    def option(self) -> str:
        """The option."""
        return f"--{self.name.replace('_', '-')}"


def _quantity(quantity: units.Quantity, *none: str) -> _Parse:
    expected = quantity.expected + (", or none" if none else "")
    return lambda text, _: 0.0 if text.lower() in none else units.parse(text, quantity, expected)


def _choice(*names: str) -> _Parse:
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


def _place(text: str, answers: Mapping[str, Any]) -> cli.draft.Place:
    return cli.draft.parse_place(text)


def _with_shank(text: str, answers: Mapping[str, Any]) -> Any:
    insertion = _quantity(units.LENGTH, "none")(text, answers)
    tool, holder = answers["tool"], answers["holder"]
    if isinstance(holder, cli.pieces.DrawnHolder):
        return replace(holder, insertion=insertion)
    return cli.pieces.inserted(holder, insertion, tool[-1]) if tool and holder else None


_OF_READING = (
    Question("columns", "Header with units", "frequency [Hz],real [g/N],imag [g/N]", lambda text, _: text),
    Question("unit", "Unit of the numbers", "m/s^2/N, or hammer=N, tip=g", lambda text, _: re.split(r"\s*,\s*", text)),
)
"""Options of reading that are asked for if a file cannot be read without them."""
_OVERHANG = Question(
    "overhang", "Overhang of {file}, from the holder's face to the tip", "60 mm", _quantity(units.LENGTH), each=True
)
_PLACES = (
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
        lambda text, _: cli.pieces.parse_pieces(text, shank=True),
    ),
    Question("tool_material", "Material of the tool, {materials}", "carbide", _choice()),
    Question("holder", _HOLDER, "48 mm x 50 mm, 90 mm x 44/16 mm", lambda text, _: cli.pieces.parse_holder(text)),
    Question("holder_material", "Material of the holder, {materials}", "steel", _choice()),
    Question("insertion", "Length of the shank in the holder, or none", "48 mm", _with_shank),
    Question(
        "sensor", "Mass of the accelerometer, or none for a laser", "0.6 g", _quantity(units.MASS, "none", "laser", "0")
    ),
    Question(
        "support", "free for a holder that hangs free, spindle for one in a machine", "free", _choice("free", "spindle")
    ),
)
_QUESTIONS = {question.name: question for question in (_OVERHANG, *_PLACES, *_OF_WEIGHTS, *_OF_MODEL)}


class _Answers(dict[str, Any]):
    """Answers by the names of questions, from options or to prompts; in a pipe they are None, and listed together."""

    def __init__(self, options: Mapping[str, Any], materials: Mapping[str, Any]) -> None:
        super().__init__(materials=tuple(materials))
        self.options, self.interactive = options, sys.stdin.isatty()
        self._missing: list[str] = []

    def ask(self, question: Question, option: str | None, file: str = "", suggested: str | None = None) -> Any:
        """Return the answer, about a file if it is named."""
        if option is not None:
            try:
                return question.parse(option, self)
            except ValueError as error:
                of_file = f" of {file}" if question.each else ""
                raise InputError(f"{question.option}{of_file} {error}") from None
        text = question.text.format(file=file, materials=" or ".join(self["materials"]))
        if self.interactive:
            prompt = printable(f"{text} (such as {question.example})")
            return typer.prompt(prompt, suggested, value_proc=lambda words: self._parsed(question, words))
        example = f"{file}={suggested or question.example}" if question.each else question.example
        self._missing.append(f"  {question.option} {shlex.quote(example)}  {text}")
        return None

    def _parsed(self, question: Question, text: str) -> Any:
        try:
            return question.parse(text.strip(), self)
        except ValueError as error:
            raise typer.BadParameter(printable(f"this {error}")) from None

    def answer(self, name: str, file: str = "") -> Any:
        """Return the answer to a question that is asked once."""
        if name not in self:
            self[name] = self.ask(_QUESTIONS[name], self.options.get(name), file)
        return self[name]

    def check(self) -> None:
        """Raise if an answer is missing."""
        if self._missing:
            head = "standard input is not a terminal, so that nothing can be asked; add with your values:"
            raise InputError("\n".join([head, *self._missing]))


def _takes_answers(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command the options of the questions in place of its parameter `options`."""
    options: dict[str, tuple[Any, Any]] = {}
    for name, question in _QUESTIONS.items():
        file = f"each file, in their order or as FILE={question.example}" if question.each else "a file"
        text = question.text.format(
            file=file, materials="steel, carbide, the name of a --material or one that `receptance materials` lists"
        )
        option = typer.Option(question.option, metavar=f"'{question.example}'", help=f"{text}.")
        kind: Any = list[str] | None if question.each else str | None
        options[name] = (Annotated[kind, option], None)
    return takes_options("options", options, lambda values: values)(command)


# The command ----------------------------------------------------------------------------------------------------------


@takes_reading(several=True)
@_takes_answers
def new(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of the campaign; it is created.")],
    files: Annotated[
        list[Path], typer.Argument(metavar="FILES", help="Files with FRFs or hammer hits, one for each overhang.")
    ],
    options: Mapping[str, Any],
    reading: ReadingOptions,
    spindle_modes: Annotated[
        str | None,
        typer.Option(metavar="N|auto", help="Modes of the spindle; by default auto, as many as the records show."),
    ] = None,
    hold_out: Annotated[
        list[str] | None,
        typer.Option(metavar="FILE", help="File that is compared with its prediction instead; may be repeated."),
    ] = None,
    material: Annotated[
        list[str] | None,
        typer.Option(
            metavar="TEXT",
            help="Another material, 'NAME = modulus, density, Poisson's ratio', such as 'brass = 100 GPa, "
            "8400 kg/m^3, 0.34'; may be repeated.",
        ),
    ] = None,
    force: Annotated[
        str | None, typer.Option(metavar="CHANNEL", help="Force channel of time records, if there are several.")
    ] = None,
    motion: Annotated[
        str | None, typer.Option(metavar="CHANNEL", help="Motion channel of time records, if there are several.")
    ] = None,
    title: Annotated[str | None, typer.Option(metavar="TEXT", help="Title; by default the name of DIR.")] = None,
    json_file: Json = None,
    overwrite: Overwrite = False,
) -> None:
    """Write a commented campaign for measurement files of a tool in a holder.

    Without an option its question is asked on a terminal; otherwise the missing options are listed.
    """
    target = _target(folder, files, overwrite)
    targets = Targets(json_file, None, None, overwrite=overwrite)
    for path, what in ((target, "the new campaign"), *((file, "a measurement file") for file in files)):
        targets.protect(path, what)
    targets.require_new()
    console = targets.console()
    with warnings.catch_warnings(), input_errors():
        warnings.simplefilter("ignore", ReceptanceWarning)
        try:
            added = [cli.pieces.parse_material(text) for text in material or ()]
        except ValueError as error:
            raise InputError(f"--material {error}") from None
        materials = cli.pieces.MATERIALS | {made.name: made for made in added}
        answers = _Answers(options, materials)
        measurements = _read_files(files, reading, answers, {"force": force, "motion": motion}, target.parent)
        print_list(console, "Files", [measurement.about for measurement in measurements])
        _add_weights(measurements, answers)
        for measurement, overhang in zip(measurements, _of_each(_OVERHANG, measurements, answers), strict=True):
            measurement.overhang = overhang
        tool, of_tool = answers.answer("tool"), answers.answer("tool_material")
        tool = tool and [replace(piece, material=of_tool or "") for piece in tool]
        answers["tool"], holder = tool, answers.answer("holder")
        is_drawn = isinstance(holder, cli.pieces.DrawnHolder)
        if is_drawn:
            file = cli.draft.relative_path(holder.file, target.parent)
            answers["holder"] = replace(
                holder, file=file, material=holder.material or answers.answer("holder_material") or ""
            )
        elif not holder or not all(piece.material for piece in holder):
            of_holder = answers.answer("holder_material")
            holder = holder and [replace(piece, material=piece.material or of_holder or "") for piece in holder]
            answers["holder"] = holder
        if is_drawn or not holder or not any(piece.core for piece in holder):
            holder = answers.answer("insertion")
        for name in ("holder_material", "insertion"):
            if options[name] is not None and name not in answers:
                raise InputError(f"{_QUESTIONS[name].option} is given, but the holder's file states it; leave it out")
        rows = (*(tool or ()), *(() if is_drawn else holder or ()))
        of_pieces = [name for piece in rows for name in (piece.material, piece.core)]
        of_pieces += [answers["holder"].material] if is_drawn else []
        materials |= listed_materials(of_pieces, materials)
        sensor, support = answers.answer("sensor"), answers.answer("support")
        for question in _PLACES:
            if support == "spindle" or options[question.name] is not None:
                places = _of_each(question, measurements, answers)
                for measurement, place in zip(measurements, places, strict=True):
                    setattr(measurement, question.name, place or cli.draft.Place())
        answers.check()
        cli.draft.share_assemblies(measurements)
        if spindle_modes is not None and support == "free":
            raise InputError("--spindle-modes is given, but --support is free; expected --support spindle")
        for text in hold_out or ():
            _named(text, measurements, "--hold-out").held_out = True
        if all(measurement.held_out for measurement in measurements):
            raise InputError("--hold-out names all measurements, expected at least one that is left for the fit")
        text = cli.draft.campaign_text(
            title=title or target.resolve().parent.name or "Campaign",
            tool=tool,
            holder=holder,
            measurements=measurements,
            sensor=sensor,
            spindle_modes=count_of_modes("--spindle-modes", spindle_modes or "auto") if support == "spindle" else None,
            materials=materials,
        )
        with created_folder(target.parent):
            check_target(target)
            # Read before it is written, so that no campaign with mistakes is left behind.
            made = _made(target, text)
            notes, missing = made.notes, campaign.missing_records(made)
            write_whole({target: text.encode()})
    step = f"receptance check {shlex.quote(str(folder))}"
    data = {
        measurement.name: {
            "file": measurement.table["file"],
            "overhang_m": measurement.overhang,
            "response": measurement.response.text,
            "hit": measurement.hit.text,
            "role": "hold out" if measurement.held_out else "identify",
            "data": measurement.about,
        }
        for measurement in measurements
    }
    assumed = [text for text in _ASSUMED if text != _AT_TIP or {"response", "hit"}.isdisjoint(answers)]
    result = {"file": str(target), "measurements": data, "assumed": assumed, "missing": list(missing)}
    targets.write(lambda: {**result, "notes": list(notes), "next": step})
    print_list(console, "Assumed, and commented in the file", assumed)
    print_list(console, "Missing", missing)
    print_list(console, "Notes", list(report.result.grouped_notes(notes)))
    console.print(f"Written: {target}", soft_wrap=True)
    targets.print_names(console)
    console.print(f"Next: {step}", soft_wrap=True)


_OPTIONS_OF: tuple[tuple[tuple[str, ...], str], ...] = (
    (("parts", "tool"), "--tool"),
    (("parts", "holder"), "--holder"),
    (("materials",), "--material"),
    (("sensors",), "--sensor"),
    (("modal_parts",), "--spindle-modes"),
    (("assemblies", "*", "insertion"), "--insertion"),
    (("assemblies", "*", "set"), "--overhang"),
    (("measurements", "*", "response"), "--response"),
    (("measurements", "*", "excitation"), "--hit"),
    (("measurements", "*", "averages"), "--averages"),
    (("measurements", "*", "standard_deviation"), "--standard-deviation"),
    (("measurements", "*", "force"), "--force"),
    (("measurements", "*", "motion"), "--motion"),
)
"""Beginnings of the keys of a new campaign, with any name for *, and the options whose answers are there."""


def _made(target: Path, text: str) -> campaign.Campaign:
    """Return the new campaign; its mistakes are told by the options, because its file is not written."""
    try:
        return campaign.Campaign.from_contents(target, tomllib.loads(text), text)
    except campaign.CampaignError as error:
        mistakes = [f"  {_about(problem.path)}{problem.text}" for problem in error.problems]
    head = f"the answers make no campaign, and {target} was not written:"
    raise InputError("\n".join([head, *dict.fromkeys(mistakes)]))


def _about(path: Sequence[str | int]) -> str:
    """Return what a mistake is about: the option, and the name of the measurement or the assembly."""
    for beginning, option in _OPTIONS_OF:
        if len(path) >= len(beginning) and all(a in ("*", b) for a, b in zip(beginning, path, strict=False)):
            of = f" of {path[1]}" if path[0] in ("assemblies", "measurements") and len(path) > 1 else ""
            return f"{option}{of}: "
    return f"{campaign.problems.path_text(tuple(path))}: " if path else ""


def _target(folder: Path, files: Sequence[Path], overwrite: bool) -> Path:
    """Return the path of the new file, before anything is asked."""
    if folder.is_file():
        raise InputError(
            f"{folder} is a file, expected first the folder of the new campaign: receptance new FOLDER "
            f"{' '.join(shlex.quote(str(path)) for path in (folder, *files))}"
        )
    if folder.exists() and not folder.is_dir():
        raise InputError(f"cannot write to {folder}: it is a pipe or a device, expected a folder")
    target = folder / "campaign.toml"
    if (target.exists() or target.is_symlink()) and not overwrite:
        raise InputError(f"{target} exists already; choose another folder, or replace it with --overwrite")
    places = [file.resolve() for file in files]
    for index, file in enumerate(files):
        if places[index] in places[:index]:
            raise InputError(f"{file} is given twice, expected each file once")
    return target


# Files ----------------------------------------------------------------------------------------------------------------


def _read_files(
    files: Sequence[Path],
    reading: ReadingOptions,
    answers: _Answers,
    channels: Mapping[str, str | None],
    folder: Path,
) -> list[cli.draft.MeasuredFile]:
    """Return the measurements in all files, with different names, for a campaign in a folder."""
    coherences: Any = reading.pop("coherence", [])
    if coherences and len(coherences) != len(files):
        count = f"{len(coherences)} --coherence {'is' if len(coherences) == 1 else 'are'} given for {len(files)} files"
        raise InputError(f"{count}, expected one for each in their order")
    measurements: list[cli.draft.MeasuredFile] = []
    for index, file in enumerate(files):
        options = cast(ReadingOptions, {**reading, "coherence": coherences[index]} if coherences else reading)
        contents, options = _read(file, options, answers)
        for measurement in cli.draft.measured_files(file, contents, options, channels, folder):
            base, number = measurement.name, 2
            while measurement.name in [other.name for other in measurements]:
                measurement.name, number = f"{base} {number}", number + 1
            measurements.append(measurement)
    return measurements


def _read(file: Path, reading: ReadingOptions, answers: _Answers) -> tuple[list[Any], ReadingOptions]:
    """Return the contents of a file and the options that read it; on a terminal a missing one is asked for."""
    while True:
        try:
            return io.read_all(file, **reading), reading
        except io.FileFormatError as error:
            question = next((question for question in _OF_READING if question.name == error.option), None)
            if not answers.interactive or question is None or question.name in reading or error.file != file.name:
                raise
            # Files of one analyser are alike, so that an answer holds for those that need it.
            if question.name not in answers:
                typer.echo(printable(str(error)))
                answers[question.name] = answers.ask(question, None)
            reading = cast(ReadingOptions, {**reading, **reading_of({question.name: answers[question.name]})})


def _add_weights(measurements: Sequence[cli.draft.MeasuredFile], answers: _Answers) -> None:
    """Add what the standard deviation of FRFs needs: averages, or the deviation itself."""
    for measurement in measurements:
        frf, name = measurement.frf, "averages"
        if frf is None or frf.log_variance is not None:
            continue
        if answers.options["standard_deviation"] is not None or frf.coherence is None:
            name = "standard_deviation"
        elif frf.averages is not None:
            if answers.options[name] is not None and answers.answer(name) != frf.averages:
                number = f"--averages is {answers[name]}, but {measurement.file} states {frf.averages}"
                raise InputError(f"{number}; leave it out")
            continue
        measurement.table[name] = answers.answer(name, measurement.name)


def _of_each(question: Question, measurements: Sequence[cli.draft.MeasuredFile], answers: _Answers) -> list[Any]:
    """Return the answer to a question for each measurement; a single place is that of all of them."""
    option, texts = question.option, answers.options[question.name] or []
    names = [measurement.name for measurement in measurements]
    if any("=" in text for text in texts):
        values = named_values(texts, option, f"FILE={question.example} for each file")
        stated = {_named(file, measurements, option).name: text for file, text in values.items()}
        if len(stated) < len(values):
            raise InputError(f"{option} is given twice for a file, expected one for each of {', '.join(names)}")
    elif len(texts) == 1 and (question is not _OVERHANG or answers.options["hit"] is not None):
        stated = dict.fromkeys(names, texts[0])  # roving hits are in one clamping
    elif texts and len(texts) != len(names):
        count = f"{len(texts)} {option} {'is' if len(texts) == 1 else 'are'} given for {len(names)} measurements"
        example = shlex.quote(f"{names[0]}={question.example}")
        raise InputError(f"{count}, expected one for each, such as {option} {example}")
    else:
        stated = dict(zip(names, texts, strict=False))
    found = []
    for measurement in measurements:
        suggested = measurement.suggested(question.name)
        found.append(answers.ask(question, stated.get(measurement.name), measurement.name, suggested))
    if question is not _OVERHANG:
        answers[question.name] = found
    return found


def _named(text: str, measurements: Sequence[cli.draft.MeasuredFile], option: str) -> cli.draft.MeasuredFile:
    """Return the measurement that an option names by the file or its name."""
    for measurement in measurements:
        if text.strip() in (measurement.name, str(measurement.file), measurement.file.name):
            return measurement
    raise InputError(f"{option} names {shown(text)}{instead_of(text, [item.name for item in measurements])}")
