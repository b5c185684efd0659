# SPDX-License-Identifier: Apache-2.0
"""Inverse dynamics of a robot description, independent of the suite and of Pinocchio.

Numbers are read as the specification of URDF means them. The torque of a joint is the moment,
about its axis, of the inertial forces of all links behind it, each from the acceleration of its
own centre of mass in the world: no recursion of forces, and no spatial algebra.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from xml.dom.expatbuilder import parseString
from xml.dom.minidom import Element

import numpy as np

Array = np.ndarray
DOWN = np.array([0.0, 0.0, -9.81])
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|[+-]?inf", re.ASCII)
_DECLARATION = re.compile(r"<\?xml.*?\?>", re.DOTALL)


def children(element: Element, tag: str) -> list[Element]:
    """The children of a tag."""
    return [child for child in element.childNodes if child.nodeName == tag]


def first(element: Element, tag: str) -> Element:
    """The first child of a tag, or an empty element."""
    return next(iter(children(element, tag)), Element(tag))


def numbers(element: Element, key: str, default: str) -> Array:
    """The numbers of an attribute."""
    words = (element.getAttribute(key) if element.hasAttribute(key) else default).split()
    assert words and all(map(_NUMBER.fullmatch, words)), (element.tagName, key, words)
    return np.array([float(word) for word in words])


def number(element: Element, key: str, default: str = "0") -> float:
    """The number of an attribute."""
    (one,) = numbers(element, key, default)
    return float(one)


def _turn(rpy: Array) -> Array:
    """Rotation about fixed axes: x, then y, then z."""
    (a, b, c), (sa, sb, sc) = np.cos(rpy), np.sin(rpy)
    x = np.array([[1, 0, 0], [0, a, -sa], [0, sa, a]])
    y = np.array([[b, 0, sb], [0, 1, 0], [-sb, 0, b]])
    z = np.array([[c, -sc, 0], [sc, c, 0], [0, 0, 1]])
    return z @ y @ x


def _about(axis: Array, angle: float) -> Array:
    """Rotation about an axis of unit length."""
    K = np.cross(np.eye(3), axis)
    return np.eye(3) + np.sin(angle) * K + (1 - np.cos(angle)) * K @ K


@dataclass
class Body:
    """Mass, centre of mass, and inertia about it along the axes of the link."""

    mass: float
    com: Array
    inertia: Array

    @classmethod
    def of(cls, link: Element) -> Body:
        """That of a <link>."""
        inertial = first(link, "inertial")
        place, tensor = first(inertial, "origin"), first(inertial, "inertia")
        i = [[number(tensor, key) for key in row] for row in
             (("ixx", "ixy", "ixz"), ("ixy", "iyy", "iyz"), ("ixz", "iyz", "izz"))]  # fmt: skip
        R = _turn(numbers(place, "rpy", "0 0 0"))
        mass = number(first(inertial, "mass"), "value")
        return cls(mass, numbers(place, "xyz", "0 0 0"), R @ np.array(i) @ R.T)


@dataclass
class Joint:
    """A joint: what it connects, where, its axis, losses and limits, and whom it follows."""

    kind: str
    parent: str
    child: str
    place: Array
    turn: Array
    axis: Array
    damping: float
    friction: float
    limits: tuple[float, float, float, float]
    leader: str | None
    rule: tuple[float, float]

    @classmethod
    def of(cls, joint: Element) -> Joint:
        """That of a <joint>."""
        place, loss, mimic = (first(joint, tag) for tag in ("origin", "dynamics", "mimic"))
        axis = numbers(first(joint, "axis"), "xyz", "1 0 0")
        limit = first(joint, "limit")
        lower, upper, effort, velocity = (
            number(limit, key) for key in ("lower", "upper", "effort", "velocity")
        )
        return cls(
            joint.getAttribute("type"), first(joint, "parent").getAttribute("link"),
            first(joint, "child").getAttribute("link"), numbers(place, "xyz", "0 0 0"),
            _turn(numbers(place, "rpy", "0 0 0")), axis / (np.linalg.norm(axis) or 1.0),
            number(loss, "damping"), number(loss, "friction"), (lower, upper, effort, velocity),
            mimic.getAttribute("joint") or None,
            (number(mimic, "multiplier", "1"), number(mimic, "offset")),
        )  # fmt: skip

    @property
    def moves(self) -> bool:
        """Whether it moves by itself or as a follower."""
        return self.kind in ("revolute", "continuous", "prismatic")


class Robot:
    """A robot description as read here."""

    def __init__(self, text: str) -> None:
        root = parseString(_DECLARATION.sub("", text), namespaces=False).documentElement
        links, joints = children(root, "link"), children(root, "joint")
        self.bodies = {link.getAttribute("name"): Body.of(link) for link in links}
        self.joints = {joint.getAttribute("name"): Joint.of(joint) for joint in joints}
        self._above = {joint.child: name for name, joint in self.joints.items()}

    def torques(
        self, q: Mapping[str, float], v: Mapping[str, float], a: Mapping[str, float],
        losses: bool = True,
    ) -> dict[str, float]:  # fmt: skip
        """Torques of the joints that follow no other; by name as all arguments."""
        state = {name: self._state(name, q, v, a) for name in self.joints}
        forces = {link: self._force(link, state) for link in self.bodies}
        found = dict.fromkeys((n for n, j in self.joints.items() if j.moves and not j.leader), 0.0)
        for name, joint in self.joints.items():
            if not joint.moves:
                continue
            leader, factor, _ = self._rule(name)
            torque = self._moment(name, forces)
            if losses:
                speed = state[name][1]
                torque += joint.damping * speed + joint.friction * np.sign(speed)
            if leader in found:
                found[leader] += factor * torque
        return found

    def _rule(self, name: str) -> tuple[str, float, float]:
        """The joint that another follows in the end, its factor and its offset."""
        joint = self.joints[name]
        if joint.leader is None:
            return name, 1.0, 0.0
        leader, factor, offset = self._rule(joint.leader)
        return leader, joint.rule[0] * factor, joint.rule[0] * offset + joint.rule[1]

    def _state(self, name: str, *given: Mapping[str, float]) -> tuple[float, float, float]:
        """Position, velocity and acceleration of any joint."""
        if not self.joints[name].moves:
            return 0.0, 0.0, 0.0
        leader, factor, offset = self._rule(name)
        x, rate, rise = (factor * one.get(leader, 0.0) for one in given)
        return x + offset, rate, rise

    def _way(self, link: str) -> list[str]:
        """The joints from the root to a link."""
        way: list[str] = []
        while link in self._above:
            way.insert(0, self._above[link])
            link = self.joints[way[0]].parent
        return way

    def _force(self, link: str, state: Mapping[str, tuple[float, float, float]]) -> _Force:
        """Where a link is, and the force and moment that its motion needs."""
        R, p = np.eye(3), np.zeros(3)
        w, alpha, a = np.zeros(3), np.zeros(3), np.zeros(3)
        axes = {}
        for name in self._way(link):
            joint, (x, rate, rise) = self.joints[name], state[name]
            slides = joint.kind == "prismatic"
            turned = R @ joint.turn
            axis = turned @ joint.axis
            r = R @ joint.place + (axis * x if slides else 0.0)
            a = a + np.cross(alpha, r) + np.cross(w, np.cross(w, r))
            p = p + r
            if slides:
                a = a + axis * rise + 2 * np.cross(w, axis * rate)
                R = turned
            else:
                R = turned @ _about(joint.axis, x)
                alpha = alpha + axis * rise + np.cross(w, axis * rate)
                w = w + axis * rate
            axes[name] = (axis, p)
        body = self.bodies[link]
        c = R @ body.com
        pull = body.mass * (a + np.cross(alpha, c) + np.cross(w, np.cross(w, c)) - DOWN)
        inertia = R @ body.inertia @ R.T
        return _Force(axes, p + c, pull, inertia @ alpha + np.cross(w, inertia @ w))

    def _moment(self, name: str, forces: Mapping[str, _Force]) -> float:
        """The force along, or the moment about the axis of a joint, of all links behind it."""
        slides, total = self.joints[name].kind == "prismatic", 0.0
        for force in forces.values():
            if name in force.axes:
                axis, at = force.axes[name]
                whole = np.cross(force.at - at, force.pull) + force.moment
                total += float(axis @ (force.pull if slides else whole))
        return total


@dataclass
class _Force:
    """Of a link: axes of the joints before it and points on them, by name; in the world."""

    axes: dict[str, tuple[Array, Array]]
    at: Array
    pull: Array
    moment: Array
