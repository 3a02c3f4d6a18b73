"""Sparse elimination with row pivoting in any arithmetic, for trees of nodes with two unknowns each."""

from __future__ import annotations

from collections.abc import Sequence

from .arithmetic import Scalar

Element = tuple[list[int], list[list[Scalar]]]
"""The nodes of an element and its stiffness in (y, theta) of each."""


def leaves_first(elements: Sequence[Element], n_nodes: int) -> list[int]:
    """Return the nodes so that each comes before all but one of its neighbours, which avoids fill-in."""
    neighbours: list[list[int]] = [[] for _ in range(n_nodes)]
    for nodes, _ in elements:
        if len(nodes) == 2:
            neighbours[nodes[0]].append(nodes[1])
            neighbours[nodes[1]].append(nodes[0])
    seen = [False] * n_nodes
    root_first: list[int] = []
    for root in reversed(range(n_nodes)):
        waiting = [root]
        while waiting:
            node = waiting.pop()
            if seen[node]:
                continue
            seen[node] = True
            root_first.append(node)
            waiting.extend(neighbours[node])
    return root_first[::-1]


def eliminate(elements: Sequence[Element], n_nodes: int, loads: Sequence[int], zero: Scalar) -> dict[int, list[Scalar]]:
    """Solve the assembled system for unit loads.

    Parameters
    ----------
    elements : sequence of (nodes, matrix)
        What is assembled.
    n_nodes : int
        The number of nodes; unknown 2 n is y of node n, 2 n + 1 its theta.
    loads : sequence of int
        The unknown that each unit load acts on.
    zero : scalar
        Zero in the arithmetic in use.

    Returns
    -------
    dict
        For each unknown its value for each load.

    Raises
    ------
    ArithmeticError
        The matrix is singular.
    """
    rows: list[dict[int, Scalar]] = [{} for _ in range(2 * n_nodes)]
    for nodes, matrix in elements:
        unknowns = [2 * node + direction for node in nodes for direction in (0, 1)]
        for i, values in zip(unknowns, matrix, strict=True):
            for j, value in zip(unknowns, values, strict=True):
                rows[i][j] = rows[i][j] + value if j in rows[i] else value
    right = [{k: zero + 1 for k, load in enumerate(loads) if load == i} for i in range(2 * n_nodes)]
    order = [2 * node + direction for node in leaves_first(elements, n_nodes) for direction in (0, 1)]

    active = set(range(2 * n_nodes))
    pivots: list[int] = []
    for column in order:
        candidates = [i for i in active if rows[i].get(column, zero) != 0]
        if not candidates:
            raise ArithmeticError(f"the model is singular at node {column // 2}")
        pivot = max(candidates, key=lambda i: abs(rows[i][column]))
        active.remove(pivot)
        pivots.append(pivot)
        pivot_row, pivot_right = rows[pivot], right[pivot]
        inverse = 1 / pivot_row[column]
        for i in candidates:
            if i != pivot:
                factor = rows[i].pop(column) * inverse
                _subtract(rows[i], pivot_row, factor, column)
                _subtract(right[i], pivot_right, factor, None)

    solution: dict[int, list[Scalar]] = {}
    for column, pivot in zip(reversed(order), reversed(pivots), strict=True):
        row = rows[pivot]
        inverse = 1 / row[column]
        others = [(value, solution[j]) for j, value in row.items() if j != column and j in solution]
        values = []
        for k in range(len(loads)):
            total = right[pivot].get(k, zero)
            for value, other in others:
                total = total - value * other[k]
            values.append(total * inverse)
        solution[column] = values
    return solution


def _subtract(target: dict[int, Scalar], source: dict[int, Scalar], factor: Scalar, skip: int | None) -> None:
    for j, value in source.items():
        if j != skip:
            target[j] = target[j] - factor * value if j in target else -factor * value
