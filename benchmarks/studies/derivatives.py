# SPDX-License-Identifier: Apache-2.0
"""Derivatives of a tick of a Panda: smooth, with dry friction, in contact; and gradients."""

from __future__ import annotations

from benchmarks.derivatives.contenders import Arm
from benchmarks.measurement.timing import steady
from benchmarks.peers.base import OURS
from benchmarks.robots.models import panda
from benchmarks.studies.bench import Bench, Record

_TASKS = {
    "A and B of a tick": {
        "linearize_many, in SIMD lanes": f"{OURS} linearize_many, in vector lanes",
        "linearize, one call from Python": f"{OURS} linearize, from Python",
        "MuJoCo, 3n + 1 RK4 steps": "MuJoCo, forward differences of RK4 steps",
        "MuJoCo, mjd_transitionFD of Euler's step": "MuJoCo mjd_transitionFD of Euler's step",
    },
    "A and B, dry friction in all joints": {
        "linearize_many, dry friction": f"{OURS} linearize_many",
        "linearize, dry friction, one call from Python": f"{OURS} linearize, from Python",
        "MuJoCo, mjd_transitionFD with friction loss": "MuJoCo mjd_transitionFD of Euler's step",
    },
    "A and B, above a table": {"linearize_many, above a table": f"{OURS} linearize_many"},
    "A and B, sliding on a table": {
        "linearize_many, sliding on the table": f"{OURS} linearize_many"
    },
    "a tick of a gradient": {"rollout_gradient, a tick": f"{OURS} rollout_gradient"},
    "a tick of a gradient, dry friction": {
        "rollout_gradient, a tick, dry friction": f"{OURS} rollout_gradient"
    },
}


def run(bench: Bench) -> Record:
    """Processor time of each derivative, in [ns]."""
    arm = Arm(panda())
    given = arm.ours() | arm.rough() | arm.gradients() | arm.mujoco()
    jobs = {
        (what, who): given[key]
        for what, names in _TASKS.items()
        for key, who in names.items()
        if key in given
    }
    costs = bench.time("derivatives", {
        key: steady(lambda: None, call) for key, (call, _) in jobs.items()
    })  # fmt: skip
    return {"rows": [
        {"what": what, "who": who, "ns": 1e9 * cost.median / jobs[what, who][1]}
        for (what, who), cost in costs.items()
    ]}  # fmt: skip
