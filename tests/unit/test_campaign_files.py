"""Data files of campaigns: FRFs and hammer records, additions by the campaign, and the simulated examples."""

from __future__ import annotations

import dataclasses
import shutil
import tomllib
from pathlib import Path

import numpy as np
import pytest

from campaign_text import TEXT, by_name
from receptance import FRF, Observation, PointMass, ReceptanceWarning, campaign, examples
from receptance.campaign import Campaign, CampaignError
from receptance.examples.simulated import FREE_FREE_JOINT, HAMMER_JOINT
from receptance.io import TimeSeries, write

LINES = np.linspace(300.0, 4000.0, 300)
BASE = TEXT.partition("[measurements.short]")[0]
UNKNOWNS = "[unknowns]" + TEXT.partition("[unknowns]")[2]
pytestmark = pytest.mark.filterwarnings("ignore::receptance.ReceptanceWarning")


@pytest.fixture(scope="module")
def free_free(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("free-free")
    examples.write("free-free", folder)
    return folder


@pytest.fixture(scope="module")
def hammer(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("hammer")
    examples.write("hammer", folder)
    return folder


def load(folder: Path, measurement: str, kind: str = "frf") -> Campaign:
    text = f'{BASE}[measurements.m]\nkind = "{kind}"\nassembly = "short"\n{measurement}\n{UNKNOWNS}'
    (folder / "campaign.toml").write_text(text)
    return campaign.load(folder)


def make_observations(folder: Path, measurement: str) -> Observation:
    data = load(folder, measurement).measurements["m"]
    assert data.is_receptance
    return data


def mistake(folder: Path, measurement: str, kind: str = "frf") -> str:
    with pytest.raises(CampaignError) as error:
        load(folder, measurement, kind)
    return str(error.value)


def values(size: int = 1) -> np.ndarray:
    one = 1e-6 / (1.0 - (LINES / 2000.0) ** 2 + 0.01j)
    return one if size == 1 else one[:, None, None] * np.arange(1.0, size * size + 1.0).reshape(1, size, size)


class TestFRF:
    def test_all_fields_from_the_file(self, tmp_path: Path) -> None:
        write(tmp_path / "m.csv", FRF(frequency_hz=LINES, values=values(), log_variance=4e-4))
        data = make_observations(tmp_path, 'file = "m.csv"')
        assert data.receptance == pytest.approx(values(), rel=1e-12)
        assert data.standard_deviation == pytest.approx(np.full(LINES.size, 0.02))
        assert (data.response.part, data.response.position, data.response.direction) == ("tool", 0.0, "y")

    def test_campaign_supplies_fields_missing_in_the_file(self, tmp_path: Path) -> None:
        rows = [f"{f!r},{v.real!r},{v.imag!r}" for f, v in zip(LINES.tolist(), values().tolist(), strict=True)]
        (tmp_path / "m.csv").write_text("\n".join(rows) + "\n")
        columns = 'columns = ["frequency [Hz]", "mobility real [mm/s/N]", "mobility imaginary [mm/s/N]"]'
        data = make_observations(tmp_path, f'file = "m.csv"\n{columns}\nstandard_deviation = "3 %"')
        expected = 1e-3 * values() / (2j * np.pi * LINES)
        assert data.receptance == pytest.approx(expected, rel=1e-12)
        assert data.standard_deviation == pytest.approx(np.full(LINES.size, 0.03))

    def test_sign_place_and_sensor(self, tmp_path: Path) -> None:
        write(tmp_path / "m.npz", FRF(frequency_hz=LINES, values=values()))
        places = (
            'response = { part = "holder", position = "end", direction = "-y" }\nexcitation = { position = "10 mm" }'
        )
        read = load(tmp_path, f'file = "m.npz"\nsensor = "accelerometer"\n{places}')
        data = read.measurements["m"]
        assert data.is_receptance
        assert data.receptance == pytest.approx(-values(), rel=1e-12)
        assert (data.response.part, data.response.position) == ("holder", "end")
        assert (data.excitation.part, data.excitation.position) == ("tool", 0.01)
        mass = data.assembly.attachments["accelerometer"]
        assert isinstance(mass, PointMass)
        assert (mass.mass, mass.part, mass.position) == (0.6e-3, "holder", "end")
        assert "accelerometer" not in read.assemblies["short"].attachments
        assert by_name(read.errors["m"])["sensors.accelerometer.mass"] == {"accelerometer.mass": pytest.approx(0.02e-3)}
        both = 'response = { direction = "-y" }\nexcitation = { direction = "-y" }'
        assert make_observations(tmp_path, f'file = "m.npz"\n{both}').receptance == pytest.approx(values(), rel=1e-12)

    def test_bands_floor_and_window(self, tmp_path: Path) -> None:
        write(tmp_path / "m.npz", FRF(frequency_hz=LINES, values=values(), log_variance=4e-4))
        data = make_observations(
            tmp_path,
            'file = "m.npz"\nbands = [["500 Hz", "1 kHz"], ["3 kHz", "9 kHz"]]\nfloor = "1.5 %"\ndecay_rate = "20 1/s"',
        )
        real = data.frequency_hz.real
        assert np.all(((real >= 500.0) & (real <= 1000.0)) | (real >= 3000.0))
        assert data.frequency_hz.imag == pytest.approx(np.full(real.size, -20.0 / (2.0 * np.pi)))
        assert data.standard_deviation == pytest.approx(np.full(real.size, 0.025))

    def test_variance_from_coherence_and_averages(self, tmp_path: Path) -> None:
        rng = np.random.default_rng(1)
        hits = values() * (1.0 + 0.05 * (rng.standard_normal((10, 300)) + 1j * rng.standard_normal((10, 300))))
        coherence = np.abs(hits.mean(axis=0)) ** 2 / np.mean(np.abs(hits) ** 2, axis=0)
        write(tmp_path / "m.npz", FRF(frequency_hz=LINES, values=hits.mean(axis=0), coherence=coherence))
        with pytest.warns(ReceptanceWarning, match=r"measurements\.m: .*`averages = 10` for example, and standard"):
            read = load(tmp_path, 'file = "m.npz"')
        data = read.measurements["m"]
        assert data.is_receptance
        assert data.standard_deviation is None
        with pytest.raises(CampaignError, match=r"no standard deviation.*number of averaged .* `averages = 10` for"):
            read.diagnose(causes=["sensor_mass"])
        with pytest.warns(ReceptanceWarning, match="because averages is 1: the coherence of a single record is"):
            load(tmp_path, 'file = "m.npz"\naverages = 1')
        assert make_observations(tmp_path, 'file = "m.npz"\nignore_coherence = true').standard_deviation is None
        spread = make_observations(tmp_path, 'file = "m.npz"\naverages = 10').standard_deviation
        assert spread is not None
        assert spread == pytest.approx(np.full(300, 0.05 / np.sqrt(10.0)), rel=0.4)

    def test_an_entry_of_many(self, tmp_path: Path) -> None:
        labels = (("tip", "nose"), ("hammer a", "hammer b"))
        many = FRF(frequency_hz=LINES, values=values(2), labels=labels)
        write(tmp_path / "m.npz", many)
        words = mistake(tmp_path, 'file = "m.npz"')
        assert "holds 2 responses and 2 excitations" in words
        assert "tip, nose" in words
        data = make_observations(tmp_path, 'file = "m.npz"\nentry = { response = "nose", excitation = 0 }')
        assert data.receptance == pytest.approx(3.0 * values(), rel=1e-12)
        write(tmp_path / "n.uff", [FRF(frequency_hz=LINES, values=values() * k, label=f"{k}") for k in (1, 2)])
        assert "FRFs, expected one" in mistake(tmp_path, 'file = "n.uff"')
        data = make_observations(tmp_path, 'file = "n.uff"\nentry = { number = 1 }')
        assert data.receptance == pytest.approx(2.0 * values(), rel=1e-9)
        assert "holds 2 FRFs, expected `entry.number`" in mistake(tmp_path, 'file = "n.uff"\nentry = { number = 2 }')

    @pytest.mark.parametrize(
        ("measurement", "words"),
        [
            (
                'file = "m.npz"\nbands = [["10 kHz", "20 kHz"]]',
                "without a usable line, expected one within 300 to 4000 Hz",
            ),
            ('file = "m.npz"\nbands = [["1 kHz", "500 Hz"]]', "expected the lower end first"),
            ('file = "m.npz"\nbands = [["1 kHz"]]', "expected at least 2"),
            ('file = "m.npz"\nbands = ["1 kHz", "2 kHz"]', "expected a list in square brackets"),
            ('file = "m.npz"\nstandard_deviation = "2 mm"', "expected a standard deviation of the FRF in percent"),
            ('file = "m.npz"\nstandard_deviation = "0 %"', "expected more than zero"),
            ('file = "m.npz"\nfloor = "-1 %"', "measurements.m.floor"),
            ('file = "m.npz"\naverages = 5', "states averages 10 and the campaign 5"),
            ('file = "m.npz"\nresponse = { position = "61 mm" }', "expected at most the length 60 mm of part"),
            ('file = "m.npz"\nresponse = { part = "joint" }', 'is "joint", which is not a part of this file'),
            ('file = "m.npz"\nquantity = "admittance"', "measurements.m.quantity"),
            ('file = "m.npz"\nunit = "m/s^2"', "measurements.m.file"),
            ('file = "m.npz"\ncoherence = "c.npz"', 'measurements.m.coherence: is "c.npz", which does not exist'),
            ('file = "m.npz"\nentry = { response = 1.5 }', "measurements.m.entry.response"),
            ('file = "empty.csv"', "the file is empty"),
            ('file = "plain.csv"', "plain.csv"),
            ('file = "campaign.toml"', "measurements.m.file"),
            ('file = "."', "which is a folder"),
        ],
    )
    def test_mistakes(self, measurement: str, words: str, tmp_path: Path) -> None:
        write(tmp_path / "m.npz", FRF(frequency_hz=LINES, values=values(), averages=10))
        (tmp_path / "empty.csv").write_bytes(b"")
        (tmp_path / "plain.csv").write_text("1,2,3\n2,3,4\n")
        output = mistake(tmp_path, measurement)
        assert words in output
        assert "line " in output

    def test_suspicious_data_give_notes_and_warnings(self, tmp_path: Path) -> None:
        """A drive point whose imaginary part has the wrong sign, as of a conjugated file."""
        write(tmp_path / "m.npz", FRF(frequency_hz=LINES, values=values().conj()))
        with pytest.warns(match=r"measurements\.m: .*conjugate"):
            read = load(tmp_path, 'file = "m.npz"')
        assert any("conjugate" in note for note in read.notes)
        assert read.measurements["m"].notes


def test_the_same_data_twice(tmp_path: Path) -> None:
    """Another file with the same numbers is named; another place or other noise is another measurement."""
    write(tmp_path / "m.npz", FRF(frequency_hz=LINES, values=values()))
    write(tmp_path / "copy.npz", FRF(frequency_hz=LINES, values=values(), label="copy"))
    again = '\n\n[measurements.again]\nkind = "frf"\nassembly = "long"\nfile = "copy.npz"'
    words = r"measurements\.again: its data are exactly those of measurements\.m \(m\.npz, copy\.npz\)"
    with pytest.warns(match=words):
        read = load(tmp_path, f'file = "m.npz"{again}')
    assert sum("exactly those of" in note for note in read.notes) == 1
    write(tmp_path / "copy.npz", FRF(frequency_hz=LINES, values=values() * (1.0 + 1e-9)))
    assert not load(tmp_path, f'file = "m.npz"{again}').notes


class TestHammer:
    def test_the_same_record_twice(self, tmp_path: Path, hammer: Path) -> None:
        for name in ("short.npz", "copy.npz"):
            shutil.copy(hammer / "short.npz", tmp_path / name)
        text = 'file = ["short.npz", "copy.npz"]\nforce = "hammer"\nmotion = "tip"'
        assert "the same record more than once: short.npz and copy.npz" in mistake(tmp_path, text, "hammer records")

    def test_records_of_several_files(self, tmp_path: Path, hammer: Path) -> None:
        """Each hit in a file of its own, as some recorders write them."""
        with np.load(hammer / "short.npz", allow_pickle=False) as file:
            names = list(file)
        assert names
        series = _series(hammer / "short.npz")
        hits = [series.values[k * 10240 : (k + 1) * 10240] for k in range(3)]
        for number, hit in enumerate(hits):
            one = TimeSeries(values=hit, channels=["hammer", "tip"], units=["N", "m/s^2"], sample_rate_hz=25600.0)
            write(tmp_path / f"{number}.csv", one)
        files = ", ".join(f'"{number}.csv"' for number in range(3))
        text = f'file = [{files}]\nforce = 0\nmotion = "tip"\nbands = [["200 Hz", "4 kHz"]]'
        read = load(tmp_path, text, "hammer records")
        assert read.files_of("m") == ("0.csv", "1.csv", "2.csv")
        assert any("H1 of 3 hits" in note for note in read.notes)
        assert "H1 of 2 hits" in " ".join(load(tmp_path, f"{text}\ndrop_hits = [2]", "hammer records").notes)
        with pytest.warns(match="reversed sensor or hammer"):
            turned = load(tmp_path, f"{text}\nreverse = true", "hammer records").measurements["m"]
        right = read.measurements["m"]
        assert turned is not None
        assert right is not None
        assert np.allclose(turned.receptance, -right.receptance)

    def test_limit_of_force_drop(self, tmp_path: Path, hammer: Path) -> None:
        shutil.copy(hammer / "short.npz", tmp_path)
        text = (
            'file = "short.npz"\nforce = "hammer"\nmotion = "tip"\ndecay_rate = "10 1/s"\n'
            'bands = [["100 Hz", "9.5 kHz"]]\nforce_drop_db = '
        )
        highest = []
        for drop in (6.0, 20.0, 40.0):
            read = load(tmp_path, f"{text}{drop}", "hammer records")
            data = read.measurements["m"]
            assert data.is_receptance
            highest.append(data.frequency_hz[-1].real)
            if drop < 40.0:
                notes = read.measurements["m"].notes
                assert any(f"over {drop:g} dB down (force_drop_db)" in note for note in notes)
                (reported,) = [note for note in notes if "of the band from 100 to 9500 Hz" in note]
                assert f"to {highest[-1]:g} Hz; the others are not usable" in reported
        assert highest[0] < 6e3 < highest[1] < 9e3 < highest[2]
        assert "force_drop_db: is 0" in mistake(tmp_path, f"{text}0", "hammer records")

    def test_error_for_unweighted_single_hit_names_the_keys(self, tmp_path: Path, hammer: Path) -> None:
        series = _series(hammer / "short.npz")
        one = TimeSeries(
            values=series.values[:10240], channels=["hammer", "tip"], units=["N", "m/s^2"], sample_rate_hz=25600.0
        )
        write(tmp_path / "one.npz", one)
        write(tmp_path / "f.npz", FRF(frequency_hz=LINES, values=values(), log_variance=4e-4))
        text = 'file = "one.npz"\nforce = "hammer"\nmotion = "tip"\nbands = [["200 Hz", "4 kHz"]]'
        other = '\n[measurements.f]\nkind = "frf"\nassembly = "short"\nfile = "f.npz"'
        output = mistake(tmp_path, text + other, "hammer records")
        assert "measurements.m: has no standard deviation, but other measurements have one" in output
        assert 'at least two hits, whose scatter is the variance, or `floor = "2 %"`' in output
        load(tmp_path, text + '\nfloor = "2 %"' + other, "hammer records")

    def test_limit_of_second_contact(self, tmp_path: Path, hammer: Path) -> None:
        """The third hit has a second contact of 27 %, a loss of 4.8 dB; where it is kept it can be dropped by hand."""
        shutil.copy(hammer / "medium.npz", tmp_path)
        text = 'file = "medium.npz"\nforce = "hammer"\nmotion = "tip"\nbands = [["200 Hz", "4 kHz"]]\ndrop_hits = [3]'
        notes = {
            limit: " ".join(load(tmp_path, f"{text}\ndouble_hit_loss_db = {limit}", "hammer records").notes)
            for limit in (4, 6)
        }
        assert "hit 3 dropped: double hit: a contact with 27 %" in notes[4]
        assert "double hit:" not in notes[6]
        assert "hit 3 dropped: dropped by the campaign" in notes[6]
        with pytest.raises(CampaignError, match="double_hit_loss_db"):
            load(tmp_path, f"{text}\ndouble_hit_loss_db = -1", "hammer records")

    @pytest.mark.parametrize(
        ("measurement", "words"),
        [
            ('file = "s.csv"\nforce = "hamer"\nmotion = "tip"', "hamer"),
            ('file = "s.csv"\nforce = "tip"\nmotion = "hammer"', "expected the force of the hammer"),
            ('file = "s.csv"\nforce = "hammer"', "measurements.m.motion: is missing"),
            (
                'file = "s.csv"\nforce = "hammer"\nmotion = "tip"\nforce_window = "2 mm"',
                'expected a time such as "2 ms"',
            ),
            ('file = "s.csv"\nforce = "hammer"\nmotion = "tip"\ntrigger = "1 kN"', "no hit"),
            ('file = []\nforce = "hammer"\nmotion = "tip"', "is an empty list"),
            (
                'file = ["s.csv", "t.csv"]\nforce = "hammer"\nmotion = "tip"',
                'file[1]: is "t.csv", which does not exist',
            ),
            ('file = 3\nforce = "hammer"\nmotion = "tip"', "expected the name of a file, or a list of them"),
            ('file = "m.npz"\nforce = "hammer"\nmotion = "tip"', "no time series"),
        ],
    )
    def test_mistakes(self, measurement: str, words: str, tmp_path: Path) -> None:
        time = np.arange(2048) / 25600.0
        force = np.where((time > 0.01) & (time < 0.0103), 50.0, 0.0)
        motion = np.exp(-100.0 * time) * np.sin(5000.0 * time)
        series = TimeSeries(
            values=np.stack([force, motion], axis=1), channels=["hammer", "tip"], units=["N", "m/s^2"],
            sample_rate_hz=25600.0,
        )  # fmt: skip
        write(tmp_path / "s.csv", series)
        write(tmp_path / "m.npz", FRF(frequency_hz=LINES, values=values()))
        assert words in mistake(tmp_path, measurement, "hammer records")


def _series(file: Path) -> TimeSeries:
    from receptance.io import read_time_series

    return read_time_series(file)


class TestExamples:
    def test_examples_are_reproduced_bitwise(self, free_free: Path, tmp_path: Path) -> None:
        examples.write("free-free", tmp_path)
        for file in free_free.iterdir():
            assert (tmp_path / file.name).read_bytes() == file.read_bytes()

    @pytest.mark.parametrize("name", ["free-free", "hammer"])
    def test_examples_are_labelled_as_simulated(self, name: str, request: pytest.FixtureRequest) -> None:
        folder = request.getfixturevalue(name.replace("-", "_"))
        text = (folder / "campaign.toml").read_text()
        assert "SIMULATED" in tomllib.loads(text)["description"]
        assert "simulated" in tomllib.loads(text)["title"]
        assert "SIMULATED" in examples.EXAMPLES[name].title
        read = campaign.load(folder)
        for measured in read.measurements.values():
            assert any("simulated" in note for note in measured.notes)

    @pytest.mark.parametrize(("name", "joint"), [("free-free", FREE_FREE_JOINT), ("hammer", HAMMER_JOINT)])
    def test_true_joint_is_identified(self, name: str, joint: dict[str, float], request: pytest.FixtureRequest) -> None:
        read = campaign.load(request.getfixturevalue(name.replace("-", "_")))
        text = read.table.description
        found = read.identify()
        assert found.converged
        assert not found.advice
        for address, value in joint.items():
            low, high = found.interval(address)
            assert low < value < high, address
            # Of the data alone: three standard errors, so that no draw of the noise decides.
            assert abs(found.values[address] - value) < 3.0 * found.standard_errors[address], address
            assert address.split(".")[1] in text, "the description states the joint"
        prediction = read.predict(found)
        held_out = next(frf for frf in prediction.frfs if frf.measured is not None)
        assert (held_out.share_within(prediction.level) or 0.0) > 0.9
        assert len(held_out.peaks) == 2
        assert all(peak.within(prediction.level) for peak in held_out.peaks)

    def test_undeclared_window_biases_the_damping(self, hammer: Path, tmp_path: Path) -> None:
        """The windowed FRF taken for an ordinary one: the damping comes out too large by the window."""
        read = campaign.load(hammer)
        right = read.identify()
        measurements = {}
        for name, measured in read.measurements.items():
            data = measured
            assert data.is_receptance
            measurements[name] = Observation(
                assembly=data.assembly, frequency_hz=data.frequency_hz.real, receptance=data.receptance,
                response=data.response, excitation=data.excitation, standard_deviation=data.standard_deviation,
                label=name, configuration=data.configuration, conditions=data.conditions,
            )  # fmt: skip
        wrong = dataclasses.replace(read, measurements=measurements).identify()
        excess = wrong.values["collet.c_theta"] - right.values["collet.c_theta"]
        assert not right.rejection
        assert wrong.rejection.widened
        assert excess > 10.0 * right.standard_errors["collet.c_theta"]

    def test_a_damaged_data_file(self, free_free: Path, tmp_path: Path) -> None:
        folder = tmp_path / "copy"
        shutil.copytree(free_free, folder)
        lines = (folder / "medium.csv").read_text().splitlines()
        lines[700] = "oops"
        (folder / "medium.csv").write_text("\n".join(lines))
        with pytest.raises(CampaignError, match=r"measurements\.medium\.file: medium\.csv.*line 701"):
            campaign.load(folder)


def test_one_file_with_two_names_is_noted(tmp_path: Path) -> None:
    rng = np.random.default_rng(6)
    noise = 0.02 * (rng.standard_normal(300) + 1j * rng.standard_normal(300))
    data = campaign.load(write_copies(tmp_path, values() * np.exp(noise)))
    assert any("again and m have the same numbers (300 of 300)" in text for text in data.identify().advice)


def write_copies(folder: Path, receptance: np.ndarray) -> Path:
    write(folder / "m.npz", FRF(frequency_hz=LINES, values=receptance, log_variance=4e-4))
    tables = "".join(
        f'[measurements.{name}]\nkind = "frf"\nassembly = "short"\nfile = "m.npz"\n' for name in ("again", "m")
    )
    (folder / "campaign.toml").write_text(f"{BASE}{tables}{UNKNOWNS}")
    return folder
