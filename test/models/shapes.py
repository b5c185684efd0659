# SPDX-License-Identifier: Apache-2.0
"""Robots of published shapes, written as their descriptions are, with all that is odd about them.

Lengths and masses are round figures of the size of the named robots, not theirs.
"""

from collections.abc import Iterator, Sequence
from typing import Any

LIMIT = '<limit lower="-2.9" upper="2.9" effort="50" velocity="2"/>'
SHORT = '<limit lower="0" upper="0.04" effort="20" velocity="0.1"/>'
BALL = '<inertia ixx="{0}" ixy="0" ixz="0" iyy="{0}" iyz="0" izz="{0}"/>'


def link(
    name: str, mass: float | None = 1.0, com: str = "0 0.01 0.05", moment: float = 1e-2
) -> str:
    """A link; without <inertial> if it has no mass."""
    if mass is None:
        return f'<link name="{name}"/>'
    tensor = BALL.format(repr(moment * mass))
    place = f'<origin xyz="{com}" rpy="0.1 0 0.2"/>'
    return f'<link name="{name}"><inertial>{place}<mass value="{mass}"/>{tensor}</inertial></link>'


def joint(
    name: str, kind: str, parent: str, child: str, xyz: str = "0 0 0.1", axis: str = "0 0 1",
    more: str | None = None, rpy: str = "0 0 0",
) -> str:  # fmt: skip
    """A joint; ``more`` holds limits and the rest."""
    if more is None:
        more = {"revolute": LIMIT, "prismatic": SHORT}.get(kind, "")
    ends = f'<parent link="{parent}"/><child link="{child}"/>'
    place = f'<origin xyz="{xyz}" rpy="{rpy}"/>'
    return f'<joint name="{name}" type="{kind}">{ends}{place}<axis xyz="{axis}"/>{more}</joint>'


def mimic(leader: str, multiplier: float = 1.0, offset: float = 0.0, limit: str = SHORT) -> str:
    """A limit and a rule to follow another joint."""
    return f'{limit}<mimic joint="{leader}" multiplier="{multiplier}" offset="{offset}"/>'


def robot(*parts: str) -> str:
    """A whole description."""
    return f'<?xml version="1.0"?><robot name="robot">{"".join(parts)}</robot>'


def serial(kinds: str, axes: str, **body: Any) -> list[str]:
    """An arm: kinds of joints (r, c or p) and their axes, one letter each."""
    names = {"r": "revolute", "c": "continuous", "p": "prismatic"}
    along = {"x": "1 0 0", "y": "0 1 0", "z": "0 0 1", "-": "0 -1 0"}
    parts = [link("base_link", None)]
    for i, (kind, axis) in enumerate(zip(kinds, axes, strict=True), 1):
        above = f"link_{i - 1}" if i > 1 else "base_link"
        parts.append(link(f"link_{i}", **body))
        place = f"{0.02 * (i % 3)} {0.01 * i} {0.3 / i:.3f}"
        parts.append(joint(f"joint_{i}", names[kind], above, f"link_{i}", place, along[axis]))
    return parts


ARMS = {
    "seven axes without ends, as Kinova": ("crcrcrc", "z-z-z-z"),
    "Stanford's arm": ("rrprrr", "zyzzyz"),
}
BODIES: dict[str, dict[str, Any]] = {
    "with inertia": {},
    "without inertia": {"mass": None},
    "with tiny inertia": {"mass": 1e-9, "moment": 1e-6},
    "with placeholders": {"mass": 1.0, "com": "0 0 0", "moment": 1.0},
}


def arms() -> Iterator[tuple[str, str]]:
    """Serial arms, each with several kinds of inertia."""
    for shape, (kinds, axes) in ARMS.items():
        for how, body in BODIES.items():
            yield f"{shape}, {how}", robot(*serial(kinds, axes, **body))


ARM = serial("rrr", "zyy")


def hand(*joints: tuple[str, str, str, str, str]) -> Sequence[str]:
    """Fingers at the end of an arm: name, kind, parent, axis and what follows."""
    parts: list[str] = []
    for i, (name, kind, parent, axis, more) in enumerate(joints):
        place = f"{0.01 * i} 0.02 0.05"
        parts += [link(f"{name}_link", 0.05, "0 0 0.02", 1e-4)]
        parts += [joint(name, kind, parent, f"{name}_link", place, axis, more or None)]
    return parts


GRIPPERS = {
    "knuckles and a tip, as 2F-85": hand(
        ("knuckle", "revolute", "link_3", "0 -1 0", LIMIT),
        ("right_knuckle", "revolute", "link_3", "0 -1 0", mimic("knuckle", -1.0, 0.0, LIMIT)),
        ("right_tip", "revolute", "right_knuckle_link", "0 -1 0", mimic("knuckle", 1, 0, LIMIT)),
    ),
    "followers of followers": hand(
        ("first", "revolute", "link_3", "1 0 0", ""),
        ("second", "revolute", "first_link", "1 0 0", mimic("first", 0.7, 0.1, LIMIT)),
        ("third", "revolute", "second_link", "1 0 0", mimic("second", 0.8, -0.2, LIMIT)),
    ),
    "a jaw that a turn moves": hand(
        ("screw", "continuous", "link_3", "0 0 1", ""),
        ("jaw", "prismatic", "link_3", "0 1 0", mimic("screw", 0.002)),
    ),
    "a follower of a fixed joint": hand(
        ("left", "fixed", "link_3", "0 0 1", ""),
        ("right", "prismatic", "link_3", "0 1 0", mimic("left")),
    ),
    "followers in a ring": hand(
        ("left", "prismatic", "link_3", "0 1 0", mimic("right")),
        ("right", "prismatic", "link_3", "0 1 0", mimic("left")),
    ),
}  # fmt: skip
LINKAGES = {
    "an opened loop": [link("rod"), joint("pin", "continuous", "base_link", "rod", axis="0 1 0")],
    "a loop": [joint("pin", "continuous", "base_link", "link_3")],
}  # fmt: skip
ODD = {
    "a fixed world": [link("world", None), joint("to_world", "fixed", "world", "base_link")],
    "a floating base": [link("world", None), joint("to_world", "floating", "world", "base_link")],
    "a shoulder through links without mass": [
        link("virtual", None), joint("roll", "continuous", "link_3", "virtual", axis="1 0 0"),
        link("real"), joint("pitch", "continuous", "virtual", "real", axis="0 1 0"),
    ],
    "a last joint that moves nothing": [
        link("flange", None), joint("last", "continuous", "link_3", "flange"),
    ],
    "a joint without limit": [link("x"), joint("j", "revolute", "link_3", "x", more="<a/>")],
    "a joint with equal limits": [
        link("x"), joint("j", "revolute", "link_3", "x",
                         more='<limit lower="0" upper="0" effort="0" velocity="0"/>'),
    ],
    "a joint of one name with its link": [link("x"), joint("x", "revolute", "link_3", "x")],
    "names of other scripts": [link("рука"), joint("関節 1", "continuous", "link_3", "рука")],
    "everything that others add": [
        link("x"), joint("j", "continuous", "link_3", "x", more=(
            "<safety_controller k_velocity='3'/><calibration rising='0'/><dynamics damping='0.1'/>"
        )),
        "<transmission name='t'><type>simple</type><joint name='j'/></transmission>",
        "<gazebo reference='x'><selfCollide>true</selfCollide></gazebo>",
        "<ros2_control name='c' type='system'><joint name='j'/></ros2_control>",
        "<material name='grey'><color rgba='1 1 1 1'/></material>",
    ],
    "an inertia that no body has": [
        '<link name="x"><inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" '
        'iyz="0" izz="5"/></inertial></link>', joint("j", "continuous", "link_3", "x"),
    ],
    "a mass of nothing but inertia": [
        '<link name="x"><inertial><mass value="0"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" '
        'iyz="0" izz="1"/></inertial></link>', joint("j", "continuous", "link_3", "x"),
    ],
}  # fmt: skip
REFUSED = {
    "a follower of a fixed joint": "joint 'right': mimics 'left', which does not move",
    "followers in a ring": "joint '(left|right)': its mimic rule leads back to itself",
    "a loop": "joint 'pin': link 'link_3' already has a parent joint",
    "a floating base": "joint 'to_world': type 'floating' .*'robot.lock: \\[to_world\\]'",
    "a joint without limit": "joint 'j': a revolute joint needs <limit>",
}
"""Those that are refused, and how."""


def shapes() -> dict[str, str]:
    """All descriptions by name."""
    more = {**GRIPPERS, **LINKAGES, **ODD}
    return dict(arms()) | {name: robot(*ARM, *parts) for name, parts in more.items()}
