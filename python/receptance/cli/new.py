"""The command `new`: a campaign from measurement files and a few answers."""

from __future__ import annotations

import shlex
import sys
import warnings
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, cast

import typer

from receptance import draft, io, report
from receptance._files import check_target, created_folder, write_whole
from receptance._reading import ReadingOptions, named_values
from receptance._text import instead_of, printable, shown
from receptance.cli.files import takes_reading
from receptance.cli.running import (
    InputError,
    Json,
    Overwrite,
    Targets,
    count_of_modes,
    input_errors,
    takes_options,
)
from receptance.draft.questions import OVERHANG, QUESTIONS, READING_QUESTIONS, Question
from receptance.errors import ReceptanceWarning
from receptance.report.terminal import print_list

# Answers --------------------------------------------------------------------------------------------------------------


def _takes_answers(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command the options of the questions in place of its parameter `options`."""
    options: dict[str, tuple[Any, Any]] = {}
    for name, question in QUESTIONS.items():
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
            added = [draft.parse_material(text) for text in material or ()]
        except ValueError as error:
            raise InputError(f"--material {error}") from None
        materials = draft.MATERIALS | {made.name: made for made in added}
        measurements = _read_files(files, reading, {"force": force, "motion": motion}, target.parent)
        print_list(console, "Files", [measurement.about for measurement in measurements])
        texts = _texts(options, measurements)
        _ask(measurements, texts, options, target, materials)
        if spindle_modes is not None and texts["support"] == "free":
            raise InputError("--spindle-modes is given, but --support is free; expected --support spindle")
        held_out = {_named(text, measurements, "--hold-out") for text in hold_out or ()}
        if held_out >= {measurement.name for measurement in measurements}:
            raise InputError("--hold-out names all measurements, expected at least one that is left for the fit")
        with created_folder(target.parent):
            check_target(target)
            # Read before it is written, so that no campaign with mistakes is left behind.
            made = _made(
                measurements,
                texts,
                target,
                materials=materials,
                title=title or "",
                spindle_modes=count_of_modes("--spindle-modes", spindle_modes or "auto"),
                held_out=held_out,
            )
            write_whole({target: made.text.encode()})
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
        for measurement in made.measurements
    }
    result = {"file": str(target), "measurements": data, "assumed": list(made.assumed), "missing": list(made.missing)}
    targets.write(lambda: {**result, "notes": list(made.notes), "next": step})
    print_list(console, "Assumed, and commented in the file", made.assumed)
    print_list(console, "Missing", made.missing)
    print_list(console, "Notes", list(report.result.grouped_notes(made.notes)))
    console.print(f"Written: {target}", soft_wrap=True)
    targets.print_names(console)
    console.print(f"Next: {step}", soft_wrap=True)


def _made(measurements: Sequence[draft.MeasuredFile], texts: draft.Texts, target: Path, **options: Any) -> draft.Draft:
    """Return the new campaign; its mistakes are told by the options, because its file is not written."""
    try:
        return draft.make_draft(measurements, texts, target, **options)
    except draft.DraftError as error:
        mistakes = [
            f"  {mistake.titled(_option(mistake.name) if mistake.is_answer else mistake.name)}"
            for mistake in error.mistakes
        ]
    head = f"the answers make no campaign, and {target} was not written:"
    raise InputError("\n".join([head, *dict.fromkeys(mistakes)]))


def _option(name: str) -> str:
    return f"--{name.replace('_', '-')}"


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


# Files and questions --------------------------------------------------------------------------------------------------


def _read_files(
    files: Sequence[Path], reading: ReadingOptions, channels: Mapping[str, str | None], folder: Path
) -> list[draft.MeasuredFile]:
    """Return the measurements in all files, with different names, for a campaign in a folder."""
    coherences: Any = reading.pop("coherence", [])
    if coherences and len(coherences) != len(files):
        count = f"{len(coherences)} --coherence {'is' if len(coherences) == 1 else 'are'} given for {len(files)} files"
        raise InputError(f"{count}, expected one for each in their order")
    answers: dict[str, str] = {}
    measurements: list[draft.MeasuredFile] = []
    for index, file in enumerate(files):
        options = cast(ReadingOptions, {**reading, "coherence": coherences[index]} if coherences else reading)
        contents, options = _read(file, options, answers)
        measurements += draft.measured_files(file, contents.measurements, options, channels, folder)
    return draft.with_different_names(measurements)


def _read(
    file: Path, reading: ReadingOptions, answers: dict[str, str]
) -> tuple[io.contents.FileContents, ReadingOptions]:
    """Return the contents of a file and the options that read it; on a terminal a missing one is asked for."""
    while True:
        try:
            return draft.read_file(file, reading, answers)
        except io.FileFormatError as error:
            question = READING_QUESTIONS.get(error.option)
            is_open = question is not None and question.name not in {*reading, *answers} and error.file == file.name
            if question is None or not is_open or not sys.stdin.isatty():
                raise
            typer.echo(printable(str(error)))
            # Files of one analyser are alike, so that an answer holds for those that need it.
            answers[question.name] = typer.prompt(printable(f"{question.text} (such as {question.example})"))


def _ask(
    measurements: Sequence[draft.MeasuredFile],
    texts: dict[str, Any],
    options: Mapping[str, Any],
    target: Path,
    materials: Mapping[str, Any],
) -> None:
    """Add the answers that are missing to the texts, on a terminal; in a pipe they are listed."""
    is_terminal = sys.stdin.isatty()
    while True:
        answers = draft.review(measurements, texts, target, materials=materials)
        if answers.wrong:
            wrong = [
                f"{item.question.option}{f' of {item.file}' if item.file else ''} {item.problem}"
                for item in answers.wrong
            ]
            raise InputError("\n".join(wrong))
        if not answers.missing or not is_terminal:
            break
        item = answers.missing[0]
        text = _prompted(item)
        if item.question.each:
            texts.setdefault(item.question.name, {})[item.file] = text
        else:
            texts[item.question.name] = text
    asked = {item.question.name for item in answers.asked}
    for name in ("holder_material", "insertion"):
        if options[name] is not None and name not in asked:
            raise InputError(f"{QUESTIONS[name].option} is given, but the holder's file states it; leave it out")
    if answers.missing:
        head = "standard input is not a terminal, so that nothing can be asked; add with your values:"
        raise InputError("\n".join([head, *map(_line, answers.missing)]))


def _line(item: draft.Asked) -> str:
    """Return what to add to a command for a missing answer."""
    example = f"{item.file}={item.suggested or item.question.example}" if item.file else item.question.example
    return f"  {item.question.option} {shlex.quote(example)}  {item.text}"


def _prompted(item: draft.Asked) -> str:
    """Return the text of a right answer."""

    def checked(text: str) -> str:
        try:
            item.parsed(text)
        except ValueError as error:
            raise typer.BadParameter(printable(f"this {error}")) from None
        return text.strip()

    prompt = printable(f"{item.text} (such as {item.question.example})")
    answer: str = typer.prompt(prompt, item.suggested, value_proc=checked)
    return answer


def _texts(options: Mapping[str, Any], measurements: Sequence[draft.MeasuredFile]) -> dict[str, Any]:
    """Return the answers of options by question, and by measurement those about each."""
    texts: dict[str, Any] = {}
    for name, question in QUESTIONS.items():
        if options[name] not in (None, []):
            texts[name] = _of_each(question, options, measurements) if question.each else options[name]
    # A standard deviation is that of all FRFs, and not only of those that have no coherence.
    deviation = texts.pop("standard_deviation", None)
    for measurement in measurements:
        frf = measurement.frf
        if frf is None or frf.log_variance is not None:
            continue
        if deviation is not None:
            measurement.table["standard_deviation"] = _parsed("standard_deviation", deviation)
        elif "averages" in texts and frf.coherence is not None and frf.averages is not None:
            number = _parsed("averages", texts["averages"])
            if number != frf.averages:
                stated = f"--averages is {number}, but {measurement.file} states {frf.averages}"
                raise InputError(f"{stated}; leave it out")
    return texts


def _parsed(name: str, text: str) -> Any:
    try:
        return QUESTIONS[name].parse(text, {})
    except ValueError as error:
        raise InputError(f"{QUESTIONS[name].option} {error}") from None


def _of_each(
    question: Question, options: Mapping[str, Any], measurements: Sequence[draft.MeasuredFile]
) -> dict[str, str]:
    """Return the answer to a question by measurement; a single place is that of all of them."""
    option, texts = question.option, options[question.name]
    names = [measurement.name for measurement in measurements]
    if any("=" in text for text in texts):
        try:
            values = named_values(texts, f"FILE={question.example} for each file")
        except ValueError as error:
            raise InputError(f"{option} {error}") from None
        stated = {_named(file, measurements, option): text for file, text in values.items()}
        if len(stated) < len(values):
            raise InputError(f"{option} is given twice for a file, expected one for each of {', '.join(names)}")
        return stated
    if len(texts) == 1 and (question is not OVERHANG or options["hit"] is not None):
        return dict.fromkeys(names, texts[0])  # roving hits are in one clamping
    if len(texts) != len(names):
        count = f"{len(texts)} {option} {'is' if len(texts) == 1 else 'are'} given for {len(names)} measurements"
        example = shlex.quote(f"{names[0]}={question.example}")
        raise InputError(f"{count}, expected one for each, such as {option} {example}")
    return dict(zip(names, texts, strict=True))


def _named(text: str, measurements: Sequence[draft.MeasuredFile], option: str) -> str:
    """Return the name of the measurement that an option names by the file or its name."""
    for measurement in measurements:
        if text.strip() in (measurement.name, str(measurement.file), measurement.file.name):
            return measurement.name
    raise InputError(f"{option} names {shown(text)}{instead_of(text, [item.name for item in measurements])}")
