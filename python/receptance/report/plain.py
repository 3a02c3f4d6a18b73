"""Conversion of results to values that JSON supports."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np


def plain(value: Any) -> Any:
    """Return a value as dictionaries, lists, text, numbers and None.

    A number that is not finite becomes None, a complex number a pair, a dataclass a dictionary of its fields.

    Examples
    --------
    >>> import numpy as np
    >>> from receptance.report.plain import plain
    >>> plain({"a": np.array([1.0, np.inf]), "b": (1 + 2j,)})
    {'a': [1.0, None], 'b': [[1.0, 2.0]]}
    """
    if isinstance(value, np.generic):
        value = value.item()
    # Most values are numbers of arrays, and the check for a mapping takes longest.
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, complex):
        return [plain(value.real), plain(value.imag)]
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, (list, tuple)):
        return [plain(item) for item in value]
    if isinstance(value, Mapping):
        return {str(key): plain(item) for key, item in value.items()}
    if is_dataclass(value):
        return {one.name: plain(getattr(value, one.name)) for one in fields(value)}
    return value
