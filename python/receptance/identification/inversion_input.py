"""What inverse coupling is asked for: checked, brought to common lines, and what is to be said of it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance.frf.resampling import between, too_sharp
from receptance.identification.laws import Tolerance
from receptance.identification.line_solutions import TERMS, names_of
from receptance.identification.observations import MeasuredFRF, altered
from receptance.joints import PointJoint

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.assembly import Assembly

__all__ = [
    "check_joint",
    "check_observations",
    "check_terms",
    "check_tolerances",
    "common_lines",
    "joint_of",
    "masked_lines",
    "not_apart",
    "notes_on",
]

_SAME = 1e-9
"""Of a frequency: lines that are nearer to each other are one line."""
_GAP = 1.5
"""Of the median step between lines: a longer one is a gap, in which nothing is interpolated."""
_FEWEST = 4
"""Lines that a spline needs."""
_FEW = 0.5
"""Share of the lines below which those in common are few, and by which resampling has to give more."""
_UNSUITED = 3.0
"""Standard deviations, as rms, beyond which one joint does not suit all lines."""
_SHOWN = 5
"""Masked lines that are listed by their frequency."""
_DEFAULT_TERMS = (("k_theta",), ("k_y", "k_theta"), ("k_y", "k_theta", "k_ytheta"))


def check_observations(observations: MeasuredFRF | Sequence[MeasuredFRF]) -> tuple[MeasuredFRF, ...]:
    """Return the observations as a tuple, all of them receptances with standard deviations."""
    found = (observations,) if isinstance(observations, MeasuredFRF) else tuple(observations)
    if not found:
        raise ValueError("observations is empty, expected at least one MeasuredFRF")
    for index, one in enumerate(found):
        if not isinstance(one, MeasuredFRF):
            raise TypeError(f"observations[{index}] is {one!r}, expected a MeasuredFRF")
        if one.standard_deviation is None:
            raise ValueError(
                f"{one!r} has no standard deviation, so nothing can be said of how far its lines can be believed; "
                "give it one"
            )
    return found


def check_terms(terms: Sequence[str] | None, count: int) -> tuple[str, ...]:
    """Return what is to be solved for, in the order of the stiffness's terms."""
    if terms is None:
        return _DEFAULT_TERMS[min(count, 3) - 1]
    given = (terms,) if isinstance(terms, str) else tuple(terms)
    if not given or len(set(given)) < len(given) or not set(given) <= TERMS.keys():
        raise ValueError(f"terms is {terms!r}, expected some of {', '.join(TERMS)}, each once")
    if len(given) > count:
        raise ValueError(
            f"{names_of(given)} are {len(given)} unknown terms on each line, but there "
            f"{'is one receptance' if count == 1 else f'are {count} receptances'}, one equation each; measure at "
            "another coordinate or another overhang too, or solve for fewer terms"
        )
    return tuple(name for name in TERMS if name in given)


def check_tolerances(tolerances: Tolerance | Sequence[Tolerance]) -> tuple[Tolerance, ...]:
    """Return tolerances as a tuple."""
    return (tolerances,) if isinstance(tolerances, Tolerance) else tuple(tolerances)


def joint_of(assembly: Assembly, joint: str) -> PointJoint:
    """Return the joint, which is to be one at a point."""
    found = assembly.elements.get(joint)
    if not isinstance(found, PointJoint):
        known = [name for name, element in assembly.elements.items() if isinstance(element, PointJoint)]
        raise ValueError(f"there is no point joint {joint!r} in {assembly!r}; there is {', '.join(known) or 'none'}")
    return found


def check_joint(observed: tuple[MeasuredFRF, ...], joint: str, terms: tuple[str, ...]) -> None:
    """Refuse observations whose joints differ in what is taken as known."""
    solved = {name for term in terms for name in (term, f"c{term[1:]}")}
    if len(terms) == len(TERMS):
        solved.add("loss_factor")
    first = joint_of(observed[0].assembly, joint)
    for one in observed[1:]:
        other = joint_of(one.assembly, joint)
        for name in PointJoint.columns_of:
            if name not in solved and getattr(other, name) != getattr(first, name):
                raise ValueError(
                    f"{joint}.{name} is {getattr(first, name):g} in {observed[0]!r} and {getattr(other, name):g} in "
                    f"{one!r}, expected the same joint, or {name} among the terms"
                )


def common_lines(
    observed: tuple[MeasuredFRF, ...],
) -> tuple[tuple[MeasuredFRF, ...], NDArray[Any], list[NDArray[np.intp]], int]:
    """Return the observations, the lines that all have, where they are in each, and how many others there are.

    Where few of their lines are the same, because the records had different lengths, they are resampled first.
    """
    lines = _shared(observed)
    if lines.size < _FEW * min(one.frequency_hz.size for one in observed):
        other = _resampled(observed)
        if other and other[0].frequency_hz.size * _FEW > lines.size:
            observed, lines = other, other[0].frequency_hz
    if not lines.size:
        raise ValueError(
            f"there is no line that all of {', '.join(map(repr, observed))} have, and no band that all of them cover "
            "with the same exponential window; the equations of a line belong together"
        )
    rows = [_found(lines, one.frequency_hz)[0] for one in observed]
    return observed, lines, rows, sum(o.frequency_hz.size - lines.size for o in observed)


def _shared(observed: tuple[MeasuredFRF, ...]) -> NDArray[Any]:
    lines: NDArray[Any] = observed[0].frequency_hz
    for one in observed[1:]:
        lines = lines[_found(lines, one.frequency_hz)[1]]
    return lines


def _resampled(observed: tuple[MeasuredFRF, ...]) -> tuple[MeasuredFRF, ...]:
    """Return observations on the lines of the one with the widest steps that all of them cover; none without such."""
    widest = max(observed, key=_step)
    lines = widest.frequency_hz
    kept = np.ones(lines.size, dtype=np.bool_)
    for one in observed:
        kept &= _between_neighbours(lines, one)
    return tuple(_on_lines(one, lines[kept], widest) for one in observed) if kept.any() else ()


def _step(one: MeasuredFRF) -> float:
    return float(np.median(np.diff(one.frequency_hz.real))) if one.frequency_hz.size > 1 else np.inf


def _between_neighbours(lines: NDArray[Any], one: MeasuredFRF) -> NDArray[np.bool_]:
    """Return which lines lie among those of an observation, and not where some of these were left out."""
    own = one.frequency_hz
    nearest, same = _found(lines, own)
    if own.size < _FEWEST:
        return same
    after = np.clip(np.searchsorted(own.real, lines.real), 1, own.size - 1)
    inside = (lines.real >= own.real[0]) & (lines.real <= own.real[-1])
    dense = own.real[after] - own.real[after - 1] <= _GAP * _step(one)
    window = np.abs(lines.imag - own.imag[nearest]) <= _SAME * np.abs(lines)
    found: NDArray[np.bool_] = same | (inside & dense & window)
    return found


def _on_lines(one: MeasuredFRF, lines: NDArray[Any], widest: MeasuredFRF) -> MeasuredFRF:
    if one is widest:
        rows = np.isin(one.frequency_hz, lines)
        fields: dict[str, Any] = {
            name: value[rows]
            for name, value in vars(one).items()
            if isinstance(value, np.ndarray) and value.shape == one.frequency_hz.shape
        }
        return altered(one, **fields)
    owner = repr(one)
    own = one.frequency_hz.real
    # Lines on the edge of the band may lie outside by rounding.
    place = between(own, np.clip(lines.real, own[0], own[-1]), owner)
    values, bend = place.smooth(one.receptance)
    spread = one.standard_deviation
    fields = {
        name: place.straight(value)
        for name, value in vars(one).items()
        if isinstance(value, np.ndarray) and value.shape == one.frequency_hz.shape and not np.iscomplexobj(value)
    }
    fields |= {"frequency_hz": lines, "receptance": values}
    notes = [*one.notes, f"{one.label or owner}: resampled to the {lines.size} lines of {widest.label or repr(widest)}"]
    sharp = too_sharp(place, values, bend, None if spread is None else place.straight(spread**2))
    notes += [f"{one.label or owner}: {sharp}"] if sharp else []
    return altered(one, **fields, notes=tuple(notes))


def _found(lines: NDArray[Any], others: NDArray[Any]) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """Return which of ascending other lines is nearest to each line, and whether it is the same but for rounding."""
    after = np.clip(np.searchsorted(others.real, lines.real), 1, max(others.size - 1, 1))
    after = np.minimum(after, others.size - 1)
    before = np.maximum(after - 1, 0)
    nearest = np.where(np.abs(others[after] - lines) < np.abs(others[before] - lines), after, before)
    return nearest, np.abs(others[nearest] - lines) <= _SAME * np.abs(lines)


def not_apart(terms: tuple[str, ...], rank: int, observed: tuple[MeasuredFRF, ...]) -> str:
    """Return why the equations do not suffice."""
    loads = {(o.excitation, str(o.assembly)) for o in observed}
    hint = (
        "all of them are responses to one load, which give two terms at most: excite at another coordinate too"
        if len(loads) == 1 and len(terms) == len(TERMS)
        else "measure at another coordinate or another overhang"
    )
    return (
        f"the {len(observed)} receptances cannot tell {names_of(terms)} apart: on no line they give more than {rank} "
        f"of these terms; {hint}, or solve for fewer terms"
    )


def masked_lines(masked: NDArray[Any], count: int) -> str:
    """Return the note on the lines, of so many, whose equations have no finite and unique solution."""
    shown = ", ".join(f"{line:g}" for line in masked.real[:_SHOWN])
    more = f" and {masked.size - _SHOWN} more" if masked.size > _SHOWN else ""
    reason = "their equations have no finite and unique solution"
    return f"{masked.size} of {count} lines are masked, {reason}: {shown} Hz{more}"


def notes_on(
    terms: tuple[str, ...],
    usable: NDArray[np.bool_],
    ambiguous: NDArray[np.bool_],
    dropped: int,
    share: float,
    observed: tuple[MeasuredFRF, ...],
    joint: str,
    rms: float,
    masked: NDArray[Any],
) -> list[str]:
    """Return the notes on a solution; `masked` are the lines without one."""
    notes = [note for one in observed for note in one.notes]
    if dropped:
        notes.append(f"{dropped} lines are left out that not all measurements have")
    if masked.size:
        notes.append(masked_lines(masked, len(usable)))
    known = [name for name in TERMS if name not in terms]
    if known:
        held = ", ".join(f"{name} = {getattr(joint_of(observed[0].assembly, joint), name):g}" for name in known)
        notes.append(f"taken as known: {held}, with their damping; what they are wrong by goes into the rest")
    for column, term in enumerate(terms):
        count = int(usable[:, column].sum())
        if not count:
            notes.append(f"no line says anything of {term} at a standard deviation below {100.0 * share:g} % of it")
        elif count < len(usable):
            notes.append(
                f"{count} of {len(usable)} lines speak of {term} (standard deviation below {100.0 * share:g} %)"
            )
    if rms > _UNSUITED:
        notes.append(
            f"no k + i w c suits all lines: the rms is {rms:.3g} standard deviations; the parts, or what is taken as "
            "known, are not as they are modelled, and the start may be far off"
        )
    if ambiguous.any():
        notes.append(
            f"on {int(ambiguous.sum())} of {len(ambiguous)} lines two stiffnesses explain the data; the one that "
            "agrees with the other lines was taken"
        )
    return notes
