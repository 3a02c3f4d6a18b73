"""Screening: which variants apply to a fitted model, and their effect on its residuals to first order.

The effect is that of a small size of the cause after a refit of all other unknowns. It determines the order of the
fits, the detection threshold and the look-alikes, and where effects are small the variants that are fitted. The
evidence of a reported cause comes from its own fit.
"""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from receptance.diagnosis.causes import Cause, Parameter, Variant, parameters_of
from receptance.diagnosis.fitting import Fit
from receptance.diagnosis.model import Model, UndecidableError
from receptance.diagnosis.tangents import slopes_of
from receptance.diagnosis.thresholds import (
    CHANCE_DRAWS,
    COLUMNS_TOGETHER,
    DEPENDENT,
    INVISIBLE,
    LOOK_ALIKE,
    SCREENING_LIMIT,
    VARIANTS_FITTED,
)
from receptance.fit.adequacy import CHANCE
from receptance.fit.covariance import square_root


@dataclass(frozen=True, eq=False)
class Direction:
    """The linear effect of a variant of a cause on the residuals of a fit without it."""

    variant: Variant
    model: Model
    """The model of the fit with the variant."""
    parameters: dict[str, Parameter]
    """Its parameters by the names of their unknowns."""
    slopes: NDArray[np.float64]
    """`(n, k)` derivatives of the residuals after a refit of all other unknowns; columns that are not zero. Or their
    coordinates, see `in_common_basis`."""
    one_sided: bool
    """Whether it has one visible parameter, which can only move to one side of its null."""
    score: float
    """Predicted decrease of chi-square."""
    estimate: dict[str, float]
    """Values of the visible parameters at that decrease."""

    @property
    def cause(self) -> Cause:
        """The cause."""
        return self.variant.cause

    @property
    def count(self) -> int:
        """Number of its parameters for which evidence has a penalty."""
        return sum(parameter.penalised for parameter in self.parameters.values())

    @property
    def far(self) -> bool:
        """Whether the model differs from the fit without it even where its parameters are null, or it has none.

        Such a variant is not screened, and has no look-alikes.
        """
        return self.variant.far or not self.parameters

    @cached_property
    def basis(self) -> NDArray[np.float64]:
        """Orthonormal columns that span the slopes, without the smallest differences between them."""
        vectors, sizes, _ = np.linalg.svd(self.slopes / np.linalg.norm(self.slopes, axis=0), full_matrices=False)
        basis: NDArray[np.float64] = vectors[:, sizes > DEPENDENT * sizes[0]]
        return basis

    @property
    def typical_gain(self) -> float | None:
        """Increase of chi-square by the typical size; None where the effect is not linear in the parameters."""
        parameters = list(self.parameters.values())
        if not parameters or self.slopes.shape[1] != len(parameters):
            return None
        change = self.slopes @ np.array([0.0 if p.secondary else p.typical - p.null for p in parameters])
        return float(change @ change)

    def predicted_evidence(self, penalty: float) -> float:
        """Return the predicted evidence: the score less the penalty of its parameters."""
        return self.score - penalty * self.count


def list_variants(fit: Fit, causes: Sequence[Cause]) -> tuple[list[tuple[Variant, Model]], dict[str, UndecidableError]]:
    """Return the variants of causes that apply to a fitted model, each with its model, and undecidable causes.

    The second result has the reasons by the ids of the causes.
    """
    extended, undecidable = extensions_of(fit.model, causes)
    changes = [pair for pair in extended if pair[0].cause.changes_data]
    improving = _improving([pair for pair in changes if not pair[0].far], fit)
    if fit.misfit > SCREENING_LIMIT:
        # The joint, or a free mass, has to be fitted again before these bring a record closer.
        tried = {variant for variant, _ in improving}
        improving += [pair for pair in changes if pair[0] not in tried and _needs_a_refit(pair, fit.model)]
    inadequate = not fit.adequacy.passed
    others = [(v, model) for v, model in extended if not v.cause.changes_data and (inadequate or not v.cause.large)]
    return [*others, *improving], undecidable


def _needs_a_refit(change: tuple[Variant, Model], model: Model) -> bool:
    """Return whether only a new fit can show that a change of the data is right, as where it changes all records."""
    variant, changed = change
    pairs = zip(model.observations, changed.observations, strict=True)
    return variant.far or all(new is not old for old, new in pairs if old.is_receptance)


def extensions_of(
    model: Model, causes: Sequence[Cause]
) -> tuple[list[tuple[Variant, Model]], dict[str, UndecidableError]]:
    """Return all variants of causes that a model can have, each with its model, and undecidable causes."""
    extensions: list[tuple[Variant, Model]] = []
    undecidable: dict[str, UndecidableError] = {}
    for cause in causes:
        try:
            extensions += cause.extensions(model)
        except UndecidableError as error:
            undecidable[cause.id] = error
    return extensions, undecidable


def _improving(changes: Sequence[tuple[Variant, Model]], fit: Fit) -> list[tuple[Variant, Model]]:
    """Return the changes of the data that bring each record that they change closer to the model.

    The distance is the median error of the logarithm. A wrong sign or quantity is an error by a factor, which other
    changes do not imitate. The same change of some of these records is left out.
    """
    errors = {
        number: (residual * observation.standard_deviations).reshape(2, -1)
        for number, (observation, residual) in enumerate(zip(fit.model.observations, fit.parts, strict=True))
        if observation.is_receptance
    }
    before = {number: _distance(error, np.ones(1)) for number, error in errors.items()}
    improving: list[tuple[tuple[Variant, Model], dict[int, float]]] = []
    for change in changes:
        after = {}
        for number, (old, new) in enumerate(zip(fit.model.observations, change[1].observations, strict=True)):
            if new is not old and number in errors:
                after[number] = _distance(errors[number], new.receptance / old.receptance)
        if after and all(distance < before[number] for number, distance in after.items()):
            improving.append((change, after))
    return [change for change, after in improving if not any(after.items() < other.items() for _, other in improving)]


def _distance(error: NDArray[np.float64], factor: NDArray[np.inexact]) -> float:
    """Return the median error of the logarithm, `(2, n)`, of a record that is multiplied by a factor."""
    change = np.broadcast_to(np.log(np.abs(factor)) + 1j * np.angle(factor), error.shape[1:])
    real, imaginary = error[0] + change.real, error[1] + change.imag
    return float(np.median(np.hypot(real, np.angle(np.exp(1j * imaginary)))))


def directions(fit: Fit, extensions: Sequence[tuple[Variant, Model]], threads: int | None = 1) -> list[Direction]:
    """Return the linear effect on a fit of each variant, with its model; `threads` as in `Assembly.receptance`."""
    basis = fit.basis
    rest = fit.compressed_residual - basis @ (basis.T @ fit.compressed_residual)
    before = {unknown.name for unknown in fit.model.unknowns}
    parameters = [parameters_of(u for u in model.unknowns if u.name not in before) for _, model in extensions]
    seen = [
        i
        for i, (variant, _) in enumerate(extensions)
        if parameters[i] and not (variant.far or variant.cause.changes_data)
    ]
    found = slopes_of(fit, [extensions[i][1] for i in seen], threads)
    effects = dict(zip(seen, _after_a_refit(found, basis, rest), strict=True))
    return [_direction(extension, parameters[i], effects.get(i), rest) for i, extension in enumerate(extensions)]


class _Effect(NamedTuple):
    """Derivatives of all residuals by the unknowns of a variant, their norms and their products with the residuals."""

    slopes: NDArray[np.float64]
    norms: NDArray[np.float64]
    products: NDArray[np.float64]


def _after_a_refit(
    found: Sequence[NDArray[np.float64] | None], basis: NDArray[np.float64], rest: NDArray[np.float64]
) -> Iterator[_Effect | None]:
    """Yield derivatives of all residuals after a refit of the unknowns of the fit, from those of the observed ones.

    A cause does not change the residuals of the priors of the fit, and that of its own prior is zero at its null.
    """
    for first in range(0, len(found), COLUMNS_TOGETHER):
        some = found[first : first + COLUMNS_TOGETHER]
        known = [one for one in some if one is not None]
        if known:
            together = np.hstack(known)
            size = len(together)
            projected = -(basis @ (basis[:size].T @ together))
            projected[:size] += together
            norms, products = np.sqrt(np.einsum("ij,ij->j", projected, projected)), rest @ projected
        begin = 0
        for one in some:
            if one is None:
                yield None
                continue
            own = slice(begin, begin + one.shape[1])
            yield _Effect(projected[:, own], norms[own], products[own])
            begin = own.stop


def _direction(
    extension: tuple[Variant, Model],
    parameters: dict[str, Parameter],
    effect: _Effect | None,
    rest: NDArray[np.float64],
) -> Direction:
    """Return the linear effect of a variant from the derivatives of the residuals, if there are any."""
    empty = Direction(*extension, parameters, np.zeros((rest.size, 0)), False, 0.0, {})
    if effect is None:
        return empty
    is_visible = effect.norms > INVISIBLE * max(float(effect.norms.max(initial=0.0)), 1e-300)
    slopes = effect.slopes if is_visible.all() else effect.slopes[:, is_visible]
    products = effect.products[is_visible]
    if not slopes.shape[1]:
        return empty
    solution: NDArray[np.floating[Any]]
    if slopes.shape[1] == 1:
        solution = -products / np.square(effect.norms[is_visible])
    else:
        solution, *_ = np.linalg.lstsq(slopes, -rest, rcond=1e-10)
    starts = {u.name: float(u.start or 0.0) for u in extension[1].unknowns if u.name in parameters}
    visible = {name: one for (name, one), yes in zip(parameters.items(), is_visible, strict=True) if yes}
    only = next(iter(visible.values()))
    one_sided = len(visible) == 1 and only.one_sided
    score = float(-products @ solution)
    if one_sided and (solution[0] < 0.0) == (only.null == only.lower):
        solution, score = np.zeros(1), 0.0
    estimate = _estimate(visible, starts, dict(zip(visible, map(float, solution), strict=True)))
    return Direction(*extension, parameters, slopes, one_sided, score, estimate)


def _estimate(
    parameters: dict[str, Parameter], starts: dict[str, float], solution: dict[str, float]
) -> dict[str, float]:
    """Return the values at which a linear solution ends.

    The derivatives with respect to secondary parameters are proportional to the size at which they were taken, so that
    their changes are inversely proportional to the size that the cause reaches.
    """
    main = [name for name in solution if not parameters[name].secondary]
    ends = {name: starts[name] + solution[name] for name in solution}
    if len(main) != 1:
        return ends
    size, end = starts[main[0]], ends[main[0]]
    for name in set(solution) - set(main):
        ends[name] = starts[name] + (solution[name] * size / end if end else 0.0)
    return ends


def in_common_basis(effects: Sequence[Direction]) -> list[Direction]:
    """Return the directions with coordinates in a basis of all of them in place of the derivatives of all residuals.

    They have the same scalar products, which is all that thresholds, look-alikes and predictions need, in as many
    numbers as there are derivatives.
    """
    if not effects:
        return []
    counts = np.cumsum([effect.slopes.shape[1] for effect in effects])
    together = np.hstack([effect.slopes for effect in effects])
    coordinates = np.split(square_root(together.T @ together).T, counts[:-1], axis=1)
    return [replace(effect, slopes=coordinate) for effect, coordinate in zip(effects, coordinates, strict=True)]


def detection_threshold(
    effects: Sequence[Direction],
    penalty: float,
    *,
    deviance: Callable[[NDArray[np.float64]], NDArray[np.float64]] | None = None,
    freedom: float = 0.0,
    level: float = 1.0 - CHANCE,
    seed: int = 0,
) -> float:
    """Return a quantile of the best evidence by chance: a parametric bootstrap of the base, to first order.

    Residuals are drawn from noise and priors. Every cause is fitted to them linearly, and the largest evidence is kept.

    Parameters
    ----------
    effects : sequence of Direction
        The linear effects of the causes.
    penalty : float
        Penalty of each unknown in evidence.
    deviance : callable, optional
        Deviance of chi-square where the size of the errors is estimated; by default chi-square itself.
    freedom : float, optional
        With `deviance`: degrees of freedom of the base.
    level : float
        The quantile.
    seed : int
        Seed of the draws.
    """
    visible = [effect for effect in effects if effect.slopes.shape[1]]
    if not visible:
        return 0.0
    bases = np.hstack([effect.basis for effect in visible])
    sizes, vectors = np.linalg.eigh(bases.T @ bases)
    # Many effects are alike: fewer numbers than there are derivatives describe their scalar products with the noise.
    kept = sizes > DEPENDENT * sizes[-1]
    # The signs of eigenvectors differ between processors. Seven digits are more than the number of draws resolves.
    root = (vectors[:, kept] * np.sign(vectors[:, kept].sum(axis=0)) * np.sqrt(sizes[kept])).astype(np.float32)
    rng = np.random.default_rng([seed, 20])
    noise = rng.standard_normal((root.shape[1], CHANCE_DRAWS), dtype=np.float32)
    products = np.split(root @ noise, np.cumsum([effect.basis.shape[1] for effect in visible])[:-1])
    left = rng.chisquare(max(freedom - 1.0, 1.0), CHANCE_DRAWS)
    best = np.full(CHANCE_DRAWS, -np.inf)
    for effect, projected in zip(visible, products, strict=True):
        gain = np.sum(np.square(projected), axis=0)
        if effect.one_sided:
            # The sign of a basis is arbitrary.
            gain[projected[0] * np.sign(effect.basis[:, 0] @ effect.slopes[:, 0]) <= 0.0] = 0.0
        if deviance is not None:
            gain = deviance(left + gain) - deviance(left)
        best = np.maximum(best, gain - penalty * effect.count)
    return float(np.quantile(best, level))


def look_alike(first: Direction, second: Direction) -> float:
    """Return the largest canonical cosine of the effects of two causes, from 0 (distinct) to 1 (same effect)."""
    if not first.slopes.shape[1] or not second.slopes.shape[1]:
        return 0.0
    both = first.basis.T @ second.basis
    # A row or a column has one singular value.
    cosine = np.linalg.norm(both, None if 1 in both.shape else 2)
    return min(float(cosine), 1.0)


def look_alikes(effects: Sequence[Direction], variant: Variant) -> dict[str, float]:
    """Return the causes with an effect similar to that of a variant, and the largest cosine of each, descending."""
    cosines: dict[str, float] = {}
    for effect in [direction for direction in effects if direction.variant == variant][:1]:
        for other in effects:
            if other.cause.id != variant.cause.id and other.slopes.shape[1] <= effect.slopes.shape[1]:
                cosines[other.cause.id] = max(cosines.get(other.cause.id, 0.0), look_alike(effect, other))
    similar = sorted(cosines.items(), key=lambda pair: -pair[1])
    return {id: round(cosine, 4) for id, cosine in similar if cosine >= LOOK_ALIKE}


def rank(effects: Sequence[Direction], penalty: float) -> list[Direction]:
    """Return the directions of the variants that are fitted, the highest predicted evidence first."""
    ranked = sorted(effects, key=lambda effect: -effect.predicted_evidence(penalty))
    # The first variant of a cause acts on all records, or on the whole part.
    plain = first_of_each(effects, lambda effect: effect.cause.id)
    counts = dict.fromkeys((effect.cause.id for effect in effects), 0)
    chosen = []
    for effect in ranked:
        # A far variant has no linear prediction and is kept in any case.
        counts[effect.cause.id] += not effect.far
        if effect.far or effect in plain or counts[effect.cause.id] <= VARIANTS_FITTED:
            chosen.append(effect)
    return chosen


_T = TypeVar("_T")


def first_of_each(items: Sequence[_T], key: Callable[[_T], Hashable]) -> list[_T]:
    """Return the first of the items with the same key, in their order."""
    first: dict[Hashable, _T] = {}
    for item in items:
        first.setdefault(key(item), item)
    return list(first.values())
