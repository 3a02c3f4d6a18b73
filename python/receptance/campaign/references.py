"""Names, addresses and files that a campaign refers to, looked up in the file as it stands.

It is looked at as it was read, not as it was checked: a table with one mistake may hold another, and both are to be
said.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

from receptance._text import did_you_mean
from receptance.campaign.addresses import kind_of, parse_position, value_at
from receptance.campaign.conditions import parse_condition
from receptance.campaign.levels import parse_level
from receptance.campaign.quantities import parse_deviation
from receptance.campaign.workshop import OWNERS, Workshop, expected
from receptance.identification.factors import FACTORS

if TYPE_CHECKING:
    from receptance.campaign.lines import Path

__all__ = ["check_references"]


def check_references(data: Mapping[str, Any], folder: FilePath | None, workshop: Workshop) -> None:
    """Add a mistake for every name, address, condition or file that leads nowhere.

    Parameters
    ----------
    data : dict
        The file as it was read.
    folder : Path or None
        Where its data files are; None where they are not to be sought.
    workshop : Workshop
        Mistakes are added there.
    """
    _check_names(workshop)
    for path, part in _tables(data, "parts"):
        for index, segment in enumerate(_list(part.get("segments"))):
            for key in ("material", "core"):
                _known((*path, "segments", index, key), segment, key, workshop, "materials")
    for path, joint in _tables(data, "joints"):
        for section in ("shank", "sleeve"):
            for key in ("material", "core"):
                _known((*path, section, key), joint.get(section), key, workshop, "materials")
    for path, attachment in _tables(data, "attachments"):
        _known((*path, "part"), attachment, "part", workshop, "parts")
    for path, assembly in _tables(data, "assemblies"):
        _check_assembly(path, assembly, workshop)
    for path, measurement in _tables(data, "measurements"):
        _check_measurement(path, measurement, folder, workshop)
    for path, candidate in _tables(data, "candidates"):
        _check_measurement(path, candidate, None, workshop)
    for path, cut in _tables(data, "cuts"):
        _check_cut(path, cut, folder, workshop)
    for path, unknown in _tables(data, "unknowns"):
        _check_unknown(path, unknown, workshop)
    _check_catalogue(_dict(data.get("catalogue")), folder, workshop)
    prediction = data.get("prediction")
    if isinstance(prediction, dict):
        _check_places(("prediction",), prediction, workshop)


def _check_assembly(path: Path, table: Mapping[str, Any], workshop: Workshop) -> None:
    # Few campaigns have modal parts, and messages name what a file has.
    chain = ("parts", "joints", *(("modal_parts",) if workshop.named["modal_parts"] else ()))
    for key, sections in (("chain", chain), ("attachments", ("attachments",))):
        for index, name in enumerate(_list(table.get(key))):
            if isinstance(name, str):
                workshop.known((*path, key, index), name, *sections)
    for address, text in _dict(table.get("set")).items():
        if isinstance(text, (str, int, float)):
            workshop.make((*path, "set", address), value_at, address, text)
    for address, text in _dict(table.get("tolerance")).items():
        workshop.make((*path, "tolerance", address), _deviation_at, address, text)
    _check_conditions(path, table, workshop)


def _check_measurement(path: Path, table: Mapping[str, Any], folder: FilePath | None, workshop: Workshop) -> None:
    _known((*path, "assembly"), table, "assembly", workshop, "assemblies")
    _known((*path, "sensor"), table, "sensor", workshop, "sensors")
    _check_places(path, table, workshop)
    _check_conditions(path, table, workshop)
    for index, name in enumerate(_list(table.get("attachments"))):
        if isinstance(name, str):
            workshop.known((*path, "attachments", index), name, "attachments")
    if folder is None:
        return
    _check_level(path, table, workshop)
    written = table.get("file")
    if isinstance(written, str):
        _check_file((*path, "file"), written, folder, workshop)
    if isinstance(table.get("coherence"), str):
        _check_file((*path, "coherence"), table["coherence"], folder, workshop)
    for index, name in enumerate(_list(written)):
        if isinstance(name, str):
            _check_file((*path, "file", index), name, folder, workshop)


def _check_cut(path: Path, table: Mapping[str, Any], folder: FilePath | None, workshop: Workshop) -> None:
    for key in ("x", "y"):
        tip = _dict(table.get(key))
        _known((*path, key, "assembly"), tip, "assembly", workshop, "assemblies")
        _known((*path, key, "measurement"), tip, "measurement", workshop, "measurements")
        for name in ("file", "coherence"):
            if folder is not None and isinstance(tip.get(name), str):
                _check_file((*path, key, name), tip[name], folder, workshop)


def _check_catalogue(table: Mapping[str, Any], folder: FilePath | None, workshop: Workshop) -> None:
    path: Path = ("catalogue",)
    for key, sections in (("machine", ("parts", "joints")), ("attachments", ("attachments",))):
        for index, name in enumerate(_list(table.get(key))):
            if key == "machine" and isinstance(name, str) and name in workshop.named["modal_parts"]:
                text = f'is "{name}", a modal part, which catalogues do not take from the campaign; expected parts and'
                text += ' joints here, or the spindle in a file of its own, named by `spindle = "FILE"`'
                workshop.problems.add((*path, key, index), text)
            elif isinstance(name, str):
                workshop.known((*path, key, index), name, *sections)
    _known((*path, "joint"), table, "joint", workshop, "joints")
    for key in ("tools", "holders"):
        if folder is not None and isinstance(table.get(key), str):
            _check_file((*path, key), table[key], folder, workshop)


def _check_file(path: Path, name: str, folder: FilePath, workshop: Workshop) -> None:
    file = folder / name
    if file.is_file():
        return
    what = "is a folder" if file.is_dir() else "is not there"
    near = [other.name for other in sorted(file.parent.iterdir())] if file.parent.is_dir() else []
    text = f'is "{name}", which {what}, expected a data file in {folder.resolve()}'
    workshop.problems.add(path, text + did_you_mean(file.name, near))


def _check_unknown(path: Path, table: Mapping[str, Any], workshop: Workshop) -> None:
    address = str(path[-1])
    for index, name in enumerate(_list(table.get("assemblies"))):
        if isinstance(name, str):
            workshop.known((*path, "assemblies", index), name, "assemblies")
    moves = _dict(table.get("moves"))
    for key in ("also", "moves"):
        for other in _dict(table.get(key)):
            _check_address((*path, key, other), other, workshop)
    if moves or not _check_address(path, address, workshop) or table.get("multiple") is not None:
        return
    for key in ("lower", "upper", "start"):
        if isinstance(table.get(key), (str, int, float)):
            workshop.make((*path, key), value_at, address, table[key])


def _check_address(path: Path, address: str, workshop: Workshop) -> bool:
    """Return whether an address has the form of one; add a mistake where its owner is unknown."""
    if workshop.make(path, kind_of, address) is None:
        return False
    owner = address.split(".", 1)[0]
    known = [name for section in OWNERS for name in workshop.named[section]]
    if owner not in known and address not in FACTORS and not workshop.blind(*OWNERS):
        text = f'begins with "{owner}", which is not a part, joint, attachment or sensor of this file'
        workshop.problems.add(path, text + expected(owner, known))
    return True


def _check_level(path: Path, table: Mapping[str, Any], workshop: Workshop) -> None:
    level = table.get("level")
    if isinstance(level, (str, int, float)) and not isinstance(level, bool):
        workshop.make((*path, "level"), parse_level, level)
    if level is not None and table.get("force") is not None:
        workshop.problems.add((*path, "level"), "is given with a force, which says the level, expected one of the two")


def _check_names(workshop: Workshop) -> None:
    """Parts, joints, attachments and sensors share one space of names, because addresses begin with them."""
    owner: dict[str, str] = {}
    for section in OWNERS:
        for name in workshop.named[section]:
            if name in owner:
                text = f"is the name of one of the {owner[name]} too, expected another name"
                workshop.problems.add((section, name), text)
            owner.setdefault(name, section)


def _check_places(path: Path, table: Mapping[str, Any], workshop: Workshop) -> None:
    for key in ("response", "excitation"):
        place = _dict(table.get(key))
        _known((*path, key, "part"), place, "part", workshop, "parts")
        if isinstance(place.get("position"), str):
            workshop.make((*path, key, "position"), parse_position, place["position"])


def _check_conditions(path: Path, table: Mapping[str, Any], workshop: Workshop) -> None:
    for key, written in _dict(table.get("conditions")).items():
        if isinstance(written, (str, int, float)):
            workshop.make((*path, "conditions", key), parse_condition, written)


def _deviation_at(address: str, written: Any) -> object:
    return parse_deviation(written, kind_of(address))


def _known(path: Path, table: Any, key: str, workshop: Workshop, section: str) -> None:
    name = table.get(key) if isinstance(table, Mapping) else None
    if isinstance(name, str) and (name or key != "part"):
        workshop.known(path, name, section)


def _tables(data: Mapping[str, Any], section: str) -> Iterator[tuple[Path, Mapping[str, Any]]]:
    for name, table in _dict(data.get(section)).items():
        if isinstance(table, dict):
            yield (section, name), table


def _dict(value: Any) -> Mapping[str, Any]:
    return value if isinstance(value, dict) else {}


def _list(value: Any) -> list[Any]:
    return value if isinstance(value, list) else []
