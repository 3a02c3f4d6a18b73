"""The handles of the extension as functions of all their arrays, for tests that change one array at a time."""

from __future__ import annotations

from typing import Any

from receptance import _core

TABLES = ("segments", "joints", "masses", "grounds")


def model(motion: int, **tables: Any) -> Any:
    """Return a model."""
    return _core.Model(motion, **tables)


def receptance(
    angular_frequency: Any, motion: Any, excitations: Any, responses: Any, parameters: Any, threads: Any,
    scale: float = 1.0, **tables: Any,
) -> Any:  # fmt: skip
    """Return receptances and derivatives."""
    lines = _core.Lines(angular_frequency, scale)
    return model(motion, **tables).receptance(lines, excitations, responses, parameters, threads)


def natural_frequencies(upper: Any, most: Any, motion: Any, parameters: Any, **tables: Any) -> Any:
    """Return natural angular frequencies and derivatives."""
    return model(motion, **tables).natural_frequencies(upper, most, parameters)


def planes(angular_frequency: Any, joint: Any, points: Any, threads: Any, **tables: Any) -> Any:
    """Return the planes of a reduction to a joint."""
    lines = _core.Lines(angular_frequency)
    return model(0, **tables).reduced_to_joint(joint, lines, points, threads, None, True).planes()


def problem(
    reduction: Any, spring: Any, variables: Any, measured: Any, weights: Any,
    logarithmic: Any, bounds: Any, priors: Any, threads: Any,
) -> Any:  # fmt: skip
    """Return a problem with one receptance of a reduced model."""
    found = _core.Problem(logarithmic, bounds, priors, threads)
    found.add_joint_receptance(reduction, spring, variables, measured, weights)
    return found


def normal_matrix(x: Any, **arguments: Any) -> Any:
    """Return the normal matrix of such a problem."""
    return problem(**arguments).normal_matrix(x)


def rows(x: Any, free: Any, **arguments: Any) -> Any:
    """Return residuals and derivatives of such a problem."""
    return problem(**arguments).rows(x, free)


def fit(starts: Any, free: Any, evaluations: Any, tolerance: Any, least: Any, **arguments: Any) -> Any:
    """Return the ends of the fits of such a problem."""
    ends = problem(**arguments).fit(starts, free, evaluations, tolerance, least)
    return ends.x, ends.cost, ends.first, ends.evaluations, ends.status, ends.normal
