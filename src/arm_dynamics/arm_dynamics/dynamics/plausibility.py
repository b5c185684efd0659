# SPDX-License-Identifier: Apache-2.0
"""Remarks on values of an arm that fit one another only in other units."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.exceptions import known_names
from arm_dynamics.model.arm import ArmModel
from arm_dynamics.model.pinocchio_terms import RigidTerms
from arm_dynamics.scene.urdf.units import FAR

# Random postures at which values are compared with the arm's weight and inertia
_POSTURES = 32
# Velocity by its limit above which it is probably in degrees or millimetres
_FAST = 10.0
# Weight of the arm, and of its payload, by the effort limits, and inertia of a drive by the arm's.
# Published arms carry up to 5.5 times their effort limits, where these are placeholders, and have
# drives of up to their own inertia.
_HEAVY_ARM, _HEAVY_PAYLOAD, _HEAVY_ROTOR = 10.0, 5.0, 300.0
# Speed in [rad/s] or [m/s] that the effort limit must reach against viscous friction
_CREEP_SPEED = 0.01
# Gear ratios of joints that turn
_LEAST_GEAR, _LARGEST_GEAR = 0.1, 1e4
# Torque constant in [N m/A] of a motor with a gear
_LARGEST_CONSTANT = 10.0
# Time constant L / R in [s], the largest in textbooks
_LARGEST_TIME_CONSTANT = 0.5
# Ratio of the constants of torque and back-EMF, which are equal but for conventions
_LARGEST_RATIO = 6.0


class Remark(NamedTuple):
    """A value of a joint that is implausible, and a hint about units or names."""

    joint: str
    text: str
    hint: str


def implausible_values(model: ArmModel) -> Iterator[str]:
    """Remarks on values that do not fit together, one for each kind."""
    q = np.random.default_rng(0).uniform(-np.pi, np.pi, (_POSTURES, model.n))
    q = np.clip(q, *model.stops.limit)
    by_hint: dict[str, list[Remark]] = {}
    with np.errstate(over="ignore", invalid="ignore"):
        remarks = *_weight_remarks(model, q), *_drive_remarks(model, q), *_friction_remarks(model)
        for remark in remarks:
            by_hint.setdefault(remark.hint, []).append(remark)
    if fast := excessive_velocity(model, model.v0):
        yield f"initial {fast}; velocities are in rad/s and m/s"
    for hint, [first, *rest] in by_hint.items():
        more = f" (and {known_names([remark.joint for remark in rest], 5)})" if rest else ""
        yield f"joint '{first.joint}'{more}: {first.text}; {hint}"


def excessive_velocity(model: ArmModel, v: Array, factor: float = _FAST) -> str:
    """The first velocity of v, shape (n,), above ``factor`` times its limit; empty for none."""
    if not (over := abs(v) > factor * model.velocity_limit).any():
        return ""
    i = int(np.argmax(over))
    unit = model.units("rad/s", "m/s")[i]
    return (
        f"velocity {v[i]:.6g} {unit} of joint '{model.joint_names[i]}' exceeds its limit "
        f"of {model.velocity_limit[i]:.6g} {unit}"
    )


def _weight_remarks(model: ArmModel, q: Array) -> Iterator[Remark]:
    """Weights of the arm, and of its payloads, far beyond the effort limits."""
    terms, bare = RigidTerms(model), RigidTerms(model.under(model.pin.gravity.linear, ()))
    own = np.array([bare.gravity(posture) for posture in q])
    loads = np.array([terms.gravity(posture) for posture in q]) - own
    is_near = all(np.linalg.norm(payload.com) < FAR for payload in model.scene.payloads)
    for cause, torques, factor, is_comparable in (
        ("its own weight", own, _HEAVY_ARM, model.reach < FAR and not model.springs),
        ("the payload", loads, _HEAVY_PAYLOAD, is_near),
    ):
        for name, unit, x, limit in _joint_values(model, abs(torques).max(axis=0)):
            if is_comparable and x > factor * limit and name not in model.placeholder_limits:
                largest = f"{x:.3g} {unit}, {x / limit:.3g} times its effort limit"
                hint = f"masses are in kg, efforts in {unit}"
                yield Remark(name, f"{cause} needs up to {largest}", hint)


def _drive_remarks(model: ArmModel, q: Array) -> Iterator[Remark]:
    """Inertias and constants that no drive has."""
    terms = RigidTerms(model)
    links = np.max([np.diagonal(terms.mass(x)) - model.armature for x in q[:4]], axis=0)
    rotors = [drive.rotor_inertia if drive else 0.0 for drive in model.drives]
    joints = _joint_values(model, np.fmax(model.armature, rotors))
    for (name, unit, inertia, _), drive in zip(joints, model.drives, strict=True):
        largest = links[model.turning == (unit == "N m")].max()
        if inertia > _HEAVY_ROTOR * largest > 0.0:
            text = f"its drive has {inertia:.3g} at the joint, and the arm at most {largest:.3g}"
            yield Remark(name, text, f"inertias are in kg{'' if unit == 'N' else ' m²'}")
        if drive is None:
            continue
        motor, constant = drive.motor, drive.motor.torque_constant or 0.0
        gear, back_emf = motor.gear_ratio, motor.back_emf_constant or constant
        if unit == "N m" and not _LEAST_GEAR <= abs(gear) <= _LARGEST_GEAR:
            hint = "it is the motor's turns over the joint's"
            yield Remark(name, f"gear_ratio = {gear:g}", hint)
        if abs(gear) > 1.0 and constant > _LARGEST_CONSTANT:
            yield Remark(name, f"torque_constant = {constant:g}", "it is in N m/A")
        if constant and not 1.0 / _LARGEST_RATIO < back_emf / constant < _LARGEST_RATIO:
            text = f"back_emf_constant = {back_emf:g} with torque_constant = {constant:g}"
            yield Remark(name, text, "in N m/A and V s/rad the two are equal")
        if (motor.inductance or 0.0) > _LARGEST_TIME_CONSTANT * (motor.resistance or np.inf):
            text = f"inductance = {motor.inductance:g} with resistance = {motor.resistance:g}"
            yield Remark(name, text, "they are in H and Ω")


def _friction_remarks(model: ArmModel) -> Iterator[Remark]:
    """Friction against which the effort limits move nothing."""
    friction = model.friction
    levels = friction.static.mean + friction.by_law.static.mean
    for name, unit, dry, limit in _joint_values(model, levels):
        if dry > limit:
            text = f"dry friction of {dry:g} {unit} is above its effort limit, {limit:g}"
            yield Remark(name, text, "it can never move")
    for name, unit, viscous, limit in _joint_values(model, model.viscous):
        if viscous * _CREEP_SPEED > limit:
            speed = f"{limit / viscous:.2g} {'rad/s' if unit == 'N m' else 'm/s'}"
            text = f"viscous friction of {viscous:g} allows {speed} at its effort limit"
            yield Remark(name, text, f"it is in {unit} s/{'rad' if unit == 'N m' else 'm'}")


def _joint_values(model: ArmModel, values: Array) -> Iterator[tuple[str, str, float, float]]:
    """Name, unit of effort, value and effort limit, inf for none, of each joint."""
    rows = zip(model.joint_names, model.units("N m", "N"), values, model.effort_limit, strict=True)
    return ((name, unit, float(x), float(limit) or np.inf) for name, unit, x, limit in rows)
