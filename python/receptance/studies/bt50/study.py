"""The study: the paper's procedure on the virtual rig, then the same with an elastic holder."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance.provenance import versions
from receptance.studies._data import read_toml
from receptance.studies.bt50.diagnosed import Diagnosed, diagnosed
from receptance.studies.bt50.levels import (
    RADIAL_CONTACT,
    AxialLevel,
    RadialLevel,
    axial_hz,
    measure_axial,
    measure_radial,
    radial_hz,
)
from receptance.studies.bt50.observations import seed_of
from receptance.studies.bt50.rig import Motion, load_holder, load_rig
from receptance.studies.bt50.settings import BT50Settings
from receptance.taper import ForceSeries, Holder

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

__all__ = ["BT50Study", "DampingIgnored", "LeftOut", "run"]

_SAME = 0.05
"""Relative difference up to which two magnitudes are called the same."""
_DIAGNOSED: tuple[Motion, ...] = ("axial", "radial")
_SHOWN_KN = 20.0
"""The force of the paper's figure 9."""


@dataclass(frozen=True, kw_only=True)
class LeftOut:
    """Natural frequencies at force levels that took no part: laws from every other level, errors at those between.

    Attributes
    ----------
    motion : {"axial", "radial"}
        Which motion.
    force_kn : tuple of float
        The levels that were left out.
    rigid_percent, elastic_percent : tuple of tuple of float
        100 (predicted / measured - 1) for each level and mode: the elastic holder on the rigid holder's springs, as the
        paper simulates it, and on its own.
    """

    motion: str
    force_kn: tuple[float, ...]
    rigid_percent: tuple[tuple[float, ...], ...]
    elastic_percent: tuple[tuple[float, ...], ...]

    @property
    def rigid_rms_percent(self) -> float:
        """Root mean square over levels and modes, before."""
        return float(np.sqrt(np.mean(np.square(self.rigid_percent))))

    @property
    def elastic_rms_percent(self) -> float:
        """The same, after."""
        return float(np.sqrt(np.mean(np.square(self.elastic_percent))))


@dataclass(frozen=True, kw_only=True)
class DampingIgnored:
    """Where the magnitude of the harmonic response is the same within 5 % without damping.

    Attributes
    ----------
    motion : {"axial", "radial"}
        Which motion; at the tip, where it is hit.
    frequency_hz, damped, undamped : ndarray
        The response of the identified elastic model, `(n,)` each.
    differs_hz : tuple of (float, float)
        Bands in which it is not the same.
    """

    motion: str
    frequency_hz: NDArray[np.float64]
    damped: NDArray[np.float64]
    undamped: NDArray[np.float64]
    differs_hz: tuple[tuple[float, float], ...]


@dataclass(frozen=True, kw_only=True)
class BT50Study:
    """Everything that the study found; all measurements in it are virtual.

    Attributes
    ----------
    settings : BT50Settings
        What was chosen.
    holder : Holder
        As drawn; what was measured is a finer model of the same holder.
    published : dict
        What the paper states in its text.
    axial, radial : tuple
        The levels of force.
    series : dict of str to ForceSeries
        Parameters over force: of the rigid holder ("rigid k_z1") and of the elastic one ("elastic k_z1", "elastic
        k_x1" and so on), and the axial damping from half-power points ("half-power c_z1").
    bonded_hz : dict of str to tuple of float
        Modes of the bonded holder, axial and radial.
    left_out : tuple of LeftOut
        Axial and radial.
    damping_ignored : tuple of DampingIgnored
        Axial and radial, at the force of the paper's figure 9.
    diagnosed : tuple of Diagnosed
        What a diagnosis says of the rigid holder.
    versions : dict of str to str
        What the numbers come from.
    """

    settings: BT50Settings
    holder: Holder
    published: dict[str, Any]
    axial: tuple[AxialLevel, ...]
    radial: tuple[RadialLevel, ...]
    series: dict[str, ForceSeries]
    bonded_hz: dict[str, tuple[float, ...]]
    left_out: tuple[LeftOut, ...]
    damping_ignored: tuple[DampingIgnored, ...]
    diagnosed: tuple[Diagnosed, ...]
    versions: dict[str, str] = field(default_factory=versions)


def run(settings: BT50Settings | None = None, *, progress: Callable[[str], None] | None = None) -> BT50Study:
    """Measure the virtual rig at all forces, identify, and predict the levels that were left out."""
    chosen = settings or BT50Settings()
    say = progress or (lambda _: None)
    holder = load_holder()
    axial: list[AxialLevel] = []
    radial: list[RadialLevel] = []
    for number, rig in enumerate(load_rig()):
        if round(rig.force_kn) % chosen.step_kn:
            continue
        say(f"{rig.force_kn:g} kN, {rig.motion}")
        seed = seed_of(chosen, number)
        if rig.motion == "axial":
            axial.append(measure_axial(holder, rig, seed, axial[-1].elastic.values if axial else None))
        else:
            radial.append(measure_radial(holder, rig, seed, radial[-1].elastic.values if radial else None))
    say("series, laws and predictions")
    series = _series(axial, radial)
    shown = int(np.argmin([abs(level.force_kn - _SHOWN_KN) for level in axial]))
    return BT50Study(
        settings=chosen,
        holder=holder,
        published=read_toml("bt50_holder.toml")["published"],
        axial=tuple(axial),
        radial=tuple(radial),
        series=series,
        bonded_hz={"axial": (axial_hz(holder, _bonded(holder)),), "radial": radial_hz(holder, *[_bonded(holder)] * 2)},
        left_out=(_left_out_axial(holder, axial, series), _left_out_radial(holder, radial, series)),
        damping_ignored=(
            _damping_ignored("axial", holder, axial[shown].elastic.values),
            _damping_ignored("radial", holder, radial[shown].elastic.values),
        ),
        diagnosed=tuple(
            diagnosed(motion, chosen, progress=lambda text: say(f"diagnosis: {text}")) for motion in _DIAGNOSED
        ),
    )


def _bonded(holder: Holder) -> float:
    return holder.bonded("axial").get("taper.k_y")


def _series(axial: Sequence[AxialLevel], radial: Sequence[RadialLevel]) -> dict[str, ForceSeries]:
    """Every parameter over force; where a model leaves more than the noise, standard errors are that much larger."""
    force = np.array([level.force_kn for level in axial])
    found: dict[str, tuple[list[float], list[float]]] = {}

    def add(name: str, value: float, error: float) -> None:
        own = found.setdefault(name, ([], []))
        own[0].append(value)
        own[1].append(error)

    for level in axial:
        for title, solution in (("rigid", level.rigid), ("half-power", level.rigid_half_power)):
            for name in ("k_z1", "c_z1"):
                low, high = solution.intervals[name]
                add(f"{title} {name}", getattr(solution.joint, name), (high - low) / (2.0 * 1.96))
        for name, value in level.elastic.values.items():
            add(f"elastic {name}", value, level.elastic.standard_errors[name] * max(level.elastic.rms, 1.0))
    for across in radial:
        for name, value in across.elastic.values.items():
            add(f"elastic {name}", value, across.elastic.standard_errors[name] * max(across.elastic.rms, 1.0))
    return {
        name: ForceSeries(name=name, force=force, values=np.array(values), standard_errors=np.array(errors))
        for name, (values, errors) in found.items()
    }


def _halves(series: ForceSeries) -> tuple[ForceSeries, NDArray[np.intp]]:
    """Every other level, and the numbers of those between."""
    kept = np.arange(0, series.force.size, 2)
    half = ForceSeries(
        name=series.name,
        force=series.force[kept],
        values=series.values[kept],
        standard_errors=series.standard_errors[kept],
    )
    return half, np.arange(1, series.force.size, 2)


def _left_out_axial(holder: Holder, levels: Sequence[AxialLevel], series: Mapping[str, ForceSeries]) -> LeftOut:
    errors = {}
    for model in ("rigid", "elastic"):
        half, between = _halves(series[f"{model} k_z1"])
        predicted = half.law.at(series[f"{model} k_z1"].force[between])
        errors[model] = tuple(
            (100.0 * (axial_hz(holder, float(k)) / levels[i].circle.frequency_hz - 1.0),)
            for i, k in zip(between, predicted, strict=True)
        )
    forces = tuple(levels[i].force_kn for i in between)
    return LeftOut(motion="axial", force_kn=forces, rigid_percent=errors["rigid"], elastic_percent=errors["elastic"])


def _left_out_radial(holder: Holder, levels: Sequence[RadialLevel], series: Mapping[str, ForceSeries]) -> LeftOut:
    laws = []
    for name in ("elastic k_x1", "elastic k_x2"):
        half, between = _halves(series[name])
        laws.append(half.law.at(series[name].force[between]))

    def errors(level: RadialLevel, predicted: Sequence[float]) -> tuple[float, ...]:
        return tuple(
            100.0 * (f / measured - 1.0) for f, measured in zip(predicted, level.modes.frequency_hz, strict=True)
        )

    # The rigid holder's springs of the level itself: the best that the paper's way can do there. A level at which no
    # rigid joint exists has none.
    chosen = [i for i in between if levels[i].simulated_hz]
    return LeftOut(
        motion="radial",
        force_kn=tuple(levels[i].force_kn for i in between),
        rigid_percent=tuple(errors(levels[i], levels[i].simulated_hz) for i in chosen),
        elastic_percent=tuple(
            errors(levels[i], radial_hz(holder, float(k1), float(k2))) for i, k1, k2 in zip(between, *laws, strict=True)
        ),
    )


def _damping_ignored(motion: str, holder: Holder, values: Mapping[str, float]) -> DampingIgnored:
    lines = np.arange(100.0, 8000.0, 5.0)
    found = []
    for factor in (1.0, 0.0):
        own: dict[str, float] = {name: value * (factor if name[0] == "c" else 1.0) for name, value in values.items()}
        if motion == "axial":
            assembly = holder.axial(own["k_z1"], own["c_z1"])
        else:
            assembly = holder.radial(own["k_x1"], own["k_x2"], own["c_x1"], own["c_x2"], contact=RADIAL_CONTACT)
        found.append(np.abs(assembly.receptance(lines)))
    differs = np.abs(found[1] / found[0] - 1.0) > _SAME
    edges = np.flatnonzero(np.diff(np.concatenate([[0], differs.astype(int), [0]])))
    bands = [(float(lines[a]), float(lines[b - 1])) for a, b in zip(edges[::2], edges[1::2], strict=True)]
    return DampingIgnored(
        motion=motion, frequency_hz=lines, damped=found[0], undamped=found[1], differs_hz=tuple(bands)
    )
