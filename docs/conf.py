"""Sphinx configuration of the site: ``python -m sphinx -W docs build/site``.

``python docs/versions.py build/site`` builds it for all released versions.
"""

import os
import re
from importlib.util import find_spec

from sphinx.application import Sphinx

import template_control

project = "template_control"
author = "the template_control authors"
copyright = author
version = release = template_control.__version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
]
root_doc = "index"
# The index of docs/ for those who read it without the site.
exclude_patterns = ["README.md"]

html_theme = "furo"
html_title = f"{project} {version}"
html_static_path: list[str] = []
html_copy_source = False

# The other versions, where docs/versions.py builds them; the rest are Furo's.
templates_path = ["_templates"]
html_context = {
    "versions": os.environ.get("DOCS_VERSIONS", "").split(),
    "shown": os.environ.get("DOCS_VERSION", ""),
}
html_sidebars = {
    "**": [
        "sidebar/brand.html",
        "sidebar/search.html",
        "sidebar/scroll-start.html",
        "sidebar/navigation.html",
        "sidebar/versions.html",
        "sidebar/scroll-end.html",
    ]
}

myst_enable_extensions = ["colon_fence"]
myst_heading_anchors = 3

autodoc_class_signature = "separated"
autodoc_default_options = {"members": True}
autodoc_member_order = "bysource"
# The extra "gym" need not be there: the reference shows its environment all the same.
autodoc_mock_imports = [] if find_spec("gymnasium") else ["gymnasium"]
# Signatures would repeat what "Args" and "Attributes" say.
autodoc_typehints = "none"
napoleon_numpy_docstring = False
napoleon_custom_sections = [
    (name, "params_style")
    for name in ("Attributes", "Attributes that are constant", "Attributes of the last update")
]

_ROBOTS = re.compile(r"\]\((?:\.\./)+robots/README\.md")


def setup(app: Sphinx) -> None:
    """Links to the robots' README lead to the page that includes it."""

    def lead_to_robots(_app: Sphinx, _page: str, source: list[str]) -> None:
        source[0] = _ROBOTS.sub("](/robots.md", source[0])

    app.connect("source-read", lead_to_robots)
