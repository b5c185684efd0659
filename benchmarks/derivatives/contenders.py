# SPDX-License-Identifier: Apache-2.0
"""What is timed: derivatives of an RK4 tick of 1 ms of one arm, for one state a call or many."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin

from arm_sim import Simulator
from benchmarks.robots.models import Robot

DT, MANY, TICKS = 1e-3, 256, 1000
EPSILON = 1e-6  # of finite differences, as usual with MuJoCo
Contender = tuple[Callable[[], object], int]
"""A call, and how many derivatives (or ticks of a gradient) it computes."""


class Arm:
    """The arm, and random states near the middle of its joint ranges, in which all joints move."""

    def __init__(self, robot: Robot, friction: float = 0.0) -> None:
        """Take a robot, and the dry friction of its joints in [N m]."""
        self.robot, self.n, self._friction = robot, robot.n, friction
        rng = np.random.default_rng(0)
        scene = {"robot": {"urdf": robot.urdf}, "joints": {"*": {
            "friction": {"viscous": 0.0, "coulomb": friction},
            "limits": {"stop": False, "effort": None},
        }}}  # fmt: skip
        self.sim = Simulator(scene, integrator="rk4", dt=DT)
        self.q = rng.uniform(-1.0, 1.0, (MANY, self.n))
        self.v, self.tau = rng.normal(size=(2, MANY, self.n))

    def ours(self) -> dict[str, Contender]:
        """Calls of this suite on one core: states one at a time, in SIMD lanes, one a call."""
        sim, batch = self.sim, (self.q, self.v, self.tau)
        state = sim.reset(self.q[0], self.v[0])
        return {
            "linearize_many, one state at a time": (
                lambda: sim.linearize_many(*batch, lanes=1, threads=1),
                MANY,
            ),
            "linearize_many, in SIMD lanes": (lambda: sim.linearize_many(*batch, threads=1), MANY),
            "linearize, one call from Python": (lambda: sim.linearize(state, self.tau[0]), 1),
        }

    def gradients(self) -> dict[str, Contender]:
        """A rollout of many ticks and its gradient with respect to all torques, on one core."""
        sim, arms = self.sim, 8
        q, v = np.tile(self.q[:1], (arms, 1)), np.zeros((arms, self.n))
        tau = np.tile(sim.dynamics.gravity(self.q[0]), (arms, TICKS, 1))
        g = np.random.default_rng(1).normal(size=(arms, TICKS + 1, 2 * self.n))
        found: dict[str, Contender] = {}
        for name, lanes in (("", 1), (", in SIMD lanes", 8)):
            found |= {
                f"rollout, a tick{name}": (
                    lambda k=lanes: sim.rollout(q, v, tau, TICKS, lanes=k, threads=1),
                    arms * TICKS,
                ),
                f"rollout_gradient, a tick{name}": (
                    lambda k=lanes: sim.rollout_gradient(q, v, tau, TICKS, g, lanes=k, threads=1),
                    arms * TICKS,
                ),
            }
        return found

    def pinocchio(self) -> dict[str, Contender]:
        """Derivatives of forward dynamics, and the same call for one joint, for its overhead."""
        model, data = self.robot.pin, self.robot.pin.createData()
        small = pin.Model()
        body = small.addJoint(0, pin.JointModelRX(), pin.SE3.Identity(), "joint")
        small.appendBodyToJoint(body, pin.Inertia.Random(), pin.SE3.Identity())
        spare, one = small.createData(), np.zeros(1)
        q, v, tau = self.q[0], self.v[0], self.tau[0]
        return {
            "Pinocchio, computeABADerivatives": (
                lambda: pin.computeABADerivatives(model, data, q, v, tau), 1
            ),
            "Pinocchio, the same call for one joint": (
                lambda: pin.computeABADerivatives(small, spare, one, one, one), 1
            ),
        }  # fmt: skip

    def mujoco(self) -> dict[str, Contender]:
        """Finite differences: 3n + 1 steps, and ``mjd_transitionFD``, which does not support RK4.

        Nothing if it is not installed.
        """
        try:
            import mujoco

            from benchmarks.peers.mujoco import compile_model
        except ImportError:
            return {}
        model, euler = (compile_model(self.robot, method, DT) for method in ("RK4", "Euler"))
        for made in (model, euler):
            made.dof_frictionloss[:] = self._friction
        data, other = mujoco.MjData(model), mujoco.MjData(euler)
        for place in (data, other):
            place.qpos[:], place.qvel[:] = self.q[0], self.v[0]
        A = np.zeros((2 * self.n, 2 * self.n))
        steps = 3 * self.n + 1
        return {
            "MuJoCo, 3n + 1 RK4 steps": (lambda: mujoco.mj_step(model, data, nstep=steps), 1),
            "MuJoCo, mjd_transitionFD of Euler's step": (
                lambda: mujoco.mjd_transitionFD(euler, other, EPSILON, 0, A, None, None, None), 1
            ),
        }  # fmt: skip

    def errors(self) -> dict[str, float]:
        """Largest error of A over its largest entry, against eighth-order differences."""
        sim, x = self.sim, np.r_[self.q[0], self.v[0]]
        weights = np.array([4 / 5, -1 / 5, 4 / 105, -1 / 280])

        def after(rows: np.ndarray) -> np.ndarray:
            q, v = np.split(rows, 2, axis=1)
            return sim.rollout(q, v, self.tau[0], 1, last_only=True)

        def sides(h: float, k: int) -> np.ndarray:
            step = k * h * np.eye(len(x))
            return (after(x + step) - after(x - step)).T / h

        true = sum(w * sides(2e-3, k) for k, w in enumerate(weights, 1))
        forward = (after(x + EPSILON * np.eye(len(x))) - after(x[None])).T / EPSILON
        ours = sim.linearize(sim.reset(*np.split(x, 2)), self.tau[0])[0]
        size = np.abs(true).max()
        return {
            "linearize": float(np.abs(ours - true).max() / size),
            f"forward differences of {EPSILON:g}": float(np.abs(forward - true).max() / size),
        }
