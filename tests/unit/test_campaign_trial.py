"""A campaign at chosen values: curves beside the measurements, causes, fits with held values, lobes."""

from __future__ import annotations

import numpy as np
import pytest

from receptance import Assembly, PointMass, campaign, examples
from receptance.diagnosis import CATALOGUE

NAMES = ("40 mm", "55 mm", "70 mm")


@pytest.fixture(scope="module")
def sensor(tmp_path_factory):
    folder = tmp_path_factory.mktemp("sensor")
    examples.write("forgotten-sensor", folder)
    return campaign.load(folder, threads=1)


@pytest.fixture(scope="module")
def identified(sensor):
    return sensor.identify()


def test_records_of_an_identification_are_those_of_its_assemblies(sensor, identified):
    trial = sensor.trial(identified)
    assert tuple(trial.records) == NAMES
    fitted = dict(zip(identified.labels, identified.assemblies, strict=True))
    for name in sensor.to_identify:
        record = trial.records[name]
        seen = record.observation
        expected = fitted[name].receptance(seen.frequency_hz, response=seen.response, excitation=seen.excitation)
        np.testing.assert_allclose(record.calculated, expected, rtol=1e-9)
        ratio = seen.receptance / expected
        np.testing.assert_allclose(record.difference_db, 20.0 * np.log10(np.abs(ratio)), atol=1e-8)
        np.testing.assert_allclose(record.difference_deg, np.degrees(np.angle(ratio)), atol=1e-6)
    assert [record.held_out for record in trial.records.values()] == [name in sensor.held_out for name in NAMES]


def test_a_move_changes_curves_and_the_fit_goes_back(sensor, identified):
    trial = sensor.trial(identified)
    moved = trial.at({"joint.k_theta": 0.5 * trial.values["joint.k_theta"]})
    assert moved.misfit > 1.5 * trial.misfit
    assert not np.allclose(moved.records["40 mm"].calculated, trial.records["40 mm"].calculated, rtol=1e-3)
    assert moved.fit().misfit == pytest.approx(trial.fit().misfit, rel=1e-3)


def test_a_fit_weighs_by_the_noise_and_stays_at_its_optimum(sensor, identified):
    trial = sensor.trial(identified)
    fitted = trial.fit()
    assert fitted.misfit <= trial.misfit * (1.0 + 1e-6)
    again = fitted.fit()
    for name in ("joint.k_y", "joint.k_theta"):
        assert again.values[name] == pytest.approx(fitted.values[name], rel=1e-3)


def test_held_values_stay_in_the_fit(sensor, identified):
    trial = sensor.trial(identified)
    held = 1.3 * trial.values["joint.k_theta"]
    fitted = trial.at({"joint.k_theta": held}).fit({"joint.k_theta"})
    assert fitted.values["joint.k_theta"] == pytest.approx(held, rel=1e-12)
    assert fitted.values["joint.k_y"] != pytest.approx(trial.values["joint.k_y"], rel=1e-3)
    assert fitted.misfit >= trial.fit().misfit * (1.0 - 1e-9)


def test_values_beyond_bounds_and_unknown_names_are_refused(sensor):
    trial = sensor.trial()
    with pytest.raises(ValueError, match=r"joint\.k_theta is -1, expected from 100 to 1e\+07 N m/rad"):
        trial.at({"joint.k_theta": -1.0})
    with pytest.raises(ValueError, match=r"no unknown.*joint\.k_teta.*did you mean.*joint\.k_theta"):
        trial.at({"joint.k_teta": 1e5})


def test_a_sensor_of_some_mass_is_a_point_mass_where_it_measures(sensor, identified):
    trial = sensor.trial(identified)
    (variant, *_) = trial.variants_of(CATALOGUE["sensor_mass"])
    heavier = trial.with_causes([variant])
    (mass,) = (name for name in heavier.values if name not in trial.values)
    for grams in (0.0, 2.0):
        record = heavier.at({mass: 1e-3 * grams}).records["40 mm"]
        seen = record.observation
        assembly = trial.measured_assembly("40 mm")
        if grams:
            first = next(iter(assembly.elements))
            mass_on_tip = PointMass(mass=1e-3 * grams, part=first, position=0.0, name="more")
            assembly = Assembly(assembly.elements.values(), [*assembly.attachments.values(), mass_on_tip])
        expected = assembly.receptance(seen.frequency_hz, response=seen.response, excitation=seen.excitation)
        np.testing.assert_allclose(record.calculated, expected, rtol=1e-8)
    assert dict(heavier.with_causes([]).values) == dict(trial.values)


def test_an_overhang_and_any_address_can_be_moved(sensor, identified):
    trial = sensor.trial(identified).with_overhangs()
    (name,) = (name for name in trial.values if name.startswith("overhang"))
    moved = trial.at({name: 1e-3})
    before, after = trial.measured_assembly("55 mm"), moved.measured_assembly("55 mm")
    assert after.length - before.length == pytest.approx(1e-3, rel=1e-9)
    address = "holder.segment[0].length"
    wider = trial.with_parameter("tool.segment[0].poisson_ratio")
    assert wider.values["tool.segment[0].poisson_ratio"] == before.parts["tool"].segments[0].material.poisson_ratio
    with pytest.raises(ValueError, match="unknown already"):
        wider.with_parameter("tool.segment[0].poisson_ratio")
    with pytest.raises(ValueError, match=r"no measured assembly has.*did you mean"):
        trial.with_parameter(address.replace("length", "lenght"))


def test_lobes_are_those_of_the_campaign_with_these_values(tmp_path):
    examples.write("machine", tmp_path)
    machine = campaign.load(tmp_path, threads=1)
    identified = machine.identify()
    trial = machine.trial(identified)
    lobes = trial.stability(["slot"])["slot"]
    np.testing.assert_allclose(lobes.depth, machine.stability(identified, cuts=["slot"])["slot"].depth, rtol=1e-9)
    softer = trial.at({"collet.k_theta": 0.8 * trial.values["collet.k_theta"]})
    assert not np.allclose(softer.stability(["slot"])["slot"].depth, lobes.depth, rtol=1e-3)


def test_modes_of_a_record_are_beside_those_of_the_model(sensor, identified):
    trial = sensor.trial(identified)
    for name in sensor.to_identify:
        seen = sensor.measurements[name]
        highest = np.abs(seen.receptance * seen.frequency_hz).argmax()
        (mode,) = [mode for mode in trial.modes(name) if np.isfinite(mode.measured_hz)]
        assert mode.measured_hz == pytest.approx(seen.frequency_hz[highest], rel=5e-3)
        assert mode.difference_percent == pytest.approx(100.0 * (mode.calculated_hz / mode.measured_hz - 1.0))
        assert abs(mode.difference_percent) < 1.0
        assert mode.calculated_damping == pytest.approx(mode.measured_damping, rel=0.3)
    softer = trial.at({"joint.k_theta": 0.5 * trial.values["joint.k_theta"]})
    lower = [mode.calculated_hz for mode in softer.modes("40 mm")]
    assert lower[0] < trial.modes("40 mm")[0].calculated_hz
    assert softer.modes("40 mm")[0].measured_hz == trial.modes("40 mm")[0].measured_hz


def test_natural_frequencies_are_beside_those_of_the_model_by_number(tmp_path):
    examples.write("er32", tmp_path)
    loaded = campaign.load(tmp_path, threads=1)
    trial = loaded.trial()
    for name, seen in list(loaded.measurements.items())[:3]:
        modes = trial.modes(name)
        np.testing.assert_array_equal([mode.measured_hz for mode in modes], seen.frequency_hz)
        calculated = trial.measured_assembly(name).lowest_natural_frequencies(max(seen.modes))[0]
        np.testing.assert_allclose([m.calculated_hz for m in modes], calculated[np.array(seen.modes) - 1], rtol=1e-12)


def test_an_error_of_a_tolerance_has_the_effect_that_the_file_states(sensor):
    trial = sensor.trial().with_overhangs()
    name = 'assemblies."40 mm".set."tool.segment[0].length"'
    assert trial.is_error(name)
    assert not trial.is_error("joint.k_y")
    assert trial.at({name: -2.0}).effect(name) == pytest.approx((-2e-4, "m"))
    change, unit = trial.at({"materials.carbide.loss_factor": 1.0}).effect("materials.carbide.loss_factor")
    assert (unit, change) == ("%", pytest.approx(100.0 * np.expm1(0.5)))
    assert trial.effect("joint.k_y") is None
    overhang = next(unknown.name for unknown in trial.unknowns if unknown.name.startswith("overhang"))
    assert trial.at({overhang: 0.003}).effect(overhang) == (0.003, "m")
