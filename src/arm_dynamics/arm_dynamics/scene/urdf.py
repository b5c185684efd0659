# SPDX-License-Identifier: Apache-2.0
"""Check a URDF before Pinocchio reads it.

Pinocchio's parser silently accepts an unreadable or negative mass. This module refuses such files
with the name of the offending element. It determines the joints and frames of a description
without loading Pinocchio.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from xml.etree import ElementTree

import numpy as np

from arm_dynamics.exceptions import ModelError, choices, did_you_mean, known_names
from arm_dynamics.scene.inertia import ROUNDING, fault, moments

MOVING = ("revolute", "continuous", "prismatic")
SUPPORTED = (*MOVING, "fixed")
_NUMBERS = {
    "origin": ("xyz", "rpy"),
    "axis": ("xyz",),
    "mass": ("value",),
    "inertia": ("ixx", "ixy", "ixz", "iyy", "iyz", "izz"),
    "limit": ("lower", "upper", "effort", "velocity"),
    "dynamics": ("damping", "friction"),
    "mimic": ("multiplier", "offset"),
}
_NOT_NEGATIVE = {
    ("mass", "value"),
    ("dynamics", "damping"),
    ("dynamics", "friction"),
    ("limit", "effort"),
    ("limit", "velocity"),
}
NEGATIVE_PART = 0.5
"""Largest negative principal moment of a link relative to its largest one.

Published robots have physically inconsistent tensors: 16 of the 69 descriptions in
example-robot-data, down to -0.39 (Tiago's antennas). The mass matrix may still be regular (if it
is not, forward dynamics refuses the arm), so they cause a warning; larger ones are errors."""


@dataclass(frozen=True)
class Mimic:
    """Follower rule ``q = multiplier * q_leader + offset``."""

    leader: str
    multiplier: float
    offset: float


@dataclass(frozen=True)
class Urdf:
    """Facts of a URDF that Pinocchio does not provide.

    Attributes:
        joints: Type of every joint by name.
        links: Names of the links.
        mimics: Follower rules by joint name.
        doubtful: Links whose inertia is not physically consistent, and why; it is used unchanged.
    """

    joints: dict[str, str]
    links: tuple[str, ...]
    mimics: dict[str, Mimic]
    doubtful: dict[str, str]

    @property
    def moving(self) -> list[str]:
        """Names of the joints that are not fixed."""
        return [name for name, kind in self.joints.items() if kind in MOVING]

    @property
    def frames(self) -> list[str]:
        """Names that a payload or a constraint may be attached to."""
        return [*self.links, *self.joints]


def read_urdf(text: str) -> Urdf:
    """Parse and check a robot description.

    Args:
        text: URDF as XML.

    Returns:
        Its joints, links and mimic rules.

    Raises:
        ModelError: If it is malformed, or holds an unsupported joint type or unphysical number.
    """
    robot = _root(text)
    links = _unique(robot, "link")
    joints = _unique(robot, "joint")
    if not links:
        xacro = "; this is xacro source, expand it to URDF first" if "<xacro:" in text else ""
        raise ModelError(f"robot description: no <link> found; at least one is required{xacro}")
    for name, element in {**links, **joints}.items():
        _check_numbers(element, f"{element.tag} '{name}'")
    for name, joint in joints.items():
        _check_joint(name, joint, set(links))
    faults = {name: _check_inertia(name, link) for name, link in links.items()}
    _check_tree(joints, links)
    kinds = {name: joint.get("type", "") for name, joint in joints.items()}
    doubtful = {name: trouble for name, trouble in faults.items() if trouble}
    return Urdf(kinds, tuple(links), _mimics(joints, kinds), doubtful)


def _root(text: str) -> ElementTree.Element:
    try:
        root = ElementTree.fromstring(text.encode())
    except ElementTree.ParseError as error:
        raise ModelError(f"robot description: not well-formed XML: {error}") from None
    if root.tag != "robot":
        raise ModelError(f"robot description: the root element is <{root.tag}>, not <robot>")
    for element in root:
        # Expanded files may keep definitions; a remaining call means that a part is missing.
        name = element.tag.rpartition("}")[2]
        if "xacro" in element.tag and name not in ("property", "macro", "include", "arg"):
            raise ModelError(
                f"robot description: <xacro:{name}> is not expanded; run xacro on the file first"
            )
    return root


def _unique(robot: ElementTree.Element, tag: str) -> dict[str, ElementTree.Element]:
    found: dict[str, ElementTree.Element] = {}
    for element in robot.findall(tag):
        name = element.get("name")
        if not name:
            raise ModelError(f"robot description: a <{tag}> has no name")
        if name in found:
            raise ModelError(f"robot description: two <{tag}> are called '{name}'")
        found[name] = element
    return found


def _dynamic_elements(element: ElementTree.Element) -> Iterator[ElementTree.Element]:
    """The element's children that affect the dynamics, without visual and collision."""
    for child in element:
        if child.tag == "inertial":
            yield from child
        else:
            yield child


def _check_numbers(element: ElementTree.Element, owner: str) -> None:
    for child in _dynamic_elements(element):
        for attribute in _NUMBERS.get(child.tag, ()):
            text = child.get(attribute)
            if text is None:
                continue
            count = 3 if attribute in ("xyz", "rpy") else 1
            values = _floats(text)
            if len(values) != count or not all(map(math.isfinite, values)):
                allowed = "one finite number" if count == 1 else "three finite numbers"
                raise ModelError(
                    f"{owner}: <{child.tag} {attribute}={text!r}>: expected {allowed}"
                )
            if (child.tag, attribute) in _NOT_NEGATIVE and values[0] < 0:
                raise ModelError(
                    f"{owner}: <{child.tag} {attribute}={text!r}>: must not be negative"
                )


def _floats(text: str) -> list[float]:
    try:
        return [float(word) for word in text.split()]
    except ValueError:
        return []


def _link_name(joint: ElementTree.Element, end: str) -> str | None:
    element = joint.find(end)
    return None if element is None else element.get("link")


def _check_joint(name: str, joint: ElementTree.Element, links: set[str]) -> None:
    kind = joint.get("type")
    if kind not in SUPPORTED:
        raise ModelError(
            f"joint '{name}': type {kind!r} is not supported; allowed: {choices(kind, SUPPORTED)}"
        )
    for end in ("parent", "child"):
        link = _link_name(joint, end)
        if link not in links:
            raise ModelError(
                f"joint '{name}': {end} link {link!r} does not exist; "
                f"links: {choices(link, sorted(links))}"
            )
    axis = joint.find("axis")
    if (
        kind in MOVING
        and axis is not None
        and np.linalg.norm(_floats(axis.get("xyz", "1 0 0"))) < 1e-9
    ):
        raise ModelError(f"joint '{name}': axis {axis.get('xyz')!r} has no direction")
    if kind in ("revolute", "prismatic"):
        _check_limit(name, kind, joint.find("limit"))


def _check_limit(name: str, kind: str, limit: ElementTree.Element | None) -> None:
    if limit is None:
        raise ModelError(f"joint '{name}': a {kind} joint needs <limit>; 'continuous' has none")
    lower, upper = float(limit.get("lower", "0")), float(limit.get("upper", "0"))
    if lower > upper:
        raise ModelError(f"joint '{name}': <limit lower={lower} upper={upper}>: lower is above")


def _check_inertia(name: str, link: ElementTree.Element) -> str | None:
    """Refuse inertias that cannot be used; return why others are not physically consistent."""
    inertial = link.find("inertial")
    if inertial is None:
        return None
    mass, tensor = inertial.find("mass"), inertial.find("inertia")
    if mass is None or mass.get("value") is None:
        raise ModelError(f"link '{name}': <inertial> without <mass value=…>")
    if tensor is None:
        raise ModelError(f"link '{name}': <inertial> without <inertia>")
    for key in ("ixx", "iyy", "izz"):
        if float(tensor.get(key, "0")) < -ROUNDING:
            raise ModelError(
                f"link '{name}': <inertia {key}={tensor.get(key)!r}>: must not be negative"
            )
    six = [float(tensor.get(key, "0")) for key in _NUMBERS["inertia"]]
    found = moments(six)
    if found[0] < -max(ROUNDING, NEGATIVE_PART * found[2]):
        said = ", ".join(f"{moment:.6g}" for moment in found)
        raise ModelError(
            f"link '{name}': <inertia>: principal moments {said} kg m²: the smallest must not be "
            f"negative by more than {NEGATIVE_PART} of the largest"
        )
    return fault(float(mass.get("value", "0")), six)


def _check_tree(
    joints: dict[str, ElementTree.Element], links: dict[str, ElementTree.Element]
) -> None:
    parent_of: dict[str, str] = {}
    for name, joint in joints.items():
        child = _link_name(joint, "child")
        if child in parent_of:
            raise ModelError(
                f"joint '{name}': link '{child}' already has a parent joint; "
                "URDF describes trees only"
            )
        parent_of[str(child)] = str(_link_name(joint, "parent"))
    ringed = [name for name in links if _in_ring(name, parent_of)]
    if ringed:
        raise ModelError(
            f"robot description: links {known_names(ringed)} form a loop; "
            "URDF describes trees only"
        )
    roots = [name for name in links if name not in parent_of]
    if len(roots) != 1:
        raise ModelError(
            f"robot description: one root link expected, found {len(roots)}: {known_names(roots)}"
        )


def _in_ring(link: str, parent_of: dict[str, str]) -> bool:
    above, seen = parent_of.get(link), set[str]()
    while above is not None and above not in seen:
        if above == link:
            return True
        seen.add(above)
        above = parent_of.get(above)
    return False


def _mimics(joints: dict[str, ElementTree.Element], kinds: dict[str, str]) -> dict[str, Mimic]:
    rules: dict[str, Mimic] = {}
    for name, joint in joints.items():
        element = joint.find("mimic")
        if element is None or kinds[name] == "fixed":
            continue
        leader = element.get("joint")
        if leader not in kinds or kinds[leader] == "fixed" or leader == name:
            others = [n for n, kind in kinds.items() if kind in MOVING and n != name]
            allowed = known_names(others) + (
                "" if leader in kinds else did_you_mean(leader, others)
            )
            raise ModelError(
                f"joint '{name}': mimics {leader!r}, which does not move; allowed: {allowed}"
            )
        rules[name] = Mimic(
            leader, float(element.get("multiplier", "1")), float(element.get("offset", "0"))
        )
    return rules
