# SPDX-License-Identifier: Apache-2.0
"""Write features_together.json: any two features at once, and many, solved independently.

Every single feature, every pair and a dozen random sets of six or more, each on a planar arm and
on a Panda, for a second. What is there already and still belongs to the same scene stays, so an
interrupted run goes on where it was. Run (an hour or so on two cores), here:
PYTHONPATH=.. ../../arm python make_features_together.py
"""

import argparse
import json
import os
import time
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from hashlib import sha256
from pathlib import Path
from typing import Any

os.environ.setdefault("OMP_NUM_THREADS", "1")
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from models import features

FILE = Path(__file__).with_name("features_together.json")
TIMES = np.linspace(0.0, 1.0, 6)
COUNTED = ("sticks", "slides", "impact", "grips", "rubs", "hit", "holds", "kink")
Job = tuple[str, tuple[str, ...]]


def label(chosen: tuple[str, ...]) -> str:
    """The key of a set in the file."""
    return ", ".join(chosen) or "none"


def jobs(arms: list[str]) -> Iterator[Job]:
    """All that are wanted, the short ones first."""
    wanted = [(), *features.sets(1), *features.sets(2), *features.many(12)]
    for arm in arms:
        yield from ((arm, chosen) for chosen in wanted)


def given(arm: str, chosen: tuple[str, ...]) -> tuple[dict[str, Any], dict[str, float], str]:
    """The scene, the command, and what tells them from any other."""
    scene = features.scene(arm, chosen)
    command = features.command(arm, scene)
    text = json.dumps([scene, command, features.LOAD], sort_keys=True)
    return scene, command, sha256(text.encode()).hexdigest()[:16]


def solved(job: Job) -> dict[str, Any]:
    """The motion of a set."""
    from reference.independent import simulate

    began = time.perf_counter()
    scene, command, digest = given(*job)
    loads = [load | features.LOAD for load in scene["payloads"]] if "payloads" in scene else None
    motion = simulate(scene, command, TIMES, loads)
    return {
        "scene": digest,
        "q": motion.q.tolist(),
        "balance": float(abs(motion.balance).max()),
        "events": {kind: len(motion.happened(kind)) for kind in COUNTED if motion.happened(kind)},
        "rates": motion.rates,
        "seconds": round(time.perf_counter() - began, 1),
    }


def main() -> None:
    """Solve what is missing and write the file after each."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--arm", choices=list(features.ARMS), action="append")
    parser.add_argument("--only", help="one set, its features separated by commas")
    parser.add_argument("--jobs", type=int, default=2)
    asked = parser.parse_args()
    found = json.loads(FILE.read_text()) if FILE.exists() else {"time": TIMES.tolist()}
    todo = []
    for job in jobs(asked.arm or list(features.ARMS)):
        have = found.setdefault(job[0], {}).get(label(job[1]), {}).get("scene")
        if asked.only:
            if set(job[1]) == set(asked.only.split(",")):
                todo.append(job)
        elif have != given(*job)[2]:
            todo.append(job)
    with ProcessPoolExecutor(asked.jobs) as pool:
        running = {pool.submit(solved, job): job for job in todo}
        for k, done in enumerate(as_completed(running), 1):
            arm, chosen = running[done]
            try:
                found[arm][label(chosen)] = done.result()
                said = f"{done.result()['seconds']} s {done.result()['balance']:.1e} J"
            except Exception as error:  # one that fails must not stop the others
                said = f"FAILED: {error!r}"
            print(f"{k}/{len(todo)} {arm}: {label(chosen)}: {said}", flush=True)
            part = FILE.with_suffix(".part")
            part.write_text(written(found), encoding="utf-8")
            part.replace(FILE)


def written(found: dict[str, Any]) -> str:
    """JSON with a line for each set."""
    parts = [f'"time": {json.dumps(found["time"])}']
    for arm in (arm for arm in features.ARMS if arm in found):
        rows = [f"{json.dumps(k)}: {json.dumps(v)}" for k, v in sorted(found[arm].items())]
        parts.append(f'"{arm}": {{\n' + ",\n".join(rows) + "\n}")
    return "{\n" + ",\n".join(parts) + "\n}\n"


if __name__ == "__main__":
    main()
