# SPDX-License-Identifier: Apache-2.0
"""The same input gives the same bits: again, in another instance, in another process, from a fresh
build.
"""

import hashlib
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from samples import covering

import models
from arm_sim import Simulator

OPTIONS: list[dict[str, Any]] = [
    {"integrator": "euler"},
    {"integrator": "semi_implicit_euler"},
    {"integrator": "rk4"},
    {"integrator": "nystrom4"},
    {"tolerance": 1e-9},
]


def fingerprint(sim: Simulator) -> str:
    """Digest of every bit of a short motion under a torque that varies."""
    sim.reset()
    ticks = 50
    torque = 10.0 * np.sin(np.outer(np.arange(ticks), np.arange(1, sim.n + 1)) / 7.0)
    run = sim.run(ticks * sim.dt, torque)
    return hashlib.sha256(
        run.q.tobytes() + run.v.tobytes() + run.local_error.tobytes()
    ).hexdigest()


@pytest.mark.parametrize(
    ("name", "options"),
    [
        *covering(["panda", "gripper"], OPTIONS),
        ("gripper", {"integrator": "rk4", "backend": "vm"}),
    ],
    ids=str,
)
def test_again_and_in_another_instance(name: str, options: dict[str, Any]) -> None:
    first = models.simulator(name, **options)
    other = Simulator(models.scene(name), **options)
    assert fingerprint(first) == fingerprint(first) == fingerprint(other)


def of_a_pendulum() -> str:
    return fingerprint(models.simulator("double_pendulum", integrator="rk4"))


def test_in_another_process_built_afresh(tmp_path: Path) -> None:
    test = Path(__file__).parents[2]
    paths = [str(test), str(test / "support"), str(Path(__file__).parent)]
    code = (
        f"import sys; sys.path[:0] = {paths!r}; import test_determinism; "
        "print(test_determinism.of_a_pendulum())"
    )
    env = {**os.environ, "XDG_CACHE_HOME": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, env=env, timeout=120
    )
    assert done.stdout.strip() == of_a_pendulum(), done.stderr
