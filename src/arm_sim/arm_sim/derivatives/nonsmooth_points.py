# SPDX-License-Identifier: Apache-2.0
"""Kinks that last for a whole tick, so that no event marks them: there is no derivative.

A command exactly at its limit, a lossy gear without load in motion, friction that differs by
direction of a joint exactly at rest, and bristles that are bent there. Kinks that a motion passes
are guards, see ``guards``.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from arm_dynamics.actuation import StateKind
from arm_dynamics.actuation.command_map import CommandMap, gravity_compensated
from arm_dynamics.arrays import Array
from arm_sim.plant.plant import Plant

# Distance to a limit, relative to it, that is rounding
ROUNDING = 1e-12


class CommandKink(NamedTuple):
    """A size of a joint's command at which its torque has a kink.

    Attributes:
        joint: Index of the joint.
        size: A limit, or 0 for a gear without load.
        velocity: Index in x of a velocity that has to differ from zero, too; None if none has.
        reason: Why there is no derivative.
    """

    joint: int
    size: float
    velocity: int | None
    reason: str

    def is_present(self, x: Any, command: Any) -> Any:
        """Whether there is a kink; x and the command by entry: numbers, arrays or expressions.

        Without x, joints are taken to move.
        """
        at_size = abs(abs(command[self.joint]) - self.size) <= ROUNDING * self.size
        if x is None or self.velocity is None:
            return at_size
        return at_size * (x[self.velocity] != 0.0)


class RestKink(NamedTuple):
    """A kink in the friction of a joint at rest.

    Attributes:
        velocity: Index in x of the velocity that is zero.
        deflection: Index of a deflection that has to differ from zero; None if none has.
        reason: Why there is no derivative.
    """

    velocity: int
    deflection: int | None
    reason: str

    def is_present(self, x: Any, _command: Any = None) -> Any:
        """Whether there is a kink, see ``CommandKink``."""
        at_rest = x[self.velocity] == 0.0
        return at_rest if self.deflection is None else at_rest * (x[self.deflection] != 0.0)


class NonsmoothPoints:
    """Lasting kinks of a scene.

    Args:
        plant: The scene's equations.
    """

    def __init__(self, plant: Plant) -> None:
        self._nx, self._n = plant.nx, plant.model.n
        self._command_kinks, self._rest_kinks = _kinks_of_commands(plant), _kinks_at_rest(plant)
        self._kinks: tuple[CommandKink | RestKink, ...] = *self._command_kinks, *self._rest_kinks
        self._compensation: ca.Function | None = None
        if gravity_compensated(plant.model.scene):
            q = ca.SX.sym("q", self._n)
            torque = CommandMap(plant.model).compensation(q)
            self._compensation = ca.Function("compensation", [q], [torque])

    @property
    def depends_on_states(self) -> bool:
        """Whether the commands at their limits depend on the states."""
        return self._compensation is not None and bool(self._command_kinks)

    def _command(self, x: Array, r: Array) -> Array:
        """Commands with the arm's gravity compensation, of the shape of ``r``."""
        if self._compensation is None:
            return r
        compensation = np.array(self._compensation(x[..., : self._n].T))
        return np.asarray(r + compensation.T.reshape(r.shape))

    def reason(self, x: Array, r: Array) -> str:
        """Why the tick from a state under a command has no derivative; empty if it may have one.

        Args:
            x: State, shape (nx,).
            r: Command, shape (n,).
        """
        state, command = x.tolist(), self._command(x, r).tolist()
        return next((kink.reason for kink in self._kinks if kink.is_present(state, command)), "")

    def ticks_before_kink(self, x: Array, r: Array) -> int:
        """Ticks of a motion before the first whose command is at a limit, or may be.

        Args:
            x: State at the beginning, shape (nx,).
            r: Commands of the ticks, shape (ticks, n).
        """
        if self.depends_on_states:
            return int(len(r) > 0 and not self.reason(x, r[0]))
        kinks = np.zeros(len(r), bool)
        for kink in self._command_kinks:
            kinks |= kink.is_present(None, r.T)
        return min(np.flatnonzero(kinks).tolist(), default=len(r))

    def kink_at_rest(self, x: ca.SX) -> ca.SX:
        """1 where a joint at rest has a kink, else 0."""
        return _any([kink.is_present(x) for kink in self._rest_kinks])

    @property
    def nonsmooth(self) -> ca.Function:
        """(x, r) -> 1 where ``reason`` has one, else 0."""
        x, r = ca.SX.sym("x", self._nx), ca.SX.sym("r", self._n)
        command = r + self._compensation(x[: self._n]) if self._compensation else r
        flag = _any([kink.is_present(x, command) for kink in self._kinks])
        return ca.Function("nonsmooth", [x, r], [flag], {"cse": True})

    def arms_with_kinks(self, x: Array, r: Array) -> list[int]:
        """Indices of arms in whose ticks there is a kink, or may be.

        Args:
            x: Initial states, shape (b, nx).
            r: Commands of all ticks, shape (b, ticks, n).
        """
        if not r.shape[1]:
            return []
        kinks, command = np.zeros(len(x), dtype=bool), self._command(x, r[:, 0])
        for kink in self._kinks:
            kinks |= kink.is_present(x.T, command.T)
        if not self.depends_on_states:
            for kink in self._command_kinks:
                kinks |= kink.is_present(None, r[:, 1:].T).any(axis=0)
        return np.flatnonzero(kinks).tolist()


def sided_friction(plant: Plant) -> NDArray[np.bool_]:
    """Joints whose viscous friction differs by direction, with no dry friction, shape (n,)."""
    friction = plant.model.friction
    return np.asarray((friction.viscous.skew != 0.0) & (friction.level == 0.0))


def _any(flags: Sequence[ca.SX]) -> ca.SX:
    """1 where one of the flags is, else 0."""
    return ca.SX(sum(flags, ca.SX(0)) > 0)


def _kinks_of_commands(plant: Plant) -> tuple[CommandKink, ...]:
    model = plant.model
    current = np.full(model.n, np.inf)
    for i, drive in enumerate(model.drives):
        if drive and drive.motor.command == "torque" and drive.motor.current_limit:
            current[i] = drive.motor.current_limit * abs(drive.torque_constant)
    current[current > model.command_limit] = np.inf
    kinks = [
        CommandKink(
            i, limits[i], None,
            f"the command of joint '{model.joint_names[i]}' is exactly at its {kind}, "
            f"{limits[i]:g}",
        )
        for kind, limits in (("limit", model.command_limit), ("current limit", current))
        for i in np.flatnonzero(np.isfinite(limits)).tolist()
    ]  # fmt: skip
    # Torques that depend on the state have guards.
    guarded = set(plant.torques.jac_sparsity(0, 0).row()) if plant.torques else set()
    kinks += [
        CommandKink(
            i, 0.0, model.n + i,
            f"joint '{model.joint_names[i]}' moves without load, where its gear's loss has a kink",
        )
        for i in sorted({*model.friction.gears} - guarded)
    ]  # fmt: skip
    return tuple(kinks)


def _kinks_at_rest(plant: Plant) -> tuple[RestKink, ...]:
    names, n = plant.model.joint_names, plant.model.n
    friction = "friction that differs by direction"
    kinks = [(i, None, friction) for i in np.flatnonzero(sided_friction(plant)).tolist()]
    kinks += [
        (joint, place, "bent bristles")
        for place, joint in np.transpose(plant.laws.places(StateKind.DEFLECTION)).tolist()
    ]
    return tuple(
        RestKink(n + i, deflection, f"joint '{names[i]}' is at rest in {kind}")
        for i, deflection, kind in kinks
    )
