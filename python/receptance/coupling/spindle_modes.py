"""Modes of a spindle, fitted to the responses of the blanks with the spindle as the end of each assembly."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from receptance import modal
from receptance.coupling.blanks import check_blanks
from receptance.coupling.common_lines import check_observations
from receptance.coupling.spindle_receptance import SpindleReceptance
from receptance.errors import ReceptanceWarning
from receptance.fit import Identification, Observation, Tolerance, Unknown, identify
from receptance.fit.covariance import square_root
from receptance.fit.observation import altered
from receptance.model.assembly import Assembly
from receptance.model.coordinates import Coordinate
from receptance.model.terminals import DISCREPANCY_WIDTH, RESIDUALS, ModalPart, Mode

POOR = 2.0
"""Rms of the residuals, in standard deviations, above which modes describe a spindle poorly. Smaller errors of a few
modes with viscous damping are in their `discrepancy`."""
_LOWEST_START = 0.02
"""Lowest damping ratio of a starting mode: a narrower mode cannot move away from a peak of noise."""
_HIGHEST_DAMPING = 0.3
_ABOVE = 1.5
"""Start frequency of the mode above the band, relative to the end of the band."""
_RESIDUAL_SHARE = 0.5
"""Share of the residual that the start of this mode accounts for."""
_HIGHEST_FREQUENCY = 5.0
"""Upper bound of the frequency of this mode, relative to the end of the band."""
_DISCREPANCIES = (1e-6, 1.0)
"""Range of the relative model error."""
_SYMMETRIC = 1e-9
"""Relative size below which an entry of a correlation, or an eigenvalue, is zero."""
_FREQUENCY_CHANGE = 0.25
"""Largest relative change of a natural frequency from its start."""


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class SpindleModes:
    """Modes of a spindle as identified by `fit_spindle`."""

    part: ModalPart
    """The spindle as the end of an assembly; its band is that of the responses. Its `discrepancy` is that of a few
    modes with viscous damping: it is estimated from the residuals of the fit, and zero if these contain noise only."""
    covariance: NDArray[np.float64]
    """`(m, m)` covariance of the parameters at `addresses`, in SI units: that of the fit, multiplied by the square of
    the rms of the fit if that is above 1."""
    identification: Identification | None = None
    """The fit: values and their covariance by address, residuals, notes; None for modes that were read from a file."""

    @property
    def addresses(self) -> tuple[str, ...]:
        """Addresses of the modes' parameters in any assembly that ends with `part`."""
        return tuple(f"{self.part.name}.{quantity}" for quantity in self.part.addresses)

    @property
    def tolerances(self) -> tuple[Tolerance, ...]:
        """The covariance as tolerances, for a fit or a diagnosis of tools on this spindle; see `mode_tolerances`."""
        return mode_tolerances(self.part, self.covariance)

    def standard_deviation(
        self,
        machine: Assembly,
        frequency_hz: ArrayLike,
        *,
        response: Coordinate | None = None,
        excitation: Coordinate | None = None,
    ) -> NDArray[np.float64]:
        """Relative standard deviation `(n,)` of the magnitude of a receptance of an assembly that ends with `part`.

        First order in the errors of the modes and in the model error. `response` and `excitation` are those of
        `Assembly.receptance`.
        """
        h, modes, error = self._sensitivities(machine, frequency_hz, response, excitation)
        slope = (modes / h[:, None]).real
        variance = np.einsum("ni,ij,nj->n", slope, self.covariance, slope)
        variance += np.sum(np.abs(error / h[:, None]) ** 2, axis=1)
        return np.asarray(np.sqrt(np.maximum(variance, 0.0)))

    def draws(
        self,
        machine: Assembly,
        frequency_hz: ArrayLike,
        *,
        count: int = 100,
        seed: int = 0,
        response: Coordinate | None = None,
        excitation: Coordinate | None = None,
    ) -> NDArray[np.complex128]:
        """Return random receptances `(count, n)` of an assembly that ends with `part`, for error bands.

        First order in the logarithm; all lines of a draw share one model error.
        """
        h, modes, error = self._sensitivities(machine, frequency_hz, response, excitation)
        random = np.random.default_rng(seed)
        values = random.standard_normal((count, len(self.addresses))) @ square_root(self.covariance).T
        normal = random.normal(size=(count, 3)) + 1j * random.normal(size=(count, 3))
        return np.asarray(h * np.exp((values @ modes.T + normal @ error.T) / h))

    def _sensitivities(
        self,
        machine: Assembly,
        frequency_hz: ArrayLike,
        response: Coordinate | None,
        excitation: Coordinate | None,
    ) -> tuple[NDArray[np.complex128], NDArray[np.complex128], NDArray[np.complex128]]:
        """Return a receptance `(n,)`, its derivatives, and its changes for one model error of each entry."""
        residuals = [f"{self.part.name}.{quantity}" for quantity in RESIDUALS]
        addresses = [*self.addresses, *residuals]
        h, slope = machine.derivatives(frequency_hz, addresses, response=response, excitation=excitation)
        count = len(self.addresses)
        root = self.part.error_root(np.asarray(frequency_hz))
        errors = np.zeros((h.size, 3), dtype=np.complex128)
        if root is not None:
            errors = np.einsum("nij,ni->nj", root, slope[..., count:])
        return h, slope[..., :count], errors

    def __repr__(self) -> str:
        return f"SpindleModes({self.part!r})"


def fit_spindle(
    observations: Sequence[Observation],
    spindle: SpindleReceptance,
    *,
    modes: int | Sequence[float] | None = None,
    name: str = "spindle",
    tolerances: Sequence[Tolerance] = (),
    threads: int | None = None,
) -> SpindleModes:
    """Fit modes and a residual to responses of blanks in a spindle.

    The start values are the modes of the line-by-line spindle from `receptance.modal.fit_modes`. The fit is that of
    `identify` to the responses themselves, with the spindle as the far end of each blank: the noise is weighted
    correctly, lines that the inversion cannot use still contribute, and the result has the covariance of all
    parameters. One additional mode above the band represents the modes there.

    Parameters
    ----------
    observations : sequence of Observation
        As for `identify_spindle`.
    spindle : SpindleReceptance
        Result of `identify_spindle`.
    modes : int or sequence of float, optional
        Number of modes, or their approximate frequencies in Hz; by default as many as `fit_modes` finds.
    name : str, optional
        First word of the addresses of the parameters.
    tolerances : sequence of Tolerance, optional
        Errors of the blanks, which are fitted as well.
    threads : int, optional
        As in `Assembly.receptance`.

    Raises
    ------
    TypeError, ValueError
        As `identify_spindle`; lines with another decay rate of the window; no modes in the band.
    """
    observed = check_observations(tuple(observations))
    check_blanks(observed)
    start = _start(spindle, modes, name=name)
    low, high = (float(np.asarray(spindle.frequency_hz).real[i]) for i in (0, -1))
    coupled, errors = _coupled(observed, start), tuple(tolerances)
    unknowns = _unknowns(start, high)
    fit = identify(coupled, unknowns, starts=1, tolerances=errors, threads=threads, noise="stated")
    if not fit.converged or fit.rms > POOR:
        # Modes with real shapes first: a complex one may leave its peak and become a background of all lines.
        real = [unknown for unknown in unknowns if not unknown.address.endswith("_imaginary")]
        first = identify(_coupled(observed, _with_real_shapes(start)), real, starts=1, threads=threads, noise="stated")
        values = {unknown.address: first.values.get(unknown.address, 0.0) for unknown in unknowns}
        started = [replace(unknown, start=values[unknown.address]) for unknown in unknowns]
        again = identify(coupled, started, starts=1, tolerances=errors, threads=threads, noise="stated")
        fit = min(fit, again, key=lambda each: each.rms)
    fitted = {address: f"{name}.{address}" for address in start.addresses}
    part = start.with_values({own: fit.values[address] for own, address in fitted.items() if address in fit.values})
    discrepancy = _discrepancy(_coupled(observed, part), part)
    return SpindleModes(
        part=replace(part, band_hz=(low, high), discrepancy=discrepancy),
        covariance=_covariance(fit, part),
        identification=fit,
    )


def _with_real_shapes(part: ModalPart) -> ModalPart:
    modes = [replace(mode, y_imaginary=0.0, theta_imaginary=0.0) for mode in part.modes]
    return replace(part, modes=tuple(modes))


def _covariance(fit: Identification, part: ModalPart) -> NDArray[np.float64]:
    """Return the covariance of the numbers of a part in SI units, zero for those that are not fitted.

    Errors of the blanks are among its causes.
    """
    order, names = list(fit.values), [f"{part.name}.{quantity}" for quantity in part.addresses]
    rows = [i for i, name in enumerate(names) if name in fit.values]
    columns = [order.index(names[i]) for i in rows]
    values = np.array([fit.values[names[i]] for i in rows])
    logarithmic = np.array([fit.unknowns[column].scale == "log" for column in columns])
    slope = np.where(logarithmic, values * np.log(10.0), 1.0) * max(fit.rms, 1.0)
    result = np.zeros((len(names), len(names)))
    result[np.ix_(rows, rows)] = np.asarray(fit.covariance)[np.ix_(columns, columns)] * np.outer(slope, slope)
    return result


def mode_tolerances(part: ModalPart, covariance: ArrayLike) -> tuple[Tolerance, ...]:
    """Return the covariance of the numbers of a modal part as tolerances, which a fit or a diagnosis takes.

    The errors are written as a sum of independent ones, the principal components of their correlation, each of which is
    a tolerance of several numbers. Where they are small beside the noise of the data the fit leaves them at zero.

    Parameters
    ----------
    part : ModalPart
        With a name, which is the first word of the addresses.
    covariance : array_like
        `(m, m)` covariance of the numbers at `part.addresses`, in SI units (Hz for frequencies); zero for exact ones.

    Raises
    ------
    ValueError
        No name; a covariance of another shape, not finite, not symmetric or not positive semidefinite.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance import ModalPart, Mode
    >>> from receptance.coupling import mode_tolerances
    >>> spindle = ModalPart(modes=[Mode(frequency_hz=900.0, damping_ratio=0.03, y=0.2, theta=1.0)], name="spindle")
    >>> deviation = np.zeros(len(spindle.addresses))
    >>> deviation[spindle.addresses.index("mode[0].frequency_hz")] = 3.0
    >>> [(error.name, dict(error.moves)) for error in mode_tolerances(spindle, np.diag(deviation**2))]
    [('spindle, error 1', {'spindle.mode[0].frequency_hz': 3.0})]
    """
    owner = "mode_tolerances"
    if not part.name:
        raise ValueError(f"{owner}: the modal part has no name, expected name=... as in the addresses of its numbers")
    matrix = np.asarray(covariance, dtype=np.float64)
    size = len(part.addresses)
    if matrix.shape != (size, size):
        raise ValueError(
            f"{owner}: covariance has shape {matrix.shape}, expected ({size}, {size}): rows in the order of "
            f"`part.addresses`, {', '.join(part.addresses[:3])}, ..."
        )
    if not np.isfinite(matrix).all():
        raise ValueError(f"{owner}: covariance has a number that is not finite")
    if (np.diag(matrix) < 0.0).any():
        address = part.addresses[int(np.argmin(np.diag(matrix)))]
        raise ValueError(f"{owner}: covariance has a negative variance of {address}, expected zero or more")
    deviation = np.sqrt(np.diag(matrix))
    exact = deviation == 0.0
    scale = np.where(exact, 1.0, deviation)
    with np.errstate(over="ignore"):
        correlation = matrix / scale[:, None] / scale
    if not np.isfinite(correlation).all():
        raise ValueError(f"{owner}: covariance has an entry far above the variances of its row and column")
    if np.abs(correlation - correlation.T).max() > _SYMMETRIC:
        raise ValueError(f"{owner}: covariance is not symmetric")
    values, vectors = np.linalg.eigh(0.5 * (correlation + correlation.T))
    if values[0] < -_SYMMETRIC * size:
        raise ValueError(f"{owner}: covariance has a negative eigenvalue, expected a positive semidefinite matrix")
    tolerances: list[Tolerance] = []
    for value, vector in zip(values[::-1], vectors.T[::-1], strict=True):
        if value <= _SYMMETRIC:
            break
        shares = np.sqrt(value) * vector * deviation * np.sign(vector[np.argmax(np.abs(vector))])
        kept = np.abs(vector) > _SYMMETRIC
        moves = {
            f"{part.name}.{address}": float(share)
            for address, share, is_kept in zip(part.addresses, shares, kept, strict=True)
            if is_kept and share
        }
        tolerances.append(Tolerance(name=f"{part.name}, error {len(tolerances) + 1}", moves=moves))
    return tuple(tolerances)


def _discrepancy(observed: Sequence[Observation], part: ModalPart) -> float:
    """Return the relative model error by restricted maximum likelihood of the residuals of the fit.

    The errors of the three entries are Gaussian with a common relative standard deviation s, independent at nodes that
    are 0.25 apart in the logarithm of frequency, and linear between them. Let J and K be the derivatives of the
    residuals r with respect to the parameters of the modes and to these errors, and P the projector on the complement
    of J. Then K^T P r is normal with the covariance W + s^2 W^2, W = K^T P K. In the eigenvectors of W the likelihood,
    which s maximises, is a product.
    """
    addresses = [f"{part.name}.{quantity}" for quantity in part.addresses]
    low = float(np.log(min(observation.frequency_hz[0].real for observation in observed)))
    high = float(np.log(max(observation.frequency_hz[-1].real for observation in observed)))
    nodes = np.linspace(low, high, int(np.ceil((high - low) / DISCREPANCY_WIDTH)) + 1)
    blocks = []
    for observation in observed:
        lines, deviation = observation.frequency_hz, np.asarray(observation.standard_deviation)
        h, slope = observation.assembly.derivatives(
            lines, addresses, response=observation.response, excitation=observation.excitation
        )
        weighted = slope / (h * deviation)[:, None]
        residual = np.log(observation.receptance / h) / deviation
        # The last parameters are the residuals; their derivatives are those with respect to the entries.
        root = replace(part, discrepancy=1.0).error_root(lines)
        assert root is not None
        entries = weighted[:, -len(RESIDUALS) :] * np.einsum("nii->ni", root)
        shares = np.stack([np.interp(np.log(lines.real), nodes, row) for row in np.eye(nodes.size)], axis=1)
        error = (entries[:, :, None] * shares[:, None, :]).reshape(lines.size, -1)
        # Real and imaginary parts are rows; an error has a real and an imaginary part, which are columns.
        columns = np.concatenate([weighted, error, 1j * error, residual[:, None]], axis=1)
        blocks += [columns.real, columns.imag]
    whole = np.concatenate(blocks)
    jacobian, other = whole[:, : len(addresses)], whole[:, len(addresses) :]
    basis, _ = np.linalg.qr(jacobian / np.maximum(np.linalg.norm(jacobian, axis=0), 1e-300))
    projected = other - basis @ (basis.T @ other)
    error, residual = projected[:, :-1], projected[:, -1]
    size, vectors = np.linalg.eigh(error.T @ error)
    determined = size > 1e-10 * size[-1]
    size, vectors = size[determined], vectors[:, determined]
    squares = (vectors.T @ (error.T @ residual)) ** 2 / size

    def deviance(logarithm: float) -> float:
        growth = 1.0 + np.exp(2.0 * logarithm) * size
        return float(np.sum(np.log(growth) + squares / growth))

    grid = np.log(np.geomspace(*_DISCREPANCIES, 60))
    best = int(np.argmin([deviance(x) for x in grid]))
    if best == 0:
        return 0.0
    bounds = (grid[best - 1], grid[min(best + 1, grid.size - 1)])
    return float(np.exp(scipy.optimize.minimize_scalar(deviance, bounds=bounds, method="bounded").x))


def _start(spindle: SpindleReceptance, modes: int | Sequence[float] | None, *, name: str) -> ModalPart:
    """Return start values: modes of the usable lines of a spindle, one mode above the band, and a residual."""
    with warnings.catch_warnings():
        # Warnings on standard errors and on the number of modes do not matter for start values.
        warnings.simplefilter("ignore", ReceptanceWarning)
        fit = modal.fit_modes(spindle.as_frf(), modes, background="above", highest_damping=_HIGHEST_DAMPING)
    size = np.sqrt(np.median(np.abs(np.einsum("nii->ni", spindle.matrix[spindle.usable])), axis=0))
    parts = []
    for frequency, damping, constant in zip(fit.frequency_hz, fit.damping_ratio, fit.modal_constant, strict=True):
        y, theta = _shape(constant, size)
        damping = float(np.clip(damping, _LOWEST_START, _HIGHEST_DAMPING))
        shape = {"y": y.real, "theta": theta.real, "y_imaginary": y.imag, "theta_imaginary": theta.imag}
        parts.append(Mode(frequency_hz=float(frequency), damping_ratio=damping, **shape))
    # At the first line the modes above the band contribute a constant.
    first = fit.frf.complex_frequency_hz[:1]
    residual = (fit.receptance(first) - fit.receptance(first, background=False))[0].real
    high = float(np.asarray(spindle.frequency_hz).real[-1])
    # At the end of the band their contribution depends on frequency: one mode above the band represents that.
    w = 2.0 * np.pi * _ABOVE * high
    y, theta = _shape(_RESIDUAL_SHARE * w * w * residual.astype(np.complex128), size)
    parts.append(Mode(frequency_hz=_ABOVE * high, damping_ratio=0.03, y=y.real, theta=theta.real))
    residual = residual - _RESIDUAL_SHARE * np.outer([y.real, theta.real], [y.real, theta.real]) / (w * w)
    return ModalPart(
        modes=tuple(parts),
        residual_y=float(residual[0, 0]),
        residual_theta=float(residual[1, 1]),
        residual_ytheta=float(0.5 * (residual[0, 1] + residual[1, 0])),
        name=name,
    )


def _shape(constant: NDArray[np.complex128], size: NDArray[np.float64]) -> tuple[complex, complex]:
    """Return a shape psi = (y, theta) with psi psi^T close to a modal constant."""
    # The component that is larger relative to its typical size follows from the diagonal, the other from the coupling.
    first = int(abs(constant[1, 1]) / size[1] ** 2 > abs(constant[0, 0]) / size[0] ** 2)
    larger = complex(np.sqrt(constant[first, first] + 0j))
    other = 0.5 * complex(constant[0, 1] + constant[1, 0]) / larger if larger else 0j
    y, theta = (larger, other) if first == 0 else (other, larger)
    return (y, theta) if y.real >= 0.0 else (-y, -theta)


def _coupled(observed: Sequence[Observation], part: ModalPart) -> list[Observation]:
    """Return the observations with the spindle as the far end of each blank."""
    coupled = []
    for observation in observed:
        blank = observation.assembly
        assembly = Assembly([*blank.elements.values(), part], blank.attachments.values())
        coupled.append(altered(observation, assembly=assembly))
    return coupled


def _unknowns(start: ModalPart, high_hz: float) -> list[Unknown]:
    """Return the parameters as unknowns with bounds around the start."""
    result = []
    names = ("y", "theta", "y_imaginary", "theta_imaginary")
    shapes = np.array([[getattr(mode, name) for name in names] for mode in start.modes])
    largest = np.tile(10.0 * np.abs(shapes[:, :2]).max(axis=0) + 1e-12, 2)
    for index, mode in enumerate(start.modes):
        address = f"{start.name}.mode[{index}]"
        f = mode.frequency_hz
        lower, upper = high_hz, _HIGHEST_FREQUENCY * high_hz
        if f <= high_hz:
            lower, upper = (1.0 - _FREQUENCY_CHANGE) * f, (1.0 + _FREQUENCY_CHANGE) * f
        result.append(Unknown(address=f"{address}.frequency_hz", lower=lower, upper=upper, start=f))
        if f <= high_hz:
            # The damping of the mode above the band is held: below it its effect is that of the imaginary shape.
            result.append(Unknown(address=f"{address}.damping_ratio", lower=1e-5, upper=0.6, start=mode.damping_ratio))
        for quantity, value, bound in zip(names, shapes[index].tolist(), largest, strict=True):
            result.append(Unknown(address=f"{address}.{quantity}", lower=-bound, upper=bound, start=value))
    # The bounds are ten times the sum of the modes at the end of the band.
    w = 2.0 * np.pi * high_hz
    y, theta = np.abs(shapes[:, :2]).max(axis=0) * np.sqrt(len(shapes)) / w
    for quantity, scale in (("residual_y", y * y), ("residual_theta", theta * theta), ("residual_ytheta", y * theta)):
        value = getattr(start, quantity)
        bound = 100.0 * max(scale, abs(value))
        result.append(Unknown(address=f"{start.name}.{quantity}", lower=-bound, upper=bound, start=value))
    return result
