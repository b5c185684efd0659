# SPDX-License-Identifier: Apache-2.0
"""Remarks on lengths and inertias so large that their unit is probably another one."""

from collections.abc import Iterable, Mapping
from xml.etree import ElementTree

from arm_dynamics.scene.inertia import gyration
from arm_dynamics.scene.urdf.plain import MOVING, TENSOR, Notes, distance, link_at

# Lengths in [m] beyond which a unit is doubtful, unless the arm is as long
FAR = 10.0
_LIGHT, _CRANE = 10.0, 1000.0  # [kg/m] that arms with links of 10 m, and of 100 m, exceed
_RADIUS = 0.5  # [m] of gyration, of bodies whose size joints do not tell, such as turntables
_SHARE = 1e-3  # fraction of the arm's mass times the square of its length

type Parts = Mapping[str, ElementTree.Element]


def size_of(links: Parts, joints: Parts, inward: Iterable[str]) -> float:
    """Largest distance in [m] of a joint or centre of mass from the first joint that moves.

    It is measured along the chain, so that no posture exceeds it. ``inward`` has the names of the
    links, each after its parent.
    """
    above = {link_at(joint, "child"): joint for joint in joints.values()}
    far: dict[str | None, float] = {}
    for link in inward:
        if (joint := above.get(link)) is None:
            continue
        if (parent := link_at(joint, "parent")) in far:
            far[link] = far[parent] + distance(joint)
        elif joint.get("type") in MOVING:
            far[link] = 0.0
    return max((d + _lever(links[str(link)]) for link, d in far.items()), default=0.0)


def wide(size: float) -> float:
    """Radius of gyration in [m] that no body of an arm of a length in [m] exceeds."""
    return max(size, _RADIUS) if size else FAR


def note_units(links: Parts, joints: Parts, size: float, notes: Notes) -> None:
    """Note lengths probably in mm, and inertias probably in kg mm², kg cm² or g mm²."""
    inner = {link_at(joint, "child") for joint in joints.values() if joint.get("type") in MOVING}
    bodies = {name: body for name, link in links.items() if (body := _body(link))[0] > 0.0}
    mass = sum(weight for weight, _ in bodies.values())
    origins = {
        f"joint '{name}'": distance(joint)
        for name, joint in joints.items()
        if link_at(joint, "parent") in inner  # the base may stand anywhere
    } | {f"link '{name}'": _lever(link) for name, link in links.items()}
    far = {
        place: d
        for place, d in origins.items()
        if d > FAR and mass < d * (_LIGHT if d < 10.0 * FAR else _CRANE)
    }
    bulky = {
        f"link '{name}'": r
        for name, (m, six) in bodies.items()
        if (r := gyration(m, six)) > wide(size) and m * r * r > _SHARE * mass * size * size
    }
    for places, remark, hint in (
        (far, "<origin> {:g} m away", f"far for an arm of {mass:.3g} kg; lengths are in m"),
        (
            bulky, "radius of gyration of {:.3g} m",
            f"beyond the length of the arm, {size:.3g} m; inertias are in kg m²",
        ),
    ):  # fmt: skip
        for first in [*places.values()][:1]:
            notes[f"{remark.format(first)}, {hint}"] = list(places)


def _lever(link: ElementTree.Element) -> float:
    """Distance in [m] of a link's centre of mass from its origin."""
    inertial = link.find("inertial")
    return 0.0 if inertial is None else distance(inertial)


def _body(link: ElementTree.Element) -> tuple[float, list[float]]:
    """Mass in [kg], and ixx, ixy, ixz, iyy, iyz, izz in [kg m²]; zeros where there is none."""
    mass, tensor = link.find("inertial/mass"), link.find("inertial/inertia")
    if mass is None or tensor is None:
        return 0.0, [0.0] * 6
    return float(mass.get("value", "")), [float(tensor.get(key, "0")) for key in TENSOR]
