"""Lines of a TOML text: every value that tomllib reads has one, and it is the right one."""

from __future__ import annotations

import json
import tomllib
from collections.abc import Iterator
from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from receptance.campaign.problems import line_of, lines_of

ODD = '''\
# remark with [brackets] and "quotes"
a = 1
b.c."d.e" = """
x = "no key" # no remark
"""
f = ['x', # z ]
  "]", [1,2],
  { g = 1, h.i = 2 }
]

[t."q r"]
x = 1979-05-27T07:32:00Z
[[p.s]]
y = \'\'\'a
]\'\'\'
[[p.s]]
z = 3
[p.s.u]
v = "\\u00e9\\""
[[p.s.w]]
k=1
[[p.s.w]]
"\\u00e9"=1 # last
'''


def paths(node: Any, path: tuple[str | int, ...] = ()) -> Iterator[tuple[str | int, ...]]:
    """Yield the path of everything in parsed TOML."""
    if path:
        yield path
    items: Any = node.items() if isinstance(node, dict) else enumerate(node) if isinstance(node, list) else ()
    for key, value in items:
        yield from paths(value, (*path, key))


def test_an_odd_text() -> None:
    found = lines_of(ODD)
    assert set(found) == set(paths(tomllib.loads(ODD)))
    lines = ODD.splitlines()
    assert lines[found["b", "c", "d.e"] - 1].startswith("b.c")
    assert found["f", 1] == 7
    assert found["f", 3, "h", "i"] == 8
    assert found["p", "s", 1, "z"] == 17
    assert found["p", "s", 1, "u", "v"] == 19
    assert found["p", "s", 1, "w", 1, "é"] == 23


def test_windows_line_ends() -> None:
    assert lines_of(ODD.replace("\n", "\r\n")) == lines_of(ODD)


def test_missing_key_error_gives_the_line_of_its_table() -> None:
    found = lines_of(ODD)
    assert line_of(("p", "s", 1, "missing"), found) == 16
    assert line_of(("nothing",), found) is None


KEYS = st.text(st.sampled_from('ab1_-. "[]=#\\é\n'), min_size=1, max_size=6)
VALUES = st.recursive(
    st.one_of(
        st.integers(-9, 9),
        st.booleans(),
        st.floats(allow_nan=False, allow_infinity=False),
        st.text(st.sampled_from("ab\"'#[]{},=.\n\\é "), max_size=8),
    ),
    lambda inner: st.one_of(st.lists(inner, max_size=3), st.dictionaries(KEYS, inner, max_size=3)),
    max_leaves=8,
)


def spelling(value: Any) -> str:
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{json.dumps(k, ensure_ascii=False)} = {spelling(v)}" for k, v in value.items()) + " }"
    if isinstance(value, list):
        return "[\n  " + ",\n  ".join(map(spelling, value)) + "\n]"
    return json.dumps(value, ensure_ascii=False)


@given(st.dictionaries(KEYS, st.dictionaries(KEYS, VALUES, max_size=3), max_size=4), st.data())
def test_any_text(tables: dict[str, dict[str, Any]], data: st.DataObject) -> None:
    """Every path has a line, and the line of a key holds that key."""
    text = ""
    for name, table in tables.items():
        text += f"[{json.dumps(name, ensure_ascii=False)}] # table\n"
        for key, value in table.items():
            blank = data.draw(st.sampled_from(["", "\n", "# remark = [\n", "  "]))
            text += f"{blank}{json.dumps(key, ensure_ascii=False)} = {spelling(value)}\n"
    found = lines_of(text)
    assert set(found) == set(paths(tomllib.loads(text)))
    lines = text.splitlines() if "\x85" not in text else text.split("\n")
    for path, line in found.items():
        if len(path) == 2:
            assert lines[line - 1].lstrip().startswith(json.dumps(path[1], ensure_ascii=False))
