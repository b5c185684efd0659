# SPDX-License-Identifier: Apache-2.0
"""Run the studies one after another and gather what they found."""

import datetime
import logging
import platform
import time
from collections.abc import Callable, Iterator, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from rich.console import Console

from benchmarks.comparison import claims, targets
from benchmarks.peers import installed, ours
from benchmarks.peers.base import OURS
from benchmarks.reporting.progress import Bar
from benchmarks.studies import (
    closed_chain,
    cost,
    energy,
    features,
    model_agreement,
    rollouts,
    startup,
    work_precision,
)
from benchmarks.studies.bench import Bench, Record

RUNNERS: dict[str, Callable[[Bench], Record]] = {
    "model_agreement": model_agreement.run,
    "work_precision": work_precision.run,
    "cost": cost.run,
    "features": features.run,
    "closed_chain": closed_chain.run,
    "rollouts": rollouts.run,
    "energy": energy.run,
    "startup": startup.run,
}
STUDIES = tuple(RUNNERS)
PACKAGES = (
    "mujoco", "drake", "exudyn", "dynibo", "scipy", "pin", "casadi", "numpy",
)  # fmt: skip


def run(quick: bool, only: Sequence[str], console: Console) -> Iterator[Record]:
    # Steps that are too long for a scene are part of what is measured.
    logging.getLogger("arm_sim").setLevel(logging.ERROR)
    peers, missing = installed()
    for name, reason in missing.items():
        console.print(f"left out: {name} ({reason})")
    began, results = time.perf_counter(), Record()
    with Bar(console) as bar:
        bench = Bench([*ours.contestants(), *peers], bar, quick)
        for name in (name for name in STUDIES if name in only):
            results[name] = RUNNERS[name](bench)
            about = _about(bench, missing, time.perf_counter() - began)
            yield judged({"about": about} | results)


def judged(results: Record) -> Record:
    """The results with what follows from them: the cost of an error, and the promises."""
    more: Record = {"claims": claims.check(results)}
    if "work_precision" in results:
        more["targets"] = targets.table(results["work_precision"]["points"], OURS)
    return results | more


def _about(bench: Bench, missing: dict[str, str], elapsed: float) -> Record:
    return {
        "date": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "quick": bench.quick,
        "repeats": bench.repeats,
        "elapsed_s": elapsed,
        "processor": processor(),
        "compiler": ours.backend(),
        "python": platform.python_version(),
        "versions": {name: v for name in PACKAGES if (v := _version(name))},
        "left_out": missing,
        "notes": {c.name: c.note for c in bench.contestants if c.note},
        "noise": bench.noise.summary(),
    }


def _version(package: str) -> str | None:
    try:
        return version(package)
    except PackageNotFoundError:
        return None


def processor() -> str:
    """Its name, the number of its cores and its widest vectors."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.processor()
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    wide = next((w for w in ("avx512f", "avx2") if any(w in line for line in lines)), "no AVX2")
    return f"{names[0] if names else platform.machine()}, {len(names)} cores, {wide}"
