# SPDX-License-Identifier: Apache-2.0
"""A Panda with LuGre friction in its joints pushes on a table, and then along it until it slides.

When the hand slips on the table, the bristles of the joints still hold it: it deflects by a
fraction of a millimetre, like a spring, and slides when the bristles yield. A controller that
equates torques and forces does not account for this.
"""

from importlib.resources import files

import numpy as np

from arm_dynamics import load_scene
from arm_dynamics.task_space import TaskSpace
from arm_sim import Simulator, State, contact_history
from arm_sim.figures import figure

PRESS, MU, LANDED, RATE = 20.0, 0.4, 0.6, 12.0  # [N], the table's µ, [s], [N/s]
scene = load_scene(files("arm_sim") / "scenes/panda_lugre_table.yaml")
smooth = scene.model_dump(exclude_unset=True)
smooth["joints"] = {"*": {"friction": {"viscous": 0.5}}}


def sideways(time: float) -> float:
    """The force along the table in [N], which grows once the hand has landed."""
    return RATE * max(0.0, time - LANDED)


def measured(sim: Simulator, axis, name: str) -> list[float]:
    """Sideways forces in [N] at which the hand slips, and has moved by 0.1 and 1 mm."""
    dyn, hand = sim.dynamics, TaskSpace(sim.dynamics, "panda_hand", selection="position")

    def push(state: State) -> np.ndarray:
        force = [0.0, sideways(state.time), -PRESS]
        return dyn.gravity(state.q) + dyn.contact_torque(state.q, force) - 4.0 * state.v

    run = sim.run(1.7, push)
    felt = contact_history(sim, run).force[:, 0]
    landed = round(LANDED / sim.dt)
    along = np.linalg.norm(felt[:, :2], axis=1)[landed:]
    start = hand.pose(run.q[landed]).position
    moved = np.array([np.linalg.norm(hand.pose(q).position - start) for q in run.q[landed:]])
    signs = along > 0.9999 * MU * felt[landed:, 2], moved > 1e-4, moved > 1e-3
    pushes = [sideways(run.time[landed + int(np.argmax(sign))]) for sign in signs]
    axis.plot(1e3 * moved, [sideways(t) for t in run.time[landed:]], label=name)
    print(f"  presses with {felt[landed, 2]:.2f} N; slips at {pushes[0]:.2f} N,", end=" ")
    print(f"0.1 mm off at {pushes[1]:.2f} N, 1 mm off at {pushes[2]:.2f} N")
    return pushes


print(f"{PRESS:.0f} N on the table, which holds {MU * PRESS:.1f} N sideways")
with figure("bristles_on_a_table", size=(7, 4)) as axis:
    print("joints without dry friction:")
    plain = measured(Simulator(smooth, dt=2e-3), axis, "joints without dry friction")
    print("joints with bristles:")
    bristles = measured(Simulator(scene, dt=2e-3, tolerance=1e-5), axis, "joints with bristles")
    axis.axhline(MU * PRESS, color="0.5", linestyle=":", label="friction limit of the table")
    axis.set(
        xlabel="displacement of the hand [mm]", ylabel="push along the table [N]", xlim=(-0.1, 4.0)
    )
    axis.legend()

assert abs(plain[0] - MU * PRESS) < 0.1 and bristles[2] > plain[2] + 0.5
