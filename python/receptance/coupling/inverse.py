"""Inverse coupling: the complex stiffness of a joint from measured and modelled receptances, line by line."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from receptance import _checks, units
from receptance._text import join_names
from receptance.coupling.common_lines import check_observations, common_lines
from receptance.coupling.line_equations import (
    TERMS,
    Equations,
    constant_grid_starts,
    constant_joint,
    masked_lines,
    solve_lines,
)
from receptance.fit.observation import Observation
from receptance.fit.parameters import Parameters
from receptance.fit.unknowns import Tolerance, Unknown
from receptance.model.assembly import Assembly
from receptance.model.joints import PointJoint
from receptance.report import Column, Provenance, Result, Results, Table
from receptance.report.table import Cell

_RIGID = PointJoint(k_y=1e15, k_theta=1e11)
"""Stiff joint at which an assembly is evaluated; its remaining compliance is subtracted exactly."""
_MISFIT_RMS = 3.0
"""Above this rms, in standard deviations, the notes say that no constant joint fits."""
_MEDIAN_ITERATIONS = 4
"""Medians over the informative lines; each uses the standard deviations at the one before."""
_MIN_LOSS_FACTOR = 1e-3
"""Least loss factor of a dashpot's start: the fitted one may be zero or negative."""
_DEFAULT_TERMS = (("k_theta",), ("k_y", "k_theta"), ("k_y", "k_theta", "k_ytheta"))


@dataclass(frozen=True, kw_only=True)
class InverseCoupling(Result):
    """The complex stiffness of a joint on each line, with its uncertainty."""

    frequency_hz: NDArray[np.inexact]
    """`(n,)` lines, complex where an exponential window was used."""
    joint: str
    """Name of the joint."""
    terms: tuple[str, ...]
    """Terms that were solved for, of "k_y", "k_theta" and "k_ytheta"; the others have the values of the assembly."""
    stiffness: NDArray[np.complex128]
    """`(n, 2, 2)` complex, over (y, theta); k + i w c if the joint is a spring with a dashpot."""
    standard_deviation: NDArray[np.float64]
    """`(n, 2, 2)` of the real and of the imaginary part, each, from the variance of the receptances, to first order."""
    model_deviation: NDArray[np.float64]
    """`(n, 2, 2)` standard deviation of the magnitude from the tolerances of the modelled parts. It is one error on all
    lines, so averaging does not reduce it. Zero without tolerances."""
    condition: NDArray[np.float64]
    """`(n,)` largest ratio of a relative error of the stiffness to a relative error of the receptances. Errors of the
    coupling term are relative to sqrt(k_y k_theta)."""
    usable: NDArray[np.bool_]
    """`(n, 2, 2)` whether both deviations together are below `limit` times the term, times sqrt(k_y k_theta) for the
    coupling. They are evaluated at the constant joint that fits all lines: at the stiffness of the line itself, lines
    on which noise makes the joint too soft would appear precise."""
    limit: float
    """Largest relative standard deviation of a usable line."""
    ambiguous: NDArray[np.bool_]
    """`(n,)` whether several stiffnesses fit; the one closest to those of the other lines was selected."""
    labels: tuple[str, ...]
    """Labels of the measurements."""
    typical: dict[str, tuple[float, float]]
    """Stiffness and dashpot of each term of the constant joint that fits all lines."""
    rms: float
    """Root mean square of the residuals of the constant joint, in standard deviations: about 1 if the joint is k + i w
    c and the parts are as modelled."""
    notes: tuple[str, ...] = field(default=())
    name: str = ""
    """Name in tables: the joint, and the assembly where the joint changes between assemblies."""
    provenance: Provenance = field(default_factory=Provenance, repr=False)

    heading = "Inverse coupling"
    plotted_by = "receptance.coupling.figure:draw_inverse_coupling"

    def term(self, name: str) -> tuple[NDArray[np.complex128], NDArray[np.float64], NDArray[np.bool_]]:
        """Return values, standard deviations and mask of one term, `(n,)` each.

        Raises
        ------
        ValueError
            A term that was not solved for.
        """
        if name not in self.terms:
            raise ValueError(f"{name!r} was not solved for, only {join_names(self.terms)}")
        at = (slice(None), *TERMS[name])
        return self.stiffness[at], self.standard_deviation[at], self.usable[at]

    def start(self) -> dict[str, float]:
        """Return stiffnesses and dashpots of the constant joint, in SI units by address, as starts for a fit.

        Least squares of the logarithms over all lines, from medians of Re K and of Im K / w and from a coarse grid.
        Empty if no line is informative; check `rms`.
        """
        values = {}
        for name, (k, c) in self.typical.items():
            values[f"{self.joint}.{name}"] = k
            values[f"{self.joint}.c{name[1:]}"] = c
        return values

    def unknowns(self, *, decades: float = 2.0, damping: bool = True) -> list[Unknown]:
        """Return unknowns for `identify` that start at the constant joint.

        Parameters
        ----------
        decades : float, optional
            Distance of the bounds of a stiffness from the start; the bounds of a dashpot are one decade wider.
        damping : bool, optional
            Whether dashpots are unknowns as well.

        Raises
        ------
        ValueError
            No line is informative.
        """
        factor = 10.0 ** _checks.positive("InverseCoupling.unknowns", "decades", decades)
        start = self.start()
        if not start:
            raise ValueError(
                f"there is no start: no line gives {join_names(self.terms)} with a relative standard deviation below "
                f"{self.limit:g}; reduce the noise, measure at other coordinates, or raise limit"
            )
        w = 2.0 * np.pi * float(np.median(np.asarray(self.frequency_hz).real))
        unknowns = []
        for name in self.terms:
            address = f"{self.joint}.{name}"
            if address not in start:
                continue
            if name == "k_ytheta":
                most = factor * max(abs(start[address]), self._coupling_size())
                unknowns.append(Unknown(address=address, lower=-most, upper=most, start=start[address]))
                continue
            k = start[address]
            if k <= 0.0:
                continue
            unknowns.append(Unknown(address=address, lower=k / factor, upper=k * factor, start=k))
            if damping:
                address = f"{self.joint}.c{name[1:]}"
                c = max(start[address], _MIN_LOSS_FACTOR * k / w)
                unknowns.append(Unknown(address=address, lower=c / (10.0 * factor), upper=10.0 * c * factor, start=c))
        return unknowns

    def _coupling_size(self) -> float:
        k = self.stiffness
        return float(np.median(np.sqrt(np.abs(k[:, 0, 0] * k[:, 1, 1]))))

    def tables(self) -> list[Table]:
        """Return the usable lines of each term, and the stiffness and dashpot of the constant joint."""
        columns = (
            "term",
            "usable lines",
            Column("from, to", "Hz", "g"),
            Column("condition\nnumber", form=".2g"),
            Column("k", form=".4g"),
            Column("c", form=".3g"),
            Column("rms of\nresiduals", form=".3g"),
        )
        lines = np.asarray(self.frequency_hz).real
        rows: list[list[Cell]] = []
        for term in self.terms:
            usable = self.term(term)[2]
            chosen = lines[usable]
            k, c = self.typical.get(term, (np.nan, np.nan))
            rows.append(
                [
                    (self.name or self.joint).replace(self.joint, f"{self.joint}.{term}", 1),
                    f"{chosen.size} of {lines.size}",
                    (float(chosen[0]), float(chosen[-1])) if chosen.size else "none",
                    float(np.median(self.condition[usable])) if chosen.size else None,
                    k if np.isfinite(k) else "unknown",
                    c if np.isfinite(c) else "unknown",
                    self.rms if np.isfinite(self.rms) else None,
                ]
            )
        title = f"Lines with a standard deviation below {100.0 * self.limit:g} %; k and c fitted to all lines, SI units"
        return [Table(title, columns, rows)]

    def data(self) -> dict[str, Any]:
        """Return each term on each line with its standard deviations, and the start for a fit."""
        terms = {}
        for name in self.terms:
            value, deviation, usable = self.term(name)
            terms[name] = {
                "real": value.real,
                "imaginary": value.imag,
                "standard_deviation": deviation,
                "model_deviation": self.model_deviation[:, *TERMS[name]],
                "usable": usable,
            }
        return {
            "joint": self.joint,
            "measured": self.labels,
            "frequency_hz": np.asarray(self.frequency_hz).real,
            "terms": terms,
            "condition": self.condition,
            "ambiguous": self.ambiguous,
            "limit": self.limit,
            "start": self.start(),
            "rms": self.rms,
        }

    def __repr__(self) -> str:
        usable = ", ".join(f"{name} on {int(self.term(name)[2].sum())}" for name in self.terms)
        return f"InverseCoupling({self.joint!r}, {len(self.frequency_hz)} lines; usable: {usable})"


class InverseCouplings(Results[InverseCoupling]):
    """Inverse couplings by name of the joint."""

    heading = "Inverse coupling"
    key = "joints"
    plotted_by = "receptance.coupling.figure:draw_inverse_coupling"


def invert_coupling(
    observations: Observation | Sequence[Observation],
    *,
    joint: str = "joint",
    terms: Sequence[str] | None = None,
    tolerances: Tolerance | Sequence[Tolerance] = (),
    limit: float = 0.2,
    threads: int | None = None,
) -> InverseCoupling:
    """Solve the coupling equations for a joint's complex stiffness, line by line.

    The method follows Ozsahin, Erturk, Ozguven and Budak (2009), who use the whole receptance matrix at the tip with
    rotations from finite differences. Here any receptances can be used, translations included, at the tip, the holder's
    nose or elsewhere, on one assembly or on several with the same joint. Each receptance is one complex equation per
    line, and each complex term needs one equation. As many equations as terms are solved in closed form, more by least
    squares.

    Parameters
    ----------
    observations : Observation or sequence of Observation
        Measurements with standard deviations. Lines that some of them lack are left out. If few lines are common, all
        are resampled to the lines of the measurement with the widest spacing.
    joint : str, optional
        Name of the joint. Terms that are not solved for have the values of the assembly.
    terms : sequence of str, optional
        Of "k_y", "k_theta", "k_ytheta"; by default as many as there are observations: k_theta, then k_y, then k_ytheta.
    tolerances : Tolerance or sequence of Tolerance, optional
        Errors of the modelled parts. Their effect is stated beside that of the noise.
    limit : float, optional
        Largest relative standard deviation of a term on a usable line.
    threads : int, optional
        As in `Assembly.receptance`.

    Returns
    -------
    InverseCoupling
        The stiffness with its variance and condition number, and a start for `identify`.

    Raises
    ------
    TypeError, ValueError
        Fewer observations than terms, or observations that cannot separate the terms on any line: all responses to one
        load of one structure, for instance, determine at most two of the three terms. No standard deviations, no
        common lines, no such joint.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance import STEEL, Assembly, Coordinate, Observation, Part, PointJoint, Segment
    >>> from receptance.coupling import invert_coupling
    >>> bar = Segment(length=0.1, outer_diameter=0.02, material=STEEL)
    >>> pair = Assembly([Part([bar], name="tool"), PointJoint(k_y=1e8, k_theta=1e5), Part([bar], name="holder")])
    >>> lines, nose = np.linspace(100.0, 4000.0, 40), Coordinate("holder", 0.0)
    >>> measured = [
    ...     Observation(
    ...         assembly=pair,
    ...         frequency_hz=lines,
    ...         receptance=pair.receptance(lines, response=place),
    ...         response=place,
    ...         standard_deviation=0.001,
    ...     )
    ...     for place in (Coordinate(), nose)
    ... ]
    >>> inverse = invert_coupling(measured)
    >>> {name: f"{value:.3g}" for name, value in inverse.start().items() if ".k" in name}
    {'joint.k_y': '1e+08', 'joint.k_theta': '1e+05'}
    """
    observed = check_observations(observations)
    names = _check_terms(terms, len(observed))
    errors = _checks.items("tolerances", tolerances, Tolerance, least=0)
    share = _checks.positive("invert_coupling", "limit", limit)
    _check_joint(observed, joint, names)
    observed, lines, rows, dropped = common_lines(observed)
    equations = _equations(observed, joint, names, lines, rows, threads)
    x, ambiguous = solve_lines(equations)
    # A stiffness beyond that of the joint that represents a rigid one cannot be resolved.
    x, rank = equations.determined(np.where(np.abs(x) < _RIGID.k_y, x, np.nan))
    if rank.max(initial=0) < len(names):
        raise ValueError(_rank_message(names, int(rank.max(initial=0)), observed))
    good, relative, condition = equations.conditions(x, rank == len(names))
    with np.errstate(all="ignore"):
        noise, scale = equations.standard_deviation(x), equations.scale(x)
    typical, usable, rms = _fit_constant_joint(equations, x, good, share)
    model = np.zeros(x.shape)
    if errors:
        moved = _moved_by_errors(observed, joint, names, lines, errors, typical, threads)
        with np.errstate(all="ignore"):
            change = np.einsum("nmp,npt->nmt", relative * scale[..., None], moved)
            model = np.sqrt(np.sum(np.abs(change) ** 2, axis=2))
            usable &= np.hypot(noise, model) <= share * scale

    def matrices(values: NDArray[Any]) -> NDArray[Any]:
        """Return values of the terms as symmetric matrices, zero for known terms."""
        return replace(equations, known=np.zeros((len(x), 2, 2), dtype=values.dtype)).stiffness(values)

    inverse = InverseCoupling(
        frequency_hz=lines,
        joint=joint,
        terms=names,
        stiffness=np.where(good[:, None, None], equations.stiffness(x), np.nan),
        standard_deviation=matrices(np.where(good[:, None], noise, np.inf)),
        model_deviation=matrices(np.where(good[:, None], model, np.inf)),
        condition=condition,
        usable=matrices(usable),
        limit=share,
        ambiguous=ambiguous & good,
        typical=typical,
        rms=rms,
        labels=tuple(o.title(i) for i, o in enumerate(observed)),
    )
    for name in ("frequency_hz", "stiffness", "standard_deviation", "model_deviation", "condition", "usable"):
        getattr(inverse, name).setflags(write=False)
    return replace(inverse, notes=tuple(_notes(inverse, observed, dropped)))


def _moved_by_errors(
    observed: tuple[Observation, ...],
    joint: str,
    terms: tuple[str, ...],
    lines: NDArray[np.inexact],
    errors: tuple[Tolerance, ...],
    typical: dict[str, tuple[float, float]],
    threads: int | None,
) -> NDArray[np.complex128]:
    """Return the derivatives of the logarithms of the modelled receptances by the errors, `(n, p, t)`.

    They count standard deviations. The joint is the constant one. A modelled receptance that moves by dH has the same
    effect on the solution as a measured one that moves by -dH.
    """
    assembly = observed[0].assembly
    values = {name: typical[name][0] if name in typical else assembly.get(f"{joint}.{name}") for name in TERMS}
    for name in ("k_y", "k_theta"):
        values[name] = abs(values[name])
    most = 0.99 * float(np.sqrt(values["k_y"] * values["k_theta"]))
    values["k_ytheta"] = float(np.clip(values["k_ytheta"], -most, most))
    sites = [o.site(i) for i, o in enumerate(observed)]
    # The parameter map needs an unknown; only its errors are used.
    some = Unknown(address=f"{joint}.{terms[0]}", lower=1.0, upper=2.0)
    parameters = Parameters([some], errors, sites)
    vector = np.array([unknown.start for unknown in parameters.unknowns], dtype=np.float64)
    result = []
    for observation, site in zip(observed, sites, strict=True):
        mapping = parameters.at(site)
        keep = [i for i, address in enumerate(mapping.addresses) if not address.startswith(f"{joint}.")]
        h, dh = site.assembly.replace({f"{joint}.{name}": value for name, value in values.items()}).derivatives(
            lines,
            [mapping.addresses[i] for i in keep],
            response=observation.response,
            excitation=observation.excitation,
            threads=threads,
        )
        result.append(dh @ mapping.jacobian(vector)[keep][:, parameters.count :] / h[:, None])
    return np.stack(result, axis=1)


def _fit_constant_joint(
    equations: Equations, x: NDArray[np.complex128], good: NDArray[np.bool_], share: float
) -> tuple[dict[str, tuple[float, float]], NDArray[np.bool_], float]:
    """Fit a constant joint k + i w c to all lines, from medians over the informative ones and from a grid.

    The result is k and c of each term (none without informative lines), the mask `(n, m)` of standard deviations below
    `share` of the term at this joint, and the root mean square of the residuals in standard deviations.
    """
    w = equations.angular_frequency
    starts = []
    with np.errstate(all="ignore"):
        at = x
        for _ in range(_MEDIAN_ITERATIONS):
            noise = equations.standard_deviation(at)
            informative = good[:, None] & (noise <= share * equations.scale(at))
            if not informative.any(axis=0).all():
                break
            columns = np.ascontiguousarray(informative.T)
            start = np.array([_median_joint(x[rows, i], noise[rows, i], w[rows]) for i, rows in enumerate(columns)])
            starts.append(start)
            # On lines where noise makes the joint too soft the standard deviation at x is too small.
            at = start[:, 0] + 1j * w[:, None] * start[:, 1]
    if not starts:
        return {}, np.zeros(x.shape, dtype=np.bool_), np.nan
    count = 2 * int(good.sum()) * equations.rigid.shape[1]
    with np.errstate(all="ignore"):
        # Medians of lines with large standard deviations are unreliable, hence the grid.
        starts = [starts[0], starts[-1], *constant_grid_starts(equations, good)]
        ends = [constant_joint(equations, start, good) for start in starts]
        misfit, stiffness, dashpots = min(ends, key=lambda end: end[0])
        typical = stiffness + 1j * w[:, None] * dashpots
        usable = good[:, None] & (equations.standard_deviation(typical) <= share * equations.scale(typical))
    pairs = zip(stiffness.tolist(), dashpots.tolist(), strict=True)
    return dict(zip(equations.terms, pairs, strict=True)), usable, float(np.sqrt(misfit / count))


def _equations(
    observed: tuple[Observation, ...],
    joint: str,
    terms: tuple[str, ...],
    lines: NDArray[np.inexact],
    rows: list[NDArray[np.intp]],
    threads: int | None,
) -> Equations:
    parts = [_with_rigid_joint(o.assembly, joint, lines, o, threads) for o in observed]
    deviations = [np.asarray(o.standard_deviation)[row] for o, row in zip(observed, rows, strict=True)]
    return Equations(
        rigid=np.stack([part[0] for part in parts], axis=1),
        measured=np.stack([o.receptance[row] for o, row in zip(observed, rows, strict=True)], axis=1),
        response=np.stack([part[1] for part in parts], axis=1),
        excitation=np.stack([part[2] for part in parts], axis=1),
        surroundings=np.stack([part[3] for part in parts], axis=1),
        deviation=np.stack(deviations, axis=1),
        known=_joint_of(observed[0].assembly, joint).stiffness(lines),
        angular_frequency=2.0 * np.pi * lines.astype(np.complex128),
        terms=terms,
    )


def _with_rigid_joint(
    assembly: Assembly, joint: str, lines: NDArray[np.inexact], observation: Observation, threads: int | None
) -> tuple[NDArray[np.complex128], ...]:
    """Return H, F_r, F_e and Y of (T8) with the joint rigid."""
    planes = assembly.reduced_to_joint(
        joint,
        lines,
        response=observation.response,
        excitation=observation.excitation,
        at=_RIGID,
        planes=True,
        threads=threads,
    ).planes()
    assert planes is not None, "planes were requested"
    h, *forces, yy, yt, tt = planes[0::2] + 1j * planes[1::2]
    r, e = np.stack(forces[:2], axis=1), np.stack(forces[2:], axis=1)
    y = np.stack([np.stack([yy, yt], axis=1), np.stack([yt, tt], axis=1)], axis=1)
    compliance = np.diag([1.0 / _RIGID.k_y, 1.0 / _RIGID.k_theta])
    factor = np.linalg.inv(np.eye(2) - y @ compliance)
    h = h - np.einsum("ni,ij,njk,nk->n", r, compliance, factor, e)
    return h, np.einsum("nij,nj->ni", factor, r), np.einsum("nij,nj->ni", factor, e), factor @ y


def _median_joint(
    value: NDArray[np.complex128], deviation: NDArray[np.float64], w: NDArray[np.complex128]
) -> tuple[float, float]:
    """Return k and c of k + i w c as weighted medians over lines."""
    deviation = np.maximum(deviation, 1e-300)
    # With complex w the imaginary part of K is c Re w, and its real part contains -c Im w.
    c = value.imag / w.real
    k = value.real + w.imag * c
    return _weighted_median(k, deviation**-2.0), _weighted_median(c, (deviation / w.real) ** -2.0)


def _weighted_median(values: NDArray[np.float64], weights: NDArray[np.float64]) -> float:
    order = np.argsort(values)
    total = np.cumsum((weights / weights.max())[order])
    return float(values[order][np.searchsorted(total, 0.5 * total[-1])])


def _check_terms(terms: Sequence[str] | None, count: int) -> tuple[str, ...]:
    """Return the terms to solve for, in the order of `TERMS`."""
    if terms is None:
        return _DEFAULT_TERMS[min(count, 3) - 1]
    names = (terms,) if isinstance(terms, str) else tuple(terms)
    if not names or len(set(names)) < len(names) or not set(names) <= TERMS.keys():
        raise ValueError(f"terms is {terms!r}, expected some of {', '.join(TERMS)}, each once")
    if len(names) > count:
        raise ValueError(
            f"{join_names(names)} are {len(names)} unknown terms on each line, but there "
            f"{'is one receptance' if count == 1 else f'are {count} receptances'}, one equation each; measure at "
            "another coordinate or with another overhang as well, or solve for fewer terms"
        )
    return tuple(term for term in TERMS if term in names)


def _joint_of(assembly: Assembly, joint: str) -> PointJoint:
    """Return the joint, which must be a `PointJoint`."""
    element = assembly.elements.get(joint)
    if not isinstance(element, PointJoint):
        names = [name for name, other in assembly.elements.items() if isinstance(other, PointJoint)]
        raise ValueError(
            f"there is no point joint {joint!r} in {assembly!r}; its point joints are: {', '.join(names) or 'none'}"
        )
    return element


def _check_joint(observed: tuple[Observation, ...], joint: str, terms: tuple[str, ...]) -> None:
    """Raise if the joints of the observations differ in their known terms."""
    solved = {name for term in terms for name in (term, f"c{term[1:]}")}
    if len(terms) == len(TERMS):
        solved |= {name for name, quantity in PointJoint.quantities.items() if quantity is units.LOSS_FACTOR}
    first = _joint_of(observed[0].assembly, joint)
    for observation in observed[1:]:
        other = _joint_of(observation.assembly, joint)
        for name in PointJoint.columns_of:
            if name not in solved and getattr(other, name) != getattr(first, name):
                raise ValueError(
                    f"{joint}.{name} is {getattr(first, name):g} in {observed[0]!r} and {getattr(other, name):g} in "
                    f"{observation!r}, expected the same joint, or {name} among the terms"
                )


def _rank_message(terms: tuple[str, ...], rank: int, observed: tuple[Observation, ...]) -> str:
    """Return the message for equations that cannot separate the terms."""
    loads = {(o.excitation, str(o.assembly)) for o in observed}
    hint = (
        "all of them are responses to one load, which determine at most two terms: excite at another coordinate as well"
        if len(loads) == 1 and len(terms) == len(TERMS)
        else "measure at another coordinate or with another overhang"
    )
    return (
        f"the {len(observed)} receptances cannot separate {join_names(terms)}: no line determines more than {rank} of "
        f"these terms; {hint}, or solve for fewer terms"
    )


def _notes(inverse: InverseCoupling, observed: tuple[Observation, ...], dropped: int) -> list[str]:
    """Return the notes for the user; `dropped` lines are not common to all observations."""
    notes = [note for observation in observed for note in observation.notes]
    if dropped:
        notes.append(f"{dropped} lines are left out because some measurements lack them")
    count = len(inverse.frequency_hz)
    masked = inverse.frequency_hz[np.isinf(inverse.condition)]
    if masked.size:
        notes.append(masked_lines(masked, count))
    fixed = [name for name in TERMS if name not in inverse.terms]
    if fixed:
        held = ", ".join(
            f"{name} = {getattr(_joint_of(observed[0].assembly, inverse.joint), name):g}" for name in fixed
        )
        notes.append(f"taken as known: {held}, with their damping; errors of them cause errors of the other terms")
    limit = f"{100.0 * inverse.limit:g} %"
    for term in inverse.terms:
        usable = int(inverse.term(term)[2].sum())
        if not usable:
            notes.append(f"no line is usable for {term}: its standard deviation is nowhere below {limit}")
        elif usable < count:
            notes.append(f"{usable} of {count} lines are usable for {term} (standard deviation below {limit})")
    if inverse.rms > _MISFIT_RMS:
        notes.append(
            f"no k + i w c fits all lines: the rms is {inverse.rms:.3g} standard deviations; the parts or the known "
            "terms differ from the model, and the start may be poor"
        )
    if inverse.ambiguous.any():
        notes.append(
            f"on {int(inverse.ambiguous.sum())} of {count} lines two stiffnesses fit; the one closer to those of the "
            "other lines was selected"
        )
    return notes
