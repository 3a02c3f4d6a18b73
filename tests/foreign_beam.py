"""Three CSV files of a foreign beam model: a blank in a holder at three overhangs, with a sensor that nobody mentions.

Finite elements of `blind.generator.elements`; no code of the package is imported. The files are those of an analyser in
another language: a preamble, semicolons, decimal commas, columns `Frequenz`, `Real`, `Imag` and `Coh`, in g/N.

    python tests/foreign_beam.py FOLDER [--sensor GRAMS] [--seed N]
"""

from __future__ import annotations

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from blind.generator.elements import Ring, Structure, cowper

OVERHANGS_MM = (60, 90, 120)
SENSOR_G = 2.0
AVERAGES = 10
NOISE = 0.005
"""Standard deviation of the noise of one hit, over the magnitude of the FRF."""
FLOOR = 2e-4
"""Standard deviation of the noise of one hit that does not depend on the FRF, over the largest magnitude."""
STEP_HZ, SPAN_HZ, LOWEST_HZ = 2.0, 6400.0, 200.0
"""3200 lines up to 6.4 kHz, a usual setting of analysers, without those that hammer and sensor do not reach."""
BLANK_MM = 20.0
HOLDER_MM = ((48.0, 50.0, 20.0), (90.0, 44.0, 16.0))
"""Length, outer diameter and bore of the holder's sections; the shank fills the first bore."""
GRAVITY = 9.80665
JOINT = {"k_y": 4.2e8, "k_theta": 1.6e5, "c_y": 400.0, "c_theta": 0.08}


def _ring(outer_mm: float, inner_mm: float, kind: str) -> Ring:
    modulus, density, poisson, loss = {
        "carbide": (580e9, 14500.0, 0.22, 0.001),
        "steel": (210e9, 7850.0, 0.3, 0.001),
    }[kind]
    outer, inner = 1e-3 * outer_mm, 1e-3 * inner_mm
    return Ring(outer, inner, modulus, density, poisson, loss, cowper(outer, inner, poisson))


def accelerance(overhang_mm: float, lines: NDArray[np.float64], sensor_g: float) -> NDArray[np.complex128]:
    """Return acceleration over force at the tip in g/N, of the blank in its holder with the sensor on the tip."""
    model = Structure()
    tip = model.station()
    mouth = model.beam(tip, 1e-3 * overhang_mm, [_ring(BLANK_MM, 0.0, "carbide")])
    nose = at = model.station()
    for number, (length, outer, inner) in enumerate(HOLDER_MM):
        rings = [_ring(outer, inner, "steel")] + ([_ring(inner, 0.0, "carbide")] if number == 0 else [])
        at = model.beam(at, 1e-3 * length, rings)
    stiffness = np.diag([JOINT["k_y"], JOINT["k_theta"]]).astype(np.complex128)
    model.spring(mouth, nose, stiffness, np.diag([JOINT["c_y"], JOINT["c_theta"]]))
    model.mass(tip, 1e-3 * sensor_g)
    stiffness, inertia, damping = model.matrices()
    load = np.zeros(model.size)
    load[2 * tip] = 1.0
    angular = 2.0 * np.pi * lines
    return np.array(
        [
            -(w**2) * np.linalg.solve(stiffness + 1j * w * damping - w**2 * inertia, load)[2 * tip] / GRAVITY
            for w in angular
        ]
    )


def measured(
    exact: NDArray[np.complex128], generator: np.random.Generator
) -> tuple[NDArray[np.complex128], NDArray[np.float64]]:
    """Return the H1 estimate and the coherence of hits with noise in the response."""
    scatter = np.sqrt((NOISE * np.abs(exact)) ** 2 + (FLOOR * np.abs(exact).max()) ** 2)
    shape = (AVERAGES, exact.size)
    noise = (generator.standard_normal(shape) + 1j * generator.standard_normal(shape)) / np.sqrt(2.0) * scatter
    hits = exact + noise
    mean = hits.mean(axis=0)
    return mean, np.abs(mean) ** 2 / np.mean(np.abs(hits) ** 2, axis=0)


def table(overhang_mm: float, sensor_g: float, generator: np.random.Generator) -> str:
    """Return the contents of the file of one overhang."""
    lines = np.arange(STEP_HZ, SPAN_HZ + 0.5 * STEP_HZ, STEP_HZ)
    lines = lines[lines >= LOWEST_HZ]
    values, coherence = measured(accelerance(overhang_mm, lines, sensor_g), generator)
    rows = [
        f"{f:.3f};{h.real:.9e};{h.imag:.9e};{c:.7f}".replace(".", ",")
        for f, h, c in zip(lines, values, coherence, strict=True)
    ]
    preamble = [f"Messung;Werkzeug {overhang_mm:g} mm", f"Mittelungen;{AVERAGES}", "Fenster;keines", ""]
    return "\n".join([*preamble, "Frequenz [Hz];Real [g/N];Imag [g/N];Coh", *rows]) + "\n"


def write(folder: Path, sensor_g: float = SENSOR_G, seed: int = 0) -> list[Path]:
    """Write the three files and return their paths."""
    generator = np.random.default_rng(seed)
    paths = []
    for overhang in OVERHANGS_MM:
        path = folder / f"tool_{overhang}mm.csv"
        path.write_text(table(overhang, sensor_g, generator), encoding="utf-8")
        paths.append(path)
    return paths


def main() -> None:
    """Write the files into a folder."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--sensor", type=float, default=SENSOR_G, metavar="GRAMS")
    parser.add_argument("--seed", type=int, default=0)
    given = parser.parse_args()
    for path in write(given.folder, given.sensor, given.seed):
        print(path)


if __name__ == "__main__":
    main()
