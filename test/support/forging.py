# SPDX-License-Identifier: Apache-2.0
"""Starts ``forge.py``, and programs by it."""

import os
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

from harness import reserve_domain, surroundings

ROOT = Path(__file__).parents[2]


def asking(forge: Path) -> list[str | Path]:
    """Words that have something run a command, which follows."""
    return [sys.executable, "-I", "-S", ROOT / "test/support/forge.py", forge]


@contextmanager
def forging(folder: Path) -> Iterator[Path]:
    """Something that runs commands; yields its socket."""
    path = folder / "forge"
    words = [sys.executable, "-P", ROOT / "test/support/forge.py", path]
    environment = surroundings(
        MPLBACKEND="Agg", PYTHONPATH=os.pathsep.join(sys.path), OPENBLAS_NUM_THREADS="1"
    )
    process = subprocess.Popen(words, env=environment, cwd=folder)
    try:
        while not path.exists():
            assert process.poll() is None
            time.sleep(0.02)
        yield path
    finally:
        process.kill()
        process.wait()


@contextmanager
def running(forge: Path, logs: Path, *commands: Sequence[str | Path]) -> Iterator[int]:
    """Nodes in processes of their own, killed in the end; yields the domain that they have."""
    domain, reservation = reserve_domain()
    environment = surroundings(ROS_DOMAIN_ID=str(domain), ROS_LOG_DIR=str(logs))
    started = []
    try:
        for node, *rest in commands:
            words = [*asking(forge), "arm", node, "--with-parent", *rest]
            silent = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL}
            started.append(subprocess.Popen(words, env=environment, **silent))
        yield domain
    finally:
        for process in started:
            process.kill()
            process.wait()
        reservation.close()
