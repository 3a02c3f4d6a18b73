"""The catalogue: all causes that a diagnosis tries by default."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from types import MappingProxyType

from receptance._text import instead_of, shown
from receptance.diagnosis.boundary_causes import BOUNDARY_CAUSES
from receptance.diagnosis.causes import Cause
from receptance.diagnosis.joint_causes import JOINT_CAUSES
from receptance.diagnosis.measurement_causes import MEASUREMENT_CAUSES
from receptance.diagnosis.part_causes import PART_CAUSES

CATALOGUE: Mapping[str, Cause] = MappingProxyType(
    {cause.id: cause for cause in (*JOINT_CAUSES, *PART_CAUSES, *BOUNDARY_CAUSES, *MEASUREMENT_CAUSES)}
)
"""The causes by id."""


def resolve_causes(causes: Iterable[Cause | str] | None) -> tuple[Cause, ...]:
    """Return causes given as objects or ids; None is the whole catalogue.

    Raises
    ------
    TypeError, ValueError
        An unknown id, an object that is not a cause, or a cause that is given twice.
    """
    if causes is None:
        return tuple(CATALOGUE.values())
    found: dict[str, Cause] = {}
    for one in [causes] if isinstance(causes, (Cause, str)) else causes:
        if isinstance(one, str) and one not in CATALOGUE:
            raise ValueError(f"there is no cause {shown(one)}{instead_of(one, CATALOGUE)}")
        cause = CATALOGUE[one] if isinstance(one, str) else one
        if not isinstance(cause, Cause):
            raise TypeError(f"causes has {one!r}, expected a Cause or the id of one")
        if cause.id in found:
            raise ValueError(f"the cause {cause.id!r} is given twice")
        found[cause.id] = cause
    return tuple(found.values())
