"""Modes of the tool tip in x and y, the model in time that semi-discretisation needs."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from receptance import _checks

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from receptance.modal import ModeEstimate

__all__ = ["TipModes"]


@dataclass(frozen=True, kw_only=True)
class TipModes:
    """Modes of a tool tip: G = sum of s s^T / (w_r^2 - w^2 + 2 i zeta_r w_r w).

    Parameters
    ----------
    frequency_hz : array_like
        Undamped natural frequencies `(k,)`.
    damping_ratio : array_like
        Viscous damping ratios `(k,)`, over 0 and under 1.
    shapes : array_like
        Mass-normalised shapes in x and y `(k, 2)`, in kg^-1/2.

    Raises
    ------
    ValueError
        Shapes that do not fit each other, or values out of range.

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
        frequency = np.atleast_1d(_checks.unmasked("TipModes", "frequency_hz", frequency_hz, np.float64).copy())
        damping = np.atleast_1d(_checks.unmasked("TipModes", "damping_ratio", damping_ratio, np.float64).copy())
        modes = np.atleast_2d(_checks.unmasked("TipModes", "shapes", shapes, np.float64).copy())
        if frequency.ndim != 1 or damping.shape != frequency.shape or modes.shape != (frequency.size, 2):
            raise ValueError(
                f"TipModes: frequency_hz has shape {frequency.shape}, damping_ratio {damping.shape}, shapes "
                f"{modes.shape}; expected (k,), (k,) and (k, 2)"
            )
        for name, values, good in (
            ("frequency_hz", frequency, frequency > 0.0),
            ("damping_ratio", damping, (damping > 0.0) & (damping < 1.0)),
            ("shapes", modes, np.ones(modes.shape, bool)),
        ):
            wrong = np.argwhere(~(good & np.isfinite(values)))
            if wrong.size:
                place = tuple(int(i) for i in wrong[0])
                expected = {"frequency_hz": "over 0 Hz", "damping_ratio": "over 0 and under 1", "shapes": "finite"}[
                    name
                ]
                raise ValueError(f"TipModes: {name}{list(place)} is {values[place]:g}, expected {expected}")
        for name, values in (("frequency_hz", frequency), ("damping_ratio", damping), ("shapes", modes)):
            values.setflags(write=False)
            object.__setattr__(self, name, values)

    @classmethod
    def from_estimates(cls, x: Sequence[ModeEstimate], y: Sequence[ModeEstimate] = ()) -> TipModes:
        """Return the modes estimated from drive-point receptances in x and in y, independent of each other.

        Raises
        ------
        ValueError
            A modal constant with a negative real part: no drive point of a passive structure.
        """
        shapes = []
        for direction, estimates in enumerate((x, y)):
            for estimate in estimates:
                constant = estimate.modal_constant.real
                if not constant > 0.0:
                    raise ValueError(
                        f"TipModes: the mode at {estimate.frequency_hz:g} Hz in {'xy'[direction]} has the modal "
                        f"constant {constant:g}, expected more than zero at a drive point"
                    )
                shapes.append([0.0, 0.0])
                shapes[-1][direction] = constant**0.5
        both = [*x, *y]
        return cls(
            frequency_hz=[estimate.frequency_hz for estimate in both],
            damping_ratio=[estimate.damping_ratio for estimate in both],
            shapes=shapes,
        )

    @classmethod
    def drawn_from_estimates(
        cls, x: Sequence[ModeEstimate], y: Sequence[ModeEstimate] = (), *, draws: int = 200, seed: int = 0
    ) -> tuple[TipModes, ...]:
        """Return modes that may be the true ones, from the standard errors of `from_estimates`.

        Frequencies, damping ratios and modal constants are log-normal, all independent of each other.

        Raises
        ------
        ValueError
            A standard error that is not finite: the lines do not determine the mode; or as `from_estimates`.
        """
        middle = cls.from_estimates(x, y)
        both = [*x, *y]
        shares = np.array(
            [
                [
                    one.frequency_standard_error_hz / one.frequency_hz,
                    one.damping_standard_error / one.damping_ratio,
                    one.modal_constant_standard_error.real / one.modal_constant.real,
                ]
                for one in both
            ]
        )
        wrong = np.flatnonzero(~np.isfinite(shares).all(axis=1))
        if wrong.size:
            raise ValueError(
                f"TipModes: the mode at {both[wrong[0]].frequency_hz:g} Hz has standard errors that are not finite, so "
                "nothing is known of its errors"
            )
        factors = np.exp(shares * np.random.default_rng(seed).standard_normal((draws, *shares.shape)))
        return tuple(
            cls(
                frequency_hz=middle.frequency_hz * one[:, 0],
                damping_ratio=np.minimum(middle.damping_ratio * one[:, 1], 0.99),
                shapes=middle.shapes * np.sqrt(one[:, 2:]),
            )
            for one in factors
        )

    def receptance(self, frequency_hz: ArrayLike) -> NDArray[np.complex128]:
        """Receptance `(n, 2, 2)` of the tip in x and y, in m/N, at lines `(n,)` in Hz."""
        w = 2.0 * np.pi * _checks.frequencies(frequency_hz)[:, None]
        w_r = 2.0 * np.pi * self.frequency_hz
        each = 1.0 / (w_r**2 - w**2 + 2j * self.damping_ratio * w_r * w)
        return np.asarray(np.einsum("nk,ki,kj->nij", each, self.shapes, self.shapes))
