"""Names, addresses and files that a campaign refers to, looked up in the file as it stands.

It is looked at as it was read, not as it was checked: a table with one mistake may hold another, and both are to be
said.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path as FilePath
from typing import TYPE_CHECKING, Any

from receptance._text import did_you_mean
from receptance.campaign.addresses import kind_of
from receptance.campaign.builder import OWNERS, Builder, expected
from receptance.identification.factors import FACTORS

if TYPE_CHECKING:
    from receptance.campaign.lines import Path

__all__ = ["check_references"]


def check_references(data: Mapping[str, Any], folder: FilePath | None, builder: Builder) -> None:
    """Add a mistake for every name, address, condition or file that leads nowhere.

    Parameters
    ----------
    data : dict
        The file as it was read.
    folder : Path or None
        Where its data files are; None where they are not to be sought.
    builder : Builder
        Mistakes are added there.
    """
    _check_names(builder)
    for path, part in _tables(data, "parts"):
        for index, segment in enumerate(_list(part.get("segments"))):
            for key in ("material", "core"):
                _known((*path, "segments", index, key), segment, key, builder, "materials")
    for path, joint in _tables(data, "joints"):
        for section in ("shank", "sleeve"):
            for key in ("material", "core"):
                _known((*path, section, key), joint.get(section), key, builder, "materials")
    for path, attachment in _tables(data, "attachments"):
        _known((*path, "part"), attachment, "part", builder, "parts")
    for path, assembly in _tables(data, "assemblies"):
        _check_assembly(path, assembly, builder)
    for path, measurement in _tables(data, "measurements"):
        _check_measurement(path, measurement, folder, builder)
    for path, candidate in _tables(data, "candidates"):
        _check_measurement(path, candidate, None, builder)
    for path, cut in _tables(data, "cuts"):
        _check_cut(path, cut, folder, builder)
    for path, unknown in _tables(data, "unknowns"):
        _check_unknown(path, unknown, builder)
    _check_catalogue(_dict(data.get("catalogue")), folder, builder)
    prediction = data.get("prediction")
    if isinstance(prediction, dict):
        _check_places(("prediction",), prediction, builder)


def _check_assembly(path: Path, table: Mapping[str, Any], builder: Builder) -> None:
    # Few campaigns have modal parts, and messages name what a file has.
    chain = ("parts", "joints", *(("modal_parts",) if builder.named["modal_parts"] else ()))
    for key, sections in (("chain", chain), ("attachments", ("attachments",))):
        for index, name in enumerate(_list(table.get(key))):
            if isinstance(name, str):
                builder.known((*path, key, index), name, *sections)


def _check_measurement(path: Path, table: Mapping[str, Any], folder: FilePath | None, builder: Builder) -> None:
    _known((*path, "assembly"), table, "assembly", builder, "assemblies")
    _known((*path, "sensor"), table, "sensor", builder, "sensors")
    _check_places(path, table, builder)
    for index, name in enumerate(_list(table.get("attachments"))):
        if isinstance(name, str):
            builder.known((*path, "attachments", index), name, "attachments")
    if folder is None:
        return
    _check_level(path, table, builder)
    written = table.get("file")
    if isinstance(written, str):
        _check_file((*path, "file"), written, folder, builder)
    if isinstance(table.get("coherence"), str):
        _check_file((*path, "coherence"), table["coherence"], folder, builder)
    for index, name in enumerate(_list(written)):
        if isinstance(name, str):
            _check_file((*path, "file", index), name, folder, builder)


def _check_cut(path: Path, table: Mapping[str, Any], folder: FilePath | None, builder: Builder) -> None:
    for key in ("x", "y"):
        tip = _dict(table.get(key))
        _known((*path, key, "assembly"), tip, "assembly", builder, "assemblies")
        _known((*path, key, "measurement"), tip, "measurement", builder, "measurements")
        for name in ("file", "coherence"):
            if folder is not None and isinstance(tip.get(name), str):
                _check_file((*path, key, name), tip[name], folder, builder)


def _check_catalogue(table: Mapping[str, Any], folder: FilePath | None, builder: Builder) -> None:
    path: Path = ("catalogue",)
    for key, sections in (("machine", ("parts", "joints")), ("attachments", ("attachments",))):
        for index, name in enumerate(_list(table.get(key))):
            if key == "machine" and isinstance(name, str) and name in builder.named["modal_parts"]:
                text = f'is "{name}", a modal part, which catalogues do not take from the campaign; expected parts and'
                text += ' joints here, or the spindle in a file of its own, named by `spindle = "FILE"`'
                builder.problems.add((*path, key, index), text)
            elif isinstance(name, str):
                builder.known((*path, key, index), name, *sections)
    _known((*path, "joint"), table, "joint", builder, "joints")
    for key in ("tools", "holders"):
        if folder is not None and isinstance(table.get(key), str):
            _check_file((*path, key), table[key], folder, builder)


def _check_file(path: Path, name: str, folder: FilePath, builder: Builder) -> None:
    file = folder / name
    if file.is_file():
        return
    what = "is a folder" if file.is_dir() else "is not there"
    near = [other.name for other in sorted(file.parent.iterdir())] if file.parent.is_dir() else []
    text = f'is "{name}", which {what}, expected a data file in {folder.resolve()}'
    builder.problems.add(path, text + did_you_mean(file.name, near))


def _check_unknown(path: Path, table: Mapping[str, Any], builder: Builder) -> None:
    address = str(path[-1])
    for index, name in enumerate(_list(table.get("assemblies"))):
        if isinstance(name, str):
            builder.known((*path, "assemblies", index), name, "assemblies")
    moves = _dict(table.get("moves"))
    for key in ("also", "moves"):
        for other in _dict(table.get(key)):
            _check_address((*path, key, other), other, builder)
    if not moves:
        _check_address(path, address, builder)


def _check_address(path: Path, address: str, builder: Builder) -> None:
    """Add a mistake where an address does not have the form of one, or its owner is unknown."""
    if builder.make(path, kind_of, address) is None:
        return
    owner = address.split(".", 1)[0]
    known = [name for section in OWNERS for name in builder.named[section]]
    if owner not in known and address not in FACTORS and not builder.blind(*OWNERS):
        text = f'begins with "{owner}", which is not a part, joint, attachment or sensor of this file'
        builder.problems.add(path, text + expected(owner, known))


def _check_level(path: Path, table: Mapping[str, Any], builder: Builder) -> None:
    if table.get("level") is not None and table.get("force") is not None:
        builder.problems.add((*path, "level"), "is given with a force, which says the level, expected one of the two")


def _check_names(builder: Builder) -> None:
    """Parts, joints, attachments and sensors share one space of names, because addresses begin with them."""
    owner: dict[str, str] = {}
    for section in OWNERS:
        for name in builder.named[section]:
            if name in owner:
                text = f"is the name of one of the {owner[name]} too, expected another name"
                builder.problems.add((section, name), text)
            owner.setdefault(name, section)


def _check_places(path: Path, table: Mapping[str, Any], builder: Builder) -> None:
    for key in ("response", "excitation"):
        place = _dict(table.get(key))
        _known((*path, key, "part"), place, "part", builder, "parts")


def _known(path: Path, table: Any, key: str, builder: Builder, section: str) -> None:
    name = table.get(key) if isinstance(table, Mapping) else None
    if isinstance(name, str) and (name or key != "part"):
        builder.known(path, name, section)


def _tables(data: Mapping[str, Any], section: str) -> Iterator[tuple[Path, Mapping[str, Any]]]:
    for name, table in _dict(data.get(section)).items():
        if isinstance(table, dict):
            yield (section, name), table


def _dict(value: Any) -> Mapping[str, Any]:
    return value if isinstance(value, dict) else {}


def _list(value: Any) -> list[Any]:
    return value if isinstance(value, list) else []
