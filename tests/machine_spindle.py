"""A spindle made of a shaft on bearings, and blanks measured in it, for the tests of its identification."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from receptance import STEEL, Assembly, Coordinate, GroundSpring, MeasuredPart, Observation, Part, PointJoint, Segment

LOSSY = replace(STEEL, loss_factor=0.002)
LINES = np.arange(100.0, 4000.0, 5.0)


def make_spindle(front: float = 3e8) -> Assembly:
    """Return nose, drawbar joint and shaft on two bearings."""
    nose = Part([Segment(length=0.004, outer_diameter=0.06, material=LOSSY)], name="nose")
    taper = PointJoint(k_y=1.5e9, k_theta=2e6, loss_factor=0.02, name="taper")
    bores = [
        Segment(length=length, outer_diameter=outer, inner_diameter=0.03, material=LOSSY)
        for length, outer in ((0.06, 0.085), (0.30, 0.07))
    ]
    bearings = [
        GroundSpring(k_y=front, k_theta=5e4, c_y=3e3, part="shaft", position=0.06, name="front"),
        GroundSpring(k_y=2e8, c_y=4e3, part="shaft", position=0.32, name="rear"),
    ]
    return Assembly([nose, taper, Part(bores, name="shaft")], bearings)


def seen_at_the_plane(spindle: Assembly, lines: np.ndarray = LINES) -> np.ndarray:
    """Return the spindle's own receptance over (y, theta)."""
    plane = [Coordinate("nose", 0.0, "y"), Coordinate("nose", 0.0, "theta")]
    return spindle.receptance(lines, response=plane, excitation=plane)


def with_spindle(blank: Assembly, spindle: Assembly) -> Assembly:
    """Return a blank in the spindle, as beams, independent of the tested code."""
    chain = [*blank.elements.values(), *spindle.elements.values()]
    named = [replace(one, name=name) for name, one in spindle.attachments.items()]
    return Assembly(chain, [*blank.attachments.values(), *named])


def make_blank(length: float = 0.1, diameter: float = 0.05) -> Assembly:
    """Return a cylinder."""
    return Assembly([Part([Segment(length=length, outer_diameter=diameter, material=STEEL)], name="blank")])


def measure(
    blank: Assembly,
    response: float,
    excitation: float,
    *,
    sd: float,
    rng: np.random.Generator | None = None,
    spindle: Assembly | None = None,
    described: Assembly | None = None,
    lines: np.ndarray = LINES,
) -> Observation:
    """Return one response in the spindle, with noise where there is a source of it."""
    places = {"response": Coordinate("blank", response), "excitation": Coordinate("blank", excitation)}
    h = with_spindle(blank, spindle or make_spindle()).receptance(lines, **places)
    if rng is not None:
        h = h * np.exp(sd * (rng.normal(size=h.size) + 1j * rng.normal(size=h.size)))
    return Observation(
        assembly=described or blank,
        frequency_hz=lines,
        receptance=h,
        standard_deviation=sd,
        label=f"{blank.get('blank.segment[0].length'):g} m, {response:g} from {excitation:g}",
        **places,
    )


def at_two_places(blank: Assembly, near: float, **how: object) -> list[Observation]:
    """Return both drive points and the cross receptance of the tip and a place near the spindle."""
    return [measure(blank, a, b, **how) for a, b in ((0.0, 0.0), (near, 0.0), (near, near))]  # type: ignore[arg-type]


def as_table(spindle: Assembly, lines: np.ndarray = LINES) -> MeasuredPart:
    """Return the true spindle as a table."""
    return MeasuredPart(frequency_hz=lines, matrix=seen_at_the_plane(spindle, lines), name="spindle")
