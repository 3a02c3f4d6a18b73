"""Elastic and rigid holders on the springs of the taper, as assemblies, and fits of the springs to complex FRFs."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Literal, Unpack

import numpy as np
from numpy.typing import NDArray

from receptance import _checks, hammer
from receptance.coupling.rigid_holder import Body, as_rigid, body_of
from receptance.errors import ReceptanceWarning
from receptance.fit import Floor, Identification, Observation, Unknown, identify
from receptance.fit.covariance import confidence_multiplier
from receptance.frf import FRF
from receptance.hammer import Hits
from receptance.hammer.estimate import EstimateKeywords
from receptance.model.assembly import Assembly
from receptance.model.beams import Part
from receptance.model.joints import GroundSpring

BodyModel = Literal["elastic", "rigid"]
Contact = Literal["spread", "fading", "ends"]

_BONDED = 1e16
"""Stiffness in N/m of a bonded taper, far above that of any section of a holder."""
_POINTS = 12
"""Number of points of the springs along the taper."""
_FADING = tuple(
    tuple(((i + 0.5) / _POINTS) ** 2 for i in order) for order in (range(_POINTS - 1, -1, -1), range(_POINTS))
)


@dataclass(frozen=True, kw_only=True)
class Holder:
    """A holder and the position of its taper.

    Parameters
    ----------
    part : Part
        The holder from the tip to the pull stud.
    big_end, small_end : float
        Ends of the taper, in m from the tip.

    Raises
    ------
    ValueError, TypeError
        Ends outside the part or in the wrong order.

    Examples
    --------
    >>> from receptance import STEEL, Part, Segment
    >>> from receptance.coupling import Holder
    >>> flange = Segment(length=0.04, outer_diameter=0.1, material=STEEL)
    >>> taper = Segment(length=0.1, outer_diameter=0.055, material=STEEL)
    >>> holder = Holder(part=Part([flange, taper], name="holder"), big_end=0.04, small_end=0.14)
    >>> springs = {"k_z1": 5e9, "c_z1": 1500.0}
    >>> [holder.axial(**springs, body=body).natural_frequencies(1e4).round() for body in ("elastic", "rigid")]
    [array([5091.]), array([5408.])]
    """

    part: Part
    big_end: float
    small_end: float

    def __post_init__(self) -> None:
        if not isinstance(self.part, Part):
            raise TypeError(f"Holder: part is {self.part!r}, expected a Part")
        big = _checks.not_negative("Holder", "big_end", self.big_end, unit="m")
        small = _checks.positive("Holder", "small_end", self.small_end, unit="m")
        if not big < small <= self.part.length * (1.0 + 1e-9):
            raise ValueError(
                f"Holder: big_end is {big:g} m and small_end {small:g} m, expected 0 <= big_end < small_end <= "
                f"{self.part.length:g} m, the length of the part"
            )

    @cached_property
    def body(self) -> Body:
        """Mass, centre of gravity and moment of inertia."""
        return body_of(self.part)

    @property
    def z1(self) -> float:
        """Distance in m of the big end from the centre of gravity towards the tip: L1 of the paper."""
        return self.body.position(self.big_end)

    @property
    def z2(self) -> float:
        """Distance in m of the small end from the centre of gravity towards the tip: -L2 of the paper."""
        return self.body.position(self.small_end)

    def axial(
        self, k_z1: float, c_z1: float = 0.0, *, body: BodyModel = "elastic", contact: Contact = "spread"
    ) -> Assembly:
        """Return the holder on the axial spring `taper`, in axial motion.

        Parameters
        ----------
        k_z1, c_z1 : float
            Stiffness in N/m and damping in N s/m of the whole taper.
        body : {"elastic", "rigid"}, optional
            Elastic rods, or rigid ones as in the paper.
        contact : {"spread", "fading", "ends"}, optional
            Uniform along the taper; concentrated at both ends, as the paper infers from wear; or at the big end only,
            as in figure 3 of the paper.
        """
        _checks.one_of("Holder", "contact", contact, Contact)
        length = 0.0 if contact == "ends" else self.small_end - self.big_end
        weights = [1.0] * _POINTS if contact != "fading" else [a + b for a, b in zip(*_FADING, strict=True)]
        spring = GroundSpring(
            k_y=k_z1,
            c_y=c_z1,
            part=self._name,
            position=self.big_end,
            length=length,
            weights=tuple(weights),
            name="taper",
        )
        return Assembly([self._part(body)], [spring], motion="axial")

    def radial(
        self,
        k_x1: float,
        k_x2: float,
        c_x1: float = 0.0,
        c_x2: float = 0.0,
        *,
        body: BodyModel = "elastic",
        contact: Contact = "spread",
    ) -> Assembly:
        """Return the holder on the radial springs `big_end` and `small_end`, in bending.

        Parameters
        ----------
        k_x1, k_x2 : float
            Stiffnesses in N/m, at the big and at the small end.
        c_x1, c_x2 : float, optional
            Dampings in N s/m.
        body : {"elastic", "rigid"}, optional
            Elastic beams, or rigid ones as in the paper.
        contact : {"spread", "fading", "ends"}, optional
            Each spring uniform over its half of the taper, as in figure 15 of the paper; over the whole taper, weighted
            with the square of the distance from the other end; or at the end only.
        """
        _checks.one_of("Holder", "contact", contact, Contact)
        share = {"spread": 0.5, "fading": 1.0, "ends": 0.0}[contact]
        length = share * (self.small_end - self.big_end)
        # Fading springs share their points; the other two divide the points between them.
        count = _POINTS if contact == "fading" else _POINTS // 2
        weights = _FADING if contact == "fading" else [(1.0,) * count] * 2
        springs = [
            GroundSpring(k_y=k, c_y=c, part=self._name, position=start, length=length, weights=shares, name=name)
            for name, k, c, start, shares in (
                ("big_end", k_x1, c_x1, self.big_end, weights[0]),
                ("small_end", k_x2, c_x2, self.small_end - length, weights[1]),
            )
        ]
        return Assembly([self._part(body)], springs)

    def bonded(self, motion: Literal["axial", "bending"]) -> Assembly:
        """Return the limit of stiff springs, in which the taper is bonded to a rigid spindle."""
        if motion == "axial":
            return self.axial(_BONDED)
        return self.radial(_BONDED, _BONDED)

    @property
    def _name(self) -> str:
        return self.part.name or "holder"

    def _part(self, body: BodyModel) -> Part:
        named = Part(self.part.segments, name=self._name)
        _checks.one_of("Holder", "body", body, BodyModel)
        return as_rigid(named) if body == "rigid" else named


_ADDRESSES: dict[str, dict[str, str]] = {
    "axial": {"k_z1": "taper.k_y", "c_z1": "taper.c_y"},
    "bending": {"k_x1": "big_end.k_y", "k_x2": "small_end.k_y", "c_x1": "big_end.c_y", "c_x2": "small_end.c_y"},
}
"""Addresses of the parameters by their symbols in the paper."""
_BOUNDS = {"k": (1e6, 1e13), "c": (1e-1, 1e7)}
"""Bounds of stiffnesses in N/m and of dampings in N s/m."""


@dataclass(frozen=True, kw_only=True)
class TaperFit:
    """Stiffnesses and dampings of the taper, fitted to FRFs."""

    values: dict[str, float]
    """Stiffnesses k_z1, or k_x1 and k_x2, in N/m and dampings c_z1, or c_x1 and c_x2, in N s/m."""
    standard_errors: dict[str, float]
    """Standard errors of the values, to first order."""
    intervals: dict[str, tuple[float, float]]
    rms: float
    """Root mean square of the residuals, in standard deviations if the FRFs have a variance; about one for a correct
    model."""
    assembly: Assembly
    """The model with these values."""
    identification: Identification
    """The fit itself."""


def fit_taper(
    holder: Holder,
    frf: FRF,
    *,
    motion: Literal["axial", "bending"],
    body: BodyModel = "elastic",
    contact: Contact = "spread",
    low_hz: float | None = None,
    high_hz: float | None = None,
    floor: float | Floor = 0.0,
    start: Mapping[str, float] | None = None,
    left_out: Sequence[FRF] = (),
) -> TaperFit:
    """Fit K_Z1 and C_Z1, or K_X1, K_X2, C_X1 and C_X2, to all entries of an FRF.

    FRFs at two points, or at one drive point, are sufficient in bending to choose between the two solutions of the
    natural frequencies, because masses are known.

    Parameters
    ----------
    holder : Holder
        The holder, with exact mass and dimensions.
    frf : FRF
        Axial or radial; coordinates are positions along the holder in direction "y".
    motion : {"axial", "bending"}
        Direction of hits and responses.
    body, contact : optional
        As in `Holder.axial` and `Holder.radial`.
    low_hz, high_hz : float, optional
        Band of the lines in Hz.
    floor : float or Floor, optional
        As in `Observation.from_frf`.
    start : mapping of str to float, optional
        Start values; by default they are determined in stages from the peaks.
    left_out : sequence of FRF, optional
        FRFs without one of the hits each, from `without_each`. Standard errors and intervals are then those of the
        jackknife, with one degree of freedom less than hits, instead of those from the variance of the FRF.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance import FRF, STEEL, Part, Segment
    >>> from receptance.coupling import Holder, fit_taper
    >>> segments = [Segment(length=x, outer_diameter=d, material=STEEL) for x, d in ((0.04, 0.1), (0.1, 0.055))]
    >>> holder = Holder(part=Part(segments, name="holder"), big_end=0.04, small_end=0.14)
    >>> f = np.arange(3000.0, 7000.0, 20.0)
    >>> frf = FRF(frequency_hz=f, values=holder.axial(5e9, 1500.0).receptance(f), log_variance=1e-4)
    >>> {name: f"{value:.4g}" for name, value in fit_taper(holder, frf, motion="axial").values.items()}
    {'k_z1': '5e+09', 'c_z1': '1500'}
    """
    _checks.one_of("fit_taper", "motion", motion, _ADDRESSES)
    addresses = _ADDRESSES[motion]
    values = {name: {"k": 1e9, "c": 1e3}[name[0]] for name in addresses} | dict(start or {})
    if motion == "axial":
        assembly = holder.axial(**values, body=body, contact=contact)
    else:
        assembly = holder.radial(**values, body=body, contact=contact)
    entries = list(np.ndindex(frf.shape[1:]))
    observed = [
        Observation.from_frf(
            assembly, frf.select(responses=i, excitations=j), low_hz=low_hz, high_hz=high_hz, floor=floor
        )
        for i, j in entries
    ]
    unknowns = [
        Unknown(address=address, lower=_BOUNDS[name[0]][0], upper=_BOUNDS[name[0]][1], start=values[name])
        for name, address in addresses.items()
    ]
    fit = identify(observed, unknowns, strategy="staged" if start is None else "direct", starts=1, noise="stated")
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
    if len(hits.kept) < 3:
        raise ValueError(f"without_each: there are {len(hits.kept)} hits, expected at least three")
    with warnings.catch_warnings():
        # The estimate from all hits has given these warnings already.
        warnings.simplefilter("ignore", ReceptanceWarning)
        # Only the values are used, so the variance is not pooled.
        keywords: EstimateKeywords = {"pooled_lines": 1, **settings}
        return tuple(hammer.estimate_frf(hits.without(hit.number, reason="left out"), **keywords) for hit in hits.kept)


def _relative_errors(
    fit: Identification,
    observed: Sequence[Observation],
    entries: Sequence[tuple[int, ...]],
    addresses: Mapping[str, str],
    left_out: Sequence[FRF],
) -> dict[str, float]:
    """Return standard errors of the logarithms of the values, by the jackknife over hits.

    Windows and noise on the force correlate neighbouring lines to an unknown degree, whereas hits are independent. To
    first order, the result of a fit changes by (J^T J)^-1 J^T times the change of the residuals, so the fit is not
    repeated. The entries are the indices of response and excitation of each observation in the FRFs.
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
