# SPDX-License-Identifier: Apache-2.0
"""How Sphinx builds the site; ``./arm docs`` runs it.

Pages are Markdown, readable as they are, except for what the reference takes from the code; the
gallery is made from the scripts in ``gallery``.
"""

from __future__ import annotations

import re
import sys
from importlib.util import find_spec
from pathlib import Path
from typing import Any

from sphinx.application import Sphinx
from sphinx.config import Config
from sphinx.writers.text import TextTranslator

sys.path.insert(0, str(Path(__file__).parent))
project = "Arm dynamics"
author = copyright = "the contributors of Arm dynamics"
html_title = "Arm dynamics"

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_copybutton",
    "sphinx_design",
    "sphinx_gallery.gen_gallery",
    "_extensions.mathjax",
    "_extensions.reference",
]
# Scripts of the gallery become pages under generated/, so what is written by hand in their folder
# (headers of the sections) is no page.
exclude_patterns = ["gallery", "_extensions"]
suppress_warnings = [
    "config.cache",  # of the gallery, whose configuration holds classes
    "ref.python",  # attributes of several classes have one name, such as n
]
if tags.has("one_page"):  # noqa: F821  # as text, by ./arm docs --print
    extensions.remove("sphinx_gallery.gen_gallery")
    suppress_warnings += ["myst", "ref", "toc"]  # the other pages are not there

myst_enable_extensions = ["colon_fence", "dollarmath", "deflist", "attrs_inline"]
myst_heading_anchors = 4
myst_links_external_new_tab = True

autodoc_typehints = "description"
autoclass_content = "both"  # a constructor may say what it takes, too
autodoc_member_order = "bysource"
napoleon_numpy_docstring = False

autodoc_mock_imports = [name for name in ("playwright", "trimesh", "viser") if not find_spec(name)]
napoleon_use_ivar = True
# Types of Python, NumPy and other libraries are named and not linked.
nitpick_ignore_regex = [("py:.*", ".*")]

html_theme = "pydata_sphinx_theme"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_theme_options = {
    "logo": {"text": "Arm dynamics"},
    "header_links_before_dropdown": 9,
    "show_prev_next": True,
    "navigation_with_keys": True,
    "secondary_sidebar_items": ["page-toc"],
}
html_sidebars = {"start": [], "index": []}  # they have no pages below them
html_show_sourcelink = False
html_search_scorer = str(Path(__file__).parent / "_static/search.js")
copybutton_prompt_text = r"\$ |>>> "
copybutton_prompt_is_regexp = True

sphinx_gallery_conf = {
    "examples_dirs": "gallery",
    "gallery_dirs": "generated/gallery",
    "filename_pattern": "/plot_",
    "image_scrapers": ("_extensions.pictures.pictures",),
    "parallel": True,
    "subsection_order": ["gallery/mechanics", "gallery/drives", "gallery/control"],
    "copyfile_regex": r".*\.(urdf|yaml|csv)",
    "remove_config_comments": True,
    "capture_repr": (),  # what a cell ends in is not shown, only what it prints and draws
    "write_computation_times": False,
    "show_memory": False,
    "show_signature": False,
    "abort_on_example_error": False,  # the build goes on and fails in the end
}


def links_out_of_the_site(app: Sphinx, name: str, source: list[str]) -> None:
    """Lead links to documents at the root, and to scripts of the gallery, to their pages here."""
    if app.tags.has("one_page"):
        source[0] = re.sub(r"```\{toctree\}.*?```", "", source[0], flags=re.DOTALL)
    source[0] = re.sub(
        r"\]\((?:\.\./)+(CONTRIBUTING|CHANGELOG)\.md(#[^)]*)?\)",
        lambda found: f"](/project/{found[1].lower()}.md{found[2] or ''})",
        source[0],
    )
    source[0] = re.sub(
        r"\]\((?:\.\./)*gallery/(?:(\w+/plot_\w+)\.py)?\)",
        lambda found: f"](/generated/gallery/{found[1] or 'index'}.rst)",
        source[0],
    )
    # The first page of the gallery, which is reStructuredText.
    source[0] = re.sub(
        r"`([^`<]+) <(?:(\w+/plot_\w+)\.py|\.\./(concepts/\w+)\.md)>`__",
        lambda found: f":doc:`{found[1]} </{found[3] or f'generated/gallery/{found[2]}'}>`",
        source[0],
    )


def only_the_root(app: Sphinx, config: Config) -> None:
    """Read no other page than the one that is printed."""
    if app.tags.has("one_page"):
        config.include_patterns = [f"{config.root_doc}.md"]


class Text(TextTranslator):
    """Pages as text, with code between the marks that it has in Markdown."""

    def visit_literal(self, node: Any) -> None:
        """Begin and end code."""
        self.add_text("`")

    depart_literal = visit_literal


def setup(app: Sphinx) -> None:
    """Called by Sphinx."""
    assert find_spec("arm_sim"), "the site is built by ./arm docs"
    app.connect("source-read", links_out_of_the_site)
    app.set_translator("text", Text)
    app.connect("config-inited", only_the_root)
