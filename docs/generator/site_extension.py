"""What the site needs beyond its generator: names as links, signs in docstrings, links to files outside `docs`."""

from __future__ import annotations

import re
from typing import Any

from docutils import nodes
from pygments.lexers.special import TextLexer
from sphinx.application import Sphinx
from sphinx.domains.python import PyXRefRole
from sphinx.util.docutils import SphinxRole

OUTSIDE = {"../README.md": "index.md", "../CHANGELOG.md": "changes.md", "../CONTRIBUTING.md": "contributing.md"}
"""Files beside `docs` that pages link to, and the pages of the site that take their place."""

INTERNAL = {
    "columns_of",
    "countable",
    "declared",
    "drawn_in_notebooks",
    "flat",
    "layout",
    "plotted_by",
    "quantities",
    "tabulated",
    "tied",
}
"""Members that the library reads and users do not need."""


class NameRole(SphinxRole):
    """A name in single backquotes: a link where it is a name of the API, code otherwise.

    A role of Sphinx would look for `.mass` in all classes and take the first one.
    """

    def run(self) -> tuple[list[nodes.Node], list[nodes.system_message]]:
        """Return the link or the literal."""
        if not re.fullmatch(r"[A-Za-z_][\w.]*(\(\))?", self.text):
            return [nodes.literal(self.rawtext, self.text)], []
        return PyXRefRole()("py:obj", self.rawtext, self.text, self.lineno, self.inliner)


def _keep_signs(app: Sphinx, what: str, name: str, thing: object, options: object, lines: list[str]) -> None:
    """Keep |H| in docstrings from being read as a substitution; leave out the docstrings of modules.

    These tell developers how a package is divided. The pages of the site introduce it to users.
    """
    if what == "module":
        lines.clear()
    in_example = False
    for i, line in enumerate(lines):
        in_example = bool(line.strip()) and (in_example or line.lstrip().startswith(">>>"))
        if not in_example:
            # Not within backquotes, where a backslash would be shown.
            pieces = re.split(r"(`[^`]*`)", line)
            lines[i] = "".join(p if p.startswith("`") else p.replace("|", "\\|") for p in pieces)


def _skip_internal(app: Sphinx, what: str, name: str, thing: object, skip: bool, options: object) -> bool | None:
    return True if name.rpartition(".")[2] in INTERNAL else None


def _stay_inside(app: Sphinx, name: str, source: list[str]) -> None:
    for outside, page in OUTSIDE.items():
        source[0] = source[0].replace(f"]({outside}", f"]({'../' * name.count('/')}{page}")


def setup(app: Sphinx) -> dict[str, Any]:
    """Register everything with Sphinx."""
    app.add_role("name", NameRole())
    app.add_lexer("csv", TextLexer)
    app.connect("source-read", _stay_inside)
    app.connect("autodoc-skip-member", _skip_internal)
    app.connect("autodoc-process-docstring", _keep_signs, priority=400)  # before numpydoc
    return {"parallel_read_safe": True, "parallel_write_safe": True}
