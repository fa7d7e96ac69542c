"""Sphinx: `make docs` builds these pages into out/docs; a warning is an error."""

import os
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent / "_ext"))

from ctrlgen import __version__

project = "ctrlgen"
author = "the ctrlgen authors"
version = release = __version__
extensions = ["myst_nb", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.mathjax", "reference_pages"]
myst_enable_extensions = ["dollarmath", "deflist", "colon_fence"]
myst_heading_anchors = 3
# Notebooks are kept without results and run when the pages are built; a cell that fails is an error
nb_execution_mode = "auto"
nb_execution_timeout = 300
nb_execution_in_temp = True
nb_execution_raise_on_error = True
nb_execution_show_tb = True
os.environ["PATH"] = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"  # what their lines of shell run
exclude_patterns = ["_ext", "README.md"]
html_theme = "furo"
html_title = "ctrlgen"
html_static_path = ["_static"]
autodoc_member_order = "bysource"
autodoc_typehints = "description"
autodoc_mock_imports = []
nitpicky = False
suppress_warnings = ["autosectionlabel.*"]
