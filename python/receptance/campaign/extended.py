"""The extended model of a diagnosis as a campaign file, which is identified and predicted like any other.

What a cause changes is written as what campaigns say anyway: segments, joints, masses, springs, unknowns that are
parameters or move several, unknowns of the measuring chain. Nothing in the file remembers that a diagnosis wrote it.
"""

from __future__ import annotations

import copy
import os
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance import units
from receptance.campaign.builder import addresses_of
from receptance.campaign.problems import Problems
from receptance.campaign.series_tables import spelled_out
from receptance.campaign.tolerances import tolerances_of
from receptance.campaign.writer import Materials, attachment_table, element_table, quantity, quantity_at, unknown_table
from receptance.coordinates import Coordinate
from receptance.diagnosis.model import Model
from receptance.identification.laws import Law, Move
from receptance.identification.observations import MeasuredFrequencies, MeasuredFRF, altered, on_lines
from receptance.identification.task import Observation, place_of
from receptance.identification.unknowns import covered

if TYPE_CHECKING:
    from receptance.assembly import Assembly
    from receptance.campaign.campaign import Campaign
    from receptance.diagnosis import Verdict
    from receptance.identification.laws import Tolerance

__all__ = ["extended_text"]

_SAME = 1e-6
"""Relative difference of chi-square up to which a file says the model that was diagnosed."""
_ORDERS = (1, 2, -1, -2)
_OTHER = {"sensors": "attachments", "attachments": "sensors"}


@dataclass(frozen=True, eq=False)
class _Extended:
    """An observation as the causes change it, and which attachments belong to the measurement alone."""

    given: MeasuredFRF | MeasuredFrequencies
    found: MeasuredFRF | MeasuredFrequencies
    tolerances: tuple[Tolerance, ...]
    beside: tuple[str, ...]

    @property
    def assembly(self) -> Assembly:
        """The assembly with its causes."""
        return self.found.assembly

    def added(self, beside: bool) -> list[str]:
        """Return names of attachments that causes have added, to the assembly or beside it."""
        own = [name for name in self.assembly.attachments if name not in self.given.assembly.attachments]
        return [name for name in own if (name in self.beside) == beside]


def extended_text(campaign: Campaign, verdict: Verdict, folder: Path) -> str:
    """Return the text of a campaign file with the extended model, for a folder.

    Raises
    ------
    ValueError
        There is no extended model, or it has something that campaign files cannot say.
    """
    import tomli_w

    data = _extended(campaign, verdict, folder)
    _check(verdict, data, folder)
    return tomli_w.dumps(data)


def _extended(campaign: Campaign, verdict: Verdict, folder: Path) -> dict[str, Any]:
    if verdict.explanation is None or verdict.extended is None:
        raise ValueError(f"there is no extended model, because the verdict is {verdict.verdict}")
    # A cause may act at one level alone, so that each has tables of its own.
    data = spelled_out(tomllib.loads(campaign.file.read_bytes().decode("utf-8-sig")), Problems({})).data
    measured = {
        name: _applied(verdict, name, one.observation, one.effects) for name, one in campaign.measurements.items()
    }
    assemblies = {name: _of_assembly(campaign, verdict, name) for name in campaign.assemblies}
    _write_structure(data, campaign, assemblies, {a for u in _unknowns(verdict) for a in addresses_of(u)})
    end = _early_end(campaign, verdict)
    seen = {one.label for one in verdict.selection.base.model.observations}
    for name, one in measured.items():
        _write_measurement(data, name, one, name in seen)
        if end is not None and isinstance(one.given, MeasuredFRF):
            data["measurements"][name]["ends"] = quantity(end, units.TIME)
    _write_unknowns(data, verdict)
    _rebase_files(data, campaign.file.parent, folder)
    data["settings"] = {**data.get("settings", {}), "starts": 1}
    data["settings"].pop("strategy", None)
    data["settings"].pop("objective", None)
    names = " and ".join(cause.id for cause, _ in verdict.explanation.steps)
    data["title"] = f"{campaign.title}, extended by {names}"
    alike = f"; could not be told apart: {', '.join(verdict.ambiguous_between)}" if verdict.ambiguous_between else ""
    own = data.get("description", "")
    data["description"] = f"{own} Written by `receptance diagnose` ({verdict.verdict}: {names}{alike}).".strip()
    order = ["format", "title", "description", "settings", "prediction"]
    return {key: data[key] for key in (*(k for k in order if k in data), *(k for k in data if k not in order))}


def _unknowns(verdict: Verdict) -> tuple[Any, ...]:
    assert verdict.explanation is not None
    return verdict.explanation.fit.model.unknowns


def _early_end(campaign: Campaign, verdict: Verdict) -> float | None:
    """Return when records ended while the structure still rang, where a cause says so; they show it together."""
    assert verdict.explanation is not None
    given = {name: getattr(one.observation, "ends", None) for name, one in campaign.measurements.items()}
    found = [one for one in verdict.explanation.fit.model.observations if isinstance(one, MeasuredFRF)]
    return max((one.ends for one in found if one.ends is not None and one.ends != given[one.label]), default=None)


def _applied(verdict: Verdict, name: str, observation: MeasuredFRF | MeasuredFrequencies, effects: Any) -> _Extended:
    """Return an observation as the causes of the best explanation change it, one after the other."""
    explanation = verdict.explanation
    assert explanation is not None
    base = verdict.selection.base.model
    model = replace(base, observations=(observation,), tolerances=tuple(tolerances_of(effects, name or None)))
    beside: list[str] = []
    for step in explanation.steps:
        before = set(model.observations[0].assembly.attachments)
        model = step.transfer(model)
        if step.cause.group == "measurement":
            beside += [one for one in model.observations[0].assembly.attachments if one not in before]
    return _Extended(observation, model.observations[0], model.tolerances, tuple(beside))


def _of_assembly(campaign: Campaign, verdict: Verdict, name: str) -> _Extended:
    """Return an assembly without what sits on it while it is measured, as the causes change it."""
    assembly = campaign.assemblies[name]
    own = [one.observation for one in campaign.measurements.values() if one.assembly == name]
    like = next((one for one in own if isinstance(one, MeasuredFRF)), own[0] if own else None)
    if like is None:
        like = next(iter(campaign.measurements.values())).observation
        if isinstance(like, MeasuredFRF):
            response, excitation = campaign.places.get(name, (Coordinate(), Coordinate()))
            like = altered(like, response=response, excitation=excitation)
    conditions = {key: one.value for key, one in campaign.conditions.get(name, {}).items()}
    bare = altered(like, assembly=assembly, configuration=name, label=name, conditions=conditions)
    return _applied(verdict, "", bare, campaign.effects.get(name, {}))


def _write_structure(
    data: dict[str, Any], campaign: Campaign, assemblies: Mapping[str, _Extended], unknown: set[str]
) -> None:
    """Write every part and joint that causes have changed, and what its assemblies have differently."""
    materials = Materials(campaign.table.materials)
    tables: dict[str, tuple[Assembly, dict[str, Any]]] = {}
    for one in assemblies.values():
        for name, element in one.assembly.elements.items():
            if name not in tables and any(_differs(name, other) for other in assemblies.values()):
                tables[name] = (one.assembly, element_table(element, materials))
    for name, (_, table) in tables.items():
        section = "parts" if "segments" in table else "modal_parts" if "modes" in table else "joints"
        data.setdefault(section, {})[name] = table
    for title, one in assemblies.items():
        _write_assembly(data, title, one, {name: base for name, (base, _) in tables.items()}, unknown)
    data["materials"].update(materials.added)


def _differs(name: str, one: _Extended) -> bool:
    new, old = one.assembly.elements.get(name), one.given.assembly.elements.get(name)
    if new is None:
        return False
    return old is None or type(new) is not type(old) or new != old


def _write_assembly(
    data: dict[str, Any], title: str, one: _Extended, bases: Mapping[str, Assembly], unknown: set[str]
) -> None:
    table, assembly = data["assemblies"][title], one.assembly
    owners = {name for name in assembly.elements if name in bases}
    table["chain"] = list(assembly.elements)
    added = one.added(beside=False)
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
            raise ValueError(f"{owner} is made differently in {title}, which a campaign cannot say")
        value = assembly.get(address)
        if value != bases[owner].get(address):
            table["set"][address] = quantity_at(address, value)
    for error in one.tolerances:
        for address, deviation in error.moves.items():
            if address.split(".", 1)[0] in owners and address not in identified:
                written = quantity_at(address, abs(deviation))
                table["tolerance"][address] = {"value": written, "name": error.name}
    fresh = {k: v for k, v in one.found.conditions.items() if k not in one.given.conditions}
    if fresh:
        table["conditions"] = {**table.get("conditions", {}), **fresh}
    for key in ("set", "tolerance"):
        if not table[key]:
            del table[key]


def _write_moved(data: dict[str, Any], one: _Extended) -> None:
    """Write where attachments are whose part begins elsewhere now; a sensor is where the response is."""
    for name, point in one.assembly.attachments.items():
        if name in data.get("attachments", {}) and one.given.assembly.attachments.get(name, point) != point:
            data["attachments"][name] = attachment_table(point)


def _write_measurement(data: dict[str, Any], name: str, one: _Extended, seen: bool) -> None:
    table = data["measurements"][name]
    if seen:
        table["role"] = "identify"
    for attached in one.added(beside=True):
        _write_beside(data, name, attached, one)
    _write_moved(data, one)
    given, found = one.given, one.found
    if not isinstance(given, MeasuredFRF) or not isinstance(found, MeasuredFRF):
        return
    for side in ("response", "excitation"):
        old, new = getattr(given, side), getattr(found, side)
        if (old.part, old.position) != (new.part, new.position):
            at = new.position if isinstance(new.position, str) else quantity(new.position, units.LENGTH)
            table[side] = {**table.get(side, {}), "part": new.part, "position": at}
    times = _integrations(given, found)
    if times:
        table["integrate"] = int(table.get("integrate", 0)) + times


def _write_beside(data: dict[str, Any], name: str, attached: str, one: _Extended) -> None:
    """Write what sits on an assembly only while it is measured: as the sensor, where it is where that sits."""
    table, point = data["measurements"][name], one.assembly.attachments[attached]
    made = attachment_table(point)
    place = one.found.response if isinstance(one.found, MeasuredFRF) else Coordinate()
    section = "attachments"
    if (
        made["kind"] == "mass"
        and (point.part, point.position) == (place.part, place.position)
        and "sensor" not in table
    ):
        section, made = "sensors", {key: made[key] for key in ("mass", "inertia") if key in made}
        table["sensor"] = attached
    else:
        table["attachments"] = [*table.get("attachments", []), attached]
    if data.get(section, {}).get(attached, made) != made or attached in data.get(_OTHER[section], {}):
        raise ValueError(f"{attached} sits in different places in different measurements, which a campaign cannot say")
    data.setdefault(section, {})[attached] = made


def _integrations(given: MeasuredFRF, found: MeasuredFRF) -> int:
    """Return how often a cause has integrated the motion of a measurement."""
    if np.array_equal(given.receptance, found.receptance):
        return 0
    angular = 2j * np.pi * given.frequency_hz
    for order in _ORDERS:
        if np.allclose(found.receptance * angular**order, given.receptance, rtol=1e-9, atol=0.0):
            return order
    raise ValueError(f"{given!r}: its data are changed by a cause in a way that a campaign cannot say")


def _write_unknowns(data: dict[str, Any], verdict: Verdict) -> None:
    """Write the unknowns, which begin where the diagnosis ended."""
    assert verdict.explanation is not None
    values = verdict.explanation.fit.values
    known = {unknown.name: unknown for unknown in verdict.selection.base.model.unknowns}
    written = dict(data.get("unknowns", {}))
    tables: dict[str, Any] = {}
    for unknown in _unknowns(verdict):
        old = known.pop(unknown.name, None)
        key = unknown.name if isinstance(unknown, Move) else unknown.address
        raw = None if old is None else written.pop(old.name if isinstance(old, Move) else old.address, None)
        same = old is not None and (old.reached, old.tied) == (unknown.reached, unknown.tied)
        if raw is not None and same:
            tables[key] = _restarted(raw, unknown, values)
        elif raw is not None and isinstance(unknown, Law) and old is not None and not unknown.tied:
            tables[key] = {**_restarted(raw, unknown, values), "name": unknown.name}
        else:
            tables[key] = unknown_table(unknown, values[unknown.name])
    # What no measurement saw stays as it was written.
    data["unknowns"] = {**written, **tables}


def _restarted(raw: dict[str, Any], unknown: Any, values: Mapping[str, float]) -> dict[str, Any]:
    if unknown.name not in values:  # a law with a value for each assembly
        return raw
    start = min(max(values[unknown.name], unknown.lower), unknown.upper)
    plain = isinstance(unknown, Move) or unknown.multiple != 1.0
    if isinstance(unknown, Law) and unknown.follows:
        raw = {**raw, "follows": dict(unknown.follows)}
    return {**raw, "start": start if plain else quantity_at(unknown.address, start)}


def _rebase_files(data: dict[str, Any], before: Path, after: Path) -> None:
    """Data files are named from where the new file is."""

    def moved(name: str) -> str:
        return Path(os.path.relpath((before / name).resolve(), after.resolve())).as_posix()

    for table in data["measurements"].values():
        for key in ("file", "coherence"):
            written = table.get(key)
            if isinstance(written, str):
                table[key] = moved(written)
            elif isinstance(written, list):
                table[key] = [moved(name) for name in written]


def _as_seen(model: Model, diagnosed: Model) -> Model:
    """Return what was written on the lines that the diagnosis took; it leaves out what is too noisy for it."""
    seen = {one.label: one for one in diagnosed.observations}
    kept: list[Observation] = []
    for one in model.observations:
        other = seen.get(one.label)
        if isinstance(one, MeasuredFRF) and isinstance(other, MeasuredFRF):
            good = np.isin(one.frequency_hz, other.frequency_hz)
            kept.append(on_lines(one, good))
        elif other is not None:
            kept.append(one)
    places = [place_of(one, i) for i, one in enumerate(kept)]
    tolerances = tuple(t for t in model.tolerances if any(p.among(t.configurations, t.labels) for p in places))
    return replace(model, observations=tuple(kept), tolerances=tolerances)


def _check(verdict: Verdict, data: dict[str, Any], folder: Path) -> None:
    """Read what was written, and refuse it where it is not the model that was diagnosed."""
    from receptance.campaign.diagnosis import campaign_model
    from receptance.campaign.loading import loaded

    explanation = verdict.explanation
    assert explanation is not None
    again = loaded(folder / "extended.toml", copy.deepcopy(data))
    fit = explanation.fit
    task = _as_seen(campaign_model(again, again.to_identify)[0], fit.model).task()
    problem = task.problem()
    names = set(task.variables.names)
    if names != set(fit.values):
        odd = ", ".join(sorted(names ^ set(fit.values)))
        raise ValueError(f"the extended model cannot be written as a campaign: {odd} would not be the same in it")
    x = task.variables.from_values(np.array([fit.values[name] for name in task.variables.names]))
    residual = problem.residual(x)
    chi_square = float(residual @ residual)
    if not abs(chi_square - fit.chi_square) <= _SAME * fit.chi_square + _SAME:
        raise ValueError(
            "the extended model cannot be written as a campaign: there it would have the chi-square "
            f"{chi_square:.6g} instead of {fit.chi_square:.6g}"
        )
