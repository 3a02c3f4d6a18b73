"""Effects of the causes of a diagnosis on FRFs of one simulated assembly, computed with the library.

The pages of the causes show the figures and the look-alikes. They are made when the site is built and not kept in the
repository, so that they are those of the present library.
"""

from __future__ import annotations

import contextlib
import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cache

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from receptance import (
    CARBIDE,
    STEEL,
    Assembly,
    Coordinate,
    GroundSpring,
    ModalPart,
    Mode,
    Observation,
    Part,
    PointJoint,
    Segment,
    Unknown,
)
from receptance.diagnosis import CATALOGUE, Cause, Model, Variant
from receptance.diagnosis.fitting import Fit, refit
from receptance.diagnosis.model import UndecidableError
from receptance.diagnosis.screening import Direction, directions, look_alike
from receptance.diagnosis.thresholds import LARGE_SIZE
from receptance.fit import Tolerance
from receptance.fit.observation import altered
from receptance.fit.predictor import Predictor
from receptance.report.colours import COLOURS, INK, PALE
from receptance.report.figure import new_figure, set_up

__all__ = ["Effect", "effect", "figure", "look_alikes"]

OVERHANGS = (0.05, 0.07, 0.09)
SHOWN = 1
"""Number of the configuration whose FRF is drawn."""
LINES = np.arange(150.0, 6000.5, 10.0)
TIP = Coordinate("tool", 0.0)
JOINT = {"k_y": 6e8, "k_theta": 1e5, "c_y": 300.0, "c_theta": 1.0}
RANGE = 1e4
"""Bounds of the unknowns are the true values times and over this."""


def _unknowns(owner: str, values: dict[str, float]) -> tuple[Unknown, ...]:
    return tuple(
        Unknown(address=f"{owner}.{name}", lower=value / RANGE, upper=value * RANGE, start=value)
        for name, value in values.items()
    )


TOLERANCES = (
    Tolerance(name="carbide E", moves={"tool.segment[*].youngs_modulus": 0.005}, relative=True),
    Tolerance(name="carbide density", moves={"tool.segment[*].density": 0.003}, relative=True),
    Tolerance(name="blank", moves={"tool.segment[*].outer_diameter": 6e-6}),
)
NOISE = 0.01
TRUNCATED = 0.012
"""Time after the hit in s at which the truncated record ends."""
VARIANTS = {
    "joint_overhang_law": "tool.segment[0].length: k_theta",
    "joint_amplitude": "k_theta",
    "xy_asymmetry": "k_theta",
    "frequency_scale": "in accelerations",
    "suspension": "near 40 % of the holder, with a loss",
    "contact_distribution": "more at one end",
}
"""Variants that are shown instead of the first one."""
SIZES = {"joint_cross_term": 50.0, "holder_modulus": 5.0}
"""Sizes that are shown, in typical ones, where three of these have too little effect to be seen."""
PHASE = ("time_delay", "reversed_polarity")
"""Causes that change the phase and not the magnitude."""


def _tool(overhang: float) -> Part:
    return Part([Segment(length=overhang, outer_diameter=0.012, material=CARBIDE)], name="tool")


def _holder(diameter: float = 0.045) -> Part:
    return Part([Segment(length=0.13, outer_diameter=diameter, material=STEEL)], name="holder")


def _model(assemblies: dict[str, Assembly], conditions: dict[str, dict[str, float]] | None = None) -> Model:
    """Return a model of tip FRFs, whose data are ones; they differ by rounding, because equal data would be copies."""
    observations = tuple(
        Observation(
            assembly=assembly,
            frequency_hz=LINES,
            receptance=np.full(LINES.size, 1.0 + 1e-14 * number, dtype=complex),
            standard_deviation=NOISE,
            response=Coordinate(next(iter(assembly.elements)), 0.0),
            excitation=Coordinate(next(iter(assembly.elements)), 0.0),
            label=name,
            conditions=(conditions or {}).get(name, {}),
        )
        for number, (name, assembly) in enumerate(assemblies.items())
    )
    return Model(observations, _unknowns("joint", JOINT), TOLERANCES)


def _joint() -> PointJoint:
    return PointJoint(**JOINT, name="joint")


def _free() -> Model:
    return _model({f"{1e3 * x:.0f} mm": Assembly([_tool(x), _joint(), _holder()]) for x in OVERHANGS})


def _two(condition: str, values: dict[str, float]) -> Model:
    assembly = Assembly([_tool(OVERHANGS[SHOWN]), _joint(), _holder()])
    return _model(dict.fromkeys(values, assembly), {name: {condition: value} for name, value in values.items()})


def _rigid() -> Model:
    stiff = replace(STEEL, youngs_modulus=1e15)
    holder = Part([Segment(length=0.13, outer_diameter=0.03, material=stiff)], name="holder")
    return _model({f"{1e3 * x:.0f} mm": Assembly([_tool(x), _joint(), holder]) for x in OVERHANGS})


def _held() -> Model:
    """Return a holder on springs along a taper, which are the unknowns."""
    length = 0.08
    spring = GroundSpring(k_y=8e8, c_y=4e3, part="holder", position=0.1, length=length, points=12, name="taper")
    body = Part([Segment(length=0.1 + length, outer_diameter=0.05, material=STEEL)], name="holder")
    held = _model({"holder in its taper": Assembly([body], [spring])})
    return replace(held, unknowns=_unknowns("taper", {"k_y": 8e8, "c_y": 4e3}), tolerances=())


def _in_spindle() -> Model:
    spindle = ModalPart(
        modes=[
            Mode(frequency_hz=900.0, damping_ratio=0.04, y=0.25, theta=1.1),
            Mode(frequency_hz=2300.0, damping_ratio=0.03, y=0.4, theta=-5.0),
        ],
        residual_y=2e-9,
        residual_theta=4e-7,
        name="spindle",
    )
    return _model({f"{1e3 * x:.0f} mm": Assembly([_tool(x), _joint(), _holder(), spindle]) for x in OVERHANGS})


_SETUPS: dict[str, Callable[[], Model]] = {
    "joint_amplitude": lambda: _two("force", {"50 N": 50.0, "200 N": 200.0}),
    "xy_asymmetry": lambda: _two("plane", {"plane 1": 1.0, "plane 2": 2.0}),
    "flexible_body": _rigid,
    "contact_distribution": _held,
    "spindle_mode": _in_spindle,
}


def _calculated(model: Model, values: dict[str, float]) -> list[NDArray[np.complex128]]:
    """Return the responses of a model at values of its unknowns, the others at their starts."""
    unknowns = model.task.variables.unknowns
    numbers = np.array([values.get(one.name, one.start or 0.0) for one in unknowns])
    new = Predictor(model.task.parameters, numbers).of(model.observations, [model.tolerances] * len(model.observations))
    # A cause that changes the quantity of the data has changed the ones.
    return [own / one.receptance for own, one in zip(new.mean(), model.observations, strict=True)]


def _with_data(model: Model, data: list[NDArray[np.complex128]]) -> Model:
    pairs = zip(model.observations, data, strict=True)
    return replace(model, observations=tuple(altered(one, receptance=own) for one, own in pairs))


def _setup(cause: Cause) -> Callable[[], Model]:
    return _SETUPS.get(cause.id, _free)


def _truncated(model: Model) -> Model:
    return model.map(lambda one: altered(one, ends=TRUNCATED))


def _variant(cause: Cause, model: Model) -> Variant:
    if cause.id == "coarse_resolution":
        # The cause itself looks for the end of the records in measured data.
        return Variant("records end too early", _truncated).of(cause)
    variants = cause.variants(model)
    if cause.id == "missing_mode":
        return min(variants, key=lambda one: abs(float(one.name.split()[1]) - 1500.0))
    return next((one for one in variants if one.name == VARIANTS.get(cause.id)), variants[0])


@dataclass(frozen=True, eq=False)
class Effect:
    """A cause in data that are fitted without it.

    Attributes
    ----------
    variant : str
        The way in which the cause acts.
    sizes : dict of str to float
        Its parameters in SI units by their names.
    without, measured, fitted : list of ndarray
        Receptances of each configuration: of the model as stated, of the data, of the model after a fit to these.
    names : list of str
        The configurations.
    joint : dict of str to (float, float)
        Identified parameters: as in the data, and as fitted.
    strain : dict of str to float
        Errors of the tolerances after the fit, in standard deviations.
    """

    variant: str
    sizes: dict[str, float]
    without: list[NDArray[np.complex128]]
    measured: list[NDArray[np.complex128]]
    fitted: list[NDArray[np.complex128]]
    names: list[str]
    joint: dict[str, tuple[float, float]]
    strain: dict[str, float]


EFFECTS: dict[str, Effect] = {}
"""Effects that are known already, by cause."""


def effect(id: str) -> Effect:
    """Return the effect of a cause of three typical sizes."""
    if id not in EFFECTS:
        EFFECTS[id] = _effect(id)
    return EFFECTS[id]


def _effect(id: str) -> Effect:
    cause = CATALOGUE[id]
    model = _setup(cause)().with_witnesses()
    variant = _variant(cause, model)
    before = {one.name for one in model.unknowns}
    extended = variant.apply(model)
    added = [one for one in extended.unknowns if one.name not in before]
    times = SIZES.get(id, LARGE_SIZE)
    sizes = {one.name: min(max(one.parameter.at(times), one.lower), one.upper) for one in added}
    measured = _calculated(extended, sizes)
    fit = refit(_with_data(model, measured), {})
    return Effect(
        variant.name,
        {one.parameter.name: sizes[one.name] for one in added},
        _calculated(model, {}),
        measured,
        _calculated(model, fit.values),
        [one.label for one in model.observations],
        {one.name: (float(one.start or 0.0), fit.values[one.name]) for one in model.unknowns},
        {one.name: fit.values[one.name] for one in model.tolerances},
    )


def figure(id: str) -> Figure:
    """Return the FRF with and without a cause, and the difference that a fit of the joint leaves."""
    shown = effect(id)
    chosen = min(SHOWN, len(shown.names) - 1)
    drawn = new_figure(7.2, 4.6)
    top, bottom = drawn.subplots(2, 1, sharex=True, height_ratios=(3, 2))
    set_up(top, f"Receptance at the tip, {shown.names[chosen]}", "", "|receptance| [µm/N]")
    for values, style in (
        (shown.without[chosen], {"color": PALE, "linewidth": 2.5, "label": "model as stated"}),
        (shown.measured[chosen], {"color": COLOURS[1], "linewidth": 1.4, "label": "data with the cause"}),
        (shown.fitted[chosen], {"color": INK, "linewidth": 1.0, "linestyle": "--", "label": "model fitted to them"}),
    ):
        top.semilogy(LINES, 1e6 * abs(values), **style)
    top.legend(frameon=False, fontsize=8, loc="best")
    if id in PHASE:
        set_up(bottom, "What the fit leaves: difference of phase", "frequency [Hz]", "[degrees]")
    else:
        set_up(bottom, "What the fit leaves: measured over fitted magnitude", "frequency [Hz]", "[dB]")
    for name, measured, fitted, colour in zip(shown.names, shown.measured, shown.fitted, COLOURS, strict=False):
        ratio = measured / fitted
        left = np.degrees(np.angle(ratio)) if id in PHASE else 20.0 * np.log10(abs(ratio))
        bottom.plot(LINES, left, color=colour, linewidth=1.1, label=name)
    bottom.legend(frameon=False, fontsize=8, ncols=3, loc="best")
    return drawn


@cache
def look_alikes(id: str) -> dict[str, float]:
    """Return how similar the effects of other causes are, to first order and after a fit of the joint, largest first.

    The number is the cosine between the effects: 1 is the same effect, 0 is none in common.
    """
    cause = CATALOGUE[id]
    base, every = _directions(_setup(cause))
    shown = _variant(cause, base.model)
    found: dict[str, float] = {}
    for own in every:
        if own.variant == shown:
            for one in every:
                if one.cause.id != id:
                    found[one.cause.id] = max(found.get(one.cause.id, 0.0), look_alike(own, one))
    return dict(sorted(((name, x) for name, x in found.items() if not math.isnan(x)), key=lambda pair: -pair[1]))


@cache
def _directions(setup: Callable[[], Model]) -> tuple[Fit, list[Direction]]:
    """Return the fit of a model to its own responses, and the effects of all variants of all causes on it."""
    model = setup()
    fit = refit(_with_data(model, _calculated(model, {})).with_witnesses(), {})
    extensions: list[tuple[Variant, Model]] = []
    for cause in CATALOGUE.values():
        # Not those that do not apply to the model.
        with contextlib.suppress(UndecidableError):
            extensions += cause.extensions(fit.model)
    return fit, directions(fit, extensions)
