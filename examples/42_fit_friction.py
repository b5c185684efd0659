# SPDX-License-Identifier: Apache-2.0
"""Friction of a Panda, estimated from a whole trajectory by Newton's method.

No accelerations are estimated and nothing is filtered: the simulated motion under the recorded
torques is compared with noisy positions, and ``rollout_gradient`` gives the derivatives of the
misfit by the friction of each joint. Differences of gradients at neighbouring points, all in one
call, give the Hessian, whose inverse is the covariance of the estimate (Ljung, System
Identification, 1999, section 9.4).
"""

import numpy as np

from arm_dynamics import load_scene
from arm_dynamics.control import ComputedTorque
from arm_dynamics.trajectory import Waypoint, quintic
from arm_sim import Simulator
from arm_sim.figures import figure

NOISE = 2e-4  # [rad]
rng = np.random.default_rng(3)
scene = load_scene("panda").model_dump(exclude_unset=True)
scene |= {
    # The nominal values in [N m s/rad]; without stops, which would be events.
    "joints": {"*": {"friction": {"viscous": 0.5}, "limits": {"stop": False}}},
    "initial": {"position": {"panda_joint2": -0.8, "panda_joint4": -2.4, "panda_joint6": 1.6}},
    "tunable": ["friction"],
}
truth = rng.uniform(0.2, 1.2, 7)

# The recording: the true arm, controlled with the nominal model.
arm = Simulator(scene)
believed = arm.dynamics
arm.set_parameter("friction", truth)
q0 = arm.state.q
way = quintic([Waypoint(0.0, q0), Waypoint(0.4, q0 + 0.3), Waypoint(0.8, q0 - 0.2)])
recorded = arm.run(0.8, ComputedTorque(believed), way)
told = recorded.q + rng.normal(0.0, NOISE, recorded.q.shape)  # measured by the encoders
tau, ticks = recorded.tau[:-1], len(recorded) - 1

sim = Simulator(scene)  # the nominal arm


def slopes(points: np.ndarray) -> tuple[float, np.ndarray]:
    """Misfit at the first point, and its gradients at all, by the logarithm of the friction."""
    d, b = np.exp(points), len(points)
    start, rest, torques = np.tile(q0, (b, 1)), np.zeros((b, 7)), np.tile(tau, (b, 1, 1))
    states = sim.rollout(start, rest, torques, ticks, parameters={"friction": d})
    g = np.zeros(states.shape)
    g[:, :, :7] = (states[:, :, :7] - told) / NOISE**2
    found = sim.rollout_gradient(start, rest, torques, ticks, g, parameters={"friction": d})
    misfit = 0.5 * float(np.sum(g[0, :, :7] ** 2)) * NOISE**2
    return misfit, found.parameters["friction"] * d


z, h, errors = np.log(np.full(7, 0.5)), 1e-5, []
for _ in range(20):
    misfit, g = slopes(np.vstack([z, z + h * np.eye(7)]))
    hessian = (g[1:] - g[0]) / h
    hessian = 0.5 * (hessian + hessian.T)
    values, vectors = np.linalg.eigh(hessian)  # made positive, so that each step descends
    step = -vectors @ ((vectors.T @ g[0]) / np.maximum(abs(values), 1e-7 * values.max()))
    errors.append(abs(np.exp(z) - truth))
    rms = np.sqrt(2.0 * misfit / told.size)
    print(f"misfit {rms:9.3f} times the noise, worst joint off by {errors[-1].max():.1e}")
    z = z + step / max(1.0, abs(step).max())
    if abs(step).max() < 1e-6:
        break

found, deviation = np.exp(z), np.exp(z) * np.sqrt(np.diag(np.linalg.inv(hessian)))
for name, true, value, sigma in zip(sim.joint_names, truth, found, deviation, strict=True):
    print(f"{name}: {value:.5f} ± {sigma:.5f}, true value {true:.5f} N m s/rad")

with figure("fit_friction", columns=2, size=(7.2, 2.6)) as (left, right):
    left.semilogy(np.array(errors), ".-")
    left.set(xlabel="step of Newton's method", ylabel="error [N m s/rad]",
             title="Friction of seven joints")  # fmt: skip
    joints = np.arange(1, 8)
    right.bar(joints, truth, color="0.85", label="truth")
    right.errorbar(joints, found, 2.0 * deviation, fmt=".", color="C1", label="estimate, ± 2σ")
    right.axhline(0.5, color="0.5", linewidth=0.8, label="nominal")
    right.set(xlabel="joint", ylabel="viscous friction [N m s/rad]")
    right.legend()

assert np.all(abs(found - truth) < 4.0 * deviation), "the truth lies within what is claimed"
assert deviation.max() < 1e-3 and abs(rms - 1.0) < 0.05
