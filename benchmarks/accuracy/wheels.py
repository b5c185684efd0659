# SPDX-License-Identifier: Apache-2.0
"""A wheel with friction, and as the rotor of a motor: error and time, here and in MuJoCo.

Dry friction against MuJoCo's ``frictionloss``: where a wheel coasts to rest, in closed form, and
whether a torque below the level moves it. LuGre against the bristles of MuJoCo's ``dcmotor``: the
courses of ``test/reference/lugre.json`` on the wheels whose σ1 is constant, as it is there.

A DC motor, L i' = V - R i - K ω, J ω' = K i - b ω, has a closed form. Compared are current and
speed after 1, 10 and 50 ms of 12 V; timed is a second in which the voltage changes its sign every
50 ms.
"""

import json
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np
from scipy.linalg import expm

try:
    import mujoco
except ImportError:  # only to compare with
    mujoco = None

from arm_sim import Simulator
from benchmarks.accuracy.problems import REFERENCE
from benchmarks.accuracy.sweep import Row
from benchmarks.measurement.timing import Noise, cpu, interleaved
from benchmarks.reporting.markdown import number, table

J, FC, B, W0 = 0.1, 0.5, 0.2, 5.0  # [kg m²], [N m], [N m s/rad], [rad/s]
STOP = J * W0 / B - J * FC / B**2 * np.log1p(B * W0 / FC)  # [rad], where J w' = -FC - B w ends
PUSH = 0.9 * FC
DRY: dict[str, dict[str, Any]] = {
    "`rk4`": {"integrator": "rk4"},
    "tolerance 1e-9": {"tolerance": 1e-9},
}
BRISTLES: dict[str, dict[str, Any]] = {
    "as a scene gets it": {},
    "tolerance 1e-8": {"tolerance": 1e-8},
}
STEPS = {"Euler": (1e-3, 1e-4, 1e-5), "implicitfast": (1e-3, 1e-4, 1e-5), "RK4": (1e-3, 1e-4)}

ROTOR, DAMPING = 5e-5, 1e-5  # [kg m²], [N m s/rad]
R, L, K, VOLTS = 1.0, 1e-3, 0.05, 12.0
TIMES = (0.001, 0.01, 0.05)  # [s]
HELD = 50  # ticks of 1 ms for which a voltage acts
REPEATS = 7
WHEELS = None  # of the reference of LuGre friction: all
MOTOR: dict[str, dict[str, Any]] = {
    "as a scene gets it": {},
    "`dop853`": {"integrator": "dop853"},
    "`rk4`": {"integrator": "rk4"},
}
MOTOR_STEPS = dict.fromkeys(STEPS, (1e-3, 1e-4, 1e-5))
Key = tuple[str, str, float]  # engine, method, step in [s]


class Ours:
    """A wheel in this suite; ``joint`` is its entry in the scene."""

    def __init__(self, inertia: float, joint: dict[str, Any], **options: Any) -> None:
        urdf = f"""<robot name="wheel"><link name="base"/><link name="wheel"><inertial>
          <mass value="1"/><inertia ixx="{inertia}" ixy="0" ixz="0" iyy="{inertia}" iyz="0"
          izz="{inertia}"/></inertial></link><joint name="axle" type="continuous">
          <parent link="base"/><child link="wheel"/><axis xyz="0 0 1"/></joint></robot>"""
        scene = {"robot": {"urdf": urdf}, "joints": {"axle": joint}}
        self._sim = Simulator(scene, dt=1e-3, **options)

    def course(self, v0: float, steps: Any) -> np.ndarray:
        """Current, if there is one, angle and speed after steps of a command from ``v0``."""
        self._sim.reset(v=[v0])
        for duration, u in steps:
            self._sim.run(duration, [u])
        state = self._sim.state
        return np.concatenate([state.z[:1], state.q, state.v])


class Theirs:
    """The same wheel in MuJoCo, with all that it does not need switched off.

    If it is ``driven``, commands are voltages of its motor, else torques.
    """

    def __init__(
        self, inertia: float, damping: float, key: Key, joint: str = "", motor: str = "",
        driven: bool = False,
    ) -> None:  # fmt: skip
        _, method, self._step = key
        motor = f'<actuator><dcmotor joint="a" {motor}/></actuator>' if motor else ""
        flags = 'constraint="disable"' if driven else ""
        self._model = mujoco.MjModel.from_xml_string(f"""<mujoco>
          <option timestep="{self._step}" integrator="{method}" gravity="0 0 0">
            <flag contact="disable" sensor="disable" {flags}/></option>
          <worldbody><body><joint name="a" axis="0 0 1" damping="{damping}" {joint}/>
            <inertial pos="0 0 0" mass="1" diaginertia="{inertia} {inertia} {inertia}"/>
          </body></worldbody>{motor}</mujoco>""")
        self._data = mujoco.MjData(self._model)
        self._command = self._data.ctrl if driven else self._data.qfrc_applied

    def course(self, v0: float, steps: Any) -> np.ndarray:
        """Current, if there is one, angle and speed after steps; NaN if the motion is lost."""
        mujoco.mj_resetData(self._model, self._data)
        self._data.qvel[0] = v0
        for duration, u in steps:
            self._command[0] = u
            mujoco.mj_step(self._model, self._data, nstep=round(duration / self._step))
        lost = self._data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number > 0
        state = np.concatenate([self._data.act, self._data.qpos, self._data.qvel])
        return state * (np.nan if lost else 1.0)


def _theirs(steps: dict[str, tuple[float, ...]]) -> list[Key]:
    if not mujoco:
        return []
    mujoco.set_mju_user_warning(lambda text: None)  # of motions that are lost; the table says
    return [("MuJoCo", name, h) for name, own in steps.items() for h in own]


def _row(key: Key, second: float, **figures: Any) -> Row:
    engine, method, step = key
    return {"engine": engine, "method": method, "step_s": step, "second_s": second} | figures


def _timed(jobs: dict[Any, Callable[[], Any]]) -> dict[Any, float]:
    """Median time in [s] of some rounds, in each of which every job has its turn."""
    for play in jobs.values():  # which warms up
        play()
    turns = {key: partial(cpu, play) for key, play in jobs.items()}
    costs = interleaved(turns, REPEATS, Noise(), lambda: None)
    return {key: cost.median for key, cost in costs.items()}


def shown(rows: list[Row]) -> str:
    """A table of rows; errors beyond 10 are those of motions that are lost."""
    figures = [
        key for key in rows[0] if key not in ("engine", "method", "step_s", "second_s", "law")
    ]
    return table(["", "method", "step", *figures, "ms for a second"], [
        (
            row["engine"], row["method"], f"{row['step_s'] * 1e3:g} ms",
            *("lost" if row[key] > 10.0 else number(row[key], 1) for key in figures),
            number(row["second_s"] * 1e3, 2),
        )
        for row in rows
    ])  # fmt: skip


# --- friction ----------------------------------------------------------------------------------


def friction() -> Iterator[Row]:
    """Error and time of each engine, method and step on both laws."""
    friction = {"friction": {"viscous": B, "coulomb": FC}}
    wheels: dict[Key, Any] = {
        ("this suite", name, 1e-3): Ours(J, friction, **options) for name, options in DRY.items()
    }
    wheels |= {key: Theirs(J, B, key, f'frictionloss="{FC}"') for key in _theirs(STEPS)}
    coast, push = (W0, ((1.0, 0.0),)), (0.0, ((1.0, PUSH),))
    times = _timed({key: partial(wheel.course, *coast) for key, wheel in wheels.items()})
    for key, wheel in wheels.items():
        error, creep = abs(wheel.course(*coast)[-2] - STOP), abs(wheel.course(*push)[-2])
        yield _row(
            key,
            times[key],
            law="dry",
            **{"error [rad]": float(error), "creep [rad]": float(creep)},
        )
    known = json.loads((REFERENCE / "lugre.json").read_text())
    courses = known["courses"]
    same = [case for case in known["wheels"] if case["wheel"]["sigma1_velocity"] is None][:WHEELS]
    for key in [*(("this suite", name, 1e-3) for name in BRISTLES), *_theirs(STEPS)]:
        bristled = [(_bristled(case["wheel"], key), case["angle"]) for case in same]
        errors = [
            abs(wheel.course(*courses[name])[-2] - angle[name])
            for wheel, angle in bristled
            for name in courses
        ]
        kept = np.nan_to_num(np.array(errors), nan=np.inf)
        half = _timed({0: partial(bristled[0][0].course, *courses["reverse"])})[0]  # of a second
        figures = {"median [rad]": float(np.median(kept)), "largest [rad]": float(kept.max())}
        yield _row(key, 2.0 * half, law="LuGre", **figures)


def _bristled(w: dict[str, Any], key: Key) -> Any:
    levels = {name: w[name] for name in ("viscous", "coulomb", "static", "stribeck_velocity")}
    if key[0] == "this suite":
        if levels["static"] == levels["coulomb"]:  # then a Stribeck velocity would do nothing
            del levels["stribeck_velocity"]
        law = levels | {"lugre": {"sigma0": w["sigma0"], "sigma1": w["sigma1"]}}
        return Ours(w["J"], {"friction": law}, **BRISTLES[key[1]])
    five = [w[n] for n in ("sigma0", "sigma1", "coulomb", "static", "stribeck_velocity")]
    # A motor without torque: its constant is too small to be felt.
    motor = f'motorconst="1e-9 1e-9" resistance="1" lugre="{" ".join(map(repr, five))}"'
    return Theirs(w["J"], w["viscous"], key, motor=motor)


# --- motors ------------------------------------------------------------------------------------


def motors() -> Iterator[Row]:
    motor = {"command": "voltage", "resistance": R, "inductance": L, "torque_constant": K}
    joint = {"actuator": motor | {"rotor_damping": DAMPING}}
    theirs = f'motorconst="{K} {K}" resistance="{R}" inductance="{L}"'
    rotors: dict[Key, Any] = {
        ("this suite", name, 1e-3): Ours(ROTOR, joint, **options)
        for name, options in MOTOR.items()
    }
    rotors |= {
        key: Theirs(ROTOR, DAMPING, key, motor=theirs, driven=True) for key in _theirs(MOTOR_STEPS)
    }
    signs = [(1e-3 * HELD, -VOLTS if k % 2 else VOLTS) for k in range(1000 // HELD)]
    times = _timed({key: partial(rotor.course, 0.0, signs) for key, rotor in rotors.items()})
    for key, rotor in rotors.items():
        ends = [(rotor.course(0.0, [(t, VOLTS)])[[0, -1]], closed_form(t)) for t in TIMES]
        current, speed = np.max([abs(x / true - 1.0) for x, true in ends], axis=0).tolist()
        yield _row(key, times[key], current=current, speed=speed)


def closed_form(t: float) -> np.ndarray:
    """Current [A] and speed [rad/s] after ``t`` [s] at ``VOLTS``, from rest."""
    A = np.array([[-R / L, -K / L], [K / ROTOR, -DAMPING / ROTOR]])
    settled = np.linalg.solve(A, [-VOLTS / L, 0.0])
    return np.asarray(settled - expm(A * t) @ settled)
