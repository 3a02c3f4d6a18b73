"""Milling and turning cuts: cutting coefficients, engagement and directional coefficients."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from receptance import _checks, units
from receptance.model.fields import Choice, Count, Element, Field, Number

Feed = Literal["down", "up"]
_FEED_WORDS = {"climb": "down", "conventional": "up"}
"""Words of the workshop, in campaign files."""
CLOSED_DEG = 1e-3
"""Largest difference in degrees of the sum of the pitch angles from a turn."""
_STRAIGHT = 1e-7
"""Lag in rad below which an edge is straight: its exact mean would lose its digits."""


@dataclass(frozen=True, kw_only=True)
class Milling(Element):
    """A milling cut.

    x is the feed direction and y the direction normal to it; the angle of a tooth is measured from y to x, in the
    direction of rotation. Seen from the spindle, y is to the left of the feed for a cutter that turns clockwise. The
    tangential force on a tooth is k_t times depth times chip thickness, the normal (radial) force k_n times depth times
    chip thickness.

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
    >>> variable = Milling(
    ...     teeth=4, k_t=6e8, k_n=2e8, diameter=0.012, pitch_deg=(70.0, 110.0, 70.0, 110.0), helix_deg=30.0
    ... )
    >>> cut.is_even, variable.is_even
    (True, False)
    """

    teeth: Annotated[int, Count("number of teeth, such as 4")]
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
        Feed, Choice("down-milling (climb) or up-milling (conventional); a slot is both", get_args(Feed), _FEED_WORDS)
    ] = "down"
    diameter: Annotated[
        float | None, Number(units.LENGTH, "diameter of the cutter; needed with a helix", parameter=False)
    ] = None
    pitch_deg: Annotated[
        tuple[float, ...],
        Field("angle from each tooth to the one that follows it, in degrees, for all teeth; by default equal"),
    ] = ()
    helix_deg: Annotated[
        float | tuple[float, ...],
        Field("helix angle in degrees, one for all teeth or one for each; the edge lags behind its end at the tip"),
    ] = 0.0

    def __post_init__(self) -> None:
        super().__post_init__()
        pitch = self._angles("pitch_deg", self.pitch_deg, units.PITCH) if np.size(self.pitch_deg) else ()
        if pitch and abs(sum(pitch) - 360.0) > CLOSED_DEG:
            raise ValueError(f"Milling: the sum of pitch_deg is {sum(pitch):.6g} degrees, expected 360")
        if len(set(pitch)) == 1:
            pitch = ()
        helix = self._angles("helix_deg", self.helix_deg, units.HELIX)
        common = len(set(helix)) == 1
        if any(helix) and self.diameter is None:
            raise ValueError(
                "Milling: diameter is None, expected the diameter of the cutter, from which the lag of a helix follows"
            )
        _checks.set_fields(self, {"pitch_deg": pitch, "helix_deg": helix[0] if common else helix})

    def _angles(self, name: str, values: float | tuple[float, ...], quantity: units.Quantity) -> tuple[float, ...]:
        """Return the angles of a field, one for each tooth; a single number is that of all teeth."""
        numbers = np.atleast_1d(_checks.unmasked("Milling", name, values, np.float64))
        if np.ndim(values) == 0:
            numbers = np.repeat(numbers, self.teeth)
        if numbers.shape != (self.teeth,):
            raise ValueError(
                f"Milling: {name} has {numbers.size} angles, expected {self.teeth}, one for each of the teeth"
            )
        return tuple(_checks.quantity("Milling", f"{name}[{i}]", float(n), quantity) for i, n in enumerate(numbers))

    @property
    def is_even(self) -> bool:
        """Whether all teeth have the same pitch and helix, so that there is one delay between teeth."""
        return not isinstance(self.helix_deg, tuple) and not self.pitch_deg

    @property
    def even(self) -> Milling:
        """The cut with equal, straight teeth."""
        return replace(self, pitch_deg=(), helix_deg=0.0)

    def require_even(self, owner: str) -> None:
        """Raise ValueError for teeth with different delays, for which the mean force has no limit in closed form."""
        if not self.is_even:
            what = "helix_deg" if isinstance(self.helix_deg, tuple) else "pitch_deg"
            raise ValueError(
                f"{owner}: {what} differs between teeth, {getattr(self, what)}, so that delays differ; expected equal "
                "teeth, or semi_discretised_lobes"
            )

    @property
    def pitch(self) -> NDArray[np.float64]:
        """Angle from each tooth to the one that follows it, `(teeth,)` in rad."""
        return np.deg2rad(self.pitch_deg) if self.pitch_deg else np.full(self.teeth, 2.0 * np.pi / self.teeth)

    @property
    def twist(self) -> NDArray[np.float64]:
        """Lag of each edge over the distance from the tip, `(teeth,)` in rad/m; zero for straight edges."""
        helix = np.broadcast_to(np.asarray(self.helix_deg, np.float64), self.teeth)
        return np.asarray(2.0 * np.tan(np.deg2rad(helix)) / (self.diameter or 1.0))

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
        return self._coefficients(sine**2, sine * cosine, cosine**2)

    def directional_mean(
        self, start: NDArray[np.float64], end: NDArray[np.float64], lag: NDArray[np.float64] | float = 0.0
    ) -> NDArray[np.float64]:
        """Return the mean of `directional` of a tooth between two angles, in closed form.

        Parameters
        ----------
        start, end : ndarray
            Angles of the lower end of the edge in rad, `(...)`, ascending.
        lag : ndarray or float, optional
            Angle in rad by which the upper end of the edge lags behind the lower one, in a shape that broadcasts with
            the others; the mean is over the edge too.

        Returns
        -------
        ndarray
            `(..., 2, 2)` in N/m^2.
        """
        turns = 2.0 * np.pi * np.floor(start / (2.0 * np.pi))
        low, high, lags = np.broadcast_arrays(start - turns, end - turns, np.asarray(lag, np.float64))
        mean = self._integral(high) - self._integral(low)
        twisted = np.abs(lags) > _STRAIGHT
        if twisted.any():
            low, high, lags = low[twisted], high[twisted], lags[twisted]
            edge = self._double_integral(high) - self._double_integral(low)
            edge -= self._double_integral(high - lags) - self._double_integral(low - lags)
            mean[twisted] = edge / lags[:, None, None]
        return np.asarray(mean / (end - start)[..., None, None])

    def _integral(self, angle: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the integral of `directional` from zero to an angle, over any number of revolutions."""
        first, last = self.engagement
        turns = np.floor(angle / (2.0 * np.pi))
        within = np.clip(angle - 2.0 * np.pi * turns, first, last)
        start = self._antiderivative(np.array(first))
        revolution = self._antiderivative(np.array(last)) - start
        return np.asarray(turns[..., None, None] * revolution + self._antiderivative(within) - start)

    def _double_integral(self, angle: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the integral of `_integral` from zero to an angle."""
        first, last = self.engagement
        turns = np.floor(angle / (2.0 * np.pi))
        angle_in_turn = (angle - 2.0 * np.pi * turns)[..., None, None]
        within = np.clip(angle_in_turn, first, last)[..., 0, 0]
        start = self._antiderivative(np.array(first))
        revolution = self._antiderivative(np.array(last)) - start

        def in_turn(ends: NDArray[np.float64], rest: NDArray[np.float64] | float) -> NDArray[np.float64]:
            engaged = self._second_antiderivative(ends) - self._second_antiderivative(np.array(first))
            return np.asarray(engaged - start * (ends - first)[..., None, None] + revolution * rest)

        whole = in_turn(np.array(last), 2.0 * np.pi - last)
        n = turns[..., None, None]
        before = n * whole + revolution * (np.pi * n * (n - 1.0) + n * angle_in_turn)
        return np.asarray(before + in_turn(within, np.maximum(angle_in_turn - last, 0.0)))

    def _antiderivative(self, angle: NDArray[np.float64]) -> NDArray[np.float64]:
        # Integrals of sin^2, sin cos and cos^2.
        ss = 0.5 * angle - 0.25 * np.sin(2.0 * angle)
        sc = -0.25 * np.cos(2.0 * angle)
        cc = 0.5 * angle + 0.25 * np.sin(2.0 * angle)
        return self._coefficients(ss, sc, cc)

    def _second_antiderivative(self, angle: NDArray[np.float64]) -> NDArray[np.float64]:
        # Integrals of those of `_antiderivative`.
        ss = 0.25 * angle**2 + 0.125 * np.cos(2.0 * angle)
        sc = -0.125 * np.sin(2.0 * angle)
        cc = 0.25 * angle**2 - 0.125 * np.cos(2.0 * angle)
        return self._coefficients(ss, sc, cc)

    def _coefficients(
        self, ss: NDArray[np.float64], sc: NDArray[np.float64], cc: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the directional coefficients for values of sin^2, sin cos and cos^2."""
        t, n = self.k_t, self.k_n
        entries = [-t * sc - n * ss, -t * cc - n * sc, t * ss - n * sc, t * sc - n * cc]
        return np.stack(entries, axis=-1).reshape(*np.shape(ss), 2, 2)


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
