"""Drive points against the declared form: every convention of a file, noise, measured data."""

import gzip
import os
import pickle
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from receptance import CARBIDE, FRF, STEEL, Assembly, Coordinate, Part, PointJoint, ReceptanceWarning, Segment
from receptance.frf.plausibility import Convention, check_drive_point
from receptance.units import FORMS

MEASURED = Path(__file__).resolve().parents[3] / "shared" / "measured"
SEED = int(os.environ.get("RECEPTANCE_TEST_SEED", "20"))
EVERY = [
    Convention(form, conjugated, flipped) for form in FORMS for conjugated in (False, True) for flipped in (False, True)
]
# Conventions with equal residues and poles, which no peak distinguishes.
TWINS = {"receptance": "accelerance", "accelerance": "receptance"}


def twin(convention):
    """Return the other convention with the same peaks, or None."""
    other = TWINS.get(convention.form)
    return other and Convention(other, convention.conjugated, not convention.flipped)


def draw_drive_point(rng):
    """Draw lines, receptance and noisy accelerance of a tool in a holder, as sensor and analyser would show it."""
    steel, carbide = (replace(m, loss_factor=10.0 ** rng.uniform(-4, -2)) for m in (STEEL, CARBIDE))
    k_y, k_theta = 10.0 ** rng.uniform(7, 9.5), 10.0 ** rng.uniform(3.5, 6)
    tool = Segment(length=rng.uniform(0.03, 0.14), outer_diameter=rng.uniform(0.006, 0.02), material=carbide)
    holder = [Segment(length=0.03, outer_diameter=d, material=steel) for d in (0.035, 0.047, 0.05, 0.042)]
    joint = PointJoint(
        k_y=k_y, k_theta=k_theta, c_y=k_y * 10 ** rng.uniform(-7.5, -5), c_theta=k_theta * 10 ** rng.uniform(-7.5, -5)
    )
    assembly = Assembly([Part([tool], name="tool"), joint, Part(holder, name="holder")])
    lines = np.linspace(20.0, rng.choice([5e3, 12e3]), int(rng.choice([200, 800, 3200])))
    place = Coordinate(rng.choice(["tool", "holder"]), rng.choice([0.0, "end"]), rng.choice(["y", "theta"]))
    if place.position != "end":
        place = replace(place, position=0.0)
    s = 2j * np.pi * lines
    receptance = assembly.receptance(lines, response=place, excitation=place)
    delay = np.exp(1j * np.radians(3.0 * rng.normal()) + s * rng.uniform(-5e-6, 5e-6))
    accelerance = receptance * s**2 * delay * (1.0 + 0.01 * rng.normal(size=lines.size))
    level = 10.0 ** rng.uniform(-3, -0.5) * np.median(np.abs(accelerance)) / np.sqrt(2.0)
    noise = level * (rng.normal(size=lines.size) + 1j * rng.normal(size=lines.size))
    return lines, receptance, accelerance + noise


def as_read(lines, accelerance, convention):
    """Return the values stored in a file of a convention."""
    values = accelerance / (2j * np.pi * lines) ** (2 - FORMS.index(convention.form))
    values = values.conj() if convention.conjugated else values
    return -values if convention.flipped else values


def count_alarms(cases, seed, *, all_forms):
    """Return false alarms and clear verdicts of noisy, correctly declared drive points, in all forms or in one each."""
    rng = np.random.default_rng(seed)
    alarms = clear = 0
    for number in range(cases):
        lines, _, accelerance = draw_drive_point(rng)
        for form in FORMS if all_forms else [FORMS[number % len(FORMS)]]:
            verdict = check_drive_point(lines, as_read(lines, accelerance, Convention(form)), form)
            alarms += verdict.contradicted
            clear += bool(verdict.conventions)
    return alarms, clear


def test_false_alarms_are_rare():
    print(f"seed {SEED}")
    alarms, clear = count_alarms(80, SEED, all_forms=True)
    # Three conventions of one record fail together: at most one record in 80 (measured: none in 9000 conventions).
    assert alarms <= 3
    assert clear > 0.85 * 240


@pytest.mark.slow
def test_false_alarms_are_rare_in_many(summarise):
    # One record fails in all its forms at once, so each is declared in one.
    alarms, clear = count_alarms(400, SEED, all_forms=False)
    text = f"seed {SEED}: {alarms} false alarms and {clear} clear verdicts in 400 noisy drive points as declared"
    summarise("drive points as declared", text, {"seed": SEED, "alarms": alarms, "clear": clear})
    # Measured in 9000: none; 7 where a pole may lie beside its peak.
    assert alarms <= 1
    assert clear > 0.9 * 400


def test_every_convention_against_every_declared_form():
    print(f"seed {SEED}")
    rng = np.random.default_rng(SEED)
    found = dict.fromkeys(((convention, form) for convention in EVERY for form in FORMS), 0)
    clear = 0
    for _ in range(10):
        lines, _, accelerance = draw_drive_point(rng)
        for convention in EVERY:
            values = as_read(lines, accelerance, convention)
            verdicts = [check_drive_point(lines, values, form) for form in FORMS]
            clear += bool(verdicts[0].conventions)
            for form, verdict in zip(FORMS, verdicts, strict=True):
                if verdict.conventions:
                    assert convention in verdict.conventions, (convention, verdict)
                    assert verdict.declared == Convention(form)
                found[convention, form] += verdict.contradicted
    assert clear > 0.85 * 10 * 12
    for (convention, form), alarms in found.items():
        declared = Convention(form)
        expected = convention != declared and twin(convention) != declared
        assert (alarms > 7) if expected else (alarms == 0), (convention, form, alarms)


def test_indistinguishable_conventions_are_both_reported():
    f = np.linspace(900.0, 1100.0, 201)
    for convention in EVERY:
        s = 2j * np.pi * f
        receptance = 1.0 / ((2e3 * np.pi) ** 2 + s**2 + s * 60.0)
        values = as_read(f, receptance * s**2, convention)
        verdict = check_drive_point(f, values, "receptance")
        assert set(verdict.conventions) == {convention, twin(convention)} - {None}
        assert verdict.peaks == 1


def test_a_peak_between_two_lines_determines_form_and_sign():
    # Half a line off either way, half-power band a hundredth of the spacing: only the flanks are seen.
    f = np.linspace(0.5, 400.5, 401)
    w, wr = 2 * np.pi * f, 2 * np.pi * 200.0
    receptance = 1.0 / (wr**2 - w**2 + 2j * 2.5e-5 * wr * w)
    assert not check_drive_point(f, receptance, "receptance").contradicted
    assert check_drive_point(f, -receptance, "receptance").contradicted
    assert check_drive_point(f, receptance * (1j * w), "receptance").contradicted


def test_without_damping_the_time_convention_is_undetermined():
    # A lossless receptance is real: it is its own conjugate, and rounding must not decide.
    bar = Assembly([Part([Segment(length=0.2, outer_diameter=0.02, material=STEEL)], name="bar")])
    rng = np.random.default_rng(SEED)
    for noise in (0.0, 1e-12, 1e-3):
        f = np.linspace(20.0, 14e3, 1400)
        values = bar.receptance(f) * (1.0 + noise * (rng.normal(size=1400) + 1j * rng.normal(size=1400)))
        verdict = check_drive_point(f, values, "receptance")
        assert verdict.peaks >= 2
        assert not verdict.contradicted
        assert Convention("receptance", conjugated=True) in verdict.conventions
        assert check_drive_point(f, -values, "receptance").contradicted


def test_inconsistent_peaks_do_not_contradict():
    # No drive point has residues of both signs: four of five against the declaration are not clear enough.
    f = np.linspace(5.0, 1000.0, 4000)
    signs = (-1.0, -1.0, 1.0, -1.0, -1.0)
    values = sum(
        a / (k**2 - f**2 + 0.02j * k * f) for a, k in zip(signs, (150.0, 300.0, 450.0, 600.0, 750.0), strict=True)
    )
    verdict = check_drive_point(f, values, "receptance")
    assert verdict.peaks == 5
    assert verdict.conventions == ()
    assert not verdict.reason


F = np.arange(2.0, 3001.0, 2.0)
MODES = sum(1.0 / (k**2 - F**2 + 0.022j * k * F) for k in (922.0, 1500.0, 2400.0))
ANGLE = np.angle(MODES)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(
    ("values", "looks_like"),
    [
        (np.abs(MODES) * np.exp(1j * np.deg2rad(ANGLE)), "is within 3.11 degrees: radians read as degrees"),
        (np.abs(MODES) * np.exp(1j * np.rad2deg(ANGLE)), "degrees read as radians, or a phase of another unit"),
        (np.abs(MODES).astype(complex), "a magnitude without a phase, or one part of the FRF"),
        (np.concatenate([MODES[:750], MODES[:749][::-1].conj()]), "the lines above 1500 Hz are the mirrored complex"),
        (MODES, ""),
        (MODES - 2.0 / (922.0**2 - F**2 + 0.022j * 922.0 * F), "3 clear peaks have different signs"),
        (1.0 / (922.0**2 - F**2 + 20j * F) - 1.0 / (1500.0**2 - F**2 + 33j * F), "2 clear peaks have different signs"),
    ],
)
def test_what_no_passive_structure_does_is_reported_with_what_it_looks_like(values, looks_like, form):
    verdict = check_drive_point(F[: values.size], values, form)
    assert bool(verdict.unphysical) == bool(looks_like)
    assert looks_like in verdict.unphysical
    assert verdict.reason.startswith("no passive structure has its phase") == bool(looks_like)
    if looks_like:
        assert verdict.conventions == ()


def test_noise_modes_and_hum_are_not_called_unphysical():
    rng = np.random.default_rng(SEED)
    print(f"seed {SEED}")
    for _ in range(40):
        lines, _, accelerance = draw_drive_point(rng)
        assert not check_drive_point(
            lines, as_read(lines, accelerance, Convention("receptance")), "receptance"
        ).unphysical
        noise = rng.normal(size=lines.size) + 1j * rng.normal(size=lines.size)
        hum = 30.0 * (rng.random(lines.size) < 0.02) * noise
        for values in (noise, 1.0 + 0.3 * noise, 1.0 + 0.01 * noise + hum):
            assert not check_drive_point(lines, values, "accelerance").unphysical


@pytest.mark.parametrize("what", ["noise", "mass", "spring", "one line", "hum", "zeros", "constant"])
def test_no_warning_without_peaks(what):
    rng = np.random.default_rng(3)
    f = np.linspace(1.0, 1000.0, 1000)
    noise = rng.normal(size=1000) + 1j * rng.normal(size=1000)
    values = {
        "noise": noise,
        "mass": -1.0 / f**2 * (1.0 + 0.01 * noise),
        "spring": 1.0 + 0.01 * noise,
        "one line": np.ones(1),
        "hum": 1.0 + 0.01 * noise + 30.0 * np.isin(f, [50.0, 150.0, 250.0]) * noise,
        "zeros": np.zeros(1000),
        "constant": np.ones(1000),
    }[what]
    for form in FORMS:
        verdict = check_drive_point(f[: values.size], values.astype(complex), form)
        assert not verdict.contradicted
        assert verdict.conventions == ()


def test_nonproportional_damping_and_close_modes():
    # Dashpots at random places: modes are complex, residues turn; a drive point stays one.
    rng = np.random.default_rng(SEED)
    print(f"seed {SEED}")
    f = np.linspace(5.0, 3500.0, 800)
    clear = 0
    for _ in range(60):
        n = int(rng.integers(1, 10))
        shapes, _ = np.linalg.qr(rng.normal(size=(n, n)))
        stiffness = shapes @ np.diag((2 * np.pi * rng.uniform(100.0, 3000.0, n)) ** 2) @ shapes.T
        pots = rng.normal(size=(n, int(rng.integers(1, n + 1))))
        damping = pots @ pots.T * 10.0 ** rng.uniform(-3, -1) * 2e4 * n / np.sum(pots**2) + np.eye(n)
        s = 2j * np.pi * f[:, None, None]
        inverse = np.linalg.inv(stiffness + s**2 * np.eye(n) + s * damping)[:, 0, 0]
        clear += bool(check_drive_point(f, inverse, "receptance").conventions)
        assert not check_drive_point(f, inverse, "receptance").contradicted
    assert clear > 50


@pytest.fixture
def drive_point():
    f = np.linspace(900.0, 1100.0, 201)
    return FRF(
        frequency_hz=f, values=1e-3 / (1000.0**2 - f**2 + 10j * f), responses=Coordinate(), excitations=Coordinate()
    )


def test_creation_warns_of_contradictions_and_keeps_the_data(drive_point):
    with pytest.warns(ReceptanceWarning, match="drive point y at 0 m") as caught:
        wrong = drive_point.with_(values=drive_point.values.conj())
    text = str(caught[0].message)
    assert "its only clear peak has the phase of the complex conjugate of receptance (written for e^(-i w t)" in text
    assert "conjugated()" in text
    assert "The data are unchanged" in text
    assert caught[0].filename == __file__
    np.testing.assert_array_equal(wrong.values, drive_point.values.conj())
    assert not wrong.notes
    assert len(wrong.contradictions) == 1
    assert wrong.contradictions[0] in text


def test_reversed_sign_and_another_form_are_both_suggested(drive_point):
    with pytest.warns(ReceptanceWarning, match=r"minus receptance \(reversed sensor .*, or of accelerance"):
        drive_point.flipped()
    with pytest.warns(
        ReceptanceWarning, match=r'clear peak has the phase of mobility \(quantity = "mobility"\); not of receptance'
    ):
        drive_point.to("mobility").with_(form="receptance")


def test_contradictions_follow_the_data(drive_point):
    with pytest.warns(ReceptanceWarning, match="drive point"):
        wrong = drive_point.conjugated().with_(label="T1")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        # FRFs derived from one that was warned of do not warn again.
        for derived in (wrong.to("mobility"), wrong.select(low_hz=950.0), wrong.with_(source="file")):
            assert len(derived.contradictions) == 1
        assert not wrong.conjugated().contradictions
        assert pickle.loads(pickle.dumps(wrong)).contradictions == wrong.contradictions


def test_only_known_drive_points_are_checked(drive_point):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        drive_point.with_(responses="y", excitations="y").flipped()
        drive_point.with_(responses=Coordinate(position=0.1)).flipped()
        both = FRF(
            frequency_hz=drive_point.frequency_hz,
            values=np.concatenate([drive_point.values, -drive_point.values], axis=1),
            responses=[Coordinate(), Coordinate("holder")],
            excitations=[Coordinate()],
        )
    with pytest.warns(ReceptanceWarning, match="drive point y at 'holder' 0 m"):
        both.with_(excitations=Coordinate("holder"))


def test_unusable_lines_are_ignored(drive_point):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        drive_point.with_(usable=drive_point.frequency_hz < 950.0).flipped()


def test_the_measured_drive_point_of_the_modelab_beam():
    # Roving hammer, accelerometer at 0.5 m facing the other way: file 4 is the drive point, with its sign flipped.
    file = MEASURED / "modelab_freefree_beam" / "Hxysv00004.txt.gz"
    if not file.exists():
        pytest.skip(f"measured data absent: {file} is not there")
    text = gzip.decompress(file.read_bytes()).decode("latin-1").splitlines()[9:]
    f, re, im = np.array([[float(word) for word in line.split()] for line in text if line.strip()]).T
    place = Coordinate("beam", 0.5)
    with pytest.warns(ReceptanceWarning, match=r"its 4 clear peaks have the phase of minus accelerance"):
        frf = FRF(
            frequency_hz=f, values=re + 1j * im, form="accelerance", responses=place, excitations=place, label="4:4"
        )
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        right = frf.flipped()
        assert not check_drive_point(f, right.to("accelerance").values.ravel(), "accelerance").contradicted
    for form in FORMS:
        turned = right.to(form)
        lines, values = turned.frequency_hz, turned.values.ravel()
        for declared in FORMS:
            assert check_drive_point(lines, values, declared).contradicted == (declared != form)
            assert check_drive_point(lines, values.conj(), declared).contradicted
    others = sorted(file.parent.glob("Hxysv0000*.txt.gz"))
    assert len(others) == 9
