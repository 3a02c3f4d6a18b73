"""Names at the top level, bounds as dictionaries, campaigns as objects and in notebooks."""

from __future__ import annotations

import inspect
import pydoc
from pathlib import Path

import pytest

import receptance as rc
from receptance import campaign, examples
from receptance.fit.unknowns import as_unknowns
from receptance.model.fields import Element

TOOL = rc.Part([rc.Segment(length=0.0623, outer_diameter=0.0127, material=rc.CARBIDE)], name="tool")
HOLDER = rc.Part([rc.Segment(length=0.129, outer_diameter=0.045, material=rc.STEEL)], name="holder")
PAIR = rc.Assembly([TOOL, rc.PointJoint(k_y=6.3e8, k_theta=1.0e5, name="joint"), HOLDER])
MEASURED = rc.Observation.from_modes(
    assembly=PAIR, frequency_hz=PAIR.natural_frequencies(15e3)[:2], standard_deviation_hz=2.0
)


def test_unknowns_as_bounds() -> None:
    bounds = {"joint.k_y": (1e7, 1e10), "joint.k_theta": {"lower": 1e3, "upper": 1e7, "start": 2e4}}
    objects = [
        rc.Unknown(address="joint.k_y", lower=1e7, upper=1e10),
        rc.Unknown(address="joint.k_theta", lower=1e3, upper=1e7, start=2e4),
    ]
    assert list(as_unknowns(bounds)) == objects
    assert as_unknowns({"joint.k_y": [1e7, 1e10, 3e8]})[0].start == 3e8
    found = rc.identify(MEASURED, bounds, starts=2)
    assert found.values == rc.identify(MEASURED, objects, starts=2).values
    assert found.values["joint.k_y"] == pytest.approx(6.3e8, rel=1e-4)


@pytest.mark.parametrize(
    ("unknowns", "error", "message"),
    [
        ({"joint.k_y": 1e7}, TypeError, r"unknowns\['joint.k_y'\] is 10000000.0, expected \(lower, upper\)"),
        ({"joint.k_y": (1e7,)}, TypeError, r"expected \(lower, upper\), \(lower, upper, start\), or a dictionary"),
        ({"joint.k_y": "ab"}, TypeError, r"is 'ab', expected \(lower, upper\)"),
        ({"joint.k_y": objects} if (objects := rc.Unknown(address="joint.k_y", lower=1, upper=2)) else {}, TypeError,
         "is an Unknown, expected bounds, or give a list of Unknown"),
        ({"joint.k_y": (1e10, 1e7)}, ValueError, "expected lower below upper"),
        ({}, ValueError, "unknowns is empty"),
    ],
)  # fmt: skip
def test_mistakes_in_bounds(unknowns: object, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message):
        rc.identify(MEASURED, unknowns)  # type: ignore[arg-type]


def test_a_campaign_is_loaded_and_shown(tmp_path: Path) -> None:
    examples.write("free-free", tmp_path)
    read = rc.Campaign.load(tmp_path)
    assert campaign.load(tmp_path).assemblies == read.assemblies
    html = read._repr_html_()
    assert "data:image/png;base64," in html
    assert "Free-free hammer test" in html
    assert "medium" in read.summary()
    assert rc.read_frf(tmp_path / "short.csv").shape[0] == 1451
    with pytest.raises(rc.CampaignError):
        rc.Campaign.load(_broken(tmp_path))


def _broken(folder: Path) -> Path:
    file = folder / "broken.toml"
    file.write_text("title = 3\n", encoding="utf-8")
    return file


def test_help_opens_with_the_types_of_the_fields() -> None:
    elements = [one for name in dir(rc) if inspect.isclass(one := getattr(rc, name)) and issubclass(one, Element)]
    assert rc.Segment in elements
    for one in elements:
        text = pydoc.render_doc(one, renderer=pydoc.plaintext)
        assert "Annotated" not in text.splitlines()[3], text[:400]
    opening = pydoc.render_doc(rc.Segment, renderer=pydoc.plaintext).splitlines()[3]
    assert opening.startswith(
        " |  Segment(*, length: float, outer_diameter: float, inner_diameter: float = 0.0, material: "
    )
