"""Reasons of a verdict: codes with values, of which sentences and JSON are made."""

from __future__ import annotations

import json
import re
from pathlib import Path

import numpy as np
import pytest

from blank_in_holder import make_assembly
from receptance import Observation, PointMass, diagnosis
from receptance.diagnosis import Reason, Verdict, diagnose
from receptance.diagnosis.model import DATA_HOLDER, TABLE, Model
from receptance.diagnosis.text import SENTENCES, Size
from receptance.fit.unknowns import Tolerance

LINES = np.linspace(200.0, 6000.0, 300)
SEED = 20261128
OVERHANGS = (0.05, 0.07, 0.09)
JOINT = {
    "joint.k_y": (1e6, 1e11),
    "joint.k_theta": (1e2, 1e8),
    "joint.c_y": (1e-1, 1e6),
    "joint.c_theta": (1e-4, 1e3),
}
MODULUS = Tolerance(name="tool", moves={"tool.segment[*].youngs_modulus": 0.01}, relative=True)


def measured(mass: float, factor: float = 1.0, overhangs: tuple[float, ...] = OVERHANGS) -> list[Observation]:
    """Return records of tools with a sensor that the model does not have, times a factor, with 1 % of noise."""
    rng = np.random.default_rng(SEED)
    print("seed", SEED)
    return [
        Observation(
            assembly=make_assembly(overhang),
            frequency_hz=LINES,
            receptance=factor
            * make_assembly(overhang, PointMass(mass=mass)).receptance(LINES)
            * np.exp(0.01 * (rng.normal(size=LINES.size) + 1j * rng.normal(size=LINES.size))),
            standard_deviation=0.01,
            label=f"{1e3 * overhang:.0f} mm",
        )
        for overhang in overhangs
    ]


def codes(verdict: Verdict) -> set[str]:
    return {reason.code for reason in verdict.reasons}


def test_limits_of_the_data_and_doubts_are_codes() -> None:
    several = diagnose(measured(2e-3), JOINT, tolerances=MODULUS, causes=["sensor_mass", "time_delay"], max_causes=1)
    assert (several.verdict, codes(several)) == ("named", set())
    single = diagnose(measured(2e-3)[:1], JOINT, causes=["sensor_mass", "time_delay"], max_causes=1, fast=True)
    assert single.verdict == "suspected"
    assert {"fast_diagnosis", "no_tolerances", "single_configuration", "fast"} <= codes(single)
    (doubt,) = [reason for reason in single.reasons if reason.code == "fast"]
    assert doubt.values["title"] == single.causes[0].title


def test_json_has_codes_and_values_and_notes_their_sentences() -> None:
    # A hundred grams are more than any sensor has.
    verdict = diagnose(measured(0.1), JOINT, tolerances=MODULUS, causes=["sensor_mass"], max_causes=1)
    assert verdict.verdict == "suspected"
    written = json.loads(json.dumps(verdict.to_dict(), allow_nan=False))
    assert [reason["code"] for reason in written["reasons"]] == [reason.code for reason in verdict.reasons]
    (unusual,) = [reason["values"] for reason in written["reasons"] if reason["code"] == "unusual_size"]
    (size,) = unusual["sizes"]
    assert (size["name"], size["unit"], size["lower"], size["upper"]) == ("mass", "kg", 0.0, 0.03)
    assert size["value"] == pytest.approx(0.1, rel=0.02)
    assert written["notes"] == [str(reason) for reason in verdict.reasons]
    assert not verdict.causes[0].plausible
    assert verdict.causes[0].implausible == tuple(verdict.reasons[0].values["sizes"])


def test_every_code_has_a_sentence() -> None:
    """A code without one would end a diagnosis where it is shown."""
    folder = Path(next(iter(diagnosis.__path__)))
    sources = [*folder.glob("*.py"), folder.parent / "campaign" / "diagnosis.py"]
    given = re.compile(r'(?:Reason\(\s*|doubt\(|\bcode(?:, \w+(?:\["\w+"\])?)? = )"(\w+)"')
    used = {code for source in sources for code in given.findall(source.read_text(encoding="utf-8"))}
    assert used | {DATA_HOLDER, TABLE} == SENTENCES.keys()


def test_sentences_show_values_in_units_and_lists_in_words() -> None:
    size = Size("log_density tool", "", np.log(0.7), np.log(0.75), np.log(1.25))
    assert str(size) == "density tool -30 % (plausible: -25 to +25 %)"
    assert str(Size("mass", "kg", 0.06, 0.0, 0.03)) == "mass 60.0 g (plausible: 0.0 to 30.0 g)"
    causes = ["sensor_mass", "time_delay", "mine"]
    assert "mass of the sensor, delay of a channel and mine" in str(Reason("ends_with_table", {"causes": causes}))
    values = {"title": "mass {0}", "sizes": {f"k{number}": 1e8 for number in range(6)}}
    text = str(Reason("large_sizes", values))
    assert text.startswith("mass {0} is not certain: k0 = 1e+08, k1 = 1e+08, ")
    assert "and 2 more" in text


def test_separate_held_out_records_confirm_a_cause() -> None:
    """They may be given in Python as in a campaign; they are not fitted."""
    held_out = Model(tuple(measured(2e-3, overhangs=(0.06, 0.08))), (), (MODULUS,))
    causes = ["sensor_mass", "time_delay"]
    verdict = diagnose(measured(2e-3), JOINT, tolerances=MODULUS, causes=causes, max_causes=1, held_out=held_out)
    assert (verdict.verdict, [cause.id for cause in verdict.causes]) == ("named", ["sensor_mass"])
    assert verdict.gain is not None
    assert [fold["configuration"] for fold in verdict.gain.folds] == ["60 mm", "80 mm"]
    assert verdict.gain.held_out_after < 0.5 * verdict.gain.held_out_before
    alone = diagnose(measured(2e-3), JOINT, tolerances=MODULUS, causes=causes, max_causes=1)
    assert verdict.causes[0].parameters == alone.causes[0].parameters


def test_the_largest_number_of_causes_is_checked() -> None:
    for number in (0, 1.5, True):
        with pytest.raises(ValueError, match=r"max_causes is .*, expected a whole number of at least 1"):
            diagnose(measured(2e-3), JOINT, max_causes=number)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="most"):
        diagnose(measured(2e-3), JOINT, most=1)  # type: ignore[call-arg]
