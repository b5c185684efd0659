# SPDX-License-Identifier: Apache-2.0
"""frax, in JAX on the processor: it integrates nothing, so it is compared by the evaluation."""

from __future__ import annotations

import os
import time
import warnings
import xml.etree.ElementTree as ET

import jax

from benchmarks.measurement.timing import Job
from benchmarks.peers.pinocchio import BATCH, states
from benchmarks.robots.models import Robot
from benchmarks.robots.urdf import in_file

# As it advises for one core, before JAX looks for processors.
FLAGS = (
    "--xla_cpu_multi_thread_eigen=false",
    "--xla_cpu_scheduler_type=CPU_SCHEDULER_TYPE_MEMORY_OPTIMIZED",
)
os.environ["XLA_FLAGS"] = " ".join((os.environ.get("XLA_FLAGS", ""), *FLAGS))
jax.config.update("jax_enable_x64", True)
with warnings.catch_warnings():
    warnings.simplefilter("ignore")  # of environment variables, some of which it wants as text
    import frax

BASE = (
    '<inertial><mass value="1"/>'
    '<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial>'
)
"""It expects an inertia of every link, also of the base that stands still."""


def batched(robot: Robot) -> Job:
    """Seconds for one ``forward_dynamics`` of many, mapped and compiled by JAX.

    Those of the whole process, since JAX computes on a thread of its own.
    """
    arm, some = _arm(robot), [x.T.copy() for x in states(robot)]
    evaluate = jax.jit(jax.vmap(lambda q, v, tau: arm.forward_dynamics(q, v, tau, None)))

    def once() -> float:
        start = time.process_time()
        evaluate(*some).block_until_ready()
        return (time.process_time() - start) / BATCH

    once()  # which compiles
    return once


def _arm(robot: Robot) -> frax.Robot:
    tree = ET.fromstring(robot.urdf)
    for link in tree.iter("link"):
        if link.find("inertial") is None:
            link.append(ET.fromstring(BASE))
    with in_file(ET.tostring(tree, encoding="unicode")) as path:
        return frax.Robot(path)
