"""Cones beside cylinders: cost, accuracy, and what crude models of a cone cost: ``python benches/cones.py``.

The first table has processor times of one thread: a free cone beside one cylinder and six, 400 lines, in turns. "anew"
makes the assembly in every call, as each step of a fit does for a changed cone; "again" calls the same one.
The accuracy is the largest relative difference from 80 to 640 cylinders with extrapolation (Richardson), to 5 kHz.
The second table replaces both cones of a tool and its holder by n cylinders of the middle diameters: changes of natural
frequencies, and joint stiffnesses that are identified from the receptance of the cones with noise.
"""

from __future__ import annotations

import os

if __name__ == "__main__":
    os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"

import argparse
import json
import statistics
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np

from receptance import (
    CARBIDE,
    STEEL,
    Assembly,
    GroundSpring,
    Observation,
    Part,
    PointJoint,
    Segment,
    Unknown,
    identify,
)
from receptance._files import write_whole

LINES, ROUNDS, CYLINDERS, SEED, NOISE = 400, 12, 6, 20261139, 0.01
LOSSY = replace(STEEL, loss_factor=0.003)
CONES = {
    "nose 40-60, bore 12, 50 mm": Segment(
        length=0.05, outer_diameter=0.04, end_outer_diameter=0.06, inner_diameter=0.012, material=LOSSY
    ),
    "solid 30-60, 60 mm": Segment(length=0.06, outer_diameter=0.03, end_outer_diameter=0.06, material=LOSSY),
    "slender 12-20, 150 mm": Segment(length=0.15, outer_diameter=0.012, end_outer_diameter=0.02, material=LOSSY),
    "solid 10-50, 50 mm": Segment(length=0.05, outer_diameter=0.01, end_outer_diameter=0.05, material=LOSSY),
}
DERIVATIVES = ("youngs_modulus", "density", "loss_factor")
"""Three parameters that a cone and its cylinders share."""
COUNTS = (1, 2, 4, 8)
"""Cylinders for a cone in the second table."""


def cylinders(cone: Segment, count: int) -> list[Segment]:
    """Return cylinders of equal lengths with the diameters in their middles."""

    def cylinder(number: int) -> Segment:
        outer, inner = cone.at((number + 0.5) / count)
        return replace(
            cone,
            length=cone.length / count,
            outer_diameter=outer,
            inner_diameter=inner,
            end_outer_diameter=None,
            end_inner_diameter=None,
        )

    return [cylinder(number) for number in range(count)]


def free(*segments: Segment) -> Assembly:
    """Return a free part as an assembly."""
    return Assembly([Part(segments, name="part")])


def inaccuracy(cone: Segment) -> float:
    """Return the largest relative difference of the tip's receptance from that of cylinders with extrapolation."""
    lines = np.geomspace(1.0, 5e3, 40)
    values = [free(*cylinders(cone, count)).receptance(lines) for count in (80, 160, 320, 640)]
    for order in (1, 2, 3):
        # The error of n cylinders is a series in n^-2.
        values = [(4**order * fine - crude) / (4**order - 1) for crude, fine in pairwise(values)]
    return float(np.abs(free(cone).receptance(lines) / values[0] - 1.0).max())


def seconds(calls: Sequence[Callable[[], object]], rounds: int, least: float) -> list[float]:
    """Return the median processor time of each call; they have turns, each of which lasts `least` at least."""
    taken: list[list[float]] = [[] for _ in calls]
    for call in calls:
        call()
    for turn in range(rounds):
        for number in range(len(calls))[:: 1 if turn % 2 else -1]:
            count, began = 0, time.process_time()
            while not count or time.process_time() - began < least:
                calls[number]()
                count += 1
            taken[number].append((time.process_time() - began) / count)
    return [statistics.median(values) for values in taken]


def costs(rounds: int, least: float) -> Iterator[dict[str, Any]]:
    """Yield the rows of the first table."""
    for name, cone in CONES.items():
        rows = [[cone], cylinders(cone, 1), cylinders(cone, CYLINDERS)]
        for highest in (5e3, 50e3):
            lines = np.linspace(10.0, highest, LINES)
            for derivatives in (0, len(DERIVATIVES)):
                addresses = [f"part.segment[0].{quantity}" for quantity in DERIVATIVES[:derivatives]]
                shared = [f"part.segment[*].{quantity}" for quantity in DERIVATIVES[:derivatives]]

                def call(row: list[Segment], ready: Assembly | None, lines: Any = lines, three: bool = bool(addresses),
                         shared: list[str] = shared) -> object:  # fmt: skip
                    assembly = ready or free(*row)
                    return (
                        assembly.derivatives(lines, shared, threads=1)
                        if three
                        else assembly.receptance(lines, threads=1)
                    )

                anew = seconds([lambda row=row: call(row, None) for row in rows], rounds, least)  # type: ignore[misc]
                made = [free(*row) for row in rows]
                again = seconds([lambda a=a: call([], a) for a in made], rounds, least)  # type: ignore[misc]
                yield {
                    "cone": name,
                    "highest_hz": highest,
                    "derivatives": derivatives,
                    "cone_ms": 1e3 * anew[0],
                    "over_one": anew[0] / anew[1],
                    "over_six": anew[0] / anew[2],
                    "again_ms": 1e3 * again[0],
                    "again_over_one": again[0] / again[1],
                    "again_over_six": again[0] / again[2],
                }


NECK = Segment(
    length=0.045, outer_diameter=0.010, end_outer_diameter=0.016, material=replace(CARBIDE, loss_factor=0.002)
)
NOSE = Segment(length=0.060, outer_diameter=0.028, end_outer_diameter=0.050, material=LOSSY)
TRUE = {"joint.k_y": 4e8, "joint.k_theta": 5e4, "joint.c_y": 300.0, "joint.c_theta": 0.3}


def assembly(count: int) -> Assembly:
    """Return tool, joint and holder on springs; the cones are `count` cylinders each, or cones where it is 0."""
    neck, nose = ([cone] if count == 0 else cylinders(cone, count) for cone in (NECK, NOSE))
    shank = Segment(length=0.015, outer_diameter=0.016, material=NECK.material)
    body = Segment(length=0.05, outer_diameter=0.063, material=LOSSY)
    joint = PointJoint(**{address.removeprefix("joint."): value for address, value in TRUE.items()}, name="joint")
    taper = GroundSpring(part="holder", position="end", k_y=3e8, k_theta=1.5e6, c_y=2e3, c_theta=5.0, name="taper")
    return Assembly([Part([*neck, shank], name="tool"), joint, Part([*nose, body], name="holder")], [taper])


def crude_models(lines: int) -> Iterator[dict[str, Any]]:
    """Yield the rows of the second table."""
    frequency_hz = np.linspace(200.0, 6e3, lines)
    noise = NOISE * (np.random.default_rng(SEED).standard_normal((lines, 2)) @ np.array([1.0, 1j]))
    data = assembly(0).receptance(frequency_hz) * np.exp(noise)
    exact = assembly(0).natural_frequencies(10e3)[:3]
    unknowns = [Unknown(address=address, lower=value / 300, upper=value * 300) for address, value in TRUE.items()]
    for count in (*COUNTS, 0):
        model = assembly(count)
        observation = Observation(
            assembly=model, frequency_hz=frequency_hz, receptance=data, standard_deviation=NOISE, label="tip"
        )
        fit = identify([observation], unknowns)
        off = {address: 100.0 * (fit.values[address] / TRUE[address] - 1.0) for address in TRUE}
        residual = np.concatenate([np.ravel(values) for values in fit.residuals])
        yield {
            "cylinders": count,
            "frequencies_percent": (100.0 * (model.natural_frequencies(10e3)[:3] / exact - 1.0)).tolist(),
            "k_y_percent": off["joint.k_y"],
            "k_theta_percent": off["joint.k_theta"],
            "misfit": float(np.sqrt(np.mean(residual**2))),
        }


def main(arguments: Sequence[str] | None = None) -> int:
    """Print both tables, and write them to a file if one is given."""
    parser = argparse.ArgumentParser(description="Cones beside cylinders: cost, accuracy, crude models.")
    parser.add_argument("--json", type=Path, metavar="FILE", help="also write the rows to a file")
    parser.add_argument("--quick", action="store_true", help="few rounds and lines: to try it out")
    options = parser.parse_args(arguments)
    rounds, least, lines = (1, 0.0, 60) if options.quick else (ROUNDS, 0.01, 300)
    print(f"{os.cpu_count()} processors, one thread, processor times, {LINES} lines, {rounds} rounds")
    print(f"{'':<28}{'to kHz':>7}{'derivatives':>12}{'anew ms':>9}{'/ 1 cyl.':>9}{'/ 6 cyl.':>9}"
          f"{'again ms':>9}{'/ 1 cyl.':>9}{'/ 6 cyl.':>9}")  # fmt: skip
    first = []
    for row in costs(rounds, least):
        first.append(row)
        print(f"{row['cone']:<28}{row['highest_hz'] / 1e3:>7g}{row['derivatives']:>12}{row['cone_ms']:>9.3f}"
              f"{row['over_one']:>9.2f}{row['over_six']:>9.2f}{row['again_ms']:>9.3f}{row['again_over_one']:>9.2f}"
              f"{row['again_over_six']:>9.2f}", flush=True)  # fmt: skip
    accuracy = {name: inaccuracy(cone) for name, cone in CONES.items()}
    for name, value in accuracy.items():
        print(f"{name:<28} differs from cylinders with extrapolation by {value:.1e}")
    print(f"\nthe same tip with n cylinders for each of two cones; seed {SEED}, noise {100 * NOISE:g} %")
    print(f"{'n':>6}{'f1 %':>9}{'f2 %':>9}{'f3 %':>9}{'k_y %':>9}{'k_theta %':>10}{'misfit':>8}")
    second = []
    for row in crude_models(lines):
        second.append(row)
        shifts = "".join(f"{value:>9.3f}" for value in row["frequencies_percent"])
        print(f"{row['cylinders'] or 'cones':>6}{shifts}{row['k_y_percent']:>9.2f}{row['k_theta_percent']:>10.2f}"
              f"{row['misfit']:>8.2f}", flush=True)  # fmt: skip
    if options.json:
        content = {"seed": SEED, "costs": first, "inaccuracy": accuracy, "crude": second}
        write_whole({options.json: f"{json.dumps(content, indent=1)}\n".encode()})
    return 0


if __name__ == "__main__":
    sys.exit(main())
