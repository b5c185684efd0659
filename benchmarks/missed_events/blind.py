# SPDX-License-Identifier: Apache-2.0
"""The engine with one of its guards switched off.

Recordings are still judged by an intact engine: the account and the second look are built later.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from contextlib import contextmanager

import numpy as np

from arm_sim.stepping import engine, stepper

GUARDS = {
    "sliding joint": (
        "limits->joint[i] = -v[i] * d[i] - rounding;",
        "limits->joint[i] = -INFINITY;",
    ),
    "held joint": (
        "limits->joint[i] = joint_excess(x, &found, i);",
        "limits->joint[i] = -INFINITY;",
    ),
    "lower stop": ("lower_stop[i] - x[i] - room;", "-INFINITY;"),
    "upper stop": ("x[i] - upper_stop[i] - room;", "-INFINITY;"),
    "compliant stop": ("? -push[side][i] : met[side][i];", "? -INFINITY : met[side][i];"),
    "contact that closes": (
        "ground[k] - geometry.place[3 * k] - SINKING * t - GAP_ROUNDING * geometry.size[k];",
        "-INFINITY;",
    ),
    "contact that opens": (
        "limits->contact[2 * k] = -r[0];",
        "limits->contact[2 * k] = -INFINITY;",
    ),
    "drive or cord": (
        "(segment->p.switches[k] != 0.0 ? -value[k] : value[k]) - SWITCH_ROUNDING * size[k];",
        "-INFINITY;",
    ),
}
"""Guards of ``native/segments.h``, and what replaces each."""
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
    source = engine.source

    def blind(defines: dict[str, str], file: str = "", without: Collection[str] = ()) -> str:
        text = source(defines, file, without)
        if "find_excursion(" in text and text.count(whole) != 1:
            raise ValueError(f"the guard of {name} stands {text.count(whole)} times in the engine")
        return text.replace(whole, instead)

    recipe_of = stepper.recipe_of
    engine.source, stepper.recipe_of = blind, lambda *_: ""  # code without a guard is not kept
    try:
        yield name
    finally:
        engine.source, stepper.recipe_of = source, recipe_of
