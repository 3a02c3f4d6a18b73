"""All lines of a measured FRF, and why a fit does not use some of them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from receptance.fit import Observation
from receptance.frf import FRF
from receptance.model.terminals import Terminal


@dataclass(frozen=True, eq=False)
class MeasuredLines:
    """A measured receptance on all its lines above 0 Hz, used or not.

    Examples
    --------
    >>> import tempfile
    >>> from receptance import campaign, examples
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = examples.write("forgotten-sensor", folder)
    ...     lines = campaign.load(folder).measured_lines("40 mm")
    >>> lines.frequency_hz.size, lines.unused
    (1551, {})
    """

    frequency_hz: NDArray[np.float64]
    """`(n,)` ascending."""
    receptance: NDArray[np.complex128]
    """`(n,)`, in m/N, m/(N m), rad/N or rad/(N m)."""
    coherence: NDArray[np.float64] | None
    """`(n,)` from 0 to 1; None where the record has none."""
    unused: dict[str, NDArray[np.bool_]]
    """The lines `(n,)` that are not used, by reason. A line has one reason; reasons without lines are left out."""

    @classmethod
    def of(
        cls, frf: FRF, used: Observation, bands: Sequence[Sequence[float]] | None, integrations: int
    ) -> MeasuredLines:
        """Return the lines of an FRF of which an observation has some.

        Parameters
        ----------
        frf : FRF
            One response and one excitation, on all lines.
        used : Observation
            What a fit uses of it.
        bands : sequence of pairs of float, optional
            The bands in Hz that the campaign chose.
        integrations : int
            How often its motion is integrated, less than zero if it is differentiated.
        """
        entry = frf.on_lines(frf.frequency_hz > 0.0).to("receptance")
        lines = entry.frequency_hz
        left = ~np.isin(lines, used.frequency_hz.real)
        reasons: dict[str, NDArray[np.bool_]] = {}
        if entry.usable is not None:
            reasons["outside the usable band of the FRF"] = ~entry.usable
        if bands is not None:
            reasons["outside the bands of the campaign"] = ~inside_bands(lines, bands)
        *_, end = used.assembly.elements.values()
        if isinstance(end, Terminal):
            reasons[f"{end.name} is not known"] = ~end.covers(lines)
        reasons["infinite variance"] = np.ones_like(left)
        unused = {}
        for reason, excluded in reasons.items():
            if (left & excluded).any():
                unused[reason] = left & excluded
            left = left & ~excluded
        values = entry.values[:, 0, 0] / (2j * np.pi * entry.complex_frequency_hz) ** integrations
        coherence = None if entry.coherence is None else entry.coherence[:, 0, 0]
        return cls(lines, np.asarray(values), coherence, unused)


def inside_bands(frequency_hz: NDArray[np.float64], bands: Sequence[Sequence[float]]) -> NDArray[np.bool_]:
    """Return which lines are within one of several bands, whose ends belong to them."""
    inside = np.zeros(frequency_hz.shape, dtype=np.bool_)
    for low, high in bands:
        inside |= (frequency_hz >= low) & (frequency_hz <= high)
    return inside
