"""Sphinx configuration. `make docs` builds the pages with every warning an error."""

import sys
from pathlib import Path

import cdcp_igl

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE / "extensions"))

project = "cdcp_igl"
author = "The cdcp_igl developers"
copyright = author
release = version = cdcp_igl.__version__

extensions = [
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.viewcode",
    "numpydoc",
    "myst_parser",
    "sphinx_gallery.gen_gallery",
    "benchmark_results",
    "cited_tests",
    "console",
    "equations",
    "error_tables",
    "flow",
    "gallery_style",
    "places",
    "viewcode_anchors",
]
templates_path = ["_templates"]
exclude_patterns = ["examples", "generated/parts", "build"]
nitpicky = True

# -- pages -----------------------------------------------------------------------------

html_theme = "pydata_sphinx_theme"
html_title = "cdcp_igl"
html_static_path = ["_static"]
html_css_files = ["cdcp_igl.css"]
html_show_sourcelink = False
html_theme_options = {
    "show_prev_next": False,
    "navbar_end": ["theme-switcher"],
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": ["copyright"],
    "footer_end": [],
    "use_edit_page_button": False,
}
html_sidebars = {"index": [], "changelog": [], "benchmarks": []}

myst_enable_extensions = ["dollarmath"]
myst_heading_anchors = 3

# -- reference -------------------------------------------------------------------------

autodoc_typehints = "none"  # the docstrings say it with shapes
autodoc_member_order = "bysource"
numpydoc_show_class_members = False
numpydoc_class_members_toctree = False
add_module_names = False
toc_object_entries_show_parents = "hide"

# -- gallery ---------------------------------------------------------------------------

sphinx_gallery_conf = {
    "examples_dirs": "examples",
    "gallery_dirs": "gallery",
    "filename_pattern": r"\.py$",
    "within_subsection_order": "FileNameSortKey",
    "image_scrapers": ("gallery_style", "matplotlib"),
    "reset_modules": ("matplotlib", "gallery_style.style"),
    "reset_modules_order": "both",
    "abort_on_example_error": True,
    "doc_module": ("cdcp_igl",),
    "backreferences_dir": "generated/backreferences",
    "download_all_examples": False,
    "show_signature": False,
    "show_memory": False,
    "min_reported_time": 3600,
    "write_computation_times": False,
    "remove_config_comments": True,
    "thumbnail_size": (400, 280),
}
