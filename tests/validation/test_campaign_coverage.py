"""Do the intervals hold where dimensions, materials and sensor err by their tolerances? On the example free-free.

Every draw errs anew, is fitted as the campaign says (with exact dimensions) and predicts the overhang that is held out.
Stiffnesses and natural frequencies must be covered as stated; dampings are not, and peaks of FRFs hardly, which
docs/campaign.md says.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import binomtest

from receptance import Assembly, MeasuredFRF, campaign, examples
from receptance.campaign import Campaign
from receptance.examples.simulated import FREE_FREE_JOINT

SEED = int(os.environ.get("RECEPTANCE_TEST_SEED", "2"))
DRAWS = 200
NOISE = 0.01


def erring(read: Campaign, rng: np.random.Generator) -> tuple[Campaign, dict[str, Assembly]]:
    """Return the campaign measured on structures that err, and these structures by measurement."""
    names = sorted({name for measured in read.measurements.values() for name in measured.effects})
    errs = {name: float(rng.standard_normal()) for name in names}
    measurements, structures = {}, {}
    for name, measured in read.measurements.items():
        seen = measured.observation
        assert isinstance(seen, MeasuredFRF)
        true = seen.assembly.replace(FREE_FREE_JOINT)
        values: dict[str, float] = {}
        for error, moved in measured.effects.items():
            for address, size in moved.items():
                values[address] = values.get(address, true.get(address)) + errs[error] * size
        structures[name] = true = true.replace(values)
        h = true.receptance(seen.frequency_hz, response=seen.response, excitation=seen.excitation)
        noise = NOISE * (rng.standard_normal(h.size) + 1j * rng.standard_normal(h.size))
        again = MeasuredFRF(
            assembly=seen.assembly,
            frequency_hz=seen.frequency_hz,
            receptance=h * np.exp(noise),
            standard_deviation=NOISE,
            response=seen.response,
            excitation=seen.excitation,
            label=name,
        )
        measurements[name] = replace(measured, observation=again)
    return replace(read, measurements=measurements), structures


@pytest.mark.slow
def test_intervals_cover(tmp_path: Path, summarise: Callable[[str, str, object], None]) -> None:
    examples.write("free-free", tmp_path)
    read = campaign.load(tmp_path)
    once = read.table.model_copy(update={"settings": read.table.settings.model_copy(update={"starts": 1})})
    near = tuple(replace(unknown, start=FREE_FREE_JOINT[unknown.address]) for unknown in read.unknowns)
    read = replace(read, table=once, unknowns=near)
    rng = np.random.default_rng(SEED)
    covered = dict.fromkeys([*FREE_FREE_JOINT, "mode 1", "mode 2"], 0)
    excess, rms, peaks = [], [], []
    for _ in range(DRAWS):
        drawn, structures = erring(read, rng)
        found = drawn.identify()
        for address, value in FREE_FREE_JOINT.items():
            low, high = found.interval(address)
            covered[address] += low <= value <= high
        excess.append(found.values["joint.c_theta"] / FREE_FREE_JOINT["joint.c_theta"] - 1.0)
        rms.append(found.rms)
        held_out = drawn.measurements["long"]
        true = structures["long"].natural_frequencies(7e3)[:2]
        model = found.apply(held_out.observation.assembly)
        predicted, scatter = found.propagation.frequencies(model, (1, 2), float(true[1]), held_out.effects)
        for mode, inside in enumerate(np.abs(predicted - true) <= 1.96 * scatter.total, 1):
            covered[f"mode {mode}"] += bool(inside)
        compared = drawn.predict(found)
        peaks += [bool(peak.within(compared.reach)) for peak in compared.frfs[0].peaks if peak.matched]
    lines = [f"seed {SEED}, {DRAWS} draws; residuals {np.median(rms):.2f} standard deviations in the median"]
    for what, count in covered.items():
        test = binomtest(int(count), DRAWS, 0.95)
        ends = test.proportion_ci(0.99, method="exact")
        lines.append(
            f"{what:14s} {count}/{DRAWS} covered, 99 % interval {100 * ends.low:.0f} to {100 * ends.high:.0f} %"
        )
        if what != "joint.c_theta":
            assert test.pvalue > 0.01 / (len(covered) - 1), lines
    lines.append(f"peaks          {sum(peaks)}/{len(peaks)} of the held-out FRF within, two in a draw")
    lines.append(f"joint.c_theta is {100 * np.mean(excess):+.1f} % off on average: see docs/campaign.md")
    summarise(
        "campaign: coverage under tolerances", "\n".join(lines), {"covered": covered, "draws": DRAWS, "seed": SEED}
    )
    assert np.mean(excess) > 0.0, "dampings are no longer too large: the documentation says they are"
