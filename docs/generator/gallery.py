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

from notebooks import notebook

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


def _run_all(app: Sphinx) -> None:
    """Run all scripts before the pages are read, because the page with their pictures needs those of all."""
    target = _target(app.srcdir)
    target.mkdir(parents=True, exist_ok=True)
    for script in sorted((Path(app.srcdir) / "gallery").glob("*.py")):
        printed, figure = run(script)
        figure.savefig(target / f"{script.stem}.png", dpi=130)
        (target / f"{script.stem}.txt").write_text(printed, encoding="utf-8")
        page, code = (script.with_suffix(ending).read_text(encoding="utf-8") for ending in (".md", ".py"))
        (target / f"{script.stem}.ipynb").write_text(notebook(page, code), encoding="utf-8")


def _target(source: str | os.PathLike[str]) -> Path:
    return Path(source) / "generated" / "gallery"


class Example(SphinxDirective):
    """The figure of a script, its output and its text."""

    required_arguments = 1

    def run(self) -> list[nodes.Node]:
        """Return the nodes."""
        _, script = self.env.relfn2path(self.arguments[0])
        self.env.note_dependency(script)
        path = Path(script)
        printed = (_target(self.env.srcdir) / f"{path.stem}.txt").read_text(encoding="utf-8")
        text = path.read_text(encoding="utf-8")
        parts = [
            f"![Figure of the example](/generated/gallery/{path.stem}.png)",
            f"It prints:\n\n```text\n{printed}```",
            f"The script:\n\n```python\n{text}```",
            f"Download the {{download}}`script <{path.name}>` or the "
            f"{{download}}`notebook </generated/gallery/{path.stem}.ipynb>`.",
        ]
        return self.parse_text_to_nodes("\n\n".join(parts))


class Pictures(SphinxDirective):
    """The pictures of examples with their titles, which lead to their pages."""

    has_content = True

    def run(self) -> list[nodes.Node]:
        """Return the nodes."""
        whole = nodes.container(classes=["gallery"])
        for name in filter(None, (line.strip() for line in self.content)):
            page = Path(self.env.srcdir) / "gallery" / f"{name}.md"
            title = page.read_text(encoding="utf-8").splitlines()[0].removeprefix("# ")
            picture = f"[![{title}](/generated/gallery/{name}.png)]({name}.md)"
            one = nodes.container()
            one += self.parse_text_to_nodes(f"{picture}\n\n[{title}]({name}.md)")
            whole += one
        return [whole]


def setup(app: Sphinx) -> dict[str, Any]:
    """Register the directives."""
    app.connect("builder-inited", _run_all)
    app.add_directive("example", Example)
    app.add_directive("pictures", Pictures)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
