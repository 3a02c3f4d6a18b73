"""Damage of the contents of campaign files: values that are replaced, moved, renamed, doubled or left out."""

from __future__ import annotations

import copy
import json
import math
from typing import Any

import numpy as np

__all__ = ["damaged_contents", "dumped"]

ODD: list[Any] = [
    *(0, -1, 3, 1e308, -0.0, 1.5, True, "", " ", "tool", "joint", "short", "60 mm", "-60 mm", "0 mm", "1e-300 mm"),
    *(
        "1e300 m",
        "2 %",
        "200 %",
        "5 Hz",
        "1e9 Hz",
        "end",
        "x\ny",
        "\u00e9",
        [],
        {},
        ["60 mm"],
        [[]],
        [["1 Hz", "2 Hz"]],
    ),
    *(
        {"value": "1 %"},
        {"value": "1 %", "name": "n"},
        "hold out",
        "frf",
        "hammer records",
        "mass",
        "ground",
        "resonator",
        "..",
        "/",
    ),
    *(math.inf, -math.inf, math.nan, 10**400, -(2**70), 1e-308, [{}], [{"a": 1}], "inf mm", "1e400 mm", "0 %"),
]


def spelling(value: Any) -> str:
    """Return a value as TOML."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{json.dumps(key)} = {spelling(item)}" for key, item in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(map(spelling, value)) + "]"
    if isinstance(value, float) and not math.isfinite(value):
        return repr(value)  # "inf" and "nan", as TOML writes them
    return json.dumps(value)


def dumped(data: dict[str, Any]) -> str:
    """Return contents as the text of a TOML file."""
    return "".join(f"{json.dumps(key)} = {spelling(value)}\n" for key, value in data.items())


def containers(node: Any) -> list[Any]:
    """Return all tables and lists that are not empty."""
    if not isinstance(node, (dict, list)) or not node:
        return []
    items = node.values() if isinstance(node, dict) else node
    return [node, *(found for item in items for found in containers(item))]


def damaged_contents(data: dict[str, Any], rng: np.random.Generator) -> dict[str, Any]:
    """Return a copy with one or two values replaced, moved, renamed, doubled or left out."""
    result = copy.deepcopy(data)
    for _ in range(int(rng.integers(1, 3))):
        found = containers(result)
        if not found:
            return result
        node = found[int(rng.integers(len(found)))]
        keys = list(node) if isinstance(node, dict) else list(range(len(node)))
        key = keys[int(rng.integers(len(keys)))]
        other = found[int(rng.integers(len(found)))]
        match int(rng.integers(5)):
            case 0 | 1:
                node[key] = copy.deepcopy(ODD[int(rng.integers(len(ODD)))])
            case 2:
                del node[key]
            case 3 if isinstance(node, dict):
                node[f"{key}x"] = node.pop(key)
            case 3:
                node.append(copy.deepcopy(node[key]))
            case _:
                items = list(other.values() if isinstance(other, dict) else other)
                node[key] = copy.deepcopy(items[int(rng.integers(len(items)))])
    return result
