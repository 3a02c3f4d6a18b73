"""Lines of a verdict, merged into the contents of the campaign file that they belong to."""

from __future__ import annotations

import copy
import re
import tomllib
from collections.abc import Sequence
from itertools import pairwise
from typing import Any


def merged(contents: dict[str, Any], lines: Sequence[str]) -> dict[str, Any]:
    """Return the contents of a campaign file after the lines are added, those of several measurements to each."""

    def add(table: dict[str, Any], more: dict[str, Any]) -> None:
        for key, value in more.items():
            if isinstance(value, dict):
                add(table.setdefault(key, {}), value)
            else:
                table[key] = value

    found = copy.deepcopy(contents)
    new = tomllib.loads("\n".join(lines))
    for line, following in pairwise(lines):
        if following.startswith("# the same for "):
            (same,) = re.findall(r"\[measurements\.(\w+)", line)
            for other in following.removeprefix("# the same for ").split(", "):
                new["measurements"][other] = new["measurements"][same]
    add(found, new)
    return found
