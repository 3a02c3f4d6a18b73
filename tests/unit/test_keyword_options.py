"""Options that complete in an editor: declared types of keywords that functions pass on."""

from __future__ import annotations

import importlib
import inspect
import pkgutil
from collections.abc import Callable, Iterator
from typing import Any

import pytest

import receptance
from receptance.fit.identification import FitKeywords, identify
from receptance.hammer.estimate import EstimateKeywords, estimate_frf

TAKE_FIELDS = {"Parameter.move", "Parameter.unknown", "FRF.with_"}
"""Their keywords are fields of the unknown that a cause makes, or of the FRF."""


def public_functions() -> Iterator[tuple[str, Callable[..., Any]]]:
    """Yield the functions and the methods of the public modules, with their names."""
    for module in pkgutil.iter_modules(receptance.__path__):
        if module.name.startswith("_"):
            continue
        found = importlib.import_module(f"receptance.{module.name}")
        for name in getattr(found, "__all__", ()):
            thing = getattr(found, name)
            if inspect.isfunction(thing):
                yield name, thing
            elif inspect.isclass(thing):
                methods = inspect.getmembers(thing, inspect.isfunction)
                yield from ((f"{name}.{method}", one) for method, one in methods if not method.startswith("_"))


def test_no_public_function_takes_any_keyword() -> None:
    open_ended = {
        name
        for name, function in public_functions()
        for one in inspect.signature(function).parameters.values()
        if one.kind is one.VAR_KEYWORD and "Unpack[" not in str(one.annotation)
    }
    assert open_ended <= TAKE_FIELDS


@pytest.mark.parametrize(
    ("function", "declared", "others"),
    [
        (identify, FitKeywords, {"observations", "unknowns", "tolerances", "seed"}),
        (estimate_frf, EstimateKeywords, {"hits"}),
    ],
)
def test_the_declared_keywords_are_those_of_the_function(
    function: Callable[..., Any], declared: type, others: set[str]
) -> None:
    """Names and types; the strings of both modules are compared, because some types are imported for checkers only."""
    parameters = inspect.signature(function).parameters
    assert set(declared.__annotations__) == set(parameters) - others
    for name, kind in declared.__annotations__.items():
        assert kind.__forward_arg__ == parameters[name].annotation, name
