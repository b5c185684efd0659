# SPDX-License-Identifier: Apache-2.0
"""What is timed: derivatives of an RK4 tick of 1 ms of one arm, for one state a call or many."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin

from arm_sim import Simulator
from benchmarks.robots.models import Robot

DT, MANY, TICKS = 1e-3, 256, 1000
TIP, POINT = "link7", [0, 0, 0.21]
"""The fingertip: a link, and a point in its frame."""
EPSILON = 1e-6  # of finite differences, as usual with MuJoCo
Contender = tuple[Callable[[], object], int]
"""A call, and how many derivatives (or ticks of a gradient) it computes."""


class Arm:
    """The arm, and random states near the middle of its joint ranges."""

    def __init__(self, robot: Robot) -> None:
        self.robot, self.n = robot, robot.n
        rng = np.random.default_rng(0)
        scene = {"robot": {"urdf": robot.urdf}, "joints": {"*": {
            "friction": {"viscous": 0.0, "coulomb": 0.0},
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
        one = {"lanes": 1, "threads": 1}
        return {
            "rollout, a tick": (lambda: sim.rollout(q, v, tau, TICKS, **one), arms * TICKS),
            "rollout_gradient, a tick": (
                lambda: sim.rollout_gradient(q, v, tau, TICKS, g, **one), arms * TICKS
            ),
        }  # fmt: skip

    def rough(self) -> dict[str, Contender]:
        """The same arm with dry friction in all joints, in motion; above a table, and on it."""
        rng = np.random.default_rng(2)
        q, v = self.q, np.sign(self.v) * rng.uniform(0.5, 1.5, self.v.shape)
        dry, above = self._with({"friction": {"coulomb": 1.0}}), self._with({}, table=-3.0)
        tau = dry.dynamics.inverse(q, v, 0.0 * q)  # no joint comes to rest
        arms, ticks = 8, TICKS // 5
        way = q[0] + DT * np.arange(ticks)[:, None] * v[0]
        along = dry.dynamics.inverse(way, np.tile(v[0], (ticks, 1)), 0.0 * way)
        start = (
            np.tile(q[:1], (arms, 1)),
            np.tile(v[:1], (arms, 1)),
            np.tile(along, (arms, 1, 1)),
            ticks,
        )
        g = rng.normal(size=(arms, ticks + 1, 2 * self.n))
        one = {"lanes": 1, "threads": 1}
        contenders: dict[str, Contender] = {
            "linearize_many, dry friction": (lambda: dry.linearize_many(q, v, tau, **one), MANY),
            "linearize_many, above a table": (
                lambda: above.linearize_many(q, v, self.tau, **one), MANY
            ),
            "rollout, a tick, dry friction": (lambda: dry.rollout(*start, **one), arms * ticks),
            "rollout_gradient, a tick, dry friction": (
                lambda: dry.rollout_gradient(*start, g, **one), arms * ticks
            ),
        }  # fmt: skip
        return contenders | self._pressed(self._with({}, table=0.4735))

    def eventful(self) -> dict[str, Contender]:
        """Ticks with an event, one a call, and a motion in which all joints reverse repeatedly."""
        bent = np.array([0.0, -0.8, 0.0, -2.4, 0.0, 1.6, 0.8])
        dry = self._with({"friction": {"coulomb": 0.05, "viscous": 0.5}})
        time, rate = DT * np.arange(TICKS)[:, None], np.linspace(10.0, 15.0, self.n)
        swing = 0.25 * np.array([np.sin(rate * time), rate * np.cos(rate * time)])
        tau = dry.dynamics.inverse(bent + swing[0], swing[1], -(rate**2) * swing[0])
        start = bent[None], swing[1, :1], tau[None], TICKS
        g = np.random.default_rng(3).normal(size=(1, TICKS + 1, 2 * self.n))
        one = {"lanes": 1, "threads": 1}
        contenders: dict[str, Contender] = {
            "rollout, a tick, reversing": (lambda: dry.rollout(*start, **one), TICKS),
            "rollout_gradient, a tick, reversing": (
                lambda: dry.rollout_gradient(*start, g, **one), TICKS
            ),
        }  # fmt: skip
        motion = dry.rollout(*start, **one)[0]
        turn = int((np.diff(np.sign(motion[:, self.n :]), axis=0) != 0).any(axis=1).argmax())
        stop = {"limits": {"lower": -2.8, "upper": 2.8, "stop": {"restitution": 0.2}}}
        high = (self.sim.dynamics.pose(bent, TIP) @ [*POINT, 1.0])[2]
        down, still = 0.3 * np.eye(self.n)[1], np.zeros(self.n)
        near = np.where(down > 0.0, 2.8 - 1e-4, bent)
        for what, sim, place, push in (
            ("a joint reverses", dry, motion[turn], tau[turn]),
            ("a joint meets its stop", self._with(stop), np.r_[near, down], still),
            ("the fingertip lands", self._with({}, table=high - 3e-5), np.r_[bent, down], still),
        ):
            state = sim.reset(*np.split(place, 2))
            contenders[f"linearize, {what}, one call from Python"] = (
                lambda sim=sim, state=state, push=push: sim.linearize(state, push), 1
            )  # fmt: skip
        return contenders

    def _with(self, joint: dict[str, Any], table: float | None = None) -> Simulator:
        """The arm with more on all joints, and a table below the flange's point."""
        joints = {"friction": {"viscous": 0.0, "coulomb": 0.0}, "limits": {"stop": False}} | joint
        scene: dict[str, Any] = {"robot": {"urdf": self.robot.urdf}, "joints": {"*": joints}}
        if table is not None:
            plane = {"point": [0, 0, table], "normal": [0, 0, 1]}
            scene["constraints"] = [{
                "type": "contact", "name": "tip", "frame": TIP, "point": POINT,
                "plane": plane, "friction": 0.4,
            }]  # fmt: skip
            bent = zip(self.sim.joint_names, (0.0, -0.8, 0.0, -2.4, 0.0, 1.6, 0.8), strict=True)
            scene["initial"] = {"position": dict(bent)}
        return Simulator(scene, integrator="rk4", dt=DT)

    def _pressed(self, sim: Simulator) -> dict[str, Contender]:
        """A fingertip pressed on the table, at rest in friction or sliding."""
        contenders = dict[str, Contender]()
        turn = sim.dynamics.pose(sim.model.q0, TIP)[:3, :3]
        linear, angular = np.split(sim.dynamics.jacobian(sim.model.q0, TIP), 2)
        J = linear + np.cross(angular.T, turn @ POINT).T
        for what, force in (("sticking", [1.0, 0.0, -20.0]), ("sliding", [0.0, 15.0, -30.0])):
            sim.reset()
            tau = sim.dynamics.gravity(sim.model.q0) + J.T @ np.array(force)
            sim.run(0.05, tau)
            if sim.contact_forces()[0].state != ("sticks" if what == "sticking" else "slides"):
                raise RuntimeError(f"the fingertip is not {what}")
            state = sim.state
            many = [np.tile(row, (MANY, 1)) for row in (state.q, state.v, tau)]
            contenders[f"linearize_many, {what} on the table"] = (
                lambda many=many: sim.linearize_many(*many, lanes=1, threads=1), MANY
            )  # fmt: skip
        return contenders

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
        """``mjd_transitionFD``, which does not support RK4; nothing if it is not installed."""
        try:
            import mujoco

            from benchmarks.peers.mujoco import compile_model
        except ImportError:
            return {}
        euler, dry = (compile_model(self.robot, "Euler", DT) for _ in range(2))
        dry.dof_frictionloss[:] = 1.0
        dry.opt.disableflags = mujoco.mjtDisableBit.mjDSBL_CONTACT
        other, rough = mujoco.MjData(euler), mujoco.MjData(dry)
        for place in (other, rough):
            place.qpos[:], place.qvel[:] = self.q[0], self.v[0]
        A = np.zeros((2 * self.n, 2 * self.n))
        return {
            "MuJoCo, mjd_transitionFD of Euler's step": (
                lambda: mujoco.mjd_transitionFD(euler, other, EPSILON, 0, A, None, None, None), 1
            ),
            "MuJoCo, mjd_transitionFD with friction loss": (
                lambda: mujoco.mjd_transitionFD(dry, rough, EPSILON, 0, A, None, None, None), 1
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
