"""Where fits of causes begin."""

from __future__ import annotations

from collections.abc import Sequence

from receptance.diagnosis.fitting import Fit
from receptance.diagnosis.screening import Direction

__all__ = ["starts_of", "starts_together"]

_LARGE = 3.0
"""Large sizes from which fits begin are so many times the typical one."""


def starts_of(direction: Direction, fit: Fit) -> list[dict[str, float]]:
    """Return where fits of a cause begin: at its null, where its direction points, and at larger sizes.

    What only says where and how it acts begins as given too: to first order it is known but vaguely.

    What has no number of its own changes the joint instead: its stiffnesses begin at several times what they were.
    """
    values = fit.values
    if not direction.names:
        joints = {a for field in ("k_y", "k_theta", "k_ytheta") for a in fit.model.joint_addresses(field)}
        stiff = [u.name for u in fit.task.parameters.unknowns if u.address in joints]
        return [{**values, **{name: times * values[name] for name in stiff}} for times in (2.0, 10.0)]
    parameters = {name: direction.cause.parameter_of(name) for name in direction.names}
    null = {name: one.start for name, one in parameters.items()}
    starts = [null]
    if direction.step:
        starts.append({**null, **direction.step})
        starts.append({name: null[name] if one.secondary else starts[-1][name] for name, one in parameters.items()})
    for times in (_LARGE, -_LARGE):
        large = {
            name: one.typical
            if one.secondary
            else min(max(one.null + times * (one.typical - one.null), one.lower), one.upper)
            for name, one in parameters.items()
        }
        starts.append(large)
    different = [one for i, one in enumerate(starts) if one not in starts[:i]]
    return [{**values, **one} for one in different]


def starts_together(base: Fit, alone: Sequence[Fit], root: Fit) -> list[dict[str, float]]:
    """Return where a fit of several causes begins from ends of the added one alone: the joint may be nearer there."""
    own = {name: value for name, value in root.values.items() if name not in base.values}
    return [{**root.values, **one.values, **own} for one in alone]
