# SPDX-License-Identifier: Apache-2.0
"""Runs distributed to other processes, of this machine and of a cluster: the same table."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
import yaml

from arm_dynamics import InvalidInput
from arm_dynamics.scene import load_scene
from arm_studies.sweeps import sweep
from arm_studies.sweeps.table import Table

with_group = pytest.mark.group("sweep")
STUDY: dict[str, Any] = {
    "scene": {
        "robot": {"urdf": load_scene("two_link").robot.urdf},
        "payloads": [{"frame": "tip", "mass": 0.5}],
    },
    "duration": 0.3,
    "motion": {"points": [{"time": 0.25, "position": {"elbow": 0.2}}]},
    "vary": {
        "controller": ["computed_torque", "pid"],
        "payloads.0.mass": {"uniform": [0.1, 2.0]},
        "joints.*.friction.viscous": {"log_uniform": [0.05, 1.0]},
    },
    "samples": 8,
}
RUNS = 16  # of two controllers


def bits(table: Table) -> dict[str, bytes]:
    """A table as what can be compared to the bit."""
    return {name: column.tobytes() for name, column in table.columns.items()}


@pytest.fixture(scope="module")
def alone() -> dict[str, bytes]:
    """The table of this process alone."""
    return bits(sweep(STUDY, workers=1).table)


@with_group
def test_processes_make_the_same_table(alone: dict[str, bytes]) -> None:
    assert bits(sweep(STUDY, workers=2).table) == alone


@with_group
@pytest.mark.filterwarnings("ignore::ResourceWarning")  # the cluster's own sockets
def test_a_cluster_makes_the_same_table(alone: dict[str, bytes], tmp_path: Path) -> None:
    import distributed

    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None, local_directory=str(tmp_path)
    ) as cluster:
        pids = {worker.pid for worker in cluster.workers.values()}
        assert len(pids - {os.getpid()}) == 2
        assert bits(sweep(STUDY, cluster=cluster.scheduler_address).table) == alone


@with_group
def test_killed_with_its_workers_and_called_again(alone: dict[str, bytes], tmp_path: Path) -> None:
    """The kill is real: SIGKILL, once the first runs are in the journal; workers end by it."""
    file, out = tmp_path / "study.yaml", tmp_path / "out"
    file.write_text(yaml.safe_dump(STUDY, sort_keys=False))
    killer = (
        "import os, signal, sys\n"
        "from pathlib import Path\n"
        "from arm_studies.sweeps import sweep\n"
        "def told(progress):\n"
        "    if progress.done:\n"
        "        tasks = Path('/proc/self/task').glob('*/children')\n"
        "        print(*(task.read_text() for task in tasks), flush=True)\n"
        "        os.kill(os.getpid(), signal.SIGKILL)\n"
        "sweep(sys.argv[1], sys.argv[2], workers=2, on_progress=told)\n"
    )
    with subprocess.Popen(
        [sys.executable, "-P", "-c", killer, str(file), str(out)],
        stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
    ) as killed:  # fmt: skip
        # The pipe is closed when the last of its writers has ended, workers included.
        told, _ = killed.communicate(timeout=120)
    children = [int(pid) for pid in told.split()]
    assert killed.returncode == -signal.SIGKILL and len(children) >= 2
    until = time.monotonic() + 20.0
    while any(map(running, children)) and time.monotonic() < until:
        time.sleep(0.1)
    assert [pid for pid in children if running(pid)] == []
    done = len((out / "runs.jsonl").read_text().splitlines()) - 1
    assert 0 < done < RUNS
    again = sweep(file, out, workers=1)
    assert again.simulated == RUNS - done
    assert bits(again.table) == alone


def running(pid: int) -> bool:
    """Whether a process is there and no zombie."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


@with_group
@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"workers": 0}, "workers = "),
        ({"workers": 2, "cluster": "tcp://127.0.0.1:1"}, "a cluster has its own workers"),
        ({"cluster": "tcp://127.0.0.1:1"}, "'tcp://127.0.0.1:1': no Dask scheduler answers"),
    ],
)
def test_nobody_to_share_with(
    given: dict[str, Any], said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("arm_studies.sweeps.sharing._TIMEOUT", 0.2)
    with pytest.raises(InvalidInput, match=said):
        sweep(STUDY, **given)


def test_missing_libraries_are_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "joblib", None)
    with pytest.raises(InvalidInput, match="cannot find the module 'joblib'.*arm setup sweep"):
        sweep(STUDY, workers=2)
