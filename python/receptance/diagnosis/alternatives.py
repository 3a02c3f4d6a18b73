"""Alternatives: changes of the model that are not causes, fitted beside the causes before one is named.

A wrong cause may absorb most of an effect that the catalogue does not have. The best explanation is therefore compared
with simple changes elsewhere: a mass, a softer place, another section, a taper, a resonator. They show where the model
is wrong, not why, and are never reported as causes.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import partial

from receptance.diagnosis.boundary_causes import RESONATOR_PARAMETERS, resonances
from receptance.diagnosis.causes import Cause, Parameter, Variant
from receptance.diagnosis.model import Model, UndecidableError, with_points
from receptance.diagnosis.thresholds import ALTERNATIVE_PLACES, SOFT_LENGTH, TAPER_CYLINDERS
from receptance.model.assembly import Assembly
from receptance.model.beams import Part
from receptance.model.joints import PointMass


def _holders(model: Model) -> tuple[str, ...]:
    holders = {anatomy.holder for anatomy in model.anatomies}
    return holders.pop() if len(holders) == 1 else ()


def _position(part: Part, share: float, beyond: float = 0.0) -> float:
    """Return the position in m at a share of the length of a part, and a distance beyond it."""
    return share * part.length + beyond


def _mass(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    places = [(model.tip, share) for share in ALTERNATIVE_PLACES]
    places += [(name, share) for name in _holders(model) for share in (0.0, *ALTERNATIVE_PLACES)]
    for name, share in places:
        where = f"at {100.0 * share:.0f} % of {name}"
        yield Variant(where, partial(_add_mass, name, share, p["mass"]))
        yield Variant(f"{where}, with inertia", partial(_add_mass, name, share, p["mass"], inertia=p["inertia"]))


def _add_mass(part: str, share: float, mass: Parameter, model: Model, inertia: Parameter | None = None) -> Model:
    changed = model.with_change(_attach_mass, part, share).plus(mass.unknown("alternative_mass.mass"))
    return changed if inertia is None else changed.plus(inertia.unknown("alternative_mass.inertia"))


def _attach_mass(model: Model, name: str, share: float) -> Model:
    return model.rebuild(partial(_with_mass, name, share))


def _with_mass(name: str, share: float, assembly: Assembly) -> Assembly:
    part = assembly.elements.get(name)
    if not isinstance(part, Part):
        return assembly
    mass = PointMass(mass=0.0, part=name, position=_position(part, share), name="alternative_mass")
    return with_points(assembly, mass)


def _section(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    found = {
        f"{name}.segment[{index}].outer_diameter"
        for observation in model.observations
        for name, part in observation.assembly.elements.items()
        if isinstance(part, Part)
        for index in range(len(part.segments))
    }
    for address in sorted(found):
        if not model.has(address):
            name = f"of {address.removesuffix('.outer_diameter')}"
            yield Variant(name, partial(_move_diameters, p["log_diameter"], {address: 1.0}))


def _move_diameters(diameter: Parameter, moves: Mapping[str, float], model: Model) -> Model:
    return model.plus(diameter.move(moves, relative=True))


def _taper(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    yield Variant(f"of {model.tip}", partial(_make_conical, p["log_diameter"]))


def _make_conical(diameter: Parameter, model: Model) -> Model:
    tip = model.tip
    if any(len(part.segments) != 1 for part in model.parts(tip)):
        raise UndecidableError("the tool has steps")
    for i in range(TAPER_CYLINDERS - 1):
        model, _ = model.split(tip, partial(_position, share=(i + 1) / TAPER_CYLINDERS))
    # The change of the diameter decreases from the tip to zero at the holder.
    weights = {f"{tip}.segment[{i}].outer_diameter": 1.0 - (i + 0.5) / TAPER_CYLINDERS for i in range(TAPER_CYLINDERS)}
    return _move_diameters(diameter, weights, model)


def _soft_section(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    for share in ALTERNATIVE_PLACES:
        yield Variant(f"at {100.0 * share:.0f} % of {model.tip}", partial(_soften, share, p["log_diameter"]))


def _soften(share: float, diameter: Parameter, model: Model) -> Model:
    tip = model.tip
    started, _ = model.split(tip, partial(_position, share=share))
    ended, index = started.split(tip, partial(_position, share=share, beyond=SOFT_LENGTH))
    return _move_diameters(diameter, {f"{tip}.segment[{index - 1}].outer_diameter": 1.0}, ended)


def _resonator(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    yield from resonances(p, model, _tip, f"on the tip of {model.tip}")


def _tip(model: Model) -> tuple[str, float]:
    return model.tip, 0.0


def _alternative(id: str, change: Callable[..., Iterator[Variant]], *parameters: Parameter, meaning: str) -> Cause:
    remedy = "inspect the place: a mass, a crack, a dimension, a loose part"
    return Cause(id=id, group="structure", parameters=parameters, change=change, meaning=meaning, remedy=remedy)


def _diameter(lower: float, upper: float, typical: float) -> Parameter:
    return Parameter(name="log_diameter", unit="", lower=lower, upper=upper, typical=typical)


ALTERNATIVES = (
    _alternative(
        "mass_somewhere",
        _mass,
        Parameter(name="mass", unit="kg", lower=0.0, upper=2.0, typical=0.005),
        Parameter(name="inertia", unit="kg m2", lower=0.0, upper=1e-2, typical=1e-6),
        meaning="a mass",
    ),
    _alternative("other_section", _section, _diameter(-0.4, 0.4, 0.02), meaning="another diameter"),
    _alternative("cone", _taper, _diameter(-0.4, 0.4, 0.02), meaning="a taper"),
    _alternative("soft_place", _soft_section, _diameter(-2.0, 0.0, -0.2), meaning="a place with more bending"),
    _alternative(
        "body_on_the_tip",
        _resonator,
        # At the tip a resonator of a milligram is not negligible.
        Parameter(name="mass", unit="kg", lower=1e-8, upper=1.0, typical=1e-3, null=1e-8),
        *RESONATOR_PARAMETERS[1:],
        meaning="a mass on a spring",
    ),
)
"""Changes that are fitted beside the causes and never reported as causes."""
