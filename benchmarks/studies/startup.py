# SPDX-License-Identifier: Apache-2.0
"""From a scene to the first step: in an empty cache, and with the compiled code there already."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from benchmarks.robots.models import Robot, chain
from benchmarks.studies.bench import Bench, Record

CHILD = Path(__file__).with_name("startup_child.py")
LINKS = (2, 5, 10, 20, 30, 40, 50)
QUICK_LINKS = (2, 20)


def run(bench: Bench) -> Record:
    """Wall time [s] of the parts of a start, every start in a process of its own."""
    growth = [chain(n) for n in (QUICK_LINKS if bench.quick else LINKS)]
    robots = [*bench.robots(), *growth]
    rows = [_start(robot, bench) for robot in bench.each("start-up", robots)]
    return {"rows": rows}


def _start(robot: Robot, bench: Bench) -> Record:
    with tempfile.TemporaryDirectory() as folder:
        scene = Path(folder) / "robot.urdf"
        scene.write_text(robot.urdf)
        cache = Path(folder) / "cache"
        cold = _child(scene, cache)
        warm = [_child(scene, cache) for _ in range(bench.repeats)]
        size = sum(f.stat().st_size for f in cache.rglob("*") if f.is_file())
    cached = {key: float(np.median([w[key] for w in warm])) for key in cold}
    return {
        "robot": robot.name,
        "joints": robot.n,
        "cold_s": cold,
        "cached_s": cached,
        "compiled_bytes": size,
    }


def _child(scene: Path, cache: Path) -> dict[str, float]:
    cache.mkdir(mode=0o700, exist_ok=True)
    environment = os.environ | {"XDG_CACHE_HOME": str(cache)}
    done = subprocess.run(
        [sys.executable, str(CHILD), str(scene)],
        env=environment, stdout=subprocess.PIPE, text=True, check=True,
    )  # fmt: skip
    return json.loads(done.stdout)
