"""Standard errors from the hits themselves: what the fit would have found without each of them."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance.errors import ReceptanceWarning

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.frf import FRF
    from receptance.identification import Identification, MeasuredFRF
    from receptance.measurement import Hits

__all__ = ["relative_errors", "without_each"]


def without_each(hits: Hits, **settings: Any) -> tuple[FRF, ...]:
    """Estimate the FRF without each of the hits in turn.

    Parameters
    ----------
    hits : Hits
        What `find_hits` returned, at least three of them kept.
    settings
        Of `estimate_frf`.

    Raises
    ------
    ValueError
        Fewer than three hits.
    """
    from receptance.measurement import estimate_frf

    if len(hits.kept) < 3:
        raise ValueError(f"without_each: there are {len(hits.kept)} hits, expected at least three")
    with warnings.catch_warnings():
        # Whatever there is to say was said of all hits together.
        warnings.simplefilter("ignore", ReceptanceWarning)
        # Only the values count, so that no variance has to be pooled.
        own = {"pooled_lines": 1, **settings}
        return tuple(estimate_frf(hits.without(hit.number, reason="left out"), **own) for hit in hits.kept)


def relative_errors(
    found: Identification,
    observed: Sequence[MeasuredFRF],
    entries: Sequence[tuple[int, int]],
    addresses: Mapping[str, str],
    left_out: Sequence[FRF],
) -> dict[str, float]:
    """Return standard errors of the logarithms of the values, by the jackknife over hits.

    Windows and noise on the force make neighbouring lines alike, by how much nobody knows beforehand; hits are
    independent whatever was done to them. To first order, a fit of other data moves by (J^T J)^-1 J^T of the residuals'
    change, so nothing is fitted again.

    Parameters
    ----------
    found : Identification
        The fit.
    observed : sequence of MeasuredFRF
        What was fitted.
    entries : sequence of (int, int)
        Response and excitation of each in the FRFs.
    addresses : mapping of str to str
        Names and addresses of the parameters.
    left_out : sequence of FRF
        The same without each hit, on the same lines.
    """
    slopes: list[NDArray[np.float64]] = []
    changes: list[NDArray[np.float64]] = []
    values = np.array([found.values[address] for address in addresses.values()])
    for one, assembly, (response, excitation) in zip(observed, found.assemblies, entries, strict=True):
        h, slope = assembly.derivatives(
            one.frequency_hz, list(addresses.values()), response=one.response, excitation=one.excitation
        )
        spread = np.ones(h.size) if one.standard_deviation is None else one.standard_deviation
        weighted = slope * values / h[:, None] / spread[:, None]
        slopes.append(np.concatenate([weighted.real, weighted.imag]))
        own = []
        for frf in left_out:
            receptance = frf.to("receptance")
            rows = np.searchsorted(receptance.frequency_hz, one.frequency_hz.real - 1e-9)
            change = np.log(receptance.values[rows, response, excitation] / one.receptance) / spread
            own.append(np.concatenate([change.real, change.imag]))
        changes.append(np.stack(own, axis=1))
    moved = np.linalg.lstsq(np.concatenate(slopes), np.concatenate(changes), rcond=None)[0]
    n = len(left_out)
    variance = (n - 1) / n * np.sum((moved - moved.mean(axis=1, keepdims=True)) ** 2, axis=1)
    return dict(zip(addresses, np.sqrt(variance).tolist(), strict=True))
