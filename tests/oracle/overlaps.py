"""Overlaps to many digits: two beams side by side, as the matrix exponential of their eight equations.

The equations are those of each beam as they stand in a textbook, with the layer's load added; the exponential is a
Taylor series with scaling and squaring. The four nodes of an overlap are reduced to the two that go on, and the
rest of the model is that of `exact`.
"""

from __future__ import annotations

from collections.abc import Sequence

import mpmath
import numpy as np
from numpy.typing import ArrayLike, NDArray

from . import exact, stiffness
from .arithmetic import DEFAULT, Arithmetic, Scalar
from .tables import COWPER, Tables

COLUMNS = (
    "a", "b", "length",
    *(f"{beam}_{name}" for beam in ("inner", "outer") for name in (
        "outer_diameter", "inner_diameter", "youngs_modulus", "density", "poisson_ratio", "loss_factor",
        "core_youngs_modulus", "core_density", "core_poisson_ratio", "core_loss_factor", "shear_model")),
    "k_y", "k_theta", "c_y", "c_theta", "loss_factor", "slope", "points",
)  # fmt: skip
"""Columns of the overlap table; `points` is 0 for a layer, else the number of springs in a row. Their stiffness changes
linearly along the insertion: a spring at x has the share (1 + slope (2 x / length - 1)) / points."""
BEAMS = (3, 14)
"""The first column of each beam."""
LAYER = 25
SLOPE, POINTS = 30, 31
FIXED = (0, 1, 13, 24, POINTS)
"""Columns that are no physical quantities."""

FIRST_DIGITS = 160
"""A stiff layer's exponential grows by tens of orders, which the elimination has to carry."""

Matrix = list[list[Scalar]]


def overlap(
    a: int,
    b: int,
    length: float,
    inner: Sequence[float],
    outer: Sequence[float],
    layer: Sequence[float],
    points: int = 0,
    slope: float = 0.0,
) -> list[float]:
    """Return a row: beams as (outer diameter, bore, E, rho, nu, loss), layer (k_y, k_theta, c_y, c_theta, loss)."""
    beams = [[*beam, 0.0, 0.0, 0.0, 0.0, COWPER] for beam in (inner, outer)]
    return [a, b, length, *beams[0], *beams[1], *layer, slope, float(points)]


def receptance_complex128(
    tables: Tables, overlaps: ArrayLike, w: ArrayLike, excitations: ArrayLike, responses: ArrayLike
) -> NDArray[np.complex128]:
    """Return the receptance of several lines, rounded; arguments as for `exact.receptance`."""
    lines = []
    for one in np.atleast_1d(w):
        line = _Line(tables, overlaps, complex(one), excitations, responses, DEFAULT)
        flat, _ = exact._converged(line.receptance, FIRST_DIGITS, DEFAULT)
        lines.append(exact._nest([DEFAULT.to_mpc(value) for value in flat], line.shape))
    return exact._rounded(lines)


def derivative_complex128(
    tables: Tables,
    overlaps: ArrayLike,
    w: ArrayLike,
    excitations: ArrayLike,
    responses: ArrayLike,
    columns: Sequence[tuple[int, int]],
) -> NDArray[np.complex128]:
    """Return the derivative by (row, column) of the overlap table, by central differences in many digits."""
    lines = []
    for one in np.atleast_1d(w):
        line = _Line(tables, overlaps, complex(one), excitations, responses, DEFAULT)
        flat, _ = exact._converged(lambda d, line=line: line.by_overlap(d, columns), FIRST_DIGITS, DEFAULT)
        lines.append(exact._nest([DEFAULT.to_mpc(value) for value in flat], (*line.shape, len(columns))))
    return exact._rounded(lines)


class _Line(exact._Line):
    """One frequency line of a model with overlaps."""

    def __init__(
        self,
        tables: Tables,
        overlaps: ArrayLike,
        w: complex,
        excitations: ArrayLike,
        responses: ArrayLike,
        ar: Arithmetic,
    ) -> None:
        super().__init__(tables, w, excitations, responses, ar)
        self.given: list[list[float]] = np.asarray(overlaps, dtype=float).reshape(-1, len(COLUMNS)).tolist()
        self.moved: tuple[int, int, Scalar] | None = None

    def by_overlap(self, digits: int, columns: Sequence[tuple[int, int]]) -> list[Scalar]:
        found = []
        for row, column in columns:
            sides = []
            for sign in (1, -1):
                with self.ar.precision(digits):
                    # a zero entry is changed by a share of its neighbour
                    scale = abs(self.given[row][column]) or {4: self.given[row][3], 15: self.given[row][14]}.get(
                        column, 1.0 / abs(self.w) if column in (LAYER + 2, LAYER + 3) else 1.0
                    )
                    step = self.ar.real(f"1e-{digits // 3}") * self.ar.real(scale)
                    self.moved = (row, column, sign * step)
                sides.append(self.receptance(digits))
            self.moved = None
            with self.ar.precision(digits):
                found.append([(plus - minus) / (2 * step) for plus, minus in zip(*sides, strict=True)])
        return [column[entry] for entry in range(self.shape[0] * self.shape[1]) for column in found]

    def _solve(self, elements: list[exact.Element]) -> list[Scalar]:
        _, w = self._numbers(None)
        more = []
        for number, given in enumerate(self.given):
            values = [self.ar.real(value) for value in given]
            if self.moved is not None and self.moved[0] == number:
                values[self.moved[1]] += self.moved[2]
            more.append(([int(given[0]), int(given[1])], reduced_stiffness(values, given, w, self.ar)))
        return super()._solve([*elements, *more])


def reduced_stiffness(row: Sequence[Scalar], given: Sequence[float], w: Scalar, ar: Arithmetic) -> Matrix:
    """Return the 4x4 dynamic stiffness of an overlap between its two nodes, the other two ends being free."""
    zero = ar.complex(ar.real(0.0), ar.real(0.0))
    sections = []
    for start in BEAMS:
        segment = [zero, zero, row[2], *row[start : start + 10]]
        sections.append(stiffness.section(segment, given[start + 10], given[start + 7] != 0.0, ar))
    k_y, k_theta, c_y, c_theta, loss = row[LAYER : LAYER + 5]
    lossy, rate = ar.complex(1 + 0 * loss, loss), w * ar.complex(0 * loss, 1 + 0 * loss)
    layer = [lossy * k_y + rate * c_y, lossy * k_theta + rate * c_theta]
    length, points = row[2], int(given[POINTS])
    if points == 0:
        transfer = exponential(equations(sections, [k / length for k in layer], w, zero), length, ar)
    else:
        half = exponential(equations(sections, [zero, zero], w, zero), length / (2 * points), ar)
        transfer = _identity(8, zero)
        for number in range(points):
            share = (1 + row[SLOPE] * (ar.real(2 * number + 1) / points - 1)) / points
            spring = _identity(8, zero)
            for i, k in enumerate(layer):
                for beam, sign in ((0, 1), (1, -1)):
                    spring[4 * beam + 2 + i][i] += sign * k * share
                    spring[4 * beam + 2 + i][4 + i] -= sign * k * share
            transfer = product(half, product(spring, product(half, transfer)))
    return _reduce(transfer)


def equations(sections: Sequence[stiffness.Section], layer: Sequence[Scalar], w: Scalar, zero: Scalar) -> Matrix:
    """Return A of s' = A s, s = (y, theta, V, M) of the inner beam and then of the outer one."""
    a = [[zero] * 8 for _ in range(8)]
    for beam, section in enumerate(sections):
        at, other = 4 * beam, 4 - 4 * beam
        y, theta, force, moment = range(at, at + 4)
        a[y][theta], a[y][force] = zero + 1, 1 / section.shear
        a[theta][moment] = 1 / section.bending
        a[force][y] = -section.mass * w * w + layer[0]
        a[force][other] = -layer[0]
        a[moment][force] = zero - 1
        a[moment][theta] = -section.rotary * w * w + layer[1]
        a[moment][other + 1] = -layer[1]
    return a


def exponential(a: Matrix, length: Scalar, ar: Arithmetic) -> Matrix:
    """Return exp(a length) by the Taylor series of exp(a length / 2^k) and k squarings."""
    size = mpmath.mpf(0)
    # the eighth power has no unit between like entries: its diagonal gives the number of waves
    power = [[value * length for value in line] for line in a]
    for _ in range(3):
        power = product(power, power)
    for i in range(8):
        size = max(size, abs(ar.to_mpc(power[i][i])))
    halvings = max(0, int(mpmath.ceil(mpmath.log(1 + size, 2) / 8)) + 4)
    step = [[value * length / 2**halvings for value in line] for line in a]
    zero = a[0][0] * 0
    total, term = _identity(8, zero), _identity(8, zero)
    for order in range(1, 4000):
        term = [[value / order for value in line] for line in product(term, step)]
        before = total
        total = [[x + y for x, y in zip(p, q, strict=True)] for p, q in zip(total, term, strict=True)]
        if order > 8 and total == before:
            break
    for _ in range(halvings):
        total = product(total, total)
    return total


def product(a: Matrix, b: Matrix) -> Matrix:
    columns = list(zip(*b, strict=True))
    return [[sum(x * y for x, y in zip(line, column, strict=True)) for column in columns] for line in a]


def _identity(n: int, zero: Scalar) -> Matrix:
    return [[zero + (1 if i == j else 0) for j in range(n)] for i in range(n)]


def _reduce(transfer: Matrix) -> Matrix:
    """From the transfer matrix to the stiffness over (inner beam at 0, outer beam at L)."""
    motions, forces = (0, 1, 4, 5), (2, 3, 6, 7)
    block = {
        (p, q): [[transfer[i][j] for j in columns] for i in rows]
        for p, rows in (("u", motions), ("n", forces))
        for q, columns in (("u", motions), ("n", forces))
    }
    zero = transfer[0][0] * 0
    inverse = _solve(block["u", "n"], _identity(4, zero))
    near = product(inverse, block["u", "u"])
    far = product(block["n", "n"], inverse)
    corner = product(block["n", "n"], near)
    whole = [[zero] * 8 for _ in range(8)]
    for i in range(4):
        for j in range(4):
            whole[i][j], whole[i][4 + j] = near[i][j], -inverse[i][j]
            whole[4 + i][j], whole[4 + i][4 + j] = block["n", "u"][i][j] - corner[i][j], far[i][j]
    keep, free = (0, 1, 6, 7), (2, 3, 4, 5)
    inner = _solve([[whole[i][j] for j in free] for i in free], [[whole[i][j] for j in keep] for i in free])
    change = product([[whole[i][j] for j in free] for i in keep], inner)
    return [[whole[i][j] - change[p][q] for q, j in enumerate(keep)] for p, i in enumerate(keep)]


def _solve(matrix: Matrix, right: Matrix) -> Matrix:
    """Solve by elimination with row pivoting."""
    rows = [[*left, *more] for left, more in zip(matrix, right, strict=True)]
    n = len(rows)
    for column in range(n):
        pivot = max(range(column, n), key=lambda i, column=column: abs(rows[i][column]))
        if rows[pivot][column] == 0:
            raise exact.TooFewDigitsError("the end of the overlap that is loaded cannot be solved for")
        rows[column], rows[pivot] = rows[pivot], rows[column]
        inverse = 1 / rows[column][column]
        rows[column] = [value * inverse for value in rows[column]]
        for i in range(n):
            if i != column:
                factor = rows[i][column]
                rows[i] = [x - factor * y for x, y in zip(rows[i], rows[column], strict=True)]
    return [line[n:] for line in rows]
