# SPDX-License-Identifier: Apache-2.0
"""From a scene to the first step: in an empty cache, and with the compiled code there already."""

import json
import os
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import yaml

from arm_dynamics import ArmModel, load_scene
from benchmarks.robots.models import chain
from benchmarks.studies.bench import Bench, Record

CHILD = Path(__file__).with_name("startup_child.py")
LINKS = (2, 5, 10, 20, 30, 40, 50)
QUICK_LINKS = (2, 20)
TIAGO = "package://example-robot-data/robots/tiago_description/robots"
# Mobile robots with hands: a stiff scene, dry friction in some joints, or in all of them.
LARGE = {
    "TIAGo": f"robot: {{urdf: {TIAGO}/tiago.urdf}}",
    "TIAGo with two arms": f"robot: {{urdf: {TIAGO}/tiago_dual.urdf}}",
    "TIAGo with two arms, dry": (
        f"robot: {{urdf: {TIAGO}/tiago_dual.urdf}}\n"
        "joints: {'*': {friction: {coulomb: 0.1, viscous: 0.1}}}"
    ),
}


@dataclass(frozen=True)
class _Case:
    """A robot's name, joints, scene file with its ending, and method."""

    name: str
    joints: int
    text: str
    ending: str = ".urdf"
    method: str = "rk4"


def run(bench: Bench) -> Record:
    """Wall time [s] of the parts of a start, every start in a process of its own."""
    growth = [chain(n) for n in (QUICK_LINKS if bench.quick else LINKS)]
    cases = [_Case(robot.name, robot.n, robot.urdf) for robot in (*bench.robots(), *growth)]
    cases += [] if bench.quick else [_large(name, text) for name, text in LARGE.items()]
    rows = [_start(case, bench) for case in bench.each("start-up", cases)]
    return {"rows": rows}


def _large(name: str, text: str) -> _Case:
    joints = ArmModel(load_scene(yaml.safe_load(text))).n
    return _Case(name, joints, text, ".yaml", "auto")


def _start(case: _Case, bench: Bench) -> Record:
    with tempfile.TemporaryDirectory() as folder:
        scene = Path(folder) / f"robot{case.ending}"
        scene.write_text(case.text)
        cache = Path(folder) / "cache"
        cold = _child(scene, cache, case.method)
        warm = [_child(scene, cache, case.method) for _ in range(bench.repeats)]
        size = sum(f.stat().st_size for f in cache.rglob("*") if f.is_file())
    cached = {key: float(np.median([w[key] for w in warm])) for key in cold}
    return {
        "robot": case.name,
        "joints": case.joints,
        "cold_s": cold,
        "cached_s": cached,
        "cached_rounds_s": [w["total without imports"] for w in warm],
        "compiled_bytes": size,
    }


def _child(scene: Path, cache: Path, method: str) -> dict[str, float]:
    cache.mkdir(mode=0o700, exist_ok=True)
    environment = os.environ | {"XDG_CACHE_HOME": str(cache)}
    done = subprocess.run(
        [sys.executable, str(CHILD), str(scene), method],
        env=environment, stdout=subprocess.PIPE, text=True, check=True,
    )  # fmt: skip
    return json.loads(done.stdout)
