# SPDX-License-Identifier: Apache-2.0
"""Remarks on values of a scene so large that their unit is probably another one."""

from __future__ import annotations

import math
from collections.abc import Iterator

from arm_dynamics.exceptions import degrees_meant, known_names
from arm_dynamics.scene.effect import given
from arm_dynamics.scene.inertia import gyration
from arm_dynamics.scene.schema import Scene
from arm_dynamics.scene.urdf import Urdf
from arm_dynamics.scene.urdf.units import FAR, wide

_MOST_DEGREES = 720.0  # as a limit, more than two turns in degrees means none
_STROKES = 20.0  # lengths of the arm; a longer stroke is in mm, or means none if it is symmetric


def unit_remarks(scene: Scene, urdf: Urdf) -> Iterator[str]:
    """Remarks on angles probably in degrees, lengths in mm and inertias of payloads in kg mm²."""
    for i, payload in enumerate(scene.payloads):
        key = f"'payloads.{i}"
        if (distance := math.hypot(*payload.com)) > max(FAR, urdf.size):
            yield (
                f"{key}.com' = {list(payload.com)} is {distance:g} m from '{payload.frame}'; "
                "lengths are in m"
            )
        if payload.mass and (r := gyration(payload.mass, payload.inertia)) > wide(urdf.size):
            yield (
                f"{key}.inertia' = {list(payload.inertia)}: its radius of gyration is {r:.3g} m; "
                "inertias are in kg m²"
            )
    turning = [name for name in urdf.moving if urdf.joints[name] != "prismatic"]
    for key, angles in {
        "initial.position.{}": scene.initial.position,
        "joints.{}.spring.rest": {n: given(scene.joint(n), "spring.rest") for n in turning},
    }.items():
        for name, angle in angles.items():
            if name in turning and angle and (remark := degrees_meant(angle)):
                yield f"'{key.format(name)}' = {remark}"
    yield from _of_ranges(scene, urdf)


def _of_ranges(scene: Scene, urdf: Urdf) -> Iterator[str]:
    """Remarks on position limits, those of the scene in place of the description's."""
    degrees, millimetres = [], []
    for name in urdf.moving:
        own, none = scene.joint(name).limits, (0.0, 0.0)
        said = zip((own.lower, own.upper), urdf.limited.get(name, none), strict=True)
        lower, upper = (other if x is None else x for x, other in said)
        place = f"joint '{name}' from {lower:g} to {upper:g}"
        farthest, stroke = max(-lower, upper), upper - lower
        if urdf.joints[name] != "prismatic":
            if farthest <= _MOST_DEGREES and degrees_meant(farthest):
                degrees.append(place)
        elif lower != -upper and stroke > max(FAR, _STROKES * urdf.size) and urdf.size:
            millimetres.append(place)
    for places, words in (
        (degrees, "are more than two turns; angles are in rad"),
        (millimetres, f"are far for an arm of {urdf.size:.3g} m; lengths are in m"),
    ):
        if places:
            yield f"position limits, {known_names(places, 5)}, {words}"
