# SPDX-License-Identifier: Apache-2.0
"""Write features_together.json: any two features at once, and many, solved independently.

Every single feature, every pair and a dozen random sets of six or more, each on a planar arm and
on a Panda, for a second. What is there already and still belongs to the same scene stays, so an
interrupted run goes on where it was. Run (an hour or so on two cores), here:
PYTHONPATH=.. ../../arm python make_features_together.py
"""

import json
import os
from collections.abc import Iterator
from concurrent.futures import ProcessPoolExecutor, as_completed
from hashlib import sha256
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from models import features
from reference.independent import simulate

FILE = Path(__file__).with_name("features_together.json")
TIMES = np.linspace(0.0, 1.0, 6)
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
    scene, command, digest = given(*job)
    loads = [load | features.LOAD for load in scene.get("payloads", ())]
    motion = simulate(scene, command, TIMES, loads)
    return {
        "scene": digest,
        "q": motion.q.tolist(),
        "balance": float(abs(motion.balance).max()),
    }


def main() -> None:
    """Solve what is missing and write the file after each."""
    found = json.loads(FILE.read_text()) if FILE.exists() else {"time": TIMES.tolist()}
    todo = [
        (arm, chosen) for arm, chosen in jobs(list(features.ARMS))
        if found.setdefault(arm, {}).get(label(chosen), {}).get("scene") != given(arm, chosen)[2]
    ]  # fmt: skip
    with ProcessPoolExecutor(2) as pool:
        running = {pool.submit(solved, job): job for job in todo}
        for done in as_completed(running):
            arm, chosen = running[done]
            print(f"{arm}: {label(chosen)}: {done.exception() or 'solved'}", flush=True)
            if not done.exception():  # one that fails must not stop the others
                found[arm][label(chosen)] = done.result()
                FILE.write_text(written(found), encoding="utf-8")


def written(found: dict[str, Any]) -> str:
    """JSON with a line for each set."""
    parts = [f'"time": {json.dumps(found["time"])}']
    for arm in (arm for arm in features.ARMS if arm in found):
        rows = [f"{json.dumps(k)}: {json.dumps(v)}" for k, v in sorted(found[arm].items())]
        parts.append(f'"{arm}": {{\n' + ",\n".join(rows) + "\n}")
    return "{\n" + ",\n".join(parts) + "\n}\n"


if __name__ == "__main__":
    main()
