"""Three CSV files of a foreign beam model: a blank in a holder at three overhangs, with a sensor that nobody mentions.

Finite elements of `blind.generator.elements`; no code of the package is imported. The files are those of an analyser in
another language: a preamble, semicolons, decimal commas, columns `Frequenz`, `Real`, `Imag` and `Coh`, in g/N.

    python tests/foreign_beam.py FOLDER [--demo] [--sensor GRAMS] [--seed N]

`--demo` writes the files of the packaged example forgotten-sensor: a thinner blank, and fewer lines.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from blind.generator.elements import Ring, Structure, cowper

SENSOR_G = 2.0
AVERAGES = 10
NOISE = 0.005
"""Standard deviation of the noise of one hit, over the magnitude of the FRF."""
FLOOR = 2e-4
"""Standard deviation of the noise of one hit that does not depend on the FRF, over the largest magnitude."""
GRAVITY = 9.80665


@dataclass(frozen=True)
class Beam:
    """A blank in a holder, and the lines of its measurement."""

    overhangs_mm: tuple[float, ...]
    blank_mm: float
    holder_mm: tuple[tuple[float, float, float], ...]
    """Length, outer diameter and bore of the holder's sections; the shank fills the first bore."""
    k_y: float
    k_theta: float
    c_y: float
    c_theta: float
    step_hz: float
    span_hz: float
    lowest_hz: float = 200.0
    """Hammer and sensor do not reach lower lines."""

    @property
    def lines(self) -> NDArray[np.float64]:
        """Lines in Hz."""
        every = np.arange(self.step_hz, self.span_hz + 0.5 * self.step_hz, self.step_hz)
        return every[every >= self.lowest_hz]


PROTOCOL = Beam((60, 90, 120), 20.0, ((48.0, 50.0, 20.0), (90.0, 44.0, 16.0)), 4.2e8, 1.6e5, 400.0, 0.08, 2.0, 6400.0)
DEMO = Beam((40, 55, 70), 12.0, ((40.0, 40.0, 12.0), (80.0, 34.0, 10.0)), 2.6e8, 4.5e4, 300.0, 0.05, 4.0, 6400.0)


def _ring(outer_mm: float, inner_mm: float, kind: str) -> Ring:
    modulus, density, poisson, loss = {
        "carbide": (580e9, 14500.0, 0.22, 0.001),
        "steel": (210e9, 7850.0, 0.3, 0.001),
    }[kind]
    outer, inner = 1e-3 * outer_mm, 1e-3 * inner_mm
    return Ring(outer, inner, modulus, density, poisson, loss, cowper(outer, inner, poisson))


def accelerance(beam: Beam, overhang_mm: float, sensor_g: float) -> NDArray[np.complex128]:
    """Return acceleration over force at the tip in g/N, of the blank in its holder with the sensor on the tip."""
    model = Structure()
    tip = model.station()
    mouth = model.beam(tip, 1e-3 * overhang_mm, [_ring(beam.blank_mm, 0.0, "carbide")])
    nose = at = model.station()
    for number, (length, outer, inner) in enumerate(beam.holder_mm):
        rings = [_ring(outer, inner, "steel")] + ([_ring(inner, 0.0, "carbide")] if number == 0 else [])
        at = model.beam(at, 1e-3 * length, rings)
    stiffness = np.diag([beam.k_y, beam.k_theta]).astype(np.complex128)
    model.spring(mouth, nose, stiffness, np.diag([beam.c_y, beam.c_theta]))
    model.mass(tip, 1e-3 * sensor_g)
    stiffness, inertia, damping = model.matrices()
    load = np.zeros(model.size)
    load[2 * tip] = 1.0
    angular = 2.0 * np.pi * beam.lines
    return np.array(
        [
            -(w**2) * np.linalg.solve(stiffness + 1j * w * damping - w**2 * inertia, load)[2 * tip] / GRAVITY
            for w in angular
        ]
    )


def measured(
    exact: NDArray[np.complex128], generator: np.random.Generator, noise: float = NOISE, floor: float | None = None
) -> tuple[NDArray[np.complex128], NDArray[np.float64]]:
    """Return the H1 estimate and the coherence of hits with noise in the response.

    `noise` is relative to the FRF; `floor`, in the unit of the FRF, is by default `FLOOR` of its largest one.
    """
    constant = FLOOR * np.abs(exact).max() if floor is None else floor
    scatter = np.sqrt((noise * np.abs(exact)) ** 2 + constant**2)
    shape = (AVERAGES, exact.size)
    errors = (generator.standard_normal(shape) + 1j * generator.standard_normal(shape)) / np.sqrt(2.0) * scatter
    hits = exact + errors
    mean = hits.mean(axis=0)
    return mean, np.abs(mean) ** 2 / np.mean(np.abs(hits) ** 2, axis=0)


def table(beam: Beam, overhang_mm: float, sensor_g: float, generator: np.random.Generator) -> str:
    """Return the contents of the file of one overhang."""
    values, coherence = measured(accelerance(beam, overhang_mm, sensor_g), generator)
    rows = [
        f"{f:.3f};{h.real:.9e};{h.imag:.9e};{c:.7f}".replace(".", ",")
        for f, h, c in zip(beam.lines, values, coherence, strict=True)
    ]
    preamble = [f"Messung;Werkzeug {overhang_mm:g} mm", f"Mittelungen;{AVERAGES}", "Fenster;keines", ""]
    return "\n".join([*preamble, "Frequenz [Hz];Real [g/N];Imag [g/N];Coh", *rows]) + "\n"


def write(folder: Path, sensor_g: float = SENSOR_G, seed: int = 0, beam: Beam = PROTOCOL) -> list[Path]:
    """Write the three files and return their paths."""
    generator = np.random.default_rng(seed)
    paths = []
    for overhang in beam.overhangs_mm:
        path = folder / f"tool_{overhang}mm.csv"
        path.write_text(table(beam, overhang, sensor_g, generator), encoding="utf-8")
        paths.append(path)
    return paths


def main() -> None:
    """Write the files into a folder."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--sensor", type=float, default=SENSOR_G, metavar="GRAMS")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--demo", action="store_true", help="the files of the packaged example")
    given = parser.parse_args()
    for path in write(given.folder, given.sensor, given.seed, DEMO if given.demo else PROTOCOL):
        print(path)


if __name__ == "__main__":
    main()
