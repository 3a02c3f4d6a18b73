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
from receptance.terminals import RESIDUALS

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
_SPACING = 0.25
"""Distance in the logarithm of frequency over which an error of the model may change."""
_SHARES = (1e-6, 1.0)
"""Least and largest relative error of the model that is considered."""
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
    discrepancy : float
        Relative standard deviation of the model error of y/F, theta/M and y/M: what few modes with viscous damping
        cannot represent. It is estimated from the residuals of the fit, and zero where they show noise only.
    """

    part: ModalPart
    identification: Identification
    discrepancy: float

    @property
    def addresses(self) -> tuple[str, ...]:
        """Addresses of the modes' parameters in any assembly that ends with `part`."""
        return tuple(f"{self.part.name}.{quantity}" for quantity in self.part.addresses)

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

        First order in the errors of the modes and in the model error; `places` as in `Assembly.receptance`.
        """
        h, modes, away = self._reactions(machine, frequency_hz, places)
        own = (modes / h[:, None]).real
        variance = np.einsum("ni,ij,nj->n", own, self.covariance, own)
        variance += np.sum(np.abs(away / h[:, None]) ** 2, axis=1)
        result: NDArray[np.float64] = np.sqrt(np.maximum(variance, 0.0))
        return result

    def draws(
        self, machine: Assembly, frequency_hz: Any, *, count: int = 100, seed: int = 0, **places: Any
    ) -> NDArray[np.complex128]:
        """Draw receptances of an assembly that ends with `part`, `(count, n)`, for bands of what is made of them.

        First order in the logarithm; the model error is drawn once for all lines of a draw.
        """
        h, modes, away = self._reactions(machine, frequency_hz, places)
        random = np.random.default_rng(seed)
        whole = random.multivariate_normal(np.zeros(len(self.addresses)), self.covariance, size=count, method="eigh")
        normal = random.normal(size=(count, 3)) + 1j * random.normal(size=(count, 3))
        result: NDArray[np.complex128] = h * np.exp((whole @ modes.T + normal @ away.T) / h)
        return result

    def _reactions(
        self, machine: Assembly, frequency_hz: Any, places: dict[str, Any]
    ) -> tuple[NDArray[np.complex128], NDArray[np.complex128], NDArray[np.complex128]]:
        """Return a receptance `(n,)`, its derivatives by modes, and its changes by one model error of each entry."""
        through = [f"{self.part.name}.{quantity}" for quantity in RESIDUALS]
        h, slope = machine.derivatives(frequency_hz, [*self.addresses, *through], **places)
        own = len(self.addresses)
        errors = self.discrepancy * _magnitudes(self.part, np.asarray(frequency_hz))
        return h, slope[..., :own], slope[..., own:] * errors

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
    fit = identify([_coupled(one, start) for one in observed], _unknowns(start, high), starts=1, threads=threads)
    values = {address.split(".", 1)[1]: value for address, value in fit.values.items()}
    part = start.with_values(values)
    return SpindleModes(
        part=replace(part, band_hz=(low, high)),
        identification=fit,
        discrepancy=_discrepancy([_coupled(one, part) for one in observed], part),
    )


def _magnitudes(part: ModalPart, lines: NDArray[Any]) -> NDArray[np.float64]:
    """Return the root sum of squares of what modes and residual contribute to y/F, theta/M and y/M, `(n, 3)`.

    A model error is relative to this: at an antiresonance contributions cancel, their errors do not.
    """
    terms = [np.abs(mode.entries(lines)[:, :2]) for mode in part.modes]
    terms.append(np.tile(np.abs([part.residual_y, part.residual_theta]), (lines.size, 1)))
    y, theta = np.sqrt(np.sum(np.square(terms), axis=0)).T
    coupling = np.sqrt(np.sum([np.prod(term, axis=1) for term in terms], axis=0))
    return np.stack([y, theta, coupling], axis=1)


def _discrepancy(observed: Sequence[MeasuredFRF], part: ModalPart) -> float:
    """Return the relative model error that makes the residuals of the fit most likely.

    The errors of the three entries are Gaussian with a common relative standard deviation s, independent at
    frequencies 0.25 apart in the logarithm and linear between. With J and K the derivatives of the residuals r by the
    parameters of the modes and by these errors, and P the projector on the complement of J, K^T P r is normal with the
    covariance W + s^2 W^2, W = K^T P K. In the eigenvectors of W the likelihood is a product; s maximises it
    (restricted maximum likelihood).
    """
    from scipy.optimize import minimize_scalar

    own = [f"{part.name}.{quantity}" for quantity in part.addresses]
    ends = [np.log([one.frequency_hz[i].real for one in observed]) for i in (0, -1)]
    low, high = float(ends[0].min()), float(ends[1].max())
    nodes = np.linspace(low, high, int(np.ceil((high - low) / _SPACING)) + 1)
    blocks = []
    for one in observed:
        lines = one.frequency_hz
        h, slope = one.assembly.derivatives(lines, own, response=one.response, excitation=one.excitation)
        weighted = slope / (h * np.asarray(one.standard_deviation))[:, None]
        residual = np.log(one.receptance / h) / one.standard_deviation
        # The residuals are the last parameters, and their derivatives those by the entries.
        reach = weighted[:, -len(RESIDUALS) :] * _magnitudes(part, lines)
        shares = np.stack([np.interp(np.log(lines.real), nodes, row) for row in np.eye(nodes.size)], axis=1)
        error = (reach[:, :, None] * shares[:, None, :]).reshape(lines.size, -1)
        # Real and imaginary parts are rows; an error has a real and an imaginary part, which are columns.
        columns = np.concatenate([weighted, error, 1j * error, residual[:, None]], axis=1)
        blocks += [columns.real, columns.imag]
    whole = np.concatenate(blocks)
    jacobian, rest = whole[:, : len(own)], whole[:, len(own) :]
    basis, _ = np.linalg.qr(jacobian / np.maximum(np.linalg.norm(jacobian, axis=0), 1e-300))
    rest = rest - basis @ (basis.T @ rest)
    error, residual = rest[:, :-1], rest[:, -1]
    size, vectors = np.linalg.eigh(error.T @ error)
    told = size > 1e-10 * size[-1]
    size, squares = size[told], (vectors[:, told].T @ (error.T @ residual)) ** 2 / size[told]

    def deviance(logarithm: float) -> float:
        growth = 1.0 + np.exp(2.0 * logarithm) * size
        return float(np.sum(np.log(growth) + squares / growth))

    grid = np.linspace(np.log(_SHARES[0]), np.log(_SHARES[1]), 60)
    best = int(np.argmin([deviance(x) for x in grid]))
    if best == 0:
        return 0.0
    around = (grid[best - 1], grid[min(best + 1, grid.size - 1)])
    return float(np.exp(minimize_scalar(deviance, bounds=around, method="bounded").x))


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


def _coupled(one: MeasuredFRF, part: ModalPart) -> MeasuredFRF:
    return MeasuredFRF(
        assembly=Assembly([*one.assembly.elements.values(), part], one.assembly.attachments.values()),
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
