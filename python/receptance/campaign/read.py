"""Reading of a campaign file and its data files, with all mistakes reported together."""

from __future__ import annotations

import copy
import difflib
import math
import re
import tomllib
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

from receptance._files import read_whole
from receptance.campaign.build import Builder, Built, with_attached, with_sensor
from receptance.campaign.campaign import Campaign
from receptance.campaign.cuts import build_cut
from receptance.campaign.measurements import Measurement, build_candidate, build_measurement
from receptance.campaign.modal_starts import modal_unknowns
from receptance.campaign.problems import CampaignError, KeyPath, Problem, Problems, lines_of, translate
from receptance.campaign.schema import CampaignTable
from receptance.campaign.series import expand_series
from receptance.campaign.tolerances import Effects, assembly_effects, attachment_effects
from receptance.campaign.values import OWNERS, References
from receptance.errors import ReceptanceWarning
from receptance.identification import MeasuredFRF
from receptance.model.assembly import Assembly
from receptance.model.coordinates import Coordinate

__all__ = ["from_data", "load", "measured_structures"]

FILE = "campaign.toml"
"""Name of the campaign file in a folder."""
_SECTIONS = (
    "materials",
    "parts",
    "modal_parts",
    "joints",
    "sensors",
    "attachments",
    "assemblies",
    "measurements",
    "candidates",
    "cuts",
    "unknowns",
)
_MOST_SPEEDS = 20_000
_DEEPEST = 20
_TOO_DEEP = f"tables and lists are nested more than {_DEEPEST} deep, expected a campaign"
_LARGEST = 2**63
_REQUIRED = ("materials", "parts", "assemblies")
"""Sections that a file without `cuts` must have; cuts may have measured tips only."""


def load(path: str | Path, *, progress: Callable[[str], None] | None = None) -> Campaign:
    """Read a campaign file and the data files that it names.

    Parameters
    ----------
    path : str or path
        The TOML file, or a folder with a `campaign.toml`. Paths of data files are relative to it.
    progress : callable, optional
        Called with a progress message before each measurement is read.

    Returns
    -------
    Campaign
        Assemblies, measurements and unknowns.

    Raises
    ------
    CampaignError
        The file has mistakes; `.problems` lists all of them with place and line. It is a ValueError.
    OSError
        The file does not exist or cannot be opened.

    Warns
    -----
    ReceptanceWarning
        Suspicious data; the `notes` of the campaign list them as well.

    Examples
    --------
    >>> import tempfile
    >>> from receptance import campaign, examples
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = examples.write("er32", folder)
    ...     er32 = campaign.load(folder)
    >>> sorted(er32.assemblies)[:2]
    ['d11_long', 'd11_medium']
    """
    file = _find(Path(path))
    data, lines = _read(file)
    return from_data(file, data, lines, called=path, progress=progress)


def from_data(
    file: Path,
    data: dict[str, Any],
    lines: dict[KeyPath, int] | None = None,
    *,
    called: str | Path | None = None,
    progress: Callable[[str], None] | None = None,
) -> Campaign:
    """Return the campaign of the contents of a file, which need not exist.

    Parameters
    ----------
    file : Path
        The file; its folder is that of the data files.
    data : dict
        Contents of the TOML file.
    lines : dict, optional
        Lines of its values, see `lines_of`.
    called : str or path, optional
        Name of the file in messages.
    progress : callable, optional
        As in `load`.
    """
    problems = Problems(lines or {})
    table, builder, built = _build(data, problems, file.parent)
    effects: dict[str, Effects] = {name: assembly_effects(name, table, built, builder) for name in built.assemblies}
    attached = {name: attachment_effects(name, table, built) for name in (*built.sensors, *built.attachments)}
    conditions = {name: one.conditions for name, one in table.assemblies.items() if one.conditions}
    measurements: dict[str, Measurement] = {}
    for name in table.measurements:
        if progress is not None:
            progress(f"reading {name}")
        measured = build_measurement(name, table, built, (effects, attached), file.parent, builder, conditions)
        if measured is not None:
            measurements[name] = measured
    possible = {
        name: build_candidate(name, table, built, (effects, attached), builder, conditions) for name in table.candidates
    }
    places = _places(table, built, builder)
    cuts = {name: build_cut(name, table, built.assemblies, measurements, file.parent, builder) for name in table.cuts}
    _check_stability(table, problems)
    _check_weights(measurements, table, problems)
    if not problems.found:
        built.unknowns |= modal_unknowns(table, built, measurements, builder)
    if problems.found:
        raise CampaignError(called or file, problems.in_file())
    for warning in dict.fromkeys(builder.warnings):
        warnings.warn(warning, ReceptanceWarning, stacklevel=3)
    return Campaign(
        file=file,
        table=table,
        assemblies=built.assemblies,
        measurements=measurements,
        unknowns=tuple(built.unknowns.values()),
        effects=effects,
        conditions=conditions,
        places=places,
        candidates={name: one for name, one in possible.items() if one is not None},
        cuts={name: one for name, one in cuts.items() if one is not None},
        built=built,
        templates={
            str(path[1]): str(inside[1]) for path, inside in problems.templates.items() if path[0] == "measurements"
        },
        notes=tuple(builder.notes),
    )


def measured_structures(text: str) -> dict[str, tuple[Assembly, Coordinate]]:
    """Return the measured assembly, with sensor, and the response coordinate of every measurement of a campaign.

    Data files are not read, so that they can be simulated.

    Parameters
    ----------
    text : str
        Text of the campaign file.
    """
    data = tomllib.loads(text)
    problems = Problems(lines_of(text))
    table, builder, built = _build(data, problems, None)
    found = {}
    for name, measurement in table.measurements.items():
        assembly = built.assemblies[measurement.assembly]
        at = builder.place(("measurements", name, "response"), measurement.response, assembly)
        if at is not None:
            sensor = None if measurement.sensor is None else built.sensors[measurement.sensor]
            points = [built.attachments[one] for one in measurement.attachments]
            found[name] = (with_sensor(with_attached(assembly, *points), sensor, at), at)
    if problems.found:
        raise CampaignError("the campaign", problems.in_file())
    return found


def _build(data: dict[str, Any], problems: Problems, folder: Path | None) -> tuple[CampaignTable, Builder, Built]:
    """Return the tables and the objects built from them; data files are looked for if a folder is given."""
    expanded = expand_series(data, problems)
    problems.templates.update(expanded.templates)
    table = _validate(expanded.data, problems, expanded.broken, folder)
    builder = Builder(problems)
    return table, builder, builder.build(table)


def _find(path: Path) -> Path:
    file = path / FILE if path.is_dir() else path
    if file.is_file():
        return file
    if path.is_dir():
        raise FileNotFoundError(f"there is no {FILE} in the folder {path}")
    folder = path.parent
    near = difflib.get_close_matches(path.name, [p.name for p in folder.iterdir()], n=1) if folder.is_dir() else []
    hint = f"; did you mean {folder / near[0]}?" if near else ""
    raise FileNotFoundError(f"there is no campaign file {path}{hint}")


def _read(file: Path) -> tuple[dict[str, Any], dict[KeyPath, int]]:
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
        problem = Problem((), f"is not TOML: {what}{where}", int(match[1]) if match else None)
        raise CampaignError(file, [problem]) from None
    except RecursionError:
        raise CampaignError.about(file, _TOO_DEEP) from None
    except ValueError as error:  # a whole number with thousands of digits
        raise CampaignError.about(file, f"the file cannot be read: {str(error).partition(';')[0]}") from None
    try:
        lines = lines_of(text)
    except (ValueError, IndexError, RecursionError):  # the values are known; messages then have no lines
        lines = {}
    problems = Problems(lines)
    _check_values(data, problems)
    if problems.found:
        raise CampaignError(file, problems.in_file())
    return data, lines


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


def _validate(data: dict[str, Any], problems: Problems, unknown: frozenset[str], folder: Path | None) -> CampaignTable:
    """Return the tables without mistakes; tables with wrong references only are among them."""
    from pydantic import ValidationError

    named = {section: list(data[section]) if isinstance(data.get(section), dict) else [] for section in _SECTIONS}
    broken = {section for section in data if section in _SECTIONS and not isinstance(data[section], dict)}
    broken |= {section for section in _REQUIRED if section not in data and "cuts" not in data} | unknown
    _check_owners(named, problems)
    references: References | None = References(named, frozenset(broken), folder)
    rest = copy.deepcopy(data)
    if "cuts" in data:
        rest |= {section: {} for section in _REQUIRED if section not in data}
    for joint in rest["joints"].values() if isinstance(rest.get("joints"), dict) else ():
        if isinstance(joint, dict):
            joint.setdefault("kind", "point")
    while True:
        try:
            return CampaignTable.model_validate(rest, context=references)
        except ValidationError as error:
            found = translate(error.errors(), rest, CampaignTable)
        references = None  # all of them are checked
        for path, (text, _) in found.items():
            problems.add(path, text)
        for path, (_, only_reference) in found.items():
            if not only_reference:
                _prune(rest, path)


def _check_owners(named: dict[str, list[str]], problems: Problems) -> None:
    """Check that names of parts, joints, attachments and sensors, which begin addresses, are unique."""
    owner: dict[str, str] = {}
    for section in OWNERS:
        for name in named[section]:
            if name in owner:
                text = f"is also the name of one of the {owner[name]}, expected another name"
                problems.add((section, name), text)
            owner.setdefault(name, section)


def _prune(data: dict[str, Any], path: KeyPath) -> None:
    """Remove the table with a mistake, so that the rest can be checked."""
    section = str(path[0])
    table = data.get(section)
    if section in _SECTIONS and isinstance(table, dict) and len(path) > 1:
        table.pop(path[1], None)
    elif section in _REQUIRED:
        data[section] = {}
    else:
        data.pop(section, None)


def _places(table: CampaignTable, built: Built, builder: Builder) -> dict[str, tuple[Coordinate, Coordinate]]:
    """Return response and excitation at which assemblies without measurements are predicted."""
    measured = {measurement.assembly for measurement in table.measurements.values()}
    found: dict[str, tuple[Coordinate, Coordinate]] = {}
    for name, assembly in built.assemblies.items():
        if name not in measured:
            response = builder.place(("prediction", "response"), table.prediction.response, assembly)
            excitation = builder.place(("prediction", "excitation"), table.prediction.excitation, assembly)
            if response is not None and excitation is not None:
                found[name] = (response, excitation)
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


_WEIGHTS = {
    "frf": '`standard_deviation = "2 %"`, or coherence in the file and `averages`',
    "hammer records": 'at least two hits, whose scatter is the variance, or `floor = "2 %"`',
    "natural frequencies": '`standard_deviation = "1 Hz"`',
}
"""Source of the standard deviation of each kind of measurement."""


def _check_weights(measurements: dict[str, Measurement], table: CampaignTable, problems: Problems) -> None:
    """Check that all fitted measurements have standard deviations, or none."""
    if table.settings.objective == "percentage":
        return
    without: list[str] = []
    some = False
    for name, measured in measurements.items():
        if measured.held_out:
            continue
        seen = measured.observation
        spread = seen.standard_deviation if isinstance(seen, MeasuredFRF) else seen.standard_deviation_hz
        some = some or spread is not None
        without += [name] if spread is None else []
    for name in without if some else []:
        problems.add(
            ("measurements", name),
            "has no standard deviation, but other measurements have one, so their weights are not defined; expected "
            + _WEIGHTS[table.measurements[name].kind],
        )
