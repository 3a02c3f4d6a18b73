"""Causes that lie in the spindle, where the model ends with its modes."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

from receptance.diagnosis.causes import Cause, Parameter, UndecidableError, Variant
from receptance.diagnosis.model import Model
from receptance.modal_parts import ModalPart

__all__ = ["SPINDLE_CAUSES"]

_SHAPE = ("y", "theta", "y_imaginary", "theta_imaginary")


def _mode(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    ends = {
        (name, one)
        for observation in model.observations
        for name, one in observation.assembly.elements.items()
        if isinstance(one, ModalPart)
    }
    if not ends:
        raise UndecidableError("the model does not end with a spindle that is known by its modes")
    if len(ends) > 1:
        raise UndecidableError("the assemblies end with different spindles")
    name, spindle = ends.pop()
    low = min(float(one.frequency_hz[0].real) for one in model.observations)
    high = max(float(one.frequency_hz[-1].real) for one in model.observations)
    for index, mode in enumerate(spindle.modes):
        own = f"{name}.mode[{index}]"
        if not low <= mode.frequency_hz <= high or model.has(f"{own}.frequency_hz"):
            continue
        frequency = p["log_frequency"].move({f"{own}.frequency_hz": 1.0}, relative=True)
        damping = p["log_damping"].move({f"{own}.damping_ratio": 1.0}, relative=True)
        size = p["log_shape"].move({f"{own}.{quantity}": 1.0 for quantity in _SHAPE}, relative=True)
        yield Variant(f"mode at {mode.frequency_hz:.0f} Hz", model.plus(frequency, damping, size))


SPINDLE_CAUSES = (
    Cause(
        id="spindle_mode",
        group="structure",
        parameters=(
            Parameter(name="log_frequency", unit="", lower=-0.2, upper=0.2, typical=0.02, plausible=(-0.15, 0.15)),
            Parameter(name="log_damping", unit="", lower=-2.0, upper=2.0, typical=0.2, plausible=(-1.5, 1.5)),
            Parameter(name="log_shape", unit="", lower=-1.0, upper=1.0, typical=0.05, plausible=(-0.7, 0.7)),
        ),
        change=_mode,
        meaning="a mode of the spindle is not where, or not as large or as damped, as it was identified",
        remedy="identify the spindle again, at the temperature and with the preload at which the tool was measured",
    ),
)
