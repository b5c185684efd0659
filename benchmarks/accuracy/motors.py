# SPDX-License-Identifier: Apache-2.0
"""A DC motor under voltage: error and time of the suite and of MuJoCo's ``dcmotor``, in one run.

L i' = V - R i - K ω, J ω' = K i - b ω has a closed form. Compared are current and speed after 1,
10 and 50 ms of 12 V; timed is a second in which the voltage changes its sign every 50 ms.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from statistics import median
from time import perf_counter
from typing import Any

import numpy as np

try:
    import mujoco
except ImportError:  # only to compare with
    mujoco = None

from arm_sim import Simulator
from benchmarks.accuracy.sweep import Row
from benchmarks.reporting.markdown import number, table

R, L, K, J, B, VOLTS = 1.0, 1e-3, 0.05, 5e-5, 1e-5, 12.0
TIMES = (0.001, 0.01, 0.05)  # [s]
HELD = 50  # ticks of 1 ms for which a voltage acts
REPEATS = 7
OURS: dict[str, dict[str, Any]] = {
    "as a scene gets it": {},
    "`dop853`": {"integrator": "dop853"},
    "`rk4`": {"integrator": "rk4"},
}
THEIRS = ("Euler", "implicitfast", "RK4")
STEPS = (1e-3, 1e-4, 1e-5)  # [s]

Play = Callable[[], Any]


def rows() -> Iterator[Row]:
    """Error and time of each engine, method and step."""
    sims = {name: Simulator(scene(), dt=1e-3, **options) for name, options in OURS.items()}
    steps = [(name, h) for name in THEIRS for h in STEPS] if mujoco else []
    models = {key: MujocoMotor(*key) for key in steps}
    errors = {("this suite", name, 1e-3): _ours(sim) for name, sim in sims.items()}
    errors |= {("MuJoCo", *key): motor.error() for key, motor in models.items()}
    jobs: dict[Any, Play] = {("this suite", n, 1e-3): _second(s) for n, s in sims.items()}
    jobs |= {("MuJoCo", *key): motor.second for key, motor in models.items()}
    times = timed(jobs)
    for key, error in errors.items():
        engine, method, step = key
        yield {
            "engine": engine, "method": method, "step_s": step,
            "current": error[0], "speed": error[1], "second_s": times[key],
        }  # fmt: skip


def page(found: list[Row]) -> str:
    """The table."""
    heads = ["", "method", "step", "current", "speed", "ms for a second"]
    return table(heads, [
        (
            row["engine"], row["method"], f"{row['step_s'] * 1e3:g} ms",
            number(row["current"], 1), number(row["speed"], 1), number(row["second_s"] * 1e3, 2),
        )
        for row in found
    ])  # fmt: skip


def scene() -> dict[str, Any]:
    """A wheel that is the rotor of a motor."""
    urdf = f"""<robot name="rotor"><link name="base"/><link name="wheel"><inertial>
      <mass value="1"/><inertia ixx="{J}" ixy="0" ixz="0" iyy="{J}" iyz="0" izz="{J}"/>
      </inertial></link><joint name="axle" type="continuous"><parent link="base"/>
      <child link="wheel"/><axis xyz="0 0 1"/></joint></robot>"""
    motor = {"command": "voltage", "resistance": R, "inductance": L, "torque_constant": K}
    joint = {"actuator": motor | {"rotor_damping": B}}
    return {"robot": {"urdf": urdf}, "joints": {"axle": joint}}


def closed_form(t: float) -> np.ndarray:
    """Current [A] and speed [rad/s] after ``t`` [s] at ``VOLTS``, from rest."""
    A = np.array([[-R / L, -K / L], [K / J, -B / J]])
    rates, modes = np.linalg.eig(A)
    settled = np.linalg.solve(A, [-VOLTS / L, 0.0])
    parts = np.linalg.solve(modes, -settled)
    return np.asarray(settled + modes @ (np.exp(rates * t) * parts))


def _relative(found: dict[float, np.ndarray]) -> tuple[float, float]:
    errors = np.array([abs(x / closed_form(t) - 1.0) for t, x in found.items()])
    return float(errors[:, 0].max()), float(errors[:, 1].max())


def _ours(sim: Simulator) -> tuple[float, float]:
    found = {}
    for t in TIMES:
        sim.run(t - sim.state.time, [VOLTS])
        found[t] = np.array([sim.state.z[0], sim.state.v[0]])
    return _relative(found)


def _second(sim: Simulator) -> Play:
    signs = np.where((np.arange(1000) // HELD) % 2, -VOLTS, VOLTS)[:, None]

    def play() -> None:
        sim.reset()
        sim.run(1.0, signs)

    return play


def timed(jobs: dict[Any, Play]) -> dict[Any, float]:
    """Middle of some rounds, in each of which every job has its turn."""
    taken: dict[Any, list[float]] = {key: [] for key in jobs}
    for turn in range(REPEATS + 1):
        for key, play in jobs.items():
            start = perf_counter()
            play()
            if turn:  # the first one warms up
                taken[key].append(perf_counter() - start)
    return {key: median(times) for key, times in taken.items()}


class MujocoMotor:
    """The same motor as MuJoCo's ``dcmotor``, with all that it does not need switched off."""

    def __init__(self, method: str, step: float) -> None:
        """Compile it."""
        self._model = mujoco.MjModel.from_xml_string(f"""<mujoco>
          <option timestep="{step}" integrator="{method}" gravity="0 0 0">
            <flag constraint="disable" contact="disable" sensor="disable"/></option>
          <worldbody><body><joint name="a" axis="0 0 1" damping="{B}"/>
            <inertial pos="0 0 0" mass="1" diaginertia="{J} {J} {J}"/></body></worldbody>
          <actuator><dcmotor joint="a" motorconst="{K} {K}" resistance="{R}" inductance="{L}"/>
          </actuator></mujoco>""")
        self._data, self._step = mujoco.MjData(self._model), step

    def error(self) -> tuple[float, float]:
        """Largest relative errors of current and speed."""
        mujoco.mj_resetData(self._model, self._data)
        self._data.ctrl[0], done, found = VOLTS, 0, {}
        for t in TIMES:
            steps = round(t / self._step)
            mujoco.mj_step(self._model, self._data, nstep=steps - done)
            done, found[t] = steps, np.array([self._data.act[0], self._data.qvel[0]])
        return _relative(found)

    def second(self) -> None:
        """A second with a voltage that changes its sign."""
        mujoco.mj_resetData(self._model, self._data)
        for k in range(1000 // HELD):
            self._data.ctrl[0] = -VOLTS if k % 2 else VOLTS
            mujoco.mj_step(self._model, self._data, nstep=round(HELD * 1e-3 / self._step))
