"""The gallery: scripts that the site runs when it is built, with what they print and draw."""

from __future__ import annotations

import contextlib
import io
import os
import tempfile
from pathlib import Path
from typing import Any

from docutils import nodes
from matplotlib.figure import Figure
from sphinx.application import Sphinx
from sphinx.util.docutils import SphinxDirective

__all__ = ["run", "setup"]


def run(script: Path) -> tuple[str, Figure]:
    """Run a script in an empty folder; return what it prints, and the figure that it calls `figure`.

    Parameters
    ----------
    script : Path
        The script.

    Raises
    ------
    ValueError
        The script makes no figure.
    """
    code = compile(script.read_text(encoding="utf-8"), str(script), "exec")
    namespace: dict[str, Any] = {"__name__": "__main__"}
    printed, before = io.StringIO(), Path.cwd()
    with tempfile.TemporaryDirectory() as folder, contextlib.redirect_stdout(printed):
        os.chdir(folder)
        try:
            exec(code, namespace)
        finally:
            os.chdir(before)
    figure = namespace.get("figure")
    if not isinstance(figure, Figure):
        raise ValueError(f"{script.name}: figure is {figure!r}, expected a matplotlib Figure")
    return printed.getvalue(), figure


class Example(SphinxDirective):
    """The figure of a script, its output and its text."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Run the script and return the nodes."""
        _, script = self.env.relfn2path(self.arguments[0])
        self.env.note_dependency(script)
        path = Path(script)
        printed, figure = run(path)
        target = Path(self.env.srcdir) / "generated" / "gallery" / f"{path.stem}.png"
        target.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(target, dpi=130)
        text = path.read_text(encoding="utf-8")
        parts = [
            f"![Figure of the example](/generated/gallery/{path.stem}.png)",
            f"It prints:\n\n```text\n{printed}```",
            f"The script:\n\n```python\n{text}```",
        ]
        return self.parse_text_to_nodes("\n\n".join(parts))


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the directive."""
    app.add_directive("example", Example)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
