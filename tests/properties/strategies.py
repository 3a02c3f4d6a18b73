"""Hypothesis strategies: ordinary materials, parts and joints of machine tools, as the library's own objects."""

from __future__ import annotations

import numpy as np
from hypothesis import strategies as st

from receptance import Assembly, Coordinate, GroundSpring, Material, Part, PointJoint, PointMass, Segment


def logarithmic(low: float, high: float) -> st.SearchStrategy[float]:
    """Return numbers spread evenly over their logarithm."""
    return st.floats(np.log(low), np.log(high)).map(lambda x: float(np.exp(x)))


def materials(*, lossy: bool | None = None) -> st.SearchStrategy[Material]:
    """Return metals and some softer and lighter things."""
    losses = {True: logarithmic(1e-4, 0.05), False: st.just(0.0), None: st.just(0.0) | logarithmic(1e-4, 0.05)}[lossy]
    return st.builds(
        Material,
        youngs_modulus=logarithmic(1e9, 7e11),
        density=logarithmic(1e3, 1.6e4),
        poisson_ratio=st.floats(0.1, 0.45),
        loss_factor=losses,
    )


@st.composite
def segments(draw: st.DrawFn, *, lossy: bool | None = None) -> Segment:
    """Draw a segment, solid, hollow or filled."""
    outer = draw(logarithmic(4e-3, 0.08))
    hollow = draw(st.booleans())
    inner = outer * draw(st.floats(0.1, 0.9)) if hollow else 0.0
    core = draw(st.none() | materials(lossy=lossy)) if hollow else None
    return Segment(
        length=draw(logarithmic(2e-3, 0.2)),
        outer_diameter=outer,
        inner_diameter=inner,
        material=draw(materials(lossy=lossy)),
        core=core,
        shear=draw(st.sampled_from(["cowper", "hutchinson"])),
    )


def parts(*, lossy: bool | None = None, most: int = 4, name: str = "") -> st.SearchStrategy[Part]:
    """Return parts of a few segments."""
    return st.lists(segments(lossy=lossy), min_size=1, max_size=most).map(lambda found: Part(found, name=name))


@st.composite
def springs(draw: st.DrawFn, *, damped: bool | None = None) -> dict[str, float]:
    """Draw the seven numbers of a joint, stiff enough to hold and with both matrices definite."""
    k_y = draw(logarithmic(1e6, 1e10))
    k_theta = k_y * draw(logarithmic(3e-3, 0.1)) ** 2
    values = {"k_y": k_y, "k_theta": k_theta, "k_ytheta": draw(st.floats(-0.9, 0.9)) * float(np.sqrt(k_y * k_theta))}
    if damped or (damped is None and draw(st.booleans())):
        c_y = k_y * draw(logarithmic(1e-8, 1e-5))
        c_theta = k_theta * draw(logarithmic(1e-8, 1e-5))
        values |= {
            "c_y": c_y,
            "c_theta": c_theta,
            "c_ytheta": draw(st.floats(-0.9, 0.9)) * float(np.sqrt(c_y * c_theta)),
        }
        values["loss_factor"] = draw(logarithmic(1e-4, 0.2))
    return values


@st.composite
def assemblies(draw: st.DrawFn, *, lossy: bool | None = None, grounded: bool | None = None) -> Assembly:
    """Draw a tool and a holder with a joint, or three parts, with or without point elements."""
    tool = draw(parts(lossy=lossy, name="tool"))
    holder = draw(parts(lossy=lossy, name="holder"))
    joint = PointJoint(**draw(springs(damped=lossy)), name="joint")
    chain: list[Part | PointJoint] = [tool, joint, holder]
    if draw(st.booleans()):
        chain.append(draw(parts(lossy=lossy, most=2, name="spindle")))
    points: list[PointMass | GroundSpring] = []
    if draw(st.booleans()):
        mass = draw(logarithmic(1e-4, 1.0))
        place = tool.length * draw(st.floats(0.0, 1.0))
        points.append(PointMass(mass=mass, inertia=mass * 1e-4, part="tool", position=place, name="sensor"))
    if grounded or (grounded is None and draw(st.booleans())):
        spring = draw(springs(damped=lossy))
        points.append(GroundSpring(**spring, part="holder", position="end", name="support"))
    return Assembly(chain, points)


def frequencies() -> st.SearchStrategy[np.ndarray]:
    """Return a few ascending lines from 10 Hz to 20 kHz."""
    lines = st.lists(logarithmic(10.0, 2e4), min_size=1, max_size=4, unique=True)
    return lines.map(lambda found: np.array(sorted(found)))


def both_ends(assembly: Assembly) -> list[Coordinate]:
    """Return y and theta of the tip and of the far end."""
    first, *_, last = [*assembly.elements, *assembly.elements]
    return [Coordinate(first, 0.0, "y"), Coordinate(first, 0.0, "theta"),
            Coordinate(last, "end", "y"), Coordinate(last, "end", "theta")]  # fmt: skip


def between_ends(part: Part, f: np.ndarray, threads: int | None = None) -> np.ndarray:
    """Return the receptance of a free part over y and theta of both ends, `(n, 4, 4)`."""
    free = Assembly([part])
    return free.receptance(f, response=both_ends(free), excitation=both_ends(free), threads=threads)


def scaled(h: np.ndarray, lever: float) -> np.ndarray:
    """Return a matrix over (y, theta, y, theta, ...) with its rotations made displacements by a lever in m."""
    d = np.where(np.arange(h.shape[-1]) % 2 == 1, lever, 1.0)
    return h * d[:, None] * d


def assert_same(found: np.ndarray, expected: np.ndarray, tolerance: float, *, lever: float = 0.05) -> None:
    """Compare receptance matrices relative to their largest entry on each line, rotations times a lever."""
    found, expected = scaled(found, lever), scaled(expected, lever)
    size = np.abs(expected).max(axis=(-2, -1), keepdims=True)
    worst = np.max(np.abs(found - expected) / size)
    assert worst <= tolerance, f"differs by {worst:.3g} of the largest entry"
