"""Validation of the fields of an FRF: shapes, types and ranges."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from receptance import _checks
from receptance.model.coordinates import measured_coordinates
from receptance.units import FORMS, Form

_MAX_AVERAGES = 10**9
_MAX_MAGNITUDE = 1e50
"""Largest magnitude of a value in SI units: beyond any structure, and its fourth power is still finite."""
_COHERENCE_ROUNDING = 1e-4
"""Excess of a coherence over 1 (or below 0) that is attributed to rounding by the analyser or its file."""


def checked_fields(given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the validated fields of an `FRF` by name, or raise; see there for their meaning."""
    label = given["label"]
    owner = f"FRF {label!r}" if label else "FRF"
    lines = check_lines(owner, given["frequency_hz"])
    array = _response_values(owner, given["values"], lines)
    shape = array.shape
    quality = per_entry(owner, "coherence", given["coherence"], shape)
    coherence_note = ""
    if quality is not None:
        quality, coherence_note = check_coherence(owner, quality, lines)
    checked: dict[str, Any] = {
        "frequency_hz": lines,
        "values": array,
        "form": check_form(owner, given["form"]),
        "responses": measured_coordinates(owner, "responses", given["responses"], shape[1]),
        "excitations": measured_coordinates(owner, "excitations", given["excitations"], shape[2]),
        "decay_rate": _checks.not_negative(owner, "decay_rate", given["decay_rate"], unit="1/s"),
        "coherence": quality,
        "averages": None if given["averages"] is None else average_count(owner, given["averages"]),
        "log_variance": per_entry(owner, "log_variance", given["log_variance"], shape, at_least=0.0),
        "degrees_of_freedom": per_entry(owner, "degrees_of_freedom", given["degrees_of_freedom"], shape, above=0.0),
        "correlated_lines": _checks.by_line(
            owner, "correlated_lines", given["correlated_lines"], lines.shape, least=1.0
        ),
        "usable": _usable_mask(owner, given["usable"], lines.size),
        "labels": check_labels(owner, given["labels"], (shape[1], shape[2])),
        "label": "" if label is None else str(label),
        "source": "" if given["source"] is None else str(given["source"]),
        "notes": check_texts(owner, "notes", given["notes"]) + ((coherence_note,) if coherence_note else ()),
    }
    return _without_undefined_zero_line(owner, checked)


def check_form(owner: str, form: Any) -> Form:
    """Return the form, or raise if it is not receptance, mobility or accelerance."""
    for known in FORMS:
        if form == known:
            return known
    kind = ValueError if isinstance(form, str) else TypeError
    raise kind(f"{owner}: form is {form!r}, expected one of {', '.join(FORMS)}")


def check_lines(owner: str, frequency_hz: ArrayLike) -> NDArray[np.float64]:
    """Return frequency lines `(n,)`: real, finite, ascending, none below 0 Hz."""
    array = _checks.numbers(
        owner, "frequency_hz", frequency_hz, "iuf", "real numbers in Hz (complex lines follow from decay_rate)"
    ).astype(np.float64)
    if array.ndim != 1:
        raise ValueError(f"{owner}: frequency_hz has shape {array.shape}, expected one dimension")
    if not array.size:
        raise ValueError(f"{owner}: frequency_hz is empty, expected at least one line")
    bad = np.flatnonzero(~(np.isfinite(array) & (array >= 0.0)))
    if bad.size:
        raise ValueError(f"{owner}: frequency_hz[{bad[0]}] is {array[bad[0]]:g} Hz, expected a finite number from 0 on")
    bad = np.flatnonzero(np.diff(array) <= 0.0)
    if bad.size:
        raise ValueError(
            f"{owner}: frequency_hz is not ascending: line {bad[0] + 1} is {array[bad[0] + 1]:g} Hz after "
            f"{array[bad[0]]:g} Hz; sort the lines and leave out repeated ones"
        )
    return array


def _response_values(owner: str, values: ArrayLike, frequency_hz: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Return values as complex `(n, n_responses, n_excitations)`; they may still be infinite or NaN."""
    array = _checks.numbers(owner, "values", values, "iufc", "complex numbers").astype(np.complex128)
    n = frequency_hz.size
    if array.shape == (n,):
        array = array.reshape(n, 1, 1)
    if array.ndim != 3 or array.shape[0] != n or 0 in array.shape:
        raise ValueError(
            f"{owner}: values has shape {array.shape} for {n} lines, expected ({n},) or ({n}, responses, excitations)"
        )
    size = np.maximum(np.abs(array.real), np.abs(array.imag))
    excessive = np.argwhere(np.isfinite(size) & (size > _MAX_MAGNITUDE))
    if excessive.size:
        index = tuple(excessive[0])
        raise ValueError(
            f"{owner}: values at {frequency_hz[index[0]]:g} Hz is {array[index]:g}, expected at most "
            f"{_MAX_MAGNITUDE:g} in SI units"
        )
    return np.ascontiguousarray(array)


def per_entry(
    owner: str,
    quantity: str,
    value: ArrayLike | None,
    shape: tuple[int, ...],
    *,
    at_least: float = -np.inf,
    above: float = -np.inf,
) -> NDArray[np.float64] | None:
    """Return real numbers as `(n, n_responses, n_excitations)`, from a number, or a number per line or entry.

    Infinite values are allowed. NaN is checked by `_without_undefined_zero_line`.
    """
    if value is None:
        return None
    array = _checks.numbers(owner, quantity, value, "iuf", "real numbers").astype(np.float64)
    if array.shape not in ((), shape[:1], shape):
        raise ValueError(f"{owner}: {quantity} has shape {array.shape}, expected one number, {shape[:1]} or {shape}")
    if array.shape == shape[:1]:
        array = array[:, None, None]
    array = np.ascontiguousarray(np.broadcast_to(array, shape))
    wrong = (array < at_least) | (array <= above) if above > -np.inf else array < at_least
    if wrong.any():
        index = tuple(int(axis[0]) for axis in np.nonzero(wrong))
        limit = f"more than {above:g}" if above > -np.inf else f"at least {at_least:g}"
        raise ValueError(f"{owner}: {quantity}{list(index)} is {array[index]:g}, expected {limit}")
    return array


def check_coherence(
    owner: str, coherence: NDArray[np.float64], frequency_hz: NDArray[np.float64]
) -> tuple[NDArray[np.float64], str]:
    """Return coherence `(n, ...)` clipped to 0 to 1, and a note if rounding was clipped; NaN is kept.

    A value below 0 or above 1 by more than rounding is a ValueError with the cause and the remedy.
    """
    wrong = (coherence < -_COHERENCE_ROUNDING) | (coherence > 1.0 + _COHERENCE_ROUNDING)
    if wrong.any():
        index = tuple(int(axis[0]) for axis in np.nonzero(wrong))
        others = int(wrong.reshape(len(wrong), -1).any(axis=1).sum()) - 1
        raise ValueError(
            f"{owner}: the coherence at {frequency_hz[index[0]]:g} Hz is {coherence[index]:.4g}"
            + (f" (and outside 0 to 1 on {others} more lines)" if others else "")
            + f", expected 0 to 1; its median is {np.nanmedian(coherence):.2f}. Coherence is the share of the "
            "response's power explained by the force. A value outside 0 to 1 means that the spectra do not "
            "belong together (different averages or windows for force and response, an overwritten record, or another "
            "quantity in this column), so the quality of this FRF is unknown. Measure or export it again, or use the "
            "FRF without its coherence"
        )
    clipped = np.clip(coherence, 0.0, 1.0)
    count = np.count_nonzero(clipped != coherence) - np.count_nonzero(np.isnan(coherence))
    return clipped, f"coherence outside 0 to 1 by rounding on {count} lines: clipped" if count else ""


def _usable_mask(owner: str, value: ArrayLike | None, n: int) -> NDArray[np.bool_] | None:
    if value is None:
        return None
    array = _checks.unmasked(owner, "usable", value)
    if array.dtype.kind != "b" or array.shape != (n,):
        raise ValueError(
            f"{owner}: usable has dtype {array.dtype} and shape {array.shape}, "
            f"expected True or False on each of {n} lines"
        )
    return array


def check_texts(owner: str, quantity: str, value: Iterable[str]) -> tuple[str, ...]:
    """Return texts as a tuple; a single string, which would be split into letters, is refused."""
    if isinstance(value, str) or not isinstance(value, Iterable):
        raise TypeError(f"{owner}: {quantity} is {value!r}, expected a sequence of texts")
    texts = tuple(value)
    for text in texts:
        if not isinstance(text, str):
            raise TypeError(f"{owner}: {quantity} holds {text!r}, expected texts")
    return texts


def check_labels(
    owner: str, value: Sequence[Sequence[str]] | None, counts: tuple[int, int]
) -> tuple[tuple[str, ...], tuple[str, ...]] | None:
    """Return the names of responses and excitations as a pair of tuples."""
    if value is None:
        return None
    sides = list(value) if isinstance(value, Iterable) and not isinstance(value, str) else []
    if len(sides) != 2 or any(isinstance(side, str) or not isinstance(side, Iterable) for side in sides):
        raise TypeError(
            f"{owner}: labels is {value!r}, expected the names of the responses and those of the excitations"
        )
    pair = tuple(str(name) for name in sides[0]), tuple(str(name) for name in sides[1])
    if (len(pair[0]), len(pair[1])) != counts:
        raise ValueError(
            f"{owner}: labels names {len(pair[0])} responses and {len(pair[1])} excitations, "
            f"expected {counts[0]} and {counts[1]}"
        )
    return pair


def average_count(owner: str, value: Any) -> int:
    """Return the number of averages, or raise."""
    try:
        count = int(value.__index__())
    except AttributeError:
        raise TypeError(f"{owner}: averages is {value!r}, expected a whole number") from None
    if not 1 <= count <= _MAX_AVERAGES or isinstance(value, bool):
        raise ValueError(f"{owner}: averages is {value!r}, expected a whole number from 1 to {_MAX_AVERAGES}")
    return count


def _without_undefined_zero_line(owner: str, checked: dict[str, Any]) -> dict[str, Any]:
    """Return the fields, without the line at 0 Hz if it is not finite; raise if any other line is not finite.

    At 0 Hz the receptance of a free structure is infinite, and the coherence of AC-coupled sensors is 0 / 0.
    """
    frequency_hz = checked["frequency_hz"]
    names = [name for name, array in checked.items() if isinstance(array, np.ndarray)]
    bad = {"values": ~np.isfinite(checked["values"])}
    for name in ("coherence", "log_variance", "degrees_of_freedom"):
        if checked[name] is not None:
            bad[name] = np.isnan(checked[name])
    rows = {name: np.flatnonzero(wrong.reshape(frequency_hz.size, -1).any(axis=1)) for name, wrong in bad.items()}
    for name, index in rows.items():
        elsewhere = index[frequency_hz[index] > 0.0]
        if elsewhere.size:
            value = checked[name][elsewhere[0]][bad[name][elsewhere[0]]][0]
            raise ValueError(
                f"{owner}: {name} at {frequency_hz[elsewhere[0]]:g} Hz is {value}, expected a finite number; "
                "leave the line out"
            )
    if not any(index.size for index in rows.values()):
        return checked
    if frequency_hz.size == 1:
        raise ValueError(f"{owner}: the only line is at 0 Hz and not finite")
    undefined = " and ".join(name for name, index in rows.items() if index.size)
    changed: dict[str, Any] = {**checked, **{name: checked[name][1:] for name in names}}
    changed["notes"] = (*checked["notes"], f"the line at 0 Hz is dropped: {undefined} not finite there")
    return changed
