# SPDX-License-Identifier: Apache-2.0
"""What is timed: each feature's tick, ticks between and in events, many arms, many points."""

from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import yaml

from benchmarks.robots.models import panda
from benchmarks.studies import features

SCENES = Path(__file__).parents[2] / "src/arm_sim/arm_sim/scenes"
TIP = "link7"
PRESS = 20.0  # [N] against the table, which is friction of 10 N
MU = 0.5
Line = dict[str, Any]


def lines() -> dict[str, Line]:
    """Every line by its name, as plain data for ``recorder.py``."""
    robot = panda()
    start = {"q": robot.q0.tolist(), "v": [0.0] * robot.n}
    bare = {"robot": {"urdf": robot.urdf}}
    ticks: Line = {"kind": "run", "ticks": features.STEPS, "integrator": "rk4"}
    smooth: Line = ticks | start | {"scene": bare}
    chosen = {
        label: ticks | {"scene": scene} | (start if "locked" not in label else {})
        for label, scene in features.scenes().items()
    }
    chosen |= {f"method {name}": smooth | {"integrator": name} for name in ("euler", "dop853")}
    controlled = smooth | {"integrator": "auto", "tolerance": 1e-8}
    chosen["error control, 1e-8"] = controlled
    chosen["a step from Python"] = smooth | {"kind": "step"}
    chosen |= _dry(bare, ticks, start) | _contact(bare, ticks, start)
    chosen["four-bar"] = ticks | {"scene": _four_bar()}
    chosen["rollout, 256 arms"] = smooth | {"kind": "rollout", "arms": 256, "ticks": 50}
    points = {"scene": bare, "points": 10_000}
    chosen["inverse dynamics, a batch"] = points | {"kind": "inverse"}
    chosen["forward dynamics, a batch"] = points | {"kind": "forward"}
    return chosen


def _dry(bare: Line, ticks: Line, start: Line) -> dict[str, Line]:
    """All joints at rest, and all in motion, too short a time for any of them to stop."""
    weightless = bare | {"gravity": [0, 0, 0]}

    def with_friction(coulomb: float) -> Line:
        return weightless | {"joints": {"*": {"friction": {"coulomb": coulomb}}}}

    sticking = ticks | start | {"scene": with_friction(1.0)}
    sliding = ticks | start | {"scene": with_friction(0.01), "ticks": 100, "v": [1.0] * 7}
    return {"dry friction, sticking": sticking, "dry friction, sliding": sliding}


def _contact(bare: Line, ticks: Line, start: Line) -> dict[str, Line]:
    """A weightless arm whose tip is away from a table, pressed on it, and pushed along it."""

    def on_table(height: float) -> Line:
        place = {"point": [0, 0, height], "normal": [0, 0, 1]}
        touch = {"type": "contact", "frame": TIP, "friction": MU, "plane": place}
        return bare | {"gravity": [0, 0, 0], "constraints": [touch]}

    height, jacobian = _tip()
    case = ticks | start | {"scene": on_table(height)}
    press = jacobian.T @ [0.0, 0.0, -PRESS]
    push = jacobian.T @ [0.0, 3.0 * MU * PRESS, -PRESS]
    return {
        "contact, apart": case | {"scene": on_table(height - 5.0)},
        "contact, sticking": case | {"tau": press.tolist()},
        "contact, sliding": case | {"tau": push.tolist(), "ticks": 100},
    }


def _tip() -> tuple[float, np.ndarray]:
    """Height in [m] of the tip in the initial posture, and its Jacobian of shape (3, n)."""
    robot = panda()
    data = robot.pin.createData()
    frame = robot.pin.getFrameId(TIP)
    axes = pin.ReferenceFrame.LOCAL_WORLD_ALIGNED
    jacobian = pin.computeFrameJacobian(robot.pin, data, robot.q0, frame, axes)
    pin.framesForwardKinematics(robot.pin, data, robot.q0)
    return float(data.oMf[frame].translation[2]), jacobian[:3].copy()


def _four_bar() -> Line:
    scene: Line = yaml.safe_load((SCENES / "four_bar.yaml").read_text())
    return scene | {"robot": {"urdf": (SCENES / "four_bar.urdf").read_text()}}
