# SPDX-License-Identifier: Apache-2.0
"""Find, read and check a scene: YAML file, URDF file, URDF text or dictionary."""

import logging
import os
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, contextmanager, nullcontext
from pathlib import Path
from typing import Any

from arm_dynamics.exceptions import ModelError, SceneError, choices, known_names, plain
from arm_dynamics.scene.constraint import check_constraints, check_frame, check_joints
from arm_dynamics.scene.effect import check_effect
from arm_dynamics.scene.files import file_text, find_file, find_scene
from arm_dynamics.scene.imperfections import check_sensors
from arm_dynamics.scene.lines import in_file, parse
from arm_dynamics.scene.schema import Joint, RobotChoice, Scene, validated
from arm_dynamics.scene.spring import check_springs
from arm_dynamics.scene.unit_remarks import unit_remarks
from arm_dynamics.scene.urdf.description import Urdf, read_urdf
from arm_dynamics.scene.urdf.inertial import with_bodies
from arm_dynamics.scene.urdf.xacro import SUFFIX, expand

# Sources of a scene; see ``load_scene``
type SceneSource = str | os.PathLike[str] | Mapping[str, Any] | Scene

_log = logging.getLogger(__name__)


def load_scene(source: SceneSource) -> Scene:
    """Load and check a scene.

    Args:
        source: Name of a bundled scene such as ``panda``, path or ``package://`` URI of a scene
            file (YAML), a URDF or xacro, URDF text, a dictionary of the same shape as a scene
            file, or a scene, which is returned unchanged.

    Returns:
        The scene with the URDF's text in ``robot.urdf``.

    Raises:
        SceneError: If something is missing, unknown or not allowed; of a file, with its name.
        ModelError: If the robot description cannot be used.

    Example:
        >>> load_scene({"robot": {"urdf": "arm.urdf"}, "gravity": [0, 0, 0]})  # doctest: +SKIP
    """
    if isinstance(source, Scene):
        return source
    if isinstance(source, Mapping):
        return _complete_scene(dict(source), Path.cwd())
    if not isinstance(source, str | os.PathLike):
        raise SceneError(
            f"scene: {source!r} is of type {type(source).__name__}; "
            "a path, URDF text or a dictionary is expected"
        )
    text = os.fspath(source)
    if _is_urdf(text):
        return scene_from_urdf(text)
    path = find_scene(text, Path.cwd())
    content = expand(path, {}) if path.suffix == SUFFIX else file_text(path)
    with in_file(path):
        if _is_urdf(content):
            return scene_from_urdf(content)
        return _complete_scene(parse(content), path.parent)


@contextmanager
def naming(source: object) -> Iterator[None]:
    """Add the name of the scene file to errors that are found only when a scene is used.

    Args:
        source: Argument of ``load_scene``; only files are named.
    """
    if not isinstance(source, str | os.PathLike) or _is_urdf(os.fspath(source)):
        yield
        return
    with in_file(find_scene(os.fspath(source), Path.cwd())):
        yield


def scene_from_urdf(text: str, most_joints: int | None = None) -> Scene:
    """The scene of a bare robot description; ``text`` is never treated as a path.

    Args:
        text: URDF as XML.
        most_joints: Largest number of joints that move; None for any.

    Returns:
        The scene.

    Raises:
        ModelError: If the description cannot be used, or has more joints than allowed.
    """
    urdf, scene = read_urdf(text), validated({"robot": {"urdf": text}})
    if most_joints is not None and len(urdf.moving) > most_joints:
        raise ModelError(
            f"robot description: {len(urdf.moving)} joints that move; at most {most_joints} are "
            "allowed here"
        )
    _check_ranges(scene, urdf)
    _warn(scene, urdf)
    return scene


def _is_urdf(text: str) -> bool:
    return text.lstrip("\ufeff \t\r\n").startswith("<")


def _description(robot: RobotChoice, folder: Path) -> tuple[str, AbstractContextManager[None]]:
    """The URDF text of a robot, and what adds the name of its file to errors."""
    path = None
    if robot.xacro is not None or not _is_urdf(robot.urdf):
        path = find_file(robot.urdf, folder)
        if robot.xacro is not None or path.suffix == SUFFIX:
            return expand(path, robot.arguments), in_file(path)
    if robot.arguments:
        raise SceneError(
            f"scene: 'robot.arguments' = {robot.arguments}, but 'robot.urdf' is not in xacro; "
            "give the file as 'robot.xacro'"
        )
    return (robot.urdf, nullcontext()) if path is None else (file_text(path), in_file(path))


def _complete_scene(data: dict[str, Any], folder: Path) -> Scene:
    scene = validated(data)
    lock = scene.robot.lock
    text, origin = _description(scene.robot, folder)
    with origin:
        urdf = read_urdf(with_bodies(text, scene.links), lock)
    _check_names(scene, urdf)
    _warn(scene, urdf)
    robot = RobotChoice(urdf=text, lock=lock) if lock else RobotChoice(urdf=text)
    return scene.model_copy(update={"robot": robot})


def _check_ranges(scene: Scene, urdf: Urdf) -> None:
    """Refuse position limits of which the lower is above the upper, unless the scene has others.

    They may be swapped, or mean that there is none, as in PyBullet.
    """
    for name, (lower, upper) in urdf.crossed.items():
        own = scene.joint(name).limits
        if name not in scene.robot.lock and None in (own.lower, own.upper):
            raise ModelError(
                f"joint '{name}': <limit lower={lower:g} upper={upper:g}>: lower is above upper; "
                f"swap them, or write 0 for both if there is no limit, or give both in a scene, "
                f"in 'joints.{name}.limits'"
            )


def _warn(scene: Scene, urdf: Urdf) -> None:
    """Warn of what is unusual, of inertias that no body has, and of units probably mistaken."""
    for remark, (place, *rest) in urdf.notes.items():
        more = f" (and {known_names(rest, 5)})" if rest else ""
        _log.warning("robot description: %s: %s%s", plain(place), remark, more)
    if urdf.doubtful:
        name, *rest = urdf.doubtful
        more = f" (and {known_names(rest, 5)})" if rest else ""
        text = "robot description: inertia that no rigid body has, used unchanged: link '%s'%s: %s"
        _log.warning(text, name, more, urdf.doubtful[name])
    for name, body in scene.links.items():
        if missing := {"com", "inertia"} - body.model_fields_set:
            zero = " and ".join(sorted(missing))
            _log.warning("scene: 'links.%s': %s of the URDF's <inertial> became zero", name, zero)
    for remark in unit_remarks(scene, urdf):
        _log.warning("scene: %s", remark)


def _check_names(scene: Scene, urdf: Urdf) -> None:
    """Check that all joints and frames of the scene exist."""
    check_joints("robot.lock", scene.robot.lock, urdf.lockable, urdf)
    for key, names in {
        "joints": [name for name in scene.joints if name != "*"],
        "initial.position": list(scene.initial.position),
        "initial.velocity": list(scene.initial.velocity),
    }.items():
        check_joints(key, names, urdf.moving, urdf)
    for name in scene.joints:
        scene.joint(name)  # which refuses what cannot be merged with the entry of "*"
    _check_ranges(scene, urdf)
    for name in scene.links:
        if name not in urdf.links:
            raise SceneError(
                f"scene: 'links' names '{name}', which does not exist; "
                f"allowed: {choices(name, urdf.links)}"
            )
    for i, payload in enumerate(scene.payloads):
        check_frame(f"payloads.{i}.frame", payload.frame, urdf)
    check_constraints(scene.constraints, urdf, set(scene.robot.lock))
    check_springs(scene.springs, urdf)
    hold, lock = scene.initial.hold, scene.robot.lock
    check_joints("initial.hold", hold, urdf.free(lock), urdf, lock)
    if hold and not scene.bilateral:
        raise SceneError(
            f"scene: 'initial.hold' = {list(hold)}, but no constraint but contacts is there to be "
            "closed, so every joint keeps its initial position; leave it out"
        )
    if scene.sensors is not None:
        check_sensors(scene.sensors, urdf, scene.robot.lock)
    for name, rule in urdf.mimics.items():
        _check_follower(scene, name, rule.leader)
    for name in scene.robot.lock:
        _check_locked(scene, name)
    check_effect(scene, urdf)


def _check_follower(scene: Scene, name: str, leader: str) -> None:
    """Refuse keys of mimic joints that would have no effect."""
    if name in scene.robot.lock and leader not in scene.robot.lock:
        raise SceneError(
            f"scene: 'robot.lock' locks '{name}', which follows '{leader}'; lock that one too"
        )
    if leader in scene.robot.lock:
        _check_locked(scene, name)
    for key in ("position", "velocity"):
        if name in getattr(scene.initial, key):
            raise SceneError(
                f"scene: 'initial.{key}' names '{name}', which follows '{leader}'; set that one"
            )
    own = scene.joints.get(name, Joint())
    for key in ("effort", "velocity"):
        if getattr(own.limits, key) is not None:
            raise SceneError(
                f"scene: 'joints.{name}.limits.{key}': '{name}' follows '{leader}' and has none "
                "of its own; limit that one"
            )


def _check_locked(scene: Scene, name: str) -> None:
    """Refuse keys of locked joints that would have no effect."""
    own = scene.joints.get(name)
    if own is not None and (keys := own.model_dump(exclude_unset=True, exclude_none=True)):
        raise SceneError(
            f"scene: 'joints.{name}' sets {known_names(keys)} of a joint that 'robot.lock' holds "
            "fast; take the entry or the lock out"
        )
    if scene.initial.velocity.get(name, 0.0) != 0.0:
        raise SceneError(
            f"scene: 'initial.velocity.{name}' = {scene.initial.velocity[name]:g}, but "
            "'robot.lock' holds it fast; allowed: 0"
        )
