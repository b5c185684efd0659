# SPDX-License-Identifier: Apache-2.0
"""The energy account of a motion: what its laws store, what came in and what went out as heat.

Where a motion is smooth and the command is the torque, both can be had from the recorded states.
Where laws have states, a current rises and bristles snap within a tick, and where there are events
friction and stops jump within one: a quadrature on the recorded states would miss it. Every tick
is made again from its recorded beginning, by the same method, with the work that came in and the
heat that went out since as further states. They are integrated as accurately as the motion itself.
Nothing of this is done before it is asked for.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import casadi as ca
import numpy as np

from arm_dynamics import Dynamics
from arm_dynamics.actuation.internal_state import Ensemble, Flow
from arm_dynamics.arrays import Array
from arm_dynamics.equations import spring
from arm_dynamics.equations.spring import Springs
from arm_dynamics.equations.tree import Tree
from arm_dynamics.model.friction import JointFriction
from arm_dynamics.model.tree_builder import tree_of
from arm_sim.integrators.selection import Choice
from arm_sim.plant.plant import Plant, split
from arm_sim.stepping.stepper import Stepper

# How many ticks a joint may be away from a stop, at its speed, and still have met it in a tick.
MARGIN = 2.0


@dataclass(frozen=True)
class Ledger(Ensemble):
    """The laws of a scene with the energies that flow as states more, all of them last.

    They are the work supplied, the heat lost, and what friction of contacts and compliant stops
    take, which ``Plant.accounted`` adds. Impacts are no part of it.

    Attributes:
        friction: The rest of the friction, whose heat counts too.
        springs: Springs, with that of their dampers.
        tree: The links.
    """

    friction: JointFriction
    springs: Springs
    tree: Tree

    @property
    def names(self) -> tuple[str, ...]:
        """The laws' states, and the account."""
        return (*super().names, "work supplied [J]", "heat lost [J]", "lost in contacts [J]")

    @property
    def scale(self) -> Array:
        """Size that matters of each of them, shape (nz + 3,)."""
        return np.concatenate([super().scale, np.ones(3)])

    def initial(self, q: Array, v: Array) -> Array:
        """The laws' states, and an empty account."""
        return np.concatenate([super().initial(q, v), np.zeros(3)])

    def equations(self, q: ca.SX, v: ca.SX, z: ca.SX, u: ca.SX) -> Flow:
        """What the laws do, and the powers but the last: heat by friction and dampers is one."""
        flow, law = super().equations(q, v, z, u), self.friction
        torque = law.smooth(v)
        if law.has_dry:
            torque = torque + law.dry(v, ca.sign(v), q, flow.torque)
        lost = flow.lost + ca.dot(torque, v) + spring.heat(self.springs, self.tree, q, v)
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

    def prepare(self) -> None:
        """Build now what the first ``flows`` would have to build."""
        if self._plant.laws is not None or self._plant.events:
            self._ledger.restart()

    def makes_ticks_again(self, x: Array) -> bool:
        """Whether ``flows`` costs as much as the ticks themselves for states of shape (k+1, nx).

        A smooth motion without laws needs it only where it meets a stop.
        """
        model = self._plant.model
        smooth = self._plant.laws is None and (not self._plant.events or self._plant.free)
        if not smooth:
            return True
        q, v = x[:, : model.n], x[:, model.n : 2 * model.n]
        # A rebound shows in how fast a joint leaves, even if it is nowhere at the stop in between.
        near = [q, *(q + way * self._choice.dt * v for way in (-MARGIN, MARGIN))]
        return any(model.stops.touched(place).any() for place in near)

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
        if self.makes_ticks_again(x):
            supplied, *lost = self._made_again(x, u, p).T
            return np.stack([supplied, sum(lost)], axis=1)
        q, v = np.split(x, 2, axis=1)
        work = np.sum(u * np.diff(q, axis=0), axis=1)  # exact: a torque is held over its tick
        return np.stack([work, dissipated_work(self._dynamics, self._choice.dt, q, v, u)], axis=1)

    def contact_losses(self, x: Array, u: Array, p: Array) -> Array:
        """Energy that impacts, and friction of contacts, took out in each tick, made again.

        In [J], shape (k, 2); arguments as for ``flows``.
        """
        return self._made_again(x, u, p)[:, [3, 2]]

    def _made_again(self, x: Array, u: Array, p: Array) -> Array:
        """Work supplied, heat lost, losses in contacts and in impacts, shape (k, 4)."""
        stepper, flows = self._ledger, np.full((len(u), 4), np.nan)
        trace, effort = np.empty((1, x.shape[1] + 3)), np.empty((1, u.shape[1]))
        stepper.p[:] = p
        stepper.restart()
        for k in range(len(u)):
            before = stepper.report.impact_loss
            start = np.concatenate([x[k], np.zeros(3)])
            if stepper.roll(start, u[k].copy(), trace, effort, np.empty((1, 2))) == 1:
                flows[k] = [*trace[0, -3:], stepper.report.impact_loss - before]
        return flows

    @cached_property
    def _stored(self) -> ca.Function:
        x, n = ca.SX.sym("x", self._plant.nx), self._plant.model.n
        flow = self._laws.equations(*split(x, n), ca.SX(n, 1))
        return ca.Function("stored", [x], [flow.stored])

    @cached_property
    def stepper(self) -> Stepper:
        """The scene's own, for looks at recorded states."""
        return Stepper(self._plant, self._choice, self._backend)

    @cached_property
    def _ledger(self) -> Stepper:
        model = self._plant.model
        ledger = Ledger(self._laws.laws, model.n, model.friction, model.springs, tree_of(model))
        return Stepper(self._plant.accounted(ledger), self._choice, self._backend)


def dissipated_work(dynamics: Dynamics, dt: float, q: Array, v: Array, tau: Array) -> Array:
    """Energy that friction and dampers take out in each tick: their power by Simpson's rule.

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
    torque = dynamics.friction
    power = [
        np.sum((torque(rate, q=at, load=tau) + _damping(dynamics, at, rate)) * rate, axis=1)
        for at, rate in ((q[:-1], v[:-1]), (middle, speed), (q[1:], v[1:]))
    ]
    return dt * (power[0] + 4.0 * power[1] + power[2]) / 6.0


def _damping(dynamics: Dynamics, q: Array, v: Array) -> Array:
    """The dampers' part of the springs' torques, shape (k, n)."""
    return dynamics.spring(q, v) - dynamics.spring(q)
