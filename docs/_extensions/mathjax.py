# SPDX-License-Identifier: Apache-2.0
"""MathJax from the package ``sphinx-mathjax-offline``: equations are drawn without a network, too.

That package's own extension forbids parallel builds and copies five times what is needed.
"""

from __future__ import annotations

import shutil
from importlib.util import find_spec
from pathlib import Path

from sphinx.application import Sphinx

PARTS = ("tex-chtml.js", "output/chtml/fonts", "input/tex/extensions")


def copy_parts(app: Sphinx, trouble: Exception | None) -> None:
    """Put what the pages load beside them."""
    found = find_spec("sphinx-mathjax-offline")
    if trouble or not found or not found.origin:
        return
    source, target = Path(found.origin).parent / "static/mathjax", app.outdir / "_static/mathjax"
    for part in PARTS:
        (target / part).parent.mkdir(parents=True, exist_ok=True)
        if (source / part).is_dir():
            shutil.copytree(source / part, target / part, dirs_exist_ok=True)
        else:
            shutil.copy(source / part, target / part)


def setup(app: Sphinx) -> dict[str, bool]:
    """Called by Sphinx."""
    app.setup_extension("sphinx.ext.mathjax")
    app.config.mathjax_path = "mathjax/tex-chtml.js"
    app.connect("build-finished", copy_parts)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
