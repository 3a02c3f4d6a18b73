"""The report of a diagnosis: complete, escaped, without network, and rendered in a browser."""

from __future__ import annotations

import re
import shutil
import subprocess
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from receptance import (
    CARBIDE,
    STEEL,
    Assembly,
    MeasuredFrequencies,
    MeasuredFRF,
    Part,
    PointJoint,
    PointMass,
    Segment,
    Unknown,
)
from receptance.diagnosis import diagnose
from receptance.diagnosis.by_mode import curves, residuals_by_mode
from receptance.diagnosis.report import diagnosis_html, write_diagnosis

SEED = 20261122
LINES = np.linspace(200.0, 6000.0, 500)
TITLE = '12 mm <script>alert(1)</script> & "mill" äöü 端'
LABEL = "</script><img src=x onerror=alert(2)> {:.0f}"
BROWSERS = ("chromium", "chromium-browser", "google-chrome", "chrome")


def make_assembly(overhang: float, *masses: PointMass) -> Assembly:
    tool = Part([Segment(length=overhang, outer_diameter=0.012, material=CARBIDE)], name="tool")
    holder = Part([Segment(length=0.13, outer_diameter=0.045, material=STEEL)], name="holder")
    joint = PointJoint(k_y=6e8, k_theta=1e5, c_y=300.0, c_theta=1.0, name="joint")
    return Assembly([tool, joint, holder], masses)


@pytest.fixture(scope="module")
def verdict() -> Any:
    """A sensor of one gram that is not in the model."""
    rng = np.random.default_rng(SEED)
    observations = [
        MeasuredFRF(
            assembly=make_assembly(overhang),
            frequency_hz=LINES,
            receptance=make_assembly(overhang, PointMass(mass=1e-3)).receptance(LINES)
            * np.exp(0.01 * (rng.normal(size=LINES.size) + 1j * rng.normal(size=LINES.size))),
            standard_deviation=0.01,
            label=LABEL.format(1e3 * overhang),
        )
        for overhang in (0.05, 0.07, 0.09)
    ]
    sensed = make_assembly(0.08, PointMass(mass=1e-3)).natural_frequencies(6000.0)[:1]
    observations.append(
        MeasuredFrequencies(assembly=make_assembly(0.08), frequency_hz=sensed, standard_deviation_hz=2.0, label="peak")
    )
    bounds = {"k_y": (1e6, 1e11), "k_theta": (1e2, 1e8), "c_y": (1e-1, 1e6), "c_theta": (1e-4, 1e3)}
    unknowns = [Unknown(address=f"joint.{name}", lower=low, upper=high) for name, (low, high) in bounds.items()]
    return diagnose(observations, unknowns, causes=["sensor_mass", "tool_density", "tool_modulus"], most=1)


@pytest.fixture(scope="module")
def page(verdict: Any) -> str:
    return diagnosis_html(verdict, title=TITLE)


def test_mode_deviation_by_the_sensor(verdict: Any) -> None:
    """Against natural frequencies of both assemblies, calculated beside the data."""
    assert verdict.verdict == "named"
    before = {one.label: one for one in residuals_by_mode(verdict.selection.base)}
    after = residuals_by_mode(verdict.explanation.fit)
    assert {one.label for one in after} == set(before)
    assert all(abs(one.frequency_percent) < 0.05 for one in after)
    assert max(abs(one.frequency_percent) for one in before.values()) > 0.3
    own = before[LABEL.format(90)]
    true = make_assembly(0.09, PointMass(mass=1e-3)).natural_frequencies(6000.0)[0]
    assert own.measured_hz == pytest.approx(true, rel=1e-3)
    assert np.isnan(before["peak"].damping_percent)


def test_curves_are_those_of_the_fitted_models(verdict: Any) -> None:
    for one, assembly in zip(curves(verdict.selection.base)[:3], verdict.base.assemblies, strict=False):
        np.testing.assert_allclose(one.modelled, assembly.receptance(one.frequency_hz), rtol=1e-6)


def test_page_is_complete(page: str, verdict: Any) -> None:
    for words in (
        "The model is inadequate, and the data identify the cause.",
        "Residuals at each mode",
        "Evidence for each cause alone",
        "Similar causes in these data",
        "Settings and versions",
        "sensor_mass",
        "Size, with 95 % interval: mass ",
        " g (",
        verdict.causes[0].remedy,
        "versions: receptance",
    ):
        assert words in page, words
    assert page.count('id="figure-curve-') == 3
    assert 'id="figure-frequencies"' in page


def test_user_text_is_escaped(page: str) -> None:
    assert "<script>alert(1)" not in page
    assert "<img src=x" not in page
    assert "&lt;script&gt;alert(1)&lt;/script&gt; &amp; &#34;mill&#34; äöü 端" in page


def test_page_has_no_external_links(page: str) -> None:
    """Outside the scripts there is no address; inside them loading is forbidden (the page's own policy)."""
    loading: list[str] = []

    class Attributes(HTMLParser):
        def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
            loading.extend(name for name, _ in attrs if name in {"src", "href", "srcset", "action", "data"})

    Attributes().feed(page)
    assert loading == []
    assert "default-src 'none'" in page


def test_page_is_written_completely(tmp_path: Path, verdict: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    path = write_diagnosis(tmp_path / "report.html", verdict)
    assert path.read_text(encoding="utf-8").endswith("</html>\n") or path.read_text(encoding="utf-8").endswith(
        "</html>"
    )
    assert [one.name for one in tmp_path.iterdir()] == ["report.html"]


def test_page_renders_in_a_browser(tmp_path: Path, verdict: Any) -> None:
    """Headless: every figure is drawn, no script fails, and no request is blocked."""
    browser = next((found for name in BROWSERS if (found := shutil.which(name))), None)
    if browser is None:
        pytest.skip(f"none of {', '.join(BROWSERS)} is installed, so the report was not opened")
    path = write_diagnosis(tmp_path / "report.html", verdict, title=TITLE)
    run = subprocess.run(
        [browser, "--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage", "--enable-logging=stderr",
         f"--user-data-dir={tmp_path / 'profile'}", "--virtual-time-budget=20000", "--dump-dom",
         path.as_uri()],
        capture_output=True, text=True, timeout=120, check=True,
    )  # fmt: skip
    figures = re.findall(r'id="figure-[\w-]+"', run.stdout)
    assert len(figures) >= 5
    assert run.stdout.count('class="main-svg"') >= len(figures), "a figure was not drawn"
    errors = [line for line in run.stderr.splitlines() if "CONSOLE" in line]
    assert not errors, errors


def test_natural_frequencies_without_an_explanation(tmp_path: Path) -> None:
    """Overhangs that deviate from the stated ones with alternating sign: no cause of the list explains it."""
    observations = [
        MeasuredFrequencies(
            assembly=make_assembly(overhang),
            frequency_hz=make_assembly(overhang + off).natural_frequencies(9000.0)[:2],
            standard_deviation_hz=0.3,
            label=f"{1e3 * overhang:.0f} mm",
        )
        for overhang, off in ((0.06, 8e-4), (0.07, -8e-4), (0.08, 8e-4), (0.09, -8e-4))
    ]
    unknowns = [
        Unknown(address="joint.k_y", lower=1e6, upper=1e11),
        Unknown(address="joint.k_theta", lower=1e2, upper=1e8),
    ]
    verdict = diagnose(observations, unknowns, causes=["tool_density", "collet_mass"], most=1, held_out=True)
    assert verdict.verdict == "unexplained"
    output, page = verdict.summary(1000), diagnosis_html(verdict)
    assert "if all standard deviations were" in output
    assert "with it" in output
    for words in ("has the highest evidence", "held-out modes", "in numbers", "as given", " at 1"):
        assert words in page, words
    for words in ("damping (%)", "level (dB)", "phase (°)", "residuals of noise alone"):
        assert words not in page, words
