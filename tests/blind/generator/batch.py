"""Which cases make a batch, and the same case under other names."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from .case import Case, Stated
from .effects import CATALOGUE, MEASUREMENT, OUTSIDE


def shuffled(case: Case) -> Case:
    """Return the same measurements under other names, in another order, without remarks."""
    rng = np.random.default_rng(len(case.name))
    old = [c.name for c in (*case.nominal.configurations, *case.new_tools)]
    names = dict(zip(old, (f"{i}" for i in rng.permutation(len(old)) + 1), strict=True))
    order = rng.permutation(len(case.nominal.configurations))
    tolerances = tuple(
        replace(
            stated,
            name=_renamed(stated, names),
            configuration=names.get(stated.configuration or ""),
        )
        for stated in case.nominal.tolerances
    )
    configurations = tuple(replace(case.nominal.configurations[i], name=names[old[i]]) for i in order)
    records = [
        replace(record, configuration=names[record.configuration], label=f"m{i}", notes=())
        for i, record in enumerate(case.records)
    ]
    return replace(
        case,
        nominal=replace(case.nominal, configurations=configurations, tolerances=tolerances),
        records=tuple(records[i] for i in rng.permutation(len(records))),
        new_tools=tuple(replace(tool, name=names[tool.name]) for tool in case.new_tools),
    )


def _renamed(stated: Stated, names: Mapping[str, str]) -> str:
    if stated.configuration is None:
        return stated.name
    return stated.name.replace(stated.configuration, names[stated.configuration])


def every(count: int) -> list[tuple[str, tuple[str, ...]]]:
    """Return kinds and effects of a batch: a third without an effect, every effect of the catalogue in turn.

    Any beginning of the list has nearly the same shares, so a batch may be cut or sharded anywhere.
    """
    hidden: list[tuple[str, tuple[str, ...]]] = []
    # Steps through the lists that have no divisor with their lengths, so that neighbours differ in kind.
    outside = single = 0
    for i in range(count):
        slot = i % 20
        if slot in (1, 6, 13, 16):
            hidden.append(("outside", (OUTSIDE[(5 * outside) % len(OUTSIDE)],)))
            outside += 1
        elif slot in (5, 15):
            hidden.append(("pair", ()))
        elif slot == 10:
            hidden.append(("one_configuration", ()))
        elif slot == 18:
            hidden.append(("misleading", ()))
        else:
            hidden.append(("single", (CATALOGUE[(7 * single) % len(CATALOGUE)],)))
            single += 1
    plan: list[tuple[str, tuple[str, ...]]] = []
    taken = 0
    for i in range(count):
        if i % 3 == 2:
            plan.append(("nothing" if (i // 3) % 2 else "nothing_exact", ()))
        else:
            plan.append(hidden[taken])
            taken += 1
    return plan


def alone(count: int, effects: Sequence[str]) -> list[tuple[str, tuple[str, ...]]]:
    """Return kinds and effects of a batch that hides one of some effects in every case, in turn."""
    return [("single", (effects[i % len(effects)],)) for i in range(count)]


def group_of(id: str) -> str:
    """Return the group of an effect."""
    return "outside" if id in OUTSIDE else "measurement" if id in MEASUREMENT else "structure"
