"""Clamped aluminium rods: the clamp from one rod's first mode, the other rods predicted.

One frequency decides one number. So the clamp is taken as yielding in rotation alone or in translation alone, each
rod gives one stiffness under either assumption, and the other rods say whether it holds.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance import _checks
from receptance.assembly import Assembly
from receptance.beams import Part, Segment
from receptance.identification import MeasuredFrequencies, Unknown, identify
from receptance.joints import GroundSpring
from receptance.materials import Material
from receptance.provenance import versions
from receptance.studies._data import number, read_table, read_toml

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = [
    "Clamp",
    "ClampedRods",
    "CommonClamp",
    "Prediction",
    "Rod",
    "as_dict",
    "checked_error",
    "findings",
    "load_rods",
    "run",
]

SOURCE = (
    "github.com/leekunhwee/Dynamics at 64deac715399fcde0113a954857c5f0fa13ca51a, RCSA/Example "
    "(numbers read from figures)"
)
ASSUMPTIONS = {"rotation": ("clamp.k_theta",), "translation": ("clamp.k_y",), "both": ("clamp.k_y", "clamp.k_theta")}
"""What yields; the rest of the clamp is rigid."""
UNITS = {"clamp.k_y": "N/m", "clamp.k_theta": "N m/rad"}
_BOUNDS = {"clamp.k_y": (1e4, 1e12), "clamp.k_theta": (1e1, 1e9)}
_RIGID = {"clamp.k_y": 1e14, "clamp.k_theta": 1e11}

Interval = tuple[float | None, float | None]


@dataclass(frozen=True)
class Rod:
    """A rod from the clamp on: (length, diameter) in mm, with its measured first mode."""

    name: str
    segments_mm: tuple[tuple[float, float], ...]
    measured_hz: float
    authors_prediction_hz: float

    def assembly(self, material: Material) -> Assembly:
        """Rod with its tip first and a clamp, so far rigid, at its far end."""
        segments = [
            Segment(length=1e-3 * length, outer_diameter=1e-3 * diameter, material=material)
            for length, diameter in reversed(self.segments_mm)
        ]
        stiffness = {address.split(".")[1]: value for address, value in _RIGID.items()}
        clamp = GroundSpring(
            k_y=stiffness["k_y"], k_theta=stiffness["k_theta"], part="rod", position="end", name="clamp"
        )
        return Assembly([Part(segments, name="rod")], [clamp])


@dataclass(frozen=True)
class Clamp:
    """Stiffness of the clamp from one rod under one assumption; None where a rigid clamp is still too soft."""

    rod: str
    assumption: str
    address: str
    value: float | None
    interval: Interval


@dataclass(frozen=True)
class Prediction:
    """First mode of a rod with the clamp of another one; the interval carries the reading error of the other."""

    assumption: str
    identified_on: str
    rod: str
    measured_hz: float
    predicted_hz: float
    interval_hz: tuple[float, float]
    agrees: bool

    @property
    def error_percent(self) -> float:
        """Predicted against measured."""
        return 100.0 * (self.predicted_hz / self.measured_hz - 1.0)


@dataclass(frozen=True)
class CommonClamp:
    """One clamp for all rods by least squares; and the least that the worst rod is off with any such clamp."""

    assumption: str
    values: dict[str, float]
    error_hz: dict[str, float]
    least_worst_hz: float
    explains: bool
    advice: tuple[str, ...]


@dataclass(frozen=True)
class ClampedRods:
    """Everything that the study found."""

    reading_error_hz: float
    seed: int
    material: Material
    rods: tuple[Rod, ...]
    rigid_hz: dict[str, float]
    clamps: tuple[Clamp, ...]
    predictions: tuple[Prediction, ...]
    common: tuple[CommonClamp, ...]
    versions: dict[str, str]


def load_rods() -> tuple[tuple[Rod, ...], Material, float]:
    """Read the packaged rods, their material and the reading error in Hz."""
    data = read_toml("clamped_rods_material.toml")
    metal = data["aluminium_7075"]
    material = Material(
        youngs_modulus=1e9 * metal["E_gpa"],
        density=float(metal["density_kg_m3"]),
        poisson_ratio=metal["poisson"],
        name="aluminium 7075",
    )
    rods = []
    for row in read_table("clamped_rods.csv"):
        pairs = (pair.split("/") for pair in row["segments_from_clamp_mm"].split())
        segments = tuple((float(length), float(diameter)) for length, diameter in pairs)
        rods.append(Rod(row["rod"], segments, number(row, "measured_1_hz"), number(row, "authors_prediction_1_hz")))
    return tuple(rods), material, float(data["reading_error_hz"])


def checked_error(reading_error_hz: float | None) -> float:
    """Return the reading error in Hz, by default the stated one.

    Raises
    ------
    ValueError, TypeError
        An error that is not positive, or as large as the frequencies themselves.
    """
    rods, _, stated = load_rods()
    given = stated if reading_error_hz is None else reading_error_hz
    error = _checks.positive("clamped-rods", "reading error", given, unit="Hz")
    least = min(rod.measured_hz for rod in rods)
    if error >= least:
        raise ValueError(
            f"clamped-rods: reading error is {error:g} Hz, expected less than the lowest frequency, {least:g} Hz"
        )
    return error


def run(
    *, reading_error_hz: float | None = None, seed: int = 0, progress: Callable[[str], None] | None = None
) -> ClampedRods:
    """Identify the clamp on every rod and predict the others with it.

    Parameters
    ----------
    reading_error_hz : float, optional
        How far a reading can be off; by default what the source states.
    seed : int, optional
        Of the starts of the identification.
    progress : callable, optional
        Is told in words what is being done.

    Examples
    --------
    >>> from receptance.studies.clamped_rods import run
    >>> {name: round(value, 1) for name, value in run().rigid_hz.items()}
    {'b': 312.6, 'c': 573.8, 'd': 414.2}
    """
    rods, material, _ = load_rods()
    error = checked_error(reading_error_hz)
    say = progress or (lambda _: None)
    rigid = {rod.name: _first(rod.assembly(material)) for rod in rods}
    say("identifying the clamp")
    clamps = [
        _clamp(rod, material, assumption, rigid[rod.name], error, seed)
        for assumption in ("rotation", "translation")
        for rod in rods
    ]
    say("predicting the other rods")
    predictions = [_predict(clamp, rod, material, error) for clamp in clamps for rod in rods if rod.name != clamp.rod]
    common = tuple(_common(assumption, rods, material, error, seed) for assumption in ASSUMPTIONS)
    return ClampedRods(error, seed, material, rods, rigid, tuple(clamps), tuple(predictions), common, versions())


def _first(assembly: Assembly) -> float:
    return float(assembly.lowest_natural_frequencies(1)[0][0])


def _clamp(rod: Rod, material: Material, assumption: str, rigid_hz: float, error: float, seed: int) -> Clamp:
    (address,) = ASSUMPTIONS[assumption]
    # A softer clamp lowers the first mode: what lies above the rigid clamp's, no stiffness reaches.
    low, value, high = (
        _stiffness(rod, material, address, frequency, seed) if frequency < rigid_hz else None
        for frequency in (rod.measured_hz - error, rod.measured_hz, rod.measured_hz + error)
    )
    return Clamp(rod.name, assumption, address, value, (low, high))


def _stiffness(rod: Rod, material: Material, address: str, frequency_hz: float, seed: int) -> float | None:
    low, high = _BOUNDS[address]
    observed = MeasuredFrequencies(
        assembly=rod.assembly(material), frequency_hz=[frequency_hz], label=f"rod {rod.name}"
    )
    found = identify(observed, [Unknown(address=address, lower=low, upper=high)], seed=seed)
    value = found.values[address]
    return value if low * 1.001 < value < high * 0.999 else None


def _predict(clamp: Clamp, rod: Rod, material: Material, error: float) -> Prediction:
    # Where the clamp is rigid within the reading error, the rigid clamp is the end.
    values = [_RIGID[clamp.address] if k is None else k for k in (clamp.interval[0], clamp.value, clamp.interval[1])]
    low, middle, high = (_first(rod.assembly(material).replace({clamp.address: value})) for value in values)
    agrees = low <= rod.measured_hz + error and high >= rod.measured_hz - error
    return Prediction(clamp.assumption, clamp.rod, rod.name, rod.measured_hz, middle, (low, high), agrees)


def _common(assumption: str, rods: Sequence[Rod], material: Material, error: float, seed: int) -> CommonClamp:
    # Uniform over the reading error to either side.
    deviation = error / float(np.sqrt(3.0))
    observed = [
        MeasuredFrequencies(
            assembly=rod.assembly(material),
            frequency_hz=[rod.measured_hz],
            standard_deviation_hz=deviation,
            label=f"rod {rod.name}",
        )
        for rod in rods
    ]
    unknowns = [
        Unknown(address=address, lower=_BOUNDS[address][0], upper=_BOUNDS[address][1])
        for address in ASSUMPTIONS[assumption]
    ]
    found = identify(observed, unknowns, seed=seed)
    errors = {rod.name: _first(rod.assembly(material).replace(found.values)) - rod.measured_hz for rod in rods}
    worst = _least_worst(rods, material, found.values)
    return CommonClamp(assumption, dict(found.values), errors, worst, worst <= error, tuple(found.advice))


def _least_worst(rods: Sequence[Rod], material: Material, start: Mapping[str, float]) -> float:
    """Smallest possible largest error in Hz, sought from the least-squares clamp."""
    from scipy.optimize import minimize  # slow to import

    assemblies = [rod.assembly(material) for rod in rods]

    def errors(x: NDArray[np.float64]) -> NDArray[np.float64]:
        values = dict(zip(start, np.exp(x[:-1]).tolist(), strict=True))
        pairs = zip(assemblies, rods, strict=True)
        return np.array([_first(a.replace(values)) - rod.measured_hz for a, rod in pairs])

    # The last variable bounds all errors from both sides and is made as small as it goes.
    x0 = np.append(np.log(list(start.values())), 0.0)
    x0[-1] = float(np.max(np.abs(errors(x0))))
    limits = [(float(np.log(_BOUNDS[address][0])), float(np.log(_BOUNDS[address][1]))) for address in start]
    inside: Any = {"type": "ineq", "fun": lambda x: np.concatenate([x[-1] - errors(x), x[-1] + errors(x)])}
    bounds = [*limits, (0.0, float("inf"))]
    found = minimize(_last, x0, method="SLSQP", bounds=bounds, constraints=inside)
    return min(float(np.max(np.abs(errors(x)))) for x in (x0, found.x))


def _last(x: NDArray[np.float64]) -> float:
    return float(x[-1])


def findings(study: ClampedRods) -> tuple[str, ...]:
    """Return what the study found, in sentences."""
    sentences = [
        f"One frequency decides one number of the clamp, so each rod is taken twice: the clamp yields in rotation "
        "alone, or in "
        f"translation alone. Readings are +-{study.reading_error_hz:g} Hz, carried through to every interval.",
        "A rigid clamp would give "
        + ", ".join(f"{f:.1f} Hz (rod {name})" for name, f in study.rigid_hz.items())
        + "; measured "
        + ", ".join(f"{rod.measured_hz:g}" for rod in study.rods)
        + " Hz.",
    ]
    for assumption in ("rotation", "translation"):
        chosen = [p for p in study.predictions if p.assumption == assumption]
        good = [p for p in chosen if p.agrees]
        worst = max(chosen, key=lambda p: abs(p.error_percent))
        sentences.append(
            f"Yielding in {assumption} alone: {len(good)} of {len(chosen)} predictions agree within the reading error"
            + (f" ({', '.join(f'{p.identified_on} to {p.rod}' for p in good)})" if good else "")
            + f"; furthest off {worst.error_percent:+.1f} % ({worst.identified_on} to {worst.rod})."
        )
    for clamp in study.common:
        values = ", ".join(f"{a.split('.')[1]} = {v:.3g} {UNITS[a]}" for a, v in clamp.values.items())
        left = ", ".join(f"{name} {value:+.1f}" for name, value in clamp.error_hz.items())
        words = "explains all three readings" if clamp.explains else "does not explain the readings"
        kind = "rotation and translation" if clamp.assumption == "both" else f"{clamp.assumption} alone"
        sentences.append(
            f"One clamp for all rods, yielding in {kind}, {words}: {values} by least squares, left over {left} Hz; "
            f"at best the worst rod is {clamp.least_worst_hz:.1f} Hz off."
        )
    if not any(clamp.explains for clamp in study.common):
        sentences.append(
            "So no single clamp of this model explains the rods: the clamping differed from rod to rod, or something "
            "else does "
            "(lengths, material, the removed accelerometer). Three frequencies cannot say which."
        )
    sentences.append("The source gives rod d's tip as 16 mm in one place and 10 mm in the others; 10 mm is used.")
    return tuple(sentences)


def as_dict(study: ClampedRods) -> dict[str, Any]:
    """Return the study as what JSON holds; an open end of an interval is None."""
    return {
        "study": "clamped-rods",
        "source": SOURCE,
        "settings": {"reading_error_hz": study.reading_error_hz},
        "seed": study.seed,
        "versions": study.versions,
        "material": dataclasses.asdict(study.material),
        "rods": [dataclasses.asdict(rod) | {"rigid_clamp_hz": study.rigid_hz[rod.name]} for rod in study.rods],
        "identified": [
            dataclasses.asdict(clamp) | {"unit": UNITS[clamp.address], "interval": list(clamp.interval)}
            for clamp in study.clamps
        ],
        "predictions": [
            dataclasses.asdict(prediction)
            | {"interval_hz": list(prediction.interval_hz), "error_percent": prediction.error_percent}
            for prediction in study.predictions
        ],
        "common_clamp": [dataclasses.asdict(clamp) for clamp in study.common],
        "findings": list(findings(study)),
    }
