"""One drawbar force of the BT50 study: the procedure of the paper, and an elastic holder fitted to the FRF."""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

import receptance as rc
from receptance.coupling import (
    AxialSolution,
    Holder,
    RadialSolution,
    Shape,
    TaperFit,
    axial_from_mode,
    fit_taper,
    radial_from_modes,
)
from receptance.examples.virtual_rig import VirtualRig
from receptance.modal import ModeEstimate, circle_fit, fit_modes, half_power

BANDS_HZ = {"axial": (3000.0, 6200.0), "radial": (500.0, 6200.0)}


def half_power_of(frf: rc.FRF, low_hz: float, high_hz: float) -> ModeEstimate:
    """Return the mode from half-power points."""
    with warnings.catch_warnings():
        # The small number of lines in the half-power band is a result of the study.
        warnings.filterwarnings("ignore", ".*lines in the half-power band", rc.ReceptanceWarning)
        return half_power(frf, low_hz=low_hz, high_hz=high_hz)


def mode_values(mode: ModeEstimate) -> dict[str, Any]:
    """Return a mode with its standard errors."""
    names = ("frequency_hz", "frequency_standard_error_hz", "damping_ratio", "damping_standard_error", "lines_in_band")
    return {name: getattr(mode, name) for name in names}


def joint_values(solution: AxialSolution | RadialSolution, names: Sequence[str]) -> dict[str, Any]:
    """Return the joint of a rigid holder with its intervals."""
    joint = solution.joint if isinstance(solution, RadialSolution) else solution
    values = {name: getattr(joint, name) for name in names}
    return {"values": values, "intervals": {name: list(ends) for name, ends in solution.intervals.items()}}


def fit_values(fit: TaperFit) -> dict[str, Any]:
    """Return a fit with its intervals."""
    intervals = {name: list(ends) for name, ends in fit.intervals.items()}
    return {"values": dict(fit.values), "intervals": intervals, "rms": fit.rms, "errors": dict(fit.standard_errors)}


def axial_level(holder: Holder, rig: VirtualRig, seed: int, start: Mapping[str, float] | None) -> dict[str, Any]:
    """Identify one axial level.

    The first mode from half-power points, as in the paper, and from a circle; K_Z1 and C_Z1 of eqs. 14 and 15 from
    either; the elastic and the rigid holder fitted to the FRF, the first from the values of the level before.
    """
    plain, windowed, left_out = rig.measure(seed)
    low, high = BANDS_HZ["axial"]
    modes = {
        "half_power": half_power_of(plain, low, high),
        "circle": circle_fit(windowed, low_hz=low, high_hz=high),
    }
    rigid_half_power, rigid = (
        axial_from_mode(
            holder.body,
            mode.frequency_hz,
            mode.damping_ratio,
            frequency_standard_error_hz=mode.frequency_standard_error_hz,
            damping_standard_error=mode.damping_standard_error,
        )
        for mode in modes.values()
    )
    band: dict[str, Any] = {"motion": "axial", "low_hz": low, "high_hz": high}
    first = {"k_z1": rigid.k_z1, "c_z1": max(rigid.c_z1, 1.0)}
    elastic = fit_taper(holder, windowed, **band, start=start or first, left_out=left_out)
    names = ("k_z1", "c_z1")
    return {
        "force_kn": rig.force_kn,
        **{name: mode_values(mode) for name, mode in modes.items()},
        "rigid_half_power": joint_values(rigid_half_power, names),
        "rigid": joint_values(rigid, names),
        "rigid_rms": fit_taper(holder, windowed, body="rigid", contact="ends", **band, start=first).rms,
        "elastic": fit_values(elastic),
        "experiment_hz": modes["circle"].frequency_hz,
        "simulated_hz": axial_hz(holder, rigid.k_z1)[0],
        "elastic_hz": axial_hz(holder, elastic.values["k_z1"])[0],
        "truth": {"frequency_hz": float(rig.frequency_hz[0]), "damping_ratio": float(rig.damping_ratio[0])},
    }


def radial_level(holder: Holder, rig: VirtualRig, seed: int, start: Mapping[str, float] | None) -> dict[str, Any]:
    """Identify one radial level: both modes, the joints of the rigid holder, and the elastic holder's four values."""
    plain, windowed, left_out = rig.measure(seed)
    low, high = BANDS_HZ["radial"]
    modes = fit_modes(windowed.select(low_hz=low, high_hz=high), 2)
    # Ratio of the constants at both points for the one hit, with its standard error to first order.
    first, second = modes.modal_constant[:, 0, 0], modes.modal_constant[:, 1, 0]
    ratio = first / second
    errors = np.hypot(
        np.abs(modes.modal_constant_standard_error[:, 0, 0] / second),
        np.abs(modes.modal_constant_standard_error[:, 1, 0] * ratio / second),
    )
    points = [holder.body.position(float(coordinate.position)) for coordinate in rig.seen]
    rigid = radial_from_modes(
        holder.body,
        holder.z1,
        holder.z2,
        modes.frequency_hz,
        modes.damping_ratio,
        frequency_standard_error_hz=modes.frequency_standard_error_hz,
        damping_standard_error=modes.damping_standard_error,
        shape=Shape(
            first=points[0],
            second=points[1],
            ratio=(complex(ratio[0]), complex(ratio[1])),
            standard_error=(float(errors[0]), float(errors[1])),
        ),
    )
    names = ("k_x1", "k_x2", "c_x1", "c_x2")
    simulated: tuple[float, ...] = ()
    if rigid.nearest is not None:
        joint = rigid.solutions[rigid.nearest].joint
        simulated = radial_hz(holder, joint.k_x1, joint.k_x2)
        start = start or {name: max(getattr(joint, name), 1.0) for name in names}
    band: dict[str, Any] = {"motion": "bending", "low_hz": low, "high_hz": high}
    elastic = fit_taper(holder, windowed, contact="fading", **band, start=start, left_out=left_out)
    half_powers: list[dict[str, Any] | None] = []
    for frequency in modes.frequency_hz.tolist():
        try:
            mode = half_power_of(plain.select(responses=0), 0.8 * frequency, 1.2 * frequency)
            half_powers.append(mode_values(mode))
        except ValueError:  # no half-power points
            half_powers.append(None)
    return {
        "force_kn": rig.force_kn,
        "half_power": half_powers,
        "modes": [mode_values(modes.mode(i)) for i in range(len(modes.frequency_hz))],
        "rigid": {
            "statement": rigid.statement,
            "of_neither": rigid.of_neither,
            "discriminant": rigid.discriminant,
            "discriminant_standard_error": rigid.discriminant_standard_error,
            "nearest": rigid.nearest,
            "solutions": [
                {
                    **joint_values(solution, names),
                    "exact": solution.exact and {name: getattr(solution.exact, name) for name in names},
                    "notes": list(solution.notes),
                }
                for solution in rigid.solutions
            ],
        },
        "elastic": fit_values(elastic),
        "experiment_hz": modes.frequency_hz.tolist(),
        "simulated_hz": list(simulated),
        "elastic_hz": list(radial_hz(holder, elastic.values["k_x1"], elastic.values["k_x2"])),
        "truth": {"frequency_hz": rig.frequency_hz[:2].tolist(), "damping_ratio": rig.damping_ratio[:2].tolist()},
    }


def axial_hz(holder: Holder, k_z1: float) -> tuple[float, ...]:
    """Return the first mode of the elastic holder."""
    return tuple(holder.axial(k_z1).lowest_natural_frequencies(1)[0].tolist())


def radial_hz(holder: Holder, k_x1: float, k_x2: float) -> tuple[float, ...]:
    """Return the first two modes of the elastic holder."""
    return tuple(holder.radial(k_x1, k_x2, contact="fading").lowest_natural_frequencies(2)[0].tolist())
