"""Receptances and their derivatives to many digits, from the tables alone.

The dynamic stiffness of each element is assembled into one global matrix, which is solved by elimination with
row pivoting. That loses digits; the precision is raised until two successive ones agree.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import mpmath
import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import stiffness
from .arithmetic import DEFAULT, Arithmetic, Scalar
from .solve import Element, eliminate
from .tables import COLUMNS, GROUNDS, JOINTS, MASSES, NODE_COLUMNS, SEGMENTS, Tables, is_continuous

AGREEMENT = 1e-20
"""Two successive precisions must agree to this, relative, in every entry ..."""
NEGLIGIBLE = 1e-290
"""... that is not below this: float64 could not hold it with its digits."""
FIRST_DIGITS = 80
FIRST_DIGITS_DERIVATIVE = 120
MOST_DIGITS = 4000
PERTURBATION = "1e-15"

Values = list[list[list[Scalar]]]
Signs = tuple[list[NDArray[np.int64]], tuple[int, int]]
"""The sign of the relative change of every table entry, and of the two parts of w."""


def receptance(
    tables: Tables, w: complex, excitations: ArrayLike, responses: ArrayLike, *, ar: Arithmetic = DEFAULT
) -> list[list[mpmath.mpc]]:
    """Return the receptance at one angular frequency.

    Parameters
    ----------
    tables : Tables
        The model; float64 entries are taken as exact numbers.
    w : complex
        Angular frequency [rad/s].
    excitations, responses : array_like, shape (n, 2)
        Rows (node, direction), direction 0 for y or force, 1 for theta or moment.
    ar : arithmetic, optional
        gmpy2's numbers by default, mpmath's if it is not installed.

    Returns
    -------
    list of list of mpmath.mpc
        [response][excitation].

    Raises
    ------
    ArithmeticError
        The model is singular at this frequency, or no precision was enough.
    """
    line = _Line(tables, w, excitations, responses, ar)
    flat, _ = _converged(line.receptance, FIRST_DIGITS, ar)
    return _nest([ar.to_mpc(value) for value in flat], line.shape)


def receptance_complex128(
    tables: Tables, w: ArrayLike, excitations: ArrayLike, responses: ArrayLike
) -> NDArray[np.complex128]:
    """Return the receptance of one or many lines, rounded; with many, the lines are the first axis."""
    lines = [receptance(tables, complex(line), excitations, responses) for line in np.atleast_1d(w)]
    rounded = _rounded(lines)
    return rounded if np.ndim(w) else rounded[0]


def derivative(
    tables: Tables,
    w: complex,
    excitations: ArrayLike,
    responses: ArrayLike,
    parameters: ArrayLike,
    *,
    ar: Arithmetic = DEFAULT,
) -> list[list[list[mpmath.mpc]]]:
    """Return the derivative of the receptance by central differences in high precision.

    Two successive precisions use different steps (a third of the digits each), so their agreement checks
    the step as well as the rounding.

    Parameters
    ----------
    tables, w, excitations, responses, ar
        As for `receptance`.
    parameters : array_like, shape (n, 3)
        Rows (table, row, column).

    Returns
    -------
    list of list of list of mpmath.mpc
        [response][excitation][parameter]. A core's columns have zero derivatives where there is no core.

    Raises
    ------
    ValueError
        A parameter that is a node number or a choice.
    ArithmeticError
        As for `receptance`.
    """
    line = _Line(tables, w, excitations, responses, ar)
    requested = _parameters(parameters)
    flat, _ = _converged(lambda digits: line.derivative(digits, requested), FIRST_DIGITS_DERIVATIVE, ar)
    return _nest([ar.to_mpc(value) for value in flat], (*line.shape, len(requested)))


def derivative_complex128(
    tables: Tables, w: ArrayLike, excitations: ArrayLike, responses: ArrayLike, parameters: ArrayLike
) -> NDArray[np.complex128]:
    """Return the derivative of one or many lines, rounded; the parameters are the last axis."""
    lines = [derivative(tables, complex(line), excitations, responses, parameters) for line in np.atleast_1d(w)]
    rounded = _rounded(lines)
    return rounded if np.ndim(w) else rounded[0]


def sensitivity(
    tables: Tables,
    w: complex,
    excitations: ArrayLike,
    responses: ArrayLike,
    n_draws: int,
    rng: np.random.Generator,
    *,
    ar: Arithmetic = DEFAULT,
) -> NDArray[np.float64]:
    """Return the relative change of each receptance when every input changes by 1e-15 of itself.

    Returns
    -------
    ndarray, shape (n_responses, n_excitations)
        The largest change over `n_draws` draws of the signs of all changes.
    """
    line = _Line(tables, w, excitations, responses, ar)
    base, digits = _converged(line.receptance, FIRST_DIGITS, ar)
    draws = (line.receptance(digits, _draw_signs(tables, rng)) for _ in range(n_draws))
    return _largest_change(base, draws, digits, ar).reshape(line.shape)


def derivative_sensitivity(
    tables: Tables,
    w: complex,
    excitations: ArrayLike,
    responses: ArrayLike,
    parameters: ArrayLike,
    n_draws: int,
    rng: np.random.Generator,
    *,
    ar: Arithmetic = DEFAULT,
) -> NDArray[np.float64]:
    """Return the relative change of each derivative when every input changes by 1e-15 of itself.

    Returns
    -------
    ndarray, shape (n_responses, n_excitations, n_parameters)
        The largest change over `n_draws` draws; zero where the derivative is and stays zero.
    """
    line = _Line(tables, w, excitations, responses, ar)
    requested = _parameters(parameters)
    base, digits = _converged(lambda d: line.derivative(d, requested), FIRST_DIGITS_DERIVATIVE, ar)
    draws = (line.derivative(digits, requested, _draw_signs(tables, rng)) for _ in range(n_draws))
    return _largest_change(base, draws, digits, ar).reshape(*line.shape, len(requested))


class _Line:
    """One frequency line of one model, to be evaluated at any precision."""

    def __init__(
        self, tables: Tables, w: complex, excitations: ArrayLike, responses: ArrayLike, ar: Arithmetic
    ) -> None:
        self.tables = tables
        self.rows: list[list[list[float]]] = [table.tolist() for table in tables]
        self.w = complex(w)
        self.excitations = _unknowns(excitations)
        self.responses = _unknowns(responses)
        self.shape = (len(self.responses), len(self.excitations))
        self.ar = ar

    def receptance(self, digits: int, signs: Signs | None = None) -> list[Scalar]:
        with self.ar.precision(digits):
            values, w = self._numbers(signs)
            return self._solve([self._element(t, r, row, w) for t, r, row in _each_row(values)])

    def derivative(
        self, digits: int, parameters: list[tuple[int, int, int]], signs: Signs | None = None
    ) -> list[Scalar]:
        columns = []
        with self.ar.precision(digits):
            relative_step = self.ar.real(f"1e-{digits // 3}")
            values, w = self._numbers(signs)
            places = {(t, r): i for i, (t, r, _) in enumerate(_each_row(values))}
            elements = [self._element(t, r, row, w) for t, r, row in _each_row(values)]
            for table, row, column in parameters:
                step = relative_step * self._scale(table, row, column)
                sides = []
                for offset in (step, -step):
                    moved = list(values[table][row])
                    moved[column] += offset
                    changed = list(elements)
                    changed[places[table, row]] = self._element(table, row, moved, w)
                    sides.append(self._solve(changed))
                columns.append([(plus - minus) / (2 * step) for plus, minus in zip(*sides, strict=True)])
        return [column[entry] for entry in range(self.shape[0] * self.shape[1]) for column in columns]

    def _numbers(self, signs: Signs | None) -> tuple[Values, Scalar]:
        real = self.ar.real
        values = [[[real(x) for x in row] for row in table] for table in self.rows]
        w_real, w_imag = real(self.w.real), real(self.w.imag)
        if signs is not None:
            change = real(PERTURBATION)
            for table, table_signs in zip(values, signs[0], strict=True):
                for row, row_signs in zip(table, table_signs.tolist(), strict=True):
                    row[:] = [x * (1 + sign * change) for x, sign in zip(row, row_signs, strict=True)]
            w_real *= 1 + signs[1][0] * change
            w_imag *= 1 + signs[1][1] * change
        return values, self.ar.complex(w_real, w_imag)

    def _element(self, table: int, row: int, values: list[Scalar], w: Scalar) -> Element:
        given = self.rows[table][row]
        nodes = [int(node) for node in given[: NODE_COLUMNS[table]]]
        if table == SEGMENTS:
            matrix = stiffness.segment(values, given[13], given[10] != 0.0, w, self.ar)
        elif table == JOINTS:
            matrix = stiffness.joint(values, w, self.ar)
        elif table == MASSES:
            matrix = stiffness.mass(values, w)
        else:
            matrix = stiffness.spring(values[1:], w, self.ar)
        return nodes, matrix

    def _solve(self, elements: list[Element]) -> list[Scalar]:
        zero = self.ar.real(0.0)
        solution = eliminate(elements, self.tables.n_nodes, self.excitations, zero)
        return [value for response in self.responses for value in solution[response]]

    def _scale(self, table: int, row: int, column: int) -> float:
        """Return the size of a change that matters, to take a step from."""
        given = self.rows[table][row]
        if given[column] != 0.0:
            return abs(given[column])
        named = dict(zip(COLUMNS[table], given, strict=True))
        name = COLUMNS[table][column]
        if name == "inner_diameter":
            return named["outer_diameter"]
        if table in (JOINTS, GROUNDS) and name != "loss_factor":
            largest_y = max(named["k_y"], abs(self.w) * named["c_y"]) or 1.0
            largest_theta = max(named["k_theta"], abs(self.w) * named["c_theta"]) or 1.0
            scales = {"y": largest_y, "theta": largest_theta, "ytheta": (largest_y * largest_theta) ** 0.5}
            scale = scales[name[2:]]
            return scale / abs(self.w) if name.startswith("c") else scale
        return 1.0


class TooFewDigitsError(ArithmeticError):
    """A matrix that is regular with more digits is singular with these."""


def _converged(evaluate: Callable[[int], list[Scalar]], first_digits: int, ar: Arithmetic) -> tuple[list[Scalar], int]:
    """Return the values at the first precision that agrees with the one before it, and its digits."""
    before: list[Scalar] = []
    digits = first_digits
    while digits <= MOST_DIGITS:
        try:
            values = evaluate(digits)
        except TooFewDigitsError:
            values = []
        with ar.precision(digits):
            if before and values and all(_agree(x, y) for x, y in zip(before, values, strict=True)):
                return values, digits
        before, digits = values, int(1.6 * digits)
    raise ArithmeticError(f"{MOST_DIGITS} digits are not enough")


def _agree(before: Scalar, now: Scalar) -> bool:
    size = abs(now)
    return bool(abs(now - before) <= AGREEMENT * size or max(size, abs(before)) < NEGLIGIBLE)


def _largest_change(
    base: list[Scalar], draws: Iterator[list[Scalar]], digits: int, ar: Arithmetic
) -> NDArray[np.float64]:
    largest = np.zeros(len(base))
    for draw in draws:
        with ar.precision(digits):
            for entry, (x, y) in enumerate(zip(base, draw, strict=True)):
                if x == y:
                    continue
                change = float(abs(y - x) / abs(x)) if x != 0 else np.inf
                largest[entry] = max(largest[entry], change)
    return largest


def _draw_signs(tables: Tables, rng: np.random.Generator) -> Signs:
    drawn = []
    for number, table in enumerate(tables):
        moved = np.array([is_continuous(number, column) for column in range(table.shape[1])])
        drawn.append(rng.choice([-1, 1], size=table.shape) * moved)
    first, second = rng.choice([-1, 1], size=2).tolist()
    return drawn, (first, second)


def _each_row(values: Values) -> Iterator[tuple[int, int, list[Scalar]]]:
    for table, rows in enumerate(values):
        for number, row in enumerate(rows):
            yield table, number, row


def _unknowns(points: ArrayLike) -> list[int]:
    return [2 * int(node) + int(direction) for node, direction in np.asarray(points).reshape(-1, 2)]


def _parameters(parameters: ArrayLike) -> list[tuple[int, int, int]]:
    requested = [(int(t), int(r), int(c)) for t, r, c in np.asarray(parameters).reshape(-1, 3)]
    for table, row, column in requested:
        if not is_continuous(table, column):
            raise ValueError(f"column {column} of table {table} (row {row}) is not a physical quantity")
    return requested


def _nest(flat: Sequence[mpmath.mpc], shape: tuple[int, ...]) -> list:
    array = np.empty(len(flat), dtype=object)
    array[:] = flat
    return array.reshape(shape).tolist()


def _rounded(values: list) -> NDArray[np.complex128]:
    objects = np.array(values, dtype=object)
    # a plain astype would go through float for an empty or real-valued array
    return np.array([complex(value) for value in objects.ravel()], dtype=np.complex128).reshape(objects.shape)
