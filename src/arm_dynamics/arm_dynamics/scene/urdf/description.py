# SPDX-License-Identifier: Apache-2.0
"""Check a URDF, and write it anew for Pinocchio.

Pinocchio's parser silently accepts an unreadable or negative mass. This module refuses such files
with the name of the offending element. It determines the joints and frames of a description
without loading Pinocchio.
"""

from collections.abc import Collection, Iterable, Mapping
from xml.etree import ElementTree

from arm_dynamics.attributes import frozen
from arm_dynamics.exceptions import ModelError, choices, did_you_mean, known_names
from arm_dynamics.scene.inertia import ROUNDING, fault, moment_tolerance, moments
from arm_dynamics.scene.urdf import plain
from arm_dynamics.scene.urdf.units import note_units, size_of
from arm_dynamics.scene.urdf.xml import xml_root

# In front of the name of a frame, they say which is meant
LINK, JOINT = "link:", "joint:"
_VERSIONS = (None, "1", "1.0", "1.1")
_FORMATS = {"mujoco": "MJCF, MuJoCo's format", "sdf": "SDF, Gazebo's format"}
_EXPAND = (
    "expand it with 'xacro arm.urdf.xacro > arm.urdf', or give the file itself, ending in .xacro, "
    "where xacro is installed"
)
# Largest number of joints from a root to a link: Pinocchio's parser recurses from link to link,
# and from 2000 to 4000 the stack of a process overflows, which ends it.
DEEPEST = 1000
# Largest negative principal moment of a link relative to its largest one. Published robots have
# physically inconsistent tensors: 16 of the 69 descriptions in example-robot-data, down to -0.39
# (Tiago's antennas). The mass matrix may still be regular (if it is not, forward dynamics refuses
# the arm), so they cause a warning; larger ones are errors.
NEGATIVE_PART = 0.5


@frozen
class Mimic:
    """Follower rule ``q = multiplier * q_leader + offset``."""

    leader: str
    multiplier: float
    offset: float


@frozen
class Urdf:
    """Facts of a URDF, and its links and joints as Pinocchio is to read them.

    Attributes:
        text: The description with what matters to the dynamics, in a form that no parser misreads.
        joints: Type of every joint by name.
        links: Names of the links.
        mimics: Follower rules by joint name.
        limited: Lower and upper limit of the joints with a position limit.
        crossed: Lower and upper limit of joints whose lower one is above the upper one; in
            ``text`` they have none.
        size: Length of the arm in [m], see ``size_of``.
        doubtful: Links whose inertia is not physically consistent, and why; it is used unchanged.
        notes: Remarks on what is unusual, each with the places where it is.
    """

    text: str
    joints: dict[str, str]
    links: tuple[str, ...]
    mimics: dict[str, Mimic]
    limited: Mapping[str, tuple[float, float]]
    crossed: Mapping[str, tuple[float, float]]
    size: float
    doubtful: dict[str, str]
    notes: plain.Notes

    @property
    def moving(self) -> list[str]:
        """Names of the joints that are not fixed."""
        return [name for name, kind in self.joints.items() if kind in plain.MOVING]

    def free(self, locked: Collection[str]) -> list[str]:
        """Names of the joints that move independently while some are locked."""
        return [name for name in self.moving if name not in (*self.mimics, *locked)]

    @property
    def lockable(self) -> list[str]:
        """Names of the joints that a scene may lock."""
        return [name for name, kind in self.joints.items() if kind in (*plain.MOVING, *plain.HELD)]

    def leader(self, name: str) -> str:
        """The joint that ``name`` follows in the end; itself if it is independent."""
        passed = {name}
        while name in self.mimics and (above := self.mimics[name].leader) not in passed:
            passed.add(name := above)
        return name

    @property
    def frames(self) -> list[str]:
        """Names that a payload or a constraint may be attached to."""
        return list(dict.fromkeys([*self.links, *self.joints]))

    def has_frame(self, name: str) -> bool:
        """Whether a link or joint has this name, with ``LINK`` or ``JOINT`` in front or not."""
        links, joints = [LINK + own for own in self.links], [JOINT + own for own in self.joints]
        return name in (*self.links, *self.joints, *links, *joints)


def read_urdf(text: str, lock: Collection[str] = ()) -> Urdf:
    """Parse and check a robot description.

    Args:
        text: URDF as XML.
        lock: Joints that the scene locks; floating and planar ones among them are fixed.

    Returns:
        Its joints, links and mimic rules.

    Raises:
        ModelError: If it is malformed, or holds an unsupported joint type or unphysical number.
    """
    notes: plain.Notes = {}
    robot = _root(text)
    links = {name: plain.plain_link(x, notes) for name, x in _unique(robot, "link").items()}
    described = _unique(robot, "joint")
    joints = {name: plain.plain_joint(x, notes, name in lock) for name, x in described.items()}
    if not links:
        xacro = f"; this is xacro source: {_EXPAND}" if "<xacro:" in text else ""
        raise ModelError(f"robot description: no <link> found; at least one is required{xacro}")
    names = set(links)
    for name, joint in joints.items():
        _check_joint(name, joint, names)
    faults = {name: _check_inertia(name, link) for name, link in links.items()}
    size = size_of(links, joints, _check_tree(joints, links))
    note_units(links, joints, size, notes)
    kinds = {name: joint.get("type", "") for name, joint in described.items()}
    ranges = {name: plain.described_range(joint) for name, joint in joints.items()}
    crossed = {name: (lower, upper) for name, (lower, upper) in ranges.items() if lower > upper}
    for name in crossed:
        for limit in joints[name].findall("limit"):
            limit.attrib.update(lower="0.0", upper="0.0")
    doubtful = {name: trouble for name, trouble in faults.items() if trouble}
    mimics = _mimics(joints, kinds)
    anew = _text_for_pinocchio(robot, [*links.values(), *joints.values()], notes)
    limited = {name: plain.described_range(x) for name, x in joints.items() if plain.is_limited(x)}
    return Urdf(anew, kinds, tuple(links), mimics, limited, crossed, size, doubtful, notes)


def _text_for_pinocchio(
    robot: ElementTree.Element, parts: Iterable[ElementTree.Element], notes: plain.Notes
) -> str:
    """The description for Pinocchio, to which every joint is independent."""
    name, version = robot.get("name"), robot.get("version")
    if not name:
        notes["<robot> has no name: 'robot' is used"] = ["the root element"]
    if version not in _VERSIONS:
        notes[f"version {version!r} is unknown: read as 1.0"] = ["<robot>"]
    root = ElementTree.Element("robot", name=name or "robot")
    for part in parts:
        for mimic in part.findall("mimic"):
            part.remove(mimic)
        root.append(part)
    return ElementTree.tostring(root, encoding="unicode")


def _root(text: str) -> ElementTree.Element:
    root = xml_root(text)
    if root.tag != "robot":
        other = _FORMATS.get(root.tag)
        hint = f"; this is {other}: use the robot's URDF, or convert it to one" if other else ""
        raise ModelError(f"robot description: the root element is <{root.tag}>, not <robot>{hint}")
    bound = [key.removeprefix("xmlns:") for key, value in root.items() if "xacro" in value]
    for element in root:
        # Expanded files may keep definitions; a remaining call means that a part is missing.
        prefix, _, name = element.tag.rpartition(":")
        if prefix in ("xacro", *bound) and name not in ("property", "macro", "include", "arg"):
            raise ModelError(f"robot description: <xacro:{name}> is not expanded: {_EXPAND}")
    return root


def _unique(robot: ElementTree.Element, tag: str) -> dict[str, ElementTree.Element]:
    by_name = dict[str, ElementTree.Element]()
    for element in robot.findall(tag):
        name = element.get("name")
        if not name:
            raise ModelError(f"robot description: a <{tag}> has no name")
        if "${" in name or "$(" in name:
            raise ModelError(f"robot description: {tag} {name!r} is not expanded: {_EXPAND}")
        if name in by_name:
            raise ModelError(f"robot description: two <{tag}> are called '{name}'")
        by_name[name] = element
    return by_name


def _check_joint(name: str, joint: ElementTree.Element, links: set[str]) -> None:
    kind = joint.get("type")
    if kind in plain.HELD:
        raise ModelError(
            f"joint '{name}': type '{kind}' is not supported as a joint that moves; allowed: "
            f"{choices(kind, plain.SUPPORTED)}; 'robot.lock: [{name}]' in a scene holds it at its "
            "origin"
        )
    if kind not in plain.SUPPORTED:
        allowed = choices(kind, plain.SUPPORTED)
        raise ModelError(f"joint '{name}': type {kind!r} is not supported; allowed: {allowed}")
    for end in ("parent", "child"):
        link = plain.link_at(joint, end)
        if link not in links:
            raise ModelError(
                f"joint '{name}': {end} link {link!r} does not exist; "
                f"links: {choices(link, sorted(links))}"
            )
    if kind in ("revolute", "prismatic") and joint.find("limit") is None:
        raise ModelError(f"joint '{name}': a {kind} joint needs <limit>; 'continuous' has none")


def _check_inertia(name: str, link: ElementTree.Element) -> str | None:
    """Refuse inertias that cannot be used; return why others are not physically consistent."""
    if (inertial := link.find("inertial")) is None:
        return None
    mass, tensor = inertial.find("mass"), inertial.find("inertia")
    if mass is None or mass.get("value") is None:
        raise ModelError(f"link '{name}': <inertial> without <mass value=…>")
    if tensor is None:
        raise ModelError(f"link '{name}': <inertial> without <inertia>")
    if absent := [key for key in plain.MOMENTS if key not in tensor.keys()]:
        raise ModelError(f"link '{name}': <inertia> without {', '.join(absent)}")
    six = [float(tensor.get(key, "")) for key in plain.TENSOR]
    weight = float(mass.get("value", ""))
    point = float(moment_tolerance(weight))
    for key in plain.MOMENTS:
        if float(tensor.get(key, "")) < -max(ROUNDING * max(map(abs, six)), point):
            raise ModelError(
                f"link '{name}': <inertia {key}={tensor.get(key)!r}>: must not be negative"
            )
    principal = moments(six)
    if principal[0] < -max(NEGATIVE_PART * principal[2], point):
        listed = ", ".join(f"{moment:.6g}" for moment in principal)
        raise ModelError(
            f"link '{name}': <inertia>: principal moments {listed} kg m²: the smallest must not "
            f"be negative by more than {NEGATIVE_PART} of the largest"
        )
    return fault(weight, six)


def _check_tree(
    joints: dict[str, ElementTree.Element], links: dict[str, ElementTree.Element]
) -> list[str]:
    """The names of the links, each after its parent."""
    parent_of = dict[str, str]()
    children = dict[str, list[str]]()
    for name, joint in joints.items():
        parent, child = str(plain.link_at(joint, "parent")), str(plain.link_at(joint, "child"))
        if child in parent_of:
            raise ModelError(
                f"joint '{name}': link '{child}' already has a parent joint; "
                "URDF describes trees only"
            )
        parent_of[child] = parent
        children.setdefault(parent, []).append(child)
    roots = [name for name in links if name not in parent_of]
    depths = dict.fromkeys(roots, 0)
    waiting = list(depths)
    for link in waiting:
        depths |= dict.fromkeys(children.get(link, ()), depths[link] + 1)
        waiting += children.get(link, ())
    if lost := [name for name in links if name not in depths]:
        link = lost[0]
        for _ in parent_of:  # into the loop in which the way to its parents ends
            link = parent_of[link]
        ring = {link}
        while (link := parent_of[link]) not in ring:
            ring.add(link)
        raise ModelError(
            f"robot description: links {known_names(x for x in links if x in ring)} form a loop; "
            "URDF describes trees only"
        )
    deepest = max(depths, key=lambda name: depths[name])
    if depths[deepest] > DEEPEST:
        raise ModelError(
            f"robot description: link '{deepest}' is {depths[deepest]} joints away from its root; "
            f"at most {DEEPEST} are supported"
        )
    if len(roots) != 1:
        raise ModelError(
            f"robot description: one root link expected, found {len(roots)}: {known_names(roots)}"
        )
    return list(depths)


def _mimics(joints: dict[str, ElementTree.Element], kinds: dict[str, str]) -> dict[str, Mimic]:
    rules: dict[str, Mimic] = {}
    for name, joint in joints.items():
        element = joint.find("mimic")
        if element is None or kinds[name] == "fixed":
            continue
        leader = element.get("joint")
        if leader not in kinds or kinds[leader] not in plain.MOVING or leader == name:
            others = [n for n, kind in kinds.items() if kind in plain.MOVING and n != name]
            allowed, why = known_names(others), "does not move"
            if leader not in kinds:
                allowed, why = allowed + did_you_mean(leader, others), "is not a joint"
            elif leader == name:
                why = "is that joint itself"
            raise ModelError(f"joint '{name}': mimics {leader!r}, which {why}; allowed: {allowed}")
        rules[name] = Mimic(
            leader, float(element.get("multiplier", "1")), float(element.get("offset", "0"))
        )
    return rules
