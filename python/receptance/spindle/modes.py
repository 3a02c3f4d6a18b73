"""A spindle as modes: fitted to the blanks' own responses, with the spindle as a part of the one forward model."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance.assembly import Assembly
from receptance.errors import ReceptanceWarning
from receptance.identification import Identification, MeasuredFRF, Unknown, identify
from receptance.identification.inversion_input import check_observations
from receptance.modal_parts import ModalPart, Mode
from receptance.spindle.blanks import check_blanks
from receptance.terminals import ENTRIES, RESIDUALS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.spindle.receptance import SpindleReceptance

__all__ = ["SpindleModes", "fit_spindle", "start_from"]

_HIGHEST_DAMPING = 0.3
_ABOVE = 1.5
"""Where the mode above the band starts, over the end of the band."""
_BEYOND = 0.5
"""Share of the residual that it takes at the start."""
_FARTHEST = 5.0
_AROUND = 0.04
"""Share of its frequency to either side of a line over which modes and lines are compared."""
_REACH = 0.25
"""How far a natural frequency may move from its start, as a share."""


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class SpindleModes:
    """A spindle's modes as `fit_spindle` finds them.

    Attributes
    ----------
    part : ModalPart
        The spindle, to end an assembly with; its band is that of the responses.
    identification : Identification
        The fit: values and their covariance by address, residuals, notes.
    lines_hz : ndarray
        `(n,)` usable lines of the spindle line by line.
    discrepancy : ndarray
        `(n, 3, 3)` how far the modes are from it, as a covariance of y/F, theta/M and y/M: the mean distance over the
        lines around each, which few modes with viscous damping may not take up, and what those lines cannot tell.
    """

    part: ModalPart
    identification: Identification
    lines_hz: NDArray[np.float64]
    discrepancy: NDArray[np.complex128]

    @property
    def addresses(self) -> tuple[str, ...]:
        """Addresses of the modes' parameters in any assembly that ends with `part`."""
        return tuple(f"{self.part.name}.{quantity}" for quantity in self.part.columns_of)

    @property
    def covariance(self) -> NDArray[np.float64]:
        """`(m, m)` covariance of the parameters at `addresses`, in SI units.

        What the modes leave over beyond noise widens it: it is that of the fit times the square of its rms, if above 1.
        """
        fit = self.identification
        order = [list(fit.values).index(address) for address in self.addresses]
        scales = [fit.unknowns[index].scale for index in order]
        values = np.array([fit.values[address] for address in self.addresses])
        slope = np.where([scale == "log" for scale in scales], values * np.log(10.0), 1.0) * max(fit.rms, 1.0)
        result: NDArray[np.float64] = np.asarray(fit.covariance)[np.ix_(order, order)] * np.outer(slope, slope)
        return result

    def standard_deviation(self, machine: Assembly, frequency_hz: Any, **places: Any) -> NDArray[np.float64]:
        """Standard deviation of the magnitude of a receptance of an assembly that ends with `part`, relative, `(n,)`.

        First order in the errors of the modes and in their distance from the spindle line by line; `places` as in
        `Assembly.receptance`.
        """
        h, modes, away, between = self._reactions(machine, frequency_hz, places)
        own = (modes / h[:, None]).real
        variance = np.einsum("ni,ij,nj->n", own, self.covariance, own)
        other = away / h[:, None]
        variance += np.einsum("ni,nij,nj->n", other, between, other.conj()).real
        result: NDArray[np.float64] = np.sqrt(np.maximum(variance, 0.0))
        return result

    def draws(
        self, machine: Assembly, frequency_hz: Any, *, count: int = 100, seed: int = 0, **places: Any
    ) -> NDArray[np.complex128]:
        """Draw receptances of an assembly that ends with `part`, `(count, n)`, for bands of what is made of them.

        First order in the logarithm; the distance from the lines is drawn as one for all lines of a draw.
        """
        h, modes, away, between = self._reactions(machine, frequency_hz, places)
        random = np.random.default_rng(seed)
        whole = random.multivariate_normal(np.zeros(len(self.addresses)), self.covariance, size=count, method="eigh")
        moved = whole @ modes.T
        value, shape = np.linalg.eigh(between)
        reach = np.einsum("ni,nij,nj->nj", away, shape, np.sqrt(np.maximum(value, 0.0)))
        normal = random.normal(size=(count, 3)) + 1j * random.normal(size=(count, 3))
        result: NDArray[np.complex128] = h * np.exp((moved + normal @ reach.T) / h)
        return result

    def _reactions(
        self, machine: Assembly, frequency_hz: Any, places: dict[str, Any]
    ) -> tuple[NDArray[np.complex128], NDArray[np.complex128], NDArray[np.complex128], NDArray[np.complex128]]:
        """Return a receptance `(n,)`, its derivatives by modes and by the plane's entries, and the discrepancy."""
        through = [f"{self.part.name}.{quantity}" for quantity in RESIDUALS]
        h, slope = machine.derivatives(frequency_hz, [*self.addresses, *through], **places)
        lines, flat = np.asarray(frequency_hz).real, self.discrepancy.reshape(len(self.lines_hz), -1)
        between = np.stack([np.interp(lines, self.lines_hz, column) for column in flat.T], axis=1).reshape(-1, 3, 3)
        own = len(self.addresses)
        return h, slope[..., :own], slope[..., own:], between

    def __repr__(self) -> str:
        return f"SpindleModes({self.part!r}, rms {self.identification.rms:.3g})"


def fit_spindle(
    observations: Sequence[MeasuredFRF],
    found: SpindleReceptance,
    *,
    modes: int | Sequence[float] | None = None,
    name: str = "spindle",
    threads: int | None = None,
) -> SpindleModes:
    """Fit modes and a residual to responses of blanks in a spindle, starting from the spindle line by line.

    The line-by-line spindle gives the start: its modes by `receptance.modal.fit_modes`. What is fitted are the
    responses themselves, by `identify`, with the spindle as the far end of each blank: noise is weighed where it is,
    lines that no inversion can decide still count for what they say, and the result has the covariance of every
    parameter. One mode more, above the band, stands for those there.

    Parameters
    ----------
    observations : sequence of MeasuredFRF
        As for `identify_spindle`.
    found : SpindleReceptance
        Its result.
    modes : int or sequence of float, optional
        How many modes, or near which frequencies in Hz; by default as many as the line-by-line spindle shows.
    name : str, optional
        First word of the addresses of the parameters.
    threads : int, optional
        As in `Assembly.receptance`.

    Raises
    ------
    TypeError, ValueError
        As `identify_spindle`; lines with a window of another decay rate; no modes in the band.
    """
    observed = check_observations(tuple(observations))
    check_blanks(observed)
    start = start_from(found, modes, name=name)
    low, high = (float(np.asarray(found.frequency_hz).real[i]) for i in (0, -1))
    coupled = [
        _with(one, Assembly([*one.assembly.elements.values(), start], one.assembly.attachments.values()))
        for one in observed
    ]
    fit = identify(coupled, _unknowns(start, high), starts=1, threads=threads)
    values = {address.split(".", 1)[1]: value for address, value in fit.values.items()}
    part = replace(start.with_values(values), band_hz=(low, high))
    lines, away = _discrepancy(found, part)
    return SpindleModes(part=part, identification=fit, lines_hz=lines, discrepancy=away)


def _discrepancy(found: SpindleReceptance, part: ModalPart) -> tuple[NDArray[np.float64], NDArray[np.complex128]]:
    """Return usable lines, and how far the modes are from them, as a covariance."""
    rows = np.flatnonzero(found.usable)
    lines = np.asarray(found.frequency_hz)[rows]
    matrix, places = found.matrix[rows], lines.real
    off = np.stack([matrix[:, i, j] for i, j in ENTRIES], axis=1) - part.entries(lines)
    covariance = found.covariance[rows]
    result = np.empty(covariance.shape, dtype=np.complex128)
    for index, place in enumerate(places):
        first, last = np.searchsorted(places, [place * (1.0 - _AROUND), place * (1.0 + _AROUND)])
        near = slice(int(first), max(int(last), int(first) + 1))
        mean = off[near].mean(axis=0)
        # Half of the square each for the real and the imaginary part.
        result[index] = 0.5 * np.outer(mean, mean.conj()) + covariance[near].mean(axis=0) / (near.stop - near.start)
    return places, result


def start_from(
    found: SpindleReceptance, modes: int | Sequence[float] | None = None, *, name: str = "spindle"
) -> ModalPart:
    """Return modes, one of them above the band, and a residual that suit the usable lines of a spindle."""
    import warnings

    from receptance.modal import fit_modes

    with warnings.catch_warnings():
        # What is said of its standard errors and of its number of modes does not matter for a start.
        warnings.simplefilter("ignore", ReceptanceWarning)
        fit = fit_modes(found.as_frf(), modes, background="above", highest_damping=_HIGHEST_DAMPING)
    size = np.sqrt(np.median(np.abs(np.einsum("nii->ni", found.matrix[found.usable])), axis=0))
    kept = []
    for frequency, damping, constant in zip(fit.frequency_hz, fit.damping_ratio, fit.modal_constant, strict=True):
        y, theta = _shape(constant, size)
        damping = float(np.clip(damping, 1e-4, _HIGHEST_DAMPING))
        shape = {"y": y.real, "theta": theta.real, "y_imaginary": y.imag, "theta_imaginary": theta.imag}
        kept.append(Mode(frequency_hz=float(frequency), damping_ratio=damping, **shape))
    # Modes above the band, near it or not, are a constant at the first line.
    first = fit.frf.complex_frequency_hz[:1]
    residual = (fit.receptance(first) - fit.receptance(first, background=False))[0].real
    high = float(np.asarray(found.frequency_hz).real[-1])
    # Modes above the band are no constant at its end: one mode there takes the curvature.
    w = 2.0 * np.pi * _ABOVE * high
    y, theta = _shape(_BEYOND * w * w * residual.astype(np.complex128), size)
    kept.append(Mode(frequency_hz=_ABOVE * high, damping_ratio=0.03, y=y.real, theta=theta.real))
    residual = residual - _BEYOND * np.outer([y.real, theta.real], [y.real, theta.real]) / (w * w)
    return ModalPart(
        modes=tuple(kept),
        residual_y=float(residual[0, 0]),
        residual_theta=float(residual[1, 1]),
        residual_ytheta=float(0.5 * (residual[0, 1] + residual[1, 0])),
        name=name,
    )


def _shape(constant: NDArray[np.complex128], size: NDArray[np.float64]) -> tuple[complex, complex]:
    """Return the shape psi = (y, theta) whose psi psi^T comes nearest to a modal constant."""
    # What is larger beside its typical size is taken from the diagonal, and the other from the coupling.
    first = int(abs(constant[1, 1]) / size[1] ** 2 > abs(constant[0, 0]) / size[0] ** 2)
    own = complex(np.sqrt(constant[first, first] + 0j))
    other = 0.5 * complex(constant[0, 1] + constant[1, 0]) / own if own else 0j
    y, theta = (own, other) if first == 0 else (other, own)
    return (y, theta) if y.real >= 0.0 else (-y, -theta)


def _with(one: MeasuredFRF, assembly: Assembly) -> MeasuredFRF:
    return MeasuredFRF(
        assembly=assembly,
        frequency_hz=one.frequency_hz,
        receptance=one.receptance,
        response=one.response,
        excitation=one.excitation,
        standard_deviation=one.standard_deviation,
        correlated_lines=one.correlated_lines,
        label=one.label,
        notes=one.notes,
    )


def _unknowns(start: ModalPart, high_hz: float) -> list[Unknown]:
    """Return all parameters with bounds around the start."""
    result = []
    names = ("y", "theta", "y_imaginary", "theta_imaginary")
    shapes = np.array([[getattr(mode, name) for name in names] for mode in start.modes])
    reach = np.tile(10.0 * np.abs(shapes[:, :2]).max(axis=0) + 1e-12, 2)
    for index, mode in enumerate(start.modes):
        own = f"{start.name}.mode[{index}]"
        f = mode.frequency_hz
        ends = ((1.0 - _REACH) * f, (1.0 + _REACH) * f) if f <= high_hz else (high_hz, _FARTHEST * high_hz)
        result.append(Unknown(address=f"{own}.frequency_hz", lower=ends[0], upper=ends[1], start=f))
        result.append(Unknown(address=f"{own}.damping_ratio", lower=1e-5, upper=0.6, start=mode.damping_ratio))
        for which, quantity in enumerate(names):
            value = float(shapes[index, which])
            result.append(Unknown(address=f"{own}.{quantity}", lower=-reach[which], upper=reach[which], start=value))
    # As large as what the modes add up to at the end of the band, tenfold.
    w = 2.0 * np.pi * high_hz
    y, theta = np.abs(shapes[:, :2]).max(axis=0) * np.sqrt(len(shapes)) / w
    for quantity, scale in (("residual_y", y * y), ("residual_theta", theta * theta), ("residual_ytheta", y * theta)):
        value = start.value(quantity)
        most = 100.0 * max(scale, abs(value))
        result.append(Unknown(address=f"{start.name}.{quantity}", lower=-most, upper=most, start=value))
    return result
