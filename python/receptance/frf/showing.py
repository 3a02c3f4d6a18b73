"""An FRF for notebooks and for xarray."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from receptance.frf.places import describe
from receptance.report import Table

if TYPE_CHECKING:
    import xarray

    from receptance.frf.frf import FRF

__all__ = ["as_dataset", "describing_table"]

_DIMENSIONS = ("frequency_hz", "response", "excitation")


def describing_table(frf: FRF) -> Table:
    """Return lines, form, places, averages, quality and notes of an FRF."""
    rows = [
        ("lines", f"{frf.frequency_hz.size}, {frf.frequency_hz[0]:g} to {frf.frequency_hz[-1]:g} Hz{_spacing(frf)}"),
        ("form", f"{frf.form} in {', '.join(sorted({unit for row in frf.units for unit in row}))}"),
    ]
    names = frf.labels or ((), ())
    for title, side, labels in zip(("responses", "excitations"), (frf.responses, frf.excitations), names, strict=True):
        words = [
            describe(place) + (f" ({labels[index]})" if labels and labels[index] else "")
            for index, place in enumerate(side)
        ]
        rows.append((title, "; ".join(words)))
    if frf.decay_rate:
        rows.append(("exponential window", f"decay rate {frf.decay_rate:g} 1/s on force and response"))
    if frf.averages is not None:
        rows.append(("averages", str(frf.averages)))
    if frf.coherence is not None:
        rows.append(("coherence", f"median {np.median(frf.coherence):.4g}, lowest {frf.coherence.min():.4g}"))
    if frf.standard_deviation is not None:
        rows.append(("standard deviation", f"median {100.0 * np.median(frf.standard_deviation):.3g} %"))
    if frf.usable is not None:
        rows.append(("usable", f"{np.count_nonzero(frf.usable)} lines{_band(frf)}"))
    if frf.source:
        rows.append(("source", frf.source))
    rows += [("note", note) for note in frf.notes]
    return Table(f"FRF {frf.label}".rstrip(), ("property", "value"), rows)


def _spacing(frf: FRF) -> str:
    steps = np.diff(frf.frequency_hz)
    if not steps.size:
        return ""
    even = bool(np.ptp(steps) <= 1e-6 * steps.max())
    return f", {steps.mean():.6g} Hz apart" if even else f", {steps.min():.6g} to {steps.max():.6g} Hz apart"


def _band(frf: FRF) -> str:
    inside = frf.frequency_hz[frf.usable]
    return f", {inside[0]:g} to {inside[-1]:g} Hz" if inside.size else ""


def as_dataset(frf: FRF) -> xarray.Dataset:
    """Return the FRF as a dataset; see `FRF.to_xarray`."""
    import xarray  # slow to import, and only needed here

    arrays: dict[str, Any] = {"frf": (_DIMENSIONS, frf.values, {"long_name": frf.form})}
    units = {unit for row in frf.units for unit in row}
    if len(units) == 1:
        arrays["frf"][2]["units"] = units.pop()
    words = {
        "coherence": "coherence",
        "log_variance": "variance of the real and of the imaginary part of the logarithm",
        "degrees_of_freedom": "degrees of freedom of the variance",
    }
    for name, long_name in words.items():
        if getattr(frf, name) is not None:
            arrays[name] = (_DIMENSIONS, getattr(frf, name), {"long_name": long_name, "units": "1"})
    for name in ("correlated_lines", "usable"):
        if getattr(frf, name) is not None:
            arrays[name] = (_DIMENSIONS[0], getattr(frf, name))
    coordinates: dict[str, Any] = {
        "frequency_hz": (_DIMENSIONS[0], frf.frequency_hz, {"long_name": "frequency", "units": "Hz"}),
        "unit": (_DIMENSIONS[1:], np.array(frf.units)),
    }
    names = frf.labels or (None, None)
    for title, side, labels in zip(_DIMENSIONS[1:], (frf.responses, frf.excitations), names, strict=True):
        coordinates[title] = (title, [describe(place) for place in side])
        coordinates[f"{title}_direction"] = (title, [place.direction for place in side])
        if labels is not None:
            coordinates[f"{title}_label"] = (title, list(labels))
    attributes = {
        "form": frf.form,
        "decay_rate": frf.decay_rate,
        "responses": [repr(place) for place in frf.responses],
        "excitations": [repr(place) for place in frf.excitations],
        "label": frf.label,
        "source": frf.source,
        "notes": list(frf.notes),
    }
    if frf.averages is not None:
        attributes["averages"] = frf.averages
    return xarray.Dataset(arrays, coordinates, attributes)
