"""Reading of a campaign file and its data files, with all mistakes reported together."""

from __future__ import annotations

import math
import re
import tomllib
from collections.abc import Callable, Mapping
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

from receptance import _checks
from receptance._files import not_found, read_whole
from receptance._text import did_you_mean, shown
from receptance.campaign.build import Builder, Built, blanks_of, modal_unknowns
from receptance.campaign.cuts import CampaignCut, build_cut
from receptance.campaign.keys import OWNERS, WRONG, NamedTables, Place
from receptance.campaign.listed_materials import note_on_listed, with_listed_materials
from receptance.campaign.measurements import MeasurementReader, note_repeated
from receptance.campaign.problems import CampaignError, Issue, KeyPath, Problems
from receptance.campaign.schema import CampaignTable, SeriesTable
from receptance.campaign.tolerances import tolerances_of_assembly
from receptance.errors import warn_user
from receptance.fit.observation import Observation
from receptance.model.assembly import Assembly
from receptance.model.coordinates import Coordinate
from receptance.predict import Candidate
from receptance.units import parse_any

FILE = "campaign.toml"
"""Name of the campaign file in a folder."""
_SECTIONS = tuple(key for key, of in CampaignTable.declared.items() if isinstance(of, NamedTables))
_MOST_SPEEDS = 20_000
_DEEPEST = 20
_TOO_DEEP = f"tables and lists are nested more than {_DEEPEST} deep, expected a campaign"
_LARGEST = 2**63
_REQUIRED = ("parts", "assemblies")
"""Sections that a file without `cuts` must have; cuts may have measured tips only."""


def silent(text: str) -> None:
    """Report no progress."""
    del text


def read_campaign(
    path: str | Path,
    *,
    threads: int | None = None,
    progress: Callable[[str], None] | None = None,
    unidentified: bool = False,
) -> dict[str, Any]:
    """Return the fields of the campaign in a file, see `receptance.campaign.Campaign.load`."""
    file = _find(Path(path))
    data, text = read_contents(file)
    return campaign_fields(file, data, text, called=path, threads=threads, progress=progress, unidentified=unidentified)


def campaign_fields(
    file: Path,
    data: dict[str, Any],
    text: str = "",
    *,
    called: str | Path | None = None,
    threads: int | None = None,
    progress: Callable[[str], None] | None = None,
    unidentified: bool = False,
) -> dict[str, Any]:
    """Return the fields of the campaign of the contents of a file, which need not exist.

    The folder of `file` is that of the data files, `text` is that of `data`, and `called` is the name in messages.
    Spindles that are not identified yet are a mistake unless `unidentified`.
    """
    _checks.thread_count(threads)
    say = progress or silent
    problems = Problems(text)
    data = expand_series(data, problems)
    table, builder, built = _build(data, problems, file.parent)
    tolerances = {name: tolerances_of_assembly(name, table, built, builder) for name in built.assemblies}
    reader = MeasurementReader(table, builder, file.parent, tolerances)
    measurements: dict[str, Observation] = {}
    for name in table.measurements:
        say(f"reading {name}, {len(measurements) + 1} of {len(table.measurements)}")
        builder.store(measurements, name, reader.measurement, name)
    note_repeated(measurements, table, builder)
    candidates: dict[str, Candidate] = {}
    for name in table.candidates:
        builder.store(candidates, name, reader.candidate, name)
    places = _places(table, built, builder)
    cuts: dict[str, CampaignCut] = {}
    for name in table.cuts:
        builder.store(cuts, name, build_cut, name, reader, measurements)
    _check_stability(table, problems)
    blanks = blanks_of(table)
    on_blanks = {
        name: observation for name, observation in measurements.items() if table.measurements[name].assembly in blanks
    }
    measurements = {name: observation for name, observation in measurements.items() if name not in on_blanks}
    _check_weights(measurements, table, problems)
    if table.catalogue is not None and not table.catalogue.machine and table.catalogue.spindle is None:
        text = "is empty, expected what is behind the holder, or `spindle` with the name of a measured one"
        problems.add(("catalogue", "machine"), text)
    if built.unidentified and not unidentified and not problems.found:
        needed = {assembly.chain[-1] for name, assembly in table.assemblies.items() if name not in blanks}
        needed |= {table.catalogue.spindle or ""} if table.catalogue is not None else set()
        for name, lacks in built.unidentified.items():
            if name in needed:
                problems.add(("spindles", name), lacks)
    if not problems.found and not built.unidentified:
        built.unknowns |= modal_unknowns(table, built, measurements, builder)
    if problems.found:
        raise CampaignError(called or file, problems.in_file())
    for warning in dict.fromkeys(builder.warnings):
        warn_user(warning)
    return {
        "file": file,
        "table": table,
        "assemblies": built.assemblies,
        "measurements": measurements,
        "on_blanks": on_blanks,
        "frfs": reader.frfs,
        "errors": {name: reader.errors(name) for name in (*measurements, *on_blanks)},
        "unknowns": tuple(built.unknowns.values()),
        "tolerances": tolerances,
        "places": places,
        "candidates": candidates,
        "cuts": cuts,
        "built": built,
        "contents": data,
        "templates": {
            str(path[1]): str(inside[1]) for path, inside in problems.templates.items() if path[0] == "measurements"
        },
        "notes": tuple(builder.notes),
        "threads": threads,
        "progress": say,
    }


def measured_structures(text: str) -> dict[str, tuple[Assembly, Coordinate]]:
    """Return the measured assembly, with sensor, and the response coordinate of every measurement of a campaign.

    Data files are not read, so that they can be simulated. `text` is that of the campaign file.
    """
    data = tomllib.loads(text)
    problems = Problems(text)
    table, builder, _ = _build(expand_series(data, problems), problems, None)
    found: dict[str, tuple[Assembly, Coordinate]] = {}
    for name, measurement in table.measurements.items():
        of = (("measurements", name), measurement, table, measurement.attachments, measurement.level)
        builder.store(found, name, builder.measured, *of)
    if problems.found:
        raise CampaignError("the campaign", problems.in_file())
    return found


def _build(data: dict[str, Any], problems: Problems, folder: Path | None) -> tuple[CampaignTable, Builder, Built]:
    """Return the tables and the objects built from them; data files are looked for if a folder is given."""
    data, listed = with_listed_materials(data)
    table = _tables(data, problems, folder)
    builder = Builder(problems, folder)
    for name in listed:
        builder.note(("materials", name), note_on_listed(name))
    return table, builder, builder.build(table)


def _find(path: Path) -> Path:
    file = path / FILE if path.is_dir() else path
    if file.is_file():
        return file
    if path.is_dir():
        raise FileNotFoundError(
            f"there is no {FILE} in the folder {path}; `receptance new {path} FILES` writes one for measurement files"
        )
    raise not_found(
        "campaign file or folder",
        path,
        "`receptance new DIR FILES` writes a campaign for measurement files, `receptance example NAME` an example",
    )


def read_contents(file: Path) -> tuple[dict[str, Any], str]:
    """Return the contents of a file and its text."""
    try:
        text = read_whole(file).decode("utf-8-sig")
        data = tomllib.loads(text)
    except UnicodeDecodeError as error:
        text = f"byte {error.start} is not UTF-8, expected a TOML file, which is text in UTF-8"
        raise CampaignError.about(file, text) from None
    except tomllib.TOMLDecodeError as error:
        match = re.search(r"\(at line (\d+), column (\d+)\)", str(error))
        what = str(error).partition(" (at line")[0]
        where = f" (column {match[2]})" if match else ""
        text = f"is not TOML: {what}{where}"
        if "'\\n'" in what or what.startswith('Expected "\'"'):
            text += "; the closing quotation mark is missing"
        if file.suffix.lower() != ".toml":
            text += f"; expected a campaign, such as {FILE}. `receptance show {file}` shows a measurement file"
        problem = Issue((), text, int(match[1]) if match else None)
        raise CampaignError(file, [problem]) from None
    except RecursionError:
        raise CampaignError.about(file, _TOO_DEEP) from None
    except ValueError as error:  # a whole number with thousands of digits
        raise CampaignError.about(file, f"the file cannot be read: {str(error).partition(';')[0]}") from None
    if not data:
        raise CampaignError.about(
            file,
            "no tables in the file, expected a campaign; `receptance new DIR FILES` writes one for measurement files",
        )
    problems = Problems(text)
    _check_values(data, problems)
    if problems.found:
        raise CampaignError(file, problems.in_file())
    return data, text


def _check_values(data: dict[str, Any], problems: Problems) -> None:
    """Add mistakes that would make later steps fail: deep nesting, and numbers beyond 64 bits."""
    waiting: list[tuple[KeyPath, Any]] = [((), data)]
    while waiting:
        path, value = waiting.pop()
        if len(path) > _DEEPEST:
            problems.add(path[:1], _TOO_DEEP)
        elif isinstance(value, (dict, list)):
            inside = value.items() if isinstance(value, dict) else enumerate(value)
            waiting += [((*path, key), one) for key, one in inside]
        elif isinstance(value, int) and abs(value) >= _LARGEST:
            problems.add(path, "is a whole number beyond the 64 bits of TOML, expected a smaller one")


def _tables(data: dict[str, Any], problems: Problems, folder: Path | None) -> CampaignTable:
    """Return the tables without mistakes; tables with wrong references only are among them."""
    named = {section: list(data[section]) if isinstance(data.get(section), dict) else [] for section in _SECTIONS}
    broken = {section for section in data if section in _SECTIONS and not isinstance(data[section], dict)}
    broken |= {section for section in _REQUIRED if section not in data and "cuts" not in data}
    broken |= problems.incomplete
    _check_owners(named, problems)
    empty: dict[str, Any] = {section: {} for section in _REQUIRED}
    place = Place(problems, named, frozenset(broken), folder)
    written = {**empty, **data} if "cuts" in data else data
    values = place.keys(CampaignTable.keys(), written)
    usable = {key: value for key, value in values.items() if value is not WRONG and key in CampaignTable.declared}
    return CampaignTable(**{**empty, **usable})


def _check_owners(named: dict[str, list[str]], problems: Problems) -> None:
    """Check that names of parts, joints, attachments and sensors, which begin addresses, are unique."""
    owner: dict[str, str] = {}
    for section in OWNERS:
        for name in named[section]:
            if name in owner:
                text = f"is also the name of one of the {owner[name]}, expected another name"
                problems.add((section, name), text)
            owner.setdefault(name, section)


def _places(table: CampaignTable, built: Built, builder: Builder) -> dict[str, tuple[Coordinate, Coordinate]]:
    """Return response and excitation at which assemblies without measurements are predicted."""
    measured = {measurement.assembly for measurement in table.measurements.values()}
    found: dict[str, tuple[Coordinate, Coordinate]] = {}

    def places(assembly: Assembly) -> tuple[Coordinate, Coordinate]:
        sides = ("response", "excitation")
        response, excitation = builder.together(
            partial(builder.place, ("prediction", side), getattr(table.prediction, side), assembly) for side in sides
        )
        return response, excitation

    for name, assembly in built.assemblies.items():
        if name not in measured:
            builder.store(found, name, places, assembly)
    return found


def _check_stability(table: CampaignTable, problems: Problems) -> None:
    speeds, step = table.stability.speeds, table.stability.step
    if speeds is not None and speeds[0] >= speeds[1]:
        text = f"goes from {speeds[0]:g} to {speeds[1]:g} rpm, expected the lower speed first"
        problems.add(("stability", "speeds"), text)
    elif speeds is not None and step is not None and (speeds[1] - speeds[0]) / step > _MOST_SPEEDS:
        text = f"is {step:g} rpm, which makes more than {_MOST_SPEEDS} speeds, expected a larger one"
        problems.add(("stability", "step"), text)
    rest = min(table.stability.probability, 1.0 - table.stability.probability)
    if table.stability.number_of_draws * rest < 1.0 - 1e-9:
        text = f"is {table.stability.number_of_draws}, too few for a probability of {table.stability.probability:g}"
        problems.add(("stability", "draws"), f"{text}, expected {math.ceil(1.0 / rest - 1e-9)} or more")
    for name, cut in table.cuts.items():
        if table.stability.method == "semi-discretisation" and cut.kind == "turning":
            text = "is turning, but `stability.method` is semi-discretisation, which is for milling; expected milling"
            problems.add(("cuts", name), text)
        for key in ("pitch", "helix") if table.stability.method == "mean force" and cut.kind == "milling" else ():
            angles = getattr(cut, key)
            if isinstance(angles, list) and len(set(angles)) > 1:
                text = "differs between teeth, and so do the delays, for which the mean force has no limit; expected "
                problems.add(("cuts", name, key), f'{text}`method = "semi-discretisation"` under [stability]')


_WEIGHTS = {
    "frf": '`standard_deviation = "2 %"`, or coherence in the file and `averages`',
    "hammer records": 'at least two hits, whose scatter is the variance, or `floor = "2 %"`',
    "natural frequencies": '`standard_deviation = "1 Hz"`',
}
"""Source of the standard deviation of each kind of measurement."""


def _check_weights(measurements: dict[str, Observation], table: CampaignTable, problems: Problems) -> None:
    """Check that all fitted measurements have standard deviations, or none."""
    if table.settings.objective == "percentage":
        return
    weighted = {
        name: observation.weighted
        for name, observation in measurements.items()
        if table.measurements[name].role == "identify"
    }
    if not any(weighted.values()):
        return
    for name in (name for name, known in weighted.items() if not known):
        problems.add(
            ("measurements", name),
            "has no standard deviation, but other measurements have one, so their weights are not defined; expected "
            + _WEIGHTS[table.measurements[name].kind],
        )


# Series: a table for each level ---------------------------------------------------------------------------------------

LEVEL = "{level}"
"""Placeholder for a level as it is written in the file."""
_VALUE = "{value}"
"""Placeholder for the number of a level without its unit."""
_TEMPLATED = ("assemblies", "measurements")
_NUMBER = re.compile(r"\s*([-+]?[0-9.]+(?:[eE][-+]?[0-9]+)?)")


def expand_series(data: dict[str, Any], problems: Problems) -> dict[str, Any]:
    """Return the contents of a file with a table for each level instead of a table with `{level}` in its name.

    Each assembly has its level as a condition. Measurements at levels of `hold_out` are held out.
    """
    templates = [
        (section, name)
        for section in _TEMPLATED
        for name in _section(data, section)
        if isinstance(name, str) and LEVEL in name
    ]
    series = data.get("series")
    if series is None:
        for path in templates:
            problems.add(path, f"has {LEVEL} in its name, but the file has no `series`, expected one with `levels`")
        return _without(data, templates, problems)
    place, keys = Place(Problems(), {}, frozenset(), None), SeriesTable.keys()
    values = place.keys(keys, series) if isinstance(series, dict) else {}
    levels, over = values.get("levels", WRONG), values.get("over", WRONG)
    if levels is WRONG or over is WRONG:
        return _without(data, templates, problems)  # the reading of all tables reports the mistake
    names = [_level_text(level) for level in levels]
    assemblies = (one for one in _section(data, "assemblies").values() if isinstance(one, dict))
    if not templates and not any(over in _section(one, "conditions") for one in assemblies):
        text = f"is not used: no assembly or measurement has {LEVEL} in its name, and no assembly has the condition"
        problems.add(("series",), f"{text} {shown(over)}")
    for index, name in enumerate(names):
        if name in names[:index]:
            problems.add(("series", "levels", index), f"is {shown(levels[index])} for the second time")
    _check_units(levels, problems)
    out = values.get("hold_out", WRONG)
    held = [] if out is WRONG else [_level_text(level) for level in out]
    for index, name in enumerate(held):
        if name not in names:
            text = f"is {shown(name)}, which is not one of the levels{did_you_mean(name, names)}"
            problems.add(("series", "hold_out", index), text)
    found = data | {section: dict(data[section]) for section, _ in templates}
    for section, template in templates:
        contents = found[section].pop(template)
        for name in dict.fromkeys(names):
            own = _substitute_level(template, name)
            if own in found[section]:
                problems.add(
                    (section, template), f"becomes {shown(own)} at a level, which is the name of another table"
                )
                continue
            found[section][own] = _table_at_level(section, contents, name, over, name in held)
            problems.templates[section, own] = (section, template)
    return found


def _check_units(levels: list[Any], problems: Problems) -> None:
    """Add a mistake for the first level of a different quantity than the level before."""
    try:
        units = [parse_any(level)[1] if isinstance(level, str) else "" for level in levels]
    except ValueError:
        return  # the validation of the condition reports the mistake
    for index, (before, unit) in enumerate(pairwise(units), 1):
        if unit != before:
            text = (
                f"is {shown(levels[index])} after {shown(levels[index - 1])}, expected the same quantity at all levels"
            )
            problems.add(("series", "levels", index), text)
            return


def _table_at_level(section: str, table: Any, level: str, over: str, held: bool) -> Any:
    own = _substituted(table, level)
    if not isinstance(own, dict):
        return own
    if section == "assemblies":
        conditions = own.get("conditions", {})
        if isinstance(conditions, dict):
            own["conditions"] = {over: level, **conditions}
    elif held:
        own.setdefault("role", "hold out")
    return own


def _substituted(thing: Any, level: str) -> Any:
    """Return a copy with the level in place of the placeholders."""
    if isinstance(thing, str):
        return _substitute_level(thing, level)
    if isinstance(thing, list):
        return [_substituted(one, level) for one in thing]
    if isinstance(thing, dict):
        return {key: _substituted(value, level) for key, value in thing.items()}
    return thing


def _substitute_level(text: str, level: str) -> str:
    number = _NUMBER.match(level)
    return text.replace(LEVEL, level).replace(_VALUE, number[1] if number else level)


def _level_text(level: Any) -> str:
    return level if isinstance(level, str) else f"{level:g}"


def _section(data: Mapping[str, Any], section: str) -> Mapping[str, Any]:
    table = data.get(section)
    return table if isinstance(table, dict) else {}


def _without(data: dict[str, Any], templates: list[tuple[str, str]], problems: Problems) -> dict[str, Any]:
    """Return the contents without templates whose levels are not known."""
    found = data | {section: dict(data[section]) for section, _ in templates}
    for section, name in templates:
        del found[section][name]
        problems.incomplete.add(section)
    return found
