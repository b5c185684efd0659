# SPDX-License-Identifier: Apache-2.0
"""Moving-horizon estimation of the payload of a Panda, from encoders alone.

Every 50 ms, the payload and the state at the beginning of a window of 200 ms are estimated such
that the motion under the applied torques fits the noisy positions (Rao, Rawlings and Mayne,
"Constrained state estimation for nonlinear discrete-time systems", IEEE TAC 48(2), 2003; the
previous estimate represents the past before the window). Gradients are exact, by
``rollout_gradient``; sixteen of them in one call, at neighbouring points, give the Hessian of
Newton's method.
"""

import time

import numpy as np

from arm_dynamics import load_scene
from arm_dynamics.control import ComputedTorque
from arm_dynamics.trajectory import Waypoint, quintic
from arm_sim import Simulator, State
from arm_sim.figures import figure

NOISE, WINDOW, EVERY = 2e-4, 200, 50  # [rad], ticks, ticks
TAKEN, PUT_DOWN, LOAD = 0.8, 2.0, 1.2  # [s], [s], [kg]

scene = load_scene("panda").model_dump(exclude_unset=True)
scene |= {
    "joints": {"*": {"friction": {"viscous": 0.5}, "limits": {"stop": False}}},
    "payloads": [{"frame": "panda_hand", "mass": 0.0, "com": [0, 0, 0.1]}],
    "initial": {"position": {"panda_joint2": -0.8, "panda_joint4": -2.4, "panda_joint6": 1.6}},
    "tunable": ["payload"],
}
nothing = np.array([0.0, 0.0, 0.0, 0.1, *np.zeros(6)])  # mass, centre of mass, inertia

# The arm moves continuously; it picks up a part and puts it down, unknown to the estimator.
arm = Simulator(scene)
q0 = arm.state.q
turns = [q0 + s * 0.35 * np.array([1, 0.6, -1, 0.8, 1, -0.8, 1]) for s in (0, 1, -1, 1, -1, 0)]
way = quintic([Waypoint(0.56 * k, q) for k, q in enumerate(turns)])
control = ComputedTorque(arm.dynamics)  # with the model of the empty hand


def led(state: State) -> np.ndarray:
    """Torque of the controller; the part is picked up and put down."""
    carried = LOAD if TAKEN <= state.time < PUT_DOWN else 0.0
    arm.set_parameter("payload", nothing + np.eye(10)[0] * carried)
    return control.torque(state, way.sample(state.time))


run = arm.run(2.8, led)
told = run.q + np.random.default_rng(5).normal(0.0, NOISE, run.q.shape)

sim = Simulator(scene)
# Unknowns z = (mass, q, v at the beginning of the window), scaled by their expected changes.
UNIT = np.concatenate([[0.5], np.full(7, 2.0 * NOISE), np.full(7, 0.05)])


def moved(points: np.ndarray, first: int) -> tuple[tuple, dict, np.ndarray]:
    """A rollout's arguments for points z of shape (b, 15), and its deviation from the encoders."""
    z = points * UNIT
    payload = {"payload": nothing + z[:, :1] * np.eye(10)[0]}
    tau = np.tile(run.tau[first : first + WINDOW], (len(z), 1, 1))
    arms = z[:, 1:8], z[:, 8:], tau, WINDOW
    states = sim.rollout(*arms, parameters=payload)
    return arms, payload, states[:, :, :7] - told[first : first + WINDOW + 1]


def misfit(points: np.ndarray, before: np.ndarray, first: int) -> np.ndarray:
    """The cost at points z, shape (b,)."""
    _, _, off = moved(points, first)
    value = (off**2).sum(axis=(1, 2)) / NOISE**2 + ((points - before) ** 2).sum(axis=1)
    return np.nan_to_num(0.5 * value, nan=np.inf)


def slopes(points: np.ndarray, before: np.ndarray, first: int) -> np.ndarray:
    """The gradients of the cost, shape (b, 15)."""
    arms, payload, off = moved(points, first)
    g = np.concatenate([off / NOISE**2, np.zeros(off.shape)], axis=2)
    found = sim.rollout_gradient(*arms, g, parameters=payload)
    by_mass = found.parameters["payload"][:, :1]
    return np.hstack([by_mass, found.q0, found.v0]) * UNIT + (points - before)


def explained(before: np.ndarray, first: int) -> tuple[np.ndarray, float]:
    """The most likely z of a window, and the standard deviation of its mass in [kg]."""
    z, h, sizes = before.copy(), 1e-5, np.append(0.5 ** np.arange(7), 0.0)
    for _ in range(8):
        g = slopes(np.vstack([z, z + h * np.eye(15)]), before, first)
        hessian = (g[1:] - g[0]) / h
        values, vectors = np.linalg.eigh(0.5 * (hessian + hessian.T))
        covariance = (vectors / abs(values)) @ vectors.T  # positive: steps descend
        tried = z - sizes[:, None] * (covariance @ g[0])
        tried[:, 0] = np.maximum(tried[:, 0], 0.0)  # masses are not negative
        best = tried[np.argmin(misfit(tried, before, first))]
        done = abs(best - z).max() < 1e-3
        z = best
        if done:
            break
    return z, float(UNIT[0] * np.sqrt(covariance[0, 0]))


estimates, took = [], []
z = np.concatenate([[0.0], told[0], np.zeros(7)]) / UNIT
for first in range(0, len(run) - 1 - WINDOW + 1, EVERY):
    begin = time.perf_counter()
    z, sigma = explained(z, first)
    took.append(time.perf_counter() - begin)
    estimates.append((run.time[first + WINDOW], z[0] * UNIT[0], sigma))
    now = z * UNIT  # the start of the next window, as estimated by this one
    payload = nothing + now[0] * np.eye(10)[0]
    ahead = sim.rollout(now[None, 1:8], now[None, 8:], run.tau[None, first : first + EVERY],
                        EVERY, parameters={"payload": payload}, last_only=True)  # fmt: skip
    z = np.concatenate([now[:1], ahead[0]]) / UNIT

when, mass, sigma = np.array(estimates).T
late = WINDOW * sim.dt  # from then on, the whole window is after the change
carrying = (when >= TAKEN + late + 0.05) & (when < PUT_DOWN)
empty = (when < TAKEN) | (when >= PUT_DOWN + late + 0.05)
print(f"{1e3 * np.median(took[1:]):.0f} ms a window of {WINDOW} ticks")
print(f"carrying {LOAD} kg: {mass[carrying].mean():.4f} kg, worst off by "
      f"{1e3 * abs(mass[carrying] - LOAD).max():.1f} g; estimated deviation "
      f"{1e3 * sigma[carrying].mean():.1f} g")  # fmt: skip
print(f"empty: at most {1e3 * mass[empty].max():.1f} g")

with figure("payload_estimate", columns=2, size=(7.2, 2.6)) as (left, right):
    left.plot(run.time, LOAD * ((run.time >= TAKEN) & (run.time < PUT_DOWN)), "k:", label="truth")
    left.errorbar(when, mass, 2.0 * sigma, fmt=".-", color="C1", label="estimate, ± 2σ")
    left.set(xlabel="time [s]", ylabel="payload [kg]", title="Payload")
    error = 1e3 * (run.q - np.array([way.sample(t).q for t in run.time]))
    right.plot(run.time, error, label=[f"joint {i + 1}" for i in range(error.shape[1])])
    right.set(xlabel="time [s]", ylabel="tracking error [mrad]", title="Effect of the load")

assert abs(mass[carrying] - LOAD).max() < 0.02 and mass[empty].max() < 0.02
