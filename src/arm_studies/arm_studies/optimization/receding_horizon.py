# SPDX-License-Identifier: Apache-2.0
"""Model predictive control: iLQR over a receding horizon, one iteration per sample.

One iteration a sample suffices, since a trajectory changes little from one sample to the next
(Diehl, Bock and Schlöder, "A real-time iteration scheme for nonlinear optimization in optimal
feedback control", SIAM J. Control and Optimization 43(5), 2005).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from arm_dynamics import ArmModel, Dynamics, InvalidInput
from arm_dynamics.arrays import Array, real_array
from arm_dynamics.attributes import sealed
from arm_dynamics.control.computed_torque import Moving, checked, gain
from arm_dynamics.scene.drive import Actuator
from arm_dynamics.scene.schema import Joint
from arm_dynamics.trajectory.reference import Reference
from arm_sim.simulator import Simulator
from arm_studies.optimization.cost import Expansion
from arm_studies.optimization.ilqr import ILQR, Phase, Trajectory

_FIRST = 10  # iterations for the first plan


@dataclass(frozen=True)
class _Cost:
    """½ Σ eᵀ Q e + ½ Σ dᵀ R d, the last error weighted by F; d is the torque in excess of τ_d."""

    x: Array
    tau: Array
    Q: Array
    F: Array
    R: Array

    def value(self, x: Array, u: Array) -> Array:
        e, d = x - self.x, u - self.tau
        way, last = e[:, :-1], e[:, -1]
        total = (way @ self.Q * way).sum(axis=(1, 2)) + (last @ self.F * last).sum(axis=1)
        return np.asarray(0.5 * (total + (d @ self.R * d).sum(axis=(1, 2))))

    def expansion(self, x: Array, u: Array) -> Expansion:
        nodes, e = len(u), x - self.x
        by_x = e @ self.Q
        by_x[-1] = e[-1] @ self.F
        xx = np.tile(self.Q, (nodes + 1, 1, 1))
        xx[-1] = self.F
        return Expansion(by_x, xx, (u - self.tau) @ self.R, np.tile(self.R, (nodes, 1, 1)))


@sealed
class RecedingHorizon:
    """Optimal torques over a receding horizon, within the arm's limits.

    The cost is ∫ e² + (4ζ² - 2) ė²/ω² + |M⁻¹ (τ - τ_d)|²/ω⁴ dt over the horizon, with τ_d the
    torque of the reference, plus its infinite-horizon value as terminal cost. Far from limits
    every joint's error thus satisfies ë + 2 ζ ω ė + ω² e = 0, as under computed torque (the linear
    quadratic regulator of a double integrator). At limits the arm brakes earlier than under
    computed torque and overshoots less; after a jump from which it cannot brake within the horizon
    it still overshoots. The reference is extrapolated at its acceleration.

    For the controller node and closed loops: ``arm_studies.optimization:RecedingHorizon``.
    """

    def __init__(
        self,
        dynamics: Dynamics,
        dt: float = 1e-3,
        bandwidth: ArrayLike = 20.0,
        damping_ratio: ArrayLike = 1.0,
        limit: ArrayLike = np.inf,
        horizon: float = 0.3,
        nodes: int = 10,
    ) -> None:
        """Compile the model.

        Args:
            dynamics: The model; used from one thread only.
            dt: Time between torques in [s].
            bandwidth: ω in [rad/s], a number or shape (n,), above zero.
            damping_ratio: ζ, a number or shape (n,), at least 0.71.
            limit: Torque limits in [N m] or [N], in addition to the model's.
            horizon: Length of the horizon in [s].
            nodes: Number of torques over the horizon.

        Raises:
            InvalidInput: If a setting is not allowed, or the model's motion is not smooth.
        """
        n = self._n = dynamics.n
        omega, zeta = (gain(*pair, n) for pair in (
            ("bandwidth", bandwidth), ("damping_ratio", damping_ratio)
        ))  # fmt: skip
        if np.any(omega <= 0.0) or np.any(zeta < np.sqrt(0.5)):
            raise InvalidInput(f"bandwidth = {bandwidth!r}, damping_ratio = {damping_ratio!r}; "
                               "allowed: numbers above 0, and of at least 0.71")  # fmt: skip
        self._dynamics, self._omega = dynamics, omega
        self._node = horizon / nodes
        self._share = dt / self._node  # fraction of a node that passes between two torques
        self._times = self._node * np.arange(nodes + 1)[:, None]
        self._Q, self._F = _weights(omega, zeta, self._node)
        arm = _smooth_arm(dynamics.model, self._node)
        most = np.minimum(real_array("limit", limit), dynamics.model.effort_limit)
        start = Reference(dynamics.model.q0, np.zeros(n), np.zeros(n))
        self._cost = self._cost_of(start.q, start)
        self._optimizer = ILQR([Phase(arm, nodes)], self._cost, low=-most, high=most, threads=1)
        self._best: Trajectory | None = None
        self._begin(np.concatenate([start.q, start.v]))  # compiles

    def restart(self) -> None:
        """Discard the plan."""
        self._best = None

    def torque(self, state: Moving, reference: Reference) -> Array:
        """Return joint torques in [N m] or [N], shape (n,), within limits."""
        q, v = checked(state, self._n, reference)
        x, optimizer = np.concatenate([q, v]), self._optimizer
        optimizer.cost = self._cost = self._cost_of(q, reference)
        if self._best is None:
            self._best = self._begin(x)
        else:
            u = self._best.u
            later = self._share * np.diff(u, axis=0, append=u[-1:])
            self._best = optimizer.improve(optimizer.moved(self._best, x, later))
        torque: Array = self._best.u[0].copy()
        return torque

    def _begin(self, x: Array) -> Trajectory:
        """The first plan."""
        return self._optimizer.solve(x, self._cost.tau, _FIRST)

    def _cost_of(self, q: Array, reference: Reference) -> _Cost:
        """Cost of the horizon that begins here."""
        t, a = self._times, np.tile(reference.a, (len(self._times), 1))
        places = reference.q + t * (reference.v + 0.5 * t * a)
        speeds = reference.v + t * a
        tau = self._dynamics.inverse(places[:-1], speeds[:-1], a[:-1])
        M = np.linalg.inv(self._dynamics.mass_matrix(q)) / self._omega[:, None] ** 2
        desired = np.hstack([places, speeds])
        return _Cost(desired, tau, self._Q, self._F, self._node * M.T @ M)


def _weights(omega: Array, zeta: Array, dt: float) -> tuple[Array, Array]:
    """Weights of errors (e, ė) in a node of length dt, and at the end of the horizon."""
    Q = dt * np.diag(np.concatenate([np.ones(omega.shape), (4.0 * zeta**2 - 2.0) / omega**2]))
    both = np.diag(1.0 / omega**2)
    by_place, by_speed = np.diag(2.0 * zeta / omega), np.diag(2.0 * zeta / omega**3)
    return Q, np.block([[by_place, both], [both, by_speed]])


def _smooth_arm(model: ArmModel, dt: float) -> Simulator:
    """The arm driven by joint torques, without stops.

    Raises:
        InvalidInput: If its motion has events, or internal states that are not measured.
    """
    joints = {
        name: joint.model_copy(update={
            "actuator": joint.actuator and _rotor(joint.actuator),
            "limits": joint.limits.model_copy(update={"stop": False}),
        })
        for name, joint in {"*": Joint(), **model.scene.joints}.items()
    }  # fmt: skip
    scene = model.scene.model_copy(
        update={"joints": joints, "sensors": None, "commands": None, "tunable": ()}
    )
    simulator = Simulator(scene, integrator="rk4", dt=dt)
    plant = simulator.arm.plant
    if plant.eventful or plant.nz:
        what = "contacts" if plant.points else "dry friction or internal states"
        raise InvalidInput(
            f"the model has {what}, but a receding horizon requires smooth motion; give the "
            "controller a scene without it"
        )
    return simulator


def _rotor(motor: Actuator) -> Actuator:
    """Properties of a motor that remain where the joint's torque is the command."""
    return Actuator(
        rotor_inertia=motor.rotor_inertia, rotor_damping=motor.rotor_damping,
        gear_ratio=motor.gear_ratio, efficiency=motor.efficiency,
    )  # fmt: skip
