# SPDX-License-Identifier: Apache-2.0
"""The numbers of links and joints that matter to the dynamics, read and written anew.

Parsers disagree about what is a number, and urdfdom, which Pinocchio uses, drops an element
without an error if it cannot read one of its numbers: a mass of ``"3 "`` becomes zero. Hence
Pinocchio receives only what was read here, in a form about which all parsers agree.
"""

import math
import re
import sys
from difflib import get_close_matches
from xml.etree import ElementTree

from arm_dynamics.arrays import unit
from arm_dynamics.exceptions import ModelError, degrees_meant

MOVING = ("revolute", "continuous", "prismatic")
SUPPORTED = (*MOVING, "fixed")
# Types of joints that are supported only if the scene locks them: then they are fixed
HELD = ("floating", "planar")
TENSOR = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
MOMENTS = ("ixx", "iyy", "izz")
PRODUCTS = ("ixy", "ixz", "iyz")
# Attributes with numbers, and those with names, by the tag of their element
_NUMBERS = {
    "origin": ("xyz", "rpy"),
    "axis": ("xyz",),
    "mass": ("value",),
    "inertia": TENSOR,
    "limit": ("lower", "upper", "effort", "velocity"),
    "dynamics": ("damping", "friction"),
    "mimic": ("multiplier", "offset"),
}
_NAMES = {"parent": "link", "child": "link", "mimic": "joint"}
_TAGS = {*_NUMBERS, "parent", "child", "inertial", "visual", "collision"}
_SIMILARITY = 0.8  # see ``difflib``: from it on an unknown tag is probably a misspelt one
_LIMITS = ("effort", "velocity")
_NOT_NEGATIVE = ("value", "damping", "friction", *_LIMITS)
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?", re.ASCII | re.IGNORECASE)
_INFINITE = re.compile(r"[+-]?inf(inity)?", re.ASCII | re.IGNORECASE)
_LARGEST = sys.float_info.max
_ROUNDING = 0.01  # error of the length of an axis of two decimals
# A position limit beyond this, in [rad] or [m], means no limit
NO_LIMIT = 1e15

# Remarks on what is unusual, each with the places where it is
type Notes = dict[str, list[str]]


def floats(text: str) -> list[float]:
    """Numbers separated by white space; empty unless all are decimal numbers as in C.

    Python alone also takes ``1_000`` and digits of other scripts for numbers.
    """
    words = text.split()
    return [float(word) for word in words] if all(map(_NUMBER.fullmatch, words)) else []


def plain_link(link: ElementTree.Element, notes: Notes) -> ElementTree.Element:
    """Copy of a named <link> with no more than its <inertial>; ``notes`` receives remarks."""
    owner = f"link '{link.get('name')}'"
    copy = ElementTree.Element("link", name=link.get("name", ""))
    inertials = link.findall("inertial")
    _note_unknown(link, owner, notes)
    if len(inertials) > 1:
        _note(notes, "more than one <inertial>: only the first counts", owner)
    for inertial in inertials[:1]:
        part = ElementTree.SubElement(copy, "inertial")
        part.extend(_parts(inertial, ("origin", "mass", "inertia"), owner, notes))
        tensor = part.find("inertia")
        if tensor is not None and (
            absent := [key for key in PRODUCTS if key not in tensor.keys()]
        ):
            tensor.attrib.update(dict.fromkeys(absent, "0.0"))
            _note(notes, f"<inertia> without {', '.join(absent)}: taken as 0", owner)
    return copy


def plain_joint(
    joint: ElementTree.Element, notes: Notes, locked: bool = False
) -> ElementTree.Element:
    """Copy of a named <joint> with what matters to its motion; ``notes`` receives remarks.

    What is not limited has a limit of zero or of the largest number. If the scene locks it, one of
    ``HELD`` is fixed.
    """
    name, kind = joint.get("name", ""), joint.get("type", "")
    if locked and kind in HELD:
        kind = "fixed"
    owner = f"joint '{name}'"
    copy = ElementTree.Element("joint", name=name, type=kind)
    own = () if kind == "fixed" else ("axis", "limit", "dynamics", "mimic")
    copy.extend(_parts(joint, ("origin", "parent", "child", *own), owner, notes))
    if kind in MOVING:
        _check_axis(copy, joint, owner, notes)
    for limit in copy.findall("limit"):  # open ones such that urdfdom reads them
        for key in _LIMITS:
            if key not in limit.keys():
                limit.set(key, "0.0")
                _note(notes, f"<limit> without {key}: none is assumed", owner)
        for key in limit.keys():
            if abs(float(limit.get(key, "0"))) == _LARGEST:
                _note(notes, f"<limit {key}> is infinite: there is none", owner)
    if (losses := copy.find("dynamics")) is not None and not losses.attrib:
        losses.attrib.update(damping="0.0", friction="0.0")
        _note(notes, "<dynamics> without damping and friction: both are taken as 0", owner)
    return copy


def described_range(joint: ElementTree.Element) -> tuple[float, float]:
    """Lower and upper position limit of the copy of a joint; equal ones mean none."""
    if (limit := joint.find("limit")) is None or joint.get("type") == "continuous":
        return 0.0, 0.0
    return float(limit.get("lower", "0")), float(limit.get("upper", "0"))


def is_limited(joint: ElementTree.Element) -> bool:
    """Whether the copy of a joint has a position limit."""
    lower, upper = described_range(joint)
    return lower != upper and min(abs(lower), abs(upper)) <= NO_LIMIT


def link_at(joint: ElementTree.Element, end: str) -> str | None:
    """Name of the link at the ``parent`` or ``child`` end of a joint."""
    element = joint.find(end)
    return None if element is None else element.get("link")


def distance(part: ElementTree.Element) -> float:
    """Distance in [m] of the copy of a joint or <inertial> from the frame of its <origin>."""
    origin = part.find("origin")
    return 0.0 if origin is None else math.hypot(*floats(origin.get("xyz", "0 0 0")))


def _note(notes: Notes, remark: str, place: str) -> None:
    notes.setdefault(remark, []).append(place)


def _note_unknown(element: ElementTree.Element, owner: str, notes: Notes) -> None:
    """Note children whose names are nearly those of the format; others are of its extensions."""
    for tag in sorted({str(child.tag) for child in element} - _TAGS):
        if near := get_close_matches(tag, _TAGS, 1, _SIMILARITY):
            _note(notes, f"<{tag}> has no effect; did you mean <{near[0]}>?", owner)


def _parts(
    element: ElementTree.Element, tags: tuple[str, ...], owner: str, notes: Notes
) -> list[ElementTree.Element]:
    """The first child of each tag, its numbers written such that every parser reads them."""
    parts = []
    _note_unknown(element, owner, notes)
    for tag in tags:
        children = element.findall(tag)
        if len(children) > 1:
            _note(notes, f"more than one <{tag}>: only the first counts", owner)
        for child in children[:1]:
            if "quat_xyzw" in child.keys():
                raise ModelError(f"{owner}: <{tag} quat_xyzw=…> is not supported; allowed: rpy")
            keys = [key for key in _NUMBERS.get(tag, ()) if key in child.keys()]
            numbers = {key: _number_text(child, key, owner, notes) for key in keys}
            names = {key: value for key, value in child.items() if key == _NAMES.get(tag)}
            parts.append(ElementTree.Element(tag, {**names, **numbers}))
    return parts


def _number_text(part: ElementTree.Element, key: str, owner: str, notes: Notes) -> str:
    """An attribute's numbers, each written such that reading it gives the same number."""
    text, tag = part.get(key, ""), part.tag
    count, open_ended = 3 if key in ("xyz", "rpy") else 1, tag == "limit"
    values = floats(text)
    if open_ended and _INFINITE.fullmatch(text.strip()):
        values = [float(text)]
    if len(values) != count or not (open_ended or all(map(math.isfinite, values))):
        number = "one finite number" if count == 1 else "three finite numbers"
        allowed, remedy = "one number, or inf" if open_ended else number, ""
        if "{" in text or "$(" in text:
            remedy = (
                "; this is an expression, as of xacro (${…}): write its value, or expand the "
                "source with 'xacro arm.urdf.xacro > arm.urdf'"
            )
        elif "," in text:
            remedy = "; decimals have a point, and there are spaces between numbers"
        raise ModelError(f"{owner}: <{tag} {key}={text!r}>: expected {allowed}{remedy}")
    if open_ended and key in _LIMITS and values == [-1.0]:
        _note(notes, f"<limit {key}> is -1: there is none", owner)
        values = [0.0]
    if key in _NOT_NEGATIVE and values[0] < 0:
        none = " (-1 and 0 mean no limit)" if open_ended else ""
        raise ModelError(f"{owner}: <{tag} {key}={text!r}>: must not be negative{none}")
    if key == "rpy" and any(map(degrees_meant, values)):
        _note(notes, "<origin rpy> of more than two turns; angles are in rad", owner)
    return " ".join(repr(max(-_LARGEST, min(value, _LARGEST))) for value in values)


def _check_axis(
    copy: ElementTree.Element, joint: ElementTree.Element, owner: str, notes: Notes
) -> None:
    fault = "<axis> without xyz"
    if (axis := copy.find("axis")) is None:
        axis, fault = ElementTree.SubElement(copy, "axis"), "no <axis>"
    if "xyz" not in axis.keys():
        axis.set("xyz", "1.0 0.0 0.0")
        _note(notes, f"{fault}: taken as the default, 1 0 0", owner)
    direction = floats(axis.get("xyz", ""))
    length = math.hypot(*direction)
    if length > 1e100:  # Pinocchio squares it
        axis.set("xyz", " ".join(map(repr, unit(direction).tolist())))
    if abs(length - 1.0) > _ROUNDING:
        _note(notes, "<axis> is not of length 1: only its direction counts", owner)
    if length < 1e-9:
        text = joint.findall("axis")[0].get("xyz")
        raise ModelError(f"{owner}: axis {text!r} has no direction")
