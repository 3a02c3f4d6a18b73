"""Materials that tools are made of, and the cause that a tool is of another one than the model says."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

from receptance.diagnosis.causes import Cause, Parameter, UndecidableError, Variant
from receptance.diagnosis.model import Model
from receptance.diagnosis.part_causes import RIGID, everywhere
from receptance.identification.unknowns import Prior

__all__ = ["TOOL_MATERIALS", "ToolMaterial", "tool_material"]

_DEVIATIONS = 4.0
"""Values up to this many standard deviations from a material's are taken as plausible."""
_ORDINARY = {"log_modulus": 0.15, "log_density": 0.1}
"""Up to these logarithms it is another modulus or another density of the stated material: causes of their own."""
_LARGE = 3.0
"""Fits start at so many typical sizes from null."""


@dataclass(frozen=True)
class ToolMaterial:
    """A class of materials: typical values, and how far its grades scatter about them.

    Attributes
    ----------
    name : str
        For people.
    youngs_modulus, density, poisson_ratio : float
        Typical values, the first two in Pa and kg/m3.
    modulus_scatter, density_scatter : float
        Standard deviations of their natural logarithms over the grades of the class.
    """

    name: str
    youngs_modulus: float
    density: float
    poisson_ratio: float
    modulus_scatter: float
    density_scatter: float


TOOL_MATERIALS = (
    ToolMaterial("steel", 215e9, 7950.0, 0.3, 0.04, 0.02),
    ToolMaterial("cemented carbide", 595e9, 14500.0, 0.22, 0.045, 0.018),
    ToolMaterial("tungsten heavy alloy", 360e9, 17700.0, 0.28, 0.05, 0.025),
    ToolMaterial("aluminium", 70e9, 2740.0, 0.33, 0.03, 0.02),
)
"""What tools, boring bars and dummies are made of.

steel
    210 GPa and a ratio of 0.3 (EN 1993-1-1, 3.2.6), 7850 kg/m3 (EN 1991-1-1, table A.4); high-speed steels have
    215 to 230 GPa and 8000 to 8300 kg/m3 (ISO 4957 grades HS6-5-2 and the like, makers' data sheets).
cemented carbide
    WC with 4 to 15 % Co: 540 to 650 GPa and 13 900 to 15 000 kg/m3 (Brookes, World Directory and Handbook of
    Hardmetals; makers' tables).
tungsten heavy alloy
    W with Ni, Fe or Cu, classes 1 to 4 of ASTM B777: 330 to 390 GPa and 17 000 to 18 500 kg/m3 (makers' data sheets,
    for example Plansee Densimet D170 to D185); for boring bars.
aluminium
    70 GPa and 2700 kg/m3 (EN 1999-1-1, 3.2.5), alloys to 73 GPa and 2850 kg/m3; for dummies and test pieces.
"""


def _another(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    addresses = {field: everywhere(model, "tool", field) for field in ("youngs_modulus", "density", "poisson_ratio")}
    if any(model.has(address) for own in addresses.values() for address in own):
        raise UndecidableError("modulus or density of the tool is an unknown of the model already")
    parts = dict.fromkeys(name for anatomy in model.anatomies for name in anatomy.tool)
    stated = {
        (segment.material.youngs_modulus, segment.material.density, segment.material.poisson_ratio)
        for one in model.observations
        for name in parts
        if name in one.assembly.elements
        for segment in one.assembly.elements[name].segments  # type: ignore[union-attr]
    }
    if len(stated) > 1:
        raise UndecidableError("the tool is made of several materials")
    ((modulus, density, ratio),) = stated
    if modulus > RIGID:
        raise UndecidableError("the tool is described as rigid; the cause flexible_body gives it a modulus")
    for material in TOOL_MATERIALS:
        wanted = {
            "log_modulus": (math.log(material.youngs_modulus / modulus), material.modulus_scatter),
            "log_density": (math.log(material.density / density), material.density_scatter),
        }
        if all(abs(wanted[name][0]) <= most for name, most in _ORDINARY.items()):
            continue  # the stated material itself, or so near to it that it is another modulus or another density
        own = {name: _towards(p[name], *wanted[name]) for name in wanted}
        moves = {
            "log_modulus": dict.fromkeys(addresses["youngs_modulus"], 1.0),
            "log_density": dict.fromkeys(addresses["density"], 1.0),
        }
        # Poisson's ratio goes along with what changes most, and is that of the material where this is.
        leading = max(wanted, key=lambda name: abs(wanted[name][0]))
        if ratio > 0.0:
            share = math.log(material.poisson_ratio / ratio) / wanted[leading][0]
            moves[leading] |= dict.fromkeys(addresses["poisson_ratio"], share)
        moved = (own[name].move(moves[name], relative=True) for name in wanted)
        yield Variant(
            material.name,
            model.plus(*moved),
            limited=tuple(own.values()),
            distant=True,
            meaning=f"the tool is of {material.name}, and the model has a material with {1e-9 * modulus:.0f} GPa and "
            f"{density:.0f} kg/m3",
            remedy=f"weigh the tool; if it is of {material.name}, give it that material in the model",
        )


def _towards(parameter: Parameter, target: float, scatter: float) -> Parameter:
    """Return a parameter whose prior is a material's value; fits start at null and there."""
    reach = _DEVIATIONS * scatter
    return replace(
        parameter,
        lower=min(0.0, target - reach),
        upper=max(0.0, target + reach),
        typical=target / _LARGE,
        plausible=(target - reach, target + reach),
        prior=Prior(mean=target, standard_deviation=scatter),
    )


tool_material = Cause(
    id="tool_material",
    group="structure",
    parameters=tuple(Parameter(name=name, unit="", lower=-3.0, upper=3.0, typical=0.3) for name in _ORDINARY),
    change=_another,
    meaning="the tool is of another material than the model says",
    remedy="weigh the tool: its density tells the materials apart",
)
