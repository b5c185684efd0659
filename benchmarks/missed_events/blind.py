# SPDX-License-Identifier: Apache-2.0
"""The engine with one of its guards switched off.

Recordings are still judged by an intact engine: the second run is built later.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from shutil import copytree
from tempfile import TemporaryDirectory

import numpy as np

from arm_sim.stepping import engine

GUARDS = {
    "sliding joint": (
        "guards->joint[i] = -v[i] * d[i] - rounding;",
        "guards->joint[i] = -INFINITY;",
    ),
    "held joint": (
        "guards->joint[i] = joint_excess(scene, x, &found, i);",
        "guards->joint[i] = -INFINITY;",
    ),
    "lower stop": ("scene->rigid_stop[0][i] - x[i] - room;", "-INFINITY;"),
    "upper stop": ("x[i] - scene->rigid_stop[1][i] - room;", "-INFINITY;"),
    "compliant stop": ("? -push[side][i] : met[side][i];", "? -INFINITY : met[side][i];"),
    "contact that closes": (
        "ground[k] - geometry.place[3 * k] - SINKING * t - GAP_ROUNDING * geometry.size[k];",
        "-INFINITY;",
    ),
    "contact that opens": (
        "guards->contact[2 * k] = -r[0];",
        "guards->contact[2 * k] = -INFINITY;",
    ),
    "drive or cord": (
        "(segment->p.switches[k] != 0.0 ? -value[k] : value[k]) - SWITCH_ROUNDING * size[k];",
        "-INFINITY;",
    ),
}
"""Guards of ``native/events/segments.h``, and what replaces each."""
FEATURES = {
    "sliding joint": {"dry friction"},
    "held joint": {"dry friction"},
    "lower stop": {"rigid stop"},
    "upper stop": {"rigid stop"},
    "compliant stop": {"compliant stop"},
    "contact that closes": {"contact"},
    "contact that opens": {"contact"},
    "drive or cord": {"cord", "backlash", "current limit"},
}
"""Features of a scene, one of which it must have for a guard to see anything."""


@contextmanager
def switched_off(seed: int, label: str) -> Iterator[str]:
    """Simulators that are built within have no guard of a kind; its name.

    Args:
        seed: it is drawn by this ...
        label: ... from those that see the features of a scene, see ``Case.label``.
    """
    own = [name for name in GUARDS if FEATURES[name] & set(label.split(", "))]
    name = str(np.random.default_rng(seed).choice(own or list(GUARDS)))
    whole, instead = GUARDS[name]
    with TemporaryDirectory() as folder:
        native = Path(copytree(engine.NATIVE, folder, dirs_exist_ok=True))
        segments = native / "events/segments.h"
        segments.write_text(segments.read_text().replace(whole, instead))
        engine.INCLUDED = (f"-I{native}",)
        engine._library.cache_clear()
        try:
            yield name
        finally:
            engine.INCLUDED = (f"-I{engine.NATIVE}",)
            engine._library.cache_clear()
