# SPDX-License-Identifier: Apache-2.0
"""Drawing a line on a table: motion along the table and a force on it, controlled separately.

The table is a contact of the scene. Friction missing from the controller's model makes the pen lag
behind; if it is known, it is fed forward as a force that the arm exerts on the table.
"""

from dataclasses import replace
from importlib.resources import files

import numpy as np

from arm_dynamics import Dynamics, load_scene
from arm_dynamics.control import MotionForce
from arm_dynamics.task_space import Pose, TaskSpace
from arm_dynamics.trajectory import line, timed
from arm_sim import Simulator
from arm_sim.figures import figure

PRESS = 20.0  # [N]
HEIGHT = 0.02  # [m] of the pen above the table at the start
LANDED = 1.0  # [s] after which the line begins
FRAME = "panda_hand_tcp"

free = load_scene(files("arm_sim") / "scenes/panda.yaml")
hand = TaskSpace(Dynamics(free), FRAME)
start = hand.pose(hand.model.q0)
draw = timed(line(start, Pose(start.position + [0.0, 0.25, 0.0], start.rotation)), 0.2, 1.0)
table = {"point": [0.0, 0.0, float(start.position[2]) - HEIGHT], "normal": [0.0, 0.0, 1.0]}


def pressed(friction: float, known: float) -> tuple[np.ndarray, np.ndarray]:
    """Normal forces in [N] and distances from the reference in [m] along the line."""
    contact = {"type": "contact", "frame": FRAME, "plane": table, "friction": friction}
    scene = load_scene(free.model_dump(exclude_none=True) | {"constraints": [contact]})
    sim, forces, offs = Simulator(scene, dt=1e-3), [], []
    control = MotionForce(hand, [0.0, 0.0, -1.0], bandwidth=20.0, posture=sim.state.q)
    while sim.state.time < LANDED + draw.duration:
        reference = replace(draw.sample(sim.state.time - LANDED), force=PRESS)
        drag = known * PRESS * np.sign(reference.velocity[:3])
        tau = control.torque(sim.state, reference)
        sim.step(tau + sim.dynamics.contact_torque(sim.state.q, drag))
        if sim.state.time > LANDED:
            forces.append(sim.contact_forces()[0].normal)
            offs.append(hand.pose(sim.state.q).position - reference.position)
    return np.array(forces), np.linalg.norm(np.array(offs)[:, :2], axis=1)


ends, curves = [], {}
for friction, known in ((0.0, 0.0), (0.3, 0.0), (0.3, 0.3)):
    force, off = pressed(friction, known)
    ends.append(off[-1])
    curves[f"friction {friction:.1f}, known {known:.1f}"] = force, off
    print(
        f"friction {friction:.1f}, known {known:.1f}: pressed with {force.min():.2f} to "
        f"{force.max():.2f} N; off by {1e3 * off[0]:.2f} mm where it has landed and by "
        f"{1e3 * off[-1]:.2f} mm at the end of the line"
    )

with figure("force_on_a_table", rows=2, size=(7.2, 4.5), sharex=True) as (above, below):
    for name, (force, off) in curves.items():
        time = 1e-3 * np.arange(len(off))
        above.plot(time, force, label=name)
        below.plot(time, 1e3 * off, label=name)
    above.set(ylabel="force on the table [N]", title="A line on a table", ylim=(0.0, 1.5 * PRESS))
    below.set(xlabel="time on the line [s]", ylabel="off by [mm]")
    below.legend()

assert ends[0] < 1e-4 and ends[2] < 1e-3 < ends[1]
