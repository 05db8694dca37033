"""Settings of Sphinx: `make docs` builds the site from this folder."""

import sys
from importlib.metadata import version as version_of
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "_extensions"))

project = "Palpate"
author = "the Palpate authors"
project_copyright = "the Palpate authors"
release = version = version_of("palpate")
language = "en-GB"

extensions = ["generated_reference", "result_tables", "scene_sites", "myst_nb", "numpydoc", "sphinx.ext.autodoc"]
exclude_patterns = ["_build", "_extensions", "_results", "_scenes"]

# Links to headings of other pages, such as accuracy.md#which-element.
myst_heading_anchors = 4
myst_enable_extensions = ["colon_fence", "deflist"]
# The examples of scene files are TOML with comments that Pygments reads; C and console output are as they are.
highlight_language = "none"

# A tutorial that fails ends the build. Nothing that a cell prints is committed.
nb_execution_mode = "force"
# Files of a tutorial go into a folder that is removed.
nb_execution_in_temp = True
nb_execution_timeout = 240
nb_execution_raise_on_error = True
nb_execution_show_tb = True
nb_merge_streams = True

autodoc_member_order = "bysource"
autodoc_typehints = "none"
numpydoc_show_class_members = False
numpydoc_class_members_toctree = False

html_theme = "pydata_sphinx_theme"
html_title = "Palpate"
html_static_path: list[str] = []
html_theme_options = {
    "show_prev_next": True,
    "navigation_with_keys": False,
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": ["copyright"],
    "footer_end": [],
}
# Nothing is loaded from other machines: formulas are plain text.
html_show_sourcelink = False
