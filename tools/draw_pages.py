# SPDX-License-Identifier: Apache-2.0
"""Draws the figures of the tutorials by running their code: docs/figures.

``./arm python tools/draw_pages.py`` also prints what the code prints.
"""

import os
import re
import shutil
import tempfile
from pathlib import Path

import matplotlib

DOCS = Path(__file__).resolve().parents[1] / "docs"
FIGURES = {
    "start.md": {"falling.png": "falling.png"},
    "tutorials/own-arm.md": {"tracking.png": "tracking.png"},
    "tutorials/friction-and-motors.md": {"friction.png": "swings.png"},
    "tutorials/loops-and-contact.md": {"contact.png": "bounces.png"},
}
BLOCK = re.compile(r"^```(\w+)[^\n]*\n(.*?)^```", re.M | re.S)
FILE = re.compile(r"(?:#|<!--) ([\w-]+\.(?:yaml|urdf|py))(?: -->)?\n")


def draw(page: str, folder: Path) -> None:
    """Run the Python of a page in a folder and take its figures from there."""
    found = BLOCK.findall((DOCS / page).read_text())
    for language, text in found:
        if (named := FILE.match(text)) and language != "bash":
            (folder / named[1]).write_text(text)
    code = "\n".join(text for language, text in found if language == "python")
    os.chdir(folder)
    exec(compile(code, page, "exec"), {"__name__": "__main__"})
    for made, figure in FIGURES[page].items():
        shutil.copy(folder / made, DOCS / "figures" / figure)


if __name__ == "__main__":
    matplotlib.rcParams |= {"backend": "agg", "savefig.dpi": 160.0}  # as arm_sim.figures.STYLE
    for page in FIGURES:
        with tempfile.TemporaryDirectory() as folder:
            draw(page, Path(folder))
