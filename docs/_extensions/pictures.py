# SPDX-License-Identifier: Apache-2.0
"""Takes the figures of the gallery's scripts; one that moves becomes a player in the page.

sphinx-gallery's own way draws an animation twice, the second time for a thumbnail that moves.
"""

from __future__ import annotations

import re
from base64 import b64decode, b64encode
from io import BytesIO
from textwrap import indent
from typing import Any

import matplotlib
import numpy as np
from matplotlib import pyplot as plt
from matplotlib.animation import Animation
from PIL import Image
from sphinx_gallery.scrapers import matplotlib_scraper

from arm_sim.figures import fill_with

THUMBNAIL = 4.0, 2.8  # inches; the shape of the gallery's frames
SHADES = 64  # of a film: without more, a page stays near a megabyte
PICTURE = re.compile(r'(?<=data:image/png;base64,)[^"]+')

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
    with matplotlib.rc_context({"savefig.dpi": "figure"}):
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
    html = indent(_lighter(player), " " * 8)
    return f"\n.. container:: sphx-glr-animation\n\n    .. raw:: html\n\n{html}\n\n"


def _lighter(player: str) -> str:
    """A player with pictures of few colours, those of the last one."""
    read = (BytesIO(b64decode(text)) for text in PICTURE.findall(player))
    pictures = [Image.open(file).convert("RGB") for file in read]
    palette = pictures[-1].quantize(SHADES, Image.Quantize.FASTOCTREE)
    made = iter(
        picture.quantize(palette=palette, dither=Image.Dither.NONE) for picture in pictures
    )

    def text(_: re.Match[str]) -> str:
        next(made).save(file := BytesIO(), "PNG", optimize=True)
        return b64encode(file.getvalue()).decode()

    return PICTURE.sub(text, player)
