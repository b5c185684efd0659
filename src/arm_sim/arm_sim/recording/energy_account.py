# SPDX-License-Identifier: Apache-2.0
"""The energy account of a motion: what its laws store, what came in and what went out as heat.

Where the command is the torque, both can be had from the recorded states. Where laws have states,
a current rises and bristles snap within a tick, and a quadrature on the recorded states would miss
it: every tick is made again from its recorded beginning, by the same method, with two more states,
the work that came in and the heat that went out since. They are integrated as accurately as the
motion itself. Nothing of this is done before it is asked for.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from arm_dynamics import Dynamics
from arm_dynamics.actuation.internal_state import Ensemble, Flow
from arm_dynamics.arrays import Array
from arm_dynamics.model.friction import JointFriction
from arm_sim.integrators.selection import Choice
from arm_sim.plant.plant import Plant, split
from arm_sim.stepping.stepper import Stepper


@dataclass(frozen=True)
class Ledger(Ensemble):
    """The laws of a scene with the work supplied and the heat lost as two states more.

    Attributes:
        friction: The rest of the friction, whose heat counts too.
    """

    friction: JointFriction

    @property
    def names(self) -> tuple[str, ...]:
        """The laws' states, and the account."""
        return (*super().names, "work supplied [J]", "heat lost [J]")

    @property
    def scale(self) -> Array:
        """Size that matters of each of them, shape (nz + 2,)."""
        return np.concatenate([super().scale, [1.0, 1.0]])

    def initial(self, q: Array, v: Array) -> Array:
        """The laws' states, and an empty account."""
        return np.concatenate([super().initial(q, v), [0.0, 0.0]])

    def equations(self, q: ca.SX, v: ca.SX, z: ca.SX, u: ca.SX) -> Flow:
        """What the laws do, and the powers: heat by friction without states is one of them."""
        flow, law = super().equations(q, v, z, u), self.friction
        torque = law.smooth(v)
        if law.has_dry:
            torque = torque + law.dry(v, ca.sign(v), q, flow.torque)
        lost = flow.lost + ca.dot(torque, v)
        return Flow(flow.torque, ca.vertcat(flow.slope, flow.supplied, lost))


class EnergyAccount:
    """The energy account of one scene; nothing is built before it is asked for.

    Args:
        plant: The scene's equation of motion.
        dynamics: The scene's dynamics.
        choice: How it is integrated.
        backend: As for ``Kernel``.
    """

    def __init__(self, plant: Plant, dynamics: Dynamics, choice: Choice, backend: str) -> None:
        self._plant, self._dynamics = plant, dynamics
        self._choice, self._backend = choice, backend
        self._laws = plant.laws or Ensemble((), plant.model.n)

    @property
    def makes_ticks_again(self) -> bool:
        """Whether ``flows`` costs as much as the ticks themselves."""
        return self._plant.laws is not None or self._plant.contact is not None

    def prepare(self) -> None:
        """Build now what the first ``flows`` would have to build."""
        if self._plant.laws:
            self._ledger.restart()
        elif self._plant.contact:
            self._plain.restart()

    def stored(self, x: Array) -> Array:
        """Energy that the laws store at states of shape (k, nx), in [J], shape (k,)."""
        if not self._plant.laws:
            return np.zeros(len(x))
        return np.array(self._stored(x.T)).ravel()

    def flows(self, x: Array, u: Array, p: Array) -> Array:
        """Work supplied and heat lost in each tick.

        Args:
            x: States before each tick and after the last, shape (k+1, nx).
            u: Command that acted in each tick, shape (k, n).
            p: Tunable quantities, shape (np,).

        Returns:
            Work and heat in [J], shape (k, 2); NaN if a tick cannot be made again.
        """
        if self._plant.laws:
            return self._made_again(x, u, p)
        q, v = np.split(x, 2, axis=1)
        work = np.sum(u * np.diff(q, axis=0), axis=1)  # exact: a torque is held over its tick
        heat = dissipated_work(self._dynamics, self._choice.dt, q, v, u)
        if self._plant.contact:
            heat = heat + self.contact_losses(x, u, p).sum(axis=1)
        return np.stack([work, heat], axis=1)

    def contact_losses(self, x: Array, u: Array, p: Array) -> Array:
        """Energy that impacts, and friction of contacts, took out in each tick, made again.

        In [J], shape (k, 2); arguments as for ``flows``.
        """
        stepper, losses = self._plain, np.full((len(u), 2), np.nan)
        trace, effort, error = np.empty((1, x.shape[1])), np.empty((1, u.shape[1])), np.empty(1)
        stepper.p[:] = p
        for k in range(len(u)):
            stepper.restart()
            stepper.report.audit = 1
            if stepper.roll(x[k].copy(), u[k].copy(), trace, effort, error) == 1:
                losses[k] = stepper.report.impact_loss, stepper.report.friction_loss
        return losses

    def _made_again(self, x: Array, u: Array, p: Array) -> Array:
        stepper, (nx, n) = self._ledger, (self._plant.nx + 2, self._plant.model.n)
        trace, effort, error = np.empty((1, nx)), np.empty((1, n)), np.empty(1)
        out = np.full((len(u), 2), np.nan)
        stepper.p[:] = p
        stepper.restart()
        for k, command in enumerate(u):
            now = np.concatenate([x[k], [0.0, 0.0]])
            if stepper.roll(now, np.ascontiguousarray(command), trace, effort, error) == 1:
                out[k] = now[-2:]
        return out

    @cached_property
    def _stored(self) -> ca.Function:
        x, n = ca.SX.sym("x", self._plant.nx), self._plant.model.n
        flow = self._laws.equations(*split(x, n), ca.SX(n, 1))
        return ca.Function("stored", [x], [flow.stored])

    @cached_property
    def _plain(self) -> Stepper:
        return Stepper(self._plant, self._choice, self._backend)

    @cached_property
    def _ledger(self) -> Stepper:
        model = self._plant.model
        ledger = Ledger(self._laws.laws, model.n, model.friction)
        return Stepper(self._plant.with_laws(ledger), self._choice, self._backend)


def dissipated_work(dynamics: Dynamics, dt: float, q: Array, v: Array, tau: Array) -> Array:
    """Energy that friction takes out in each tick: the integral of F·v by Simpson's rule.

    Position and velocity in the middle of a tick are those of the cubic through both ends
    (Hermite).

    Args:
        dynamics: The scene's dynamics.
        dt: Length of a tick in [s].
        q: Joint positions in [rad] or [m], shape (k+1, n).
        v: Joint velocities in [rad/s] or [m/s], shape (k+1, n).
        tau: Torque of each tick in [N m] or [N], shape (k, n).

    Returns:
        Energy in [J], shape (k,).
    """
    if not len(tau):
        return np.zeros(0)
    middle = 0.5 * (q[:-1] + q[1:]) + 0.125 * dt * (v[:-1] - v[1:])
    speed = 1.5 * np.diff(q, axis=0) / dt - 0.25 * (v[:-1] + v[1:])
    power = [
        np.sum(dynamics.friction(rate, q=at, load=tau) * rate, axis=1)
        for at, rate in ((q[:-1], v[:-1]), (middle, speed), (q[1:], v[1:]))
    ]
    return dt * (power[0] + 4.0 * power[1] + power[2]) / 6.0
