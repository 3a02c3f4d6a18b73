"""Every docstring example runs and prints the documented output; every public name has one."""

from __future__ import annotations

import doctest
import importlib
import pkgutil
from pathlib import Path

import pytest

import receptance

_OPTIONS = doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS


def _modules() -> list[str]:
    below = pkgutil.walk_packages(receptance.__path__, "receptance.")
    return ["receptance", *sorted(module.name for module in below if not module.name.endswith(("._core", ".__main__")))]


def _examples() -> list[doctest.DocTest]:
    finder = doctest.DocTestFinder(exclude_empty=True)
    return [test for name in _modules() for test in finder.find(importlib.import_module(name)) if test.examples]


EXAMPLES = _examples()


@pytest.mark.parametrize("example", EXAMPLES, ids=[example.name for example in EXAMPLES])
def test_docstring(example: doctest.DocTest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MPLBACKEND", "Agg")
    report: list[str] = []
    failed, _ = doctest.DocTestRunner(optionflags=_OPTIONS).run(example, out=report.append)
    assert failed == 0, "".join(report)


def test_every_public_name_has_an_example() -> None:
    """Classes and functions; exceptions are raised, not called, and constants are values."""
    without = []
    for name in receptance.__all__:
        thing = getattr(receptance, name)
        if not callable(thing) or (isinstance(thing, type) and issubclass(thing, BaseException)):
            continue
        documented = thing.__doc__ or ""
        if isinstance(thing, type):
            own = [vars(thing).get(member) for member in vars(thing) if not member.startswith("_")]
            documented += "".join(getattr(member, "__doc__", None) or "" for member in own)
        if ">>>" not in documented:
            without.append(name)
    assert not without, f"without a runnable example: {without}"
