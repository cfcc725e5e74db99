"""Settings of the documentation: ``make docs`` builds it into build/docs, and a warning is an error."""

from __future__ import annotations

import sys
import tomllib
from pathlib import Path

DOCS = Path(__file__).parent
sys.path.insert(0, str(DOCS / "extensions"))

from gallery_runs import copy_examples  # noqa: E402  (its folder has only now a place on the path)

project = "linework"
author = "the linework maintainers"
version = release = tomllib.loads((DOCS.parent / "pyproject.toml").read_text(encoding="utf-8"))["project"][
    "version"
]

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "numpydoc",
    "sphinx_gallery.gen_gallery",
    "gallery_runs",
    "reference_pages",
]
exclude_patterns = ["extensions", "make_pictures", "examples", ".examples"]
root_doc = "index"

# Gallery: every example is run, in a folder that is empty but for the examples; one that fails stops the build.
sphinx_gallery_conf = {
    "examples_dirs": copy_examples(),
    "gallery_dirs": "gallery",
    "filename_pattern": r"\.py$",
    "subsection_order": [f".examples/{name}" for name in ("first_steps", "methods", "own_steps", "exchange")],
    "within_subsection_order": "gallery_runs.ReadingOrder",
    "abort_on_example_error": True,
    "backreferences_dir": None,
    "download_all_examples": False,
    "ignore_repr_types": r"matplotlib|'(list|tuple)'",
    "image_scrapers": ("matplotlib",),
    "remove_config_comments": True,
    "reset_modules": ("matplotlib", "gallery_runs.remove_what_was_written"),
    "reset_modules_order": "both",
    "show_memory": False,
    "show_signature": False,
    "write_computation_times": False,
    "min_reported_time": 1e9,
}

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
