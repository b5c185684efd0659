# SPDX-License-Identifier: Apache-2.0
"""The robots that the tests run on, each loaded and built once."""

from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from arm_dynamics import Dynamics, Scene, load_scene
from arm_dynamics.scene.schema import Joint
from arm_sim import Simulator
from models.oracle import Oracle

FOLDER = Path(__file__).parent
SCENES = FOLDER.parents[1] / "src/arm_sim/arm_sim/scenes"

REAL = ("panda", "ur10", "kinova", "z1")
OWN = ("pendulum", "double_pendulum", "two_link", "puma560")
DRIVEN = ("motor_pendulum", "flexible_arm")  # with motors: a command is no torque there
MADE = tuple(sorted(path.stem for path in FOLDER.glob("*.urdf")))
HELD = (
    "slider_crank", "four_bar", "five_bar", "bricard", "parallel_gripper", "panda_pen", "andrews",
)  # fmt: skip
BOTH = ("slider_crank_motor",)  # a loop and a motor
BALANCED = ("spring_balanced_arm",)  # by springs, of which the oracle knows nothing
TOUCHING = (
    "panda_table",
    "panda_lugre_table",
    "flexible_arm_wall",
    "lifting_gripper",
)  # with constraints and contacts: a torque is not all that acts there
ARMS = ("fr3", "ur5e", "xarm7")  # further bundled arms, like REAL to all features
REAL_DRIVES = ("real_panda", "real_fr3", "real_ur10", "real_ur5e", "real_xarm7")  # with rotors
ROBOTS = (*REAL, *OWN, *MADE)


@cache
def scene(name: str) -> Scene:
    """The scene of one of ``ROBOTS``, or of a scene file beside this one."""
    places = SCENES / f"{name}.yaml", FOLDER / f"{name}.yaml", FOLDER / f"{name}.urdf"
    return load_scene(next(path for path in places if path.is_file()))


@cache
def dynamics(name: str) -> Dynamics:
    """Its dynamics, shared by all tests."""
    return Dynamics(scene(name))


@cache
def oracle(name: str) -> Oracle:
    """The same robot through Pinocchio alone."""
    return Oracle(scene(name))


def boundless(scene: Scene) -> Scene:
    """The scene without end stops, for motions through all positions."""
    joints = {
        name: joint.model_dump(exclude_unset=True, exclude_none=True)
        for name, joint in {"*": Joint(), **scene.joints}.items()
    }
    for joint in joints.values():
        joint["limits"] = {**joint.get("limits", {}), "stop": False}
    checked = {name: Joint.model_validate(joint) for name, joint in joints.items()}
    return scene.model_copy(update={"joints": checked})


def simulator(name: str, stops: bool = True, **options: Any) -> Simulator:
    """A simulator of the robot, built once for each set of options and put back to its start."""
    sim = _simulator(name, stops, tuple(sorted(options.items())))
    sim.reset()
    return sim


@cache
def _simulator(name: str, stops: bool, options: tuple[tuple[str, Any], ...]) -> Simulator:
    model = scene(name) if stops else boundless(scene(name))
    return Simulator(model, **dict(options))


def random_state(rng: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Any position, a brisk velocity and an acceleration (or torque), each of shape (n,)."""
    return rng.uniform(-np.pi, np.pi, n), rng.normal(0.0, 2.0, n), rng.normal(0.0, 10.0, n)
