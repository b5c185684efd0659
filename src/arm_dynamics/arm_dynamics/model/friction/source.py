# SPDX-License-Identifier: Apache-2.0
"""Friction of the joints from scene and URDF, checked together."""

from collections.abc import Sequence
from functools import cached_property

import numpy as np

from arm_dynamics.arrays import Array, read_only
from arm_dynamics.attributes import frozen
from arm_dynamics.equations.interpolation import Curve
from arm_dynamics.model.friction.joint_friction import STEEPEST, DryFriction, JointFriction, Sided
from arm_dynamics.model.friction.table import FrictionTable, steepest
from arm_dynamics.scene.effect import refuse_of_joints, value_at
from arm_dynamics.scene.friction import IN_TABLE, Friction, Sides, Table, refusal
from arm_dynamics.scene.schema import Scene


@frozen
class FrictionSource:
    """What scene and URDF say of the friction of one joint.

    Attributes:
        name: The joint.
        own: Keys of the scene, those for all joints included.
        named: Keys of the joint's own entry alone.
        damping: Viscous friction where the scene gives none, in [N m s/rad] or [N s/m].
        dry: Dry friction likewise, in [N m] or [N].
        drive_viscous: Viscous friction added by the joint's drive.
        efficiency: Efficiency of the drive's gear.
    """

    name: str
    own: Friction
    named: Friction
    damping: float
    dry: float
    drive_viscous: float
    efficiency: float

    @cached_property
    def table(self) -> FrictionTable | None:
        """Friction of the joint by speed, if the scene gives that."""
        if (table := self.own.table) is None:
            return None
        place = None if table.position is None else np.array(table.position)
        return FrictionTable.of(
            np.array(table.speed), np.array(table.rows), place, table.period or 0.0
        )

    @property
    def coulomb(self) -> tuple[float, float]:
        """Dry friction in sliding, of a table that at rest: mean of both directions, and skew."""
        return (self.table.dry, 0.0) if self.table else _sides(self.own.coulomb, self.dry)

    @property
    def viscous(self) -> tuple[float, float]:
        """Viscous friction, likewise, without the drive's; a table replaces the default."""
        return _sides(self.own.viscous, 0.0 if self.table else self.damping)


def friction_of(
    scene: Scene, joints: Sequence[FrictionSource], free: Sequence[str], followers: Array
) -> JointFriction:
    """Friction of the independent joints (``free``); that of a mimic joint acts on its leader.

    ``joints`` are all that move, in the order of the rows of ``followers``, the matrix E.

    Raises:
        SceneError: If the coefficients of a joint contradict one another.
    """
    for joint in joints:
        (_check if joint.name in free else _check_follower)(joint)
    viscous = np.array([joint.viscous for joint in joints])
    viscous[:, 0] += [joint.drive_viscous for joint in joints]
    coulomb = np.array([joint.coulomb for joint in joints])
    static = np.array(
        [_sides(j.own.static, *level) for j, level in zip(joints, coulomb, strict=True)]
    )
    fc, fs = (Sided(*(level.T @ abs(followers))) for level in (coulomb, static))
    by_name = {joint.name: joint for joint in joints}
    independent = [by_name[name] for name in free]
    tables = tuple(joint.table for joint in independent)
    falls = np.array([joint.own.stribeck_velocity or 0.0 for joint in independent])
    dry = DryFriction(
        coulomb=fc,
        static=fs,
        excess=Sided(fs.mean - fc.mean, fs.skew - fc.skew).times(falls > 0.0),
        stribeck_velocity=np.where(falls > 0.0, falls, 1.0),
        position=tuple(
            table.dry_by_position if table else _curve(joint.own.position)
            for joint, table in zip(independent, tables, strict=True)
        ),
        load=tuple(_curve(joint.own.load) for joint in independent),
    )
    _check_loads(independent, dry)
    levels = zip(independent, np.transpose(fc), np.transpose(fs), strict=True)
    refuse_of_joints(scene, {joint.name: _idle_keys(joint.own, *x) for joint, *x in levels})
    stateful = [i for i, joint in enumerate(independent) if joint.own.stateful]
    sticking = [i for i in range(len(independent)) if i not in stateful]
    return JointFriction(
        **vars(dry.of(sticking)),
        viscous=Sided(*map(read_only, viscous.T @ followers**2)),
        tables=tables,
        by_law=dry.of(stateful),
        efficiency=np.array([joint.efficiency for joint in independent]),
    )


def _sides(value: float | Sides | None, mean: float, skew: float = 0.0) -> tuple[float, float]:
    """Mean of both directions and half their difference; the defaults where no value is given."""
    if isinstance(value, Sides):
        return 0.5 * (value.positive + value.negative), 0.5 * (value.positive - value.negative)
    return (mean, skew) if value is None else (float(value), 0.0)


def _curve(table: Table | None) -> Curve | None:
    if table is None:
        return None
    return Curve.through(np.array(table.at), np.array(table.factor), table.period or 0.0)


def _check(joint: FrictionSource) -> None:
    own, law = joint.own, joint.own.stateful
    if own.table is not None:
        for key in IN_TABLE:
            if (value := value_at(own, key)) is not None:
                text = f"{key}' = {value!r}: 'friction.table' of the joint contains it; allowed "
                raise refusal(joint.name, f"{text}beside it: 'viscous'")
        return
    if joint.efficiency < 1.0 and law:
        raise refusal(
            joint.name,
            f"{law}' and 'actuator.efficiency' = {joint.efficiency}: the LuGre model "
            "includes all dry friction of a joint; give that of the gear by 'friction.load'",
        )
    fc, fc_skew = _sides(own.coulomb, joint.dry)
    fs, fs_skew = _sides(own.static, fc, fc_skew)
    if fs + fs_skew >= fc + fc_skew and fs - fs_skew >= fc - fc_skew:
        return
    level = joint.dry if own.coulomb is None else own.coulomb
    text = f"static' = {own.static}: at least coulomb, {level}, is expected"
    if own.stribeck_velocity is None:
        raise refusal(joint.name, f"{text} without 'stribeck_velocity'")
    if law:
        raise refusal(joint.name, f"{text} with '{law}'")
    if not fs > abs(fs_skew):
        text = f"static' = {own.static}: more than 0 is expected, so that the joint can rest"
        raise refusal(joint.name, text)


def _check_follower(joint: FrictionSource) -> None:
    own = joint.own
    for key in ("static", "position", "load", "table", own.stateful):
        if key and getattr(own, key) is not None:
            raise refusal(joint.name, f"{key}': a mimic joint has none of its own")
    if joint.named.stribeck_velocity is not None:
        raise refusal(joint.name, "stribeck_velocity': a mimic joint has none of its own")
    for key in ("viscous", "coulomb"):
        if isinstance(getattr(own, key), Sides):
            raise refusal(joint.name, f"{key}': a mimic joint has one number for both directions")


def _check_loads(joints: Sequence[FrictionSource], dry: DryFriction) -> None:
    for i, (joint, curve) in enumerate(zip(joints, dry.load, strict=True)):
        if curve is None:
            continue
        level = float(dry.extremes(i)[1].max()) / float(curve.values.max())
        steep = level * steepest(curve)
        allowed = STEEPEST * joint.efficiency  # the motor supplies 1/η of the friction torque
        if steep > allowed:
            gear = f", half of the gear's efficiency {joint.efficiency}" if allowed < 0.5 else ""
            raise refusal(
                joint.name,
                f"load': friction grows by {steep:.3g} of the load that causes it; allowed: "
                f"up to {allowed:.3g}{gear}; beyond, the joint could be self-locking",
            )


def _idle_keys(own: Friction, coulomb: Array, static: Array) -> dict[str, str]:
    """Keys of a joint's friction that change nothing, and why.

    Levels are mean of both directions and skew, followers' included.
    """
    lost = {}
    if np.array_equal(coulomb, static):
        lost["stribeck_velocity"] = "friction falls from 'static' to 'coulomb': " + (
            "'static' is missing" if own.static is None else "another 'static' is expected"
        )
    if static[0] == 0.0:
        none = "it multiplies dry friction, and there is no 'coulomb' and no 'static'"
        lost |= {"position": none, "load": none}
    if own.lugre is not None and own.lugre.sigma1 == 0.0:
        lost["lugre.sigma1_velocity"] = "the damping that it fades, 'sigma1', is 0"
    reasons = [(key, why) for key, why in lost.items() if value_at(own, key) is not None]
    return {f"friction.{key}": why for key, why in reasons}
