"""All springs and dashpots of the taper at once, from complex FRFs through the one forward model."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from receptance.identification import Floor, MeasuredFRF, Unknown, identify
from receptance.identification.spread import quantile
from receptance.taper.holder import BodyModel, Contact, Holder
from receptance.taper.jackknife import relative_errors

if TYPE_CHECKING:
    from receptance.assembly import Assembly
    from receptance.frf import FRF
    from receptance.identification import Identification

__all__ = ["TaperFit", "fit_axial", "fit_radial"]

AXIAL = {"k_z1": "taper.k_y", "c_z1": "taper.c_y"}
RADIAL = {"k_x1": "big_end.k_y", "k_x2": "small_end.k_y", "c_x1": "big_end.c_y", "c_x2": "small_end.c_y"}
"""The paper's symbols and the addresses of the assembly."""
_BOUNDS = {"k": (1e6, 1e13), "c": (1e-1, 1e7)}


@dataclass(frozen=True, kw_only=True)
class TaperFit:
    """What the FRFs say of the taper.

    Attributes
    ----------
    values : dict of str to float
        Stiffnesses k_z1, or k_x1 and k_x2, in N/m and dampings c_z1, or c_x1 and c_x2, in N s/m.
    standard_errors : dict of str to float
        Of the values, to first order.
    intervals : dict of str to (float, float)
        95 % intervals.
    rms : float
        Of the residuals, in standard deviations where the FRFs state their variance: near one where the model is right.
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
        The holder; its mass and shape are taken as they are.
    frf : FRF
        One response to one hit along the axis; coordinates are places along the holder, in direction "y".
    body, contact : optional
        As in `Holder.axial`.
    low_hz, high_hz : float, optional
        Band of the lines.
    floor : float or Floor, optional
        As in `MeasuredFRF.from_frf`.
    start : mapping of str to float, optional
        Where to start; by default the fit is led there by way of the peak.
    left_out : sequence of FRF, optional
        The FRF without each of the hits, from `without_each`. Standard errors and intervals then come from them
        (jackknife), with one degree of freedom less than hits, and not from the variance that the FRF states.

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
    return _fit(observed, AXIAL, values, start is None, [(0, 0)], left_out)


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
    """Fit K_X1, K_X2, C_X1 and C_X2 to FRFs across; parameters as in `fit_axial`, all entries of the FRF are used.

    Two points tell the two solutions of the natural frequencies apart by themselves, and so does one drive point,
    because masses are known.
    """
    values = {"k_x1": 1e9, "k_x2": 1e9, "c_x1": 1e3, "c_x2": 1e3} | dict(start or {})
    assembly = holder.radial(**values, body=body, contact=contact)
    _, outs, ins = frf.shape
    entries = [(i, j) for i in range(outs) for j in range(ins)]
    observed = [
        MeasuredFRF.from_frf(
            assembly, frf.select(responses=i, excitations=j), low_hz=low_hz, high_hz=high_hz, floor=floor
        )
        for i, j in entries
    ]
    return _fit(observed, RADIAL, values, start is None, entries, left_out)


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
    found = identify(observed, unknowns, strategy="staged" if staged else "direct", starts=1)
    own = {name: found.values[address] for name, address in addresses.items()}
    errors = {name: found.standard_errors[address] for name, address in addresses.items()}
    intervals = {name: found.interval(address) for name, address in addresses.items()}
    if left_out:
        relative = relative_errors(found, observed, entries, addresses, left_out)
        errors = {name: own[name] * error for name, error in relative.items()}
        reach = quantile(0.95, len(left_out) - 1)
        factors = {name: math.exp(reach * error) for name, error in relative.items()}
        intervals = {name: (own[name] / factor, own[name] * factor) for name, factor in factors.items()}
    return TaperFit(
        values=own,
        standard_errors=errors,
        intervals=intervals,
        rms=found.rms,
        assembly=found.assemblies[0],
        identification=found,
    )
