# SPDX-License-Identifier: Apache-2.0
"""What a scene does not need costs nothing: operations and ns with each feature on or off."""

from typing import Any

import numpy as np

from benchmarks.measurement.timing import Job, steady
from benchmarks.robots.models import panda
from benchmarks.studies.bench import Bench, Record

STEPS = 1000
STEP = 1e-3
Scene = dict[str, Any]
DRY: Scene = {"coulomb": 1.0}
TABLE: Scene = {"at": [-1.0, 0.0, 1.0], "factor": [1.0, 1.5, 1.0]}
LOAD: Scene = {"at": [0.0, 20.0], "factor": [1.0, 2.0]}
LUGRE: Scene = DRY | {"viscous": 0.5, "lugre": {"sigma0": 1e5, "sigma1": 316.0}}

MOTOR: Scene = {
    "resistance": 0.8, "torque_constant": 0.1, "rotor_inertia": 3e-5, "gear_ratio": 100.0,
}  # fmt: skip
VOLTAGE: Scene = MOTOR | {"command": "voltage"}
BELT: Scene = {"stiffness": 3e3, "damping": 3.0}
HARMONIC: Scene = BELT | {
    "stiffening": 1e6,
    "hysteresis": {"torque": 1.0, "deflection": 1e-3},
    "kinematic_error": {"amplitude": 1e-4, "order": 2},
}


def scenes() -> dict[str, Scene]:
    """The bare Panda, and the bare Panda with one thing added or taken away."""
    robot = {"urdf": panda().urdf}
    bare: Scene = {"robot": robot}
    ball = [1e-2, 0, 0, 1e-2, 0, 1e-2]
    load = {"frame": "link7", "mass": 1.2, "com": [0, 0, 0.1], "inertia": ball}
    names = [f"panda_joint{i}" for i in range(1, 8)]
    return {
        "bare arm: inertia, Coriolis, gravity": bare,
        "− gravity": bare | {"gravity": [0, 0, 0]},
        "− three wrist joints (locked)": {"robot": robot | {"lock": names[4:]}},
        "− six joints (locked)": {"robot": robot | {"lock": names[1:]}},
        "+ viscous friction": bare | _all(friction={"viscous": 0.5}),
        "+ dry friction, by events": bare | _all(friction={"coulomb": 1.0}),
        "+ viscous friction by direction": bare
        | _all(friction={"viscous": {"positive": 0.5, "negative": 0.3}}),
        "+ dry friction by position": bare | _all(friction=DRY | {"position": TABLE}),
        "+ dry friction by load": bare | _all(friction=DRY | {"load": LOAD}),
        "+ LuGre friction, implicit, error control": bare | _all(friction=LUGRE),
        "+ motor inertia": bare | _all(armature=0.1),
        "+ motors, torque commanded": bare | _all(actuator=MOTOR),
        "+ motors, voltage commanded": bare | _all(actuator=VOLTAGE),
        "+ motors with inductance, 7 states": bare | _all(actuator=VOLTAGE | {"inductance": 8e-4}),
        "+ gears that lose power, by events": bare | _all(actuator=MOTOR | {"efficiency": 0.8}),
        "+ flexible joints, 14 states": bare | _all(actuator=MOTOR, transmission=BELT),
        "+ harmonic drives, 21 states": bare | _all(actuator=MOTOR, transmission=HARMONIC),
        "+ effort limits": bare | _all(limits={"effort": 87.0}),
        "+ payload": bare | {"payloads": [load]},
        "+ tunable gravity": bare | {"tunable": ["gravity"]},
        "+ tunable friction": bare | {"tunable": ["friction"]},
        "+ tunable payload": bare | {"payloads": [load], "tunable": ["payload"]},
        "viscous, inertia, limits, tunables": bare
        | {"payloads": [load], "tunable": ["gravity", "friction", "payload"]}
        | _all(friction={"viscous": 0.5}, armature=0.1, limits={"effort": 87.0}),
    }


def run(bench: Bench) -> Record:
    from arm_sim import Simulator

    jobs: dict[str, Job] = {}
    operations: dict[str, int] = {}
    for label, scene in bench.each("building scenes", list(scenes().items())):
        simulator = Simulator(scene, integrator="rk4", dt=STEP)
        operations[label] = simulator.plan.operations
        jobs[label] = _job(simulator)
    costs = bench.time("cost of each feature", jobs)
    rows = [
        {"scene": label, "operations": operations[label], "ns": costs[label].median * 1e9}
        for label in jobs
    ]
    return {"robot": "Panda", "rows": rows}


def _job(simulator: Any) -> Job:
    q0 = np.resize(panda().q0, simulator.n)
    still = np.zeros(simulator.n)
    job = steady(lambda: simulator.reset(q0, still), lambda: simulator.run(STEPS * STEP))
    return lambda: job() / STEPS


def _all(**settings: Any) -> Scene:
    return {"joints": {"*": settings}}
