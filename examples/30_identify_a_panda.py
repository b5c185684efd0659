# SPDX-License-Identifier: Apache-2.0
"""A Panda with unknown friction and payload: excite, record, identify, and control it."""

import sys
import time

import numpy as np

from arm_dynamics import Dynamics, load_scene
from arm_dynamics.control import ComputedTorque, FrictionFeedForward
from arm_dynamics.trajectory import Limits, quintic_through
from arm_sim import Simulator
from arm_sim.figures import figure
from arm_studies.identification import Room, compare, excite, identify

begin = time.monotonic()


def say(text):
    """Progress, on stderr."""
    print(f"{time.monotonic() - begin:5.1f} s  {text}", file=sys.stderr, flush=True)


# The true arm, and its nominal model, the URDF.
rough = {"viscous": 2.0, "coulomb": 2.5, "static": 3.2, "stribeck_velocity": 0.1}
fine = {"viscous": 0.4, "coulomb": 0.6, "static": 0.8, "stribeck_velocity": 0.1}
names = [f"panda_joint{k}" for k in range(1, 8)]
nominal = load_scene("panda")
arm = nominal.model_dump(exclude_unset=True) | {
    "joints": {name: {"friction": rough if k < 4 else fine} for k, name in enumerate(names)},
    "payloads": [{"frame": "panda_hand", "mass": 0.7, "com": [0.0, 0.02, 0.08]}],
    "sensors": {
        "seed": 1,
        "position": {"resolution": 2e-5},
        "velocity": {"from": "position", "cutoff": 60.0},
        "effort": {"noise": 0.05},
    },
}
sim = Simulator(arm)

# An exciting motion, computed with the nominal model; one attempt, to save time.
say("looking for an exciting motion")
room = Room(Dynamics(nominal), share=0.6, acceleration=8.0)
best = excite(room, period=8.0, attempts=1, iterations=30)
print(f"exciting motion: {best.parameters} parameters, condition {best.condition:.1f}")


def controller(scene):
    """Computed torque with the bodies of a scene, and feed-forward of its friction."""
    bare = scene.model_dump(exclude_unset=True)
    bare["joints"] = {name: {"friction": {"viscous": 0.0, "coulomb": 0.0}} for name in names}
    rigid = ComputedTorque(Dynamics(bare))
    return FrictionFeedForward(rigid, Dynamics(scene).model)


def tracked(scene, motion):
    """Follow a motion with the parameters of a scene; the recording and the tracking error."""
    sim.reset(motion.sample(0.0).q)
    run = sim.run(motion.duration, controller(scene), motion)
    wanted = np.array([motion.sample(t).q for t in run.time])
    return run, run.q - wanted


say("recording it")
run, _ = tracked(nominal, best.motion)
say("identifying")
# The cut-off frequency in [Hz]; a higher one takes longer.
found = identify(nominal, run, band=8.0, on_progress=say)

before, after = found.nominal_error, found.torque_error
for name in names:
    print(f"{name}: held-out error: nominal {before[name]:6.1%}, identified {after[name]:6.1%}")

# Validation on another motion: errors before and after.
say("another motion with both sets of numbers")
goals = sim.model.q0 + np.array([[0.0] * 7, [0.8, 0.5, -0.4, 0.6, 0.5, 0.4, -0.6],
                                 [-0.7, 0.2, 0.6, -0.4, -0.8, 0.8, 0.9], [0.0] * 7])  # fmt: skip
course = quintic_through(goals, Limits.of(sim.model, acceleration=4.0))
scenes = {"the URDF": nominal, "the identification": found.scene}
runs = {label: tracked(scene, course) for label, scene in scenes.items()}
unseen, error = runs["the URDF"][0], {}
for label, scene in scenes.items():
    beside, off = compare(scene, unseen), runs[label][1]
    error[label] = float(np.sqrt(np.mean(off**2)))
    print(
        f"parameters of {label}: torque error {beside.whole:.1%}, tracking error "
        f"{1e3 * error[label]:.2f} mrad rms, {1e3 * abs(off).max():.1f} mrad at most"
    )

with figure("identify_a_panda", rows=2, size=(7.2, 5.0), sharex=True) as axes:
    for axis, (label, (run, off)) in zip(axes, runs.items(), strict=True):
        axis.plot(run.time, 1e3 * off, label=[f"joint {k}" for k in range(1, 8)])
        axis.set(ylabel="error [mrad]", title=f"Computed torque with parameters from {label}")
    axes[1].set_xlabel("time [s]")

say("done")
assert error["the identification"] < 0.2 * error["the URDF"]
