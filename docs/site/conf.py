"""The documentation site: the Markdown pages where they are, and the API from its docstrings.

Sphinx reads the whole repository as its folder of sources, so a link between
pages is the same on the site and on a forge. `pages.py` adds what is generated.
"""

from __future__ import annotations

import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path[:0] = [str(HERE.parents[1]), str(HERE)]  # this checkout's packages, and pages.py

import decmcts  # noqa: E402  # found by the line above

project = "decmcts"
version = release = decmcts.__version__

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
    "pages",
    "written",
]
root_doc = "README"
include_patterns = ["*.md", "docs/**", "examples/README.md"]
exclude_patterns = [".*", "out"]
myst_heading_anchors = 4  # links to headings are as on a forge
default_role = "code"  # `name` in docstrings
autodoc_member_order = "bysource"
autodoc_preserve_defaults = True
autodoc_typehints = "none"  # written.py adds them
python_maximum_signature_line_length = 88

html_theme = "furo"
html_title = "decmcts"
html_extra_path = ["index.html"]  # leads to the README
html_copy_source = False
html_show_copyright = False  # LICENSE says it
