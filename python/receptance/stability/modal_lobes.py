"""Lobes by semi-discretisation, with bands where modes or cutting coefficients are uncertain."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from typing import TYPE_CHECKING

import numpy as np

from receptance import _checks
from receptance.stability.cutting import Milling
from receptance.stability.lobes import Lobes, ensemble, with_draws
from receptance.stability.semi_discretisation import limit_near, semi_discretised_limit

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import ArrayLike, NDArray

    from receptance.stability.modal_model import TipModes

__all__ = ["semi_discretised_lobes"]


def semi_discretised_lobes(
    cut: Milling,
    tip: TipModes,
    *,
    speeds_rpm: ArrayLike,
    most: float,
    draws: Sequence[TipModes] | None = None,
    cuts: Sequence[Milling] | None = None,
    threads: int | None = None,
    progress: Callable[[str], None] | None = None,
) -> Lobes:
    """Return the limit of depth over spindle speed with the periodic force as it is.

    The limit of each draw is the crossing nearest to that of `tip`: an island of instability below it that only the
    draw has is not seen. A limit takes some 10 to 100 ms for each draw and speed, longer at low speeds.

    Parameters
    ----------
    cut, tip, speeds_rpm, most
        As for `semi_discretised_limit`.
    draws : sequence of TipModes, optional
        Modes that may be the true ones (`TipModes.drawn_from_estimates`), at least 20.
    cuts : sequence of Milling, optional
        Cuts that may be the true one (`Milling.drawn`), as many as draws; without such, at least 20.
    threads : int, optional
        Threads over draws; by default RECEPTANCE_THREADS or all that this process may use.
    progress : callable, optional
        Called with a line of text for each speed.

    Returns
    -------
    Lobes
        Chatter frequencies are NaN, and limits above `most` infinite.

    Raises
    ------
    ValueError
        As `semi_discretised_limit`, or too few draws.

    Examples
    --------
    >>> from receptance.stability import Milling, TipModes, semi_discretised_lobes
    >>> tip = TipModes(frequency_hz=[922.0], damping_ratio=[0.011], shapes=[[0.03993**-0.5, 0.0]])
    >>> cut = Milling(teeth=2, k_t=6e8, k_n=2e8, immersion=0.05)
    >>> lobes = semi_discretised_lobes(cut, tip, speeds_rpm=[25e3], most=5e-3, cuts=cut.drawn(20, k_t=0.1))
    >>> f"{1e3 * lobes.depth[0]:.2f} mm, stable with 90 %: {1e3 * lobes.stable_depth(0.9)[0]:.2f} mm"
    '2.91 mm, stable with 90 %: 2.60 mm'
    """
    owner = "semi_discretised_lobes"
    if not isinstance(cut, Milling):
        raise TypeError(f"{owner}: cut is {type(cut).__name__}, expected Milling: turning is not interrupted")
    speeds = np.atleast_1d(_checks.unmasked(owner, "speeds_rpm", speeds_rpm, np.float64))
    several = None if draws is None and cuts is None else ensemble(owner, cut, tip, draws, cuts)
    depths, limits = [], []
    with ThreadPoolExecutor(_checks.worker_count(threads)) as pool:
        for number, speed in enumerate(speeds):
            if progress is not None:
                progress(f"semi-discretisation at {speed:g} rpm, {number + 1} of {speeds.size}")
            depth = float(semi_discretised_limit(cut, tip, speeds_rpm=speed, most=most)[0])
            depths.append(depth)
            if several is not None:
                rows = [(own, one, float(speed), depth, most) for own, one in several]
                limits.append(list(pool.map(lambda row: limit_near(*row), rows)))
    return _lobes(cut, speeds, np.array(depths), np.array(limits).T if several is not None else None, most)


def _lobes(
    cut: Milling,
    speeds: NDArray[np.float64],
    depth: NDArray[np.float64],
    draws: NDArray[np.float64] | None,
    most: float,
) -> Lobes:
    beyond = int(np.count_nonzero(~np.isfinite(depth)))
    notes = (
        () if not beyond else (f"at {beyond} of {speeds.size} speeds all depths up to {1e3 * most:g} mm are stable",)
    )
    return with_draws(
        Lobes(speeds_rpm=speeds, depth=depth, chatter_hz=np.full(speeds.size, np.nan), cut=cut, notes=notes), draws
    )
