"""Functions of a universal file as FRFs, coherences and time records."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance.frf import FRF
from receptance.io.build import in_si, make_frf, without_phase
from receptance.io.coherence import Coherence
from receptance.io.errors import FileFormatError
from receptance.io.options import ReadOptions, resolve_frf
from receptance.io.time_series import TimeSeries
from receptance.io.uff.header import remembered
from receptance.io.uff.sets import Function, Other, data_sets
from receptance.io.uff.time_records import cycles, time_series
from receptance.io.uff.units import declared_form, declared_unit, directions, expect_abscissa

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.frf.forms import Form

__all__ = ["read_uff"]

_TIME, _FRF, _COHERENCE = 1, 4, 6
_FUNCTIONS = {
    0: "general function",
    1: "time response",
    2: "auto spectrum",
    3: "cross spectrum",
    4: "frequency response function",
    5: "transmissibility",
    6: "coherence",
    9: "power spectral density",
    10: "energy spectral density",
    12: "spectrum",
    26: "multiple coherence",
}


@dataclass(frozen=True, eq=False)
class _Entry:
    """One FRF of one response and one excitation, in SI."""

    function: Function
    form: Form
    directions: tuple[str, str]
    values: NDArray[Any]
    notes: tuple[str, ...]

    @property
    def pair(self) -> tuple[str, str]:
        return self.function.response.label, self.function.reference.label


def read_uff(data: bytes, options: ReadOptions) -> list[FRF | TimeSeries | Coherence]:
    """Return the functions (data sets 58) of a universal file that are FRFs, coherences or time records.

    FRFs of one form on the same lines are one matrix where every response comes with every excitation. A coherence goes
    to the FRF of the same points and lines, else it stands alone. Functions of other kinds are noted.

    Raises
    ------
    FileFormatError
        Whatever cannot be read right, with line or byte.
    """
    items = list(data_sets(data))
    functions = [item for item in items if isinstance(item, Function)]
    by_kind = {kind: [f for f in functions if f.kind == kind] for kind in (_TIME, _FRF, _COHERENCE)}
    if not any(by_kind.values()):
        held = ", ".join(dict.fromkeys(_named(item) for item in items)) or "no data set at all"
        raise FileFormatError(
            "there is no time record, FRF or coherence in the file (data set 58 of function type 1, 4 or 6); "
            f"it holds {held}",
            line=items[0].line.number if items else 1,
        )
    others = [_FUNCTIONS.get(f.kind, f"function of type {f.kind}") for f in functions if f.kind not in by_kind]
    notes = [f"not read: {name} ({others.count(name)} in the file)" for name in dict.fromkeys(others)]
    found: list[FRF | TimeSeries | Coherence] = []
    left = list(by_kind[_COHERENCE])
    for matrix in _matrices([_entry(function, options) for function in by_kind[_FRF]]):
        found.append(_frf(matrix, left, notes, options))
    if not (options.ignore_coherence and found):
        alone = [_Entry(function, "receptance", ("y", "y"), _real(function), function.notes) for function in left]
        found.extend(_coherence(matrix, notes) for matrix in _matrices(alone))
    found.extend(time_series(cycle, notes, options) for cycle in cycles(by_kind[_TIME]))
    return found


def _named(item: Function | Other) -> str:
    if isinstance(item, Other):
        return f"data set {item.kind}"
    return f"{_FUNCTIONS.get(item.kind, 'a function')} (data set 58 of function type {item.kind})"


def _entry(function: Function, options: ReadOptions) -> _Entry:
    """Return one FRF in SI."""
    try:
        expect_abscissa(function, 18)
        form = declared_form(function)
        resolved = resolve_frf(
            options,
            declared=declared_unit(function, form, options),
            form=form,
            directions=directions(function),
            undeclared="neither a data set 164 nor axis labels say in which unit the FRF is",
        )
    except FileFormatError as error:
        raise function.line.error(error.problem) from None
    notes = [*function.notes, *resolved.notes, *without_phase(function.ordinate)]
    values = in_si(function.ordinate, resolved.factor)
    kind = resolved.kind
    return _Entry(function, kind.form, (kind.response, kind.excitation), values, tuple(notes))


def _matrices(entries: Sequence[_Entry]) -> list[list[list[_Entry]]]:
    """Group entries of one form on the same lines to matrices [response][excitation], or leave them single."""
    groups: list[dict[tuple[str, str], _Entry]] = []
    for entry in entries:
        for group in groups:
            first = next(iter(group.values()))
            if entry.pair not in group and entry.form == first.form and _same_lines(entry.function, first.function):
                group[entry.pair] = entry
                break
        else:
            groups.append({entry.pair: entry})
    matrices: list[list[list[_Entry]]] = []
    for group in groups:
        out, into = (list(dict.fromkeys(pair[side] for pair in group)) for side in (0, 1))
        if len(group) == len(out) * len(into) and _directions_agree(group):
            matrices.append([[group[row, column] for column in into] for row in out])
        else:
            matrices.extend([[entry]] for entry in group.values())
    return matrices


def _directions_agree(group: dict[tuple[str, str], _Entry]) -> bool:
    """Return whether a point is either a translation or a rotation throughout."""
    seen: dict[tuple[int, str], str] = {}
    for pair, entry in group.items():
        for side in (0, 1):
            if seen.setdefault((side, pair[side]), entry.directions[side]) != entry.directions[side]:
                return False
    return True


def _same_lines(one: Function, other: Function) -> bool:
    return np.array_equal(one.abscissa, other.abscissa)


def _frf(matrix: list[list[_Entry]], left: list[Function], notes: Sequence[str], options: ReadOptions) -> FRF:
    """Return the FRF of a matrix; the coherences that it takes are removed from those that are left."""
    first = matrix[0][0].function
    values = np.stack([np.stack([entry.values for entry in row], axis=-1) for row in matrix], axis=1)
    coherence = _coherences(matrix, left)
    rows, columns = [row[0] for row in matrix], matrix[0]
    labels = tuple(e.function.response.label for e in rows), tuple(e.function.reference.label for e in columns)
    known: dict[str, Any] = dict(remembered(first.texts).values)
    known.pop("sample_rate_hz", None)
    lines = _lines(first, known.pop("lines", None))
    labelled = known.pop("labels", 1) and (any(labels[0]) or any(labels[1]))
    for name, side, entries in (("responses", 0, rows), ("excitations", 1, columns)):
        places = [remembered(entry.function.texts).coordinates for entry in entries]
        if all(
            place is not None and place[side].direction == e.directions[side]
            for place, e in zip(places, entries, strict=True)
        ):
            known[name] = tuple(place[side] for place in places if place is not None)
    try:
        return make_frf(
            frequency_hz=lines,
            values=values,
            form=matrix[0][0].form,
            directions=([e.directions[0] for e in rows], [e.directions[1] for e in columns]),
            labels=labels if labelled else None,
            coherence=coherence,
            label=first.texts[0],
            notes=[*dict.fromkeys(note for row in matrix for entry in row for note in entry.notes), *notes],
            options=options,
            **known,
        )
    except FileFormatError as error:
        raise first.line.error(error.problem) from None


def _lines(function: Function, exact: tuple[float, float] | None) -> NDArray[np.float64]:
    """Return the frequency lines, from their exact increment where that is remembered and fits."""
    if exact is not None and function.step is not None:
        lines = exact[0] + exact[1] * np.arange(function.abscissa.size, dtype=np.float64)
        if np.allclose(lines, function.abscissa, rtol=1e-5, atol=1e-5 * function.step):
            return lines
    return function.abscissa


def _coherences(matrix: list[list[_Entry]], left: list[Function]) -> NDArray[np.float64] | None:
    """Take the coherences of all entries out of those that are left, or none of them."""
    taken: list[Function] = []
    for entry in (entry for row in matrix for entry in row):
        points = (entry.function.response, entry.function.reference)
        partner = next(
            (
                f
                for f in left
                if f not in taken and (f.response, f.reference) == points and _same_lines(f, entry.function)
            ),
            None,
        )
        if partner is None:
            return None
        taken.append(partner)
    left[:] = [function for function in left if function not in taken]
    return np.stack([_real(f) for f in taken], axis=-1).reshape(-1, len(matrix), len(matrix[0]))


def _real(function: Function) -> NDArray[np.float64]:
    values: NDArray[Any] = function.ordinate
    if np.iscomplexobj(values):
        if np.any(values.imag != 0.0):
            raise function.line.error("the coherence is complex, expected real numbers from 0 to 1")
        values = values.real
    return values


def _coherence(matrix: list[list[_Entry]], notes: Sequence[str]) -> Coherence:
    first = matrix[0][0].function
    labels = tuple(row[0].pair[0] for row in matrix), tuple(entry.pair[1] for entry in matrix[0])
    told = dict.fromkeys(note for row in matrix for entry in row for note in entry.notes)
    try:
        expect_abscissa(first, 18)
        return Coherence(
            frequency_hz=first.abscissa,
            values=np.stack([np.stack([entry.values for entry in row], axis=-1) for row in matrix], axis=1),
            labels=labels if any(labels[0]) or any(labels[1]) else None,
            label=first.texts[0],
            notes=(*told, *notes),
        )
    except ValueError as error:
        problem = error.problem if isinstance(error, FileFormatError) else str(error)
        raise first.line.error(problem) from None
