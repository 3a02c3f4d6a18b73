"""Writing of a campaign file: tables of elements and unknowns, and the extended model of a diagnosis."""

from __future__ import annotations

import copy
import os
import re
import warnings
from collections.abc import Iterable, Mapping
from dataclasses import MISSING, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import tomli_w

from receptance import units
from receptance._files import write_whole
from receptance.campaign.build import addresses_of
from receptance.campaign.data import CampaignData
from receptance.campaign.diagnosis import base_model
from receptance.campaign.identification import parts_to_start
from receptance.campaign.schema import ATTACHMENTS, JOINTS
from receptance.campaign.shapes import shape_keys
from receptance.campaign.values import PLAIN_NUMBER, kind_of
from receptance.diagnosis import Verdict
from receptance.diagnosis.causes import Variant, transfer
from receptance.diagnosis.explanation import Explanation
from receptance.diagnosis.fitting import Fit
from receptance.diagnosis.model import Model
from receptance.diagnosis.text import title_of
from receptance.errors import ReceptanceWarning
from receptance.fit.observation import Observation, altered
from receptance.fit.spindle_errors import has_spindle_errors
from receptance.fit.unknowns import Law, Move, Tolerance, Unknown, covered
from receptance.model.assembly import Assembly
from receptance.model.beams import Material, Part
from receptance.model.coordinates import Coordinate
from receptance.model.fields import Element, Member
from receptance.model.joints import GroundSpring, PointMass, Resonator
from receptance.model.terminals import ModalPart


class _Materials:
    """Names of the materials that the file has, `known`, and tables of those that are added to it."""

    def __init__(self, known: Iterable[str] = ()) -> None:
        self._known = set(known)
        self._made: list[tuple[Material, str]] = []
        self.added: dict[str, dict[str, Any]] = {}

    def name_of(self, material: Material) -> str:
        """Return the name of a material in the file, which is added if it is new."""
        if material.name in self._known:
            return material.name
        for made, name in self._made:
            if made == material:
                return name
        base = name = material.name or "material"
        number = 2
        while name in self._known or name in self.added:
            name, number = f"{base} {number}", number + 1
        self._made.append((material, name))
        self.added[name] = _field_table(material, self)
        return name


def _element_table(element: Any, materials: _Materials) -> dict[str, Any]:
    """Return the table of a part, a joint or a modal part, without tolerances; new materials are added."""
    if isinstance(element, Part):
        return {
            "segments": [{**_field_table(segment, materials), **shape_keys(segment)} for segment in element.segments]
        }
    if isinstance(element, ModalPart):
        if element.band_hz is not None:
            raise ValueError(f"{element!r} has a frequency band, which the table of a modal part cannot contain")
        modes = [_field_table(mode, materials) for mode in element.modes]
        return {"modes": modes, **_field_table(element, materials)}
    kind = JOINTS.kind_of(element)
    if kind is None:
        raise ValueError(f"{element!r} cannot be written as a table of a campaign")
    return {**({"kind": kind} if kind != "point" else {}), **_field_table(element, materials)}


def attachment_table(point: PointMass | GroundSpring | Resonator) -> dict[str, Any]:
    """Return the table of a mass, a resonator or a ground spring at a point.

    Raises
    ------
    ValueError
        The ground spring is distributed along a part.
    """
    if getattr(point, "length", 0.0):
        raise ValueError(f"{point!r} is distributed along a part and cannot be written as a table of a campaign")
    place = {"kind": ATTACHMENTS.kind_of(point), "part": point.part, "position": _POSITION.write(point.position)}
    return {**place, **_field_table(point, _Materials())}


def _field_table(element: Element, materials: _Materials) -> dict[str, Any]:
    """Return the fields of an element that differ from their defaults; new materials are added."""
    table: dict[str, Any] = {}
    for name, of in element.declared.items():
        value = getattr(element, name)
        if name in ("name", "shape") or value == getattr(type(element), name, MISSING):
            continue
        if not isinstance(of, Member):
            table[name] = of.write(value)
        else:
            table[name] = materials.name_of(value) if of.kind is Material else _field_table(value, materials)
    return table


def _unknown_table(unknown: Unknown, start: float) -> dict[str, Any]:
    """Return the table of an unknown with a start value."""
    if isinstance(unknown, Law):
        raise ValueError(f"{unknown!r} cannot be written as a table of a campaign")
    plain = isinstance(unknown, Move) or unknown.multiple != 1.0
    kind = PLAIN_NUMBER if plain else kind_of(unknown.address)
    start = min(max(start, unknown.lower), unknown.upper)
    table: dict[str, Any] = {"lower": kind.text(unknown.lower), "upper": kind.text(unknown.upper)}
    table |= {"start": kind.text(start), "scale": unknown.scale}
    if (prior := unknown.prior) is not None:
        share = f"{100.0 * prior.standard_deviation!r} %"
        spread = share if unknown.scale == "log" else kind.text(prior.standard_deviation)
        table["prior"] = {"value": kind.text(prior.mean), "spread": spread}
    if unknown.configurations is not None:
        table["assemblies"] = list(unknown.configurations)
    if unknown.labels is not None:
        table["measurements"] = list(unknown.labels)
    if isinstance(unknown, Move):
        table |= {"moves": dict(unknown.moves), "relative": unknown.relative}
        return {**table, **({"power_of": unknown.of, "reference": unknown.reference} if unknown.of else {})}
    if unknown.name != unknown.address:
        table["name"] = unknown.name
    if unknown.multiple != 1.0:
        table["multiple"] = unknown.multiple
    return {**table, **({"also": dict(unknown.also)} if unknown.also else {})}


_SAME = 1e-6
"""Relative difference of chi-square up to which the file and the diagnosed model are the same."""
_POSITION = PointMass.declared["position"]
_ORDERS = (1, 2, -1, -2)
_OF_THE_PLACE = ("assembly", "role", "sensor", "attachments", "response", "excitation", "conditions")
"""Keys of a measurement that do not describe its file."""
_OTHER = {"sensors": "attachments", "attachments": "sensors"}


@dataclass(frozen=True, eq=False)
class _Extended:
    """An observation before and after the causes change it, its errors with them, and temporary attachments."""

    given: Observation
    found: Observation
    tolerances: tuple[Tolerance, ...]
    temporary: tuple[str, ...]

    @property
    def assembly(self) -> Assembly:
        """The assembly with the causes."""
        return self.found.assembly

    @property
    def changed(self) -> set[str]:
        """Names of the elements that the causes change or add."""
        before = self.given.assembly.elements
        return {
            name
            for name, element in self.assembly.elements.items()
            if type(element) is not type(before.get(name)) or element != before.get(name)
        }

    def added(self, *, temporary: bool) -> list[str]:
        """Return the attachments that causes add, during this measurement only or always."""
        own = [name for name in self.assembly.attachments if name not in self.given.assembly.attachments]
        return [name for name in own if (name in self.temporary) == temporary]


def extended_text(campaign: CampaignData, verdict: Verdict, folder: Path) -> str:
    """Return the model that a diagnosis has extended as the text of a campaign file.

    The file is identified and predicted like any other. Start values are the results of the diagnosis.

    Parameters
    ----------
    campaign : Campaign
        The campaign.
    verdict : Verdict
        Result of its diagnosis.
    folder : Path
        Folder of the new file; paths of data files are relative to it.

    Raises
    ------
    ValueError
        There is no extended model, or a campaign file cannot describe it.
    """
    return tomli_w.dumps(_extended(campaign, verdict, folder))


def write_extended(campaign: CampaignData, verdict: Verdict, path: str | Path) -> Path:
    """Write the model that a diagnosis has extended as a campaign file, completely or not at all.

    Parameters and errors are those of `extended_text`; `path` is that of the new file, which is returned.
    """
    target = Path(path)
    write_whole({target: extended_text(campaign, verdict, target.parent).encode("utf-8")})
    return target


def _extended(campaign: CampaignData, verdict: Verdict, folder: Path) -> dict[str, Any]:
    """Return the contents of the extended file."""
    base, explanation = verdict.selection.base.model, verdict.explanation
    if explanation is None:
        raise ValueError(f"there is no extended model, because the verdict is {verdict.verdict}")
    # A cause may act at one level only, so that each level has its own tables.
    data = copy.deepcopy(campaign.contents)
    measured = {
        name: _applied(base, explanation.variants, observation, campaign.errors_of([name]))
        for name, observation in campaign.measurements.items()
    }
    described = [name for name in campaign.assemblies if name not in campaign.blanks]
    assemblies = {name: _of_assembly(campaign, base, explanation, name) for name in described}
    _write_structure(data, campaign, assemblies, {a for u in explanation.fit.model.unknowns for a in addresses_of(u)})
    seen = {observation.label for observation in base.observations}
    for name, measurement in measured.items():
        _write_measurement(data, name, measurement, name in seen)
    _exchange_files(data, {name: measurement.found.label for name, measurement in measured.items()})
    for name in parts_to_start(campaign):
        _write_modes(data, name, explanation.fit)
    _write_unknowns(data, base, explanation)
    _rebase_files(data, campaign.file.parent, folder)
    data["settings"] = {**data.get("settings", {}), "starts": 1}
    data["settings"].pop("strategy", None)
    data["settings"].pop("objective", None)
    names = " and ".join(variant.cause.title for variant in explanation.variants)
    data["title"] = f"{campaign.title}, extended by {names}"
    alike = (
        f"; indistinguishable causes: {', '.join(title_of(id) for id in verdict.ambiguous_between)}"
        if verdict.ambiguous_between
        else ""
    )
    own = data.get("description", "")
    data["description"] = f"{own} Written by `receptance diagnose` ({verdict.verdict}: {names}{alike}).".strip()
    order = ["format", "title", "description", "settings", "prediction"]
    data = {key: data[key] for key in (*(k for k in order if k in data), *(k for k in data if k not in order))}
    _check(campaign, explanation.fit, data, folder, with_discrepancy=verdict.discrepancy is not None)
    return data


def _applied(
    base: Model,
    variants: Iterable[Variant],
    observation: Observation,
    tolerances: Iterable[Tolerance],
) -> _Extended:
    """Apply causes to an observation, one after the other."""
    model = replace(base, observations=(observation,), tolerances=tuple(tolerances))
    temporary: list[str] = []
    for variant in variants:
        before = set(model.observations[0].assembly.attachments)
        model = transfer(model, [variant])
        if variant.cause.group == "measurement" and not variant.cause.changes_data:
            temporary += [
                attachment for attachment in model.observations[0].assembly.attachments if attachment not in before
            ]
    return _Extended(observation, model.observations[0], model.tolerances, tuple(temporary))


def _of_assembly(campaign: CampaignData, base: Model, explanation: Explanation, name: str) -> _Extended:
    """Apply the causes of an explanation to an assembly without sensors."""
    assembly = campaign.assemblies[name]
    own = [observation for observation in campaign.measurements.values() if observation.configuration == name]
    like = next((observation for observation in own if observation.is_receptance), own[0] if own else None)
    if like is None:
        like = next(iter(campaign.measurements.values()))
        if like.is_receptance:
            response, excitation = campaign.places.get(name, (Coordinate(), Coordinate()))
            like = altered(like, response=response, excitation=excitation)
    site = campaign.site(name)
    bare = altered(like, assembly=assembly, configuration=name, label=name, conditions=site.conditions)
    # A change of the data is none of the assembly.
    structural = tuple(variant for variant in explanation.variants if not variant.cause.changes_data)
    return _applied(base, structural, bare, campaign.tolerances.get(name, ()))


def _write_structure(
    data: dict[str, Any], campaign: CampaignData, assemblies: Mapping[str, _Extended], unknown: set[str]
) -> None:
    """Write the elements that causes have changed, and the values in which assemblies differ."""
    materials = _Materials(campaign.table.materials)
    tables: dict[str, tuple[Assembly, dict[str, Any]]] = {}
    changed = {name for extended in assemblies.values() for name in extended.changed}
    # Where a tool or a holder is changed, all of them are written with the shank in the bore.
    shanks = {title: shank.insertion for title, shank in campaign.built.insertions.items() if title in assemblies}
    inserted = {part.name for insertion in shanks.values() for part in (insertion.tool, insertion.holder)}
    if changed & inserted:
        changed |= inserted
        for title in shanks:
            del data["assemblies"][title]["insertion"]
    for extended in assemblies.values():
        for name, element in extended.assembly.elements.items():
            if name not in tables and name in changed:
                tables[name] = (extended.assembly, _element_table(element, materials))
    for name, (_, table) in tables.items():
        section = "parts" if "segments" in table else "modal_parts" if "modes" in table else "joints"
        data.setdefault(section, {})[name] = table
    for title, extended in assemblies.items():
        _write_assembly(data, title, extended, {name: base for name, (base, _) in tables.items()}, unknown)
    if materials.added:
        data.setdefault("materials", {}).update(materials.added)


def _write_assembly(
    data: dict[str, Any], title: str, one: _Extended, bases: Mapping[str, Assembly], unknown: set[str]
) -> None:
    table, assembly = data["assemblies"][title], one.assembly
    owners = {name for name in assembly.elements if name in bases}
    table["chain"] = list(assembly.elements)
    added = one.added(temporary=False)
    for name in added:
        data.setdefault("attachments", {})[name] = attachment_table(assembly.attachments[name])
    if added:
        table["attachments"] = [*table.get("attachments", []), *added]
    _write_moved(data, one)
    identified = {own for address in unknown for own in covered(address, assembly)}
    for key in ("set", "tolerance"):
        kept = table.get(key, {})
        table[key] = {
            address: written
            for address, written in kept.items()
            if address.split(".", 1)[0] not in owners and not covered(address, assembly) & identified
        }
    for address in assembly.parameters:
        owner = address.split(".", 1)[0]
        if owner not in owners or address in identified:
            continue
        if owner not in bases[owner].elements or address not in bases[owner].parameters:
            raise ValueError(f"{owner} has other parameters in {title}, which a campaign file cannot describe")
        value = assembly.get(address)
        if value != bases[owner].get(address):
            table["set"][address] = kind_of(address).text(value)
    for error in one.tolerances:
        for address, deviation in error.moves.items():
            if address.split(".", 1)[0] in owners and address not in identified:
                share = f"{100.0 * abs(deviation):.15g} %"
                written = share if error.relative else kind_of(address).text(abs(deviation))
                table["tolerance"][address] = {"value": written, "name": error.name}
    fresh = {k: v for k, v in one.found.conditions.items() if k not in one.given.conditions}
    if fresh:
        table["conditions"] = {**table.get("conditions", {}), **fresh}
    for key in ("set", "tolerance"):
        if not table[key]:
            del table[key]


def _write_moved(data: dict[str, Any], one: _Extended) -> None:
    """Write attachments whose position changes with the beginning of their part; sensors follow the response."""
    for name, point in one.assembly.attachments.items():
        if name in data.get("attachments", {}) and one.given.assembly.attachments.get(name, point) != point:
            data["attachments"][name] = attachment_table(point)


def _write_measurement(data: dict[str, Any], name: str, one: _Extended, seen: bool) -> None:
    table = data["measurements"][name]
    if seen:
        table["role"] = "identify"
    for attached in one.added(temporary=True):
        _write_temporary(data, name, attached, one)
    _write_moved(data, one)
    given, found = one.given, one.found
    if not given.is_receptance or not found.is_receptance:
        return
    if found.ends is not None and found.ends != given.ends:
        table["ends"] = units.TIME.text(found.ends)
    for side in ("response", "excitation"):
        old, new = getattr(given, side), getattr(found, side)
        if (old.part, old.position) != (new.part, new.position):
            table[side] = {**table.get(side, {}), "part": new.part, "position": _POSITION.write(new.position)}
    if np.array_equal(found.receptance, -given.receptance):
        own = table.get("response", {})
        direction = own.get("direction", "+y")
        table["response"] = {**own, "direction": direction.translate(str.maketrans("+-", "-+"))}
        return
    if np.array_equal(found.receptance, given.receptance.conj()) and not np.array_equal(
        found.receptance, given.receptance
    ):
        table["conjugate"] = not table.get("conjugate", False)
        return
    times = _integrations(given, found)
    if times:
        table["integrate"] = int(table.get("integrate", 0)) + times


def _exchange_files(data: dict[str, Any], labels: Mapping[str, str]) -> None:
    """Write the data of each measurement into the table of another one, whose structure and places stay."""
    tables = {name: data["measurements"][name] for name in labels}
    for name, label in labels.items():
        if label != name:
            places = {key: value for key, value in tables[label].items() if key in _OF_THE_PLACE}
            values = {key: value for key, value in tables[name].items() if key not in _OF_THE_PLACE}
            data["measurements"][label] = {**places, **values}


def _write_temporary(data: dict[str, Any], name: str, attached: str, one: _Extended) -> None:
    """Write an attachment of one measurement, as its sensor if it is a mass at the response coordinate."""
    table, point = data["measurements"][name], one.assembly.attachments[attached]
    made = attachment_table(point)
    place = one.found.response if one.found.is_receptance else Coordinate()
    section = "attachments"
    at_response = made["kind"] == "mass" and (point.part, point.position) == (place.part, place.position)
    if at_response and "sensor" not in table:
        section, made = "sensors", {key: made[key] for key in ("mass", "inertia") if key in made}
    # An attachment that is written differently for different measurements has a name for each form.
    names = _names_of(data, attached)
    same = [name for name in names if data.get(section, {}).get(name) == made]
    attached = same[0] if same else f"{attached}_{len(names) + 1}" if names else attached
    if section == "sensors":
        table["sensor"] = attached
    else:
        table["attachments"] = [*table.get("attachments", []), attached]
    data.setdefault(section, {})[attached] = made


def _names_of(data: Mapping[str, Any], attached: str) -> list[str]:
    """Return the names under which an attachment of a cause is written."""
    tables = [name for section in _OTHER for name in data.get(section, {})]
    return [name for name in tables if name == attached or re.fullmatch(rf"{attached}_\d+", name)]


def _integrations(given: Observation, found: Observation) -> int:
    """Return the number of integrations by which a cause has changed the motion of a measurement."""
    if np.array_equal(given.receptance, found.receptance):
        return 0
    angular = 2j * np.pi * given.frequency_hz
    for order in _ORDERS:
        if np.allclose(found.receptance * angular**order, given.receptance, rtol=1e-9, atol=0.0):
            return order
    raise ValueError(f"{given!r}: a cause changes its data in a way that a campaign file cannot describe")


def _write_modes(data: dict[str, Any], name: str, fit: Fit) -> None:
    """Write the modal part of an unknown spindle with the modes of a fit, whose numbers are among the unknowns."""
    spindle = next(o.assembly.elements[name] for o in fit.model.observations if name in o.assembly.elements)
    if not isinstance(spindle, ModalPart):
        raise TypeError(f"{name!r} is {spindle!r}, expected a modal part")
    numbers = {
        unknown.address.removeprefix(f"{name}."): fit.values[unknown.name]
        for unknown in fit.model.unknowns
        if unknown.address.startswith(f"{name}.")
    }
    count = sum(f"mode[{i}].frequency_hz" in numbers for i in range(len(spindle.modes)))
    written = replace(spindle, modes=spindle.modes[:count]).with_values(numbers)
    data["modal_parts"][name] = _element_table(written, _Materials())


def _write_unknowns(data: dict[str, Any], base: Model, explanation: Explanation) -> None:
    """Write the unknowns with the results of the diagnosis as start values."""
    values = explanation.fit.values
    known = {unknown.name: unknown for unknown in base.unknowns}
    written = dict(data.get("unknowns", {}))
    tables: dict[str, Any] = {}
    measured = list(dict.fromkeys(table["assembly"] for table in data["measurements"].values()))
    of_measurement = {
        name
        for variant in explanation.variants
        if variant.cause.group == "measurement"
        for name in explanation.sizes(variant.cause)
    }
    for unknown in explanation.fit.model.unknowns:
        old = known.pop(unknown.name, None)
        key = unknown.name if isinstance(unknown, Move) else unknown.address
        raw = None if old is None else written.pop(old.name if isinstance(old, Move) else old.address, None)
        same = old is not None and (old.addresses, old.tied) == (unknown.addresses, unknown.tied)
        if raw is not None and same:
            tables[key] = _restarted(raw, unknown, values)
        elif raw is not None and isinstance(unknown, Law) and old is not None and not unknown.tied:
            tables[key] = {**_restarted(raw, unknown, values), "name": unknown.name}
        else:
            everywhere = unknown.configurations is None and unknown.labels is None
            if isinstance(unknown, Move) and unknown.name in of_measurement and everywhere:
                # What belongs to the measurement does not act in assemblies that are only predicted.
                unknown = replace(unknown, configurations=tuple(measured))
            owner, _, field = unknown.address.rpartition(".")
            names = _names_of(data, owner) if owner.startswith("cause_") else []
            copies = {f"{name}.{field}": unknown.multiple for name in names if name != owner}
            if copies:
                unknown = replace(unknown, name=unknown.name, also={**unknown.also, **copies})
            tables[key] = _unknown_table(unknown, values[unknown.name])
            for address in (key, *copies):
                _write_found(data, address, tables[key].get("start"), unknown)
    # Unknowns that no measurement depends on remain unchanged.
    data["unknowns"] = {**written, **tables}


def _write_found(data: dict[str, Any], address: str, value: Any, unknown: Unknown) -> None:
    """Write the value of a new unknown into the table of the sensor or attachment that a cause has added.

    The table has the value wherever the unknown does not act, so assemblies and measurements without it lose the
    attachment, which was there without effect.
    """
    name, _, key = address.rpartition(".")
    configurations, labels = unknown.configurations, unknown.labels
    for section in _OTHER:
        if name.startswith("cause_") and key in data.get(section, {}).get(name, {}):
            data[section][name][key] = value
            for title, table in data["assemblies"].items():
                _detach(table, name, labels is None and (configurations is None or title in configurations))
            for title, table in data["measurements"].items():
                acts = configurations is None or table["assembly"] in configurations
                _detach(table, name, acts and (labels is None or title in labels))


def _detach(table: dict[str, Any], name: str, kept: bool) -> None:
    if kept:
        return
    if table.get("sensor") == name:
        del table["sensor"]
    if name in table.get("attachments", []):
        table["attachments"] = [one for one in table["attachments"] if one != name]


def _restarted(raw: dict[str, Any], unknown: Unknown, values: Mapping[str, float]) -> dict[str, Any]:
    if unknown.name not in values:  # a law with a value for each assembly
        return raw
    start = min(max(values[unknown.name], unknown.lower), unknown.upper)
    plain = isinstance(unknown, Move) or unknown.multiple != 1.0
    if isinstance(unknown, Law) and unknown.follows:
        raw = {**raw, "follows": dict(unknown.follows)}
    return {**raw, "start": start if plain else kind_of(unknown.address).text(start)}


def _rebase_files(data: dict[str, Any], before: Path, after: Path) -> None:
    """Make the paths of data files relative to the folder of the new file."""

    def moved(name: str) -> str:
        return Path(os.path.relpath((before / name).resolve(), after.resolve())).as_posix()

    tables = (*data["measurements"].values(), *data.get("spindles", {}).values(), *data["parts"].values())
    for table in tables:
        for key in ("file", "coherence", "contour"):
            written = table.get(key)
            if isinstance(written, str):
                table[key] = moved(written)
            elif isinstance(written, list):
                table[key] = [moved(name) for name in written]


def _on_diagnosed_lines(model: Model, diagnosed: Model, *, with_discrepancy: bool) -> Model:
    """Return the written model on the lines of the diagnosis, which leaves out noisy ones.

    A discrepancy and errors of a spindle enlarge the standard deviations of the diagnosis; a campaign file does not
    describe the first, and every fit adds the others.
    """
    seen = {observation.label: observation for observation in diagnosed.observations}
    enlarged = with_discrepancy or has_spindle_errors(model.observations)
    fields = ("standard_deviation", "correlated_lines", "standard_deviation_damping") if enlarged else ()
    kept: list[Observation] = []
    for observation in model.observations:
        if (other := seen.get(observation.label)) is None:
            continue
        if observation.is_receptance:
            observation = observation.select(np.isin(observation.frequency_hz, other.frequency_hz))
        kept.append(altered(observation, **{name: getattr(other, name) for name in fields}))
    places = [one.site(i) for i, one in enumerate(kept)]
    tolerances = tuple(t for t in model.tolerances if any(p.among(t.configurations, t.labels) for p in places))
    return replace(model, observations=tuple(kept), tolerances=tolerances)


def _check(campaign: CampaignData, fit: Fit, data: dict[str, Any], folder: Path, *, with_discrepancy: bool) -> None:
    """Raise a ValueError if the written campaign is not the model that was diagnosed."""
    again = campaign.from_contents(folder / "extended.toml", copy.deepcopy(data))
    written = base_model(again)[0]
    task = _on_diagnosed_lines(written, fit.model, with_discrepancy=with_discrepancy).task
    problem = task.problem()
    names = set(task.variables.names)
    if names != set(fit.values):
        odd = ", ".join(sorted(names ^ set(fit.values)))
        raise ValueError(f"the extended model cannot be written as a campaign: {odd} would differ")
    x = task.variables.from_values(np.array([fit.values[name] for name in task.variables.names]))
    residual = problem.residual(x)
    chi_square = float(residual @ residual)
    if not abs(chi_square - fit.chi_square) <= _SAME * fit.chi_square + _SAME:
        raise ValueError(
            "the extended model cannot be written as a campaign: its chi-square would be "
            f"{chi_square:.6g} instead of {fit.chi_square:.6g}"
        )


# Lines that add an explanation to a file ------------------------------------------------------------------------------

_OWN = ("title", "description", "settings")
"""Keys that every extended campaign has of its own."""
_LONG = re.compile(r"^(-?\d[\d.]*(?:e[-+]?\d+)?)(?= |$)")


def with_campaign_lines(campaign: CampaignData, verdict: Verdict) -> Verdict:
    """Return the verdict with the lines that add its explanation to the file; without them if there are none."""
    if verdict.explanation is None or not verdict.final:
        return verdict
    with warnings.catch_warnings():
        # Warnings on the data were given when they were read.
        warnings.simplefilter("ignore", ReceptanceWarning)
        try:
            return replace(verdict, campaign=replace(verdict.campaign, lines=_changed_lines(campaign, verdict)))
        except ValueError:
            return verdict


def _changed_lines(campaign: CampaignData, verdict: Verdict) -> tuple[str, ...]:
    """Return the lines in which the extended model of a diagnosis differs from the campaign file.

    They are what `extended_text` writes, with the same errors, without roles and start values of the unknowns that the
    campaign has. Numbers have six digits. Measurements with the same lines share them.
    """
    before = {key: value for key, value in campaign.contents.items() if key not in _OWN}
    after = {key: value for key, value in _extended(campaign, verdict, campaign.file.parent).items() if key not in _OWN}
    for name, table in after["measurements"].items():
        given = before["measurements"][name]
        table.pop("role", None)
        if "role" in given:
            table["role"] = given["role"]
    for name, table in after.get("unknowns", {}).items():
        if "start" in table and (given := before.get("unknowns", {}).get(name)) is not None:
            table.pop("start")
            table |= {"start": given["start"]} if "start" in given else {}
    for name in parts_to_start(campaign):
        # The modes are chosen again beside the cause, unless it moves them.
        if any(
            address.startswith(f"{name}.mode[")
            for table in after["unknowns"].values()
            for address in table.get("moves", ())
        ):
            return ()
        after["modal_parts"][name] = before["modal_parts"][name]
        new = set(after["unknowns"]) - set(before.get("unknowns", {}))
        after["unknowns"] = {k: v for k, v in after["unknowns"].items() if k not in new or not k.startswith(f"{name}.")}
    changed = _shortened(_changes(before, after))
    # Measurements with the same lines share them.
    groups: dict[str, tuple[dict[str, Any], list[str]]] = {}
    for name, table in changed.pop("measurements", {}).items():
        groups.setdefault(tomli_w.dumps(table), (table, []))[1].append(name)
    lines = [line for line in tomli_w.dumps({k: v for k, v in changed.items() if v}).splitlines() if line]
    for table, (first, *others) in groups.values():
        head, *own = tomli_w.dumps({"measurements": {first: table}}).splitlines()
        lines += [head, *([f"# the same for {', '.join(others)}"] if others else []), *own]
    return tuple(lines)


def _changes(before: Mapping[str, Any], after: Mapping[str, Any]) -> dict[str, Any]:
    """Return the keys whose values are new or different, tables key by key."""
    found: dict[str, Any] = {}
    for key, value in after.items():
        old = before.get(key)
        if isinstance(value, dict) and isinstance(old, dict):
            inner = _changes(old, value)
            if inner:
                found[key] = inner
        elif value != old:
            found[key] = value
    return found


def _shortened(value: Any) -> Any:
    """Return values with numbers of six digits, those in texts included."""
    if isinstance(value, dict):
        return {key: _shortened(one) for key, one in value.items()}
    if isinstance(value, list):
        return [_shortened(one) for one in value]
    if isinstance(value, float):
        return float(f"{value:.6g}")
    if isinstance(value, str):
        return _LONG.sub(lambda match: f"{float(match[1]):.6g}", value)
    return value
