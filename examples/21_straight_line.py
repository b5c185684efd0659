# SPDX-License-Identifier: Apache-2.0
"""A straight line and a circle drawn by a Panda: inverse kinematics, pacing, two controllers."""

from importlib.resources import files

import numpy as np

from arm_dynamics.control import ComputedTorque, OperationalSpace
from arm_dynamics.task_space import Pose, TaskSpace
from arm_dynamics.trajectory import circle, joint_path, line, paced, timed
from arm_sim import Simulator
from arm_sim.figures import figure

sim = Simulator(files("arm_sim") / "scenes/panda.yaml", dt=1e-3)
hand = TaskSpace(sim.dynamics, "panda_hand_tcp")
start = hand.pose(sim.state.q)

straight = line(start, Pose(start.position + [0.1, 0.35, -0.15], start.rotation))
whole = circle(start, start.position + [0.0, 0.08, 0.0], [1, 0, 0], 2 * np.pi)
worst, curves = 0.0, {}
for shape, way in (("line", straight), ("circle", whole)):
    asked = timed(way, speed=0.5, acceleration=2.0)
    joints = joint_path(hand, asked)
    kept = paced(joints, sim.dynamics)
    stretch = kept.duration / joints.duration
    print(f"{shape}: {way.length:.3f} m in {kept.duration:.3f} s, stretched by {stretch:.2f}")
    motion = type(asked)(way, kept.timing)
    controllers = {
        "computed torque": (ComputedTorque(sim.dynamics, 20.0), kept.sample),
        "operational space": (OperationalSpace(hand, 20.0, friction=True), motion.sample),
    }
    for name, (control, sample) in controllers.items():
        sim.reset()
        done = sim.run(kept.duration, lambda s, c=control, r=sample: c.torque(s, r(s.time)))
        reference = np.array([motion.sample(float(t)).position for t in done.time])
        off = 1e3 * np.linalg.norm(hand.pose(done.q).position - reference, axis=1)
        worst = max(worst, off.max())
        curves[shape, name] = done.time, 1e3 * off
        print(f"  {name:18s} largest distance from the reference {off.max():.4f} mm")

with figure("straight_line", columns=2, sharey=True) as both:
    for axis, shape in zip(both, ("line", "circle"), strict=True):
        for name in controllers:
            axis.plot(*curves[shape, name], label=name)
        axis.set(xlabel="time [s]", title=f"A {shape}")
    both[0].set_ylabel("distance from the reference [µm]")

assert worst < 0.1
