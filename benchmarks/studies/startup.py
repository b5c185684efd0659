# SPDX-License-Identifier: Apache-2.0
"""From a scene to the first step: in an empty cache, and with the compiled code there already."""

import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import yaml

from arm_dynamics import ArmModel, load_scene
from benchmarks.robots.models import chain
from benchmarks.studies.bench import Bench, Record

CHILD = Path(__file__).with_name("startup_child.py")
LINKS = (2, 5, 10, 20, 30, 40, 50)
QUICK_LINKS = (2, 20)
TIAGO = "robot: {urdf: package://example-robot-data/robots/tiago_description/robots/tiago.urdf}"


def run(bench: Bench) -> Record:
    """Wall time [s] of the parts of a start, every start in a process of its own."""
    growth = [chain(n) for n in (QUICK_LINKS if bench.quick else LINKS)]
    robots = [*bench.robots(), *growth]
    cases = [(robot.name, robot.n, robot.urdf, ".urdf", "rk4") for robot in robots]
    if not bench.quick:
        joints = ArmModel(load_scene(yaml.safe_load(TIAGO))).n
        cases.append(("TIAGo", joints, TIAGO, ".yaml", "auto"))
    return {"rows": [_start(bench, *case) for case in bench.each("start-up", cases)]}


def _start(
    bench: Bench, name: str, joints: int, text: str, ending: str, method: str
) -> Record:  # fmt: skip
    with tempfile.TemporaryDirectory() as folder:
        scene = Path(folder) / f"robot{ending}"
        scene.write_text(text)
        cache = Path(folder) / "cache"
        cold = _child(scene, cache, method)
        warm = [_child(scene, cache, method) for _ in range(bench.repeats)]
    cached = {key: float(np.median([w[key] for w in warm])) for key in cold}
    return {
        "robot": name,
        "joints": joints,
        "cold_s": cold,
        "cached_s": cached,
        "cold_rounds_s": [cold["total without imports"]],
        "cached_rounds_s": [w["total without imports"] for w in warm],
    }


def _child(scene: Path, cache: Path, method: str) -> dict[str, float]:
    cache.mkdir(mode=0o700, exist_ok=True)
    environment = os.environ | {"XDG_CACHE_HOME": str(cache)}
    done = subprocess.run(
        [sys.executable, str(CHILD), str(scene), method],
        env=environment, stdout=subprocess.PIPE, text=True, check=True,
    )  # fmt: skip
    return json.loads(done.stdout)
