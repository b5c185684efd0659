# SPDX-License-Identifier: Apache-2.0
"""A closed chain: what a step of a four-bar costs, and what error it buys.

The peers are Pinocchio's ``constraintDynamics``, which integrates nothing, and MuJoCo's
``equality``. Error is that of the crank angle after one second, against the linkage's equation in
its one coordinate (test/reference/linkages.json).
"""

import json
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.measurement.timing import Cost, Job, steady
from benchmarks.peers.base import OURS
from benchmarks.peers.pinocchio import BATCH, in_one_thread
from benchmarks.studies.bench import Bench, Record
from benchmarks.studies.cost import repeated

REFERENCE = Path(__file__).parents[2] / "test/reference/linkages.json"
SCENE = "four_bar"
STEPS = {"rk4": (4e-3, 2e-3, 1e-3, 5e-4), "Euler": (1e-3, 1e-4), "RK4": (1e-3, 2e-4, 1e-4)}
TICKS = 1000
ROD = (
    '<geom type="capsule" fromto="0 0 0 {length} 0 0" size="0.001" mass="0"/>'
    '<inertial pos="{half} 0 0" mass="{mass}" diaginertia="1e-9 {inertia} {inertia}"/>'
)


def run(bench: Bench) -> Record:
    """Cost and error of the four-bar in every simulator that is there."""
    start, end = (_state(t) for t in ("0", "1"))
    jobs: dict[str, Job] = {}
    errors: dict[str, tuple[float, float]] = {}
    for method, steps in STEPS.items():
        for step in steps:
            if method == "rk4":
                name = f"{OURS} rk4, {step * 1e3:g} ms"
                jobs[name], error = _ours(step, start, end)
            elif find_spec("mujoco"):
                name = f"MuJoCo {method} with equality, {step * 1e3:g} ms"
                jobs[name], error = _mujoco(method, step, start, end)
            else:
                continue
            errors[name] = step, error
    call, plain, compiled = _pinocchio(start)
    jobs |= {"call": call, "plain": plain, "compiled": compiled}
    costs = bench.time("closed chain", jobs)
    return {
        "rows": [_row(name, costs[name], *errors[name]) for name in errors],
        "pinocchio_rounds_ns": [
            _from_cpp({name: cost.samples[k] for name, cost in costs.items()}) * 1e9
            for k in range(bench.repeats)
        ],
    }


def _row(name: str, cost: Cost, step: float, error: float) -> Record:
    c = cost.scaled(1e9)
    about = {"who": name, "step": step, "error": error}
    return about | {"ns": c.median, "rounds_ns": list(c.samples)}


def _from_cpp(costs: dict[str, float]) -> float:
    """``constraintDynamics`` without what the binding takes of a call, which ``aba`` shows."""
    return costs["call"] - (costs["plain"] - costs["compiled"])


def _state(t: str) -> tuple[np.ndarray, np.ndarray]:
    known = json.loads(REFERENCE.read_text())[SCENE][t]
    return tuple(np.array([float(x) for x in known[key]]) for key in ("q", "v"))  # type: ignore[return-value]


def _ours(step: float, start: Any, end: Any) -> tuple[Job, float]:
    from arm_sim import Simulator

    sim = Simulator(_scene(), integrator="rk4", dt=step)
    sim.reset(*start)
    error = abs(sim.run(1.0).q[-1, 0] - end[0][0])
    job = steady(lambda: sim.reset(*start), lambda: sim.run(TICKS * step))
    return (lambda: job() / TICKS), float(error)


def _scene() -> Any:
    """The linkage with the moon's gravity, as in the reference."""
    import arm_sim
    from arm_dynamics import load_scene

    plain = load_scene(Path(arm_sim.__file__).parent / f"scenes/{SCENE}.yaml")
    return load_scene(plain.model_dump(exclude_unset=True) | {"gravity": [0, 0, -1.62]})


def _mujoco(method: str, step: float, start: Any, end: Any) -> tuple[Job, float]:
    import mujoco

    from benchmarks.peers.mujoco import METHODS

    model = mujoco.MjModel.from_xml_string(_mjcf())
    model.opt.integrator, model.opt.timestep = METHODS[method], step
    data = mujoco.MjData(model)

    def reset() -> None:
        mujoco.mj_resetData(model, data)
        data.qpos[:], data.qvel[:] = start

    reset()
    mujoco.mj_step(model, data, nstep=round(1.0 / step))
    error = abs(data.qpos[0] - end[0][0])
    job = steady(reset, lambda: mujoco.mj_step(model, data, nstep=TICKS))
    return (lambda: job() / TICKS), float(error)


def _mjcf() -> str:
    """The same linkage for MuJoCo; its URDF reader knows no loops."""

    def rod(name: str, place: str, length: float, mass: float, inside: str) -> str:
        numbers = {"length": length, "half": length / 2, "mass": mass}
        body = ROD.format(**numbers, inertia=mass * length**2 / 12)
        hinge = '<joint type="hinge" axis="0 -1 0"/>'
        return f'<body name="{name}" pos="{place}">{hinge}{body}{inside}</body>'

    coupler = rod("coupler", "0.1 0 0", 0.3, 0.6, '<site name="a" pos="0.3 0 0"/>')
    crank = rod("crank", "0 0 0", 0.1, 0.2, coupler)
    rocker = rod("rocker", "0.35 0 0", 0.25, 0.5, '<site name="b" pos="0.25 0 0"/>')
    return (
        '<mujoco><compiler angle="radian"/><option gravity="0 0 -1.62">'
        '<flag contact="disable" limit="disable"/></option><default><geom contype="0"/></default>'
        f"<worldbody>{crank}{rocker}</worldbody>"
        '<equality><connect site1="a" site2="b"/></equality></mujoco>'
    )


def _pinocchio(start: Any) -> tuple[Job, Job, Job]:
    """Seconds of one constrained evaluation, of one ``aba``, and of ``aba`` from C++."""
    import pinocchio as pin

    from arm_dynamics import ArmModel, load_scene

    arm = ArmModel(load_scene(_scene()))
    model = arm.pin
    places = []
    for name, point in (("coupler", 0.3), ("rocker", 0.25)):
        frame = model.frames[model.getFrameId(name)]
        tip = pin.SE3(np.eye(3), np.array([point, 0.0, 0.0]))
        places += [frame.parentJoint, frame.placement * tip]
    loop = pin.RigidConstraintModel(pin.ContactType.CONTACT_3D, model, *places)
    data, held = model.createData(), loop.createData()
    pin.initConstraintDynamics(model, data, [loop], [held])
    loops, loop_data = pin.StdVec_RigidConstraintModel(), pin.StdVec_RigidConstraintData()
    loops.append(loop)
    loop_data.append(held)
    settings = pin.ProximalSettings(1e-12, 1e-10, 3)
    q, v, tau = arm.configuration(start[0]), start[1], np.zeros(3)

    def constrained() -> object:
        return pin.constraintDynamics(model, data, q, v, tau, loops, loop_data, settings)

    world = pin.Convention.WORLD
    plain = repeated(lambda: pin.aba(model, data, q, v, tau, world))
    columns = (np.asfortranarray(np.tile(x[:, None], BATCH)) for x in (q, v, tau))
    return repeated(constrained), plain, in_one_thread(model, *columns)
