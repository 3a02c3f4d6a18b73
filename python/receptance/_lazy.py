"""Names of a package that are imported at first use.

A package states where its names are defined, once for type checkers and editors (imports below `TYPE_CHECKING`) and
once for `lazily`; tests compare both.
"""

from __future__ import annotations

import importlib
import sys
from collections.abc import Callable, Iterable, Mapping
from typing import Any


def lazily(
    package: str, names: Mapping[str, Iterable[str]], modules: Iterable[str] = ()
) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """Return `__getattr__` and `__dir__` of a package whose names are imported at first use.

    `names` are listed by the module of the package, or by the full name of another module, in which they are defined.
    `modules` are modules of the package that are attributes of it as well.

    Examples
    --------
    >>> from receptance._lazy import lazily
    >>> get, names = lazily("receptance.report", {"table": ["Table"], "receptance._text": ["printable"]})
    >>> get("Table").__module__, get("printable").__module__
    ('receptance.report.table', 'receptance._text')
    >>> get("Tables")
    Traceback (most recent call last):
    AttributeError: module 'receptance.report' has no attribute 'Tables'
    """
    home = {
        name: module if module.startswith("receptance.") else f"{package}.{module}"
        for module, own in names.items()
        for name in own
    }
    places = frozenset(modules)

    def get(name: str) -> Any:
        if name in home:
            value = getattr(importlib.import_module(home[name]), name)
        elif name in places:
            value = importlib.import_module(f"{package}.{name}")
        else:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        # The next access finds the name without this function.
        setattr(sys.modules[package], name, value)
        return value

    def listed() -> list[str]:
        return sorted({*vars(sys.modules[package]), *home, *places})

    return get, listed
