"""Campaign files with random damage: a message without a crash, and no unusable campaign."""

from __future__ import annotations

import copy
import json
import math
import os
import tomllib
import warnings
from pathlib import Path
from typing import Any

import numpy as np

from campaign_text import TEXT
from receptance import campaign, examples
from receptance.campaign import CampaignError
from receptance.errors import ReceptanceError, ReceptanceWarning

SEED = int(os.environ.get("RECEPTANCE_TEST_SEED", "20241121"))
CASES = 160
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
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{json.dumps(key)} = {spelling(item)}" for key, item in value.items()) + " }"
    if isinstance(value, list):
        return "[" + ", ".join(map(spelling, value)) + "]"
    if isinstance(value, float) and not math.isfinite(value):
        return repr(value)  # "inf" and "nan", as TOML writes them
    return json.dumps(value)


def dumped(data: dict[str, Any]) -> str:
    return "".join(f"{json.dumps(key)} = {spelling(value)}\n" for key, value in data.items())


def containers(node: Any) -> list[Any]:
    """Return all tables and lists that are not empty."""
    if not isinstance(node, (dict, list)) or not node:
        return []
    items = node.values() if isinstance(node, dict) else node
    return [node, *(found for item in items for found in containers(item))]


def damaged(data: dict[str, Any], rng: np.random.Generator) -> dict[str, Any]:
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


def answer(file: Path, use: bool) -> str:
    """Return the error message for a campaign file; empty if it is valid."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ReceptanceWarning)
        try:
            found = campaign.load(file)
            for assembly in found.assemblies.values():
                assembly.parameters  # noqa: B018
            if use:
                found.identify()
        except (CampaignError, ReceptanceError) as error:
            return str(error)
    return ""


def test_damaged_campaigns(tmp_path: Path) -> None:
    rng = np.random.default_rng(SEED)
    sources = [*3 * [tomllib.loads(TEXT)], tomllib.loads(examples.EXAMPLES["er32"].campaign)]
    file = tmp_path / "campaign.toml"
    answers = []
    for case in range(CASES):
        text = dumped(damaged(sources[case % 4], rng))
        file.write_text(text, encoding="utf-8")
        try:
            answers.append(answer(file, use=case % 2 == 0))
        except Exception as error:
            raise AssertionError(f"seed {SEED}, case {case}: {error!r}\n{text}") from error
    refused = [output for output in answers if output]
    print(f"seed {SEED}: {len(refused)} of {CASES} refused")
    assert CASES // 2 < len(refused) < CASES
    assert all("expected" in output or "key" in output or "missing" in output or ": " in output for output in refused)
