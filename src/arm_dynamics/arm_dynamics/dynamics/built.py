# SPDX-License-Identifier: Apache-2.0
"""The arm model of a scene, with warnings of values that fit one another only in other units."""

import logging
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.exceptions import known_names
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.model.pinocchio_terms import RigidTerms
from arm_dynamics.scene.load import SceneSource, load_scene, naming
from arm_dynamics.scene.urdf.units import FAR

_log = logging.getLogger(__name__)
_POSTURES = 32  # random ones, at which values are compared with the arm's weight and inertia
_TOO_FAST = 10.0  # limits; faster speeds are probably in degrees or millimetres
# Published arms carry up to 5.5 times their effort limits, where these are placeholders, and have
# drives of up to their own inertia.
_HEAVY, _LOADED, _INERT = 10.0, 5.0, 300.0
_CRAWL = 0.01  # [rad/s] or [m/s] against viscous friction, at the effort limit
_LEAST_GEAR, _LARGEST_GEAR = 0.1, 1e4  # of joints that turn
_STRONGEST = 10.0  # [N m/A] of a motor with a gear
_SLOWEST = 0.5  # [s] of L / R, the largest in textbooks
_SAME = 6.0  # ratio of the constants of torque and back-EMF, which are equal but for conventions


class Remark(NamedTuple):
    """A value of a joint that is implausible, and a hint about units or names."""

    joint: str
    text: str
    hint: str


def arm_model(source: SceneSource | ArmModel) -> ArmModel:
    """Build the arm model of a scene, with warnings; a model is returned unchanged.

    Args:
        source: Anything ``load_scene`` takes, or a model.

    Raises:
        SceneError: If the scene is invalid; names the file, if there is one.
    """
    if isinstance(source, ArmModel):
        return source
    scene = load_scene(source)
    with naming(source):
        model = ArmModel(scene)
    for remark in unit_remarks(model):
        _log.warning("scene: %s", remark)
    return model


def unit_remarks(model: ArmModel) -> Iterator[str]:
    """Remarks on values that do not fit together, one for each kind."""
    q = np.random.default_rng(0).uniform(-np.pi, np.pi, (_POSTURES, model.n))
    q = np.clip(q, *model.stops.limit)
    by_hint: dict[str, list[Remark]] = {}
    with np.errstate(over="ignore", invalid="ignore"):
        for remark in (*_weights(model, q), *_drives(model, q), *_friction(model)):
            by_hint.setdefault(remark.hint, []).append(remark)
    if fast := too_fast(model, model.v0):
        yield f"initial {fast}; velocities are in rad/s and m/s"
    for hint, [first, *rest] in by_hint.items():
        more = f" (and {known_names([remark.joint for remark in rest], 5)})" if rest else ""
        yield f"joint '{first.joint}'{more}: {first.text}; {hint}"


def too_fast(model: ArmModel, v: Array, times: float = _TOO_FAST) -> str:
    """The first velocity of v, shape (n,), that exceeds its limit ``times``, or empty."""
    if not (over := abs(v) > times * model.velocity_limit).any():
        return ""
    i = int(np.argmax(over))
    unit = model.units("rad/s", "m/s")[i]
    return (
        f"velocity {v[i]:.6g} {unit} of joint '{model.joint_names[i]}' exceeds its limit "
        f"of {model.velocity_limit[i]:.6g} {unit}"
    )


def _weights(model: ArmModel, q: Array) -> Iterator[Remark]:
    """Weights of the arm, and of its payloads, far beyond the effort limits."""
    terms, bare = RigidTerms(model), RigidTerms(model.under(model.pin.gravity.linear, ()))
    own = np.array([bare.gravity(posture) for posture in q])
    loads = np.array([terms.gravity(posture) for posture in q]) - own
    near = all(np.linalg.norm(payload.com) < FAR for payload in model.scene.payloads)
    for cause, torques, most, is_comparable in (
        ("its own weight", own, _HEAVY, model.reach < FAR and not model.springs),
        ("the payload", loads, _LOADED, near),
    ):
        for name, unit, x, limit in _joints(model, abs(torques).max(axis=0)):
            if is_comparable and x > most * limit and name not in model.placeholder_limits:
                largest = f"{x:.3g} {unit}, {x / limit:.3g} times its effort limit"
                hint = f"masses are in kg, efforts in {unit}"
                yield Remark(name, f"{cause} needs up to {largest}", hint)


def _drives(model: ArmModel, q: Array) -> Iterator[Remark]:
    """Inertias and constants that no drive has."""
    terms = RigidTerms(model)
    links = np.max([np.diagonal(terms.mass(x)) - model.armature for x in q[:4]], axis=0)
    rotors = [drive.rotor_inertia if drive else 0.0 for drive in model.drives]
    joints = _joints(model, np.fmax(model.armature, rotors))
    for (name, unit, inertia, _), drive in zip(joints, model.drives, strict=True):
        largest = links[model.turning == (unit == "N m")].max()
        if inertia > _INERT * largest > 0.0:
            text = f"its drive has {inertia:.3g} at the joint, and the arm at most {largest:.3g}"
            yield Remark(name, text, f"inertias are in kg{'' if unit == 'N' else ' m²'}")
        if drive is None:
            continue
        motor, constant = drive.motor, drive.motor.torque_constant or 0.0
        gear, back = motor.gear_ratio, motor.back_emf_constant or constant
        if unit == "N m" and not _LEAST_GEAR <= abs(gear) <= _LARGEST_GEAR:
            hint = "it is the motor's turns over the joint's"
            yield Remark(name, f"gear_ratio = {gear:g}", hint)
        if abs(gear) > 1.0 and constant > _STRONGEST:
            yield Remark(name, f"torque_constant = {constant:g}", "it is in N m/A")
        if constant and not 1.0 / _SAME < back / constant < _SAME:
            text = f"back_emf_constant = {back:g} with torque_constant = {constant:g}"
            yield Remark(name, text, "in N m/A and V s/rad the two are equal")
        if (motor.inductance or 0.0) > _SLOWEST * (motor.resistance or np.inf):
            text = f"inductance = {motor.inductance:g} with resistance = {motor.resistance:g}"
            yield Remark(name, text, "they are in H and Ω")


def _friction(model: ArmModel) -> Iterator[Remark]:
    """Friction against which the effort limits move nothing."""
    friction = model.friction
    levels = friction.static.mean + friction.by_law.static.mean
    for name, unit, dry, limit in _joints(model, levels):
        if dry > limit:
            text = f"dry friction of {dry:g} {unit} is above its effort limit, {limit:g}"
            yield Remark(name, text, "it can never move")
    for name, unit, viscous, limit in _joints(model, model.viscous):
        if viscous * _CRAWL > limit:
            speed = f"{limit / viscous:.2g} {'rad/s' if unit == 'N m' else 'm/s'}"
            text = f"viscous friction of {viscous:g} allows {speed} at its effort limit"
            yield Remark(name, text, f"it is in {unit} s/{'rad' if unit == 'N m' else 'm'}")


def _joints(model: ArmModel, values: Array) -> Iterator[tuple[str, str, float, float]]:
    """Name, unit of effort, value and effort limit, inf for none, of each joint."""
    rows = zip(model.joint_names, model.units("N m", "N"), values, model.effort_limit, strict=True)
    return ((name, unit, float(x), float(limit) or np.inf) for name, unit, x, limit in rows)
