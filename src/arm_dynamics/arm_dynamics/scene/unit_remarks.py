# SPDX-License-Identifier: Apache-2.0
"""Remarks on values of a scene that are probably in other units: degrees, mm, ms or kg mm²."""

import math
from collections.abc import Iterator

from arm_dynamics.exceptions import degrees_meant, known_names
from arm_dynamics.scene.constraint import WORLD
from arm_dynamics.scene.effect import value_at
from arm_dynamics.scene.inertia import gyration
from arm_dynamics.scene.schema import Scene
from arm_dynamics.scene.urdf.description import Urdf
from arm_dynamics.scene.urdf.units import FAR, wide

_DEGREES = 720.0  # as a limit, more than two turns in degrees means none
_STROKE = 20.0  # lengths of the arm; a longer stroke is in mm, or means none if it is symmetric
_DELAY = 1.0  # [s] from a state to its command; longer ones are in ms


def unit_remarks(scene: Scene, urdf: Urdf) -> Iterator[str]:
    """Remarks on angles, position limits, lengths, delays and payloads' inertias."""
    for i, payload in enumerate(scene.payloads):
        if payload.mass and (r := gyration(payload.mass, payload.inertia)) > wide(urdf.size):
            yield (
                f"'payloads.{i}.inertia' = {list(payload.inertia)}: its radius of gyration is "
                f"{r:.3g} m; inertias are in kg m²"
            )
    turning = [name for name in urdf.moving if urdf.joints[name] != "prismatic"]
    steps = scene.sensors.position.resolution if scene.sensors else {}
    for key, angles in {
        "initial.position.{}": scene.initial.position,
        "joints.{}.spring.rest": {n: value_at(scene.joint(n), "spring.rest") for n in turning},
        "sensors.position.resolution.{}": steps,
    }.items():
        for name, angle in angles.items():
            if name in (*turning, "*") and angle and (remark := degrees_meant(angle)):
                yield f"'{key.format(name)}' = {remark}"
    if scene.delay > _DELAY:
        yield f"'sensors.delay' and 'commands.delay': {scene.delay:g} s in all; times are in s"
    yield from _length_remarks(scene, urdf)
    yield from _range_remarks(scene, urdf)


def _length_remarks(scene: Scene, urdf: Urdf) -> Iterator[str]:
    """Remarks on points in frames of the arm, cords, balls and wheels that are larger than it."""
    for key in ("payloads", "springs", "constraints"):
        for i, part in enumerate(getattr(scene, key)):
            ends = zip(getattr(part, "frames", ()), getattr(part, "points", ()), strict=False)
            points = {f"points.{k}": p for k, (frame, p) in enumerate(ends) if frame != WORLD}
            points |= {name: getattr(part, name, ()) for name in ("com", "point")}
            points |= {name: (getattr(part, name, 0.0),) for name in ("rest_length", "radius")}
            for name, point in points.items():
                if (length := math.hypot(*point)) > max(FAR, urdf.size):
                    yield f"'{key}.{i}.{name}' is {length:g} m; lengths are in m"


def _range_remarks(scene: Scene, urdf: Urdf) -> Iterator[str]:
    """Remarks on position limits, those of the scene in place of the description's."""
    degrees, millimetres = [], []
    for name in urdf.moving:
        own, (lower, upper) = scene.joint(name).limits, urdf.limited.get(name, (0.0, 0.0))
        lower = lower if own.lower is None else own.lower
        upper = upper if own.upper is None else own.upper
        place = f"joint '{name}' from {lower:g} to {upper:g}"
        farthest, stroke = max(-lower, upper), upper - lower
        if urdf.joints[name] != "prismatic":
            if farthest <= _DEGREES and degrees_meant(farthest):
                degrees.append(place)
        elif lower != -upper and stroke > max(FAR, _STROKE * urdf.size) and urdf.size:
            millimetres.append(place)
    for places, words in (
        (degrees, "are more than two turns; angles are in rad"),
        (millimetres, f"are far for an arm of {urdf.size:.3g} m; lengths are in m"),
    ):
        if places:
            yield f"position limits, {known_names(places, 5)}, {words}"
