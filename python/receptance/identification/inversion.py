"""Inverse coupling: a joint's complex stiffness line by line, in closed form from measured and modelled receptances."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance import _checks
from receptance.identification.inverse_coupling import InverseCoupling
from receptance.identification.inversion_input import (
    check_joint,
    check_observations,
    check_terms,
    check_tolerances,
    common_lines,
    joint_of,
    not_apart,
    notes_on,
)
from receptance.identification.line_solutions import (
    TERMS,
    Equations,
    coarse_joints,
    constant_joint,
    solve_lines,
)
from receptance.identification.mapping import Parameters, Place
from receptance.identification.task import place_of
from receptance.identification.unknowns import Unknown
from receptance.joints import PointJoint

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from receptance.assembly import Assembly
    from receptance.identification.laws import Tolerance
    from receptance.identification.observations import MeasuredFRF

__all__ = ["invert_coupling"]

_STIFF = PointJoint(k_y=1e15, k_theta=1e11)
"""The joint at which an assembly is evaluated; what it lacks to a rigid one is taken off exactly."""
_SUITED = 1.5
"""Standard deviations, as rms, up to which a joint is taken to suit all lines."""
_ROUNDS = 4
"""Of medians over the lines that speak."""


def invert_coupling(
    observations: MeasuredFRF | Sequence[MeasuredFRF],
    *,
    joint: str = "joint",
    terms: Sequence[str] | None = None,
    tolerances: Tolerance | Sequence[Tolerance] = (),
    limit: float = 0.2,
    threads: int | None = None,
) -> InverseCoupling:
    """Solve the coupling equations for a joint's complex stiffness, on each line by itself.

    After Ozsahin, Erturk, Ozguven and Budak (2009), who take the whole receptance matrix at the tip, rotations from
    finite differences. Here any receptances will do, translations alone, at the tip, the holder's nose or elsewhere, of
    one assembly or of several with the same joint: each is one complex equation a line, and one complex term can be
    solved for with each. From one structure they are solved in closed form; more equations than terms, or several
    structures, by least squares.

    Parameters
    ----------
    observations : MeasuredFRF or sequence of MeasuredFRF
        What was measured, with standard deviations. Lines that not all of them have are left out; where no line is
        in all of them, all are resampled to the lines of the one with the widest steps.
    joint : str, optional
        Name of the joint. Its terms that are not solved for have the values that it has in the assembly.
    terms : sequence of str, optional
        Of "k_y", "k_theta", "k_ytheta"; by default as many as there are observations: k_theta, then k_y, then k_ytheta.
    tolerances : Tolerance or sequence of Tolerance, optional
        Errors of the modelled parts; what they do is stated beside what noise does.
    limit : float, optional
        Standard deviation, as a share of a term, up to which a line is said to speak of it.
    threads : int, optional
        As in `Assembly.receptance`.

    Returns
    -------
    InverseCoupling
        The stiffness with its variance and condition number, and a start for `identify`.

    Raises
    ------
    TypeError, ValueError
        Fewer observations than terms, or observations that cannot tell the terms apart on any line: all responses to
        one load of one structure, for instance, give two of the three terms at most. No standard
        deviations, no common lines, no such joint.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance import STEEL, Assembly, Coordinate, MeasuredFRF, Part, PointJoint, Segment
    >>> from receptance.identification import invert_coupling
    >>> bar = Segment(length=0.1, outer_diameter=0.02, material=STEEL)
    >>> pair = Assembly([Part([bar], name="tool"), PointJoint(k_y=1e8, k_theta=1e5), Part([bar], name="holder")])
    >>> lines, nose = np.linspace(100.0, 4000.0, 40), Coordinate("holder", 0.0)
    >>> measured = [
    ...     MeasuredFRF(
    ...         assembly=pair,
    ...         frequency_hz=lines,
    ...         receptance=pair.receptance(lines, response=place),
    ...         response=place,
    ...         standard_deviation=0.001,
    ...     )
    ...     for place in (Coordinate(), nose)
    ... ]
    >>> found = invert_coupling(measured)
    >>> {name: f"{value:.3g}" for name, value in found.start().items() if ".k" in name}
    {'joint.k_y': '1e+08', 'joint.k_theta': '1e+05'}
    """
    observed = check_observations(observations)
    wanted = check_terms(terms, len(observed))
    errors = check_tolerances(tolerances)
    share = _checks.positive("invert_coupling", "limit", limit)
    check_joint(observed, joint, wanted)
    observed, lines, rows, dropped = common_lines(observed)
    equations = _equations(observed, joint, wanted, lines, rows, threads)
    x, ambiguous = solve_lines(equations)
    # Beyond the joint that stands for a rigid one there is nothing to tell.
    with np.errstate(all="ignore"):
        good = (np.abs(x) < _STIFF.k_y).all(axis=1) & np.isfinite(equations.cost(np.where(np.isfinite(x), x, 1.0)))
        x = np.where(good[:, None], x, 0.0)
        rank = np.where(good, equations.rank(x), 0)
    if rank.max(initial=0) < len(wanted):
        raise ValueError(not_apart(wanted, int(rank.max(initial=0)), observed))
    with np.errstate(all="ignore"):
        good &= rank == len(wanted)
        reaction, scale = equations.reaction(x), equations.scale(x)
        good &= np.isfinite(reaction / scale[..., None]).all(axis=(1, 2))
        condition = np.linalg.norm(np.where(good[:, None, None], reaction / scale[..., None], 0.0), ord=2, axis=(1, 2))
        noise = equations.noise(x)
    typical, usable, rms = _typical(equations, x, good, share)
    result = _Result(equations, joint, observed, lines, x, good)
    model = np.zeros(x.shape)
    if errors:
        model = result.model_deviation(errors, reaction, typical, threads)
        usable &= np.hypot(noise, model) <= share * scale
    found = InverseCoupling(
        frequency_hz=lines,
        joint=joint,
        terms=wanted,
        stiffness=np.where(good[:, None, None], equations.stiffness(x), np.nan),
        standard_deviation=result.spread(np.where(good[:, None], noise, np.inf)),
        model_deviation=result.spread(np.where(good[:, None], model, np.inf)),
        condition=np.where(good, condition, np.inf),
        usable=result.spread(usable),
        limit=share,
        ambiguous=ambiguous & good,
        typical=typical,
        rms=rms,
        labels=tuple(o.label or f"observation {i}" for i, o in enumerate(observed)),
        notes=tuple(notes_on(wanted, usable, ambiguous & good, dropped, share, observed, joint, rms, lines[~good])),
    )
    for name in ("frequency_hz", "stiffness", "standard_deviation", "model_deviation", "condition", "usable"):
        getattr(found, name).setflags(write=False)
    return found


@dataclass(frozen=True)
class _Result:
    """What a solution is turned into: matrices, and what tolerances do to it."""

    equations: Equations
    joint: str
    observed: tuple[MeasuredFRF, ...]
    lines: NDArray[Any]
    x: NDArray[np.complex128]
    good: NDArray[np.bool_]

    def spread(self, values: NDArray[Any]) -> NDArray[Any]:
        """Return values of the terms as symmetric matrices, zero for what is known."""
        result = np.zeros((len(values), 2, 2), dtype=values.dtype)
        for column, term in enumerate(self.equations.terms):
            i, j = TERMS[term]
            result[:, i, j] = result[:, j, i] = values[:, column]
        return result

    def model_deviation(
        self,
        errors: tuple[Tolerance, ...],
        reaction: NDArray[np.complex128],
        typical: dict[str, tuple[float, float]],
        threads: int | None,
    ) -> NDArray[np.float64]:
        """Return what the tolerances do to each term, `(n, m)`.

        The modelled receptance, with the joint that was found, moves by dH for an error; the joint then has to make up
        for it, as for a measured one that moved by -dH. The joint is taken as the same on all lines here.
        """
        places = [place_of(o, i) for i, o in enumerate(self.observed)]
        values = self._values(typical)
        # The parameter map of a fit needs an unknown; nothing of it is used but the errors.
        some = Unknown(address=f"{self.joint}.{self.equations.terms[0]}", lower=1.0, upper=2.0)
        parameters = Parameters([some], errors, places)
        pairs = zip(self.observed, places, strict=True)
        moved = np.stack([self._moved(parameters, place, one, values, threads) for one, place in pairs], axis=1)
        with np.errstate(all="ignore"):
            change = np.einsum("nmp,npt->nmt", reaction, moved)
        result: NDArray[np.float64] = np.sqrt(np.sum(np.abs(change) ** 2, axis=2))
        return result

    def _moved(
        self,
        parameters: Parameters,
        place: Place,
        one: MeasuredFRF,
        values: dict[str, float],
        threads: int | None,
    ) -> NDArray[np.complex128]:
        """Return the change of the logarithm of a modelled receptance for one standard deviation of each, `(n, t)`."""
        placed = parameters.at(place)
        vector = np.array([unknown.start for unknown in parameters.unknowns], dtype=np.float64)
        keep = [i for i, address in enumerate(placed.addresses) if not address.startswith(f"{self.joint}.")]
        slopes = placed.jacobian(vector)[keep][:, parameters.count :]
        h, dh = place.assembly.replace(values).derivatives(
            self.lines,
            [placed.addresses[i] for i in keep],
            response=one.response,
            excitation=one.excitation,
            threads=threads,
        )
        result: NDArray[np.complex128] = dh @ slopes / h[:, None]
        return result

    def _values(self, typical: dict[str, tuple[float, float]]) -> dict[str, float]:
        """Return a joint that is one, for the derivatives of the modelled parts."""
        assembly = self.observed[0].assembly
        found = {name: typical[name][0] if name in typical else assembly.get(f"{self.joint}.{name}") for name in TERMS}
        for name in ("k_y", "k_theta"):
            found[name] = abs(found[name])
        most = 0.99 * float(np.sqrt(found["k_y"] * found["k_theta"]))
        found["k_ytheta"] = float(np.clip(found["k_ytheta"], -most, most))
        return {f"{self.joint}.{name}": value for name, value in found.items()}


def _typical(
    equations: Equations, x: NDArray[np.complex128], good: NDArray[np.bool_], share: float
) -> tuple[dict[str, tuple[float, float]], NDArray[np.bool_], float]:
    """Return stiffness and dashpot of each term that suit all lines, the lines that speak, `(n, m)`, and the rms left.

    Medians over the lines that speak, by their own variances, lead to the least squares over all lines. The variances
    at the joint that is found there tell the lines that speak.
    """
    w = equations.angular_frequency
    starts = []
    with np.errstate(all="ignore"):
        at = x
        for _ in range(_ROUNDS):
            noise = equations.noise(at)
            heard = good[:, None] & (noise <= share * equations.scale(at))
            if not heard.any(axis=0).all():
                break
            columns = np.ascontiguousarray(heard.T)
            start = np.array([_of_lines(x[rows, i], noise[rows, i], w[rows]) for i, rows in enumerate(columns)])
            starts.append(start)
            # A line that comes out too soft by chance seems well known: from here on all are judged at the medians.
            at = start[:, 0] + 1j * w[:, None] * start[:, 1]
    if not starts:
        return {}, np.zeros(x.shape, dtype=np.bool_), np.nan
    ends = [constant_joint(equations, start, good) for start in (starts[0], starts[-1])]
    count = 2 * int(good.sum()) * equations.rigid.shape[1]
    if min(end[0] for end in ends) > _SUITED**2 * count:
        # Medians of lines that say little each may lie anywhere.
        with np.errstate(all="ignore"):
            ends += [constant_joint(equations, start, good) for start in coarse_joints(equations, good)]
    misfit, stiffness, dashpots = min(ends, key=lambda end: end[0])
    typical = stiffness + 1j * w[:, None] * dashpots
    with np.errstate(all="ignore"):
        usable = good[:, None] & (equations.noise(typical) <= share * equations.scale(typical))
    pairs = zip(stiffness.tolist(), dashpots.tolist(), strict=True)
    return dict(zip(equations.terms, pairs, strict=True)), usable, float(np.sqrt(misfit / count))


def _equations(
    observed: tuple[MeasuredFRF, ...],
    joint: str,
    terms: tuple[str, ...],
    lines: NDArray[Any],
    rows: list[NDArray[np.intp]],
    threads: int | None,
) -> Equations:
    parts = [_rigid(o.assembly, joint, lines, o, threads) for o in observed]
    known = joint_of(observed[0].assembly, joint)
    w = 2.0 * np.pi * lines.astype(np.complex128)
    springs = np.array([[known.k_y, known.k_ytheta], [known.k_ytheta, known.k_theta]])
    dashpots = np.array([[known.c_y, known.c_ytheta], [known.c_ytheta, known.c_theta]])
    deviations = [np.asarray(o.standard_deviation)[row] for o, row in zip(observed, rows, strict=True)]
    return Equations(
        rigid=np.stack([part[0] for part in parts], axis=1),
        measured=np.stack([o.receptance[row] for o, row in zip(observed, rows, strict=True)], axis=1),
        response=np.stack([part[1] for part in parts], axis=1),
        excitation=np.stack([part[2] for part in parts], axis=1),
        surroundings=np.stack([part[3] for part in parts], axis=1),
        deviation=np.stack(deviations, axis=1),
        known=(1.0 + 1j * known.loss_factor) * springs + 1j * w[:, None, None] * dashpots,
        angular_frequency=w,
        terms=terms,
    )


def _rigid(
    assembly: Assembly, joint: str, lines: NDArray[Any], one: MeasuredFRF, threads: int | None
) -> tuple[NDArray[np.complex128], ...]:
    """Return H, F_r, F_e and Y of (T8) with the joint rigid."""
    planes = assembly.reduced_to_joint(
        joint,
        lines,
        response=one.response,
        excitation=one.excitation,
        at=_STIFF,
        planes=True,
        threads=threads,
    ).planes()
    assert planes is not None, "planes were asked for"
    h, *forces, yy, yt, tt = planes[0::2] + 1j * planes[1::2]
    r, e = np.stack(forces[:2], axis=1), np.stack(forces[2:], axis=1)
    y = np.stack([np.stack([yy, yt], axis=1), np.stack([yt, tt], axis=1)], axis=1)
    yielding = np.diag([1.0 / _STIFF.k_y, 1.0 / _STIFF.k_theta])
    taken = np.linalg.inv(np.eye(2) - y @ yielding)
    h = h - np.einsum("ni,ij,njk,nk->n", r, yielding, taken, e)
    return h, np.einsum("nij,nj->ni", taken, r), np.einsum("nij,nj->ni", taken, e), taken @ y


def _of_lines(
    value: NDArray[np.complex128], deviation: NDArray[np.float64], w: NDArray[np.complex128]
) -> tuple[float, float]:
    """Return k and c of k + i w c that suit the values on some lines."""
    deviation = np.maximum(deviation, 1e-300)
    # With w complex K has Re w c as its imaginary part, and -c Im w is in its real part.
    c = value.imag / w.real
    k = value.real + w.imag * c
    return _median(k, deviation**-2.0), _median(c, (deviation / w.real) ** -2.0)


def _median(values: NDArray[np.float64], weights: NDArray[np.float64]) -> float:
    """Return the weighted median."""
    order = np.argsort(values)
    grown = np.cumsum((weights / weights.max())[order])
    return float(values[order][np.searchsorted(grown, 0.5 * grown[-1])])
