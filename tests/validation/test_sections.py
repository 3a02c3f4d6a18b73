"""Sections against the finite elements of sectionproperties, and flutes against a published effective diameter."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import pytest

from receptance import SectionShape
from receptance.model.flutes import fluted_outline
from receptance.model.meshing import mesh_by_sectionproperties, mesh_of, spacing_for
from receptance.model.outlines import Outline, checked_outline, moments
from receptance.model.warping import Warping, warping

SHAPES: dict[str, tuple[Any, Any]] = {
    "two flutes": (fluted_outline(2, 0.5), ()),
    "three flutes": (fluted_outline(3, 0.6), ()),
    "four flutes": (fluted_outline(4, 0.6), ()),
    "eight flutes": (fluted_outline(8, 0.7), ()),
    "box": ([(0, 0), (2, 0), (2, 1), (0, 1)], [[(0.2, 0.2), (1.8, 0.2), (1.8, 0.8), (0.2, 0.8)]]),
    "triangle": ([(0, 0), (1, 0), (0.5, 0.3)], ()),
    "tee": ([(-0.5, 0), (0.5, 0), (0.5, 0.2), (0.1, 0.2), (0.1, 1), (-0.1, 1), (-0.1, 0.2), (-0.5, 0.2)], ()),
}
POISSON_RATIOS = (0.0, 0.3)


@functools.cache
def _about_principal_axes(name: str) -> Outline:
    outline = checked_outline(name, *SHAPES[name])
    exact = moments(outline)
    outline = Outline(outline.points - exact.centroid, tuple(hole - exact.centroid for hole in outline.holes))
    return (
        outline.turned(-0.5 * float(np.arctan2(2 * exact.xy, exact.xx - exact.yy))) if abs(exact.xy) > 1e-9 else outline
    )


def _flexibility(result: Warping, plane: int, poisson_ratio: float) -> float:
    return float(np.polyval(result.energy[plane][::-1], poisson_ratio / (1 + poisson_ratio)))


@pytest.mark.parametrize("name", SHAPES)
def test_sections_agree_with_a_foreign_program(name: str) -> None:
    """Torsion constant and energy coefficients of Pilkey of `sectionproperties`, which has the one of those here."""
    pytest.importorskip("sectionproperties", reason="the extra `sections`")
    from sectionproperties.analysis import Section
    from sectionproperties.pre import Geometry, Material
    from shapely import Polygon

    outline = _about_principal_axes(name)
    result = warping(mesh_of(outline, spacing_for(outline)))
    area = moments(outline).area
    for poisson_ratio in POISSON_RATIOS:
        material = Material("bar", 1.0, poisson_ratio, 1.0, 1.0, "grey")
        geometry = Geometry(Polygon(outline.points, outline.holes), material=material)
        geometry.create_mesh(mesh_sizes=[area / 1200])
        section = Section(geometry)
        section.calculate_geometric_properties()
        section.calculate_warping_properties()
        foreign = section.section_props
        assert result.torsion == pytest.approx(foreign.j, rel=5e-3)
        for plane, shear_area in enumerate((foreign.a_sx, foreign.a_sy)):
            assert area / _flexibility(result, plane, poisson_ratio) == pytest.approx(shear_area, rel=5e-3)


@pytest.mark.parametrize("name", SHAPES)
def test_the_two_meshers_agree(name: str) -> None:
    pytest.importorskip("sectionproperties", reason="the extra `sections`")
    outline = _about_principal_axes(name)
    first, second = (warping(mesh(outline, spacing_for(outline))) for mesh in (mesh_of, mesh_by_sectionproperties))
    assert first.torsion == pytest.approx(second.torsion, rel=5e-3)
    assert np.array(first.cowper) == pytest.approx(np.array(second.cowper), rel=5e-3, abs=5e-3)


@pytest.mark.parametrize("name", SHAPES)
def test_coefficients_have_converged(name: str) -> None:
    """Half the spacing changes torsion and shear by less than 0.3 %."""
    outline = _about_principal_axes(name)
    coarse, fine = (warping(mesh_of(outline, spacing_for(outline) / part)) for part in (1.0, 2.0))
    assert coarse.torsion == pytest.approx(fine.torsion, rel=3e-3)
    for first, second in ((coarse.cowper, fine.cowper), (coarse.energy, fine.energy)):
        assert np.array(first)[:, :2] == pytest.approx(np.array(second)[:, :2], rel=3e-3, abs=3e-3)


@pytest.mark.parametrize("name", SHAPES)
def test_cowper_is_the_mean_of_the_energy_and_hutchinson(name: str) -> None:
    outline = _about_principal_axes(name)
    result = warping(mesh_of(outline, spacing_for(outline)))
    mean = (np.array(result.energy) + np.array(result.hutchinson)) / 2
    scale = np.abs(np.array(result.energy)).max()
    assert mean == pytest.approx(np.array(result.cowper), abs=3e-3 * scale)


@pytest.mark.parametrize("number", [2, 4])
def test_the_effective_diameter_is_that_of_kops_and_vo(number: int) -> None:
    """About 80 % of the diameter for two and four flutes: L. Kops, D. T. Vo, CIRP Annals 39(1), 1990, 93.

    The core diameters of their cutters are not in the abstract; 0.5 to 0.7 of the diameter are usual.
    """
    ratios = [
        SectionShape.fluted(number, diameter=0.02, core_diameter=0.02 * core).bending_diameter / 0.02
        for core in (0.5, 0.7)
    ]
    assert 0.65 < ratios[0] < 0.8 < ratios[1] < 0.9
