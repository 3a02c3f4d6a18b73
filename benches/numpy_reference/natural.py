"""Natural frequencies of an undamped chain: brackets by a whole-chain series, checked by a mode count."""

from __future__ import annotations

import numpy as np
from scipy.optimize import elementwise

from .chain import EMPTY, chain_generators
from .segment import Real
from .series import SPAN_LIMIT, degree_for, minors_generator, propagate

# Grid points per half wave of the chain's wave span; modes of a chain are about a half wave apart.
_DENSITY = 8
# Pieces shorter than this wave span have no clamped-clamped mode of their own, so their own count is zero.
_PIECE_SPAN = 1.0
_TERMS = 22
# Fraction of the limit below which a mode is called rigid.
_NEAR_ZERO = 1e-5


def natural_frequencies(
    segments: Real, limit_hz: float, joints: Real = EMPTY, masses: Real = EMPTY, grounds: Real = EMPTY
) -> Real:
    """Elastic natural frequencies below a limit, none missed; losses are ignored, rigid modes left out.

    Parameters
    ----------
    segments, joints, masses, grounds : tables of a chain.
    limit_hz : highest frequency of interest [Hz].

    Returns
    -------
    (n_modes,) frequencies [Hz], rising.
    """
    limit = 2 * np.pi * limit_hz
    lossless = np.array(segments, dtype=np.float64, ndmin=2)
    lossless[:, [8, 12]] = 0
    joints, grounds = _undamped(joints), _undamped(grounds)
    elements, span = chain_generators(lossless, limit, joints, masses, grounds)
    elements = [(fixed.real.copy(), inertial.real.copy()) for fixed, inertial in elements]
    counter = _Counter(elements)
    expected = int(counter(np.ones(1))[0][0])
    if span <= SPAN_LIMIT:
        polynomial = _determinant(elements, span)
        rigid = int(np.flatnonzero(polynomial)[0])
        polynomial = polynomial[rigid:]
        x = np.linspace(1e-3, 1.0, int(_DENSITY * (span / np.pi + 4)))
        values = np.polynomial.polynomial.polyval(x**2, polynomial)
        change = np.flatnonzero(np.signbit(values[:-1]) != np.signbit(values[1:]))
        if change.size == expected - rigid:
            return limit_hz * _newton(polynomial, x[change], x[change + 1])
    else:
        # Two rigid modes of a free chain are at zero, and counts far below the first mode hold only those.
        rigid = int(counter(np.full(1, _NEAR_ZERO))[0][0])
    if expected == rigid:
        return np.empty(0)
    low, high = _isolate(counter, rigid, expected)
    found = elementwise.find_root(lambda x: counter(x)[1], (low, high), tolerances={"xrtol": 1e-14})
    if not np.all(found.success):
        raise ArithmeticError(f"{np.sum(~found.success)} of {low.size} bracketed modes were not refined")
    return limit_hz * np.sort(found.x)


def _undamped(table: Real) -> Real:
    result = np.array(table, dtype=np.float64)
    if result.size:
        result[:, -4:] = 0
    return result


def _determinant(elements: list, span: float) -> Real:
    """Coefficients in s = (w/limit)^2 of the chain's load determinant: its roots are the modes."""
    minors = np.zeros((6, degree_for(span), 1))
    minors[0, 0] = 1
    for fixed, inertial in reversed(elements):
        minors = propagate(minors_generator(fixed), minors_generator(inertial), minors)
    return minors[5, :, 0]


def _newton(polynomial: Real, low: Real, high: Real) -> Real:
    """All roots of polynomial(x^2) together, Newton's step where it stays in its bracket, else bisection."""
    slope = np.polynomial.polynomial.polyder(polynomial)
    both = np.stack([polynomial, np.append(slope, 0.0)], axis=1)
    rising = np.polynomial.polynomial.polyval(low**2, polynomial) < 0
    x = (low + high) / 2
    for _ in range(60):
        value, derivative = np.polynomial.polynomial.polyval(x**2, both)
        below = (value < 0) == rising
        low, high = np.where(below, x, low), np.where(below, high, x)
        new = x - value / (2 * x * derivative)
        new = np.where((new > low) & (new < high), new, (low + high) / 2)
        step = np.abs(new - x)
        x = new
        if np.all(step <= 1e-14 * x):
            break
    return x


class _Counter:
    """Number of natural frequencies below x = w/limit, and the load determinant, for many x at once.

    The impedance is carried from the far end through short pieces. A piece adds the number of negative
    eigenvalues of its own far-end stiffness plus the impedance behind (Wittrick and Williams); the tip adds
    those of the impedance.
    """

    def __init__(self, elements: list) -> None:
        pieces: list[tuple[Real, Real]] = []
        for fixed, inertial in elements:
            # A rigid or massless element has no waves: one piece.
            waves = fixed.any() and inertial.any()
            parts = int(np.ceil(_element_span(fixed, inertial) / _PIECE_SPAN)) if waves else 1
            pieces += [(fixed / parts, inertial / parts)] * parts
        self.fixed = np.array([p[0] for p in pieces])
        self.inertial = np.array([p[1] for p in pieces])
        self.flexible = self.fixed[:, :2, 2:].any(axis=(1, 2))

    def __call__(self, x: Real) -> tuple[Real, Real]:
        """Counts and determinants, each of x's shape."""
        shape, x = np.shape(x), np.ravel(x)
        transfer = _exponential(self.fixed[:, None] + (x**2)[None, :, None, None] * self.inertial[:, None])
        z = np.zeros((3, x.size))
        count, determinant = np.zeros(x.size, dtype=int), np.ones(x.size)
        for t, flexible in zip(transfer[::-1], self.flexible[::-1], strict=True):
            t = t.transpose(1, 2, 0)
            # Rows of T11 + T12 Z above those of T21 + T22 Z.
            first = t[:, 0] + t[:, 2] * z[0] + t[:, 3] * z[1]
            second = t[:, 1] + t[:, 2] * z[1] + t[:, 3] * z[2]
            over = first[0] * second[1] - second[0] * first[1]
            if flexible:
                across = t[0, 2] * t[1, 3] - t[0, 3] * t[1, 2]
                corner = (t[1, 3] * first[0] - t[0, 3] * first[1]) / across
                count += _negative(over / across, corner)
            determinant *= over
            z = np.array(
                [
                    first[2] * second[1] - second[2] * first[1],
                    second[2] * first[0] - first[2] * second[0],
                    second[3] * first[0] - first[3] * second[0],
                ]
            )
            z /= over
        tip = z[0] * z[2] - z[1] ** 2
        count += _negative(tip, z[0])
        return count.reshape(shape), (determinant * tip).reshape(shape)


def _negative(determinant: Real, corner: Real) -> Real:
    """Number of negative eigenvalues of symmetric 2x2 matrices."""
    return np.where(determinant < 0, 1, np.where(corner < 0, 2, 0))


def _element_span(fixed: Real, inertial: Real) -> float:
    """Largest |eigenvalue| of an element's generator at the limit: its |lambda| L."""
    return float(np.abs(np.linalg.eigvals(fixed + inertial)).max())


def _exponential(matrix: Real) -> Real:
    """Taylor series by Horner, for pieces short enough not to need scaling."""
    result = np.broadcast_to(np.eye(4), matrix.shape)
    for order in range(_TERMS, 0, -1):
        result = np.eye(4) + (matrix / order) @ result
    return result


def _isolate(counter: _Counter, rigid: int, expected: int) -> tuple[Real, Real]:
    """Brackets of one mode each, by counting only: intervals that hold several are cut until they do not."""
    edges = np.linspace(0, 1, 4 * expected + 2)[1:]
    edges[0] = _NEAR_ZERO
    for _ in range(50):
        counts = counter(edges)[0]
        several = np.flatnonzero(np.diff(counts) > 1)
        if not several.size:
            break
        extra = edges[several, None] + np.diff(edges)[several, None] * np.arange(1, 8) / 8
        edges = np.sort(np.append(edges, extra))
    one = np.flatnonzero(np.diff(counts) == 1)
    if one.size != expected - rigid:
        raise ArithmeticError(f"{expected - rigid} modes counted, {one.size} separated")
    return edges[one], edges[one + 1]
