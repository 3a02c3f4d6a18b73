"""One level of drawbar force: the paper's procedure beside better estimators and the elastic model."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from receptance.errors import ReceptanceWarning
from receptance.modal import circle_fit, fit_modes, half_power
from receptance.taper import (
    Holder,
    RadialSolutions,
    Shape,
    TaperFit,
    axial_from_mode,
    fit_axial,
    fit_radial,
    radial_from_modes,
)

if TYPE_CHECKING:
    from receptance.frf import FRF
    from receptance.modal import ModalFit, ModeEstimate
    from receptance.studies.bt50.rig import VirtualRig
    from receptance.taper import AxialSolution
    from receptance.taper.holder import Contact

__all__ = ["AxialLevel", "RadialLevel", "measure_axial", "measure_radial"]

AXIAL_BAND_HZ = (3000.0, 6200.0)
RADIAL_BAND_HZ = (500.0, 6200.0)
RADIAL_CONTACT: Contact = "fading"
_MODE_SHARE = 0.2
"""Of a frequency: how far its band reaches."""


@dataclass(frozen=True, kw_only=True)
class AxialLevel:
    """Axially, at one force.

    Attributes
    ----------
    force_kn : float
        Drawbar force.
    half_power, circle : ModeEstimate
        The first mode as the paper estimates it, and from a circle.
    rigid_half_power, rigid : AxialSolution
        K_Z1 and C_Z1 of eqs. 14 and 15 from one and from the other.
    elastic : TaperFit
        Both from the FRF with the elastic holder.
    rigid_rms : float
        What is left when the rigid holder is fitted to the same FRF, in standard deviations.
    simulated_hz, elastic_hz : float
        First mode of the elastic holder with the rigid holder's K_Z1 (the paper's simulation), and with its own.
    true_frequency_hz, true_damping_ratio : float
        Of the virtual rig.
    """

    force_kn: float
    half_power: ModeEstimate
    circle: ModeEstimate
    rigid_half_power: AxialSolution
    rigid: AxialSolution
    elastic: TaperFit
    rigid_rms: float
    simulated_hz: float
    elastic_hz: float
    true_frequency_hz: float
    true_damping_ratio: float


@dataclass(frozen=True, kw_only=True)
class RadialLevel:
    """Across, at one force.

    Attributes
    ----------
    force_kn : float
        Drawbar force.
    half_power : tuple of ModeEstimate or None
        Both modes as the paper estimates them; None where the half-power points cannot be found.
    modes : ModalFit
        Both modes at both points.
    solutions : RadialSolutions
        The rigid holder's joints, and what the mode shape says of them.
    elastic : TaperFit
        All four parameters from both FRFs with the elastic holder.
    simulated_hz, elastic_hz : tuple of float
        Both modes of the elastic holder with the stiffnesses of the rigid one (of the solution nearest to the mode
        shape), and with its own.
    true_frequency_hz, true_damping_ratio : tuple of float
        Of the virtual rig.
    """

    force_kn: float
    half_power: tuple[ModeEstimate | None, ...]
    modes: ModalFit
    solutions: RadialSolutions
    elastic: TaperFit
    simulated_hz: tuple[float, ...]
    elastic_hz: tuple[float, ...]
    true_frequency_hz: tuple[float, ...]
    true_damping_ratio: tuple[float, ...]


def measure_axial(holder: Holder, rig: VirtualRig, seed: int, start: Mapping[str, float] | None) -> AxialLevel:
    """Measure and identify one level; `start` is where the elastic fit starts, the level before say."""
    plain, windowed, left_out = rig.measure(seed)
    low, high = AXIAL_BAND_HZ
    as_published = _quiet(half_power, plain, low, high)
    circle = circle_fit(windowed, low_hz=low, high_hz=high)
    solutions = [
        axial_from_mode(
            holder.body,
            mode.frequency_hz,
            mode.damping_ratio,
            frequency_standard_error_hz=mode.frequency_standard_error_hz,
            damping_standard_error=mode.damping_standard_error,
        )
        for mode in (as_published, circle)
    ]
    rigid = solutions[1].joint
    first = {"k_z1": rigid.k_z1, "c_z1": max(rigid.c_z1, 1.0)}
    elastic = fit_axial(holder, windowed, low_hz=low, high_hz=high, start=start or first, left_out=left_out)
    rigid_fit = fit_axial(holder, windowed, body="rigid", contact="ends", low_hz=low, high_hz=high, start=first)
    return AxialLevel(
        force_kn=rig.force_kn,
        half_power=as_published,
        circle=circle,
        rigid_half_power=solutions[0],
        rigid=solutions[1],
        elastic=elastic,
        rigid_rms=rigid_fit.rms,
        simulated_hz=axial_hz(holder, rigid.k_z1),
        elastic_hz=axial_hz(holder, elastic.values["k_z1"]),
        true_frequency_hz=float(rig.frequency_hz[0]),
        true_damping_ratio=float(rig.damping_ratio[0]),
    )


def measure_radial(holder: Holder, rig: VirtualRig, seed: int, start: Mapping[str, float] | None) -> RadialLevel:
    """Measure and identify one level; as `measure_axial`."""
    plain, windowed, left_out = rig.measure(seed)
    low, high = RADIAL_BAND_HZ
    modes = fit_modes(windowed.select(low_hz=low, high_hz=high), 2)
    # The ratio of both points' constants for the one hit, with its scatter to first order.
    first, second = modes.modal_constant[:, 0, 0], modes.modal_constant[:, 1, 0]
    ratio = first / second
    errors = np.hypot(
        np.abs(modes.modal_constant_standard_error[:, 0, 0] / second),
        np.abs(modes.modal_constant_standard_error[:, 1, 0] * ratio / second),
    )
    places = [holder.body.position(float(one.position)) for one in rig.seen]
    solutions = radial_from_modes(
        holder.body,
        holder.z1,
        holder.z2,
        modes.frequency_hz,
        modes.damping_ratio,
        frequency_standard_error_hz=modes.frequency_standard_error_hz,
        damping_standard_error=modes.damping_standard_error,
        shape=Shape(
            first=places[0],
            second=places[1],
            ratio=(complex(ratio[0]), complex(ratio[1])),
            standard_error=(float(errors[0]), float(errors[1])),
        ),
    )
    if start is None and solutions.nearest is not None:
        rigid = solutions.solutions[solutions.nearest].joint
        start = {name: max(getattr(rigid, name), 1.0) for name in ("k_x1", "k_x2", "c_x1", "c_x2")}
    elastic = fit_radial(
        holder, windowed, contact=RADIAL_CONTACT, low_hz=low, high_hz=high, start=start, left_out=left_out
    )
    simulated: tuple[float, ...] = ()
    if solutions.nearest is not None:
        joint = solutions.solutions[solutions.nearest].joint
        simulated = radial_hz(holder, joint.k_x1, joint.k_x2)
    found = []
    for frequency in modes.frequency_hz:
        reach = _MODE_SHARE * float(frequency)
        try:
            found.append(_quiet(half_power, plain.select(responses=0), frequency - reach, frequency + reach))
        except ValueError:
            found.append(None)
    return RadialLevel(
        force_kn=rig.force_kn,
        half_power=tuple(found),
        modes=modes,
        solutions=solutions,
        elastic=elastic,
        simulated_hz=simulated,
        elastic_hz=radial_hz(holder, elastic.values["k_x1"], elastic.values["k_x2"]),
        true_frequency_hz=tuple(rig.frequency_hz[:2].tolist()),
        true_damping_ratio=tuple(rig.damping_ratio[:2].tolist()),
    )


def axial_hz(holder: Holder, k_z1: float) -> float:
    """First mode of the elastic holder."""
    return float(holder.axial(k_z1).lowest_natural_frequencies(1)[0][0])


def radial_hz(holder: Holder, k_x1: float, k_x2: float) -> tuple[float, ...]:
    """First two modes of the elastic holder."""
    return tuple(holder.radial(k_x1, k_x2, contact=RADIAL_CONTACT).lowest_natural_frequencies(2)[0].tolist())


def _quiet(estimate: Any, frf: FRF, low_hz: float, high_hz: float) -> Any:
    with warnings.catch_warnings():
        # That there are few lines in the half-power band is what the study is about; it says so itself.
        warnings.filterwarnings("ignore", ".*lines in the half-power band", ReceptanceWarning)
        return estimate(frf, low_hz=low_hz, high_hz=high_hz)
