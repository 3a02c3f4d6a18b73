"""A spindle given by its modes in a campaign: fitted with the joint from hits at several places of tool and holder."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import tomli_w

from campaign_lines import merged
from receptance import (
    FRF,
    Assembly,
    Coordinate,
    MeasuredPart,
    ModalPart,
    Mode,
    Part,
    PointJoint,
    PointMass,
    Segment,
    campaign,
    io,
)
from receptance.campaign import CampaignCheck, CampaignError
from receptance.campaign.write import with_campaign_lines
from receptance.cli import main
from receptance.diagnosis.causes import Cause, Parameter, Variant
from receptance.diagnosis.model import Model
from receptance.fit import Predictor
from receptance.fit.parameters import Site
from receptance.model.beams import Material
from receptance.stability import Lobes, critical_depths

STEEL = Material(name="steel", youngs_modulus=210e9, density=7850.0, poisson_ratio=0.3, loss_factor=0.002)
LINES = np.arange(300.0, 3000.0, 10.0)
MODES = (
    Mode(frequency_hz=800.0, damping_ratio=0.03, y=0.28, theta=1.2),
    Mode(frequency_hz=1900.0, damping_ratio=0.025, y=0.35, theta=-2.5),
)
PLACES = {"tip": ("tool", 0.0), "mid": ("tool", 0.03), "nose": ("holder", 0.0), "back": ("holder", 0.05)}
HITS = [("tip", "tip"), ("tip", "mid"), ("tip", "nose"), ("tip", "back"), ("back", "back"), ("nose", "back")]
HELD_OUT = ("mid", "back")
HEAD = """
[materials.steel]
youngs_modulus = "210 GPa"
density = "7850 kg/m^3"
poisson_ratio = 0.3
loss_factor = 0.002

[[parts.tool.segments]]
length = "70 mm"
outer_diameter = "16 mm"
material = "steel"

[[parts.holder.segments]]
length = "90 mm"
outer_diameter = "45 mm"
material = "steel"

[joints.joint]
k_y = "3e8 N/m"
c_y = "100 N s/m"

[[modal_parts.spindle.modes]]
frequency_hz = "780 Hz"

[[modal_parts.spindle.modes]]
frequency_hz = "2 kHz"

[assemblies.machine]
chain = ["tool", "joint", "holder", "spindle"]

[assemblies.longer]
chain = ["tool", "joint", "holder", "spindle"]
set = { "tool.segment[0].length" = "85 mm" }

[settings]
starts = 4

[unknowns]
"joint.k_theta" = { lower = "1e3 N m/rad", upper = "1e6 N m/rad" }
"joint.c_theta" = { lower = "0.01 N m s/rad", upper = "100 N m s/rad" }
"spindle.mode[0].frequency_hz" = { lower = "600 Hz", upper = "1 kHz" }
"spindle.mode[1].frequency_hz" = { lower = "1.6 kHz", upper = "2.4 kHz" }
"spindle.mode[0].damping_ratio" = { lower = 0.005, upper = 0.2 }
"spindle.mode[1].damping_ratio" = { lower = 0.005, upper = 0.2 }
"spindle.mode[0].y" = { lower = "0.01 1/kg**0.5", upper = "1 1/kg**0.5" }
"spindle.mode[1].y" = { lower = "0.01 1/kg**0.5", upper = "1 1/kg**0.5" }
"spindle.mode[0].theta" = { lower = "-10 rad/(m*kg**0.5)", upper = "10 rad/(m*kg**0.5)" }
"spindle.mode[1].theta" = { lower = "-10 rad/(m*kg**0.5)", upper = "10 rad/(m*kg**0.5)" }
"spindle.residual_y" = { lower = "-1e-8 m/N", upper = "1e-8 m/N" }
"spindle.residual_theta" = { lower = "-1e-6 rad/(N m)", upper = "1e-6 rad/(N m)" }
"""


AUTOMATIC = re.sub(r'"spindle\..*\n', "", HEAD)
AUTOMATIC = re.sub(r"\[\[modal_parts(.|\n)*?(?=\[assemblies)", "", AUTOMATIC).replace(
    "[assemblies.machine]", "[modal_parts.spindle]\nidentify = true\nmodes = [{}, {}]\n\n[assemblies.machine]"
)
"""The same, and nothing of the spindle is given but the number of its modes."""

FURTHER = """
[candidates.nose]
kind = "frf"
assembly = "longer"
step = "50 Hz"
lower = "300 Hz"
upper = "2.9 kHz"
standard_deviation = "1 %"

[cuts.roughing]
kind = "milling"
teeth = 4
radial_depth = 0.5
feed = "down"
k_t = "800 MPa"
k_n = "250 MPa"
x = { assembly = "longer" }
y = "as x"

[prediction]
lower = "300 Hz"
upper = "2.9 kHz"
step = "20 Hz"

[stability]
speeds = ["3000 rpm", "6000 rpm"]
draws = 50
"""


def true_machine(overhang: float = 0.07, modes: tuple[Mode, ...] = MODES, *points: PointMass) -> Assembly:
    tool = Part([Segment(length=overhang, outer_diameter=0.016, material=STEEL)], name="tool")
    joint = PointJoint(k_y=3e8, k_theta=4e4, c_y=100.0, c_theta=2.0, name="joint")
    holder = Part([Segment(length=0.09, outer_diameter=0.045, material=STEEL)], name="holder")
    spindle = ModalPart(modes=modes, residual_y=2e-9, residual_theta=3e-7, name="spindle")
    return Assembly([tool, joint, holder, spindle], points)


def highest_lines(assembly: Assembly) -> np.ndarray:
    """Return the frequencies at which the receptance of the tip is larger than on both sides."""
    lines = np.arange(300.0, 3000.0, 0.25)
    size = np.abs(assembly.receptance(lines))
    return lines[1:-1][(size[1:-1] > size[:-2]) & (size[1:-1] > size[2:])]


def write_campaign(
    folder: Path, text: str = HEAD, modes: tuple[Mode, ...] = MODES, step: int = 1, sensor: float = 0.0
) -> campaign.Campaign:
    """Write FRFs of the roving hammer with 1 % noise, seed 5, on every `step`th line, and the campaign, and load it.

    `sensor` is a mass at the response that the campaign does not have.
    """
    rng = np.random.default_rng(5)
    lines = LINES[::step]
    for response, excitation in (*HITS, HELD_OUT):
        mass = PointMass(mass=sensor, part=PLACES[response][0], position=PLACES[response][1])
        h = true_machine(0.07, modes, mass).receptance(
            lines, response=Coordinate(*PLACES[response]), excitation=Coordinate(*PLACES[excitation])
        )
        noise = 0.01 * (rng.normal(size=lines.size) + 1j * rng.normal(size=lines.size))
        name = f"{response}_{excitation}"
        io.write(folder / f"{name}.npz", FRF(frequency_hz=lines, values=h * np.exp(noise), log_variance=1e-4))
        role = "hold out" if (response, excitation) == HELD_OUT else "identify"
        text += f'\n[measurements.{name}]\nkind = "frf"\nassembly = "machine"\nfile = "{name}.npz"\nrole = "{role}"\n'
        for key, place in (("response", response), ("excitation", excitation)):
            part, position = PLACES[place]
            text += f'{key} = {{ part = "{part}", position = "{1e3 * position:g} mm" }}\n'
    (folder / "campaign.toml").write_text(text, encoding="utf-8")
    return campaign.load(folder)


def test_a_spindle_is_fitted_with_the_joint(tmp_path: Path) -> None:
    loaded = write_campaign(tmp_path)
    found = loaded.identify()
    true = true_machine()
    values = found.values
    for address, value in values.items():
        if "residual" not in address:
            assert value == pytest.approx(true.get(address), rel=0.1), address
    assert values["joint.k_theta"] == pytest.approx(4e4, rel=0.02)
    assert values["spindle.mode[0].frequency_hz"] == pytest.approx(800.0, rel=0.005)
    assert found.rms == pytest.approx(1.0, abs=0.1)
    assert np.isfinite(found.covariance).all()
    # Another overhang, which was not measured, and a pair of places that was held out.
    fitted = loaded.built.assemblies["longer"].replace(values)
    off = np.abs(np.log(fitted.receptance(LINES) / true_machine(0.085).receptance(LINES)))
    assert np.median(off) < 0.02
    held = [one for one in loaded.predict(found).frfs if one.rms_decibel is not None]
    assert len(held) == 1
    assert held[0].rms_decibel < 0.5


def test_natural_frequencies_of_a_machine_are_peaks_of_the_tip(tmp_path: Path) -> None:
    """An assembly that ends with modes has intervals of natural frequencies, and so have peaks held out."""
    loaded = write_campaign(tmp_path, HEAD + FURTHER)
    prediction = loaded.predict()
    (longer,) = (one for one in prediction.frequencies if one.name == "longer")
    true = highest_lines(true_machine(0.085))
    assert len(longer.modes) >= 2
    for mode in longer.modes:
        low, high = mode.interval_hz()
        assert 0.0 < high - low < 0.05 * mode.predicted_hz
        assert np.abs(true / mode.predicted_hz - 1.0).min() < 0.02
    assert longer.scatter.errors == {}
    (held,) = (one for one in prediction.frfs if one.measured is not None)
    both = [peak for peak in held.peaks if peak.predicted_hz is not None and peak.measured_hz is not None]
    assert len(both) >= 2
    assert all(peak.within() is not None for peak in both)
    lost = [peak for peak in held.peaks if peak.predicted_hz is not None and peak.deviation_hz is None]
    assert bool(lost) == any("have no interval" in note for note in prediction.notes)
    assert any("distinct peaks of the FRF of the tip" in note for note in prediction.notes)
    assert "Assemblies that were not measured" in prediction.summary(80)


def test_natural_frequencies_of_a_spindle_from_a_table() -> None:
    """The errors of the lines of a table widen the intervals of the peaks."""
    tool = Part([Segment(length=0.085, outer_diameter=0.016, material=STEEL)], name="tool")
    spindle = ModalPart(modes=MODES, residual_y=2e-9, residual_theta=3e-7, name="spindle")
    lines = np.arange(300.0, 3000.0, 2.0)
    matrix = spindle.receptance(lines)
    share = 1e-3 * np.abs(spindle.entries(lines))
    covariance = np.einsum("ni,ij,nj->nij", share, np.eye(3), share)
    exact = MeasuredPart(frequency_hz=lines, matrix=matrix, name="spindle")
    noisy = MeasuredPart(frequency_hz=lines, matrix=matrix, covariance=covariance, name="spindle")
    predicted = [Predictor().at(Site(Assembly([tool, end]), "", "", {})) for end in (exact, noisy)]
    certain, widened = (one.peak_frequencies(lines, one.linear(lines)) for one in predicted)
    assert np.all(certain.standard_error_hz == 0.0)
    assert np.all(widened.standard_error_hz > 0.0)
    assert len(certain.modes) == len(widened.modes) >= 1
    true = highest_lines(Assembly([tool, spindle]))
    for mode in certain.modes:
        assert np.abs(true / mode.predicted_hz - 1.0).min() < 0.02


def test_mistakes_of_a_modal_part(tmp_path: Path) -> None:
    with pytest.raises(CampaignError, match="frequency_hz"):
        write_campaign(tmp_path, HEAD.replace('frequency_hz = "780 Hz"', 'frequency_hz = "780 mm"'))
    with pytest.raises(CampaignError, match="it must be the last element"):
        write_campaign(tmp_path, HEAD.replace('"holder", "spindle"]', '"spindle", "holder"]', 1))
    with pytest.raises(CampaignError, match=r"mode\[2\]"):
        write_campaign(tmp_path, HEAD.replace('"spindle.mode[1].y"', '"spindle.mode[2].y"'))
    with pytest.raises(CampaignError, match="has no mode shape, expected y or theta"):
        write_campaign(tmp_path, re.sub(r'"spindle.mode\[1\].(y|theta)".*\n', "", HEAD))


def test_a_spindle_starts_from_the_measured_frfs(tmp_path: Path) -> None:
    loaded = write_campaign(tmp_path, AUTOMATIC, step=2)
    found = loaded.identify()
    true = true_machine()
    for address, value in found.values.items():
        if address.endswith("_imaginary"):
            assert abs(value) < 0.1 * abs(true.get(address.removesuffix("_imaginary"))), address
        elif "residual" not in address:
            assert value == pytest.approx(true.get(address), rel=0.1), address
    assert found.values["joint.k_theta"] == pytest.approx(4e4, rel=0.02)
    assert found.rms == pytest.approx(1.0, abs=0.1)
    # Bounds that are given are kept.
    bounds = '"spindle.mode[0].frequency_hz" = { lower = "700 Hz", upper = "900 Hz" }\n'
    kept = write_campaign(tmp_path, AUTOMATIC + bounds, step=2).unknowns
    assert [(one.lower, one.upper) for one in kept if one.address == "spindle.mode[0].frequency_hz"] == [(700.0, 900.0)]
    assert len(kept) == len(loaded.unknowns)


BY_EVIDENCE = AUTOMATIC.replace("modes = [{}, {}]", 'modes = "auto"')
"""The same, and the records choose the number of modes."""


def test_a_diagnosis_has_one_mode_more_than_the_records_choose(tmp_path: Path) -> None:
    loaded = write_campaign(tmp_path, BY_EVIDENCE, step=4)

    def count(names: Iterable[str]) -> int:
        return sum(name.startswith("spindle.") and name.endswith(".frequency_hz") for name in names)

    verdict = loaded.diagnose(["calibration_gain"])
    assert count(verdict.base.values) == count(loaded.identify().values) + 1
    assert verdict.verdict == "adequate"


def test_the_records_choose_the_number_of_modes(tmp_path: Path) -> None:
    loaded = write_campaign(tmp_path, BY_EVIDENCE, step=2)
    text = "\n".join(CampaignCheck(loaded).sentences())
    assert "5 unknowns" in text
    assert "The records choose the number of modes of spindle." in text
    fit = loaded.identify()
    assert fit.stabilised is not None
    chosen = fit.stabilised["spindle"]
    assert chosen.used == len(MODES), chosen.criterion
    modes = [name for name in fit.values if name.endswith(".frequency_hz")]
    assert modes == ["spindle.mode[0].frequency_hz", "spindle.mode[1].frequency_hz"]
    assert fit.values["joint.k_theta"] == pytest.approx(4e4, rel=0.02)
    assert fit.rms == pytest.approx(1.0, abs=0.1)
    assert "The records show 2 modes of spindle." in fit.sentences()
    assert fit.to_dict()["number_of_modes"]["spindles"]["spindle"]["chosen"] == 2
    # Modes beyond these have no effect on assemblies that are predicted.
    longer = loaded.predict(fit).frfs[-1]
    true = true_machine(0.085).receptance(longer.frequency_hz)
    assert np.sqrt(np.mean(np.abs(np.log(longer.receptance / true)) ** 2)) < 0.1
    assert not any("not identified" in note for note in loaded.predict(fit).notes)


def critical_depth(lobes: Lobes, machine: Assembly, lowest_hz: float) -> float:
    """Return the least depth in m at which a machine chatters above a frequency, the same in both directions."""
    lines = np.linspace(lowest_hz, 2.5 * lowest_hz, 20000)
    matrix = machine.receptance(lines)[:, None, None] * np.eye(2)
    return float(critical_depths(lobes.cut, lines, matrix)[0].min())


def test_a_measured_mode_above_the_lines_of_a_prediction_limits_the_depth(tmp_path: Path) -> None:
    text = AUTOMATIC.replace("starts = 4", "starts = 1")
    text += FURTHER.replace('upper = "2.9 kHz"\nstep = "20 Hz"', 'upper = "1.5 kHz"\nstep = "20 Hz"')
    modes = (MODES[0], Mode(frequency_hz=1900.0, damping_ratio=0.01, y=0.6, theta=-4.0))
    loaded = write_campaign(tmp_path, text.replace('"6000 rpm"', '"20000 rpm"'), modes=modes, step=4)
    fit = loaded.identify()
    lobes = loaded.stability(fit)["roughing"]
    limit = critical_depth(lobes, loaded.assemblies["longer"].replace(fit.values), 1500.0)
    assert lobes.depth.max() == pytest.approx(limit, rel=0.01)
    assert any("above the lines, which end at 1500 Hz" in note for note in lobes.notes)


def test_a_mode_above_what_was_measured_counts_with_and_without_its_resonance(tmp_path: Path) -> None:
    """It stands for all others, whose resonances are elsewhere: the larger one of two limits counts."""
    above = Mode(frequency_hz=3500.0, damping_ratio=0.02, y=0.35, theta=-2.8)
    text = AUTOMATIC.replace("modes = [{}, {}]", "modes = 3").replace("starts = 4", "starts = 1")
    text += FURTHER.replace('"3000 rpm", "6000 rpm"', '"10000 rpm", "20000 rpm"')
    loaded = write_campaign(tmp_path, text, modes=(*MODES, above), step=4)
    fit = loaded.identify()
    lobes = loaded.stability(fit)["roughing"]
    machine = loaded.assemblies["longer"].replace(fit.values)
    *front, spindle = machine.elements.values()
    assert isinstance(spindle, ModalPart)
    (high,) = [mode for mode in spindle.modes if mode.frequency_hz > 2900.0]
    w = 2.0 * np.pi * high.frequency_hz
    static = replace(
        spindle,
        modes=[mode for mode in spindle.modes if mode is not high],
        residual_y=spindle.residual_y + high.y**2 / w**2,
        residual_theta=spindle.residual_theta + high.theta**2 / w**2,
        residual_ytheta=spindle.residual_ytheta + high.y * high.theta / w**2,
    )
    smaller, larger = sorted(critical_depth(lobes, Assembly([*front, end]), 2900.0) for end in (spindle, static))
    assert smaller < 0.7 * larger
    assert smaller < 0.8 * lobes.depth.max()
    assert lobes.depth.max() <= larger


def test_a_stated_number_of_modes_is_compared_with_the_records(tmp_path: Path) -> None:
    text = AUTOMATIC.replace("modes = [{}, {}]", "modes = 3")
    fit = write_campaign(tmp_path, text, step=4).identify()
    assert fit.stabilised is not None
    assert (fit.stabilised["spindle"].used, fit.stabilised["spindle"].chosen) == (3, 2)
    text = 'The records show 2 of the 3 stated modes of spindle: `modes = "auto"` leaves out the others.'
    assert text in fit.sentences()


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_random_spindles_are_identified_from_measured_frfs(tmp_path: Path, seed: int) -> None:
    rng = np.random.default_rng(seed)
    modes = tuple(
        Mode(
            frequency_hz=rng.uniform(low, high),
            damping_ratio=rng.uniform(0.02, 0.05),
            y=rng.uniform(0.15, 0.4),
            theta=rng.uniform(0.5, 3.0) * rng.choice([-1.0, 1.0]),
        )
        for low, high in ((500.0, 1000.0), (1500.0, 2500.0))
    )
    fit = write_campaign(tmp_path, AUTOMATIC, modes=modes, step=2).identify()
    assert fit.rms == pytest.approx(1.0, abs=0.1)
    for index, mode in enumerate(modes):
        assert fit.values[f"spindle.mode[{index}].frequency_hz"] == pytest.approx(mode.frequency_hz, rel=0.03)


def test_inverse_coupling_refuses_an_unknown_spindle(tmp_path: Path) -> None:
    with pytest.raises(CampaignError, match="spindle, the modal part behind joint, has unknowns"):
        write_campaign(tmp_path, AUTOMATIC, step=10).invert()


KNOWN = AUTOMATIC.replace(
    "identify = true\nmodes = [{}, {}]",
    """residual_y = "2e-9 m/N"
residual_theta = "3e-7 rad/(N m)"
modes = [
  { frequency_hz = "800 Hz", damping_ratio = 0.03, y = "0.28 1/kg**0.5", theta = "1.2 rad/(m*kg**0.5)" },
  { frequency_hz = "1.9 kHz", damping_ratio = 0.025, y = "0.35 1/kg**0.5", theta = "-2.5 rad/(m*kg**0.5)" },
]""",
).replace("starts = 4", "starts = 1")


def with_mode(p: Mapping[str, Parameter], model: Model) -> Iterator[Variant]:
    """Yield a third mode of the spindle."""

    def build(assembly: Assembly) -> Assembly:
        *rest, spindle = assembly.elements.values()
        assert isinstance(spindle, ModalPart)
        more = Mode(frequency_hz=1300.0, damping_ratio=0.02, y=0.0, theta=0.0)
        return Assembly([*rest, replace(spindle, modes=(*spindle.modes, more))])

    yield Variant("one more", lambda model: model.rebuild(build).plus(p["y"].unknown("spindle.mode[2].y")))


ANOTHER = Cause(
    id="another_mode",
    group="structure",
    parameters=(Parameter(name="y", unit="1/kg**0.5", lower=0.0, upper=1.0, typical=0.1),),
    change=with_mode,
    meaning="the spindle has one more mode",
    remedy="identify the spindle with one more mode",
)


@pytest.mark.slow
def test_a_cause_that_changes_the_modal_part_is_written(tmp_path: Path) -> None:
    more = (*MODES, Mode(frequency_hz=1300.0, damping_ratio=0.02, y=0.15, theta=0.0))
    given = write_campaign(tmp_path, KNOWN, modes=more, step=10)
    found = given.diagnose([ANOTHER])
    assert found.explanation is not None
    again = campaign.load(campaign.write_extended(given, found, tmp_path / "extended.toml"))
    spindle = again.assemblies["machine"].elements["spindle"]
    assert isinstance(spindle, ModalPart)
    assert len(spindle.modes) == 3
    fit = again.identify()
    added = [value for name, value in fit.values.items() if not name.startswith("joint.")]
    assert added == pytest.approx([0.15], rel=0.05)
    assert fit.rms == pytest.approx(1.0, abs=0.15)


@pytest.mark.slow
@pytest.mark.parametrize("modes", ['"auto"', "4"])
def test_a_cause_beside_unknown_modes_is_written(tmp_path: Path, modes: str) -> None:
    """All records have a stated sensor, so that the mass that is missing there is written for each place."""
    text = AUTOMATIC.replace("[{}, {}]", modes).replace("starts = 4", "starts = 1")
    text += '[sensors.light]\nmass = "1 g"\n'
    write_campaign(tmp_path, text, step=4, sensor=0.02)
    file = tmp_path / "campaign.toml"
    file.write_text(file.read_text().replace('kind = "frf"\n', 'kind = "frf"\nsensor = "light"\n'))
    given = campaign.load(file)
    found = given.diagnose(["sensor_mass", "calibration_gain"], fast=True)
    assert found.explanation is not None
    assert [cause.id for cause in found.causes] == ["sensor_mass"]
    again = campaign.load(campaign.write_extended(given, found, tmp_path / "extended.toml"))
    assert again.identify().rms == pytest.approx(found.explanation.fit.misfit**0.5, abs=0.05)
    # The lines of the answer leave the modes to the next fit.
    lines = with_campaign_lines(given, found).campaign.lines
    assert not any("spindle" in line for line in lines)
    shorter = tmp_path / "shorter.toml"
    shorter.write_text(tomli_w.dumps(merged(given.contents, lines)))
    fit = campaign.load(shorter).identify()
    assert fit.rms == pytest.approx(1.0, abs=0.1)
    assert fit.values["sensor_mass.mass"] == pytest.approx(0.019, rel=0.15)


@pytest.mark.slow
def test_a_diagnosis_of_a_spindle_ends_with_a_verdict(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    write_campaign(tmp_path, KNOWN.replace("800 Hz", "760 Hz"), step=10)
    target = tmp_path / "extended.toml"
    monkeypatch.setattr(
        "sys.argv", ["receptance", "diagnose", str(tmp_path), "--cause", "spindle_mode", "--extended", str(target)]
    )
    with pytest.raises(SystemExit) as ended:
        main()
    assert not ended.value.code
    output = capsys.readouterr().out
    assert re.search(r"^Verdict +suspected:", output, re.MULTILINE)
    assert "mode at 760 Hz" in output
    assert campaign.load(target).identify().rms == pytest.approx(1.0, abs=0.15)


@pytest.mark.slow
def test_transfer_next_and_stability_with_an_unknown_spindle(tmp_path: Path) -> None:
    text = AUTOMATIC.replace("starts = 4", "starts = 1") + FURTHER
    loaded = write_campaign(tmp_path, text, step=10)
    found = loaded.identify()
    assert found.rms == pytest.approx(1.0, abs=0.15)
    assert "nose" in str(loaded.next_measurement(found).to_dict())
    assert "roughing" in str(loaded.stability(found).to_dict())
    with pytest.raises(CampaignError, match="fewer than two assemblies were measured"):
        loaded.transfer()
    catalogue = '\n[catalogue]\nmachine = ["spindle"]\n'
    with pytest.raises(CampaignError, match="a modal part, which `machine` cannot contain"):
        write_campaign(tmp_path, text + catalogue, step=10)
    frequencies = """
[candidates.counted]
kind = "natural frequencies"
assembly = "longer"
modes = [1]
standard_deviation = "2 Hz"
"""
    with pytest.raises(CampaignError, match=r"natural frequencies are not available .* use the peaks"):
        write_campaign(tmp_path, text + frequencies, step=10)


def test_mistakes_of_an_unknown_modal_part(tmp_path: Path) -> None:
    with pytest.raises(CampaignError, match="has no frequency_hz, expected one, or `identify = true`"):
        write_campaign(tmp_path, AUTOMATIC.replace("identify = true", "identify = false"))
    with pytest.raises(
        CampaignError, match=r'is "auto", which is for modes that are identified; add `identify = true`'
    ):
        write_campaign(tmp_path, BY_EVIDENCE.replace("identify = true", "identify = false"))
    with pytest.raises(CampaignError, match=r'is "automatic", expected "auto", a number of modes, or their tables'):
        write_campaign(tmp_path, BY_EVIDENCE.replace('"auto"', '"automatic"'))
    bounds = '"spindle.mode[0].frequency_hz" = { lower = "700 Hz", upper = "900 Hz" }\n'
    with pytest.raises(CampaignError, match=r'belongs to a mode of spindle, whose modes are "auto"'):
        write_campaign(tmp_path, BY_EVIDENCE + bounds)
    with pytest.raises(CampaignError, match="is a rigid-body mode"):
        write_campaign(tmp_path, AUTOMATIC.replace("[{}, {}]", '[{ frequency_hz = "0 Hz" }, {}]'))
    with pytest.raises(CampaignError, match="expected one of the two"):
        write_campaign(tmp_path, AUTOMATIC.replace('"85 mm" }', '"85 mm", "spindle.mode[0].y" = "0.2 1/kg**0.5" }'))
    with pytest.raises(CampaignError, match="there is no FRF for identification of an assembly"):
        write_campaign(tmp_path, AUTOMATIC.replace('"holder", "spindle"]', '"holder"]'))
