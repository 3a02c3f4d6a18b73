"""The command `new`: a campaign from measurement files and a few answers."""

from __future__ import annotations

import re
import shlex
import sys
import tomllib
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TypeVar, cast

import typer

from receptance import units
from receptance._files import check_target, created_folder, read_whole, write_whole
from receptance._reading import ReadingOptions, campaign_keys
from receptance._text import instead_of, one_of, printable, shown
from receptance.cli.files import reading_of, takes_reading
from receptance.cli.running import InputError, Json, Overwrite, Targets, input_errors
from receptance.errors import ReceptanceWarning

if TYPE_CHECKING:
    from receptance import FRF
    from receptance.catalogue import HolderRow
    from receptance.cli.draft import Draft, MeasuredFile
    from receptance.io import TimeSeries
    from receptance.model.beams import Material
    from receptance.report import Table
    from receptance.report.table import Cell

_FILE = "campaign.toml"
_LEAST_COHERENCE = 0.9
"""Median coherence of neighbouring lines below which the ends of the band are left out."""
_NEIGHBOURS = 9
"""Number of neighbouring lines of that median."""
_NONE = ("none", "laser", "0")
_OVERHANG = re.compile(r"(?<![\d.])(\d+(?:\.\d+)?)\s*_?mm(?![a-z])", re.IGNORECASE)
"""An overhang in the name of a file, which a question suggests."""
_ASSUMED = (
    "tolerances of dimensions and materials",
    "loss factors",
    "bounds of the joint",
    "hit and response at the tip",
)
_MOTIONS = ("displacement", "velocity", "acceleration")

_OPTION = 30
"""Width of the column of options in a message."""

_T = TypeVar("_T")


@takes_reading(several=True)
def new(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of the campaign; it is created.")],
    files: Annotated[
        list[Path], typer.Argument(metavar="FILES", help="Files with FRFs or hammer hits, one for each overhang.")
    ],
    reading: ReadingOptions,
    overhang: Annotated[
        list[str] | None,
        typer.Option(
            metavar="LENGTH",
            help="From the holder's face to the tip, '60 mm'; one for each file in their order, or FILE=LENGTH.",
        ),
    ] = None,
    tool: Annotated[
        str | None,
        typer.Option(
            metavar="PIECES",
            help="Diameter of the tool, '12.7 mm'; or pieces from the tip on, the shank last: '30 mm x 9.6 mm, 12 mm'.",
        ),
    ] = None,
    tool_material: Annotated[
        str | None, typer.Option(metavar="NAME", help="steel, carbide, or the name of a --material.")
    ] = None,
    holder: Annotated[
        str | None,
        typer.Option(
            metavar="PIECES",
            help="Pieces of the holder from its nose on, length x outer diameter/bore, '48 mm x 50 mm, 90 mm x 44/16 "
            "mm'; or a CSV or TOML file of segments, FILE:NAME if it has several holders.",
        ),
    ] = None,
    holder_material: Annotated[str | None, typer.Option(metavar="NAME", help="As --tool-material.")] = None,
    insertion: Annotated[
        str | None, typer.Option(metavar="LENGTH", help="Length of the shank in the holder, '48 mm', or none.")
    ] = None,
    sensor: Annotated[
        str | None, typer.Option(metavar="MASS", help="Mass of the accelerometer, '0.6 g', or none for a laser.")
    ] = None,
    support: Annotated[
        str | None,
        typer.Option(metavar="NAME", help="free for a holder that hangs free, or spindle for one in a machine."),
    ] = None,
    spindle_modes: Annotated[
        int | None, typer.Option(min=1, max=20, metavar="N", help="Modes of the spindle; by default 2.")
    ] = None,
    averages: Annotated[
        int | None, typer.Option(min=2, metavar="N", help="Number of averages, if the files do not state it.")
    ] = None,
    standard_deviation: Annotated[
        str | None,
        typer.Option(metavar="SHARE", help="Of the FRFs on every line, '2 %', if the files have no coherence."),
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
    from receptance.cli.draft import Draft
    from receptance.report.result import grouped_notes
    from receptance.report.terminal import print_list, print_table

    target = _target(folder, files, overwrite)
    asked: dict[str, Any] = {}
    answers = _Answers(sys.stdin.isatty())
    targets = Targets(json_file, None, None, overwrite=overwrite)
    for path, what in ((target, "the new campaign"), *((file, "a measurement file") for file in files)):
        targets.protect(path, what)
    targets.require_new()
    console = targets.console()
    with warnings.catch_warnings(), input_errors():
        warnings.simplefilter("ignore", ReceptanceWarning)
        readings = _by_file(files, reading)
        contents = [o for file in files for o in _contents(file, readings[file], asked, answers, force, motion)]
        _name_apart(contents)
        print_table(console, _files_table(contents))
        _weights(contents, averages, standard_deviation, answers)
        _add_overhangs(contents, overhang, answers)
        materials = _materials(material or ())
        named = _choice([*materials])
        pieces = answers.get("--tool", tool, "Diameter of the tool", _tool, "20 mm")
        kind = answers.get(
            "--tool-material", tool_material, f"Material of the tool ({', '.join(materials)})", named, "carbide"
        )
        body = answers.get(
            "--holder", holder, "Pieces of the holder, or a file", _holder, "48 mm x 50 mm, 90 mm x 44/16 mm"
        )
        of_body: str | None = ""
        if holder_material is not None or body is None or any(not piece.material for piece in body):
            of_body = answers.get(
                "--holder-material", holder_material, f"Material of the holder ({', '.join(materials)})", named, "steel"
            )
        pieces = None if pieces is None else [replace(piece, material=kind or "") for piece in pieces]
        body = None if body is None else [replace(p, material=p.material or of_body or "") for p in body]
        body = _with_shank(body, pieces, insertion, answers)
        mass = answers.get("--sensor", sensor, "Mass of the accelerometer, or none", _sensor, "0.6 g")
        hangs = answers.get(
            "--support",
            support,
            "Does the holder hang free, or is it in a spindle",
            _choice(["free", "spindle"]),
            "free",
        )
        answers.check()
        assert pieces is not None
        assert body is not None
        if spindle_modes is not None and hangs == "free":
            raise InputError("--spindle-modes is given, but --support is free; expected --support spindle")
        _hold_out(contents, hold_out or ())
        draft = Draft(
            title=title or target.resolve().parent.name or "Campaign",
            tool=pieces,
            holder=body,
            folder=target.parent,
            measurements=contents,
            sensor=mass or 0.0,
            spindle_modes=(spindle_modes or 2) if hangs == "spindle" else 0,
            materials=materials,
        )
        notes = _write(draft, target)
    step = f"receptance check {shlex.quote(str(folder))}"
    targets.write(lambda: _data(target, draft, notes, step))
    print_list(console, "Assumed, and commented in the file", _ASSUMED)
    print_list(console, "Notes", list(grouped_notes(notes)))
    console.print(f"Written: {target}", soft_wrap=True)
    targets.print_names(console)
    console.print(f"Next: {step}", soft_wrap=True)


# Questions ------------------------------------------------------------------------------------------------------------


@dataclass
class _Answers:
    """Answers by options, or asked on a terminal; missing ones are listed together."""

    interactive: bool
    missing: list[tuple[str, str]] = field(default_factory=list)
    """Options with examples, and their questions."""

    def get(self, option: str, given: str | None, question: str, parse: Callable[[str], _T], example: str) -> _T | None:
        """Return an answer; None if it is missing or wrong answers are to be listed later."""
        if given is not None:
            try:
                return parse(given)
            except ValueError as error:
                raise InputError(f"{option} {error}") from None
        if not self.interactive:
            self.missing.append((f"{option} {shlex.quote(example)}", question))
            return None
        return self.ask(question, parse, example)

    def ask(self, question: str, parse: Callable[[str], _T], example: str, default: str | None = None) -> _T:
        """Ask until the answer is understood."""
        while True:
            text = typer.prompt(printable(f"{question} (such as {example})"), default=default)
            try:
                return parse(str(text).strip())
            except ValueError as error:
                typer.echo(printable(f"  This {error}."))

    def check(self) -> None:
        """Raise if an answer is missing."""
        if not self.missing:
            return
        rows = [
            f"  {option:{_OPTION}s}  {question}"
            if len(option) <= _OPTION
            else f"  {option}\n  {'':{_OPTION}s}  {question}"
            for option, question in self.missing
        ]
        raise InputError(
            "standard input is not a terminal, so that nothing can be asked; add with your values:\n" + "\n".join(rows)
        )


def _choice(names: Sequence[str]) -> Callable[[str], str]:
    def parse(text: str) -> str:
        if text not in names:
            raise ValueError(f"is {shown(text)}{instead_of(text, names)}")
        return text

    return parse


def _units(text: str) -> list[str]:
    return [unit.strip() for unit in text.split(",")]


def _tool(text: str) -> list[HolderRow]:
    from receptance.cli.draft import parse_pieces

    return parse_pieces(text, shank=True)


def _sensor(text: str) -> float:
    if text.lower() in _NONE:
        return 0.0
    try:
        return units.parse(text, units.MASS)
    except ValueError as error:
        raise ValueError(f"{error}, or none") from None


def _length(text: str) -> float:
    return units.parse(text, units.LENGTH)


def _share(text: str) -> str:
    from receptance.campaign.values import parse_deviation_share

    parse_deviation_share(text)
    return text


def _averages(text: str) -> int:
    if not text.isdecimal() or int(text) < 2:
        raise ValueError(f"is {shown(text)}, expected a whole number of at least 2")
    return int(text)


# Files ----------------------------------------------------------------------------------------------------------------


def _target(folder: Path, files: Sequence[Path], overwrite: bool) -> Path:
    """Return the path of the new file, before anything is asked."""
    if folder.is_file():
        raise InputError(
            f"{folder} is a file, expected first the folder of the new campaign: receptance new FOLDER "
            f"{' '.join(shlex.quote(str(one)) for one in (folder, *files))}"
        )
    if folder.exists() and not folder.is_dir():
        raise InputError(f"cannot write to {folder}: it is a pipe or a device, expected a folder")
    target = folder / _FILE
    if (target.exists() or target.is_symlink()) and not overwrite:
        raise InputError(f"{target} exists already; choose another folder, or replace it with --overwrite")
    double = [file for index, file in enumerate(files) if file.resolve() in [one.resolve() for one in files[:index]]]
    if double:
        raise InputError(f"{double[0]} is given twice, expected each file once")
    return target


def _contents(
    file: Path,
    reading: ReadingOptions,
    asked: dict[str, Any],
    answers: _Answers,
    force: str | None,
    motion: str | None,
) -> list[MeasuredFile]:
    """Return the FRFs, or the time record, of a file; on a terminal a missing unit or header is asked for."""
    from receptance import FRF
    from receptance.cli.draft import MeasuredFile
    from receptance.io import FileFormatError, TimeSeries, read_all

    while True:
        try:
            found = read_all(file, **reading)
            break
        except FileFormatError as error:
            wanted = next((name for name in ("columns", "unit") if f"--{name}" in str(error)), "")
            if not answers.interactive or not wanted or wanted in reading or error.file != file.name:
                raise
            # Files of one analyser are alike, so that an answer holds for those that need it.
            if wanted not in asked:
                typer.echo(printable(str(error)))
                asked[wanted] = (
                    answers.ask("Header with units", str, "frequency [Hz],real [g/N],imag [g/N]")
                    if wanted == "columns"
                    else answers.ask("Unit of the numbers", _units, "m/s^2/N, or hammer=N, tip=g")
                )
            reading = cast(ReadingOptions, {**reading, **reading_of({wanted: asked[wanted]})})
    frfs = [one for one in found if isinstance(one, FRF)]
    series = [one for one in found if isinstance(one, TimeSeries)]
    keys = _reading_keys(reading, records=not frfs)
    if len(frfs) == 1:
        return [MeasuredFile(file=file, name=file.stem, measured=frfs[0], table=_frf_keys(file, frfs[0], keys))]
    if frfs:
        return [
            MeasuredFile(
                file=file,
                name=f"{file.stem} {index + 1}",
                measured=one,
                table=_frf_keys(file, one, {**keys, "entry": {"number": index}}),
            )
            for index, one in enumerate(frfs)
        ]
    if series and len({(record.channels, record.units, record.sample_rate_hz) for record in series}) == 1:
        # Several records of the same channels are hits of one measurement.
        table = _hammer_keys(file, series[0], keys, force, motion)
        return [MeasuredFile(file=file, name=file.stem, measured=series[0], table=table)]
    if series:
        raise InputError(
            f"{file} holds {len(series)} time records with different channels; split it with receptance convert "
            f"{shlex.quote(str(file))} OUT --number N"
        )
    raise InputError(
        f"{file} holds {found[0]!r} and no FRF, expected the file of its FRF with --coherence {shlex.quote(str(file))}"
    )


def _frf_keys(file: Path, frf: FRF, keys: dict[str, Any]) -> dict[str, Any]:
    """Return the keys of an FRF in a file."""
    if frf.values[0].size > 1:
        raise InputError(
            f"{file} holds an FRF with {frf.shape[1]} responses and {frf.shape[2]} excitations, expected files with "
            "one of each; write the entry that belongs to the tip with receptance.io, or write its campaign by hand "
            "with `entry`"
        )
    table = {"kind": "frf", "file": "", **keys}
    if band := _good_band(frf):
        table["bands"] = [[f"{band[0]:.6g} Hz", f"{band[1]:.6g} Hz"]]
    return table


def _hammer_keys(
    file: Path, series: TimeSeries, keys: dict[str, Any], force: str | None, motion: str | None
) -> dict[str, Any]:
    """Return the keys of a file with hammer hits; the channels follow from their units."""
    table: dict[str, Any] = {"kind": "hammer records", "file": ""}
    for key, given, kinds in (("force", force, ("force",)), ("motion", motion, _MOTIONS)):
        own = [name for name, kind in zip(series.channels, series.quantities, strict=True) if kind in kinds]
        if given is not None and given not in series.channels:
            raise InputError(f"--{key} is {shown(given)}{instead_of(given, series.channels)}, a channel of {file}")
        if given is None and len(own) != 1:
            raise InputError(
                f"{file} has {len(own) or 'no'} channels with the unit of a {key}, expected --{key} CHANNEL, "
                f"{one_of(own or series.channels)}"
            )
        table[key] = given or own[0]
    return {**table, **keys}


def _by_file(files: Sequence[Path], reading: ReadingOptions) -> dict[Path, ReadingOptions]:
    """Return the options of reading for each file, with its own file of coherence."""
    several: Any = reading.pop("coherence", [])
    if several and len(several) != len(files):
        raise InputError(
            f"{len(several)} --coherence {'is' if len(several) == 1 else 'are'} given for {len(files)} files, expected "
            "one for each in their order"
        )
    own: list[Any] = [{"coherence": one} for one in several] or [{}] * len(files)
    return {file: cast(ReadingOptions, {**reading, **one}) for file, one in zip(files, own, strict=True)}


def _reading_keys(reading: ReadingOptions, *, records: bool) -> dict[str, Any]:
    """Return options of `read_all` as keys of a measurement."""
    names = campaign_keys(records=records)
    keys = {names[name]: value for name, value in reading.items() if name in names}
    if "sample_rate_hz" in reading:
        keys["sample_rate"] = f"{reading['sample_rate_hz']:.15g} Hz"
    return keys


def _good_band(frf: FRF) -> tuple[float, float] | None:
    """Return the band without ends of low coherence; None if all lines are in it."""
    import numpy as np

    if frf.coherence is None or frf.frequency_hz.size <= _NEIGHBOURS:
        return None
    padded = np.pad(frf.coherence[:, 0, 0], _NEIGHBOURS // 2, mode="edge")
    median = np.median(np.lib.stride_tricks.sliding_window_view(padded, _NEIGHBOURS), axis=1)
    good = np.flatnonzero(median >= _LEAST_COHERENCE)
    if not good.size or (good[0] == 0 and good[-1] == median.size - 1):
        return None
    return float(frf.frequency_hz[good[0]]), float(frf.frequency_hz[good[-1]])


def _name_apart(contents: list[MeasuredFile]) -> None:
    """Give measurements of files with the same name different ones."""
    names: list[str] = []
    for one in contents:
        name, number = one.name, 2
        while name in names:
            name, number = f"{one.name} {number}", number + 1
        one.name = name
        names.append(name)


def _files_table(contents: Sequence[MeasuredFile]) -> Table:
    import numpy as np

    from receptance import FRF
    from receptance.cli.draft import lines_of
    from receptance.report import Column, Table

    rows: list[tuple[Cell, ...]] = []
    for one in contents:
        frf = one.measured
        if not isinstance(frf, FRF):
            rows.append((one.name, "hammer hits", f"{len(frf)} samples at {frf.sample_rate_hz:.6g} Hz", None, None))
            continue
        coherence = None if frf.coherence is None else float(np.median(frf.coherence))
        rows.append((one.name, f"{frf.form} in {frf.unit}", lines_of(frf), frf.averages, coherence))
    columns = ("measurement", "contents", "data", Column("averages", form="d"), Column("median coherence", form=".4f"))
    return Table("Files", columns, rows).without_empty()


def _weights(contents: Sequence[MeasuredFile], averages: int | None, deviation: str | None, answers: _Answers) -> None:
    """Add what the standard deviation of FRFs needs: averages, or the deviation itself."""
    from receptance import FRF

    frfs = [one for one in contents if isinstance(one.measured, FRF) and one.measured.log_variance is None]
    stated = None if deviation is None else answers.get("--standard-deviation", deviation, "", _share, "2 %")
    if stated is not None:
        for one in frfs:
            one.table["standard_deviation"] = stated
        return
    coherent = [one for one in frfs if one.measured.coherence is not None]  # type: ignore[union-attr]
    for one in coherent:
        own = one.measured.averages  # type: ignore[union-attr]
        if own is not None and averages is not None and own != averages:
            raise InputError(f"--averages is {averages}, but {one.file} states {own}; leave it out")
    counted = [one for one in coherent if one.measured.averages is None]  # type: ignore[union-attr]
    if counted:
        given = None if averages is None else str(averages)
        count = answers.get("--averages", given, f"Number of averages of {counted[0].name}", _averages, "10")
        for one in counted:
            one.table["averages"] = count
    bare = [one for one in frfs if one not in coherent]
    if bare:
        question = f"Standard deviation of the FRF, {bare[0].name} has no coherence"
        share = answers.get("--standard-deviation", None, question, _share, "2 %")
        for one in bare:
            one.table["standard_deviation"] = share


def _add_overhangs(contents: Sequence[MeasuredFile], given: Sequence[str] | None, answers: _Answers) -> None:
    """Add the overhang of each measurement."""
    names = [one.name for one in contents]
    example = " ".join(f"--overhang {shlex.quote(f'{name}=60 mm')}" for name in names[:2])
    if not given:
        if not answers.interactive:
            suggested = [f"--overhang {shlex.quote(_suggested(name) or '60 mm')}" for name in names]
            answers.missing.append((" ".join(suggested), "Overhangs of the files, in their order"))
            return
        for one in contents:
            question = f"Overhang of {one.name}, from the holder's face to the tip"
            one.overhang = answers.ask(question, _length, "60 mm", _suggested(one.name))
        return
    texts: dict[str, str] = {}
    if any("=" in text for text in given):
        known = _aliases(contents)
        for text in given:
            name, sign, value = text.rpartition("=")
            if not sign:
                raise InputError(f"--overhang is {shown(text)}, expected FILE=LENGTH for each file: {example}")
            if name.strip() not in known:
                raise InputError(f"--overhang names {shown(name)}{instead_of(name.strip(), names)}")
            if known[name.strip()] in texts:
                raise InputError(f"--overhang is given twice for {shown(name)}, expected one")
            texts[known[name.strip()]] = value.strip()
        lacking = [name for name in names if name not in texts]
        if lacking:
            raise InputError(f"--overhang is missing for {', '.join(lacking)}; add --overhang '{lacking[0]}=60 mm'")
    elif len(given) != len(names):
        count = f"{len(given)} --overhang {'is' if len(given) == 1 else 'are'} given for {len(names)} measurements"
        raise InputError(f"{count}, expected one for each in the order of the files, or {example} ...")
    else:
        texts = dict(zip(names, given, strict=True))
    for one in contents:
        try:
            one.overhang = _length(texts[one.name])
        except ValueError as error:
            raise InputError(f"--overhang of {one.name} {error}") from None


def _aliases(contents: Sequence[MeasuredFile]) -> dict[str, str]:
    """Return the names of measurements by everything that an option may call them."""
    return {alias: one.name for one in contents for alias in (str(one.file), one.file.name, one.name)}


def _suggested(name: str) -> str | None:
    """Return the only length in the name of a file."""
    found = _OVERHANG.findall(name)
    return f"{found[0]} mm" if len(found) == 1 else None


def _hold_out(contents: Sequence[MeasuredFile], given: Sequence[str]) -> None:
    known = _aliases(contents)
    for text in given:
        if text not in known:
            raise InputError(f"--hold-out is {shown(text)}{instead_of(text, [one.name for one in contents])}")
    out = {known[text] for text in given}
    if len(out) == len(contents):
        raise InputError("--hold-out names all measurements, expected at least one that is left for the fit")
    for one in contents:
        one.held_out = one.name in out


# Tool and holder ------------------------------------------------------------------------------------------------------


def _materials(given: Sequence[str]) -> dict[str, Material]:
    from receptance.cli.draft import MATERIALS, parse_material

    found = dict(MATERIALS)
    for text in given:
        try:
            made = parse_material(text)
        except ValueError as error:
            raise InputError(f"--material {error}") from None
        found[made.name] = made
    return found


def _holder(text: str) -> list[HolderRow]:
    """Return the pieces of a holder, from their text or from a file."""
    from receptance.cli.draft import parse_pieces

    path, name = Path(text), ""
    if not path.is_file() and ":" in text:
        first, _, name = text.rpartition(":")
        path = Path(first)
    ending = path.suffix.lower()
    if ending not in (".csv", ".toml"):
        if path.is_file():
            raise ValueError(f"is {shown(text)}, a file with the ending {ending or 'none'}, expected .csv or .toml")
        return parse_pieces(text)
    if not path.is_file():
        raise ValueError(f"is {shown(text)}, but there is no file {path}")
    holders = _holders_of_csv(path) if ending == ".csv" else _holders_of_toml(path)
    if not name and len(holders) > 1:
        names = ", ".join(holders)
        raise ValueError(
            f"is {shown(text)}, which holds {names}; expected one of them, such as {path}:{next(iter(holders))}"
        )
    if name and name not in holders:
        raise ValueError(f"is {shown(text)}, but {path} has no {shown(name)}{instead_of(name, holders)}")
    return holders[name or next(iter(holders))]


def _holders_of_csv(path: Path) -> dict[str, list[HolderRow]]:
    from receptance.catalogue.rows import read_holders

    try:
        return read_holders(path)
    except ValueError as error:
        raise ValueError(f"names a file with mistakes: {error}") from None


def _holders_of_toml(path: Path) -> dict[str, list[HolderRow]]:
    from receptance.cli.draft import pieces_of

    try:
        data = tomllib.loads(read_whole(path).decode("utf-8-sig"))
    except (UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise ValueError(f"names {path}, which is not TOML: {error}") from None
    parts = data.get("parts")
    tables = {"holder": data["segments"]} if "segments" in data else {}
    if isinstance(parts, dict):
        tables |= {name: part.get("segments") for name, part in parts.items() if isinstance(part, dict)}
    if not tables:
        raise ValueError(f"names {path}, which has neither [[segments]] nor [[parts.NAME.segments]]")
    found = {}
    for name, segments in tables.items():
        where = f"{path}, segments" if "segments" in data and name == "holder" else f"{path}, parts.{name}.segments"
        if not isinstance(segments, list):
            raise ValueError(f"names {where}, which is {shown(segments)}, expected a list of segments")
        try:
            found[name] = pieces_of(segments, where)
        except ValueError as error:
            raise ValueError(f"names a file with a mistake: {error}") from None
    return found


def _with_shank(
    body: list[HolderRow] | None, tool: list[HolderRow] | None, insertion: str | None, answers: _Answers
) -> list[HolderRow] | None:
    """Return the holder with the shank in its bore, unless its pieces contain it already."""
    from receptance.cli.draft import inserted

    if body is not None and any(piece.core for piece in body):
        if insertion is not None:
            raise InputError(
                "--insertion is given, but the holder's file states the core of its pieces; give one of the two"
            )
        return body

    def parse(text: str) -> list[HolderRow]:
        length = 0.0 if text.lower() == "none" else _length(text)
        return [] if body is None or tool is None else inserted(body, length, tool[-1])

    found = answers.get("--insertion", insertion, "Length of the shank in the holder, or none", parse, "48 mm")
    return body if found is None else found


# The file -------------------------------------------------------------------------------------------------------------


def _data(target: Path, draft: Draft, notes: Sequence[str], step: str) -> dict[str, Any]:
    """Return the contents of `--json`."""
    measurements = {
        one.name: {
            "file": one.table["file"],
            "overhang_m": one.overhang,
            "role": "hold out" if one.held_out else "identify",
            "data": one.about,
        }
        for one in draft.measurements
    }
    return {
        "file": str(target),
        "measurements": measurements,
        "assumed": list(_ASSUMED),
        "notes": list(notes),
        "next": step,
    }


def _write(draft: Draft, target: Path) -> tuple[str, ...]:
    """Write the campaign if it can be read, and return the notes on its data."""
    from receptance.campaign import Campaign

    text = draft.text()
    with created_folder(target.parent):
        check_target(target)
        # Read before it is written, so that no campaign with mistakes is left behind.
        found = Campaign.from_contents(target, tomllib.loads(text), text)
        write_whole({target: text.encode()})
    return found.notes
