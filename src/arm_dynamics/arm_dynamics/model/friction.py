# SPDX-License-Identifier: Apache-2.0
"""The friction of a scene's joints as numbers, and F as one law for everybody who needs it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import casadi as ca
import numpy as np

from arm_dynamics.arrays import Array
from arm_dynamics.equations import friction, lugre, transmission
from arm_dynamics.equations.elementary import Quantity, size
from arm_dynamics.equations.interpolation import Curve
from arm_dynamics.exceptions import SceneError
from arm_dynamics.scene.friction import Friction, Sides, Table


@dataclass(frozen=True)
class Bristles:
    """Joints whose dry friction is a LuGre law; arrays of shape (m,), one entry for each of them.

    Attributes:
        joints: Which joints, in model order.
        sigma0: Stiffness in [N m/rad] or [N/m].
        sigma1: Damping in [N m s/rad] or [N s/m].
        fading: Speed at which the damping fades in [rad/s] or [m/s]; inf where it does not.
        coulomb: Fc in [N m] or [N].
        static: Fs in [N m] or [N].
        stribeck_velocity: vs in [rad/s] or [m/s]; 1 where Fs is Fc.
    """

    joints: tuple[int, ...]
    sigma0: Array
    sigma1: Array
    fading: Array
    coulomb: Array
    static: Array
    stribeck_velocity: Array


@dataclass(frozen=True)
class JointFriction:
    """Friction of the joints of a scene; arrays of shape (n,) in model order.

    Where the two directions differ, a coefficient is their mean, and its skew half the difference
    of the positive and the negative one. The levels of joints with bristles are zero here.

    Attributes:
        viscous: Viscous friction in [N m s/rad] or [N s/m].
        viscous_skew: Its skew.
        coulomb: Dry friction in sliding in [N m] or [N].
        coulomb_skew: Its skew.
        static: Dry friction at rest in [N m] or [N], at least ``coulomb``.
        static_skew: Its skew.
        excess: Dry friction at creeping speed beyond ``coulomb``; zero where it falls at once.
        excess_skew: Its skew.
        stribeck_velocity: Speed of that fall in [rad/s] or [m/s]; 1 where there is none.
        position: Factor of dry friction by position, or None, for each joint.
        load: Factor of dry friction by the size of the drive's torque, or None, for each joint.
        bristles: Joints with a LuGre law, or None.
        efficiency: Part of the power that a joint's gear passes on.
    """

    viscous: Array
    viscous_skew: Array
    coulomb: Array
    coulomb_skew: Array
    static: Array
    static_skew: Array
    excess: Array
    excess_skew: Array
    stribeck_velocity: Array
    position: tuple[Curve | None, ...]
    load: tuple[Curve | None, ...]
    bristles: Bristles | None
    efficiency: Array

    @cached_property
    def has_dry(self) -> bool:
        """Whether a joint can stick."""
        return bool(self.level.any())

    @cached_property
    def directional(self) -> bool:
        """Whether it asks which way a joint slides, or is about to."""
        return self.has_dry or self.bristles is not None or bool(self.gears)

    @cached_property
    def skewed(self) -> bool:
        """Whether viscous friction depends on the direction."""
        return bool(self.viscous_skew.any())

    @cached_property
    def level(self) -> Array:
        """Scale of ``relative_hold``: ``static``, or 1 where only a gear's loss holds."""
        only_gear = (self.static == 0.0) & (self.efficiency < 1.0)
        return np.where(only_gear, 1.0, self.static)

    @cached_property
    def gearless(self) -> JointFriction:
        """The same without the gears' losses."""
        return replace(self, efficiency=np.ones_like(self.efficiency)) if self.gears else self

    @cached_property
    def gears(self) -> tuple[int, ...]:
        """Joints with a gear that loses power."""
        return tuple(np.flatnonzero(self.efficiency < 1.0).tolist())

    @cached_property
    def by_position(self) -> bool:
        """Whether it depends on the joints' positions."""
        return any(curve is not None for curve in self.position)

    @cached_property
    def by_load(self) -> bool:
        """Whether it depends on the drives' torques."""
        return any(curve is not None for curve in self.load)

    def smooth(self, v: Quantity, coefficient: Quantity = None) -> Quantity:
        """Viscous friction at v; another ``coefficient`` than the scene's, if given."""
        like = _like(v)
        mean = like(self.viscous) if coefficient is None else coefficient
        return friction.viscous(v, mean, like(self.viscous_skew) if self.skewed else None)

    def dry(self, v: Quantity, direction: Quantity, q: Quantity, load: Quantity) -> Quantity:
        """Friction of joints that slide the way of ``direction`` and have no bristles.

        Args:
            v: Joint velocities in [rad/s] or [m/s], shape (…, n).
            direction: -1, 0 or 1 for each joint.
            q: Joint positions in [rad] or [m]; used only if ``by_position``.
            load: Drives' torques in [N m] or [N]; used only if ``by_load``.

        Returns:
            Torques in [N m] or [N], of the sign of ``direction``.
        """
        like = _like(v)
        fall = like(self.stribeck_velocity)
        mean = friction.dry(v, direction, like(self.coulomb), like(self.excess), fall)
        if self.coulomb_skew.any() or self.excess_skew.any():
            skew = like(self.coulomb_skew), like(self.excess_skew)
            mean = mean + direction * friction.dry(v, direction, skew[0], skew[1], fall)
        rubbing = self._times_factor(mean, q, load)
        if not self.gears:
            return rubbing
        lost = {
            i: _column(rubbing, i)
            + transmission.gear_loss(_column(direction, i), _column(load, i), self.efficiency[i])
            for i in self.gears
        }
        return _replaced(rubbing, lost)

    def relative_hold(self, reaction: Quantity, q: Quantity, load: Quantity) -> Quantity:
        """A torque that holds a sticking joint, on a scale on which ``level`` is the level."""
        like, whole = _like(reaction), reaction
        if self.static_skew.any():
            level = np.where(self.static > 0.0, self.static, 1.0)
            reaction = reaction / (1.0 + like(self.static_skew / level) * _sign(reaction))
        factors = self._factors(q, load)
        held = reaction if factors is None else reaction / factors
        return self._held_by_gears(held, whole, factors, load) if self.gears else held

    def _held_by_gears(
        self, held: Quantity, reaction: Quantity, factors: Quantity | None, load: Quantity
    ) -> Quantity:
        relative = {}
        for i in self.gears:
            push = _column(reaction, i)
            level = self.static[i] + self.static_skew[i] * _sign(push)
            level = level if factors is None else level * _column(factors, i)
            lost = size(transmission.gear_loss(_sign(push), _column(load, i), self.efficiency[i]))
            relative[i] = push * self.level[i] / (level + lost + UNLOADED)
        return _replaced(held, relative)

    def steady(self, v: Quantity, direction: Quantity, q: Quantity, load: Quantity) -> Quantity:
        """All the friction of a steady motion, shape (…, n): viscous, dry, and bristles bent."""
        if not (self.has_dry or self.bristles):
            return self.smooth(v)
        return self.smooth(v) + self.steady_dry(v, direction, q, load)

    def steady_dry(
        self, v: Quantity, direction: Quantity, q: Quantity, load: Quantity
    ) -> Quantity:
        """The part of ``steady`` that changes sign with ``direction``."""
        if not self.bristles:
            return self.dry(v, direction, q, load)
        return self.bent(v, direction) + (self.dry(v, direction, q, load) if self.has_dry else 0.0)

    def bent(self, v: Quantity, direction: Quantity) -> Quantity:
        """Friction of the bristles of a steady motion, of the sign of ``direction``."""
        b, like = self.bristles, _like(v)
        if b is None:
            return 0.0 * v
        spread = np.eye(len(self.viscous))[list(b.joints)]
        coulomb, excess = like(b.coulomb @ spread), like((b.static - b.coulomb) @ spread)
        fall = like(b.stribeck_velocity @ spread + 1.0 - spread.sum(axis=0))
        return friction.dry(v, direction, coulomb, excess, fall)

    def demanded(self, rigid: Quantity, v: Quantity, direction: Quantity, q: Quantity) -> Quantity:
        """Torque that moves the rigid arm and overcomes its own load's friction.

        Solves tau = rigid + F(v, q, tau). A factor by load makes F grow with tau, by less than tau
        does (see ``joint_friction``), so that the repetition converges.

        Args:
            rigid: M a + C v + G in [N m] or [N], shape (…, n).
            v: Joint velocities in [rad/s] or [m/s].
            direction: Which way joints slide; used only if ``directional``.
            q: Joint positions in [rad] or [m]; used only if ``by_position``.

        Returns:
            Torques of the shape of ``rigid``.
        """
        tau = rigid + self.gearless.steady(v, direction, q, rigid)
        for _ in range(REPETITIONS if self.by_load else 0):
            tau = rigid + self.gearless.steady(v, direction, q, tau)
        return self.gear_input(tau, direction)

    def gear_input(self, wanted: Quantity, direction: Quantity) -> Quantity:
        """Torques of the motors of which ``wanted`` arrives behind the gears.

        Args:
            wanted: In [N m] or [N], shape (…, n).
            direction: Which way joints slide, -1 to 1; a part of one takes that part of the loss.
        """
        motors = {}
        for i in self.gears:
            way, torque = _column(direction, i), _column(wanted, i)
            lost = transmission.gear_input(way, torque, self.efficiency[i]) - torque
            motors[i] = torque + size(way) * lost
        return _replaced(wanted, motors) if motors else wanted

    def _times_factor(self, torque: Quantity, q: Quantity, load: Quantity) -> Quantity:
        factors = self._factors(q, load)
        return torque if factors is None else torque * factors

    def _factors(self, q: Quantity, load: Quantity) -> Quantity | None:
        if not (self.by_position or self.by_load):
            return None
        product: Any = 1.0
        for curves, x in ((self.position, q), (self.load, load)):
            if any(curve is not None for curve in curves):
                product = product * _applied(curves, x if curves is self.position else size(x))
        return product


REPETITIONS = 40
STEEPEST = 0.5
"""Most that friction may grow with the torque that causes it; each repetition halves the error."""
UNLOADED = 1e-12
"""What a gear without load holds in [N m] or [N], so that nothing is divided by zero."""


def _column(x: Quantity, i: int) -> Quantity:
    return x[i] if isinstance(x, ca.SX) else np.asarray(x)[..., i]


def _replaced(x: Quantity, columns: dict[int, Quantity]) -> Quantity:
    """``x`` with the entries of some joints replaced."""
    changed = ca.SX(x) if isinstance(x, ca.SX) else np.array(x, dtype=float)
    for i, column in columns.items():
        changed[i if isinstance(x, ca.SX) else (..., i)] = column
    return changed


def _applied(curves: Sequence[Curve | None], x: Quantity) -> Quantity:
    if isinstance(x, ca.SX):
        return ca.vertcat(*[1.0 if c is None else c(x[i]) for i, c in enumerate(curves)])
    x = np.asarray(x)
    ones = np.ones(x.shape[:-1])
    return np.stack([ones if c is None else c(x[..., i]) for i, c in enumerate(curves)], axis=-1)


def _like(x: Quantity) -> Any:
    """What turns coefficients into the kind of ``x``; zeros vanish from an expression."""
    return _expression if isinstance(x, ca.SX) else np.asarray


def _expression(values: Array) -> ca.SX:
    return ca.sparsify(ca.SX(ca.DM(values)))


def _sign(x: Quantity) -> Quantity:
    return ca.sign(x) if isinstance(x, ca.SX) else np.sign(x)


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
