# SPDX-License-Identifier: Apache-2.0
"""The energy account of a motion: stored energy, supplied work and dissipated heat.

If a motion is smooth and the command is the torque, work and heat follow from the recorded states,
to fourth order. With error control that is not accurate enough. With internal states, a current
rises and bristles deflect within a tick, and with events friction and stop forces jump within one:
a quadrature over the recorded states would miss that. Then every tick is repeated from its
recorded start, by the same method, with work and heat as additional states, which are integrated
as accurately as the motion itself. All of this is computed on demand.
"""

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from arm_dynamics import Dynamics
from arm_dynamics.arrays import Array
from arm_dynamics.attributes import sealed
from arm_dynamics.codegen.one_at_a_time import built_once
from arm_sim.integrators.selection import Choice
from arm_sim.plant.energy_flows import FLOWS
from arm_sim.plant.parameters import EXTERNAL
from arm_sim.plant.plant import Plant
from arm_sim.plant.present_dynamics import PresentDynamics
from arm_sim.plant.state_space import split
from arm_sim.stepping.stepper import Stepper

# Distance to a stop, in ticks at the joint's velocity, within which it may have hit the stop
MARGIN = 2.0
# Part of an energy that counts as rounding, not as motion
ROUNDING = 1e-9


@sealed
class EnergyAccount:
    """The energy account of one scene; everything is built on demand.

    Args:
        plant: The scene's equation of motion.
        present: Its dynamics under tunable quantities.
        choice: How it is integrated.
        backend: As for ``Kernel``.

    Attributes:
        choice: How the scene is integrated.
    """

    def __init__(
        self, plant: Plant, present: PresentDynamics, choice: Choice, backend: str
    ) -> None:
        self._plant, self._present = plant, present
        self.choice, self._backend = choice, backend

    @property
    def may_need_repeats(self) -> bool:
        """Whether some motion of the scene needs repeated ticks."""
        return self._repeats_always or self._plant.eventful

    @property
    def _repeats_always(self) -> bool:
        return bool(self._plant.laws) or self.choice.tolerance is not None

    def prepare(self) -> None:
        """Build in advance what the first ``flows`` needs."""
        if self.may_need_repeats:
            self._flow_stepper.restart()

    def repeats(self, x: Array) -> bool:
        """Whether ``flows`` costs as much as the ticks themselves for states of shape (k+1, nx).

        A smooth motion with fixed steps and without internal states requires it only at stops.
        """
        return bool(self._to_repeat(x).any())

    def _to_repeat(self, x: Array) -> NDArray[np.bool_]:
        """Whether a tick that begins or ends at states of shape (k, nx) is to be repeated."""
        if self._repeats_always or (self._plant.eventful and not self._plant.free):
            return np.ones(len(x), bool)
        q, v, _ = self._split(x)
        # A rebound is visible in the velocity after it, even if no recorded position is at the
        # stop.
        near = [q, *(q + sign * self.choice.dt * v for sign in (-MARGIN, MARGIN))]
        touched = self._plant.model.stops.touched
        return np.any([touched(place).any(axis=1) for place in near], axis=0)

    def stored(self, x: Array) -> Array:
        """Energy stored in drives and friction at states of shape (k, nx), in [J], shape (k,)."""
        if not self._plant.laws or not len(x):
            return np.zeros(len(x))
        return np.array(self._stored(x.T)).ravel()

    def _dynamics(self, p: Array) -> Dynamics:
        return self._present.without_external(p).of_motions()

    def energies(self, x: Array, p: Array) -> Array:
        """Kinetic, potential and stored energy at states.

        Args:
            x: States, shape (k, nx).
            p: Tunable quantities at each, shape (k, np).

        Returns:
            In [J], shape (k, 3).
        """
        q, v, _ = self._split(x)
        parts = [
            np.transpose(self._dynamics(p[run.start]).energy(q[run], v[run]))
            for run in self._present.runs(p)
        ]
        return np.column_stack([np.concatenate([np.zeros((0, 2)), *parts]), self.stored(x)])

    def flows(self, x: Array, after: Array, u: Array, p: Array) -> Array:
        """Work supplied and heat lost in each tick, whatever other ticks there are.

        Args:
            x: States at the beginning of each tick, shape (k, nx).
            after: States at its end, shape (k, nx).
            u: Effective command in each tick, shape (k, n).
            p: Tunable quantities in each tick, shape (k, np).

        Returns:
            Work and heat in [J], shape (k, 2); NaN if a tick cannot be repeated.
        """
        repeat = self._to_repeat(x) | self._to_repeat(after)
        smooth, flows = ~repeat, np.empty((len(u), 2))
        if repeat.any():
            energies = self._integrated_flows(x[repeat], u[repeat], p[repeat]).T
            supplied, lost, friction, external, contacts, impacts = energies
            heat = lost + friction + contacts + impacts
            flows[repeat] = np.stack([supplied + external, heat], axis=1)
        if smooth.any():
            flows[smooth] = self._quadrature(x[smooth], after[smooth], u[smooth], p[smooth])
        return flows

    def _quadrature(self, x: Array, after: Array, u: Array, p: Array) -> Array:
        """See ``flows``, of smooth ticks."""
        pushed = self._plant.parameters.place(EXTERNAL)
        acting = u if pushed is None else u + p[:, pushed]
        displacement = self._split(after)[0] - self._split(x)[0]
        # Exact: the command is constant over its tick
        work = np.sum(acting * displacement, axis=1)
        dt = self.choice.dt
        heat = [
            dissipated_work(self._dynamics(p[run.start]), dt, (x[run], after[run]), u[run])
            for run in self._present.runs(p)
        ]
        return np.stack([work, np.concatenate(heat)], axis=1)

    def contact_losses(self, x: Array, u: Array, p: Array) -> Array:
        """Energy lost in impacts, and in friction of contacts, in each tick, by repeating it.

        In [J], shape (k, 2); arguments as those of ``flows``.
        """
        *_, contacts, impacts = self._integrated_flows(x, u, p).T
        return np.column_stack([impacts, contacts])

    def turnover(self, x: Array, after: Array, p: Array) -> float:
        """Largest kinetic energy that a change of the velocities in one tick moves, in [J].

        An elastic impact within a tick leaves all energies as they were, though it moved them.
        """
        (q, v, _), (_, v_end, _) = self._split(x), self._split(after)
        parts = [
            self._dynamics(p[run.start]).energy(q[run], v_end[run] - v[run])[0]
            for run in self._present.runs(p)
        ]
        return float(np.max(np.concatenate(parts), initial=0.0)) if parts else 0.0

    def _split(self, x: Array) -> list[Array]:
        """q, v and z of states."""
        n = self._plant.model.n
        return np.split(x, (n, 2 * n), axis=1)

    def _integrated_flows(self, x: Array, u: Array, p: Array) -> Array:
        """Energies that flow in each tick in [J], shape (k, 6).

        Those of ``FLOWS``, in their order, and after them the energy lost in impacts.
        """
        begin = np.hstack([x, np.zeros((len(x), len(FLOWS)))])
        after, lost = self._flow_stepper.advance_each(begin, u, p, ticks=1)
        return np.column_stack([after[:, x.shape[1] :], lost])

    @built_once
    def _stored(self) -> ca.Function:
        x, n = ca.SX.sym("x", self._plant.nx), self._plant.model.n
        flow = self._plant.laws.equations(*split(x, n), ca.SX(n, 1))
        return ca.Function("stored", [x], [flow.stored])

    @built_once
    def _flow_stepper(self) -> Stepper:
        return Stepper(self._plant.variant(energies=True), self.choice, self._backend, acted=True)


def relative_error(balance: float, moved: float, size: float) -> float:
    """Unexplained energy relative to the energy that moved.

    Args:
        balance: Unexplained energy in [J].
        moved: Energy that changed its form, was supplied or lost, in [J].
        size: Largest energy in [J]; ``ROUNDING`` of it is treated as rounding, not motion.

    Returns:
        A ratio; infinite where an energy is not finite.
    """
    if not np.isfinite([balance, moved, size]).all():
        return np.inf
    return float(abs(balance) / (moved + ROUNDING * size + np.finfo(float).tiny))


def dissipated_work(
    dynamics: Dynamics, dt: float, states: tuple[Array, Array], tau: Array
) -> Array:
    """Energy lost in friction and dampers in each tick: their power by Simpson's rule.

    Position and velocity in the middle of a tick are those of the cubic through both ends
    (Hermite).

    Args:
        dynamics: The scene's dynamics.
        dt: Length of a tick in [s].
        states: States (q, v) at the beginning and at the end of each tick, each of shape (k, 2n).
        tau: Torque of each tick in [N m] or [N], shape (k, n).

    Returns:
        Energy in [J], shape (k,).
    """
    (q0, v0), (q1, v1) = (np.split(x[:, : 2 * dynamics.n], 2, axis=1) for x in states)
    middle = 0.5 * (q0 + q1) + 0.125 * dt * (v0 - v1)
    speed = 1.5 * (q1 - q0) / dt - 0.25 * (v0 + v1)
    q, v = np.vstack([q0, middle, q1]), np.vstack([v0, speed, v1])
    damping = dynamics.spring(q, v) - dynamics.spring(q)
    torque = dynamics.friction(v, q=q, load=np.tile(tau, (3, 1))) + damping
    first, inner, last = np.sum(torque * v, axis=1).reshape(3, -1)
    return np.asarray(dt * (first + 4.0 * inner + last) / 6.0)
