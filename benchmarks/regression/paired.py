# SPDX-License-Identifier: Apache-2.0
"""Time every line in this tree and in an older revision, by turns, and print the ratios.

``./arm python -m benchmarks.regression.paired REVISION``. The older tree is a temporary git
worktree; each tree has a process and a kernel cache of its own. The two processes measure by
turns, a few milliseconds each, so that a slow second hits both; the least of a line counts. Both
are started anew several times, as where things lie in memory decides too. A line is slower if
the whole confidence interval of the median ratio is above what is allowed, and open if that lies
inside.
"""

import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Self

import click
import numpy as np
from rich.console import Console
from rich.table import Table

from benchmarks.measurement.intervals import of_median
from benchmarks.regression.lines import lines
from benchmarks.reporting.markdown import duration
from benchmarks.reporting.progress import Bar

ROOT = Path(__file__).parents[2]
RECORDER = Path(__file__).with_name("recorder.py")
ALLOWED = 1.05  # ratio of this tree's time to the older one's


class Recorder:
    """``recorder.py`` in a tree; ended by ``with``."""

    def __init__(self, tree: Path, folder: Path, task: Path) -> None:
        """Start it with the tree's packages and a kernel cache in a folder."""
        names = "arm_sim", "arm_dynamics", "arm_studies"  # older trees lack the last
        packages = [str(tree / "src" / name) for name in names]
        path = os.pathsep.join([*packages, os.environ.get("PYTHONPATH", "")])
        folder.mkdir(mode=0o700, exist_ok=True)
        self._process = subprocess.Popen(
            [sys.executable, "-P", str(RECORDER), str(task)],
            env=os.environ | {"PYTHONPATH": path, "XDG_CACHE_HOME": str(folder)},
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        )  # fmt: skip
        module = self._read()
        if not module.startswith(packages[0]):
            self.__exit__()
            raise click.ClickException(f"arm_sim of {tree} is not used, but {module}")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._process.kill()
        self._process.communicate()

    def ask(self, name: str) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write(f"{name}\n")
        self._process.stdin.flush()

    def answer(self) -> float | str:
        """Wait for its time in [s], or why there is none."""
        answer: float | str = json.loads(self._read())
        return answer

    def _read(self) -> str:
        assert self._process.stdout is not None
        if not (line := self._process.stdout.readline()):
            raise click.ClickException("the recorder has ended; its words are above")
        return line.rstrip("\n")


@contextmanager
def worktree(revision: str, folder: Path) -> Iterator[Path]:
    git = ("git", "-C", str(ROOT), "worktree")
    result = subprocess.run([*git, "add", "--detach", str(folder), revision],
                          capture_output=True, text=True)  # fmt: skip
    if result.returncode:
        raise click.ClickException(result.stderr.strip())
    try:
        yield folder
    finally:
        subprocess.run([*git, "remove", "--force", str(folder)], check=True)


def pair(trees: tuple[Path, Path], folder: Path, task: Path, names: list[str], samples: int,
         bar: Bar) -> dict[str, list[float] | str]:  # fmt: skip
    """Least time in [s] of every line in one process of each tree, or why there is none."""
    ratios: dict[str, list[float] | str] = {}
    with (
        Recorder(trees[0], folder / "new", task) as new,
        Recorder(trees[1], folder / "old", task) as old,
    ):
        for name in names:
            ratios[name] = _least(new, old, name, samples)
            bar.done()
    return ratios


def _least(new: Recorder, old: Recorder, name: str, samples: int) -> list[float] | str:
    for recorder in (new, old):
        recorder.ask(name)  # both at once: it may have to be compiled, and is not kept
    for tree, answer in [("this tree", new.answer()), ("the older tree", old.answer())]:
        if isinstance(answer, str):
            return f"{tree}: {answer}"
    taken: tuple[list[float], list[float]] = ([], [])
    turns = [(new, taken[0]), (old, taken[1])]
    for _ in range(samples):
        for recorder, times in turns:
            recorder.ask(name)
            times.append(float(recorder.answer()))
        turns.reverse()
    return [min(times) for times in taken]


def table(
    rounds: list[dict[str, list[float] | str]], revision: str
) -> tuple[Table, list[str], list[str]]:
    """The table, and names of the lines that failed (or were not measured) and of open ones."""
    shown = Table("line", revision, "this tree", "ratio", "95 % interval", "")
    failed, undecided = [], []
    for name in rounds[0]:
        values = [of_round[name] for of_round in rounds]
        if wrong := [value for value in values if isinstance(value, str)]:
            shown.add_row(name, wrong[0])
            failed.append(name)
            continue
        times = np.array(values)
        new, old = np.median(times, axis=0)
        ratios = times[:, 0] / times[:, 1]
        low, high = of_median(ratios)
        verdict = ""
        if low > ALLOWED:
            failed.append(name)
            verdict = "[red]slower"
        elif high > ALLOWED:
            undecided.append(name)
            verdict = "[yellow]open"
        shown.add_row(
            name, duration(old), duration(new), f"{np.median(ratios):.3f}",
            f"{low:.3f} to {high:.3f}", verdict,
        )  # fmt: skip
    return shown, failed, undecided


@click.command()
@click.argument("revision")
@click.option(
    "--only", multiple=True, help="Only lines whose name contains this; may be repeated."
)
@click.option("--processes", default=6, show_default=True, type=click.IntRange(1),
              help="Pairs of processes, alternating; a decision needs at least six.")  # fmt: skip
@click.option("--samples", default=20, show_default=True, type=click.IntRange(1),
              help="Measurements of a line in each process; the minimum counts.")  # fmt: skip
def main(revision: str, only: tuple[str, ...], processes: int, samples: int) -> None:
    """Compare the times of this tree with those of REVISION in pairs.

    Ends with an error if a line surely (95 %) takes more than 1.05 times what it took there. Leave
    the machine alone meanwhile.
    """
    chosen: dict[str, Any] = {
        name: line for name, line in lines().items()
        if not only or any(part in name for part in only)
    }  # fmt: skip
    if not chosen:
        raise click.UsageError(
            f"no line contains {', '.join(only)}; there are {', '.join(lines())}"
        )
    with tempfile.TemporaryDirectory() as temporary:
        folder = Path(temporary)
        task = folder / "lines.json"
        task.write_text(json.dumps(chosen))
        rounds = []
        with worktree(revision, folder / "older") as older, Bar(Console(stderr=True)) as bar:
            for k in range(processes):
                bar.stage(f"pair {k + 1} of {processes}", len(chosen))
                rounds.append(pair((ROOT, older), folder, task, list(chosen), samples, bar))
    shown, failed, undecided = table(rounds, revision)
    Console().print(shown)
    within = len(chosen) - len(failed) - len(undecided)
    click.echo(f"{within} of {len(chosen)} lines within {ALLOWED}, {len(undecided)} open")
    sys.exit(bool(failed))


if __name__ == "__main__":
    main()
