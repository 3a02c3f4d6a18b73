"""The documentation site has a place for every public name and every cause; `.ci/run` builds it."""

from __future__ import annotations

import ast
import importlib
import inspect
import re
from pathlib import Path

import numpy as np
import pytest

import cause_effects
import drawings
import notebooks
import receptance
from examples.documents import ROOT, difference
from receptance import Assembly, PointMass
from receptance.diagnosis import CATALOGUE
from receptance.diagnosis.thresholds import LARGE_SIZE

PAGES = sorted((ROOT / "docs" / "api").glob("*.md"))
_MODULE = re.compile(r"\.\. automodule:: (\S+)\n(?:\s+:exclude-members: (.*)\n)?")
_NAME = re.compile(r"\.\. auto(?:class|data|exception|function):: (\S+)")


def _public(module: str) -> set[str]:
    """Return the names of a module that are not packages, which have pages of their own."""
    package = importlib.import_module(module)
    return {name for name in package.__all__ if not inspect.ismodule(getattr(package, name))} - {"__version__"}


def test_the_api_reference_describes_every_public_name_once() -> None:
    described: list[tuple[str, str]] = []
    for page in PAGES:
        text = page.read_text(encoding="utf-8")
        described += [("receptance", name) for name in _NAME.findall(text)]
        for module, names in _MODULE.findall(text):
            described += [(module, name) for name in _public(module) - set(names.split(", "))]
    assert len(described) == len(set(described))
    things = [getattr(importlib.import_module(module), name) for module, name in described]
    assert len({id(thing) for thing in things if callable(thing)}) == sum(map(callable, things))
    # The page is a program, as the command line is.
    packages = {"frf", *(n for n in receptance.__all__ if inspect.ismodule(getattr(receptance, n)))} - {"app"}
    for module in ("receptance", *(f"receptance.{name}" for name in packages)):
        for name in _public(module):
            thing = getattr(importlib.import_module(module), name)
            assert (module, name) in described or any(thing is other for other in things), f"{module}.{name}"


CAUSES = sorted(path for path in (ROOT / "docs" / "causes").glob("*.md") if path.stem != "index")


def test_every_cause_of_the_catalogue_has_a_page_and_every_page_a_cause() -> None:
    assert [path.stem for path in CAUSES] == sorted(CATALOGUE)


@pytest.mark.parametrize("page", CAUSES, ids=[path.stem for path in CAUSES])
def test_the_page_of_a_cause_has_its_sections_and_its_own_facts(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    assert re.findall(r"^## (.*)$", text, re.MULTILINE) == [
        "What it is",
        "How it shows",
        "What looks alike",
        "How to settle it",
    ]
    assert re.findall(r"^```\{cause-(\S+)\} (\S+)$", text, re.MULTILINE) == [
        (shown, page.stem) for shown in ("facts", "figure", "look-alikes", "measurements")
    ]


def test_the_computed_effect_of_a_mass_at_the_tip_is_that_of_the_library() -> None:
    """Three typical masses: the first antiresonance and resonance of the figure are those of a model with the mass."""
    shown = cause_effects.effect("sensor_mass")
    mass = LARGE_SIZE * CATALOGUE["sensor_mass"].parameters[0].typical
    assert shown.sizes == {"mass": mass}
    tool, joint, holder = cause_effects._tool(0.07), cause_effects._joint(), cause_effects._holder()
    heavy = Assembly([tool, joint, holder], [PointMass(mass=mass, part="tool", position=0.0)])
    np.testing.assert_allclose(shown.measured[1], heavy.receptance(cause_effects.LINES), rtol=1e-9)
    plain = Assembly([tool, joint, holder])
    np.testing.assert_allclose(shown.without[1], plain.receptance(cause_effects.LINES), rtol=1e-9)


def test_look_alikes_are_symmetric_where_both_have_one_variant() -> None:
    first = cause_effects.look_alikes("tool_modulus")["tool_density"]
    assert first == pytest.approx(cause_effects.look_alikes("tool_density")["tool_modulus"], rel=1e-9)
    assert 0.0 < first < 1.0


@pytest.mark.parametrize("name", list(drawings.DRAWINGS))
def test_the_drawings_are_those_of_their_script(name: str) -> None:
    shown = (drawings.FOLDER / f"{name}.svg").read_text(encoding="utf-8")
    assert difference(drawings.DRAWINGS[name](), shown) is None, "run `python docs/generator/drawings.py`"


def test_notebooks_of_the_gallery_have_the_statements_of_their_scripts() -> None:
    nbformat = pytest.importorskip("nbformat", reason="needs nbformat")
    for script in (ROOT / "docs" / "gallery").glob("*.py"):
        code = script.read_text(encoding="utf-8")
        made = nbformat.reads(
            notebooks.notebook(script.with_suffix(".md").read_text(encoding="utf-8"), code), as_version=4
        )
        nbformat.validate(made)
        text, magic, *cells = [cell.source for cell in made.cells]
        assert (magic, cells.pop()) == ("%matplotlib inline", "figure")
        assert text.startswith("# ")
        assert "```" not in text
        assert len(cells) > 2
        for cell in cells:
            compile(cell, script.name, "exec")
        assert ast.dump(ast.parse("\n".join(cells))) == ast.dump(ast.Module(ast.parse(code).body[1:], []))


def test_every_example_of_the_gallery_has_a_page() -> None:
    folder = ROOT / "docs" / "gallery"
    pages = sorted(path.stem for path in folder.glob("*.md") if path.stem != "index")
    assert pages == sorted(path.stem for path in folder.glob("*.py"))
    for name in pages:
        assert f"```{{example}} {name}.py\n" in (folder / f"{name}.md").read_text(encoding="utf-8")
