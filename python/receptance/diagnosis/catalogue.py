"""All causes that are looked for unless something else is asked."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import MappingProxyType

from receptance.diagnosis.causes import Cause
from receptance.diagnosis.joint_causes import JOINT_CAUSES
from receptance.diagnosis.measurement_causes import MEASUREMENT_CAUSES
from receptance.diagnosis.part_causes import PART_CAUSES
from receptance.diagnosis.spindle_causes import SPINDLE_CAUSES
from receptance.diagnosis.support_causes import SUPPORT_CAUSES
from receptance.diagnosis.tool_materials import tool_material

__all__ = ["CATALOGUE", "listed"]

CATALOGUE: Mapping[str, Cause] = MappingProxyType(
    {
        cause.id: cause
        for cause in (*JOINT_CAUSES, *PART_CAUSES, tool_material, *SUPPORT_CAUSES, *SPINDLE_CAUSES, *MEASUREMENT_CAUSES)
    }
)
"""The causes by id."""


def listed(causes: Iterable[Cause | str] | None) -> tuple[Cause, ...]:
    """Return causes by themselves or by id; None stands for the catalogue."""
    if causes is None:
        return tuple(CATALOGUE.values())
    found: dict[str, Cause] = {}
    for one in [causes] if isinstance(causes, (Cause, str)) else causes:
        if isinstance(one, str) and one not in CATALOGUE:
            raise ValueError(f"there is no cause {one!r}; the catalogue has {', '.join(CATALOGUE)}")
        cause = CATALOGUE[one] if isinstance(one, str) else one
        if not isinstance(cause, Cause):
            raise TypeError(f"causes has {one!r}, expected a Cause or the id of one")
        if cause.id in found:
            raise ValueError(f"the cause {cause.id!r} is given twice")
        found[cause.id] = cause
    return tuple(found.values())
