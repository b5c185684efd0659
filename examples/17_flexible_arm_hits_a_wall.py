# SPDX-License-Identifier: Apache-2.0
"""An arm with flexible joints swings against a wall: its links rebound, its rotors continue.

At the instant of an impact only the links stop; the springs of the drives then transmit the
momentum of the rotors, and the arm hits the wall again. Rigid drives hit it with all their inertia
at once.
"""

from importlib.resources import files

import numpy as np

from arm_dynamics import load_scene
from arm_dynamics.actuation import rigid_twin
from arm_sim import Simulator, contact_history
from arm_sim.figures import figure

scene = load_scene(files("arm_sim") / "scenes/flexible_arm_wall.yaml")
SPEED, TORQUE = 2.0, [2.0, 1.0]  # [rad/s], [N m]

curves = {}
for name, arm in (("flexible", scene), ("rigid", rigid_twin(scene))):
    sim = Simulator(arm, dt=1e-3)
    sim.reset(v=[SPEED, 0.0])
    run = sim.run(1.0, TORQUE)
    history = contact_history(sim, run)
    loss = np.diff(history.impact_loss)
    hits = np.flatnonzero(loss > 1e-9)
    first = hits[0]
    print(
        f"{name}: hits after {run.time[first]:.3f} s, which takes {loss[first]:.3f} J of "
        f"{run.kinetic[first] + run.stored[first]:.3f} J; {len(hits)} ticks with impacts "
        f"take {history.impact_loss[-1]:.3f} J"
    )
    if run.z.shape[1]:
        twist = run.z[:, [0, 2]] - run.q
        most = np.abs(twist).max(axis=0) * 1e3
        print(f"  its drives twist by up to {most[0]:.1f} and {most[1]:.1f} mrad")
    curves[name] = run.time, history.gap[:, 0], history.force[:, 0]
    assert history.gap.min() > -1e-12 and loss[first] > 0.0
    assert np.abs(run.balance).max() < 1e-5

with figure("flexible_arm_hits_a_wall", rows=2, size=(7.2, 4.5), sharex=True) as (above, below):
    for name, (time, gap, force) in curves.items():
        above.plot(time, 1e3 * gap, label=name)
        below.plot(time, np.linalg.norm(force, axis=1), label=name)
    above.set(ylabel="distance from the wall [mm]", title="A swing against a wall")
    below.set(xlabel="time [s]", ylabel="force between impacts [N]")
    above.legend()
