"""The measured structures: what was measured, the engineer's model, and what cannot be claimed of each.

ModeLAB beam (`modelab`)
    Nine hammer accelerances of a free beam to one sensor at 0.5 m, one of them its drive point;
    github.com/alxhslm/ModeLAB, GPL-3.0. Length, section and material are not documented. The model has a length of
    1.3 m (symmetry of the points), and the section of a steel ring with the mass per length and the bending stiffness
    that the plain data show (`NOMINAL`), rounded to an engineer's digits, with an engineer's tolerances. So two things
    that an engineer would have by scale and caliper come from the data before anything is hidden in them: the scales
    of frequency and amplitude. Modes relative to each other, places and drive points stay as they were measured. There
    is no coherence and no repeat; noise is estimated from the scatter of neighbouring lines. The mass of the sensor
    that was used is not documented, so a model without it has a true error of that kind.
    A mass elsewhere cannot be hidden: it needs a drive point there, and 0.5 m is the only one.
    The drive point reads 1.3 dB less than the transfers imply, a factor of 1.23, 1.12 and 1.11 beside the mirrored hit
    at 0.8 m in the modes 1, 2 and 4. As a record it is left so. Bodies, hidden and known ones, are added with the drive
    point times the mean of these factors (`drive_gain`), so their sizes are uncertain by some 5 %: the
    model has this as the tolerance of the known masses, and the coverage of hidden sizes contains it.
Brake-Reuss beam (`brake_reuss`)
    Stepped sine around the first mode of a beam with a bolted lap joint, drive point, twelve levels;
    github.com/mattiacenedese/BRBtesting, GPL-3.0. Its dimensions are not in the files and there is one mode in 2 Hz,
    so the mass of the model is unknown: a gain, a mass, a spring, a delay and a frequency scale cannot be told from
    another beam. What remains is the quantity and the polarity. Real discrepancy: the joint's dependence on amplitude.
None of the others supports a model: `REFUSED` says why.
"""

from __future__ import annotations

import gzip
from dataclasses import dataclass
from functools import cache, cached_property
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from real.exact import Lines, Values, local_mode

MEASURED = Path(__file__).resolve().parents[3] / "shared" / "measured"

REFUSED = {
    "clamped_rods": "first natural frequencies alone, read from figures to 5 Hz: there is no FRF to hide an effect in",
    "brb_jointed_beam/HammerImpact.mat": "three accelerometers without the force: no FRF",
    "vibrationtesting_cases": "no structure, no units, a median coherence of 0.31",
    "uff_io": "single FRFs of structures that are not documented",
}
"""Measurements that no model can be made for, and the reasons."""

DECAY_RATE = 10.0
"""In 1/s, of the window that the ModeLAB records get first, and that the engineer states. Modes with a damping of 1e-4
are a line wide. A body moves them to where the drive point was noise, which the formula would take for its damping."""
STEP = 128
"""Lines of the file for each line of a case: 2.5 Hz."""
LOWEST_HZ = 60.0
HIT_PLACES = (0.1, 0.25, 0.375, 0.5, 0.65, 0.8, 0.925, 1.05, 1.2)
"""In m, of the nine ModeLAB records."""
SENSOR_PLACE = 0.5
MIRRORED_PLACE = 0.8
"""The hit on the other side of the middle."""
STRONG_MODES = (0, 1, 3)
"""Modes in which the sensor's place moves; the third has a node beside it."""
KNOWN_MASS_TOLERANCE = 0.05
"""Relative, of masses added by means of the drive point."""
LENGTH = 1.3
NOMINAL = {
    "youngs_modulus": 197e9,
    "density": 7410.0,
    "poisson_ratio": 0.14,
    "outer_diameter": 0.0354,
    "inner_diameter": 0.0214,
}
"""Ring whose bending stiffness, mass, rotary inertia and shear are those of the beam."""
TOLERANCES = {"youngs_modulus": 0.01, "density": 0.005, "outer_diameter": 0.002, "poisson_ratio": 0.1}
"""Relative standard deviations that an engineer would state, by datasheet, scales, caliper and textbook."""
PLACE_M = 0.002
"""Standard deviation of a place that was hit or that the sensor was put on."""
MODE_BANDS = ((100.0, 124.0), (292.0, 322.0), (580.0, 612.0), (950.0, 990.0))
"""One ModeLAB mode each."""


@dataclass(frozen=True)
class Beam:
    """The nine ModeLAB accelerances, sensor turned to the hammer's direction, on all lines of the files."""

    spacing_hz: float
    accelerance: Values
    """`(9, n)` from 0 Hz."""

    @property
    def frequency_hz(self) -> Lines:
        """All lines."""
        return self.spacing_hz * np.arange(self.accelerance.shape[1])

    def lines(self, highest_hz: float) -> NDArray[np.intp]:
        """Return the numbers of the lines of a case."""
        first = int(np.ceil(LOWEST_HZ / self.spacing_hz / STEP)) * STEP
        return np.arange(first, int(highest_hz / self.spacing_hz) + 1, STEP)

    @cached_property
    def noise(self) -> Lines:
        """Return the standard deviation `(9, n)` of a line's real and imaginary part, from second differences.

        Their median over 5 Hz to each side is hardly affected by a resonance, which is some lines wide.
        """
        d = self.accelerance
        second = np.abs(d[:, 1:-1] - 0.5 * (d[:, :-2] + d[:, 2:])) ** 2
        # The median of |noise|^2 is ln 2 times its mean; that of the difference is 1.5 times as large as of a line.
        half = int(5.0 / self.spacing_hz)
        marks = np.arange(half, second.shape[1] - half, half)
        level = np.array([np.median(second[:, m - half : m + half], axis=1) for m in marks]).T / (1.5 * np.log(2.0))
        every = np.arange(d.shape[1])
        return np.array([np.sqrt(0.5 * np.interp(every, marks, own)) for own in level])

    @cached_property
    def modes(self) -> list[Values]:
        """Return the local fits of the drive point's modes, with its gain."""
        drive = self.drive_gain * self.accelerance[HIT_PLACES.index(SENSOR_PLACE)]
        return [local_mode(self.frequency_hz, drive, low, high) for low, high in MODE_BANDS]

    @cached_property
    def drive_gain(self) -> float:
        """Return the factor that the drive point lacks beside the mirrored hit, the mean of the strong modes."""
        ratios = []
        for low, high in (MODE_BANDS[i] for i in STRONG_MODES):
            sizes = []
            for place in (MIRRORED_PLACE, SENSOR_PLACE):
                p, c0, c1 = local_mode(self.frequency_hz, self.accelerance[HIT_PLACES.index(place)], low, high)
                sizes.append(abs(c0 + c1 * p))
            ratios.append(sizes[0] / sizes[1])
        return float(np.exp(np.mean(np.log(ratios))))


@cache
def modelab() -> Beam | None:
    """Return the ModeLAB beam; None where its files are absent."""
    folder = MEASURED / "modelab_freefree_beam"
    found = []
    for number in range(1, 10):
        path = folder / f"Hxysv0000{number}.txt.gz"
        if not path.is_file():
            return None
        with gzip.open(path, "rt", encoding="latin-1") as file:
            rows = np.array([[float(x) for x in line.split()] for line in file.readlines()[9:] if line.strip()])
        found.append(-(rows[:, 1] + 1j * rows[:, 2]))  # setup.csv: the accelerometer's axis is reversed
    return Beam(float(rows[1, 0] - rows[0, 0]), np.array(found))


@dataclass(frozen=True)
class Level:
    """One stepped sine of the Brake-Reuss beam."""

    label: str
    frequency_hz: Lines
    accelerance: Values
    force: Lines
    """In N, of each line."""


@cache
def brake_reuss() -> tuple[Level, ...] | None:
    """Return the levels of the Brake-Reuss beam; None where its file is absent."""
    path = MEASURED / "brb_jointed_beam" / "ForcedFrequencyResponses.mat"
    if not path.is_file():
        return None
    from scipy.io import loadmat

    data = loadmat(path, squeeze_me=True, struct_as_record=False)["FRdata"]
    found = []
    for kind in ("ForceControl", "ResponseControl"):
        for number, one in enumerate(getattr(data, kind), 1):
            # The phase runs from 0 to -pi through the resonance: it is that of the displacement.
            ratio = -one.amplitude / one.force * np.exp(1j * one.phase)
            found.append(Level(f"{kind} {number}", one.frequency, ratio, one.force))
    return tuple(found)
