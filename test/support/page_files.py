# SPDX-License-Identifier: Apache-2.0
"""Files that a reader of a page has and the page does not make: an arm, recordings, records."""

import os
import shutil
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

import models
from arm_dynamics import load_scene
from arm_dynamics.control import ComputedTorque
from arm_dynamics.trajectory import Reference
from arm_sim import Recording, Simulator

ROBOT = str(models.SCENES / "two_link.urdf")
VISCOUS = {"joints": {"*": {"friction": {"viscous": 0.8, "coulomb": 0.6}}}}


class Waves:
    """Joints that swing about where they are, from rest, each at frequencies of its own."""

    def __init__(self, sim: Simulator, seed: int) -> None:
        rng, model, self._q0 = np.random.default_rng(seed), sim.model, sim.state.q
        room = np.minimum(self._q0 - model.position_lower, model.position_upper - self._q0)
        self._w = rng.uniform(1.0, 5.0, (3, sim.n))
        self._A = 0.4 / 3.0 * np.minimum(1.0, room) * rng.uniform(-1.0, 1.0, (3, sim.n))

    def sample(self, t: float) -> Reference:
        """The reference at one time."""
        A, w = self._A, self._w
        q, v, a = A * (1.0 - np.cos(w * t)), A * w * np.sin(w * t), A * w**2 * np.cos(w * t)
        return Reference(self._q0 + q.sum(axis=0), v.sum(axis=0), a.sum(axis=0))


def recorded(
    scene: str = "panda", seed: int = 1, duration: float = 6.0, holding: float = 0.0
) -> Recording:
    """A motion of an arm with friction; a Panda may hold a body of some [kg]."""
    given = {**load_scene(scene).model_dump(exclude_unset=True), **VISCOUS}
    if holding:
        given["payloads"] = [{"frame": "panda_hand", "mass": holding, "com": [0.0, 0.0, 0.1]}]
    sim = Simulator(given, dt=4e-3)
    return sim.run(duration, ComputedTorque(sim.dynamics), Waves(sim, seed))


def simulated(path: Path, **how: Any) -> None:
    """A recording of the sim: a file, or a bag where the name has no ending."""
    recorded(**how).save(path)


def cut_off(path: Path) -> None:
    """A recording whose writer was killed."""
    simulated(path)
    os.truncate(path, path.stat().st_size * 2 // 3)


def joint_table(path: Path) -> None:
    """A table of an arm whose shoulder it calls ``axis_1``."""
    columns = recorded(ROBOT).to_dict()
    heading = ",".join(columns).replace("shoulder", "axis_1")
    rows = np.column_stack(list(columns.values()))
    np.savetxt(path, rows, delimiter=",", header=heading, comments="")


# --- by name -------------------------------------------------------------------------------------


def written(text: str) -> Callable[[Path], None]:
    """A file of this text."""
    return lambda path: None if path.write_text(text) else None


MAKERS: dict[str, Callable[[Path], None]] = {
    "run.mcap": simulated,
    "run2.mcap": simulated,
    "held.mcap": partial(simulated, holding=1.2),
    "cut.mcap": cut_off,
    "other.mcap": partial(simulated, duration=1.0),
    "other_run.mcap": partial(simulated, scene=ROBOT, seed=2),
    "bag_of_my_robot": simulated,
    "bags/my_robot": partial(simulated, scene="ur10"),
    "bag_1": partial(simulated, scene="ur10"),
    "bag_2": partial(simulated, scene="ur10", seed=2),
    "table.csv": joint_table,
    "my_arm.urdf": written(Path(ROBOT).read_text()),
    "arm.urdf": written(Path(ROBOT).read_text()),
    "my_scene.yaml": written("robot: {urdf: package://arm_sim/scenes/pendulum.urdf}\n"),
    "better.yaml": written(
        (models.SCENES / "panda.yaml").read_text()
        + 'joints: {"*": {friction: {viscous: 0.8, coulomb: 0.6}}}\n'
    ),
}

_MODULE = """
class Gentle:
    def __init__(self, dynamics):
        self.dynamics = dynamics

    def torque(self, state, reference):
        pull = 100.0 * (reference.q - state.q) - 20.0 * state.v
        return self.dynamics.inverse(state.q, 0.0 * state.v, pull)
"""
MAKERS["my_package/my_module.py"] = written(_MODULE)


def put(name: str, folder: Path, shelf: Path) -> None:
    """Put a file into a folder; it is made once, on the shelf."""
    made, there = shelf / name, folder / name
    if not made.exists():
        made.parent.mkdir(parents=True, exist_ok=True)
        MAKERS[name](made)
    there.parent.mkdir(parents=True, exist_ok=True)
    (shutil.copytree if made.is_dir() else shutil.copy)(made, there)
