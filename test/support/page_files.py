# SPDX-License-Identifier: Apache-2.0
"""Files that a reader of a page has and the page does not make: an arm, recordings, records."""

import os
import shutil
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

import models
from arm_dynamics import Dynamics, load_scene
from arm_dynamics.arrays import Array
from arm_dynamics.control import ComputedTorque
from arm_dynamics.trajectory import Reference
from arm_sim import Simulator

ROBOT = str(models.SCENES / "two_link.urdf")
VISCOUS = {"joints": {"*": {"friction": {"viscous": 0.8, "coulomb": 0.6}}}}


class Waves:
    """Joints that swing about where a scene begins, from rest, each at frequencies of its own."""

    def __init__(self, dynamics: Dynamics, q0: Array, seed: int) -> None:
        rng = np.random.default_rng(seed)
        room = np.minimum(1.0, np.nan_to_num(self._room(dynamics, q0), posinf=1.0))
        self._q0, shape = q0, (3, len(q0))
        self._w = rng.uniform(1.0, 5.0, shape)
        self._A = 0.4 * room * rng.uniform(-1.0, 1.0, shape) / 3.0

    @staticmethod
    def _room(dynamics: Dynamics, q0: Array) -> Array:
        model = dynamics.model
        return np.minimum(q0 - model.position_lower, model.position_upper - q0)

    def at(self, t: Array) -> tuple[Array, Array, Array]:
        """Positions, velocities and accelerations at times ``(k,)``."""
        wt = self._w * np.asarray(t)[:, None, None]
        q = self._q0 + (self._A * (1.0 - np.cos(wt))).sum(axis=1)
        v = (self._A * self._w * np.sin(wt)).sum(axis=1)
        return q, v, (self._A * self._w**2 * np.cos(wt)).sum(axis=1)

    def sample(self, t: float) -> Reference:
        """The reference at one time."""
        return Reference(*(x[0] for x in self.at(np.array([t]))))


def simulated(
    path: Path, scene: str = "panda", seed: int = 1, duration: float = 6.0, holding: float = 0.0
) -> None:
    """A recording of the sim; a Panda may hold a body of some [kg]."""
    given = {**load_scene(scene).model_dump(exclude_unset=True), **VISCOUS}
    if holding:
        given["payloads"] = [{"frame": "panda_hand", "mass": holding, "com": [0.0, 0.0, 0.1]}]
    sim = Simulator(given, dt=4e-3)
    waves = Waves(sim.dynamics, sim.state.q, seed)
    sim.run(duration, ComputedTorque(sim.dynamics), waves).save(path)


def cut_off(path: Path) -> None:
    """A recording whose writer was killed."""
    simulated(path)
    os.truncate(path, path.stat().st_size * 2 // 3)


def measured(scene: str, seed: int, rate: float = 100.0) -> tuple[tuple[str, ...], Array, Array]:
    """Joint names, times, and columns of positions and efforts of an arm with friction."""
    true = Dynamics({**load_scene(scene).model_dump(exclude_unset=True), **VISCOUS})
    start = Simulator(scene, backend="vm").state.q
    t = np.arange(0.0, 12.0, 1.0 / rate)
    q, v, a = Waves(true, start, seed).at(t)
    noise = 0.02 * np.random.default_rng(seed).normal(size=q.shape)
    return true.joint_names, t, np.stack([q, v, true.inverse(q, v, a) + noise])


def bag(path: Path, scene: str, seed: int = 1) -> None:
    """A bag of a robot: a folder, or its one file if the name ends in ``.db3``."""
    names, times, (q, v, tau) = measured(scene, seed)
    store = get_typestore(Stores.ROS2_JAZZY)
    kinds = {name.rpartition("/")[2]: kind for name, kind in store.types.items()}
    JointState, Header, Time = (kinds[name] for name in ("JointState", "Header", "Time"))
    folder = path.with_suffix("")
    folder.parent.mkdir(parents=True, exist_ok=True)
    with Writer(folder, version=9, storage_plugin=StoragePlugin.SQLITE3) as writer:
        topic = writer.add_connection("/joint_states", JointState.__msgtype__, typestore=store)
        for t, *columns in zip(times, q, v, tau, strict=True):
            stamp = round(1e9 * (1000.0 + t))
            header = Header(stamp=Time(sec=stamp // 10**9, nanosec=stamp % 10**9), frame_id="")
            message = JointState(header, list(names), *columns)
            data = store.serialize_cdr(message, JointState.__msgtype__)
            writer.write(topic, stamp, data)
    if path.suffix:
        (folder / f"{folder.name}.db3").rename(path)
        shutil.rmtree(folder)


def joint_table(path: Path) -> None:
    """A table of an arm whose shoulder it calls ``axis_1``."""
    names, t, (q, _, tau) = measured(ROBOT, 1)
    told = [{"shoulder": "axis_1"}.get(name, name) for name in names]
    heading = ["time", *(f"{part}.{name}" for part in ("position", "effort") for name in told)]
    rows = np.column_stack([t, q, tau])
    np.savetxt(path, rows, delimiter=",", header=",".join(heading), comments="")


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
    "bag_of_my_robot": partial(bag, scene="panda"),
    "bags/my_robot": partial(bag, scene="ur10"),
    "bag_1": partial(bag, scene="ur10"),
    "bag_2": partial(bag, scene="ur10", seed=2),
    "ur10_exciting_trajectory.db3": partial(bag, scene="ur10"),
    "panda_exciting_trajectory.db3": partial(bag, scene="panda"),
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
