"""From the candidates of a campaign to measurements that could be taken."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from receptance.campaign.builder import with_sensor
from receptance.campaign.frequencies import deviations_of
from receptance.campaign.frf_files import deviation_share
from receptance.campaign.quantities import Condition
from receptance.campaign.tolerances import tolerances_of
from receptance.identification import Candidate
from receptance.identification.candidates import natural_slopes

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.assembly import Assembly
    from receptance.campaign.builder import Builder, Built
    from receptance.campaign.format import CampaignTable, CandidateFrequenciesTable, CandidateFRFTable
    from receptance.campaign.tolerances import Effects

__all__ = ["build_candidate"]

_MOST_LINES = 100_000


def build_candidate(
    name: str,
    campaign: CampaignTable,
    built: Built,
    effects: tuple[dict[str, Effects], dict[str, Effects]],
    builder: Builder,
    of_assemblies: Mapping[str, Mapping[str, Condition]],
) -> Candidate | None:
    """Return a candidate, or None after its mistakes are added.

    `effects` are the errors of assemblies, and of what sits on them only while measured, by their names;
    `of_assemblies` are the conditions of assemblies.
    """
    table, path = campaign.candidates[name], ("candidates", name)
    make = builder.make
    assembly = built.assemblies.get(table.assembly)
    sensor = None if table.sensor is None else built.sensors.get(table.sensor)
    if assembly is None or (table.sensor is not None and sensor is None):
        return None
    response = builder.place((*path, "response"), table.response, assembly)
    if response is None:
        return None
    errors = dict(effects[0].get(table.assembly, {}))
    for error, moved in effects[1].get(table.sensor or "", {}).items():
        errors[error] = {**errors.get(error, {}), **moved}
    known = {key: one.value for key, one in of_assemblies.get(table.assembly, {}).items()}
    common = {
        "label": name,
        "assembly": with_sensor(assembly, sensor, response),
        "tolerances": tuple(tolerances_of(errors)),
        "configuration": table.assembly,
        "conditions": {**known, **{key: one.value for key, one in table.conditions.items()}},
        "cost": table.cost,
    }
    if table.kind == "natural frequencies":
        spread = make((*path, "standard_deviation"), _deviations, table, common["assembly"])
        if spread is None:
            return None
        return make(path, Candidate, modes=tuple(table.modes), standard_deviation_hz=spread, **common)
    excitation = builder.place((*path, "excitation"), table.excitation, assembly)
    lines = make(path, _lines, table)
    share = make((*path, "standard_deviation"), deviation_share, table.standard_deviation)
    floor = make((*path, "floor"), deviation_share, table.floor)
    if excitation is None or lines is None or share is None or builder.problems.at((*path, "floor")):
        return None
    return make(
        path,
        Candidate,
        frequency_hz=lines,
        response=response,
        excitation=excitation,
        standard_deviation=share,
        floor=floor or 0.0,
        **common,
    )


def _lines(table: CandidateFRFTable) -> NDArray[np.float64]:
    lower = table.step if table.lower is None else table.lower
    if lower >= table.upper:
        raise ValueError(f"goes from {lower:g} to {table.upper:g} Hz, expected `lower` below `upper`")
    count = int((table.upper - lower) / table.step * (1.0 + 1e-12)) + 1
    if count > _MOST_LINES:
        raise ValueError(f"has {count} lines, expected at most {_MOST_LINES}; give a larger `step`")
    return lower + table.step * np.arange(count, dtype=np.float64)


def _deviations(table: CandidateFrequenciesTable, assembly: Assembly) -> list[float]:
    """Return standard deviations in Hz, those in percent of what the model with its start values has."""
    frequencies, _ = natural_slopes(assembly, table.modes, ())
    return deviations_of(table.standard_deviation, frequencies.tolist()) or []
