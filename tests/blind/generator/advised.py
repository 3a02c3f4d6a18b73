"""The next measurement: one quantity by itself, which is then known, or more records from the same bench."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .case import JOINT, Case, Configuration, Stated, Truth, recorded
from .records import like

_SHOWN = {
    "weigh the blank": ("tool_density", "tool_material"),
    "weigh the sensor": ("sensor_mass",),
    "weigh collet": ("collet_mass",),
    "weigh the holder": ("holder_inertia",),
    "caliper": ("overhang_error",),
    "without the exponential window": ("exponential_window",),
    "which exponential window": ("exponential_window",),
    "marked": ("hammer_offset",),
    "free mass": ("calibration_gain", "time_delay", "wrong_quantity", "reversed_polarity"),
    # The axis is no effect of the bench: it is right in every case.
    "generator of known frequency": ("frequency_scale",),
    "softer": ("suspension",),
    "swing on the suspension": ("suspension",),
    "blank alone": ("tool_material", "tool_modulus", "tool_density", "fluted_part"),
    "holder alone": ("holder_modulus", "holder_inertia", "flexible_body"),
    "plain blank": ("fluted_part",),
    "gauge blank again": ("spindle_mode",),
}


def shown_by(action: str) -> frozenset[str]:
    """Return the effects that a measurement shows by itself, present or not."""
    return frozenset(id for words, ids in _SHOWN.items() if words in action for id in ids)


def measured_again(case: Case, truth: Truth, action: str) -> Case | None:
    """Return the case with the advised records; None if none of them is available."""
    rng = np.random.default_rng([*truth.seed, 79])
    levels = sorted({record.level for record in case.records})
    form, notes = case.records[0].form, case.records[0].notes
    added = []
    for one in action.split(", and "):
        if "overhang" in one and "caliper" not in one:
            longest = max(case.nominal.configurations, key=lambda c: c.overhang)
            new = replace(longest, name="longer", overhang=round(1.2 * longest.overhang, 4))
            case, truth = _with_configuration(case, truth, new, rng)
            added += [(new, level, "tip") for level in levels]
        elif "nose" in one and case.known is not None:
            continue  # data at the mouth say nothing of a sensor on the holder
        elif "nose" in one:
            added += [(c, levels[-1], "nose") for c in case.nominal.configurations if c.name != "longer"]
        elif "force" in one:
            level = 3.0 * levels[-1]
            truth = replace(truth, setups={**truth.setups, level: like(truth.setups[levels[-1]], level)})
            added += [(c, level, "tip") for c in case.nominal.configurations if c.name != "longer"]
    if not added:
        return None
    records = [
        recorded(rng, case.nominal, truth, one, level, 1, place=place, form=form, notes=notes, label=f"again {i}")
        for i, (one, level, place) in enumerate(added)
    ]
    return replace(case, records=(*case.records, *records))


def _with_configuration(case: Case, truth: Truth, new: Configuration, rng: np.random.Generator) -> tuple[Case, Truth]:
    like_it = next(one for one in case.nominal.tolerances if one.configuration is not None)
    stated: Stated = replace(like_it, name=f"overhang {new.name}", configuration=new.name)
    drawn = [stated.name, *(f"{name} @ {new.name}" for name in JOINT)]
    truth = replace(truth, errors={**truth.errors, **{name: float(rng.standard_normal()) for name in drawn}})
    nominal = replace(
        case.nominal,
        configurations=(*case.nominal.configurations, new),
        tolerances=(*case.nominal.tolerances, stated),
    )
    return replace(case, nominal=nominal), truth
