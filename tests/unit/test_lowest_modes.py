"""The lowest natural frequencies, wherever they are: against those up to a limit, and in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from receptance import (
    CARBIDE,
    STEEL,
    Assembly,
    GroundSpring,
    MicroslipJoint,
    ModalPart,
    Mode,
    Part,
    PointJoint,
    PointMass,
    Segment,
    SpreadJoint,
)
from receptance.model.beams import Section

TOOL = Part([Segment(length=0.06, outer_diameter=0.012, material=CARBIDE)], name="tool")
HOLDER = Part([Segment(length=0.13, outer_diameter=0.045, material=STEEL)], name="holder")


def structures() -> list[Assembly]:
    soft = PointJoint(k_y=1e3, k_theta=1e-1, name="joint")
    slip = MicroslipJoint(k_y=6e8, k_theta=1e5, slip_theta=0.2, level=1.5, name="joint")
    sleeve = SpreadJoint(
        length=0.04,
        shank=Section(outer_diameter=0.012, material=CARBIDE),
        sleeve=Section(outer_diameter=0.045, inner_diameter=0.012, material=STEEL),
        k_y=5e8,
        k_theta=1e3,
        name="joint",
    )
    heavy = PointMass(mass=300.0, inertia=5.0, part="holder", position="end")
    ground = GroundSpring(k_y=10.0, k_theta=1e-3, part="holder", position="end")
    return [
        Assembly([HOLDER]),
        Assembly([TOOL, soft, HOLDER], [ground]),
        Assembly([TOOL, slip, HOLDER], [heavy]),
        Assembly([TOOL, sleeve, HOLDER]),
        Assembly([HOLDER], [heavy, ground], motion="axial"),
    ]


@pytest.mark.parametrize("assembly", structures(), ids=repr)
@pytest.mark.parametrize("count", [0, 1, 3, 12])
def test_lowest_modes_equal_the_first_of_all_modes(assembly: Assembly, count: int) -> None:
    address = "holder.segment[0].outer_diameter"
    frequency, slope = assembly.lowest_natural_frequencies(count, [address])
    assert frequency.shape == (count,)
    assert slope.shape == (count, 1)
    if count:
        expected, own = assembly.natural_frequency_derivatives(1.01 * float(frequency[-1]), [address])
        assert len(expected) >= count
        np.testing.assert_allclose(frequency, expected[:count], rtol=1e-12)
        np.testing.assert_allclose(slope, own[:count], rtol=1e-9, atol=1e-9 * np.abs(own).max())


def test_a_free_rod() -> None:
    """Modes of a free rod of length L: n c / (2 L)."""
    speed = np.sqrt(STEEL.youngs_modulus / STEEL.density)
    frequency, slope = Assembly([HOLDER], motion="axial").lowest_natural_frequencies(5, ["holder.segment[0].length"])
    expected = np.arange(1, 6) * speed / (2.0 * 0.13)
    np.testing.assert_allclose(frequency, expected, rtol=1e-12)
    np.testing.assert_allclose(slope[:, 0], -expected / 0.13, rtol=1e-9)


def test_invalid_requests() -> None:
    with pytest.raises(ValueError, match="too short"):
        Assembly([HOLDER]).lowest_natural_frequencies(100_000)
    spindle = ModalPart(modes=[Mode(frequency_hz=650.0, damping_ratio=0.03, y=0.25, theta=1.1)])
    with pytest.raises(ValueError, match="use the peaks"):
        Assembly([HOLDER, spindle]).lowest_natural_frequencies(2)
