"""Stiffnesses and dampings of the taper, fitted to complex FRFs, with jackknife errors over the hits."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Unpack

import numpy as np
from numpy.typing import NDArray

from receptance.errors import ReceptanceWarning
from receptance.identification import Floor, MeasuredFRF, Unknown, identify
from receptance.identification.covariance import confidence_multiplier
from receptance.taper.holder import BodyModel, Contact, Holder

if TYPE_CHECKING:
    from receptance.frf import FRF
    from receptance.identification import Identification
    from receptance.measurement import Hits
    from receptance.measurement.estimate import EstimateKeywords
    from receptance.model.assembly import Assembly

__all__ = ["TaperFit", "fit_axial", "fit_radial", "without_each"]

_AXIAL = {"k_z1": "taper.k_y", "c_z1": "taper.c_y"}
_RADIAL = {"k_x1": "big_end.k_y", "k_x2": "small_end.k_y", "c_x1": "big_end.c_y", "c_x2": "small_end.c_y"}
"""Addresses of the parameters by their symbols in the paper."""
_BOUNDS = {"k": (1e6, 1e13), "c": (1e-1, 1e7)}
"""Bounds of stiffnesses in N/m and of dampings in N s/m."""


@dataclass(frozen=True, kw_only=True)
class TaperFit:
    """Stiffnesses and dampings of the taper, fitted to FRFs.

    Attributes
    ----------
    values : dict of str to float
        Stiffnesses k_z1, or k_x1 and k_x2, in N/m and dampings c_z1, or c_x1 and c_x2, in N s/m.
    standard_errors : dict of str to float
        Standard errors of the values, to first order.
    intervals : dict of str to (float, float)
        95 % intervals.
    rms : float
        Root mean square of the residuals, in standard deviations if the FRFs have a variance; about one for a correct
        model.
    assembly : Assembly
        The model with these values.
    identification : Identification
        The fit itself.
    """

    values: dict[str, float]
    standard_errors: dict[str, float]
    intervals: dict[str, tuple[float, float]]
    rms: float
    assembly: Assembly
    identification: Identification


def fit_axial(
    holder: Holder,
    frf: FRF,
    *,
    body: BodyModel = "elastic",
    contact: Contact = "spread",
    low_hz: float | None = None,
    high_hz: float | None = None,
    floor: float | Floor = 0.0,
    start: Mapping[str, float] | None = None,
    left_out: Sequence[FRF] = (),
) -> TaperFit:
    """Fit K_Z1 and C_Z1 to an axial FRF.

    Parameters
    ----------
    holder : Holder
        The holder, with exact mass and dimensions.
    frf : FRF
        One response to one axial hit; coordinates are positions along the holder in direction "y".
    body, contact : optional
        As in `Holder.axial`.
    low_hz, high_hz : float, optional
        Band of the lines in Hz.
    floor : float or Floor, optional
        As in `MeasuredFRF.from_frf`.
    start : mapping of str to float, optional
        Start values; by default they are determined in stages from the peaks.
    left_out : sequence of FRF, optional
        FRFs without one of the hits each, from `without_each`. Standard errors and intervals are then those of the
        jackknife, with one degree of freedom less than hits, instead of those from the variance of the FRF.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance import FRF, STEEL, Part, Segment
    >>> from receptance.taper import Holder, fit_axial
    >>> segments = [Segment(length=x, outer_diameter=d, material=STEEL) for x, d in ((0.04, 0.1), (0.1, 0.055))]
    >>> holder = Holder(part=Part(segments, name="holder"), big_end=0.04, small_end=0.14)
    >>> f = np.arange(3000.0, 7000.0, 20.0)
    >>> frf = FRF(frequency_hz=f, values=holder.axial(5e9, 1500.0).receptance(f), log_variance=1e-4)
    >>> {name: f"{value:.4g}" for name, value in fit_axial(holder, frf).values.items()}
    {'k_z1': '5e+09', 'c_z1': '1500'}
    """
    values = {"k_z1": 1e9, "c_z1": 1e3} | dict(start or {})
    assembly = holder.axial(**values, body=body, contact=contact)
    observed = [MeasuredFRF.from_frf(assembly, frf, low_hz=low_hz, high_hz=high_hz, floor=floor)]
    return _fit(observed, _AXIAL, values, start is None, [(0, 0)], left_out)


def fit_radial(
    holder: Holder,
    frf: FRF,
    *,
    body: BodyModel = "elastic",
    contact: Contact = "spread",
    low_hz: float | None = None,
    high_hz: float | None = None,
    floor: float | Floor = 0.0,
    start: Mapping[str, float] | None = None,
    left_out: Sequence[FRF] = (),
) -> TaperFit:
    """Fit K_X1, K_X2, C_X1 and C_X2 to all entries of a radial FRF; parameters as in `fit_axial`.

    FRFs at two points, or at one drive point, are sufficient to choose between the two solutions of the natural
    frequencies, because masses are known.
    """
    values = {"k_x1": 1e9, "k_x2": 1e9, "c_x1": 1e3, "c_x2": 1e3} | dict(start or {})
    assembly = holder.radial(**values, body=body, contact=contact)
    _, responses, excitations = frf.shape
    entries = [(i, j) for i in range(responses) for j in range(excitations)]
    observed = [
        MeasuredFRF.from_frf(
            assembly, frf.select(responses=i, excitations=j), low_hz=low_hz, high_hz=high_hz, floor=floor
        )
        for i, j in entries
    ]
    return _fit(observed, _RADIAL, values, start is None, entries, left_out)


def _fit(
    observed: Sequence[MeasuredFRF],
    addresses: Mapping[str, str],
    values: Mapping[str, float],
    staged: bool,
    entries: Sequence[tuple[int, int]],
    left_out: Sequence[FRF],
) -> TaperFit:
    unknowns = [
        Unknown(address=address, lower=_BOUNDS[name[0]][0], upper=_BOUNDS[name[0]][1], start=values[name])
        for name, address in addresses.items()
    ]
    fit = identify(observed, unknowns, strategy="staged" if staged else "direct", starts=1)
    fitted = {name: fit.values[address] for name, address in addresses.items()}
    errors = {name: fit.standard_errors[address] for name, address in addresses.items()}
    intervals = {name: fit.interval(address) for name, address in addresses.items()}
    if left_out:
        relative = _relative_errors(fit, observed, entries, addresses, left_out)
        errors = {name: fitted[name] * error for name, error in relative.items()}
        multiplier = confidence_multiplier(0.95, len(left_out) - 1)
        factors = {name: math.exp(multiplier * error) for name, error in relative.items()}
        intervals = {name: (fitted[name] / factor, fitted[name] * factor) for name, factor in factors.items()}
    return TaperFit(
        values=fitted,
        standard_errors=errors,
        intervals=intervals,
        rms=fit.rms,
        assembly=fit.assemblies[0],
        identification=fit,
    )


def without_each(hits: Hits, **settings: Unpack[EstimateKeywords]) -> tuple[FRF, ...]:
    """Estimate the FRFs without one of the hits each.

    Parameters
    ----------
    hits : Hits
        Result of `find_hits` with at least three kept hits.
    settings
        Keyword arguments of `estimate_frf`.

    Raises
    ------
    ValueError
        Fewer than three hits.
    """
    from receptance.measurement import estimate_frf

    if len(hits.kept) < 3:
        raise ValueError(f"without_each: there are {len(hits.kept)} hits, expected at least three")
    with warnings.catch_warnings():
        # The estimate from all hits has given these warnings already.
        warnings.simplefilter("ignore", ReceptanceWarning)
        # Only the values are used, so the variance is not pooled.
        own: EstimateKeywords = {"pooled_lines": 1, **settings}
        return tuple(estimate_frf(hits.without(hit.number, reason="left out"), **own) for hit in hits.kept)


def _relative_errors(
    fit: Identification,
    observed: Sequence[MeasuredFRF],
    entries: Sequence[tuple[int, int]],
    addresses: Mapping[str, str],
    left_out: Sequence[FRF],
) -> dict[str, float]:
    """Return standard errors of the logarithms of the values, by the jackknife over hits.

    Windows and noise on the force correlate neighbouring lines to an unknown degree, whereas hits are independent. To
    first order, the result of a fit changes by (J^T J)^-1 J^T times the change of the residuals, so the fit is not
    repeated.

    Parameters
    ----------
    fit : Identification
        The fit.
    observed : sequence of MeasuredFRF
        Fitted observations.
    entries : sequence of (int, int)
        Indices of response and excitation of each observation in the FRFs.
    addresses : mapping of str to str
        Names and addresses of the parameters.
    left_out : sequence of FRF
        FRFs without one hit each, on the same lines.
    """
    slopes: list[NDArray[np.float64]] = []
    changes: list[NDArray[np.float64]] = []
    values = np.array([fit.values[address] for address in addresses.values()])
    receptances = [frf.to("receptance") for frf in left_out]
    for observation, assembly, (response, excitation) in zip(observed, fit.assemblies, entries, strict=True):
        lines = observation.frequency_hz
        deviation = np.ones(lines.size) if observation.standard_deviation is None else observation.standard_deviation
        h, slope = assembly.derivatives(
            lines, list(addresses.values()), response=observation.response, excitation=observation.excitation
        )
        weighted = slope * values / h[:, None] / deviation[:, None]
        slopes.append(np.concatenate([weighted.real, weighted.imag]))
        rows = [np.searchsorted(frf.frequency_hz, lines.real - 1e-9) for frf in receptances]
        estimates = [frf.values[row, response, excitation] for frf, row in zip(receptances, rows, strict=True)]
        change = np.log(np.stack(estimates, axis=1) / observation.receptance[:, None]) / deviation[:, None]
        changes.append(np.concatenate([change.real, change.imag]))
    change_of_fit = np.linalg.lstsq(np.concatenate(slopes), np.concatenate(changes), rcond=None)[0]
    n = len(left_out)
    variance = (n - 1) / n * np.sum((change_of_fit - change_of_fit.mean(axis=1, keepdims=True)) ** 2, axis=1)
    return dict(zip(addresses, np.sqrt(variance).tolist(), strict=True))
