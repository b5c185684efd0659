# SPDX-License-Identifier: Apache-2.0
"""The torques of a motion, term by term: inertia, Coriolis, gravity, friction."""

import numpy as np

from arm_dynamics import Dynamics, Term, load_scene
from arm_sim.figures import figure

scene = load_scene({
    "robot": {
        "urdf": "package://example-robot-data/robots/panda_description/urdf/panda.urdf",
        "lock": ["panda_finger_joint1", "panda_finger_joint2"],
    }
})  # fmt: skip
dynamics = Dynamics(scene)

q = np.array([0.0, -0.8, 0.0, -2.4, 0.0, 1.6, 0.8])  # [rad]
v = np.full(dynamics.n, 1.0)  # [rad/s]
a = np.full(dynamics.n, 2.0)  # [rad/s²]

terms = {term.name: dynamics.inverse(q, v, a, terms=term) for term in Term}
total = dynamics.inverse(q, v, a)

print("torques in N m" + " " * 6 + "".join(f"{name:>12}" for name in [*terms, "ALL"]))
for i, joint in enumerate(dynamics.joint_names):
    print(f"{joint:<20}" + "".join(f"{tau[i]:12.4f}" for tau in [*terms.values(), total]))

# Forward dynamics is the inverse: these torques produce that acceleration.
np.testing.assert_allclose(dynamics.forward(q, v, total), a, atol=1e-9)

# Batches: the torques that hold the arm in a thousand postures, in one call.
lower, upper = dynamics.model.position_lower, dynamics.model.position_upper
postures = np.random.default_rng(0).uniform(lower, upper, (1000, dynamics.n))
worst = np.abs(dynamics.gravity(postures)).max(axis=0)
print("\nlargest holding torques in 1000 postures [N m]:", np.round(worst, 2))

with figure("torques", size=(7.2, 3.6)) as axis:
    places, joints = np.arange(dynamics.n), [f"joint {i + 1}" for i in range(dynamics.n)]
    acting = {name: tau for name, tau in terms.items() if abs(tau).max() > 0.01}
    for k, (name, tau) in enumerate(acting.items()):
        axis.bar(places + 0.15 * (k - 1), tau, 0.14, label=name.capitalize())
    axis.plot(places, total, "k_", markersize=26, label="Sum")
    axis.set(ylabel="torque [N m]", title="Torques of a Panda by term")
    axis.set_xticks(places, joints)
    axis.legend(ncols=2, markerscale=0.5)
