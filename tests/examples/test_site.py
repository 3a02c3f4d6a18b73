"""The documentation site has a place for every public name. That its pages build is a step of `.ci/run`."""

from __future__ import annotations

import importlib
import re

import receptance
from examples.documents import ROOT

PAGES = sorted((ROOT / "docs" / "api").glob("*.md"))
_MODULE = re.compile(r"\.\. automodule:: (\S+)\n(?:\s+:exclude-members: (.*)\n)?")


def test_the_api_reference_describes_every_public_name_once() -> None:
    described: dict[str, set[str]] = {}
    left_out: dict[str, set[str]] = {}
    for page in PAGES:
        for module, names in _MODULE.findall(page.read_text(encoding="utf-8")):
            left_out[module] = set(names.split(", ")) - {""}
            described[module] = set(importlib.import_module(module).__all__) - left_out[module]
    public = {"receptance", *(f"receptance.{name}" for name in receptance._SUBPACKAGES)}
    public |= {"receptance.frf", "receptance.identification"}
    # The studies are command lines; they have no names of their own.
    assert set(described) == public - {"receptance.studies"}
    for module, names in left_out.items():
        own = importlib.import_module(module)
        for name in names:
            elsewhere = [other for other in described if name in described[other]]
            assert any(getattr(importlib.import_module(other), name) is getattr(own, name) for other in elsewhere), name
    objects = [
        id(thing)
        for module, names in described.items()
        for name in names
        if callable(thing := getattr(importlib.import_module(module), name))
    ]
    assert len(objects) == len(set(objects))
