"""Milling and turning cuts: cutting coefficients, engagement and directional coefficients."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from receptance import _checks, units
from receptance.model.fields import Choice, Count, Element, Number

Feed = Literal["down", "up"]


@dataclass(frozen=True, kw_only=True)
class Milling(Element):
    """A milling cut with straight, evenly spaced teeth.

    x is the feed direction and y the direction normal to it; the angle of a tooth is measured from y to x, in the
    direction of rotation. The tangential force on a tooth is k_t times depth times chip thickness, the normal (radial)
    force k_n times depth times chip thickness.

    Parameters
    ----------
    {fields}

    Raises
    ------
    ValueError
        A value out of its range.

    References
    ----------
    Altintas, Budak 1995, Analytical prediction of stability lobes in milling, CIRP Annals 44, eqs. 1 to 4.

    Examples
    --------
    >>> cut = Milling(teeth=2, k_t=6e8, k_n=2e8, immersion=0.5)
    >>> [round(float(angle), 4) for angle in cut.engagement]
    [1.5708, 3.1416]
    """

    teeth: Annotated[int, Count("number of teeth")]
    k_t: Annotated[
        float, Number(units.CUTTING_COEFFICIENT, "tangential cutting coefficient; force over depth and chip thickness")
    ]
    k_n: Annotated[float, Number(units.CUTTING_COEFFICIENT_OR_ZERO, "normal (radial) cutting coefficient")]
    immersion: Annotated[
        float,
        Number(
            units.IMMERSION, "radial immersion; width of cut over diameter of the tool, 1 for a slot", parameter=False
        ),
    ] = 1.0
    feed: Annotated[
        Feed, Choice("down-milling (climb) or up-milling (conventional); a slot is both", get_args(Feed))
    ] = "down"

    @property
    def engagement(self) -> tuple[float, float]:
        """Angles at which a tooth enters and leaves the cut, in rad."""
        if self.feed == "up":
            return 0.0, float(np.arccos(1.0 - 2.0 * self.immersion))
        return float(np.arccos(2.0 * self.immersion - 1.0)) if self.immersion < 1.0 else 0.0, np.pi

    def drawn(self, draws: int, *, k_t: float = 0.0, k_n: float = 0.0, seed: int = 0) -> tuple[Milling, ...]:
        """Return random cuts within the uncertainty of the coefficients.

        Parameters
        ----------
        draws : int
            Number of cuts.
        k_t, k_n : float, optional
            Independent standard deviations of the logarithms of the coefficients, such as 0.1 for 10 %.
        seed : int, optional
            Seed of the random numbers.

        Raises
        ------
        ValueError
            A negative standard deviation, or a number of draws below one.

        Examples
        --------
        >>> cuts = Milling(teeth=2, k_t=6e8, k_n=2e8).drawn(1000, k_t=0.1, seed=1)
        >>> f"{np.std(np.log([cut.k_t for cut in cuts])):.2f}, {cuts[0].k_n:.1e}"
        '0.10, 2.0e+08'
        """
        t, n = _factors("Milling", draws, {"k_t": k_t, "k_n": k_n}, seed)
        return tuple(replace(self, k_t=self.k_t * a, k_n=self.k_n * b) for a, b in zip(t, n, strict=True))

    def directional(self, angle: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the directional coefficients of one tooth: force over depth and displacement between two passes.

        Parameters
        ----------
        angle : ndarray
            Angles of the tooth in rad, `(n,)`.

        Returns
        -------
        ndarray
            `(n, 2, 2)` in N/m^2, force in x and y by displacement in x and y; zero outside the cut.
        """
        first, last = self.engagement
        within = np.mod(angle, 2.0 * np.pi)
        engaged = (within >= first) & (within <= last)
        sine, cosine = np.sin(within) * engaged, np.cos(within) * engaged
        force = np.stack([-self.k_t * cosine - self.k_n * sine, self.k_t * sine - self.k_n * cosine], axis=-1)
        thickness = np.stack([sine, cosine], axis=-1)
        return np.asarray(force[..., :, None] * thickness[..., None, :])

    def directional_mean(self, start: NDArray[np.float64], end: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the mean of the sum of `directional` over all teeth between two angles of the first, in closed form.

        Parameters
        ----------
        start, end : ndarray
            Angles in rad, `(n,)`, ascending.

        Returns
        -------
        ndarray
            `(n, 2, 2)` in N/m^2.
        """
        offsets = 2.0 * np.pi * np.arange(self.teeth) / self.teeth
        low, high = start[:, None] + offsets, end[:, None] + offsets
        total = self._integral(high) - self._integral(low)
        return np.asarray(total.sum(axis=1) / (end - start)[:, None, None])

    def _integral(self, angle: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the integral of `directional` from zero to an angle, over any number of revolutions."""
        first, last = self.engagement
        turns = np.floor(angle / (2.0 * np.pi))
        within = np.clip(angle - 2.0 * np.pi * turns, first, last)
        start = self._antiderivative(np.array(first))
        revolution = self._antiderivative(np.array(last)) - start
        return np.asarray(turns[..., None, None] * revolution + self._antiderivative(within) - start)

    def _antiderivative(self, angle: NDArray[np.float64]) -> NDArray[np.float64]:
        # Integrals of sin^2, sin cos and cos^2.
        ss = 0.5 * angle - 0.25 * np.sin(2.0 * angle)
        sc = -0.25 * np.cos(2.0 * angle)
        cc = 0.5 * angle + 0.25 * np.sin(2.0 * angle)
        t, n = self.k_t, self.k_n
        entries = [-t * sc - n * ss, -t * cc - n * sc, t * ss - n * sc, t * sc - n * cc]
        return np.stack(entries, axis=-1).reshape(*np.shape(angle), 2, 2)


@dataclass(frozen=True, kw_only=True)
class Turning(Element):
    """A turning cut: one tooth in continuous engagement.

    Parameters
    ----------
    {fields}

    Raises
    ------
    ValueError
        A value out of its range.

    References
    ----------
    Tlusty, Polacek 1963; Altintas 2012, Manufacturing Automation, section 4.3.

    Examples
    --------
    >>> Turning(k=1e9).share
    1.0
    """

    k: Annotated[float, Number(units.CUTTING_COEFFICIENT, "cutting coefficient; force over depth and chip thickness")]
    angle_deg: Annotated[
        float,
        Number(
            units.DIRECTION,
            "angle between the force and the direction of the chip's thickness, in the plane of the receptance",
            parameter=False,
        ),
    ] = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        if not -90.0 < self.angle_deg < 90.0:
            raise ValueError(f"Turning: angle_deg is {self.angle_deg:g}, expected between -90 and 90 degrees")

    def drawn(self, draws: int, *, k: float = 0.0, seed: int = 0) -> tuple[Turning, ...]:
        """Return random cuts within the uncertainty of the coefficient; see `Milling.drawn`."""
        (factors,) = _factors("Turning", draws, {"k": k}, seed)
        return tuple(replace(self, k=self.k * factor) for factor in factors)

    @property
    def share(self) -> float:
        """Cosine of `angle_deg`: the share of the force in the direction of the chip thickness."""
        return float(np.cos(np.deg2rad(self.angle_deg)))


def _factors(owner: str, draws: int, deviations: dict[str, float], seed: int) -> list[list[float]]:
    """Return random factors of the coefficients for each standard deviation."""
    count = _checks.whole_number(owner, "draws", draws)
    scales = [
        _checks.not_negative(owner, f"the standard deviation of {name}", value) for name, value in deviations.items()
    ]
    random = np.random.default_rng(seed).standard_normal((len(scales), count))
    return [np.exp(scale * row).tolist() for scale, row in zip(scales, random, strict=True)]
