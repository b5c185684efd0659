# SPDX-License-Identifier: Apache-2.0
"""Derivatives of a tick of a Panda, smooth and with dry friction, and gradients of rollouts."""

from __future__ import annotations

from benchmarks.derivatives.contenders import Arm, Contender
from benchmarks.measurement.timing import steady
from benchmarks.peers.base import OURS
from benchmarks.robots.models import panda
from benchmarks.studies.bench import Bench, Record

SMOOTH, DRY, GRADIENT = "A and B of a tick", "A and B, dry friction", "a tick of a gradient"
FRICTION = 1.0  # [N m], of all joints
_SMOOTH = {
    "linearize_many, in SIMD lanes": f"{OURS} linearize_many, in vector lanes",
    "linearize, one call from Python": f"{OURS} linearize, from Python",
    "MuJoCo, 3n + 1 RK4 steps": "MuJoCo, forward differences of RK4 steps",
    "MuJoCo, mjd_transitionFD of Euler's step": "MuJoCo mjd_transitionFD of Euler's step",
}
_DRY = {key: who for key, who in _SMOOTH.items() if "lanes" not in key and "3n" not in key}
_GRADIENT = {
    "rollout_gradient, a tick": f"{OURS} rollout_gradient",
    "rollout, a tick": f"{OURS} rollout, without a gradient",
}


def run(bench: Bench) -> Record:
    """Processor time of each derivative, in [ns]."""
    smooth, dry = Arm(panda()), Arm(panda(), FRICTION)
    both = smooth.ours() | smooth.mujoco()
    jobs = {
        **_named(SMOOTH, both, _SMOOTH),
        **_named(DRY, dry.ours() | dry.mujoco(), _DRY),
        **_named(GRADIENT, smooth.gradients(), _GRADIENT),
    }
    costs = bench.time("derivatives", {
        key: steady(lambda: None, call) for key, (call, _) in jobs.items()
    })  # fmt: skip
    return {"rows": [
        {"what": what, "who": who, "ns": 1e9 * cost.median / jobs[what, who][1]}
        for (what, who), cost in costs.items()
    ]}  # fmt: skip


def _named(
    what: str, given: dict[str, Contender], names: dict[str, str]
) -> dict[tuple[str, str], Contender]:
    return {(what, who): given[key] for key, who in names.items() if key in given}
