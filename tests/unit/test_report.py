"""The protocol of results: tables, numbers, the renderers, and its implementation by every class."""

from __future__ import annotations

import importlib
import inspect
import json
import pkgutil
from dataclasses import dataclass, field
from typing import Any, get_type_hints

import numpy as np
import pytest
from matplotlib.figure import Figure

import receptance
from receptance import FRF, STEEL, Assembly, Observation, Part, PointJoint, Segment, Unknown, identify
from receptance.fit import Identification, profile_likelihoods
from receptance.report import Column, Fact, Provenance, Renderable, Result, Results, Table
from receptance.report.result import plain
from receptance.report.table import amount, amount_interval, interval, joined, number


@dataclass(frozen=True, kw_only=True)
class Found(Result):
    values: tuple[float, ...] = (4.16234e8, 1.6e-12, float("inf"))
    name: str = "joint.k_y"
    notes: tuple[str, ...] = ()
    provenance: Provenance = field(default_factory=Provenance)

    heading = "Found things"
    next_step = "measure <b> again"

    def warnings(self) -> list[str]:
        return ["do not use this"]

    def facts(self) -> list[Fact]:
        return [Fact("Cause", ("a mass", "of 1.99 g"), ("[sensors.s]", 'mass = "1.99 g" # ' + 90 * "<"))]

    def tables(self) -> list[Table]:
        columns = ("parameter", Column("value", "N/m", ".5g"), Column("95 % interval", form=".4g"))
        return [Table("Values", columns, [(self.name, one, (0.9 * one, 1.1 * one)) for one in self.values])]

    def sentences(self) -> list[str]:
        return ["all is well", "  in detail"]

    def data(self) -> dict[str, Any]:
        return {"values": np.array(self.values), "pair": 1 + 2j}


class FoundThings(Results[Found]):
    heading = "Results"


@pytest.fixture(scope="module")
def fit() -> Identification:
    bar = Segment(length=0.1, outer_diameter=0.02, material=STEEL)
    pair = Assembly([Part([bar], name="tool"), PointJoint(k_y=1e8, k_theta=1e5), Part([bar], name="holder")])
    modes = Observation.from_modes(
        assembly=pair,
        frequency_hz=pair.natural_frequencies(2e4)[:3] + np.array([3.0, -4.0, 2.0]),
        standard_deviation_hz=2.0,
        label="pay $5 <b>",
    )
    return identify(modes, Unknown(address="joint.k_theta", lower=1e3, upper=1e7), starts=2)


def test_numbers_and_intervals() -> None:
    assert number(float("nan")) == ""
    assert number(float("inf")) == "not determined"
    assert number(-0.5, "+.1f") == "-0.5"
    assert interval((-np.inf, 3.0)) == "below 3"
    assert interval((1e9, np.inf), ".1e") == "above 1.0e+09"
    column = Column("count", form="d")
    assert [column.text(one) for one in (7, None, "none", True, False)] == ["7", "", "none", "yes", "no"]
    assert Column("k", "N/m").heading == "k\n[N/m]"


@pytest.mark.parametrize(
    ("value", "unit", "digits", "text"),
    [
        (1.9912e-3, "kg", 3, "1.99 g"),
        (0.9999, "kg", 2, "1.0 kg"),
        (0.52e-3, "kg", 2, "0.52 g"),
        (2.4e8, "N/m", 3, "2.40e8 N/m"),
        (99999.0, "N m/rad", 3, "1.00e5 N m/rad"),
        (12345.0, "N m/rad", 3, "12345 N m/rad"),
        (-4.2e-5, "m", 2, "-42 µm"),
        (0.0, "kg", 3, "0.00 kg"),
        (1e-12, "", 2, "1.0e-12"),
        (float("nan"), "N", 3, "not determined"),
    ],
)
def test_amounts_carry_units(value: float, unit: str, digits: int, text: str) -> None:
    assert amount(value, unit, digits) == text


def test_intervals_keep_every_digit_over_decades() -> None:
    assert amount_interval((3.1e3, 4.2e8), "N/m") == "3.100e3 to 4.200e8 N/m"
    assert amount_interval((2e-6, 0.5), "kg", 3) == "0.00200 to 500 g"
    assert amount_interval((-np.inf, 3.0)) == "below 3.000"
    assert amount_interval((None, None)) == "open"


def test_warnings_and_facts_are_above_the_numbers() -> None:
    text = Found().summary(60)
    order = ["do not use this", "Cause  a mass", "       of 1.99 g", "all is well", "4.1623e+08", "Next step  measure"]
    assert [text.index(words) for words in order] == sorted(text.index(words) for words in order)
    # Lines to copy are not wrapped.
    assert f'\n    mass = "1.99 g" # {90 * "<"}\n' in text
    page = Found()._repr_html_()
    assert page.index("do not use this") < page.index("<dt>Cause</dt><dd><p>a mass</p>") < page.index("<table>")
    assert f"&quot;1.99 g&quot; # {90 * '&lt;'}</pre>" in page
    assert "measure &lt;b&gt; again" in page


def test_tables_state_omitted_content() -> None:
    with pytest.raises(ValueError, match="table 'T': a row has 1 cells, expected 2"):
        Table("T", ("a", "b"), [("x",)])
    table = Table("T", ("a", "b", Column("c")), [("x", "", 1.0), ("y", None, 2.0)])
    assert table.without_empty().headings == ["a", "c"]
    first, other = joined([table, Table("U", ("a",), [("z",)]), table])
    assert (len(first.rows), len(other.rows)) == (4, 1)


@pytest.mark.parametrize("width", [10, 40, 60, 80, 200])
def test_text_keeps_every_number_at_any_width(width: int) -> None:
    name = "a parameter with a name that is much longer than a line of a terminal " * 2
    text = Found(name=name).summary(width)
    for shown in ("4.1623e+08", "3.746e+08 to 4.579e+08", "1.6e-12", "1.44e-12 to 1.76e-12", "not determined"):
        assert shown in text
    lines = [line for line in text.splitlines() if "\u2500" in line]
    assert max(map(len, lines)) <= max(width, 40)
    assert not any(line.endswith(" ") for line in text.splitlines())


def test_text_and_html_show_findings_notes_and_campaign_path() -> None:
    provenance = Provenance(title="Tests & more", file="c.toml", description="made up", seed=3)
    found = Found(notes=("a: first", "a: second", "alone: here", "<script>"), provenance=provenance)
    text = found.summary(80)
    assert text.startswith("Tests & more: found things ")
    for words in (
        "  made up",
        "  all is well\n    in detail",
        "  - a:\n    - first\n    - second",
        "  - alone: here",
        "seed 3;",
    ):
        assert words in text, words
    assert "seed 3; receptance " in text
    page = found._repr_html_()
    for words in ("Tests &amp; more: found things", "&lt;script&gt;", "<th", "value<br>[N/m]", ">4.1623e+08</td>"):
        assert words in page, words
    assert "<script>" not in page
    assert "seed" not in Found().summary()
    assert "\x1b" not in Found(name="tip\x1b[2J").summary()
    assert "\x1b" not in Found(name="tip\x1b[2J")._repr_html_()


def test_dictionaries_equal_their_json() -> None:
    found = Found(provenance=Provenance(title="T", file="c.toml", seed=1, settings={"starts": 8})).to_dict()
    assert json.loads(json.dumps(found, allow_nan=False)) == found
    assert list(found) == ["campaign", "file", "values", "pair", "notes", "settings", "seed", "versions"]
    assert found["values"][2] is None
    assert found["pair"] == [1.0, 2.0]
    assert "campaign" not in Found().to_dict()
    assert plain({"a": Column("k")}) == {"a": {"name": "k", "unit": "", "form": ".4g"}}


def test_results_of_one_kind_are_a_mapping_and_a_result() -> None:
    both = FoundThings({"one": Found(), "two": Found(name="joint.k_theta")}, notes=["of both"])
    assert list(both) == ["one", "two"]
    assert both["two"].name == "joint.k_theta"
    (table,) = both.tables()
    assert len(table.rows) == 6
    assert both.to_dict()["results"]["two"]["values"][0] == pytest.approx(4.16234e8)
    assert "of both" in both.summary()


def test_a_result_is_drawn_in_place_of_axes(fit: Identification) -> None:
    profiles = profile_likelihoods(fit)
    for result, panels in ((profiles, 1), (profiles["joint.k_theta"], 1), (fit, 2)):
        own = Figure(layout="constrained")
        left, right = own.subplots(1, 2)
        left.plot([1.0, 2.0])
        assert result.plot(right) is own
        assert len(own.axes) == 1 + panels
        assert right not in own.axes
        own.canvas.draw()  # a dollar sign in a label is no formula
        assert len(result.plot().axes) == panels
    with pytest.raises(ValueError, match="ax is not part of a grid"):
        profiles.plot(Figure().add_axes((0.1, 0.1, 0.8, 0.8)))
    with pytest.raises(TypeError, match="there is no figure of a Found"):
        Found().plot()


def test_numbers_of_a_fit_are_in_all_forms(fit: Identification) -> None:
    low, high = fit.interval("joint.k_theta")
    shown = amount_interval((low, high), "N m/rad")
    assert shown.endswith(" N m/rad")
    assert shown in fit.summary(60)
    assert shown in fit._repr_html_()
    assert fit.to_dict()["parameters"]["joint.k_theta"]["interval_95"] == [low, high]
    assert "pay $5 &lt;b&gt;" in fit._repr_html_()


def _classes() -> list[type]:
    found: dict[str, type] = {}
    for module in pkgutil.walk_packages(receptance.__path__, "receptance."):
        if module.name.endswith("__main__") or "._core" in module.name:
            continue
        for one in vars(importlib.import_module(module.name)).values():
            if inspect.isclass(one) and one.__module__.startswith("receptance."):
                found[f"{one.__module__}.{one.__qualname__}"] = one
    return list(found.values())


def test_every_result_implements_the_protocol() -> None:
    """A class declares tables, sentences, data and the function that draws it; only `Renderable` renders."""
    classes = _classes()
    results = [one for one in classes if issubclass(one, Result) and one not in (Result, Results)]
    assert len(results) > 10
    for one in results:
        assert one.data is not Result.data, one
        assert one.heading != Result.heading, one
        assert one.to_dict is Result.to_dict, one
    drawn = [one for one in classes if issubclass(one, Renderable) and one.plotted_by]
    assert {Assembly, FRF, *results} <= set(drawn)
    for one in drawn:
        draw = pkgutil.resolve_name(one.plotted_by)
        content, ax, *options = inspect.signature(draw).parameters.values()
        assert issubclass(one, get_type_hints(draw)[content.name]), one
        assert (ax.name, ax.default) == ("ax", None), one
        assert all(option.kind is option.KEYWORD_ONLY for option in options), one
    others = [one for one in classes if one is not Renderable]
    for name in ("as_dict", "summary", "_repr_html_", "as_text", "as_html"):
        assert not [one for one in others if name in vars(one)], name
