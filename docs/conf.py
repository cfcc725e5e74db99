"""Settings of the documentation: ``make docs`` builds it into build/docs, and a warning is an error."""

from __future__ import annotations

import os
import sys
import tomllib
from pathlib import Path

# Kernels stay plain functions, so that their signatures and docstrings are shown and nothing is compiled.
os.environ["NUMBA_DISABLE_JIT"] = "1"

DOCS = Path(__file__).parent
sys.path.insert(0, str(DOCS / "extensions"))

project = "linework"
author = "the linework maintainers"
version = release = tomllib.loads((DOCS.parent / "pyproject.toml").read_text(encoding="utf-8"))["project"][
    "version"
]

extensions = ["myst_parser", "sphinx.ext.autodoc", "numpydoc", "reference_pages"]
exclude_patterns = ["extensions", "make_pictures"]
root_doc = "index"

# Markdown: every heading is an anchor, as on the pages of a source host.
myst_heading_anchors = 4

# Docstrings: types stand in the signature only, single backticks are names of Python.
default_role = "py:obj"
add_module_names = False
python_use_unqualified_type_names = True
python_maximum_signature_line_length = 100
autodoc_member_order = "bysource"
autodoc_type_aliases = {
    name: name
    for name in ("FloatArray", "Float32Array", "IntArray", "Int32Array", "ByteArray", "BoolArray", "AnyArray")
}
autodoc_typehints_format = "fully-qualified"
autodoc_preserve_defaults = True
autodoc_default_options = {"members": True, "undoc-members": True, "show-inheritance": True}
numpydoc_show_class_members = False

# A reference into linework must resolve. Those into other packages have no inventory here: a build asks
# nothing of the network.
nitpicky = True
nitpick_ignore_regex = [(r"py:.*", r"(?!linework\.).*|.*\.Annotated")]

# A source listed under References is that of the whole docstring, and is not cited again in its text.
suppress_warnings = ["ref.citation"]

html_theme = "pydata_sphinx_theme"
html_title = "linework"
html_static_path: list[str] = []
html_show_sourcelink = False
html_copy_source = False
html_theme_options = {
    "navbar_end": ["theme-switcher"],
    "navigation_with_keys": False,
    "show_nav_level": 1,
    "navigation_depth": 3,
    "show_toc_level": 2,
    "footer_start": ["copyright"],
    "footer_end": [],
    "secondary_sidebar_items": ["page-toc"],
}
html_sidebars = {
    name: [] for name in ("architecture", "changelog", "contributing", "getting-started", "glossary")
}
