# SPDX-License-Identifier: Apache-2.0
"""Show whether two revisions of the suite behave identically.

    ./arm python tools/same_behaviour.py                  # this working tree against HEAD
    ./arm python tools/same_behaviour.py v1 --only c,states --scenes panda z1
    ./arm python tools/same_behaviour.py v1 --record /tmp/v1      # for later comparisons
    ./arm python tools/same_behaviour.py --against /tmp/v1

Compared to the bit: the C code that is generated for the shipped scenes by every method (``c``),
the handwritten C that is compiled with it (``drivers``), short runs (``states``), terms of the
equation of motion and derivatives (``terms``), what commands print (``help``, ``describe``), what
nodes offer (``ros``) and publish (``messages``). The messages of arm_msgs are those that are built
now, for both. The exit status is 1 if anything differs.
"""

from __future__ import annotations

import argparse
import difflib
import gzip
import json
import os
import subprocess
import sys
import tempfile
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
RECORDER = Path(__file__).with_name("record_behaviour.py")
SCENES = Path("src/arm_sim/arm_sim/scenes")
RECORDS = "records.json"
PACKAGES = ("src/arm_studies", "src/arm_sim", "src/arm_dynamics")
JOBS = {
    "help": ("help",),
    "nodes": ("ros", "messages"),
    "code": ("c", "drivers"),
    "describe": ("describe",),
    "motion": ("states", "terms"),
}
OF_A_SCENE = ("code", "motion", "describe")
GROUPS = tuple(group for groups in JOBS.values() for group in groups)


def main() -> int:
    """Compare, or only record; return the exit status."""
    options = arguments()
    groups = [g for g in GROUPS if g in options.only and g not in options.ignore]
    with tempfile.TemporaryDirectory(prefix="behaviour-") as name:
        scratch = Path(name)
        if options.record:
            with revision(options.revision, scratch / "tree") as tree:
                take(tree, options.record, groups, options.scenes, options.jobs)
            return 0
        before = options.against
        if before is None:
            before = scratch / "before"
            with revision(options.revision, scratch / "tree") as tree:
                take(tree, before, groups, options.scenes, options.jobs)
        after = scratch / "after"
        take(ROOT, after, groups, options.scenes, options.jobs)
        return compare(before, after, groups, options.scenes, options.lines)


def arguments() -> argparse.Namespace:
    """What was asked for."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("revision", nargs="?", default="HEAD", help="what to compare with")
    parser.add_argument("--scenes", nargs="+", metavar="SCENE", help="only these shipped scenes")
    parser.add_argument("--only", type=listed, default=GROUPS, metavar="GROUP,...")
    parser.add_argument("--ignore", type=listed, default=(), metavar="GROUP,...")
    parser.add_argument("--record", type=Path, metavar="FOLDER", help="record REVISION, and stop")
    parser.add_argument("--against", type=Path, metavar="FOLDER", help="compare with a record")
    parser.add_argument("--jobs", type=int, default=1, help="processes at once")
    parser.add_argument("--lines", type=int, default=30, help="of a difference to show")
    return parser.parse_args()


def listed(text: str) -> tuple[str, ...]:
    """Names of groups with commas between them."""
    names = tuple(text.split(","))
    if unknown := [name for name in names if name not in GROUPS]:
        allowed = ", ".join(GROUPS)
        raise argparse.ArgumentTypeError(f"{', '.join(unknown)}; allowed: {allowed}")
    return names


@contextmanager
def revision(name: str, folder: Path) -> Iterator[Path]:
    """A checkout of a revision, removed in the end."""
    git = ["git", "-C", str(ROOT), "worktree"]
    subprocess.run([*git, "add", "--quiet", "--detach", str(folder), name], check=True)
    try:
        yield folder
    finally:
        subprocess.run([*git, "remove", "--force", str(folder)], check=True)


# --- recording ---------------------------------------------------------------------------------


def take(
    tree: Path, folder: Path, groups: Sequence[str], scenes: Sequence[str] | None, jobs: int
) -> None:
    """Record what a tree does.

    Args:
        tree: A checkout.
        folder: Receives ``records.json``, digests by name, and ``texts``; adds to what is there.
        groups: Groups to record.
        scenes: Names of shipped scenes, None for all.
        jobs: Processes at once.
    """
    folder.mkdir(parents=True, exist_ok=True)
    shipped = scenes or sorted(path.stem for path in (tree / SCENES).glob("*.yaml"))
    work = [
        (job, scene)
        for job, made in JOBS.items()
        if set(made) & set(groups)
        for scene in (shipped if job in OF_A_SCENE else ["all"])
    ]
    with tempfile.TemporaryDirectory(prefix="cache-") as cache, ThreadPoolExecutor(jobs) as pool:
        digests = load(folder) if (folder / RECORDS).exists() else {}
        for part in pool.map(lambda item: record(tree, folder, Path(cache), *item), work):
            digests |= {name: digest for name, digest in part.items() if group_of(name) in groups}
            (folder / RECORDS).write_text(json.dumps(digests, indent=1, sort_keys=True))


def record(tree: Path, folder: Path, cache: Path, job: str, scene: str) -> dict[str, str]:
    """One job in a process of its own; a failure is recorded as such."""
    command = [sys.executable, "-P", str(RECORDER), job, str(tree / SCENES), scene, str(folder)]
    done = subprocess.run(
        command,
        env=surroundings(tree, cache),
        cwd=cache,
        stdout=subprocess.DEVNULL,
        stderr=subprocess.PIPE,
        text=True,
        check=False,
    )
    if done.returncode != 0:
        raise RuntimeError(f"{job} of {scene} could not be recorded in {tree}:\n{done.stderr}")
    part = folder / f"{job}-{scene}.json"
    digests: dict[str, str] = json.loads(part.read_text())
    part.unlink()
    return digests


def surroundings(tree: Path, cache: Path) -> dict[str, str]:
    """The environment of ``./arm``, with the packages of a tree in place of this one's."""
    ours = {str(ROOT / package) for package in PACKAGES}
    kept = [p for p in os.environ.get("PYTHONPATH", "").split(os.pathsep) if p and p not in ours]
    return {
        **os.environ,
        "PYTHONPATH": os.pathsep.join([*(str(tree / package) for package in PACKAGES), *kept]),
        "PYTHONDONTWRITEBYTECODE": "1",
        "XDG_CACHE_HOME": str(cache),
        "ROS_LOG_DIR": str(cache / "log"),
        "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST",
    }


# --- comparing ---------------------------------------------------------------------------------


def compare(
    before: Path, after: Path, groups: Sequence[str], scenes: Sequence[str] | None, lines: int
) -> int:
    """Print how two records differ.

    Returns:
        1 if they do, else 0.
    """
    old, new = (chosen(load(folder), groups, scenes) for folder in (before, after))
    print(f"{'group':10} {'records':>8} {'equal':>8} {'differ':>8} {'gone':>6} {'new':>6} raised")
    for group in groups:
        a, b = ({n: d for n, d in x.items() if group_of(n) == group} for x in (old, new))
        both = a.keys() & b.keys()
        equal = sum(a[name] == b[name] for name in both)
        counts = len(a | b), equal, len(both) - equal, len(a) - len(both), len(b) - len(both)
        errors = sum(text(after, d).startswith("raised ") for d in b.values())
        print("{:10} {:8} {:8} {:8} {:6} {:6} {:6}".format(group, *counts, errors))
    differing = [name for name in sorted(old | new) if old.get(name) != new.get(name)]
    show(differing, before, after, old, new, lines)
    return 1 if differing else 0


def load(folder: Path) -> dict[str, str]:
    """Digests by name."""
    digests: dict[str, str] = json.loads((folder / RECORDS).read_text())
    return digests


def chosen(
    records: dict[str, str], groups: Sequence[str], scenes: Iterable[str] | None
) -> dict[str, str]:
    """Those of some groups and scenes; what belongs to no scene belongs to all."""
    allowed = None if scenes is None else set(scenes)
    return {
        name: digest
        for name, digest in records.items()
        if group_of(name) in groups
        and (allowed is None or name.count("/") < 2 or name.split("/")[1] in allowed)
    }


def group_of(name: str) -> str:
    """The group of a record."""
    return name.partition("/")[0]


def text(folder: Path, digest: str | None) -> str:
    """The text of a record, empty for one that is not there."""
    if digest is None:
        return ""
    return gzip.decompress((folder / "texts" / f"{digest}.gz").read_bytes()).decode()


def show(
    names: Sequence[str],
    before: Path,
    after: Path,
    old: dict[str, str],
    new: dict[str, str],
    lines: int,
) -> None:
    """Print every name that differs, and the beginnings of differences, each of them once."""
    shown: set[tuple[str | None, str | None]] = set()
    for name in names:
        pair = old.get(name), new.get(name)
        print(
            f"\n{name}: {'gone' if pair[1] is None else 'new' if pair[0] is None else 'differs'}"
        )
        if pair in shown or None in pair:
            continue
        shown.add(pair)
        sides = text(before, pair[0]).splitlines(), text(after, pair[1]).splitlines()
        for number, line in enumerate(difflib.unified_diff(*sides, "before", "after", "", "", 2)):
            if number >= lines:
                print("    ...")
                break
            print("   ", line.rstrip("\n")[:200])


if __name__ == "__main__":
    sys.exit(main())
