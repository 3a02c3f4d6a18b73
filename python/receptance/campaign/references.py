"""Check of the names, addresses and files that a campaign refers to.

The raw contents of the file are checked, not the validated tables, so that all mistakes of a table are reported.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from receptance._text import did_you_mean, instead_of
from receptance.campaign.builder import OWNERS, Builder
from receptance.campaign.quantities import kind_of
from receptance.identification.mapping import FACTORS

if TYPE_CHECKING:
    from receptance.campaign.lines import KeyPath

__all__ = ["check_references"]


def check_references(data: Mapping[str, Any], folder: Path | None, builder: Builder) -> None:
    """Add a mistake for every name, address or file that does not exist.

    Parameters
    ----------
    data : dict
        Contents of the file.
    folder : Path or None
        Folder of the data files; None if they are not checked.
    builder : Builder
        Builder to which mistakes are added.
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


def _check_assembly(path: KeyPath, table: Mapping[str, Any], builder: Builder) -> None:
    # Messages mention modal parts only if the file has some.
    chain = ("parts", "joints", *(("modal_parts",) if builder.named["modal_parts"] else ()))
    for key, sections in (("chain", chain), ("attachments", ("attachments",))):
        for index, name in enumerate(_list(table.get(key))):
            if isinstance(name, str):
                builder.check_name((*path, key, index), name, *sections)


def _check_measurement(path: KeyPath, table: Mapping[str, Any], folder: Path | None, builder: Builder) -> None:
    _known((*path, "assembly"), table, "assembly", builder, "assemblies")
    _known((*path, "sensor"), table, "sensor", builder, "sensors")
    _check_places(path, table, builder)
    for index, name in enumerate(_list(table.get("attachments"))):
        if isinstance(name, str):
            builder.check_name((*path, "attachments", index), name, "attachments")
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


def _check_cut(path: KeyPath, table: Mapping[str, Any], folder: Path | None, builder: Builder) -> None:
    for key in ("x", "y"):
        tip = _dict(table.get(key))
        _known((*path, key, "assembly"), tip, "assembly", builder, "assemblies")
        _known((*path, key, "measurement"), tip, "measurement", builder, "measurements")
        for name in ("file", "coherence"):
            if folder is not None and isinstance(tip.get(name), str):
                _check_file((*path, key, name), tip[name], folder, builder)


def _check_catalogue(table: Mapping[str, Any], folder: Path | None, builder: Builder) -> None:
    path: KeyPath = ("catalogue",)
    for key, sections in (("machine", ("parts", "joints")), ("attachments", ("attachments",))):
        for index, name in enumerate(_list(table.get(key))):
            if key == "machine" and isinstance(name, str) and name in builder.named["modal_parts"]:
                text = f'is "{name}", a modal part, which `machine` cannot contain; expected parts and joints, or the'
                text += ' spindle in a file of its own, named by `spindle = "FILE"`'
                builder.problems.add((*path, key, index), text)
            elif isinstance(name, str):
                builder.check_name((*path, key, index), name, *sections)
    _known((*path, "joint"), table, "joint", builder, "joints")
    for key in ("tools", "holders"):
        if folder is not None and isinstance(table.get(key), str):
            _check_file((*path, key), table[key], folder, builder)


def _check_file(path: KeyPath, name: str, folder: Path, builder: Builder) -> None:
    file = folder / name
    if file.is_file():
        return
    what = "is a folder" if file.is_dir() else "does not exist"
    near = [other.name for other in sorted(file.parent.iterdir())] if file.parent.is_dir() else []
    text = f'is "{name}", which {what}, expected a data file in {folder.resolve()}'
    builder.problems.add(path, text + did_you_mean(file.name, near))


def _check_unknown(path: KeyPath, table: Mapping[str, Any], builder: Builder) -> None:
    address = str(path[-1])
    for index, name in enumerate(_list(table.get("assemblies"))):
        if isinstance(name, str):
            builder.check_name((*path, "assemblies", index), name, "assemblies")
    moves = _dict(table.get("moves"))
    for key in ("also", "moves"):
        for other in _dict(table.get(key)):
            _check_address((*path, key, other), other, builder)
    if not moves:
        _check_address(path, address, builder)


def _check_address(path: KeyPath, address: str, builder: Builder) -> None:
    """Add a mistake if a text is not an address, or its owner is unknown."""
    if builder.make(path, kind_of, address) is None:
        return
    owner = address.split(".", 1)[0]
    known = [name for section in OWNERS for name in builder.named[section]]
    if owner not in known and address not in FACTORS and not builder.incomplete(*OWNERS):
        text = f'begins with "{owner}", which is not a part, joint, attachment or sensor of this file'
        builder.problems.add(path, text + instead_of(owner, known))


def _check_level(path: KeyPath, table: Mapping[str, Any], builder: Builder) -> None:
    if table.get("level") is not None and table.get("force") is not None:
        builder.problems.add((*path, "level"), "is given with a force, which determines it, expected one of the two")


def _check_names(builder: Builder) -> None:
    """Check that names of parts, joints, attachments and sensors, which begin addresses, are unique."""
    owner: dict[str, str] = {}
    for section in OWNERS:
        for name in builder.named[section]:
            if name in owner:
                text = f"is also the name of one of the {owner[name]}, expected another name"
                builder.problems.add((section, name), text)
            owner.setdefault(name, section)


def _check_places(path: KeyPath, table: Mapping[str, Any], builder: Builder) -> None:
    for key in ("response", "excitation"):
        place = _dict(table.get(key))
        _known((*path, key, "part"), place, "part", builder, "parts")


def _known(path: KeyPath, table: Any, key: str, builder: Builder, section: str) -> None:
    name = table.get(key) if isinstance(table, Mapping) else None
    if isinstance(name, str) and (name or key != "part"):
        builder.check_name(path, name, section)


def _tables(data: Mapping[str, Any], section: str) -> Iterator[tuple[KeyPath, Mapping[str, Any]]]:
    for name, table in _dict(data.get(section)).items():
        if isinstance(table, dict):
            yield (section, name), table


def _dict(value: Any) -> Mapping[str, Any]:
    return value if isinstance(value, dict) else {}


def _list(value: Any) -> list[Any]:
    return value if isinstance(value, list) else []
