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

OPTIONS: dict[str, dict[str, Any]] = {
    "rk4": {"integrator": "rk4"},
    "nystrom4": {"integrator": "nystrom4"},
    "semi-implicit": {"integrator": "semi_implicit_euler"},
    "adaptive": {"tolerance": 1e-9},
    "virtual machine": {"integrator": "rk4", "backend": "vm"},
}


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
    ("name", "options"), covering(["panda", "gripper"], OPTIONS.values()), ids=str
)
def test_again_and_in_another_instance(name: str, options: dict[str, Any]) -> None:
    first = models.simulator(name, **options)
    prints = {
        fingerprint(first),
        fingerprint(first),
        fingerprint(Simulator(models.scene(name), **options)),
    }
    assert len(prints) == 1


def test_in_another_process_built_afresh(tmp_path: Path) -> None:
    here = Path(__file__)
    paths = [str(here.parents[2]), str(here.parents[2] / "support"), str(here.parent)]
    code = (
        f"import sys; sys.path[:0] = {paths!r}; import models, test_determinism; "
        "print(test_determinism.fingerprint(models.simulator('two_link', integrator='rk4')))"
    )
    env = {**os.environ, "XDG_CACHE_HOME": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, env=env, timeout=120
    )
    assert done.stdout.strip() == fingerprint(models.simulator("two_link", integrator="rk4")), (
        done.stderr
    )


def test_numeric_answers_do_not_depend_on_what_was_asked_before(rng: np.random.Generator) -> None:
    dyn = models.dynamics("kinova")
    q, v, a = models.random_state(rng, dyn.n)
    first = dyn.inverse(q, v, a)
    for _ in range(3):
        other = models.random_state(rng, dyn.n)
        dyn.forward(*other)
        dyn.energy(other[0], other[1])
        dyn.coriolis_matrix(other[0], other[1])
    np.testing.assert_array_equal(dyn.inverse(q, v, a), first)
