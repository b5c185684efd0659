# SPDX-License-Identifier: Apache-2.0
"""``python -m benchmarks.sweeps``: a study uninterrupted, killed and resumed, and on a cluster."""

from __future__ import annotations

import json
import resource
import signal
import subprocess
import sys
import tempfile
from importlib.util import find_spec
from pathlib import Path

import click

from arm_studies.sweeps import Study, Sweep, load_study, sweep
from benchmarks.reporting.markdown import number, table

STUDY = Path(__file__).parents[2] / "examples" / "ten_thousand_loops.yaml"
KILLED_AT = 0.4  # of the runs
KILLER = """
import os, signal, sys
from arm_studies.sweeps import sweep
file, out, workers, share = sys.argv[1:]
def told(progress):
    if progress.done > float(share) * progress.total:
        os.kill(os.getpid(), signal.SIGKILL)
sweep(file, out, workers=int(workers), told=told)
"""


@click.command()
@click.option(
    "--runs", type=click.IntRange(1), help="Number of closed loops.  [default: as in the study]"
)
@click.option("--workers", default=2, show_default=True, type=click.IntRange(1),
              help="Processes on this machine.")  # fmt: skip
@click.option("--cluster-workers", default=4, show_default=True, type=click.IntRange(1),
              help="Workers of the local Dask cluster.")  # fmt: skip
@click.option("--out", default=Path("reports/sweeps.json"), show_default=True,
              type=click.Path(path_type=Path), help="JSON file for the results.")  # fmt: skip
def main(runs: int | None, workers: int, cluster_workers: int, out: Path) -> None:
    """Time examples/ten_thousand_loops.yaml; repeat it killed and resumed, and on a cluster.

    The three tables must agree to the bit.
    """
    if find_spec("distributed") is None:  # before a minute of work, not after it
        raise click.ClickException("Dask is missing: './arm setup sweep' installs it")
    study = load_study(STUDY)
    if runs is not None:
        study = study.model_copy(update={"samples": runs})
    sweep(study.model_copy(update={"samples": 1}), workers=1)  # compiles
    with tempfile.TemporaryDirectory() as folder:
        told = _figures(study, workers, cluster_workers, Path(folder))
    click.echo(table(["", ""], [[name, _text(value)] for name, value in told.items()]))
    out.parent.mkdir(parents=True, exist_ok=True)
    out.write_text(json.dumps(told, indent=1))
    if not (told["resumed: the same bits"] and told["on the cluster: the same bits"]):
        raise click.ClickException("the tables differ")


def _figures(
    study: Study, workers: int, cluster_workers: int, folder: Path
) -> dict[str, float | bool]:
    before = _processor_time()
    whole = sweep(study, folder / "whole", workers=workers)
    spent = _processor_time() - before
    simulated = whole.made * study.duration
    killed, resumed = _killed_and_resumed(study, folder, workers)
    clustered = _on_cluster(study, folder / "cluster", cluster_workers)
    return {
        "closed loops": len(whole.table),
        "of them done": int(whole.table.done.sum()),
        "time [s]": whole.seconds,
        "simulated seconds per second and core": simulated / (whole.seconds * workers),
        "simulated seconds per second of processor time": simulated / spent,
        "killed after": killed,
        "made when resumed": resumed.made,
        "resumed: the same bits": _bits(resumed) == _bits(whole),
        "cluster, time [s]": clustered.seconds,
        "on the cluster: the same bits": _bits(clustered) == _bits(whole),
    }


def _killed_and_resumed(study: Study, folder: Path, workers: int) -> tuple[int, Sweep]:
    """Runs in the journal of a sweep that got SIGKILL in the middle, and the sweep resumed."""
    file, out = folder / "study.yaml", folder / "killed"
    file.write_text(json.dumps(study.model_dump(mode="json", exclude_unset=True)))
    told = str(file), str(out), str(workers), str(KILLED_AT)
    process = subprocess.run([sys.executable, "-P", "-c", KILLER, *told])
    if process.returncode != -signal.SIGKILL:
        raise click.ClickException(f"the sweep to kill ended by itself: {process.returncode}")
    return (out / "runs.jsonl").read_bytes().count(b"\n") - 1, sweep(file, out, workers=workers)


def _on_cluster(study: Study, out: Path, workers: int) -> Sweep:
    from distributed import LocalCluster

    with LocalCluster(
        n_workers=workers, threads_per_worker=1, dashboard_address=None, local_directory=str(out)
    ) as cluster:  # fmt: skip
        return sweep(study, out, cluster=cluster.scheduler_address)


def _bits(done: Sweep) -> dict[str, bytes]:
    return {name: column.tobytes() for name, column in done.table.columns.items()}


def _processor_time() -> float:
    """Of this process and of its children that have ended, in [s]."""
    kinds = resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN
    return sum(use.ru_utime + use.ru_stime for use in map(resource.getrusage, kinds))


def _text(value: float | bool) -> str:
    return ("no", "yes")[value] if isinstance(value, bool) else number(value)
