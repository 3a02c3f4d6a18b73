"""The tool tip: modes for semi-discretisation, and receptance matrices from measured FRFs with random draws of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from receptance import _checks
from receptance.frf import FRF
from receptance.frf.plausibility import check_drive_point, low_frequency_rise
from receptance.modal import ModeEstimate

_HALF_POWER = 0.5**0.5
_SMOOTH = 0.1
"""Share of noise below which a peak at the lowest lines is that of a mode."""
_RESOLVED = 0.25
"""Magnitude of the first line, as a share of the largest, below which the peak of such a mode is on the lines: with a
larger one limits that chatter below the natural frequency determines are lost."""
_AT_TOP = 0.9
"""Least magnitude of the first line, as a share of the largest, if the mode is below it."""
_FIRST = 1.1
"""Frequency ratio from the first line within which the slope is taken."""
_STEEPEST_MASS = -3.0
"""Exponent of the fall of the magnitude below which it is that of a mode below the lines; a free mass has -2."""


@dataclass(frozen=True, kw_only=True)
class TipModes:
    """Modes of a tool tip: G = sum of s s^T / (w_r^2 - w^2 + 2 i zeta_r w_r w).

    Parameters
    ----------
    frequency_hz : array_like
        Undamped natural frequencies `(k,)` in Hz.
    damping_ratio : array_like
        Viscous damping ratios `(k,)`, between 0 and 1.
    shapes : array_like
        Mass-normalised shapes in x and y `(k, 2)`, in kg^-1/2.

    Raises
    ------
    ValueError
        Arrays whose shapes do not match, or values out of range.

    Examples
    --------
    >>> tip = TipModes(frequency_hz=[922.0], damping_ratio=[0.011], shapes=[[0.03993**-0.5, 0.0]])
    >>> f"{abs(tip.receptance([922.0])[0, 0, 0]):.3g} m/N"
    '3.39e-05 m/N'
    """

    frequency_hz: NDArray[np.float64]
    damping_ratio: NDArray[np.float64]
    shapes: NDArray[np.float64]

    def __init__(self, *, frequency_hz: ArrayLike, damping_ratio: ArrayLike, shapes: ArrayLike) -> None:
        frequency = np.atleast_1d(_checks.unmasked("TipModes", "frequency_hz", frequency_hz, np.float64))
        damping = np.atleast_1d(_checks.unmasked("TipModes", "damping_ratio", damping_ratio, np.float64))
        modes = np.atleast_2d(_checks.unmasked("TipModes", "shapes", shapes, np.float64))
        if frequency.ndim != 1 or damping.shape != frequency.shape or modes.shape != (frequency.size, 2):
            raise ValueError(
                f"TipModes: frequency_hz has shape {frequency.shape}, damping_ratio {damping.shape}, shapes "
                f"{modes.shape}; expected (k,), (k,) and (k, 2)"
            )
        for name, values, good, expected in (
            ("frequency_hz", frequency, frequency > 0.0, "more than 0 Hz"),
            ("damping_ratio", damping, (damping > 0.0) & (damping < 1.0), "between 0 and 1"),
            ("shapes", modes, np.ones(modes.shape, bool), "finite"),
        ):
            wrong = np.argwhere(~(good & np.isfinite(values)))
            if wrong.size:
                index = tuple(int(i) for i in wrong[0])
                raise ValueError(f"TipModes: {name}{list(index)} is {values[index]:g}, expected {expected}")
        _checks.set_fields(self, {"frequency_hz": frequency, "damping_ratio": damping, "shapes": modes})

    def with_errors(self, frequency: NDArray[np.float64], level: NDArray[np.float64]) -> TipModes:
        """Return the modes with relative errors of the frequencies, and errors of the logarithm of the levels."""
        return TipModes(
            frequency_hz=self.frequency_hz * np.exp(frequency),
            damping_ratio=self.damping_ratio,
            # The level of a mode at its resonance is s^2 / (2 zeta w^2).
            shapes=self.shapes * np.exp(frequency + 0.5 * level)[:, None],
        )

    @classmethod
    def from_estimates(cls, x: Sequence[ModeEstimate], y: Sequence[ModeEstimate] = ()) -> TipModes:
        """Return the modes from separate estimates of drive-point receptances in x and in y.

        Raises
        ------
        ValueError
            A modal constant without a positive real part, which a drive point of a passive structure has.
        """
        shapes = []
        for direction, tips in enumerate((x, y)):
            for estimate in tips:
                constant = estimate.modal_constant.real
                if not constant > 0.0:
                    raise ValueError(
                        f"TipModes: the mode at {estimate.frequency_hz:g} Hz in {'xy'[direction]} has the modal "
                        f"constant {constant:g}, expected more than zero at a drive point"
                    )
                shapes.append([0.0, 0.0])
                shapes[-1][direction] = constant**0.5
        estimates = [*x, *y]
        return cls(
            frequency_hz=[estimate.frequency_hz for estimate in estimates],
            damping_ratio=[estimate.damping_ratio for estimate in estimates],
            shapes=shapes,
        )

    @classmethod
    def drawn_from_estimates(
        cls, x: Sequence[ModeEstimate], y: Sequence[ModeEstimate] = (), *, draws: int = 200, seed: int = 0
    ) -> tuple[TipModes, ...]:
        """Return random modes within the standard errors of the estimates; see `from_estimates`.

        Frequencies, damping ratios and modal constants are independent and log-normal.

        Raises
        ------
        ValueError
            A standard error that is not finite because the lines do not determine the mode; or as `from_estimates`.
        """
        nominal = cls.from_estimates(x, y)
        estimates = [*x, *y]
        shares = np.array(
            [
                [
                    estimate.frequency_standard_error_hz / estimate.frequency_hz,
                    estimate.damping_standard_error / estimate.damping_ratio,
                    estimate.modal_constant_standard_error.real / estimate.modal_constant.real,
                ]
                for estimate in estimates
            ]
        )
        wrong = np.flatnonzero(~np.isfinite(shares).all(axis=1))
        if wrong.size:
            raise ValueError(
                f"TipModes: the mode at {estimates[wrong[0]].frequency_hz:g} Hz has standard errors that are not "
                "finite: the lines do not determine the mode"
            )
        factors = np.exp(shares * np.random.default_rng(seed).standard_normal((draws, *shares.shape)))
        return tuple(
            cls(
                frequency_hz=nominal.frequency_hz * factor[:, 0],
                damping_ratio=np.minimum(nominal.damping_ratio * factor[:, 1], 0.99),
                shapes=nominal.shapes * np.sqrt(factor[:, 2:]),
            )
            for factor in factors
        )

    def rotated(self, rotation_deg: float) -> TipModes:
        """Return the modes in the directions of a cut; see `rotated_receptance`."""
        shapes = self.shapes @ _rotation(rotation_deg).T
        return TipModes(frequency_hz=self.frequency_hz, damping_ratio=self.damping_ratio, shapes=shapes)

    def receptance(self, frequency_hz: ArrayLike) -> NDArray[np.complex128]:
        """Return the receptance `(n, 2, 2)` of the tip in x and y, in m/N, at lines `(n,)` in Hz."""
        w = 2.0 * np.pi * _checks.frequencies(frequency_hz)[:, None]
        w_r = 2.0 * np.pi * self.frequency_hz
        gain = 1.0 / (w_r**2 - w**2 + 2j * self.damping_ratio * w_r * w)
        return np.asarray(np.einsum("nk,ki,kj->nij", gain, self.shapes, self.shapes))


def receptance_matrix(
    x: FRF | None, y: FRF | None = None, *, xy: FRF | None = None
) -> tuple[NDArray[np.float64], NDArray[np.complex128]]:
    """Return lines and the receptance matrix of the tip in x and y from separately measured FRFs.

    Parameters
    ----------
    x, y : FRF
        Drive-point FRFs in and normal to the feed direction, of any form, with one response and one excitation each.
        A direction without an FRF is rigid.
    xy : FRF, optional
        Cross FRF, equal in both directions; by default zero.

    Returns
    -------
    frequency_hz, receptance : ndarray
        Lines that all FRFs have, `(n,)` in Hz, and the matrix `(n, 2, 2)` in m/N.

    Raises
    ------
    ValueError
        No FRF, FRFs with several entries, fewer than two common lines, or an FRF in x or y that no passive structure
        has at a drive point.
    """
    lines, receptances = _on_common_lines(x, y, xy)
    return lines, _matrix(lines.size, {name: frf.values[rows, 0, 0] for name, (frf, rows) in receptances.items()})


def rotated_receptance(receptance: ArrayLike, rotation_deg: float) -> NDArray[np.complex128]:
    """Return the receptance in the directions of a cut, of a tip that was measured in others.

    Parameters
    ----------
    receptance : array_like
        `(..., 2, 2)` in m/N, in the directions of the measurement.
    rotation_deg : float
        Angle from the feed to the first direction of the measurement, in degrees, positive towards y of the cut.

    Returns
    -------
    ndarray
        `(..., 2, 2)` in m/N, along and normal to the feed: `R G R^T`.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance.stability import rotated_receptance
    >>> rotated_receptance(np.diag([3e-8, 1e-8]), 45.0).real.round(9)
    array([[2.e-08, 1.e-08],
           [1.e-08, 2.e-08]])
    """
    matrix = _checks.unmasked("rotated_receptance", "receptance", receptance, np.complex128)
    if matrix.shape[-2:] != (2, 2):
        raise ValueError(f"rotated_receptance: receptance has shape {matrix.shape}, expected (..., 2, 2)")
    turn = _rotation(rotation_deg)
    return np.asarray(turn @ matrix @ turn.T)


def _rotation(rotation_deg: float) -> NDArray[np.float64]:
    """Return the matrix of a vector in the directions of a cut from one in those of a measurement."""
    angle = np.deg2rad(_checks.number("stability", "rotation_deg", rotation_deg, unit="degrees"))
    return np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])


def receptance_draws(
    x: FRF | None, y: FRF | None = None, *, xy: FRF | None = None, draws: int = 200, seed: int = 0
) -> NDArray[np.complex128]:
    """Return random receptance matrices within the variance of measured FRFs.

    Real and imaginary part of the logarithm have Gaussian errors, correlated between neighbouring lines as stated by
    the FRF. The draws add noise to the measured values, which contain noise already, so limits are slightly too low.
    Draws of modes (`TipModes.drawn_from_estimates`) have no noise from line to line.

    Parameters
    ----------
    x, y, xy : FRF
        As in `receptance_matrix`; each with its `log_variance`.
    draws : int, optional
        Number of draws.
    seed : int, optional
        Seed of the random numbers.

    Returns
    -------
    ndarray
        `(draws, n, 2, 2)` in m/N, on the lines of `receptance_matrix`.

    Raises
    ------
    ValueError
        An FRF without a variance, or as `receptance_matrix`.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance import FRF
    >>> from receptance.stability import TipModes, receptance_draws
    >>> f = np.arange(800.0, 1000.0)
    >>> tip = TipModes(frequency_hz=[922.0], damping_ratio=[0.011], shapes=[[5.0, 0.0]])
    >>> x = FRF(frequency_hz=f, values=tip.receptance(f)[:, 0, 0], log_variance=0.02**2)
    >>> receptance_draws(x, draws=50).shape
    (50, 200, 2, 2)
    """
    lines, receptances = _on_common_lines(x, y, xy)
    count = _checks.whole_number("stability", "draws", draws)
    for name, (frf, rows) in receptances.items():
        if frf.log_variance is None or not np.isfinite(frf.log_variance[rows]).all():
            raise ValueError(
                f"stability: {name} has no variance{'' if frf.log_variance is None else ' on some lines'}, expected "
                "an FRF with log_variance"
            )
    random = np.random.default_rng(seed)
    result = np.empty((count, lines.size, 2, 2), np.complex128)
    for drawn in result:
        drawn[:] = _matrix(lines.size, {name: _drawn(frf, rows, random) for name, (frf, rows) in receptances.items()})
    return result


def _drawn(frf: FRF, rows: NDArray[np.bool_], random: np.random.Generator) -> NDArray[np.complex128]:
    """Return a draw of the first entry of an FRF on some of its lines."""
    values, correlated = frf.values[rows, 0, 0], np.rint(frf.correlated_lines[rows]).astype(np.intp)
    # Each line gets the mean of as many independent numbers as lines err correlated there, neighbours shared ones.
    parts = random.standard_normal((2, values.size + int(correlated.max()) - 1))
    parts = np.cumsum(np.pad(parts, ((0, 0), (1, 0))), axis=1)
    first = np.arange(values.size)
    deviation = np.sqrt(np.asarray(frf.log_variance)[rows, 0, 0] / correlated)
    real, imaginary = (parts[:, first + correlated] - parts[:, first]) * deviation
    return np.asarray(values * np.exp(real + 1j * imaginary))


def require_drive_point(name: str, frf: FRF) -> None:
    """Raise ValueError if an FRF with one entry is none that a passive structure has at the tip of a tool."""
    reason = check_drive_point(frf.frequency_hz, frf.values[:, 0, 0], frf.form).reason
    if reason:
        raise ValueError(f"{name}: a tip in a cut is a drive point, but {reason}")


def beyond_lines(lines: NDArray[np.float64], receptance: NDArray[np.complex128]) -> tuple[str, ...]:
    """Return for each direction whose largest magnitude is at an end of the lines that they do not contain its mode.

    The limit of a mode is determined between its natural frequency and the upper half-power point, so the lines contain
    a mode if its magnitude falls to half power above it. At the first lines noise, drift and the mass of a free body do
    not count, which fall about as 1/f^2.

    Parameters
    ----------
    lines, receptance : ndarray
        `(n,)` in Hz and `(n, d, d)`; a rigid direction is zero.
    """
    texts = []
    for i in range(receptance.shape[1]):
        values = receptance[:, i, i]
        if not values.any():
            continue
        size = np.abs(values)
        drift = low_frequency_rise(lines, values, drive_point=True)
        if drift is not None:
            if drift.noise_share < _SMOOTH and size[0] < _RESOLVED * size.max():
                drift = None  # a mode near the first line, whose peak is on the lines, falls like that as well
            else:
                size = size[lines > drift.highest_hz]
        top = int(size.argmax())
        low = size < _HALF_POWER * size[top]
        ends = [("last", lines[-1], "higher")] if not low[top:].any() else []
        if drift is None and size[0] > _AT_TOP * size[top] and _slope(lines, size) < _STEEPEST_MASS:
            ends.append(("first", lines[0], "lower"))
        texts += [
            f"the magnitude of the tip in {'xy'[i]} rises to the {which} of the lines, at {line:g} Hz, so they do not "
            f"contain its mode and no limit follows: give lines at {where} frequencies"
            for which, line, where in ends
        ]
    return tuple(texts)


def _slope(lines: NDArray[np.float64], size: NDArray[np.float64]) -> float:
    """Return the exponent of the growth of a magnitude with frequency at the first lines."""
    first = (lines > 0.0) & (lines <= _FIRST * lines[lines > 0.0][0]) & (size > 0.0)
    if np.count_nonzero(first) < 2:
        return 0.0
    return float(np.polyfit(np.log(lines[first]), np.log(size[first]), 1)[0])


def _on_common_lines(
    x: FRF | None, y: FRF | None, xy: FRF | None
) -> tuple[NDArray[np.float64], dict[str, tuple[FRF, NDArray[np.bool_]]]]:
    """Return the common lines of the FRFs, and for each FRF its receptance and the mask of these lines."""
    frfs = {name: frf for name, frf in (("x", x), ("y", y), ("xy", xy)) if frf is not None}
    if not {"x", "y"} & frfs.keys():
        raise ValueError("stability: x and y are both None, expected an FRF of at least one direction")
    receptances = {}
    for name, frf in frfs.items():
        if not isinstance(frf, FRF):
            raise TypeError(f"stability: {name} is {type(frf).__name__}, expected an FRF")
        if frf.values.shape[1:] != (1, 1):
            raise ValueError(
                f"stability: {name} has entries {frf.values.shape[1:]}, expected one response and one excitation"
            )
        if frf.decay_rate:
            raise ValueError(
                f"stability: {name} has an exponential window of {frf.decay_rate:g} 1/s, expected none; fit modes and "
                "use TipModes"
            )
        frf = frf.masked()
        if name != "xy":
            require_drive_point(name, frf)
        receptances[name] = frf.to("receptance")
    lines = next(iter(receptances.values())).frequency_hz
    lines = lines[lines > 0.0]
    for name, frf in receptances.items():
        lines = lines[np.isin(lines, frf.frequency_hz)]
        if lines.size < 2:
            usable = int(np.count_nonzero(frf.frequency_hz > 0.0))
            text = f"shares {lines.size} lines with the other FRFs, expected at least 2; resample one"
            if usable < 2 or len(receptances) == 1:
                text = f"has {usable} usable lines, expected at least 2"
            raise ValueError(f"stability: {name} {text}")
    return lines, {name: (frf, np.isin(frf.frequency_hz, lines)) for name, frf in receptances.items()}


def _matrix(count: int, values: dict[str, NDArray[np.complex128]]) -> NDArray[np.complex128]:
    matrix = np.zeros((count, 2, 2), np.complex128)
    entries = {"x": [(0, 0)], "y": [(1, 1)], "xy": [(0, 1), (1, 0)]}
    for name, receptance in values.items():
        for i, j in entries[name]:
            matrix[:, i, j] = receptance
    return matrix
