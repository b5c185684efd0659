# SPDX-License-Identifier: Apache-2.0
"""A user-defined controller with springs of limited force: in a run, a closed loop, and the node.

The force of a joint's spring is limited, however far the goal is: PD with gravity compensation and
a bounded proportional term (Kelly, Santibanez and Loria, "Control of Robot Manipulators in Joint
Space", 2005, chapter 11). In the controller node, with this file's folder on PYTHONPATH:

    ./arm controller panda --ros-args -p controller:=my_module:Gentle
"""

import numpy as np

from arm_dynamics import Dynamics
from arm_dynamics.control import Settings, tuned
from arm_dynamics.trajectory import Waypoint, hold
from arm_sim import ClosedLoop, Simulator
from arm_sim.figures import figure

SHARE = 0.1  # largest spring torque, as a fraction of the effort limit


class Gentle:
    """τ = G(q) + F tanh(K e / F) + D ė, with F the largest torque of the spring."""

    def __init__(self, dynamics: Dynamics, bandwidth: float = 10.0) -> None:
        """Arguments are passed by name, such as the model, ``dt`` or ``bandwidth``."""
        self._dynamics = dynamics
        self._stiffness, self._damping = tuned(dynamics, bandwidth)
        self._most = SHARE * dynamics.model.effort_limit

    def torque(self, state, reference):
        """Joint torques [N m], shape (n,), held until the next tick."""
        pull = self._stiffness * (reference.q - state.q)
        pull = self._most * np.tanh(pull / self._most)
        brake = self._damping * (reference.v - state.v)
        return self._dynamics.gravity(state.q) + pull + brake


sim = Simulator("panda")
goal = sim.state.q + [1.0, 0.6, -0.8, 0.7, 0.5, 0.6, -1.0]
control = Gentle(sim.dynamics)
motion = sim.run(6.0, control, reference=hold(goal))  # the goal steps, the torque stays bounded
print(f"in a run: {abs(motion.q[-1] - goal).max():.1e} rad from the goal")
print(
    f"largest fraction of an effort limit: {(abs(motion.tau) / sim.model.effort_limit).max():.2f}"
)
assert abs(motion.q[-1] - goal).max() < 1e-3

pair = ClosedLoop("panda", Gentle, Settings(bandwidth=30.0))
pair.follow([Waypoint(2.0, goal)])
led = pair.run(3.0)
print(f"along a trajectory: {abs(led.q[-1] - goal).max():.1e} rad from the goal")
assert abs(led.q[-1] - goal).max() < 1e-3

with figure("own_controller", columns=2) as (left, right):
    left.plot(motion.time, motion.q - goal, label=[f"joint {i + 1}" for i in range(sim.n)])
    left.set(xlabel="time [s]", ylabel="distance from the goal [rad]", title="Step of the goal")
    right.plot(motion.time, motion.tau / sim.model.effort_limit)
    right.set(
        xlabel="time [s]", ylabel="fraction of the effort limit", title="The torque is bounded"
    )
