"""Tolerances of a campaign: their list, their share in results, and the coverage of intervals."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from campaign_text import TEXT, by_name, changed, load
from receptance import Assembly, Observation, identify
from receptance.campaign import Campaign, CampaignError
from receptance.campaign.prediction import predict_assembly

SEED = 20161107
JOINT = {"joint.k_y": 3.5e8, "joint.k_theta": 6.0e4}
DAMPED = {"joint.c_y": 150.0, "joint.c_theta": 0.03}
LINES = np.linspace(400.0, 12e3, 700)


def shifted(campaign: Campaign, assembly: str, draws: dict[str, float], sensor: bool = False) -> Assembly:
    """Return an assembly with the true joint whose errors are `draws` standard deviations."""
    found = campaign.assemblies[assembly].replace(JOINT)
    moves: dict[str, float] = {}
    for error in campaign.tolerances[assembly]:
        for address, size in error.moves.items():
            moves[address] = moves.get(address, found.get(address)) + draws.get(error.name, 0.0) * size
    return found.replace(moves)


def with_frequencies(campaign: Campaign, draws: dict[str, float], noise: np.random.Generator | None) -> Campaign:
    """Return the campaign with frequencies measured on assemblies that err."""
    measurements = {}
    for name, measured in campaign.measurements.items():
        true = shifted(campaign, measured.configuration, draws).natural_frequencies(20e3)[:2]
        read = true if noise is None else true + 2.0 * noise.standard_normal(2)
        measurements[name] = Observation.from_modes(
            assembly=campaign.assemblies[measured.configuration], frequency_hz=read, standard_deviation_hz=2.0,
            label=name, configuration=measured.configuration, conditions=measured.conditions,
        )  # fmt: skip
    return replace(campaign, measurements=measurements)


@pytest.fixture(scope="module")
def campaign(tmp_path_factory: pytest.TempPathFactory) -> Campaign:
    return load(tmp_path_factory.mktemp("campaign"))


def errors_of(campaign: Campaign) -> list[str]:
    return sorted({error.name for tolerances in campaign.tolerances.values() for error in tolerances})


def test_large_relative_tolerances_keep_the_sign(tmp_path: Path) -> None:
    """A loss factor with 50 % would be negative at two standard deviations; its logarithm is fitted instead."""
    text = changed(
        ('poisson_ratio = 0.22\ntolerance = { youngs_modulus = "0.5 %",',
         'poisson_ratio = 0.22\nloss_factor = 0.001\ntolerance = { loss_factor = "50 %", youngs_modulus = "0.5 %",')
    )  # fmt: skip
    tolerances = load(tmp_path, text).tolerances["short"]
    (loss,) = [one for one in tolerances if one.name == "materials.carbide.loss_factor"]
    assert loss.relative
    assert set(loss.moves.values()) == {0.5}
    assert not any(one.relative for one in tolerances if one is not loss)


def test_list_of_tolerance_errors(campaign: Campaign) -> None:
    """A blank's diameter and a material are one error everywhere; an overhang that an assembly sets is its own."""
    assert errors_of(campaign) == [
        'assemblies.long.set."tool.segment[0].length"',
        'assemblies.longest.set."tool.segment[0].length"',
        "materials.carbide.density",
        "materials.carbide.youngs_modulus",
        "parts.holder.segments[1].outer_diameter",
        "parts.tool.segments[0].length",
        "parts.tool.segments[0].outer_diameter",
    ]
    short = by_name(campaign.tolerances["short"])
    assert short["materials.carbide.youngs_modulus"] == {
        "tool.segment[0].youngs_modulus": pytest.approx(0.005 * 580e9),
        "holder.segment[0].core.youngs_modulus": pytest.approx(0.005 * 580e9),
    }
    assert short["parts.tool.segments[0].outer_diameter"] == {"tool.segment[0].outer_diameter": pytest.approx(6e-6)}
    assert by_name(campaign.tolerances["long"])['assemblies.long.set."tool.segment[0].length"'] == {
        "tool.segment[0].length": pytest.approx(5e-5)
    }


def test_tolerances_of_one_name_are_one_error(tmp_path: Path) -> None:
    named = '{ length = { value = "0.05 mm", name = "gauge" }, outer_diameter = "0.05 %" }'
    text = changed(
        ('{ length = "0.05 mm", outer_diameter = "0.05 %" }', named),
        ('{ outer_diameter = "0.1 mm" }', '{ outer_diameter = { value = "0.1 mm", name = "gauge" } }'),
        ('conditions = { torque = "135 N m" }', 'tolerance = { "tool.segment[*].density" = "1 %" }'),
    )
    found = load(tmp_path, text)
    gauge = {"tool.segment[0].length": pytest.approx(5e-5), "holder.segment[1].outer_diameter": pytest.approx(1e-4)}
    assert all(by_name(found.tolerances[name])["gauge"] == gauge for name in found.assemblies)
    own = by_name(found.tolerances["short"])['assemblies.short.tolerance."tool.segment[*].density"']
    assert own == {"tool.segment[0].density": pytest.approx(145.0)}
    assert "tool.segment[0].density" not in by_name(found.tolerances["short"])["materials.carbide.density"]
    assert "tool.segment[0].density" in by_name(found.tolerances["long"])["materials.carbide.density"]


def test_the_reaction_of_the_fit_is_that_of_refits(campaign: Campaign) -> None:
    """Against differences of whole fits and predictions, error by error."""
    exact = with_frequencies(campaign, {}, None).identify()
    predicted = {one.name: one for one in with_frequencies(campaign, {}, None).predict(exact).frequencies}
    step = 0.05
    for error in errors_of(campaign):
        ends = []
        for sign in (1.0, -1.0):
            # The error is in the blank, not in the model: the fit changes in the opposite direction.
            wrong = with_frequencies(campaign, {error: sign * step}, None)
            found = wrong.identify()
            values = np.log10([found.values[address] for address in JOINT])
            modes = {
                one.name: one.predicted_hz - np.array(one.measured_hz)
                for one in wrong.predict(found).frequencies
                if one.measured_hz is not None
            }
            ends.append((values, modes["long"]))
        moved = (ends[0][0] - ends[1][0]) / (2.0 * step)
        if error in exact.errors:
            # Two frequencies determine two stiffnesses for any errors, so the posterior of these is the prior.
            stated = exact.scatter().errors[error][: len(JOINT)]
            assert stated == pytest.approx(-moved, rel=2e-3, abs=1e-7)
        else:
            assert np.abs(moved).max() < 1e-9
        change = (ends[0][1] - ends[1][1]) / (2.0 * step)
        stated = predicted["long"].scatter.errors.get(error, np.zeros(2))
        assert stated == pytest.approx(-change, rel=5e-3, abs=1e-5), error


def test_standard_errors_with_and_without_tolerances(campaign: Campaign) -> None:
    found = with_frequencies(campaign, {}, None).identify()
    for address in JOINT:
        assert found.standard_errors[address] > found.data_errors[address]
        low, high = found.interval(address)
        exact = found.interval(address, exact=True)
        assert low < exact[0] < exact[1] < high
        assert low * high == pytest.approx(found.values[address] ** 2)
    with pytest.raises(ValueError, match="was not identified"):
        found.interval("joint.c_y")


def test_the_error_of_data_is_that_of_a_fit_with_exact_dimensions(campaign: Campaign) -> None:
    measured = with_frequencies(campaign, {}, None)
    found = measured.identify()
    record = list(measured.to_identify.values())
    exact = identify(record, campaign.unknowns, starts=1)
    for address in JOINT:
        assert found.data_errors[address] == pytest.approx(exact.standard_errors[address], rel=1e-3)
        assert found.interval(address, exact=True) == pytest.approx(exact.interval(address), rel=1e-4)


def test_without_tolerances_data_are_the_only_error(tmp_path: Path) -> None:
    bare = "\n".join(line for line in TEXT.splitlines() if not line.startswith("tolerance"))
    found = load(tmp_path, bare).identify()
    assert found.errors == ()
    assert found.data_errors == pytest.approx(found.standard_errors)
    assert not any("toleranc" in note for note in found.notes)


def test_tolerances_need_standard_deviations(tmp_path: Path) -> None:
    text = changed(('"10000 Hz"]\nstandard_deviation = "2 Hz"', '"10000 Hz"]'))
    for run in (Campaign.identify, Campaign.transfer):
        with pytest.raises(CampaignError, match=r"measurements\.short: has no standard deviation"):
            run(load(tmp_path, text))
    text = TEXT + '\n[settings]\nobjective = "percentage"\n'
    with pytest.raises(CampaignError, match=r'settings\.objective: is "percentage"'):
        load(tmp_path, text).identify()


def test_inconsistent_data_do_not_override_tolerances(campaign: Campaign) -> None:
    """Readings stated fifty times too exact: the fit finds their scatter, and errors stay within their tolerances."""
    rng = np.random.default_rng(SEED)
    measured = {}
    for name in campaign.assemblies:
        true = campaign.assemblies[name].replace(JOINT).natural_frequencies(40e3)[:4]
        measured[name] = Observation.from_modes(
            assembly=campaign.assemblies[name], frequency_hz=true * (1.0 + 0.01 * rng.standard_normal(4)),
            standard_deviation_hz=2e-4 * true, label=name,
        )  # fmt: skip
    found = replace(campaign, measurements=measured, errors=campaign.tolerances).identify()
    assert 0.004 < found.discrepancy.frequency < 0.02
    assert 15.0 < found.rms < 90.0
    assert max(abs(found.values[name]) for name in found.errors) < 2.5
    for address, value in JOINT.items():
        low, high = found.interval(address, 0.999)
        assert low < value < high
    assert any("the model leaves residuals of" in text for text in found.advice)


@pytest.mark.slow
def test_tolerances_in_receptances(campaign: Campaign) -> None:
    """The scatter of a predicted FRF and the part of each error in it, against assemblies drawn from the posterior."""
    rng = np.random.default_rng(SEED)
    found = {}
    for name, one in campaign.measurements.items():
        true = campaign.assemblies[one.configuration].replace(JOINT).replace(DAMPED)
        noise = 0.002 * (rng.standard_normal(LINES.size) + 1j * rng.standard_normal(LINES.size))
        found[name] = Observation(
            assembly=campaign.assemblies[one.configuration].replace(DAMPED), frequency_hz=LINES,
            receptance=true.receptance(LINES) * np.exp(noise), standard_deviation=0.002, label=name,
            configuration=one.configuration, conditions=one.conditions,
        )  # fmt: skip
    measured = replace(campaign, measurements=found)
    identified = measured.identify()
    stated = next(one for one in measured.predict(identified).frfs if one.name == "long")
    place = replace(campaign.site("long"), assembly=found["long"].assembly)
    predicted = predict_assembly(campaign, identified, place, campaign.tolerances["long"], "long", [])
    drawn = [one for one in predicted.assemblies(700, SEED) if one is not None]
    logs = np.log([one.receptance(LINES, threads=1) for one in drawn])
    away = logs.real.std(axis=0) < 0.03  # in the linear range
    assert away.mean() > 0.5
    phase = np.angle(np.exp(1j * (logs.imag - np.angle(stated.receptance))))
    for part, scatter in ((logs.real, stated.scatter), (phase, stated.phase_scatter)):
        spread = part.std(axis=0)[away]
        assert scatter.total[away] == pytest.approx(spread, rel=0.08, abs=1e-3 * spread.max())
        for error, address in (
            ("materials.carbide.density", "tool.segment[0].density"),
            ('assemblies.long.set."tool.segment[0].length"', "tool.segment[0].length"),
        ):
            values = np.array([one.get(address) for one in drawn])
            error_of_draw = (values - values.mean()) / values.std()
            change = (error_of_draw @ (part - part.mean(axis=0)) / len(drawn))[away]
            # The slope of a regression on draws is uncertain by the spread over the root of their number.
            off = np.abs(scatter.errors[error][away] - change) / (spread / np.sqrt(len(drawn)))
            assert np.median(off) < 2.0, error


def test_unidentified_parameters_are_reported(tmp_path: Path) -> None:
    """A parameter without a measurement keeps its start, with a note."""
    other = '[joints.joint]\n[joints.other]\nk_y = "1e8 N/m"\nk_theta = "1e5 N m/rad"'
    unknown = '"other.k_y" = { lower = "1e7 N/m", upper = "1e9 N/m" }'
    text = changed(
        ("[joints.joint]", other),
        ('longest]\nchain = ["tool", "joint"', 'longest]\nchain = ["tool", "other"'),
        ("[unknowns]", f"[unknowns]\n{unknown}"),
    )
    found = load(tmp_path, text).predict()
    assert "other.k_y is not identified" in " ".join(found.notes)
    assert "at start values" in " ".join(found.notes)
