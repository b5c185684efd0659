# SPDX-License-Identifier: Apache-2.0
"""Takes the figures of the gallery's scripts; one that moves becomes a player in the page.

sphinx-gallery's own way draws an animation twice, the second time for a thumbnail that moves.
"""

from __future__ import annotations

from textwrap import indent
from typing import Any

import matplotlib
from matplotlib import pyplot as plt
from matplotlib.animation import Animation
from sphinx_gallery.scrapers import matplotlib_scraper

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
    """An animation as a player of HTML; its last picture is saved for the thumbnail."""
    player = animation.to_jshtml()
    figure = animation._fig
    figure.savefig(path)
    plt.close(figure)
    html = indent(player, " " * 8)
    return f"\n.. container:: sphx-glr-animation\n\n    .. raw:: html\n\n{html}\n\n"
