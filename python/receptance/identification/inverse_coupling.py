"""A joint's complex stiffness line by line, and how far each line can be believed."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance import _checks
from receptance.identification.line_solutions import TERMS, names_of
from receptance.identification.unknowns import Unknown
from receptance.report import Column, Provenance, Result, Results, Table
from receptance.report.table import Cell

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

__all__ = ["InverseCoupling", "InverseCouplings"]

_FAINT_LOSS = 1e-3
"""Loss factor at which a dashpot starts that the lines do not show to be above zero."""


@dataclass(frozen=True, kw_only=True)
class InverseCoupling(Result):
    """The complex stiffness of a joint on each line, and how far each line can be believed.

    Attributes
    ----------
    frequency_hz : ndarray
        `(n,)` lines, complex where an exponential window was used.
    joint : str
        Name of the joint.
    terms : tuple of str
        What was solved for, of "k_y", "k_theta" and "k_ytheta"; the rest has the values of the assembly.
    stiffness : ndarray
        `(n, 2, 2)` complex, over (y, theta): k + i w c where the joint is one of those.
    standard_deviation : ndarray
        `(n, 2, 2)` of the real and of the imaginary part, each, from the variance of the receptances; first order.
    model_deviation : ndarray
        `(n, 2, 2)` standard deviation of the modulus that the tolerances of the modelled parts make; the same error on
        all lines, so no averaging makes it smaller. Zero without tolerances.
    condition : ndarray
        `(n,)` by how much a relative error of the receptances can grow on its way to the stiffness; an error of the
        coupling term is counted relative to sqrt(k_y k_theta).
    usable : ndarray
        `(n, 2, 2)` where the data speak: at the joint that suits all lines both deviations together are below `limit`
        of the term's size, sqrt(k_y k_theta) for the coupling. A line's own stiffness does not decide it: one that
        comes out too soft by chance would seem well known.
    limit : float
        That share.
    ambiguous : ndarray
        `(n,)` where several stiffnesses explain the data, and the one that agrees with the other lines was taken.
    rms : float
        Root mean square of what is left of the logarithms with that joint on all lines, in standard deviations: about 1
        where it is one joint k + i w c and all else is as it is modelled.
    labels : tuple of str
        What was measured.
    typical : dict of str to (float, float)
        Stiffness and dashpot of each term that suit all lines together.
    notes : tuple of str
        Notes for the user.
    name : str
        Name in tables: the joint, and the assembly where the joint changes between assemblies.
    provenance : Provenance
        Campaign and versions of the software.
    """

    frequency_hz: NDArray[Any]
    joint: str
    terms: tuple[str, ...]
    stiffness: NDArray[np.complex128]
    standard_deviation: NDArray[np.float64]
    model_deviation: NDArray[np.float64]
    condition: NDArray[np.float64]
    usable: NDArray[np.bool_]
    limit: float
    ambiguous: NDArray[np.bool_]
    labels: tuple[str, ...]
    typical: dict[str, tuple[float, float]]
    rms: float
    notes: tuple[str, ...] = field(default=())
    name: str = ""
    provenance: Provenance = field(default_factory=Provenance, repr=False)

    heading = "Joints line by line"

    def term(self, name: str) -> tuple[NDArray[np.complex128], NDArray[np.float64], NDArray[np.bool_]]:
        """Return values, standard deviations and mask of one term, `(n,)` each.

        Raises
        ------
        ValueError
            A term that was not solved for.
        """
        if name not in self.terms:
            raise ValueError(f"{name!r} was not solved for, only {names_of(self.terms)}")
        at = (slice(None), *TERMS[name])
        return self.stiffness[at], self.standard_deviation[at], self.usable[at]

    def start(self) -> dict[str, float]:
        """Return stiffnesses and dashpots that suit the lines that speak, in SI units by address.

        Least squares of the logarithm over all lines, from medians of Re K and of Im K / w, and from a coarse grid
        where these do not suit. Lines that say little each may say enough together; look at `rms`. Empty where no line
        says anything.
        """
        found = {}
        for name, (k, c) in self.typical.items():
            found[f"{self.joint}.{name}"] = k
            found[f"{self.joint}.c{name[1:]}"] = c
        return found

    def unknowns(self, *, decades: float = 2.0, damping: bool = True) -> list[Unknown]:
        """Return unknowns for `identify` that start there.

        Parameters
        ----------
        decades : float, optional
            How far the bounds of a stiffness are from the start; a dashpot has one more to either side.
        damping : bool, optional
            Whether dashpots are unknown as well.

        Raises
        ------
        ValueError
            No line speaks of any term.
        """
        reach = 10.0 ** _checks.positive("InverseCoupling.unknowns", "decades", decades)
        start = self.start()
        if not start:
            raise ValueError(
                f"no line says anything of {names_of(self.terms)} at a standard deviation below {self.limit:g} of its "
                "size, so there is no start; measure with less noise, elsewhere, or raise limit"
            )
        w = 2.0 * np.pi * float(np.median(np.asarray(self.frequency_hz).real))
        found = []
        for name in self.terms:
            address = f"{self.joint}.{name}"
            if address not in start:
                continue
            if name == "k_ytheta":
                most = reach * max(abs(start[address]), self._coupling_size())
                found.append(Unknown(address=address, lower=-most, upper=most, start=start[address]))
                continue
            k = start[address]
            if k <= 0.0:
                continue
            found.append(Unknown(address=address, lower=k / reach, upper=k * reach, start=k))
            if damping:
                address = f"{self.joint}.c{name[1:]}"
                c = max(start[address], _FAINT_LOSS * k / w)
                found.append(Unknown(address=address, lower=c / (10.0 * reach), upper=10.0 * c * reach, start=c))
        return found

    def _coupling_size(self) -> float:
        k = self.stiffness
        return float(np.median(np.sqrt(np.abs(k[:, 0, 0] * k[:, 1, 1]))))

    def tables(self) -> list[Table]:
        """Return for each term its usable lines, and the stiffness and dashpot that suit all lines."""
        columns = (
            "term",
            "usable lines",
            Column("from, to", "Hz", "g"),
            Column("condition\nnumber", form=".2g"),
            Column("k", form=".4g"),
            Column("c", form=".3g"),
            Column("rms left", form=".3g"),
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
        title = f"Standard deviation below {100.0 * self.limit:g} %; k and c that suit all lines, SI units"
        return [Table(title, columns, rows)]

    def data(self) -> dict[str, Any]:
        """Return each term on each line with its deviations, and the start for a fit."""
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

    def plot(self, ax: Axes | None = None) -> Figure:
        """Draw real and imaginary part of each term, and the condition number; see `Result.plot`."""
        return InverseCouplings({self.name or self.joint: self}).plot(ax)

    def __repr__(self) -> str:
        spoken = ", ".join(f"{name} on {int(self.term(name)[2].sum())}" for name in self.terms)
        return f"InverseCoupling({self.joint!r}, {len(self.frequency_hz)} lines; the data speak of {spoken})"


class InverseCouplings(Results[InverseCoupling]):
    """Joints line by line, by name of the joint."""

    heading = "Joints line by line"
    key = "joints"

    def plot(self, ax: Axes | None = None) -> Figure:
        """Draw real and imaginary part of each term of each joint, and condition numbers; see `Result.plot`."""
        from receptance.identification.figures.inverse_coupling import draw_inverse_coupling

        return draw_inverse_coupling(self, ax)
