# SPDX-License-Identifier: Apache-2.0
"""Takes the figures of the gallery's scripts; one that moves becomes a player in the page.

sphinx-gallery's own way draws an animation twice, the second time for a thumbnail that moves.
"""

from __future__ import annotations

import re
from textwrap import indent
from typing import Any

import matplotlib
import numpy as np
from matplotlib import pyplot as plt
from matplotlib.animation import Animation
from sphinx_gallery.scrapers import matplotlib_scraper

from arm_sim.figures import fill_with

THUMBNAIL = 4.0, 2.8  # inches; the shape of the gallery's frames

matplotlib.use("agg")


def pictures(block: Any, block_vars: dict[str, Any], gallery_conf: dict[str, Any]) -> str:
    """Save the figures that are open and say in reStructuredText where they are."""
    made = block_vars["example_globals"].values()
    players = [
        _player(value, next(block_vars["image_path_iterator"]))
        for value in made
        if isinstance(value, Animation) and plt.fignum_exists(value._fig.number)
    ]
    return "".join(players) + str(matplotlib_scraper(block, block_vars, gallery_conf))


def _player(animation: Animation, path: str) -> str:
    """An animation as a player of HTML; what moves is saved for the thumbnail, as it ends."""
    player = re.sub(r"<link\b[^>]*>", "", animation.to_jshtml())  # icons are those of the site
    figure = animation._fig
    for legend in figure.legends:
        legend.remove()
    (axes,) = figure.axes
    axes.set(position=(0.0, 0.0, 1.0, 1.0), title="")
    axes.set_axis_off()
    axes.texts[0].set_visible(False)  # the clock
    figure.set_size_inches(*THUMBNAIL)
    fill_with(axes, np.vstack([line.get_xydata() for line in axes.lines]))
    figure.savefig(path, dpi=200)
    plt.close(figure)
    html = indent(player, " " * 8)
    return f"\n.. container:: sphx-glr-animation\n\n    .. raw:: html\n\n{html}\n\n"
