"""The documentation site: `make docs` builds it, offline, and a warning is an error."""

import sys
from pathlib import Path

from sphinx.addnodes import pending_xref

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from pns_common.version import VERSION

project = "PNS"
version = release = VERSION
extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon"]
html_theme = "furo"
html_title = "PNS"
html_copy_source = False
html_show_copyright = False

autodoc_typehints = "none"  # shapes stand in the text
autodoc_member_order = "bysource"
napoleon_google_docstring = True
# Notebooks are run, in a folder of their own, and stop the build where they fail.
nb_execution_mode = "force"
nb_execution_in_temp = True
nb_execution_raise_on_error = True
nb_execution_timeout = 300
myst_enable_extensions = ["colon_fence"]
myst_heading_anchors = 3


def leave_the_site(app, doctree):
    """Show links to pages of the repository that are no part of the site as their text."""
    for link in doctree.findall(pending_xref):
        name = link.get("reftarget", "")
        outside = link.get("refdomain") == "doc" and name.lstrip("/") not in app.env.found_docs
        if outside and Path(f"{name}.md").is_file():
            link.replace_self(link.children)


def drop_module_docstring(app, what, name, thing, options, lines):
    """Leave out the module's own docstring: it guides readers of the sources."""
    if what == "module":
        lines.clear()


def setup(app):
    """Register what Sphinx is to call."""
    app.connect("autodoc-process-docstring", drop_module_docstring)
    app.connect("doctree-read", leave_the_site)
