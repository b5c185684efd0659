# SPDX-License-Identifier: Apache-2.0
"""Kinks that last for a whole tick, so that no event marks them: there is no derivative.

A command exactly at its limit, a lossy gear without load in motion, friction that differs by
direction of a joint exactly at rest, and bristles that are bent there. Kinks that a motion passes
are guards, see ``guards``.
"""

from __future__ import annotations

from itertools import chain

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from arm_dynamics.actuation import StateKind
from arm_dynamics.actuation.command_map import CommandMap, gravity_compensated
from arm_dynamics.arrays import Array
from arm_sim.plant.plant import Plant

# Relative distance to a limit that is none.
ROUNDING = 1e-12

UNLOADED = "load"

type Flags = NDArray[np.bool_]


class NonsmoothPoints:
    """Lasting kinks of a scene.

    Args:
        plant: The scene's equations.
    """

    def __init__(self, plant: Plant) -> None:
        self._plant, self._model, self._n = plant, plant.model, plant.model.n
        self._limits = _limits(plant)
        self._weight: ca.Function | None = None
        if gravity_compensated(plant.model.scene):
            q = ca.SX.sym("q", self._n)
            self._weight = ca.Function("weight", [q], [CommandMap(plant.model).compensation(q)])
        self._sided = sided(plant)
        self._bristles = _bristles(plant)

    @property
    def depends_on_states(self) -> bool:
        """Whether the commands at their limits depend on the states."""
        return self._weight is not None and bool(self._limits)

    def commands_at_limits(self, r: Array, x: Array | None = None) -> dict[str, Flags]:
        """Commands of joints exactly at a limit, by what limits them, or at no load of a gear.

        Args:
            r: Commands, shape (…, n).
            x: States under which they act, shape (…, nx); without them, commands to which the arm
                adds its gravity compensation are left out, and gears are taken to move.

        Returns:
            Booleans of the shape of ``r``.
        """
        if self._weight is not None:
            if x is None:
                return {}
            r = r + np.array(self._weight(np.atleast_2d(x)[:, : self._n].T)).T.reshape(r.shape)
        flags = {
            kind: abs(abs(r) - limit) <= ROUNDING * limit for kind, limit in self._limits.items()
        }
        if UNLOADED in flags and x is not None:
            flags[UNLOADED] &= x[..., self._n : 2 * self._n] != 0.0
        return flags

    def at_rest(self, x: Array) -> dict[str, Flags]:
        """Joints exactly at rest whose friction has a kink there, by its kind, shape (…, n)."""
        flags = dict[str, Flags]()
        if not (self._sided.any() or len(self._bristles)):
            return flags
        still = x[..., self._n : 2 * self._n] == 0.0
        if self._sided.any():
            flags["friction that differs by direction"] = still & self._sided
        if len(self._bristles):
            joints, places = self._bristles.T
            bent = np.zeros_like(still)
            bent[..., joints] = still[..., joints] & (x[..., places] != 0.0)
            flags["bent bristles"] = bent
        return flags

    def reason(self, x: Array, r: Array) -> str:
        """Why the tick from a state under a command has no derivative; empty if it may have one.

        Args:
            x: State, shape (nx,).
            r: Command, shape (n,).
        """
        for kind, flags in self.commands_at_limits(r, x).items():
            if flags.any():
                joint = int(flags.argmax())
                name, limit = self._model.joint_names[joint], self._limits[kind][joint]
                if kind is UNLOADED:
                    return f"joint '{name}' moves without load, where its gear's loss has a kink"
                return f"the command of joint '{name}' is exactly at its {kind}, {limit:g}"
        for kind, flags in self.at_rest(x).items():
            if flags.any():
                joint = int(flags.argmax())
                return f"joint '{self._model.joint_names[joint]}' is at rest in {kind}"
        return ""

    def ticks_before(self, x: Array, r: Array) -> int:
        """Ticks of a motion before the first whose command is at a limit, or may be.

        Args:
            x: State at the beginning, shape (nx,).
            r: Commands of the ticks, shape (ticks, n).
        """
        if self.depends_on_states:
            return int(len(r) > 0 and not self.reason(x, r[0]))
        kinks = np.zeros(len(r), bool)
        for flags in self.commands_at_limits(r).values():
            kinks |= flags.any(axis=1)
        return min(np.flatnonzero(kinks).tolist(), default=len(r))

    def rests_bent(self, x: ca.SX) -> ca.SX:
        """1 where ``at_rest`` has a joint, else 0."""
        v, bent = x[self._n : 2 * self._n], ca.SX(0)
        for joint in np.flatnonzero(self._sided):
            bent = ca.logic_or(bent, v[int(joint)] == 0)
        for joint, place in self._bristles.tolist():
            bent = ca.logic_or(bent, ca.logic_and(v[joint] == 0, x[place] != 0))
        return bent

    @property
    def nonsmooth(self) -> ca.Function:
        """(x, r) -> 1 where ``reason`` has one, else 0."""
        x, r = ca.SX.sym("x", self._plant.nx), ca.SX.sym("r", self._n)
        kink, command = self.rests_bent(x), r
        if self._weight is not None:
            command = r + self._weight(x[: self._n])
        for kind, limit in self._limits.items():
            for i in np.flatnonzero(np.isfinite(limit)).tolist():
                beside = ca.fabs(ca.fabs(command[i]) - limit[i])
                moves = x[self._n + i] != 0 if kind is UNLOADED else 1
                kink = ca.logic_or(kink, ca.logic_and(beside <= ROUNDING * limit[i], moves))
        return ca.Function("nonsmooth", [x, r], [kink], {"cse": True})

    def arms(self, x: Array, r: Array) -> list[int]:
        """Arms with such a kink.

        Args:
            x: Initial states, shape (b, nx).
            r: Commands of all ticks, shape (b, ticks, n).
        """
        if not r.shape[1]:
            return []
        kinks = np.zeros(len(x), dtype=bool)
        by_kind = [self.commands_at_limits(r[:, 0], x), self.at_rest(x)]
        if r.shape[1] > 1:
            by_kind.append(self.commands_at_limits(r[:, 1:]))
        for flags in chain.from_iterable(kind.values() for kind in by_kind):
            kinks |= flags.reshape(len(x), -1).any(axis=1)
        return np.flatnonzero(kinks).tolist()


def sided(plant: Plant) -> Flags:
    """Joints whose viscous friction differs by direction, with no dry friction, shape (n,)."""
    friction = plant.model.friction
    return np.asarray((friction.viscous.skew != 0.0) & (friction.level == 0.0))


def _limits(plant: Plant) -> dict[str, Array]:
    """Sizes of commands with a kink, shape (n,), NaN for none."""
    model, current = plant.model, np.full(plant.model.n, np.inf)
    for i, drive in enumerate(model.drives):
        if drive and drive.motor.command == "torque" and drive.motor.current_limit:
            current[i] = drive.motor.current_limit * abs(drive.torque_constant)
    current[current > model.command_limit] = np.inf
    unloaded = np.full(model.n, np.inf)
    unloaded[list(model.friction.gears)] = 0.0
    if plant.torques is not None:  # torques that depend on the state have guards
        unloaded[list(set(plant.torques.jac_sparsity(0, 0).row()))] = np.inf
    limits = {"limit": model.command_limit, "current limit": current, UNLOADED: unloaded}
    return {
        kind: np.where(np.isfinite(limit), limit, np.nan)
        for kind, limit in limits.items()
        if np.isfinite(limit).any()
    }


def _bristles(plant: Plant) -> NDArray[np.intp]:
    """Joints and places in x of the deflections of friction laws, shape (k, 2)."""
    pairs, place = list[tuple[int, int]](), 2 * plant.model.n
    for law in plant.laws.laws:
        for state in law.states:
            if state.kind is StateKind.DEFLECTION and not law.replaces_command.any():
                pairs.append((state.joint, place))
            place += 1
    return np.array(pairs, dtype=np.intp).reshape(-1, 2)
