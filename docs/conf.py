"""Settings of the documentation site; `make docs` builds it into docs/_build/html."""

from __future__ import annotations

import os
import sys
import tomllib
from pathlib import Path
from typing import Any

HERE = Path(__file__).parent
# The site needs no accelerator, and should not reserve its memory.
os.environ.setdefault("JAX_PLATFORMS", "cpu")
sys.path[:0] = [str(HERE.parent), str(HERE.parent / "src")]

import jax  # noqa: E402

from docs.environment_pages import write_pages  # noqa: E402
from docs.other_pages import commands_page, recipes  # noqa: E402
from docs.page_parts import turned  # noqa: E402
from jaxenstein.version import __version__  # noqa: E402

# Attributes are shown with their types; use the public name of this one.
jax.Array.__module__, jax.Array.__qualname__ = "jax", "Array"

project = "JAXenstein"
author = "The JAXenstein developers"
version = release = __version__
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.viewcode"]
# The pages of the environments include the files of `originals`.
exclude_patterns = ["_build", "originals"]
source_suffix = {".md": "markdown"}
default_role = "code"
# Blocks without a language are commands.
highlight_language = "text"

myst_enable_extensions = ["colon_fence"]
myst_heading_anchors = 3
PROJECT = tomllib.loads((HERE.parent / "pyproject.toml").read_text("utf-8"))["project"]
# `[words](repository:)` links to the repository.
myst_url_schemes = {
    "http": None,
    "https": None,
    "repository": PROJECT["urls"]["Repository"] + "{{path}}",
}

autodoc_member_order = "bysource"
# The docstrings state types, shapes and units.
autodoc_typehints = "none"
napoleon_google_docstring = True
napoleon_numpy_docstring = False

html_theme = "furo"
html_title = f"JAXenstein {__version__}"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_copy_source = False
html_show_sphinx = False
html_show_copyright = False
html_theme_options = {"navigation_with_keys": True}


def turn_links(app: Any, page: str, source: list[str]) -> None:
    """Point links to files outside docs at the pages that show them."""
    del app
    if "/" not in page:
        source[0] = turned(source[0])


def write_all(app: Any) -> None:
    """Write the generated pages; unchanged files are not touched."""
    del app
    write_pages(HERE / "environments")
    page, text = HERE / "commands.md", commands_page() + recipes()
    if not page.exists() or page.read_text("utf-8") != text:
        page.write_text(text, "utf-8")


def setup(app: Any) -> None:
    """Write the generated pages before the sources are read."""
    app.connect("builder-inited", write_all)
    app.connect("source-read", turn_links)
