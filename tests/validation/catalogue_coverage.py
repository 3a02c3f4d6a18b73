"""Are predicted tools right? `python tests/validation/catalogue_coverage.py --seed S --cases N [--spindle PERCENT]`.

Every case is a machine of its own, SIMULATED: joint, spindle and materials err by their tolerances. The joint between
tool and holder is identified from the tip FRFs of two blanks with 1 % noise, each with an overhang that errs as well;
then the tip of one tool of the catalogue, another holder, flutes, an overhang with an error, is predicted with what the
campaign states. Compared are the modes that stand out up to 5 kHz with those of the true machine. Counted is how often
natural frequencies are within 2 %, and how often the 95 % interval of the most flexible mode holds the truth (one mode
a case, as the modes of one machine are not independent), against 95 % by an exact binomial test at the 1 % level.
With `--spindle 1` the spindle is a table of receptances at its nose with 1 % noise on every line and entry instead, the
joint is known to 5 %, and its damping to 20 %.
"""

from __future__ import annotations

import argparse
import json
import sys
import tempfile
import time
import warnings
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy import stats

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from machine_with_catalogue import HOLDERS, TEXT, TRUE_K_THETA
from receptance import Assembly, Coordinate, DampedModes, MeasuredPart, campaign, damped_modes
from receptance.catalogue import Catalogue, ToolPrediction, predict_catalogue, read_holders, read_tools
from receptance.errors import ReceptanceWarning
from receptance.fit import Tolerance

LEVEL = 0.95
REJECTED_AT = 0.01
WITHIN = 0.02
QUANTITIES = ("natural frequency", "damping ratio", "dynamic stiffness")
LINES = np.arange(300.0, 4000.0, 4.0)
NOISE = 0.01
STRONG = 10.0
"""Modes that are up to so many times as stiff as the most flexible one count."""


@dataclass(frozen=True)
class Outcome:
    """The modes of one tool: predicted over true, and whether the truth is in the interval."""

    case: int
    errors: list[float]
    covered: tuple[bool, bool, bool]


def text_of(folder: Path) -> str:
    """The campaign with measured FRFs instead of natural frequencies; blanks' overhangs err by 0.1 mm."""
    head, rest = TEXT.split("[measurements.short]")
    measured = "".join(
        f'[measurements.{name}]\nkind = "frf"\nassembly = "{name}"\nfile = "{name}.csv"\nstandard_deviation = "1 %"\n\n'
        for name in ("short", "long")
    )
    head = head.replace('length = "60 mm"\n', 'length = "60 mm"\ntolerance = { length = "0.1 mm" }\n')
    unknowns = '[unknowns]\n"collet.k_theta" = { lower = "1e3 N m/rad", upper = "1e7 N m/rad" }\n'
    more = '"collet.c_theta" = { lower = "1e-3 N m s/rad", upper = "1e2 N m s/rad" }\n'
    tail = rest.split("[unknowns]")[1].split("\n", 2)[2]
    settings = "\n[settings]\nstarts = 2\nprofiles = false\n"
    known = head.replace('c_theta = "0.4 N m s/rad"\n', "")
    return known + measured + unknowns + more + settings + tail


def tool(rng: np.random.Generator) -> str:
    """A catalogue with one tool."""
    holder = rng.choice(["er32", "shrink"])
    overhang, diameter = rng.uniform(50.0, 120.0), rng.choice([10.0, 12.0, 16.0])
    flutes = rng.uniform(0.3, 0.6) * overhang
    head = "name,holder,material,overhang [mm],diameter [mm],flute length [mm],effective diameter [%]"
    return f"{head}\nT,{holder},carbide,{overhang:.2f},{diameter:g},{flutes:.2f},80\n"


def erring(
    assembly: Assembly, tolerances: Iterable[Tolerance], errors: dict[str, float], rng: np.random.Generator
) -> Assembly:
    """The assembly with drawn errors; what has the same name in several assemblies is one error."""
    moved: dict[str, float] = {}
    for one in tolerances:
        error = errors.setdefault(one.name, float(rng.standard_normal()))
        for address, deviation in one.moves.items():
            moved[address] = moved.get(address, 0.0) + deviation * error
    return assembly.replace({address: assembly.get(address) + change for address, change in moved.items()})


def measure(seed: int, case: int) -> Outcome:
    """Return how one tool in one machine is predicted."""
    rng = np.random.default_rng([seed, case])
    with tempfile.TemporaryDirectory() as name, warnings.catch_warnings():
        warnings.simplefilter("ignore", ReceptanceWarning)
        folder = Path(name)
        (folder / "campaign.toml").write_text(text_of(folder))
        (folder / "tools.csv").write_text(tool(rng))
        (folder / "holders.csv").write_text(HOLDERS)
        errors: dict[str, float] = {}
        truth = {
            "collet.k_theta": TRUE_K_THETA * np.exp(0.3 * rng.standard_normal()),
            "collet.c_theta": 0.4 * np.exp(0.3 * rng.standard_normal()),
        }
        for blank in ("short", "long"):
            write(folder / f"{blank}.csv", np.ones(LINES.size, np.complex128))
        described = campaign.load(folder)
        for blank in ("short", "long"):
            true = erring(described.assemblies[blank].replace(truth), described.tolerances[blank], errors, rng)
            noise = NOISE * rng.standard_normal((2, LINES.size))
            write(folder / f"{blank}.csv", true.receptance(LINES, threads=1) * np.exp(noise[0] + 1j * noise[1]))
        read = campaign.load(folder, threads=1)
        catalogue = Catalogue(read)
        predicted = next(predict_catalogue(catalogue, read.identify()))
        own = next(iter(catalogue))
        true = damped_modes(erring(own.site.assembly.replace(truth), own.tolerances, errors, rng), 5300.0, threads=1)
    return compared(case, predicted, true)


def measure_with_table(seed: int, case: int, share: float) -> Outcome:
    """Return how one tool is predicted with a spindle that is known as a table with noise."""
    rng = np.random.default_rng([seed, case])
    text = TEXT.split("[measurements.short]")[0] + "[prediction]" + TEXT.split("[prediction]")[1]
    text = text.replace('c_theta = "0.4 N m s/rad"', f'c_theta = "0.4 N m s/rad"\nk_theta = "{TRUE_K_THETA} N m/rad"')
    text = text.replace("[joints.taper]", 'tolerance = { k_theta = "5 %", c_theta = "20 %" }\n\n[joints.taper]')
    text = text.replace('machine = ["taper", "spindle"]\nattachments = ["front", "rear"]', 'machine = ["taper"]')
    with tempfile.TemporaryDirectory() as name, warnings.catch_warnings():
        warnings.simplefilter("ignore", ReceptanceWarning)
        folder = Path(name)
        (folder / "campaign.toml").write_text(text)
        (folder / "tools.csv").write_text(tool(rng))
        (folder / "holders.csv").write_text(HOLDERS)
        read = campaign.load(folder, threads=1)
        rows, holders = read_tools(folder / "tools.csv"), read_holders(folder / "holders.csv")
    beams = erring(read.assemblies["short"], [Tolerance(name="front", moves={"front.k_y": 1.25e7})], {}, rng)
    lines = np.arange(50.0, 5000.0, 2.5)
    places = [Coordinate("spindle", 0.0, "y"), Coordinate("spindle", 0.0, "theta")]
    shaft = beams.elements["spindle"]
    matrix = Assembly([shaft], beams.attachments.values()).receptance(lines, response=places, excitation=places)
    entries = np.stack([matrix[:, 0, 0], matrix[:, 1, 1], matrix[:, 0, 1]], axis=1)
    deviation = share * np.abs(entries)
    real, imaginary = deviation * rng.standard_normal((2, *deviation.shape))
    error = real + 1j * imaginary
    nose = MeasuredPart(
        frequency_hz=lines,
        matrix=matrix + np.stack([error[:, [0, 2]], error[:, [2, 1]]], axis=1),
        covariance=np.einsum("ni,ij->nij", deviation**2, np.eye(3)).astype(complex),
        name="nose",
    )
    catalogue = Catalogue(read, rows, holders, spindle=nose)
    predicted = next(predict_catalogue(catalogue))
    own = next(iter(catalogue))
    front = erring(own.site.assembly, own.tolerances, {}, rng)
    elements = [element for name, element in front.elements.items() if name != "nose"]
    true = damped_modes(Assembly([*elements, shaft], beams.attachments.values()), 5300.0, threads=1)
    return compared(case, predicted, true)


def compared(case: int, predicted: ToolPrediction, true: DampedModes) -> Outcome:
    """Return the modes of a prediction beside the nearest ones of the true machine."""
    values = np.stack([true.frequency_hz, true.damping_ratio, true.dynamic_stiffness], axis=1)
    modes, interval = predicted.modes, predicted.modes_interval
    strong = np.flatnonzero(modes[:, 2] <= STRONG * modes[:, 2].min())
    nearest = [int(np.argmin(np.abs(values[:, 0] - modes[i, 0]))) for i in strong]
    most = predicted.most_flexible
    assert most is not None
    there = values[nearest[list(strong).index(most)]]
    inside = (interval[most, :, 0] <= there) & (there <= interval[most, :, 1])
    errors_of_modes = [float(modes[i, 0] / values[j, 0] - 1.0) for i, j in zip(strong, nearest, strict=True)]
    return Outcome(case, errors_of_modes, (bool(inside[0]), bool(inside[1]), bool(inside[2])))


def write(path: Path, values: np.ndarray) -> None:
    """Write a receptance as a table."""
    rows = [f"{f:g},{g.real:.9e},{g.imag:.9e}" for f, g in zip(LINES, values, strict=True)]
    path.write_text("\n".join(["frequency [Hz],receptance real [m/N],receptance imaginary [m/N]", *rows]) + "\n")


def report(outcomes: list[Outcome]) -> tuple[dict[str, object], str]:
    """Return the results as plain values and as text."""
    errors = np.array([error for one in outcomes for error in one.errors])
    all_within = sum(max(map(abs, one.errors)) <= WITHIN for one in outcomes)
    lines = [
        f"natural frequencies: {np.mean(np.abs(errors) <= WITHIN):.1%} of {errors.size} within {WITHIN:.0%}, rms "
        f"{np.sqrt(np.mean(errors**2)):.2%}, worst {np.abs(errors).max():.2%}; all modes of a tool within it: "
        f"{all_within} of {len(outcomes)}"
    ]
    rows = []
    for index, quantity in enumerate(QUANTITIES):
        hits = sum(one.covered[index] for one in outcomes)
        test = stats.binomtest(hits, len(outcomes), LEVEL)
        low, high = test.proportion_ci(0.95)
        rows.append({"quantity": quantity, "cases": len(outcomes), "covered": hits, "p_value": test.pvalue})
        lines.append(
            f"{quantity:17s} of the most flexible mode in its 95 % interval: {hits} of {len(outcomes)} "
            f"({100 * low:.1f} to {100 * high:.1f} %), binomial p = {test.pvalue:.3f}"
        )
    return {"within": all_within, "modes": errors.size, "coverage": rows}, "\n".join(lines)


def main() -> None:
    """Measure, print, write JSON if requested; the exit code is 1 if a requirement is not met."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--cases", type=int, default=200)
    parser.add_argument("--spindle", type=float, default=0.0, help="noise in percent of a spindle known as a table")
    parser.add_argument("--json", type=Path)
    options = parser.parse_args()
    begun = time.perf_counter()
    outcomes = [
        measure_with_table(options.seed, case, options.spindle / 100.0)
        if options.spindle
        else measure(options.seed, case)
        for case in range(options.cases)
    ]
    found, text = report(outcomes)
    seconds = time.perf_counter() - begun
    sys.stdout.write(f"seed {options.seed}, {options.cases} virtual machines, {seconds:.0f} s\n{text}\n")
    if options.json:
        options.json.write_text(json.dumps({"seed": options.seed, **found}), encoding="utf-8")
    coverage = found["coverage"]
    assert isinstance(coverage, list)
    within = found["within"]
    assert isinstance(within, int)
    sys.exit(int(within < LEVEL * len(outcomes) or coverage[0]["p_value"] < REJECTED_AT))


if __name__ == "__main__":
    main()
