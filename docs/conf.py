"""Settings of the documentation, built by `make docs` (Sphinx, MyST Markdown, furo)."""

from __future__ import annotations

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "_ext"))

from pygments.lexers import PythonLexer
from sphinx.highlighting import lexers

from jeat_graph.version import __version__

# A block that needs Ray is Python, and is run by its own test.
lexers["ray"] = PythonLexer()

project = "jeat-graph"
author = "The jeat-graph authors"
copyright = author
release = version = __version__

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "generated_reference",
    "mathml",
    "type_names",
]
myst_enable_extensions = ["dollarmath", "colon_fence", "deflist"]
myst_heading_anchors = 3
nb_execution_mode = "off"  # a test runs the notebooks; their outputs are kept in them
autodoc_member_order = "bysource"
# Not needed to read what is written about it.
autodoc_mock_imports = ["torch"]
autodoc_typehints = "description"
autodoc_typehints_description_target = "documented_params"
autodoc_typehints_format = "short"
autodoc_preserve_defaults = True
python_maximum_signature_line_length = 88
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True
nitpicky = False
exclude_patterns = ["_build", "_ext"]

html_theme = "furo"
html_title = "jeat-graph"
html_static_path = ["_static"]
html_css_files = ["extra.css"]
html_js_files = ["copy.js"]
html_search_scorer = str(Path(__file__).parent / "_static" / "scorer.js")
html_copy_source = False
html_show_sphinx = False
# Shown by their names, not as the unions that they stand for.
_NAMED = (
    "FloatArray",
    "IntArray",
    "BoolArray",
    "TextArray",
    "RecordArray",
    "EmbeddingArray",
    "PathLike",
    "ScanLike",
)
autodoc_type_aliases = {name: name for name in _NAMED} | {
    "npt.ArrayLike": "ArrayLike",
    "ArrayLike": "ArrayLike",
}
