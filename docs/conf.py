"""Settings of the documentation site: `sphinx-build -W --keep-going docs target/site`.

Sphinx with MyST, because the docstrings are numpydoc, which it reads as NumPy's and SciPy's sites do, because it takes
objects from the imported package, compiled ones included, and because it is maintained. The pages remain Markdown that
is readable without it.
"""

from __future__ import annotations

import sys
from pathlib import Path

from numpydoc.xref import DEFAULT_LINKS

import receptance.coupling
import receptance.diagnosis
import receptance.fit
import receptance.predict

sys.path.insert(0, str(Path(__file__).resolve().parent / "generator"))

project = "receptance"
author = "the authors of receptance"
version = release = receptance.__version__

extensions = ["myst_parser", "sphinx.ext.autodoc", "numpydoc", "site_extension", "cause_pages", "gallery"]
source_suffix = {".md": "markdown", ".rst": "restructuredtext"}
exclude_patterns = ["generator", "studies", "generated"]
# Names in single backquotes are links where they are names of the API, and code everywhere else.
default_role = "name"

myst_enable_extensions = ["colon_fence", "tasklist"]
myst_heading_anchors = 4

# The names of a package's `__all__`, in that order. Docstrings of functions state types and units; signatures would
# repeat them. Fields of classes have the types of their annotations.
autodoc_default_options = {"members": True}
autodoc_member_order = "bysource"
autodoc_typehints = "description"
autodoc_typehints_description_target = "documented"
autodoc_preserve_defaults = True
# Of the two readers of numpydoc's sections this one knows several names before one type.
numpydoc_show_class_members = False
numpydoc_xref_param_type = True
numpydoc_xref_ignore = "all"
# Types of Python and NumPy stay words: their documentation is on other servers, which the build does not ask.
numpydoc_xref_aliases = {name: name for name in DEFAULT_LINKS} | {
    name: f"{package.__name__}.{name}"
    for package in (receptance.diagnosis, receptance.coupling, receptance.predict, receptance.fit, receptance)
    for name in package.__all__
}

html_theme = "furo"
html_title = f"receptance {release}"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_sourcelink = False
html_show_copyright = False
html_theme_options = {"navigation_with_keys": True}
