"""A race of causes: which of some rivals explain the data best beside the causes that are kept.

Successive halving (Jamieson and Talwalkar 2016, "Non-stochastic best arm identification and hyperparameter
optimization"): all rivals get short fits to compressed data from a few starts, those that may come close to the best
one get further starts and evaluations, and those that do are fitted to all lines.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

from receptance.diagnosis.causes import Variant
from receptance.diagnosis.explanation import Explanation, Selection, behind_limit
from receptance.diagnosis.fitting import Exploration, Fit, explore, fit_base, fit_or_none, with_null
from receptance.diagnosis.progress import Progress
from receptance.diagnosis.screening import Direction, first_of_each
from receptance.diagnosis.starts import starts_from_singles, starts_of
from receptance.diagnosis.thresholds import (
    BEHIND,
    CONTINUED_SHARE,
    LEADING_CAUSES,
    LEAST_CONTINUED,
    MARGIN,
)
from receptance.fit.adequacy import MISFIT_LIMIT


@dataclass(frozen=True)
class Neighbourhood:
    """Causes that are kept, and the variants of further causes that race to be added to them."""

    kept: tuple[Variant, ...]
    root: Fit
    """The fit with the causes that are kept."""
    rivals: Sequence[Direction]
    """The variants, each with its linear effect."""
    near: Mapping[str, float] = field(default_factory=dict)
    """Values of the best explanation, from which the rivals are fitted as well."""
    adequate: float = math.inf
    """Chi-square of an adequate explanation, if there is one: rivals far behind it are left out."""
    alternatives: bool = False
    """Whether the rivals are no causes."""
    least: float = -math.inf
    """Evidence above which a rival becomes an explanation; with less it is only known to have been tried."""

    @property
    def stage(self) -> str:
        """The stage of the diagnosis, as of `Progress`."""
        if self.alternatives:
            return "alternatives"
        return "together" if self.kept else "causes"

    def starts(self, rival: Direction, selection: Selection) -> list[list[dict[str, float]]]:
        """Return groups of starting values of a rival."""
        groups = starts_of(rival, self.root)
        if self.near:
            joint = {name: self.near[name] for name in selection.base.values}
            groups = [[{**groups[0][0], **self.near}, {**groups[0][-1], **joint}]]
        if self.kept:
            alone = [single.fit for single in selection.singles if single.variants[0] == rival.variant]
            groups[0] += starts_from_singles(selection.base, alone, self.root)
        return groups


def race(neighbourhood: Neighbourhood, selection: Selection, progress: Progress) -> Iterator[Explanation]:
    """Yield the rivals of a neighbourhood as explanations.

    Those that come close to the best one are fitted to all lines, the others are as their short fits left them.
    After a KeyboardInterrupt the best of these follow, before it is raised again.
    """
    changed = [rival for rival in neighbourhood.rivals if rival.cause.changes_data]
    for explanation in _changed_data(neighbourhood, changed, selection, progress):
        yield explanation
        if explanation.adequacy.of_lines:
            # Without that change of the data no fit comes close to them.
            return
    rivals = [rival for rival in neighbourhood.rivals if not rival.cause.changes_data]
    explored: list[tuple[Direction, Exploration]] = []
    try:
        for pair in _explore(neighbourhood, rivals, selection, progress):
            explored.append(pair)
            leading = min(explored, key=lambda pair: pair[1].chi_square)[0]
            progress.leading = " + ".join(each.cause.title for each in (*neighbourhood.kept, leading.variant))
        latest = sorted(dict(explored).items(), key=lambda pair: pair[1].chi_square)
        yield from _finish(neighbourhood, latest, selection, progress)
    except KeyboardInterrupt:
        latest = sorted(dict(explored).items(), key=lambda pair: pair[1].chi_square)
        for rival, exploration in first_of_each(latest, lambda pair: pair[0].cause.id)[:LEADING_CAUSES]:
            if exploration.best is not None:
                yield selection.explain((*neighbourhood.kept, rival.variant), exploration.best)
        raise


def _changed_data(
    neighbourhood: Neighbourhood, rivals: Sequence[Direction], selection: Selection, progress: Progress
) -> Iterator[Explanation]:
    """Yield the rivals that change the data, each fitted from its own starting values."""
    fits = [partial(fit_or_none, partial(fit_base, rival.model)) for rival in rivals]
    titles = [_title(neighbourhood, rival) for rival in rivals]
    for rival, fit in zip(rivals, progress.run(neighbourhood.stage, titles, fits, selection.workers), strict=True):
        if fit is not None:
            selection.evaluations += fit.evaluations
            yield selection.explain((*neighbourhood.kept, rival.variant), fit)


def _explore(
    neighbourhood: Neighbourhood, rivals: Sequence[Direction], selection: Selection, progress: Progress
) -> Iterator[tuple[Direction, Exploration]]:
    """Yield the rivals with their short fits, and again with further ones if they may come close to the best one.

    A rival may if its short fit or its linear effect does, or if it has not come far: its fit is above chi-square of
    the root, or it has no linear effect.
    """
    root = neighbourhood.root
    starts = [neighbourhood.starts(rival, selection) for rival in rivals]
    titles = [_title(neighbourhood, rival) for rival in rivals]
    fits: list[Callable[[], Exploration]] = [
        partial(explore, root, rival.model, groups[0], far=rival.far)
        for rival, groups in zip(rivals, starts, strict=True)
    ]
    short = []
    for rival, exploration in zip(
        rivals, progress.run(neighbourhood.stage, titles, fits, selection.workers), strict=True
    ):
        selection.evaluations += exploration.evaluations
        short.append(exploration)
        yield rival, exploration
    limit = math.inf
    if math.isfinite(neighbourhood.adequate) or any(exploration.misfit <= MISFIT_LIMIT for exploration in short):
        limit = behind_limit(root.chi_square, (neighbourhood.adequate, *(each.chi_square for each in short)))

    def prospect(i: int) -> float:
        # Short fits from afar may not have come far.
        predicted = root.chi_square - rivals[i].score
        return min(short[i].chi_square, math.inf if rivals[i].far else predicted) + selection.penalty * rivals[i].count

    near = [i for i in sorted(range(len(rivals)), key=prospect) if prospect(i) <= limit]
    near = near[: max(LEAST_CONTINUED, math.ceil(CONTINUED_SHARE * len(rivals)))]
    fits = [partial(short[i].go_on, [start for group in starts[i][1:] for start in group]) for i in near]
    titles = [f"{titles[i]}, continued" for i in near]
    for i, exploration in zip(near, progress.run(neighbourhood.stage, titles, fits, selection.workers), strict=True):
        selection.evaluations += exploration.evaluations - short[i].evaluations
        yield rivals[i], exploration


def _finish(
    neighbourhood: Neighbourhood,
    explored: Sequence[tuple[Direction, Exploration]],
    selection: Selection,
    progress: Progress,
) -> Iterator[Explanation]:
    """Yield explored rivals, the best one first: fitted to all lines where they come close to the best one."""
    root = neighbourhood.root
    limit = behind_limit(root.chi_square, (neighbourhood.adequate, *(each.chi_square for _, each in explored)))
    leaders: dict[str, float] = {}
    rivals: list[tuple[Direction, Exploration]] = []
    for rival, exploration in explored:
        # A variant far behind another one of its cause is not needed.
        is_close = exploration.chi_square <= leaders.setdefault(rival.cause.id, exploration.chi_square) + BEHIND
        gains = root.chi_square - exploration.chi_square >= MARGIN
        if is_close and gains and exploration.chi_square <= limit:
            rivals.append((rival, exploration))
        elif exploration.best is not None:
            better = rival.far or exploration.chi_square < root.chi_square
            null = exploration.best if better else with_null(rival.model, root)
            yield selection.explain((*neighbourhood.kept, rival.variant), null)
    fits: list[Callable[[], Fit | None]] = [exploration.finish for _, exploration in rivals]
    titles = [f"{_title(neighbourhood, rival)}, on all lines" for rival, _ in rivals]
    best: Explanation | None = None
    for (rival, exploration), fit in zip(
        rivals, progress.run(neighbourhood.stage, titles, fits, selection.workers), strict=True
    ):
        if fit is not None:
            selection.evaluations += fit.evaluations - exploration.evaluations
            explanation = selection.explain((*neighbourhood.kept, rival.variant), fit)
            best = explanation if best is None or explanation.evidence > best.evidence else best
            progress.leading = f"{best.title}, misfit {best.fit.misfit:.2f}"
            yield explanation


def _title(neighbourhood: Neighbourhood, rival: Direction) -> str:
    """Return the names of the causes with a rival, and its variant."""
    return (
        ("no cause: " if neighbourhood.alternatives else "")
        + " + ".join(each.cause.title for each in (*neighbourhood.kept, rival.variant))
        + f", {rival.variant.name}"
    )
