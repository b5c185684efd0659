# SPDX-License-Identifier: Apache-2.0
"""A Panda picks up a part and places it on the other side in one second, with minimal currents.

iLQR (``arm_studies.optimization``) finds motor currents for 100 nodes of 10 ms. Rotors, friction,
stops and current limits are in the model, and so is the part, from the grasp on: the arm of the
second phase differs from that of the first. From an arm at rest, which dry friction holds, smooth
derivatives find the motion; exact ones, across its stops and starts, then improve it. The result
includes a feedback policy, which also moves an arm that carries a different part than planned.
"""

import time

import numpy as np

from arm_dynamics import load_scene
from arm_dynamics.task_space import TaskSpace
from arm_sim import Simulator
from arm_sim.figures import figure
from arm_studies.optimization import ILQR, Expansion, Phase, QuadraticCost

NODES, GRASP, DT = 100, 45, 0.01
PART = 1.5  # [kg]
DRY = {"viscous": 0.5, "coulomb": 0.8}
LARGE = {"command": "current", "torque_constant": 0.1, "gear_ratio": 100, "rotor_inertia": 4e-5,
         "rotor_damping": 2e-5}  # fmt: skip
SMALL = LARGE | {"rotor_inertia": 5e-6, "rotor_damping": 1e-5}


def arm(part: float, dt: float = DT) -> Simulator:
    """The Panda with its motors and a payload in [kg]."""
    scene = load_scene("panda").model_dump(exclude_unset=True)
    scene["joints"] = {
        f"panda_joint{i}": {"actuator": LARGE if i < 5 else SMALL, "friction": DRY}
        for i in range(1, 8)
    }
    scene["payloads"] = [{"frame": "panda_hand", "mass": part, "com": [0, 0, 0.1]}]
    return Simulator(scene, integrator="rk4", dt=dt)


empty, loaded = arm(0.0), arm(PART)
n, start = empty.n, empty.arm.x.copy()
hand = TaskSpace(empty.dynamics, "panda_hand")
home = hand.pose(start[:n]).position
pick, place = home + [0.12, -0.12, -0.17], home + [0.12, 0.13, -0.17]
LIFT = np.array([0.0, 0.0, 0.08])
# Positions of the hand at certain nodes; between them it is only attracted.
STATIONS = {36: (pick + LIFT, 2e3), GRASP: (pick, 5e4), 55: (pick + LIFT, 2e3),
            88: (place + LIFT, 2e3), NODES: (place, 5e4)}  # fmt: skip
nodes = np.array(list(STATIONS))
places = np.array([place for place, _ in STATIONS.values()])
weights = np.array([weight for _, weight in STATIONS.values()])
DOWN, UPRIGHT = np.array([0.0, 0.0, -1.0]), 0.1  # direction of the hand, and its weight


class PickAndPlace:
    """Squared currents and speeds, and the distance of the hand from its stations."""

    def __init__(self) -> None:
        """At rest where the part is picked up or put down."""
        x_weight = np.hstack([np.full((NODES + 1, n), 1e-3), np.full((NODES + 1, n), 2e-2)])
        x_weight[[GRASP, NODES], n:] = 1e2
        self.way = QuadraticCost(
            np.tile(start, (NODES + 1, 1)),
            x_weight,
            np.zeros((NODES, n)),
            np.full((NODES, n), 1e-3),
        )

    def off(self, x: np.ndarray) -> np.ndarray:
        """Weighted errors of the hand at its stations, shape (stations, 6)."""
        pose = hand.pose(x[nodes, :n])
        tilt = UPRIGHT * (pose.rotation[:, :, 2] - DOWN)
        return np.sqrt(weights)[:, None] * np.hstack([pose.position - places, tilt])

    def value(self, x: np.ndarray, u: np.ndarray) -> np.ndarray:
        """Cost of trajectories side by side."""
        at_stations = [0.5 * np.sum(self.off(np.nan_to_num(one)) ** 2) for one in x]
        return self.way.value(x, u) + at_stations

    def expansion(self, x: np.ndarray, u: np.ndarray) -> Expansion:
        """Cost of one trajectory, with the Gauss-Newton Hessian."""
        way, error = self.way.expansion(x, u), self.off(x)
        axes, J = hand.pose(x[nodes, :n]).rotation[:, :, 2], hand.jacobian(x[nodes, :n])
        for k, node in enumerate(nodes):
            turned = np.cross(J[k, 3:], axes[k], axis=0)  # ω × axis
            slope = np.sqrt(weights[k]) * np.vstack([J[k, :3], UPRIGHT * turned])
            way.x[node, :n] += slope.T @ error[k]
            way.xx[node, :n, :n] += slope.T @ slope
        return way


def held(sim: Simulator) -> np.ndarray:
    """Currents that hold the arm at the start."""
    still = np.zeros(n)
    return sim.dynamics.command_map(start[:n], still, sim.dynamics.gravity(start[:n]))


phases = [Phase(empty, GRASP), Phase(loaded, NODES - GRASP)]
smooth = ILQR(phases, PickAndPlace(), tolerance=1e-4, smoothing=0.1)
exact = ILQR(phases, PickAndPlace(), tolerance=1e-4)
guess = np.vstack([np.tile(held(empty), (GRASP, 1)), np.tile(held(loaded), (NODES - GRASP, 1))])
best = smooth.solve(start, guess, iterations=1)  # compiles
best, costs = exact.solve(start, best.u, iterations=1), list[float]()
for optimizer, what in ((smooth, "smooth"), (exact, "exact")):
    begin = time.perf_counter()
    best = optimizer.solve(start, best.u if costs else guess, iterations=200)
    took, rounds = time.perf_counter() - begin, len(best.costs) - 1
    print(
        f"{what} slopes: {best.verdict} after {rounds} improvements of "
        f"{1e3 * took / rounds:.1f} ms, cost {best.costs[0]:.1f} -> {best.cost:.4f}"
    )
    costs += best.costs


def driven(part: float, gain: float) -> np.ndarray:
    """States at the nodes when the arm with a payload in [kg] is driven at 1 kHz."""
    arms = arm(0.0, 1e-3), arm(part, 1e-3)
    x = best.x.copy()
    for node in range(NODES):
        u = best.u[node] + gain * best.feedback[node] @ (x[node] - best.x[node])
        sim = arms[node >= GRASP]
        now = x[node][None]
        x[node + 1] = sim.rollout(now[:, :n], now[:, n:], u, 10, last_only=True)[0]
    return x


def missed(x: np.ndarray) -> float:
    """Distance of the part from its goal when it is put down, in [mm]."""
    return 1e3 * float(np.linalg.norm(hand.pose(x[-1, :n]).position - place))


plain, heavy, led = driven(PART, 0.0), driven(1.2 * PART, 0.0), driven(1.2 * PART, 1.0)
limit, speed = empty.model.command_limit, abs(best.x[:, n:]) / empty.model.velocity_limit
share = abs(best.u) / limit
print(
    f"planned: {missed(best.x):.2f} mm off at the end, {abs(best.x[-1, n:]).max():.1e} rad/s left"
)
print(f"executed at 1 kHz: {missed(plain):.2f} mm off")
print(f"a part that weighs 20 % more: {missed(heavy):.1f} mm off, with the plan's feedback "
      f"{missed(led):.1f} mm")  # fmt: skip
print(f"largest fraction of a limit: current {share.max():.2f}, speed {speed.max():.2f}")

path, heavier = (hand.pose(x[:, :n]).position for x in (best.x, led))
t = DT * np.arange(NODES + 1)
with figure("pick_and_place", rows=2, columns=2, size=(7.2, 5.0)) as (
    (side, up),
    (currents, axis),
):
    side.plot(path[:, 1], path[:, 2])
    side.plot(*places[:, 1:].T, "o", color="C3", label="stations")
    side.set(xlabel="y [m]", ylabel="z [m]", title="Path of the hand, seen from the front")
    side.axis("equal")
    up.plot(t, best.x[:, n:], label=[f"joint {i + 1}" for i in range(n)])
    up.axvline(GRASP * DT, color="0.6", linestyle=":")
    up.set(xlabel="time [s]", ylabel="speed [rad/s]", title="Joints; dotted: the grasp")
    currents.step(t[:-1], best.u / limit, where="post")
    currents.set(xlabel="time [s]", ylabel="fraction of the limit", title="Motor currents")
    axis.semilogy(costs, ".-")
    axis.set(xlabel="improvement", ylabel="cost", title="iLQR")

assert missed(best.x) < 2.0 and missed(plain) < 5.0 and abs(best.x[-1, n:]).max() < 0.05
assert share.max() <= 1.0 and missed(led) < 0.5 * missed(heavy)
