"""Do 95 % intervals of a campaign hold the truth? `python tests/validation/campaign_coverage.py --seeds 2 3 4 5`.

Every draw takes the example free-free, lets all its dimensions, materials and sensors err by their tolerances,
measures these structures with noise and identifies the joint by the campaign file. Counted is how often the
intervals of the four joint parameters, of two natural frequencies of the held-out overhang, and of the peaks of its
measured FRF hold the truth, against 95 % by an exact binomial test.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from scipy.stats import binomtest

from receptance import Assembly, Observation, campaign, examples
from receptance.campaign import Campaign
from receptance.examples.simulated import FREE_FREE_JOINT

NOISE = 0.01
LEVEL = 0.95
MODES = ("mode 1", "mode 2")
REJECTED_AT = 0.01


@dataclass
class Coverage:
    """How many intervals hold the truth, over draws."""

    draws: int = 0
    covered: dict[str, int] = field(default_factory=lambda: dict.fromkeys((*FREE_FREE_JOINT, *MODES), 0))
    errors_percent: dict[str, list[float]] = field(default_factory=lambda: {name: [] for name in FREE_FREE_JOINT})
    peaks: list[bool] = field(default_factory=list)
    rms: list[float] = field(default_factory=list)

    def add(self, other: Coverage) -> None:
        """Count the draws of another one as well."""
        self.draws += other.draws
        self.covered = {name: count + other.covered[name] for name, count in self.covered.items()}
        self.errors_percent = {name: own + other.errors_percent[name] for name, own in self.errors_percent.items()}
        self.peaks += other.peaks
        self.rms += other.rms

    def p_value(self, name: str) -> float:
        """Chance of a coverage as far from the level of the intervals as this one, by the exact binomial test."""
        return float(binomtest(self.covered[name], self.draws, LEVEL).pvalue)

    def report(self) -> str:
        """Return the coverage of each result as text."""
        lines = [f"{self.draws} draws; residuals {np.median(self.rms):.3f} standard deviations in the median"]
        for name, count in self.covered.items():
            ends = binomtest(count, self.draws, LEVEL).proportion_ci(0.95, method="exact")
            line = (
                f"{name:14s} {count} of {self.draws} = {100 * count / self.draws:.1f} % "
                f"({100 * ends.low:.1f} to {100 * ends.high:.1f} %), binomial p = {self.p_value(name):.3f}"
            )
            if name in self.errors_percent:
                line += f"; mean error {np.mean(self.errors_percent[name]):+.2f} %"
            lines.append(line)
        share = 100.0 * float(np.mean(self.peaks))
        lines.append(f"peaks          {sum(self.peaks)} of {len(self.peaks)} = {share:.1f} % of the held-out FRF")
        return "\n".join(lines)


def read_campaign() -> Campaign:
    """Return the example, which starts at the true joint and computes no profiles."""
    with tempfile.TemporaryDirectory() as folder:
        examples.write("free-free", Path(folder))
        read = campaign.load(Path(folder), threads=1)
    settings = read.table.settings.with_(starts=1, profiles=False)
    near = tuple(replace(unknown, start=FREE_FREE_JOINT[unknown.address]) for unknown in read.unknowns)
    return replace(read, table=read.table.with_(settings=settings), unknowns=near)


def erring(read: Campaign, rng: np.random.Generator) -> tuple[Campaign, dict[str, Assembly]]:
    """Return the campaign measured on structures that err, and these structures by measurement."""
    names = sorted({error.name for errors in read.errors.values() for error in errors})
    errs = {name: float(rng.standard_normal()) for name in names}
    measurements, structures = {}, {}
    for name, measured in read.measurements.items():
        data = measured
        assert data.is_receptance
        true = data.assembly.replace(FREE_FREE_JOINT)
        values: dict[str, float] = {}
        for error in read.errors[name]:
            for address, size in error.moves.items():
                values[address] = values.get(address, true.get(address)) + errs[error.name] * size
        structures[name] = true = true.replace(values)
        h = true.receptance(data.frequency_hz, response=data.response, excitation=data.excitation)
        noise = NOISE * (rng.standard_normal(h.size) + 1j * rng.standard_normal(h.size))
        again = Observation(
            assembly=data.assembly,
            frequency_hz=data.frequency_hz,
            receptance=h * np.exp(noise),
            standard_deviation=NOISE,
            response=data.response,
            excitation=data.excitation,
            label=name,
            configuration=data.configuration,
            conditions=data.conditions,
        )
        measurements[name] = again
    return replace(read, measurements=measurements), structures


def measure(seed: int, draws: int) -> Coverage:
    """Return the coverage over the draws of one seed."""
    read = read_campaign()
    rng = np.random.default_rng(seed)
    found = Coverage(draws=draws)
    for _ in range(draws):
        drawn, structures = erring(read, rng)
        identified = drawn.identify()
        for address, value in FREE_FREE_JOINT.items():
            low, high = identified.interval(address, LEVEL)
            found.covered[address] += low <= value <= high
            found.errors_percent[address].append(100.0 * (identified.values[address] / value - 1.0))
        found.rms.append(identified.rms)
        held_out = drawn.measurements["long"]
        true = structures["long"].natural_frequencies(7e3)[: len(MODES)]
        there = identified.at(held_out.assembly, configuration="long", tolerances=drawn.errors["long"])
        frequencies = there.natural_frequencies(7e3)
        predicted, deviation = frequencies.predicted_hz, frequencies.standard_error_hz
        inside = np.abs(predicted[: len(MODES)] - true) <= 1.96 * deviation[: len(MODES)]
        for name, yes in zip(MODES, inside, strict=True):
            found.covered[name] += bool(yes)
        compared = drawn.predict(identified)
        found.peaks += [
            bool(peak.within(compared.level)) for peak in compared.frfs[0].peaks if peak.error_percent is not None
        ]
    return found


def main() -> None:
    """Measure and print; the exit code is 1 where a coverage is rejected."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, nargs="+", default=[2])
    parser.add_argument("--draws", type=int, default=200, help="of each seed")
    parser.add_argument("--processes", type=int, default=1)
    options = parser.parse_args()
    begun = time.perf_counter()
    found = Coverage()
    with ProcessPoolExecutor(options.processes) as pool:
        for one in pool.map(measure, options.seeds, [options.draws] * len(options.seeds)):
            found.add(one)
    seconds = time.perf_counter() - begun
    sys.stdout.write(f"seeds {options.seeds}, {seconds:.0f} s\n{found.report()}\n")
    sys.exit(int(any(found.p_value(name) < REJECTED_AT for name in found.covered)))


if __name__ == "__main__":
    main()
