# SPDX-License-Identifier: Apache-2.0
"""Dry and LuGre friction: error and time of the suite and of MuJoCo, in one run.

Dry friction against MuJoCo's ``frictionloss``: where a wheel coasts to rest, in closed form, and
whether a torque below the level moves it. LuGre against the bristles of MuJoCo's ``dcmotor``: the
courses of ``test/reference/make_lugre.py`` on the wheels whose σ1 is constant, as it is there.
"""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterator
from importlib.util import module_from_spec, spec_from_file_location
from typing import Any

import numpy as np

try:
    import mujoco
except ImportError:  # only to compare with
    mujoco = None

from arm_sim import Simulator
from benchmarks.accuracy.motors import timed
from benchmarks.accuracy.problems import ROOT
from benchmarks.accuracy.sweep import Row
from benchmarks.reporting.markdown import number, table

J, FC, B, W0 = 0.1, 0.5, 0.2, 5.0  # [kg m²], [N m], [N m s/rad], [rad/s]
STOP = J * W0 / B - J * FC / B**2 * np.log1p(B * W0 / FC)  # [rad], where J w' = -FC - B w ends
PUSH = 0.9 * FC
OURS: dict[str, dict[str, Any]] = {
    "`rk4`": {"integrator": "rk4"},
    "tolerance 1e-9": {"tolerance": 1e-9},
}
BRISTLES: dict[str, dict[str, Any]] = {
    "as a scene gets it": {},
    "tolerance 1e-8": {"tolerance": 1e-8},
}
STEPS = {"Euler": (1e-3, 1e-4, 1e-5), "implicitfast": (1e-3, 1e-4, 1e-5), "RK4": (1e-3, 1e-4)}
REFERENCE = ROOT / "test/reference"


def rows() -> Iterator[Row]:
    """Error and time of each engine, method and step on both laws."""
    if mujoco:
        mujoco.set_mju_user_warning(lambda text: None)  # of motions that are lost; the table says
    yield from _dry()
    yield from _lugre()


def page(found: list[Row], law: str) -> str:
    """The table of one law."""
    heads = ["", "method", "step", "error [rad]", "creep [rad]", "ms for a second"]
    if law == "LuGre":
        heads[3:5] = ["median error [rad]", "largest"]
    return table(heads, [
        (
            row["engine"], row["method"], f"{row['step_s'] * 1e3:g} ms",
            _said(row["error" if law == "dry" else "median"]),
            _said(row["creep" if law == "dry" else "error"]), number(row["second_s"] * 1e3, 2),
        )
        for row in found if row["law"] == law
    ])  # fmt: skip


def _said(error: float) -> str:
    if error == 0.0:
        return "0"
    return number(error, 1) if error < 10.0 else "lost"


def _row(law: str, key: tuple[str, str, float], second: float, **figures: float) -> Row:
    engine, method, step = key
    found = {"law": law, "engine": engine, "method": method, "step_s": step, "second_s": second}
    return found | figures


def _dry() -> Iterator[Row]:
    engines: dict[Any, Any] = {
        ("this suite", name, 1e-3): _Ours({"viscous": B, "coulomb": FC}, J, **options)
        for name, options in OURS.items()
    }
    for name, h in _steps():
        engines["MuJoCo", name, h] = _Theirs(J, B, h, name, f'frictionloss="{FC}"', "")
    times = timed({key: _coast(engine) for key, engine in engines.items()})
    for key, engine in engines.items():
        error = abs(engine.course(W0, ((1.0, 0.0),)) - STOP)
        creep = abs(engine.course(0.0, ((1.0, PUSH),)))
        yield _row("dry", key, times[key], error=error, creep=creep)


def _coast(engine: Any) -> Callable[[], Any]:
    return lambda: engine.course(W0, ((1.0, 0.0),))


def _lugre() -> Iterator[Row]:
    courses = _courses()
    wheels = json.loads((REFERENCE / "lugre.json").read_text())["wheels"]
    same = [case for case in wheels if case["wheel"]["sigma1_velocity"] is None]
    keys = [("this suite", name, 1e-3) for name in BRISTLES]
    for key in keys + [("MuJoCo", name, h) for name, h in _steps()]:
        engines = [(_wheel(case["wheel"], key), case["angle"]) for case in same]
        errors = [
            abs(engine.course(*courses[name]) - angle[name])
            for engine, angle in engines
            for name in courses
        ]
        kept = np.nan_to_num(np.array(errors), nan=np.inf)
        second = timed({0: _reverse(engines[0][0], courses)})[0]
        figures = {"median": float(np.median(kept)), "error": float(kept.max())}
        yield _row("LuGre", key, 2.0 * second, **figures)


def _reverse(engine: Any, courses: dict[str, Any]) -> Callable[[], Any]:
    """Half a second of the hardest course."""
    return lambda: engine.course(*courses["reverse"])


def _wheel(w: dict[str, Any], key: tuple[str, str, float]) -> Any:
    levels = {name: w[name] for name in ("viscous", "coulomb", "static", "stribeck_velocity")}
    if key[0] == "this suite":
        if levels["static"] == levels["coulomb"]:  # then a Stribeck velocity would do nothing
            del levels["stribeck_velocity"]
        law = levels | {"lugre": {"sigma0": w["sigma0"], "sigma1": w["sigma1"]}}
        return _Ours(law, w["J"], **BRISTLES[key[1]])
    five = [w[n] for n in ("sigma0", "sigma1", "coulomb", "static", "stribeck_velocity")]
    # A motor without torque: its constant is too small to be felt.
    bristles = f"""<actuator><dcmotor joint="a" motorconst="1e-9 1e-9" resistance="1"
      lugre="{" ".join(map(repr, five))}"/></actuator>"""
    return _Theirs(w["J"], w["viscous"], key[2], key[1], "", bristles)


def _steps() -> list[tuple[str, float]]:
    return [(name, h) for name, steps in STEPS.items() for h in steps] if mujoco else []


def _courses() -> dict[str, Any]:
    """Initial speed and steps of torque, from the script that made the reference."""
    spec = spec_from_file_location("make_lugre", REFERENCE / "make_lugre.py")
    assert spec is not None and spec.loader is not None
    module = module_from_spec(spec)
    sys.modules["make_lugre"] = module  # a dataclass looks itself up there
    spec.loader.exec_module(module)
    return dict(module.COURSES)


class _Ours:
    """A wheel in this suite."""

    def __init__(self, friction: dict[str, Any], inertia: float, **options: Any) -> None:
        urdf = f"""<robot name="wheel"><link name="base"/><link name="wheel"><inertial>
          <mass value="1"/><inertia ixx="{inertia}" ixy="0" ixz="0" iyy="{inertia}" iyz="0"
          izz="{inertia}"/></inertial></link><joint name="axle" type="continuous">
          <parent link="base"/><child link="wheel"/><axis xyz="0 0 1"/></joint></robot>"""
        scene = {"robot": {"urdf": urdf}, "joints": {"axle": {"friction": friction}}}
        self._sim = Simulator(scene, dt=1e-3, **options)

    def course(self, v0: float, steps: Any) -> float:
        """Angle after steps of torque from ``v0``."""
        self._sim.reset(v=[v0])
        for duration, u in steps:
            self._sim.run(duration, [u])
        return float(self._sim.state.q[0])


class _Theirs:
    """The same wheel in MuJoCo, with all that it does not need switched off."""

    def __init__(
        self, inertia: float, damping: float, step: float, method: str, joint: str, actuator: str
    ) -> None:
        self._model = mujoco.MjModel.from_xml_string(f"""<mujoco>
          <option timestep="{step}" integrator="{method}" gravity="0 0 0">
            <flag contact="disable" sensor="disable"/></option>
          <worldbody><body><joint name="a" axis="0 0 1" damping="{damping}" {joint}/>
            <inertial pos="0 0 0" mass="1" diaginertia="{inertia} {inertia} {inertia}"/>
          </body></worldbody>{actuator}</mujoco>""")
        self._data, self._step = mujoco.MjData(self._model), step

    def course(self, v0: float, steps: Any) -> float:
        """Angle after steps of torque from ``v0``."""
        mujoco.mj_resetData(self._model, self._data)
        self._data.qvel[0] = v0
        for duration, u in steps:
            self._data.qfrc_applied[0] = u
            mujoco.mj_step(self._model, self._data, nstep=round(duration / self._step))
        lost = self._data.warning[mujoco.mjtWarning.mjWARN_BADQACC].number > 0
        return np.nan if lost else float(self._data.qpos[0])
