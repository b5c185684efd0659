# SPDX-License-Identifier: Apache-2.0
"""Execution of a sweep, from its study to its table."""

import os
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, closing
from dataclasses import replace
from itertools import batched
from pathlib import Path

import numpy as np

from arm_dynamics.attributes import frozen
from arm_studies._renaming import renamed_argument, renamed_attribute
from arm_studies.sweeps.design import points
from arm_studies.sweeps.journal import Journal
from arm_studies.sweeps.metrics import check_joints
from arm_studies.sweeps.recipes import Group, Planner
from arm_studies.sweeps.runs import Row
from arm_studies.sweeps.sharing import Task, Workers, check_libraries, worker_pool
from arm_studies.sweeps.study import Study, StudySource, load_study
from arm_studies.sweeps.table import Table, table_of
from arm_studies.sweeps.world import world_of

# Runs per task such that the cost of passing it to a worker is negligible.
_COMPILED_RUNS, _OTHER_RUNS = 32, 2
_LEAST_TASKS = 4  # tasks per worker, such that none is idle at the end
_LEAST_RESULTS = 3  # results required for an estimate of the remaining time


@frozen
class Plan:
    """Extent of a sweep.

    Attributes:
        runs: Number of all runs.
        worlds: Number of sets of equations that are generated and compiled.
        compiled: Number of runs simulated entirely in compiled code; in the others, controller,
            sensors or delays run in Python.
        tunable: Keys whose values are inputs of the equations.
    """

    runs: int
    worlds: int
    compiled: int
    tunable: tuple[str, ...]


@frozen
class Sweep:
    """A finished sweep.

    Attributes:
        study: Its study.
        plan: Its extent.
        table: One row for each run, in order.
        simulated: Number of runs simulated now; the others were in the journal.
        seconds: Duration of those in [s].
        dropped: Whether a damaged last line of the journal was dropped.
    """

    study: Study
    plan: Plan
    table: Table
    simulated: int
    seconds: float
    dropped: bool = False
    made = renamed_attribute("made", "simulated")

    def __repr__(self) -> str:
        """A summary: runs, how they ended, and the median of each metric."""
        plan, table = self.plan, self.table
        lines = [
            f"<Sweep: {plan.runs} runs of {self.study.duration:g} s, {np.sum(table.done)} done, "
            f"{plan.compiled} in compiled code, sets of equations: {plan.worlds}",
            *([f"varied: {', '.join(table.varied)}"] if table.varied else []),
        ]
        for name in table.metrics if table.done.any() else ():
            least, median, most = np.percentile(table[name][table.done], (0, 50, 100))
            lines.append(f"{name}: median {median:.4g}, from {least:.4g} to {most:.4g}")
        return "\n  ".join(lines) + ">"


@frozen
class Progress:
    """Progress of a sweep.

    Attributes:
        done: Number of finished runs, earlier ones included.
        total: Number of all runs.
        remaining: Remaining time in [s]; None while too little is known.
        activity: What is being done.
    """

    done: int
    total: int
    remaining: float | None
    activity: str
    what = renamed_attribute("what", "activity")


@renamed_argument("told", "on_progress")
def sweep(
    source: StudySource,
    out: str | os.PathLike[str] | None = None,
    *,
    workers: int | None = None,
    cluster: str | None = None,
    on_progress: Callable[[Progress], None] | None = None,
) -> Sweep:
    """Simulate the runs of a study.

    Results depend on the study alone: they are bitwise identical for any number of workers and
    order of execution.

    Args:
        source: A study, or anything that ``load_study`` accepts.
        out: Folder for the journal of finished runs: if called again, only missing runs are
            simulated. With None, nothing is written.
        workers: Number of processes; None for one per core, 1 for this process alone.
        cluster: Address of a Dask scheduler, whose workers are used instead.
        on_progress: Called with the progress.

    Returns:
        The table and information about the sweep.

    Raises:
        InvalidInput: If the folder holds runs of another study, a library is missing, or no
            scheduler answers at the address.
        SceneError: If the study, or the scene of its first run, cannot be used.

    Example:
        >>> done = sweep({"scene": "panda", "duration": 1.0,
        ...               "vary": {"joints.*.friction.viscous": {"uniform": [0, 1]}},
        ...               "samples": 100})  # doctest: +SKIP
        >>> done.table["tracking_rms"].max()  # doctest: +SKIP
    """
    check_libraries(workers, cluster)
    study = load_study(source)
    runs = points(study)
    planner = Planner(study)
    groups = planner.groups(runs)
    report = on_progress or (lambda progress: None)
    report(Progress(0, len(runs), None, "building the first arm"))
    # An error of the first run is raised, since the others would fail in the same way.
    world = world_of(planner.recipe(groups[0]))
    world.check(groups[0].jobs[0])
    check_joints(study.metrics, world.joint_names)
    compiled = sum(len(planner.split(group).compiled) for group in groups)
    tunable = tuple(dict.fromkeys(key for group in groups for key in group.slots))
    plan = Plan(len(runs), len(groups), compiled, tunable)
    with ExitStack() as stack:
        journal = None
        if out is not None:
            journal = stack.enter_context(closing(Journal(Path(out), planner.inputs(groups))))
        rows = dict(journal.rows) if journal else dict[int, Row]()
        begin, before = time.perf_counter(), len(rows)
        left = [[job for job in group.jobs if job.index not in rows] for group in groups]
        pairs = zip(groups, left, strict=True)
        missing = [replace(group, jobs=jobs) for group, jobs in pairs if jobs]
        if missing:
            pool = stack.enter_context(worker_pool(workers, cluster))
            for activity, remaining in _simulate(planner, missing, pool, rows, journal):
                report(Progress(len(rows), len(runs), remaining, activity))
        seconds = time.perf_counter() - begin
    return Sweep(
        study=study, plan=plan, table=table_of(study, runs, rows), simulated=len(rows) - before,
        seconds=seconds, dropped=journal is not None and journal.dropped,
    )  # fmt: skip


def _simulate(
    planner: Planner, groups: Sequence[Group], pool: Workers, rows: dict[int, Row],
    journal: Journal | None,
) -> Iterator[tuple[str, float | None]]:  # fmt: skip
    """Simulate groups of runs into rows by number and the journal.

    Yields:
        The current activity, and the remaining time in [s]; None while too little is known.
    """
    # Code that several workers share is compiled once, before they start.
    builds = list[Task]()
    for group in groups:
        if len(group.jobs) > 1 and pool.size > 1:
            compiled = group.jobs[0] in planner.split(group).compiled
            builds.append(Task(planner.recipe(group), (), compiled))
    for k, _ in enumerate(pool.results(builds), 1):
        yield f"compiling, {k} of {len(builds)}", None
    remaining = sum(len(group.jobs) for group in groups)
    for number, results in enumerate(pool.results(_tasks(planner, groups, pool.size)), 1):
        if journal is not None:
            journal.add(results)
        rows.update((row.index, row) for row in results)
        remaining, now = remaining - len(results), time.perf_counter()
        if number == 1:  # processes have started, and the first world is built
            first, begin = remaining, now
        known = number >= _LEAST_RESULTS
        yield "running", remaining * (now - begin) / (first - remaining) if known else None


def _tasks(planner: Planner, groups: Sequence[Group], workers: int) -> Iterator[Task]:
    for group in groups:
        recipe = planner.recipe(group)
        runs = planner.split(group)
        for jobs, most in ((runs.compiled, _COMPILED_RUNS), (runs.others, _OTHER_RUNS)):
            size = max(1, min(most, len(jobs) // (workers * _LEAST_TASKS)))
            for part in batched(jobs, size):
                yield Task(recipe, part, jobs is runs.compiled)
