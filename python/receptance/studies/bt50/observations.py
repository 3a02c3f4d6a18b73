"""The study's measurements as observations of one model, for whatever explains them together."""

from __future__ import annotations

from typing import Any

import numpy as np

from receptance.identification import MeasuredFRF
from receptance.identification.floor import Floor
from receptance.studies.bt50.levels import AXIAL_BAND_HZ, RADIAL_BAND_HZ, RADIAL_CONTACT
from receptance.studies.bt50.rig import Motion, VirtualRig, load_holder, load_rig
from receptance.studies.bt50.settings import BT50Settings
from receptance.taper.holder import BodyModel

__all__ = ["observations", "seed_of"]


def seed_of(settings: BT50Settings, number: int) -> int:
    """Seed of a measurement: hits of one level are not those of another, nor of the other motion."""
    return int(np.random.SeedSequence([settings.seed, number]).generate_state(1)[0])


def observations(
    motion: Motion,
    settings: BT50Settings | None = None,
    *,
    body: BodyModel = "rigid",
    floor: float | Floor = 0.0,
) -> tuple[MeasuredFRF, ...]:
    """Return the virtual FRFs of all force levels, windowed, each as an observation of a holder in its taper.

    Parameters
    ----------
    motion : {"axial", "radial"}
        Along or across.
    settings : BT50Settings, optional
        The same settings give the same measurements as in `run`.
    body : {"rigid", "elastic"}, optional
        Model that they are observations of: with "rigid" the paper's, across with springs lumped at the ends. Along,
        it makes no difference where on a rigid holder the spring is, so that it lies along the taper.
    floor : float or Floor, optional
        As in `MeasuredFRF.from_frf`; for a diagnosis `Floor()`.

    Returns
    -------
    tuple of MeasuredFRF
        One for each level and place; the configuration is the level, the condition "drawbar force" is in N.

    Examples
    --------
    >>> from receptance.studies.bt50 import BT50Settings, observations
    >>> found = observations("axial", BT50Settings(step_kn=2))
    >>> len(found), found[-1].configuration, found[-1].conditions
    (13, '24 kN', {'drawbar force': 24000.0})
    """
    chosen = settings or BT50Settings()
    holder = load_holder()
    springs: dict[str, Any] = {"body": body}
    if motion == "axial":
        springs["contact"] = "spread"
        assembly, band = holder.axial(5e9, 1e3, **springs), AXIAL_BAND_HZ
    else:
        springs["contact"] = "ends" if body == "rigid" else RADIAL_CONTACT
        assembly, band = holder.radial(1e9, 1e9, 5e3, 5e3, **springs), RADIAL_BAND_HZ
    found = []
    for number, rig in _levels(motion, chosen):
        frf = rig.windowed(seed_of(chosen, number))
        for i in range(len(rig.seen)):
            found.append(
                MeasuredFRF.from_frf(
                    assembly,
                    frf.select(responses=i),
                    low_hz=band[0],
                    high_hz=band[1],
                    configuration=f"{rig.force_kn:g} kN",
                    conditions={"drawbar force": 1e3 * rig.force_kn},
                    floor=floor,
                )
            )
    return tuple(found)


def _levels(motion: Motion, settings: BT50Settings) -> list[tuple[int, VirtualRig]]:
    rigs = enumerate(load_rig())
    return [(n, rig) for n, rig in rigs if rig.motion == motion and round(rig.force_kn) % settings.step_kn == 0]
