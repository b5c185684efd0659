# SPDX-License-Identifier: Apache-2.0
"""From what scene and URDF say of friction to ``JointFriction``, checked together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.equations import lugre
from arm_dynamics.equations.interpolation import Curve
from arm_dynamics.exceptions import SceneError
from arm_dynamics.model.friction import STEEPEST, Bristles, JointFriction
from arm_dynamics.scene.friction import Friction, Sides, Table


@dataclass(frozen=True)
class Settings:
    """What is said of one joint.

    Attributes:
        name: The joint.
        own: The scene's words.
        damping: Viscous friction if the scene has no word, in [N m s/rad] or [N s/m].
        dry: Dry friction likewise, in [N m] or [N].
        more: Viscous friction that the joint's drive adds.
        efficiency: Of the drive's gear.
    """

    name: str
    own: Friction
    damping: float
    dry: float
    more: float = 0.0
    efficiency: float = 1.0


def resolve(joints: Sequence[Settings], free: Sequence[str], followers: Array) -> JointFriction:
    """The friction of the independent joints; that of a mimic joint acts through its leader.

    Args:
        joints: Every moving joint, mimic joints too, in the order of the rows of ``followers``.
        free: Independent joints, in model order.
        followers: Matrix E of shape (len(joints), n).

    Returns:
        The friction.

    Raises:
        SceneError: If the coefficients of a joint do not go together.
    """
    for joint in joints:
        (_check if joint.name in free else _check_follower)(joint)
    viscous = [_sides(joint.own.viscous, joint.damping) for joint in joints]
    sliding = [_sides(joint.own.coulomb, joint.dry) for joint in joints]
    holding = [
        level if joint.own.static is None else _sides(joint.own.static, 0.0)
        for joint, level in zip(joints, sliding, strict=True)
    ]
    resisting = np.array(viscous).T + np.array([[j.more for j in joints], [0.0] * len(joints)])
    b, b_skew = resisting @ followers**2
    (fc, fc_skew), (fs, fs_skew) = (np.array(x).T @ abs(followers) for x in (sliding, holding))
    mine = [next(joint for joint in joints if joint.name == name) for name in free]
    bristles = _bristles(mine, b - abs(b_skew), fc, fs)
    dry = np.array([joint.own.lugre is None for joint in mine])
    falls = np.array([joint.own.stribeck_velocity or 0.0 for joint in mine])
    falling = dry & (falls > 0.0)
    friction = JointFriction(
        b, b_skew, fc * dry, fc_skew * dry, fs * dry, fs_skew * dry,
        (fs - fc) * falling, (fs_skew - fc_skew) * falling, np.where(falling, falls, 1.0),
        tuple(_curve(joint.own.position) for joint in mine),
        tuple(_curve(joint.own.load) for joint in mine), bristles,
        np.array([joint.efficiency for joint in mine]),
    )  # fmt: skip
    _check_loads(mine, friction)
    return friction


def _sides(value: float | Sides | None, otherwise: float) -> tuple[float, float]:
    """Mean of both directions, and half their difference."""
    if isinstance(value, Sides):
        return 0.5 * (value.positive + value.negative), 0.5 * (value.positive - value.negative)
    return (float(otherwise) if value is None else float(value)), 0.0


def _curve(table: Table | None) -> Curve | None:
    if table is None:
        return None
    return Curve.through(np.array(table.at), np.array(table.factor), table.period or 0.0)


def _check(joint: Settings) -> None:
    own = joint.own
    for key in ("load", "lugre"):
        if joint.efficiency < 1.0 and getattr(own, key) is not None:
            raise _refusal(
                joint,
                f"{key}' and 'actuator.efficiency' = {joint.efficiency}: one of them is allowed",
            )
    if own.static is None:
        return
    (fs, fs_skew), (fc, fc_skew) = _sides(own.static, 0.0), _sides(own.coulomb, joint.dry)
    if fs + fs_skew < fc + fc_skew or fs - fs_skew < fc - fc_skew:
        level = joint.dry if own.coulomb is None else own.coulomb
        raise _refusal(joint, f"static' = {own.static}: at least coulomb, {level}, is wanted")


def _check_follower(joint: Settings) -> None:
    own = joint.own
    for key in ("static", "position", "load", "lugre"):
        if getattr(own, key) is not None:
            raise _refusal(joint, f"{key}': a mimic joint has none of its own")
    for key in ("viscous", "coulomb"):
        if isinstance(getattr(own, key), Sides):
            raise _refusal(joint, f"{key}': a mimic joint has one number for both directions")


def _check_loads(joints: Sequence[Settings], friction: JointFriction) -> None:
    for i, (joint, curve) in enumerate(zip(joints, friction.load, strict=True)):
        if curve is None:
            continue
        level = float(friction.static[i] + abs(friction.static_skew[i]))
        place = friction.position[i]
        level *= float(place.values.max()) if place else 1.0
        grid = np.linspace(curve.at[0], curve.at[-1], 1000)
        steepest = level * float(np.max(np.diff(curve(grid)) / np.diff(grid)))
        if steepest > STEEPEST:
            raise _refusal(
                joint,
                f"load': friction grows by {steepest:.3g} of the load that causes it; at most "
                f"{STEEPEST} is allowed, or the joint could lock itself",
            )


def _bristles(
    joints: Sequence[Settings], viscous: Array, coulomb: Array, static: Array
) -> Bristles | None:
    """The joints with a LuGre law; the levels are those of scene, URDF and followers together."""
    rows = []
    for i, joint in enumerate(joints):
        if joint.own.lugre is not None:
            _check_bristles(joint, float(viscous[i]), float(coulomb[i]), float(static[i]))
            law = joint.own.lugre
            fading = law.sigma1_velocity or np.inf
            speed = joint.own.stribeck_velocity or 1.0
            rows.append((law.sigma0, law.sigma1, fading, coulomb[i], static[i], speed))
    which = tuple(i for i, joint in enumerate(joints) if joint.own.lugre is not None)
    return Bristles(which, *np.array(rows, dtype=float).T) if rows else None


def _check_bristles(joint: Settings, viscous: float, coulomb: float, static: float) -> None:
    own, law = joint.own, joint.own.lugre
    assert law is not None
    for key in ("coulomb", "static"):
        if isinstance(getattr(own, key), Sides):
            raise _refusal(joint, f"{key}': with 'lugre' one number for both directions is wanted")
    for key in ("position", "load"):
        if getattr(own, key) is not None:
            raise _refusal(joint, f"{key}': not together with 'lugre'")
    if not coulomb > 0.0:
        raise _refusal(joint, f"lugre' needs coulomb above zero, got {coulomb}")
    if static > coulomb and own.stribeck_velocity is None:
        raise _refusal(joint, "lugre' with static above coulomb needs a 'stribeck_velocity'")
    if not lugre.is_passive(law.sigma1, viscous, coulomb, static, law.sigma1_velocity):
        needed = law.sigma1 * (static - coulomb) / coulomb
        slow = lugre.FADING * coulomb / law.sigma1
        raise _refusal(
            joint,
            f"lugre' is not passive, it could give out energy: viscous >= sigma1 (static - "
            f"coulomb) / coulomb = {needed:.4g} is wanted, got {viscous:.4g}; or let the damping "
            f"fade: sigma1_velocity <= 4 sqrt(2 e) coulomb / sigma1 = {slow:.4g}, "
            f"got {law.sigma1_velocity}",
        )


def _refusal(joint: Settings, text: str) -> SceneError:
    return SceneError(f"scene: 'joints.{joint.name}.friction.{text}")
