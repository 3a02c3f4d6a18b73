"""List of materials: typical values, their scatter between deliveries, and where they come from.

A `Grade` is a material that can be named, `material("carbide-10co")`. Scatters are standard deviations of a delivery
about the listed values; where a source states a range, the standard deviation is that of a uniform distribution over
it. A `MaterialClass` covers all grades of a kind, and is what a diagnosis tries for a tool of another material.

A source with clause or table was checked by what others print of it. "As commonly used" are values for which no source
was checked.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

from receptance._text import instead_of, shown
from receptance.model.beams import CARBIDE, STEEL, Material

LOSS_FACTOR = 0.001
"""Loss factor of a listed material in a campaign: that of metal bars without joints, which the sources do not state."""
LOSS_SCATTER = 0.5
"""Its relative standard deviation."""
COBALT = (0.03, 0.25)
"""Least and largest share of cobalt in mass for which the relations of cemented carbide hold."""
_NOT_A_LETTER = re.compile(r"[\s_%-]+")
_CARBIDE = re.compile(r"carbide(\d+(?:\.\d+)?)co")


@dataclass(frozen=True, kw_only=True)
class Grade:
    """A listed material.

    `youngs_modulus` is in Pa, `density` in kg/m3; `modulus_scatter` and `density_scatter` are relative standard
    deviations, `poisson_scatter` is an absolute one.
    """

    name: str
    """Name in campaigns and commands."""
    title: str
    """What it is, with names of its standards."""
    kind: str
    """Name of its `MaterialClass`."""
    youngs_modulus: float
    modulus_scatter: float
    density: float
    density_scatter: float
    poisson_ratio: float
    poisson_scatter: float
    source: str
    """Where the values come from."""

    def material(self, loss_factor: float = 0.0) -> Material:
        """Return the material; without a loss factor it is undamped, as `STEEL` is.

        Examples
        --------
        >>> from receptance import MATERIALS, STEEL
        >>> MATERIALS["steel"].material() == STEEL
        True
        """
        return Material(
            youngs_modulus=self.youngs_modulus,
            density=self.density,
            poisson_ratio=self.poisson_ratio,
            loss_factor=loss_factor,
            name=self.name,
        )

    @property
    def deviations(self) -> dict[str, float]:
        """Standard deviations by the names of the fields of `Material`, in SI units.

        Examples
        --------
        >>> from receptance import MATERIALS
        >>> MATERIALS["steel"].deviations["density"]
        39.25
        """
        return {
            "youngs_modulus": self.modulus_scatter * self.youngs_modulus,
            "density": self.density_scatter * self.density,
            "poisson_ratio": self.poisson_scatter,
        }

    @property
    def about(self) -> str:
        """Values with their standard deviations, in one line.

        Examples
        --------
        >>> from receptance import MATERIALS
        >>> MATERIALS["steel"].about
        '210 GPa +- 2 %, 7850 kg/m3 +- 0.5 %, Poisson ratio 0.3 +- 0.01'
        """
        return (
            f"{1e-9 * self.youngs_modulus:.3g} GPa +- {100.0 * self.modulus_scatter:.2g} %, "
            f"{self.density:.0f} kg/m3 +- {100.0 * self.density_scatter:.2g} %, "
            f"Poisson ratio {self.poisson_ratio:.3g} +- {self.poisson_scatter:g}"
        )


@dataclass(frozen=True)
class MaterialClass:
    """A class of materials: typical values and the scatter of its grades."""

    name: str
    """Name in texts."""
    youngs_modulus: float
    """Typical value in Pa."""
    density: float
    """Typical value in kg/m3."""
    poisson_ratio: float
    modulus_scatter: float
    """Standard deviation of the natural logarithm over the grades of the class."""
    density_scatter: float
    """Standard deviation of the natural logarithm over the grades of the class."""
    of_tools: bool = True
    """Whether tools, boring bars and test pieces in place of tools are made of it."""

    def relative_to(self, stated: Material) -> tuple[float, float]:
        """Return the natural logarithms of modulus and density over those of a stated material."""
        return math.log(self.youngs_modulus / stated.youngs_modulus), math.log(self.density / stated.density)

    @property
    def grades(self) -> tuple[str, ...]:
        """Names of the listed grades of the class."""
        return tuple(grade.name for grade in MATERIALS.values() if grade.kind == self.name)


MATERIAL_CLASSES = (
    MaterialClass("steel", 215e9, 7950.0, 0.3, 0.04, 0.02),
    MaterialClass("cemented carbide", 595e9, 14500.0, 0.22, 0.045, 0.018),
    MaterialClass("tungsten heavy alloy", 360e9, 17700.0, 0.28, 0.05, 0.025),
    MaterialClass("aluminium", 70e9, 2740.0, 0.33, 0.03, 0.02),
    MaterialClass("titanium", 113e9, 4450.0, 0.33, 0.04, 0.02, of_tools=False),
    MaterialClass("brass", 99e9, 8460.0, 0.34, 0.05, 0.02, of_tools=False),
)
"""Classes of the listed materials.

steel
    210 GPa and a ratio of 0.3 (EN 1993-1-1, 3.2.6), 7850 kg/m3 (EN 1991-1-1, table A.4); high-speed steels have
    215 to 230 GPa and 8000 to 8300 kg/m3 (as commonly used for HS6-5-2 and the like).
cemented carbide
    WC with 4 to 15 % Co: 540 to 650 GPa and 13 900 to 15 000 kg/m3 (as commonly used; for grades see Brookes, World
    Directory and Handbook of Hardmetals).
tungsten heavy alloy
    W with Ni, Fe or Cu, the four classes of ASTM B777: 330 to 390 GPa and 17 000 to 18 500 kg/m3 (as commonly used);
    for boring bars.
aluminium
    70 GPa and 2700 kg/m3, alloys to 73 GPa and 2850 kg/m3 (as commonly used); for dummies and test pieces.
titanium, brass
    Alloys of fixtures and weights; a diagnosis does not try them for tools.
"""


def carbide(cobalt: float) -> Grade:
    """Return cemented carbide, WC with cobalt, from the share of cobalt in mass.

    The density is that of the mixture without pores, of WC with 15 630 and cobalt with 8900 kg/m3. The modulus is in
    the middle between the bounds of Hashin and Shtrikman (J. Mech. Phys. Solids 11, 1963, 127), of WC with 707 GPa
    and a ratio of 0.19 (attributed to Doi et al. 1970, which was not at hand) and cobalt with 211 GPa and 0.31.
    The standard deviation of the modulus is that of a uniform distribution between the bounds, and 1.5 % for grain
    size and other carbides; that of the density is half a percent of cobalt in mass, and 0.5 %. Values are rounded to
    four or five digits.

    Parameters
    ----------
    cobalt : float
        Share of cobalt in mass, from 0.03 to 0.25.

    Raises
    ------
    ValueError
        The share is out of these bounds.

    Examples
    --------
    >>> from receptance.model.materials import carbide
    >>> carbide(0.10).about
    '578 GPa +- 2.2 %, 14531 kg/m3 +- 0.61 %, Poisson ratio 0.213 +- 0.01'
    """
    if not COBALT[0] <= cobalt <= COBALT[1]:
        raise ValueError(
            f"carbide: cobalt is {cobalt:g}, expected a share in mass from {COBALT[0]:g} to {COBALT[1]:g}, such as 0.1"
        )
    share, density = _mixed(cobalt)
    stiff, soft = _moduli(707e9, 0.19), _moduli(211e9, 0.31)
    upper, ratio_of_upper = _bound(stiff, soft, share)
    lower, ratio_of_lower = _bound(soft, stiff, 1.0 - share)
    modulus = 0.5 * (upper + lower)
    of_cobalt = 0.5 * (_mixed(cobalt - 0.005)[1] - _mixed(cobalt + 0.005)[1])
    return Grade(
        name=f"carbide-{100.0 * cobalt:g}co",
        title=f"cemented carbide, WC with {100.0 * cobalt:g} % Co",
        kind="cemented carbide",
        youngs_modulus=round(modulus, -8),
        modulus_scatter=math.hypot(0.015, 0.5 * (upper - lower) / math.sqrt(3.0) / modulus),
        density=round(density),
        density_scatter=math.hypot(0.005, of_cobalt / density),
        poisson_ratio=round(0.5 * (ratio_of_upper + ratio_of_lower), 3),
        poisson_scatter=0.01,
        source="mean of Hashin-Shtrikman bounds (1963), moduli attributed to Doi et al. 1970; rule of mixtures",
    )


def _mixed(cobalt: float) -> tuple[float, float]:
    """Return the share of cobalt in volume, and the density of the mixture in kg/m3, from the share in mass."""
    of_cobalt, of_carbide = cobalt / 8900.0, (1.0 - cobalt) / 15630.0
    return of_cobalt / (of_cobalt + of_carbide), 1.0 / (of_cobalt + of_carbide)


def _moduli(youngs_modulus: float, ratio: float) -> tuple[float, float]:
    """Return bulk and shear modulus."""
    return youngs_modulus / (3.0 * (1.0 - 2.0 * ratio)), youngs_modulus / (2.0 * (1.0 + ratio))


def _bound(matrix: tuple[float, float], inclusion: tuple[float, float], share: float) -> tuple[float, float]:
    """Return Young's modulus and Poisson's ratio of the bound with a share of the inclusion in volume."""
    (bulk, shear), (other_bulk, other_shear) = matrix, inclusion
    rest, stiff = 1.0 - share, 3.0 * bulk + 4.0 * shear
    bulk_bound = bulk + share / (1.0 / (other_bulk - bulk) + 3.0 * rest / stiff)
    of_shear = 6.0 * rest * (bulk + 2.0 * shear) / (5.0 * shear * stiff)
    shear_bound = shear + share / (1.0 / (other_shear - shear) + of_shear)
    youngs_modulus = 9.0 * bulk_bound * shear_bound / (3.0 * bulk_bound + shear_bound)
    return youngs_modulus, youngs_modulus / (2.0 * shear_bound) - 1.0


def _grade(
    name: str,
    title: str,
    kind: str,
    modulus: tuple[float, float],
    density: tuple[float, float],
    ratio: tuple[float, float],
    source: str,
) -> Grade:
    """Return a grade from pairs of value and standard deviation: GPa and %, kg/m3 and %, and the ratio."""
    return Grade(
        name=name,
        title=title,
        kind=kind,
        youngs_modulus=1e9 * modulus[0],
        modulus_scatter=0.01 * modulus[1],
        density=density[0],
        density_scatter=0.01 * density[1],
        poisson_ratio=ratio[0],
        poisson_scatter=ratio[1],
        source=source,
    )


def _stated(material: Material, title: str, kind: str, scatters: tuple[float, float], source: str) -> Grade:
    """Return the grade of a material of the model, with relative standard deviations of modulus and density."""
    return Grade(
        name=material.name,
        title=title,
        kind=kind,
        youngs_modulus=material.youngs_modulus,
        modulus_scatter=scatters[0],
        density=material.density,
        density_scatter=scatters[1],
        poisson_ratio=material.poisson_ratio,
        poisson_scatter=0.01,
        source=source,
    )


_STEEL, _HEAVY = "steel", "tungsten heavy alloy"
_GRADES = (
    _stated(
        STEEL, "steel, unalloyed or low alloyed", _STEEL, (0.02, 0.005), "EN 1993-1-1, 3.2.6; EN 1991-1-1, table A.4"
    ),
    _grade(
        "holder-steel",
        "case-hardening steel 16MnCr5, 42CrMo4: holders, collets, spindles",
        _STEEL,
        (210, 1.5),
        (7840, 0.4),
        (0.29, 0.01),
        "as commonly used",
    ),
    _grade(
        "tool-steel",
        "hot-work tool steel X40CrMoV5-1 (H13): shrink-fit holders",
        _STEEL,
        (211, 2),
        (7780, 0.5),
        (0.29, 0.01),
        "as commonly used (205 to 215 GPa, 7740 to 7800 kg/m3)",
    ),
    _grade(
        "stainless-austenitic",
        "stainless steel 1.4301 (304)",
        _STEEL,
        (200, 2),
        (7900, 0.5),
        (0.29, 0.015),
        "as commonly used",
    ),
    _grade(
        "stainless-martensitic",
        "stainless steel 1.4021, 1.4034 (420)",
        _STEEL,
        (215, 2),
        (7700, 0.5),
        (0.29, 0.01),
        "as commonly used",
    ),
    _grade(
        "hss",
        "high-speed steel HS6-5-2 (M2)",
        _STEEL,
        (221, 2),
        (8120, 0.7),
        (0.29, 0.01),
        "as commonly used (217 to 225 GPa, 8100 to 8160 kg/m3)",
    ),
    _stated(
        CARBIDE,
        "cemented carbide of a grade that is not stated",
        "cemented carbide",
        (0.045, 0.018),
        "as commonly used (540 to 650 GPa, 13 900 to 15 000 kg/m3)",
    ),
    *map(carbide, (0.06, 0.08, 0.10, 0.12, 0.15)),
    _grade(
        "heavy-metal-1",
        "tungsten heavy alloy, 90 % W, ASTM B777 class 1",
        _HEAVY,
        (340, 3),
        (17050, 0.7),
        (0.28, 0.01),
        "class of ASTM B777, values as commonly used (16.85 to 17.25 g/cm3)",
    ),
    _grade(
        "heavy-metal-2",
        "tungsten heavy alloy, 92.5 % W, ASTM B777 class 2",
        _HEAVY,
        (360, 3),
        (17500, 1.2),
        (0.28, 0.01),
        "class of ASTM B777, values as commonly used (17.15 to 17.85 g/cm3)",
    ),
    _grade(
        "heavy-metal-3",
        "tungsten heavy alloy, 95 % W, ASTM B777 class 3",
        _HEAVY,
        (370, 3),
        (18050, 1),
        (0.28, 0.01),
        "class of ASTM B777, values as commonly used (17.75 to 18.35 g/cm3)",
    ),
    _grade(
        "heavy-metal-4",
        "tungsten heavy alloy, 97 % W, ASTM B777 class 4",
        _HEAVY,
        (385, 3),
        (18550, 0.9),
        (0.28, 0.01),
        "class of ASTM B777, values as commonly used (18.25 to 18.85 g/cm3)",
    ),
    _grade(
        "aluminium",
        "aluminium alloy, EN AW-6082 and the like",
        "aluminium",
        (70, 1.5),
        (2700, 0.5),
        (0.33, 0.01),
        "as commonly used",
    ),
    _grade(
        "aluminium-7075",
        "aluminium alloy EN AW-7075",
        "aluminium",
        (71.7, 1.5),
        (2810, 0.5),
        (0.33, 0.01),
        "as commonly used",
    ),
    _grade(
        "titanium-6al4v",
        "titanium alloy Ti-6Al-4V",
        "titanium",
        (113.8, 2.5),
        (4430, 0.4),
        (0.342, 0.015),
        "as commonly used",
    ),
    _grade(
        "brass",
        "free-cutting brass CuZn39Pb3 (CW614N)",
        "brass",
        (97, 3),
        (8470, 0.5),
        (0.34, 0.015),
        "as commonly used (96 to 100 GPa)",
    ),
)


class Grades(Mapping[str, Grade]):
    """Materials by name, read only.

    Examples
    --------
    >>> from receptance import MATERIALS
    >>> "steel" in MATERIALS
    True
    """

    def __init__(self, grades: Iterable[Grade]) -> None:
        self._by_name = {grade.name: grade for grade in grades}

    def __getitem__(self, name: str) -> Grade:
        return self._by_name[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._by_name)

    def __len__(self) -> int:
        return len(self._by_name)


MATERIALS = Grades(_GRADES)
"""Listed materials by name; `grade` also has cemented carbide with any share of cobalt."""


def grade(name: str) -> Grade:
    """Return a listed material by name.

    Parameters
    ----------
    name : str
        A name of `MATERIALS`, or `carbide-NUMBERco` with any percentage of cobalt in mass from 3 to 25. Blanks, case,
        hyphens and the sign of percent are not significant.

    Raises
    ------
    ValueError, TypeError
        The list has no material of this name; similar names are told.

    Examples
    --------
    >>> from receptance.model.materials import grade
    >>> grade("carbide 9% Co").name, grade("HSS").title
    ('carbide-9co', 'high-speed steel HS6-5-2 (M2)')
    """
    if not isinstance(name, str):
        raise TypeError(f'material: the name is {name!r}, expected a text such as "carbide-10co"')
    listed = _listed(name)
    if listed is None:
        raise ValueError(f"material: there is no listed material {shown(name)}{instead_of(name, MATERIALS)}")
    return listed


def _listed(name: str) -> Grade | None:
    plain = _plain(name)
    if (match := _CARBIDE.fullmatch(plain)) is not None:
        return carbide(float(match[1]) / 100.0)
    return next((listed for listed in MATERIALS.values() if _plain(listed.name) == plain), None)


def _plain(name: str) -> str:
    return _NOT_A_LETTER.sub("", name).lower()


def is_listed(name: str) -> bool:
    """Return whether the list has a material of exactly this name, as campaigns write it.

    Examples
    --------
    >>> from receptance.model.materials import is_listed
    >>> is_listed("carbide-9co"), is_listed("carbide 9% Co"), is_listed("carbide-90co")
    (True, False, False)
    """
    try:
        listed = _listed(name)
    except ValueError:
        return False
    return listed is not None and listed.name == name


def material(name: str, *, loss_factor: float = 0.0) -> Material:
    """Return a material of the list by name; see `grade`.

    Parameters
    ----------
    name : str
        Such as "steel", "hss", "carbide-10co" or "carbide 10% Co"; `receptance materials` lists all names.
    loss_factor : float, default 0
        Hysteretic loss factor; the list has none.

    Examples
    --------
    >>> from receptance import STEEL, material
    >>> material("steel") == STEEL
    True
    >>> material("carbide 10% Co", loss_factor=0.001).density
    14531.0
    """
    return grade(name).material(loss_factor)
