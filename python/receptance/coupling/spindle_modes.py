"""Modes of a spindle, fitted to the responses of the blanks with the spindle as the end of each assembly."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from receptance.coupling.blanks import check_blanks
from receptance.coupling.common_lines import check_observations, common_lines
from receptance.coupling.unknown_modes import bounds_of_modes, start_modes
from receptance.fit import Identification, Observation, Tolerance, Unknown, identify
from receptance.fit.covariance import square_root
from receptance.fit.observation import altered
from receptance.model.assembly import Assembly
from receptance.model.coordinates import Coordinate
from receptance.model.terminals import DISCREPANCY_WIDTH, RESIDUALS, ModalPart, Mode

POOR = 2.0
"""Rms of the residuals, in standard deviations, above which modes describe a spindle poorly. Smaller errors of a few
modes with viscous damping are in their `discrepancy`."""
_MOST_MODES = 24
"""Largest number of modes that the responses may show."""
_DISCREPANCIES = (1e-6, 1.0)
"""Range of the relative model error."""
_SHARE = 0.6
"""Its quantile that is stated: the bands of simulated tools then contain 93 % for a shaft with hysteretic damping and
99 % for modes."""
_STEPS = 200
"""Values at which its likelihood is computed."""
_AT_BOUND = 1e-6
"""Largest distance from a bound, as a share of the range, of a number that is at it."""
_SYMMETRIC = 1e-9
"""Relative size below which an entry of a correlation, or an eigenvalue, is zero."""


@dataclass(frozen=True, kw_only=True, eq=False, repr=False)
class SpindleModes:
    """Modes of a spindle as identified by `fit_spindle`."""

    part: ModalPart
    """The spindle as the end of an assembly; its band is that of the responses. Its `discrepancy` is that of a few
    modes with viscous damping, as large as the residuals of the fit leave possible."""
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
    *,
    modes: int | Sequence[float] | None = None,
    name: str = "spindle",
    tolerances: Sequence[Tolerance] = (),
    threads: int | None = None,
) -> SpindleModes:
    """Fit modes and a residual to responses of blanks in a spindle.

    The fit is that of `identify` to the responses themselves, with the spindle as the far end of each blank: the noise
    is weighted correctly, lines that the inversion cannot use still contribute, and the result has the covariance of
    all parameters. Its start is that of a spindle that was never measured alone (`receptance.coupling.unknown_modes`):
    modes are added one at a time.

    Without a number of modes the evidence of the responses chooses it (`receptance.coupling.stabilisation`), or it is
    the next lower one with which the fit converges. Modes above the band represent those there.

    Parameters
    ----------
    observations : sequence of Observation
        As for `identify_spindle`.
    modes : int or sequence of float, optional
        Number of modes, those above the band included, or the approximate frequencies in Hz of those in the band; by
        default as many as the responses show.
    name : str, optional
        First word of the addresses of the parameters.
    tolerances : sequence of Tolerance, optional
        Errors of the blanks, which are fitted as well.
    threads : int, optional
        As in `Assembly.receptance`.

    Raises
    ------
    TypeError, ValueError
        As `identify_spindle`; lines with another decay rate of the window.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance import STEEL, Assembly, Coordinate, ModalPart, Mode, Observation, Part, Segment
    >>> from receptance.coupling import fit_spindle
    >>> blank = Part([Segment(length=0.1, outer_diameter=0.05, material=STEEL)], name="blank")
    >>> true = ModalPart(modes=[Mode(frequency_hz=900.0, damping_ratio=0.03, y=0.2, theta=1.0)], residual_y=5e-9,
    ...     residual_theta=5e-7, residual_ytheta=2e-8)
    >>> lines, places = np.arange(200.0, 2000.0, 20.0), [Coordinate("blank", 0.0), Coordinate("blank", 0.07)]
    >>> h = Assembly([blank, true]).receptance(lines, response=places, excitation=places)
    >>> responses = [Observation(assembly=Assembly([blank]), frequency_hz=lines, receptance=h[:, i, j],
    ...     standard_deviation=0.01, response=places[i], excitation=places[j]) for i, j in ((0, 0), (1, 0), (1, 1))]
    >>> fit = fit_spindle(responses, modes=1)
    >>> print(f"{fit.part.modes[0].frequency_hz:.1f} Hz")
    900.0 Hz
    """
    observed = check_observations(tuple(observations))
    check_blanks(observed)
    _, lines, _, _ = common_lines(observed)
    if modes is None or isinstance(modes, int):
        described: list[dict[str, float]] = [{}] * (_MOST_MODES if modes is None else modes)
    else:
        described = [*({"frequency_hz": float(frequency)} for frequency in modes), {}]
    start = _start(name, len(described))
    coupled = _coupled(observed, start)
    unknowns, errors, _ = start_modes(
        coupled,
        bounds_of_modes(name, described, {}, coupled),
        name,
        by_evidence=modes is None,
        tolerances=tuple(tolerances),
        threads=threads,
    )
    started = {unknown.address for unknown in unknowns}
    count = sum(f"{name}.mode[{index}].frequency_hz" in started for index in range(len(described)))
    start = _start(name, count)
    coupled = _coupled(observed, start)
    fit = identify(coupled, unknowns, starts=1, tolerances=errors, threads=threads, noise="stated")
    if modes is None and not fit.converged and count > 1:
        # Modes beside the band that the responses hardly show have valleys without an end.
        for fewer in range(count - 1, 0, -1):
            spindle = fit_spindle(observations, modes=fewer, name=name, tolerances=tolerances, threads=threads)
            if spindle.identification is not None and spindle.identification.converged:
                return spindle
    fitted = {address: f"{name}.{address}" for address in start.addresses}
    part = start.with_values({own: fit.values[address] for own, address in fitted.items() if address in fit.values})
    discrepancy = _discrepancy(_coupled(observed, part), part)
    band = (float(lines.real[0]), float(lines.real[-1]))
    return SpindleModes(
        part=replace(part, band_hz=band, discrepancy=discrepancy), covariance=_covariance(fit, part), identification=fit
    )


def _start(name: str, count: int) -> ModalPart:
    """Return so many modes without effect.

    Numbers that are not fitted, imaginary parts of the shapes of modes above the band, stay zero.
    """
    mode = Mode(frequency_hz=1.0, damping_ratio=0.03, y=0.0, theta=0.0)
    return ModalPart(modes=(mode,) * count, name=name)


def _covariance(fit: Identification, part: ModalPart) -> NDArray[np.float64]:
    """Return the covariance of the numbers of a part in SI units, zero for those that are not fitted.

    Errors of the blanks are among its causes. A number at its lower bound is held there: below it the model may have no
    value, such as a negative damping ratio, and the others have their covariance with it held.
    """
    order, names = list(fit.values), [f"{part.name}.{quantity}" for quantity in part.addresses]
    rows = [i for i, name in enumerate(names) if name in fit.values]
    columns = [order.index(names[i]) for i in rows]
    values = np.array([fit.values[names[i]] for i in rows])
    unknowns = [fit.unknowns[column] for column in columns]
    covariance = np.asarray(fit.covariance)[np.ix_(columns, columns)]
    held = np.array([_is_lowest(unknown, value) for unknown, value in zip(unknowns, values, strict=True)])
    across = covariance[:, held]
    covariance = covariance - across @ np.linalg.pinv(covariance[np.ix_(held, held)], hermitian=True) @ across.T
    covariance[held] = covariance[:, held] = 0.0
    logarithmic = np.array([unknown.scale == "log" for unknown in unknowns])
    slope = np.where(logarithmic, values * np.log(10.0), 1.0) * max(fit.rms, 1.0)
    result = np.zeros((len(names), len(names)))
    result[np.ix_(rows, rows)] = covariance * np.outer(slope, slope)
    return result


def _is_lowest(unknown: Unknown, value: float) -> bool:
    """Return whether the value of an unknown that is positive is at its lower bound."""
    return unknown.scale == "log" and math.log(value / unknown.lower) <= _AT_BOUND * math.log(
        unknown.upper / unknown.lower
    )


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
    """Return the relative model error that the residuals of the fit leave possible.

    The errors of the three entries are Gaussian with a common relative standard deviation s, independent at nodes that
    are 0.25 apart in the logarithm of frequency, and linear between them. Let J and K be the derivatives of the
    residuals r with respect to the parameters of the modes and to these errors, and P the projector on the complement
    of J. Then K^T P r is normal with the covariance W + s^2 W^2, W = K^T P K. In the eigenvectors of W this restricted
    likelihood is a product. The result is a quantile of s, each s being as likely before. Its most likely value is
    often zero where an error as large as that of the modes' numbers would not show.
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

    grid = np.log(np.geomspace(*_DISCREPANCIES, _STEPS))
    rises = np.array([deviance(x) for x in grid])
    # Steps of the logarithm are proportional to s.
    weights = np.exp(grid - 0.5 * (rises - rises.min()))
    share = np.cumsum(weights) / np.sum(weights)
    return float(np.exp(np.interp(_SHARE, share, grid)))


def _coupled(observed: Sequence[Observation], part: ModalPart) -> list[Observation]:
    """Return the observations with the spindle as the far end of each blank."""
    coupled = []
    for observation in observed:
        blank = observation.assembly
        assembly = Assembly([*blank.elements.values(), part], blank.attachments.values())
        coupled.append(altered(observation, assembly=assembly))
    return coupled
