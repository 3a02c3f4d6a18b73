"""From a fit of poles to the modes with their standard errors, and what a person should know of them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from receptance.modal._selection import Scatter, reach_of, weights_of
from receptance.modal.estimate import constants, joint_with_residue, modal_values, scaled
from receptance.modal.modal_fit import ModalFit

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.modal._least_squares import PoleFit
    from receptance.modal._lines import Lines

_CLUSTERS = 4
"""Fewer entries say nothing of how much they disagree."""
_TOLD = 1.2
"""Where a pole rests on one entry alone, as good as, no other can disagree."""
_ROUNDING = 1e-22
"""Share of the sum of squares below which residuals are those of the arithmetic."""
_VISIBLE = 0.2
"""Correlation of neighbouring residuals below which nothing is said."""


def conclude(
    fit: PoleFit,
    modes: NDArray[np.bool_],
    lines: Lines,
    terms: tuple[int, ...],
    scatter: Scatter,
    orders: list[NDArray[np.complex128]],
    wanted: int | tuple[float, ...] | None,
) -> tuple[ModalFit, list[str]]:
    """Return the result, and those of its notes that are to be warned of; `modes` of the poles are no background."""
    shape = np.asarray(lines.frf.values).shape[1:]
    sigma = float(lines.frf.decay_rate)
    factor, freedom, correlation, notes = _spread(fit, lines)
    of_poles, remark = scaled(fit.of_poles, factor), list[str]()
    if not _exact(fit, lines):
        of_poles, freedom, remark = _between_entries(fit, of_poles, freedom)
    place = np.flatnonzero(modes)
    place = place[np.argsort(np.abs(fit.poles[place]))]
    poles, count = fit.poles[place], place.size
    both = np.concatenate([place, fit.poles.size + place])
    frequency, damping, covariance = modal_values(poles, of_poles[np.ix_(both, both)])
    spread = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    constant = np.empty((count, fit.coefficients.shape[0]), dtype=np.complex128)
    of_constant = np.empty_like(constant)
    for row, mode in enumerate(place):
        for entry in range(constant.shape[1]):
            joint = scaled(joint_with_residue(fit, int(mode), entry), factor)
            residue = complex(fit.residues[mode, entry])
            constant[row, entry], of_constant[row, entry] = constants(complex(fit.poles[mode]), residue, joint)
    outside = fit.coefficients[:, 2 * fit.poles.size :]
    decay = sigma - poles.real
    aloud = [*_missing(frequency, lines, wanted), *_doubts(fit, frequency, damping, spread[count:])]
    quietly = [*_remarks(frequency, decay, lines), *_others(fit.poles[~modes], lines)]
    said = [*lines.notes, *notes, *remark, *aloud, *quietly]
    result = ModalFit(
        frequency_hz=frequency,
        frequency_standard_error_hz=spread[:count],
        damping_ratio=damping,
        damping_standard_error=spread[count:],
        covariance=covariance,
        modal_constant=constant.reshape(count, *shape),
        modal_constant_standard_error=of_constant.reshape(count, *shape),
        residue=fit.residues[place].reshape(count, *shape),
        background={
            term: (outside[:, 2 * index] + 1j * outside[:, 2 * index + 1]).reshape(shape)
            for index, term in enumerate(terms)
        },
        outside_poles=fit.poles[~modes],
        outside_residue=fit.residues[~modes].reshape(-1, *shape),
        lines_in_band=np.maximum(decay, 0.0) / np.pi / _spacing(lines, poles.imag / (2.0 * np.pi)),
        frf=lines.frf,
        scatter=_scatter(fit, lines, scatter).reshape(shape),
        known_scatter=lines.relative is not None,
        correlation=correlation,
        degrees_of_freedom=freedom,
        converged=fit.converged,
        stabilisation=tuple(found - 1j * sigma / (2.0 * np.pi) for found in orders),
        notes=tuple(said),
    )
    return result, aloud


def _spread(fit: PoleFit, lines: Lines) -> tuple[float, float, float, list[str]]:
    """What the covariances are multiplied by, its degrees of freedom, the residuals' correlation, and notes."""
    notes = []
    freedom = fit.degrees_of_freedom
    independent = freedom / lines.shared
    variance = fit.chi_square / freedom if freedom >= 0.5 else float("inf")
    if lines.relative is None:
        of_factor = max(independent, 1.0)
    elif variance > 1.0 + 3.0 * np.sqrt(2.0 / max(independent, 1.0)):
        of_factor = max(independent, 1.0)
        notes.append(
            f"the residuals are {np.sqrt(variance):.2g} times what the stated variance explains; the standard errors "
            "are larger by that"
        )
    else:
        variance, of_factor = 1.0, lines.freedom
    correlation = _correlation(fit)
    # What the lines share is in the covariance already.
    stated = 1.0 / (1.0 + (np.pi / lines.shared) ** 2) if lines.shared > 1.0 else 0.0
    chance = 3.0 / np.sqrt(2.0 * fit.residual.size / lines.shared)
    if correlation <= stated + max(_VISIBLE * (1.0 - stated), chance) or _exact(fit, lines):
        return variance, of_factor, correlation, notes
    # As if neighbours were all that is correlated: so many more lines share one independent value than is stated.
    kept = min(correlation, 0.98)
    more = (1.0 + kept) / (1.0 - kept) * (1.0 - stated) / (1.0 + stated)
    notes.append(
        f"the residuals of neighbouring lines are correlated ({correlation:.2f}): the model misses something, or the "
        f"lines are closer than the record resolves; the standard errors are {np.sqrt(more):.2g} times larger for it"
    )
    return variance * more, max(of_factor / more, 1.0), correlation, notes


def _correlation(fit: PoleFit) -> float:
    """Correlation of the residuals of neighbouring lines."""
    left = fit.residual
    neighbours = float(np.sum((left[:-1].conj() * left[1:]).real))
    return neighbours / max(fit.chi_square, np.finfo(np.float64).tiny)


def _exact(fit: PoleFit, lines: Lines) -> bool:
    """Whether what is left is the rounding of the arithmetic, which says nothing."""
    left = np.sum(np.abs(lines.values - fit.fitted) ** 2)
    return bool(left <= _ROUNDING * np.sum(np.abs(lines.values) ** 2))


def _between_entries(
    fit: PoleFit, covariance: NDArray[np.float64], freedom: float
) -> tuple[NDArray[np.float64], float, list[str]]:
    """Covariance of the poles, enlarged where single entries disagree about them by more than their scatter explains.

    Where a sensor or a temperature moves between hits every entry has poles of its own. How much the entries pull
    the common poles (their scores) then says more of the uncertainty than the scatter within each entry: the
    covariance between entries as clusters (Liang and Zeger 1986).
    """
    if not np.all(np.isfinite(covariance)) or fit.scores.shape[0] < _CLUSTERS:
        return covariance, freedom, []
    from scipy.special import chdtri

    pulls = fit.scores @ fit.inverse
    shares = np.einsum("ij,ejk,ki->ei", fit.inverse, fit.information_matrices, fit.inverse)
    clusters = shares.sum(axis=0) ** 2 / np.sum(shares**2, axis=0)
    told = clusters > _TOLD
    between = np.sum(pulls**2, axis=0) / np.where(told, 1.0 - 1.0 / clusters, 1.0)
    ratio = between / np.diag(covariance)
    # Upper 0.1 % point of chi-square over its degrees of freedom.
    limit = chdtri(clusters, 1e-3) / clusters
    over = told & (ratio > limit)
    if not over.any():
        return covariance, freedom, []
    scale = np.sqrt(np.where(over, ratio, 1.0))
    note = (
        f"the entries of the FRF disagree about the poles by up to {scale.max():.2g} times what their scatter explains "
        "(did the structure change between the hits?); the standard errors are larger by that"
    )
    return covariance * np.outer(scale, scale), min(freedom, max(float(clusters[over].min()) - 1.0, 1.0)), [note]


def _missing(frequency: NDArray[np.float64], lines: Lines, wanted: int | tuple[float, ...] | None) -> list[str]:
    if wanted is None:
        return []
    if isinstance(wanted, int):
        if frequency.size == wanted:
            return []
        return [
            f"{wanted} modes were asked for, {frequency.size} found: no further pole in the band improves the fit; "
            "give the frequencies as modes"
        ]
    from scipy.optimize import linear_sum_assignment

    far = np.abs(np.array(wanted)[:, None] - frequency)
    met = {int(row) for row, column in zip(*linear_sum_assignment(far), strict=True) if np.isfinite(far[row, column])}
    return [
        f"no mode was found within {reach_of(place, lines):.3g} Hz of {place:g} Hz"
        for index, place in enumerate(wanted)
        if index not in met
    ]


def _doubts(
    fit: PoleFit,
    frequency: NDArray[np.float64],
    damping: NDArray[np.float64],
    of_damping: NDArray[np.float64],
) -> list[str]:
    said = []
    if not fit.converged:
        said.append("the fit did not converge; is the number of modes right?")
    for f, z, spread in zip(frequency, damping, of_damping, strict=True):
        if z <= 0.0:
            said.append(f"the damping ratio of the mode at {f:.6g} Hz is {z:.2g} +- {spread:.1g}, not above zero")
    return said


def _others(poles: NDArray[np.complex128], lines: Lines) -> list[str]:
    f = np.sort(np.abs(poles) / (2.0 * np.pi))
    inside = [f"{one:.6g}" for one in f if lines.frequency_hz[0] <= one <= lines.frequency_hz[-1]]
    if not inside:
        return []
    return [f"the band holds further modes that were not asked for; fitted as background: {', '.join(inside)} Hz"]


def _remarks(frequency: NDArray[np.float64], decay: NDArray[np.float64], lines: Lines) -> list[str]:
    said = []
    width = decay / np.pi
    spacing = _spacing(lines, frequency)
    for f, own, step in zip(frequency, width, spacing, strict=True):
        if 0.0 < own < step:
            said.append(
                f"the half-power band of the mode at {f:.6g} Hz is {own / step:.1g} of the distance of the lines: its "
                "damping rests on the lines being exact, without leakage"
            )
    for index in range(frequency.size - 1):
        if frequency[index + 1] - frequency[index] < 0.5 * min(width[index], width[index + 1]):
            said.append(
                f"the poles at {frequency[index]:.6g} and {frequency[index + 1]:.6g} Hz are within half of a "
                "half-power band: two close modes, or one that moved between the hits"
            )
    return said


def _spacing(lines: Lines, places: NDArray[np.float64]) -> NDArray[np.float64]:
    """Distance of the lines at some frequencies."""
    gaps = np.diff(lines.frequency_hz)
    return np.asarray(gaps[np.clip(np.searchsorted(lines.frequency_hz, places) - 1, 0, gaps.size - 1)])


def _scatter(fit: PoleFit, lines: Lines, scatter: Scatter) -> NDArray[np.float64]:
    """`(m,)` root mean square of what is left, corrected for what was fitted."""
    left = lines.values - fit.fitted
    if lines.relative is not None:
        left = left * weights_of(lines, scatter, fit, smooth=True)
    elif scatter == "relative":
        left = left / np.maximum(np.abs(lines.values), np.finfo(np.float64).tiny)
    share = max(fit.degrees_of_freedom, 1) / (2.0 * fit.residual.size)
    return np.asarray(np.sqrt(np.mean(np.abs(left) ** 2, axis=0) / 2.0 / share))
