# SPDX-License-Identifier: Apache-2.0
"""Mutation testing: mistakes in Python by cosmic-ray (``pip install cosmic-ray``), in C by this.

    cosmic-ray init tools/cosmic-ray.toml mutations.sqlite    # all mistakes, in some minutes
    python tools/mutate.py draw mutations.sqlite 60 1         # sixty, by the seed 1
    cosmic-ray exec tools/cosmic-ray.toml mutations.sqlite
    cr-report mutations.sqlite --surviving-only
    python tools/mutate.py c 20 1                             # twenty in C, by the seed 1

They are made in this tree, which has to be committed. Tests are those of the mistake's package
folder, ``python tools/mutate.py test``.
"""

import random
import re
import sqlite3
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
TIMEOUT = 900  # [s]
SUFFIXES = (".c", ".cpp", ".h", ".hpp")
# Status of pytest that tells of no failure: passed, an error of its own or of usage, no tests
NOT_CAUGHT = (0, 3, 4, 5)
IN_C = {
    r" < ": (" <= ", " > "), r" > ": (" >= ", " < "), r" <= ": (" < ",), r" >= ": (" > ",),
    r" == ": (" != ",), r" != ": (" == ",), r" \+ ": (" - ",), r" - ": (" + ",),
    r" \* ": (" / ",), r" / ": (" * ",), r" && ": (" || ",), r" \|\| ": (" && ",),
    r" \+= ": (" -= ",), r" -= ": (" += ",), r"\bfmin\(": ("fmax(",), r"\bfmax\(": ("fmin(",),
    r"\b0\b(?!\.)": ("1",), r"\b1\b(?!\.)": ("0",), r"\b0\.5\b": ("0.25",),
}  # fmt: skip
NOT_CODE = re.compile(r"\s*(#|//|/?\*|$)")


def draw(session: str, count: str, seed: str) -> None:
    """Keep some lines of a session and one mistake in each; types are no code."""
    with sqlite3.connect(session) as database:
        lines: dict[tuple[str, int], list[str]] = {}
        for job, path, row in database.execute(
            "SELECT job_id, module_path, start_pos_row FROM mutation_specs"
            " WHERE operator_name NOT LIKE '%BitOr%' ORDER BY 2, 3, operator_name, occurrence"
        ):
            lines.setdefault((path, row), []).append(job)
        rng = random.Random(int(seed))
        kept = [rng.choice(lines[at]) for at in rng.sample(sorted(lines), int(count))]
        marks = ", ".join("?" * len(kept))
        for table in ("mutation_specs", "work_items", "work_results"):
            database.execute(f"DELETE FROM {table} WHERE job_id NOT IN ({marks})", kept)


def test() -> int:
    """Run the tests of the folders in which ``src`` differs from what is committed."""
    git = ["git", "diff", "--name-only", "src"]
    changed = subprocess.run(git, cwd=ROOT, capture_output=True, text=True, check=True).stdout
    folders = {str(tests_of(Path(path))) for path in changed.split()}
    command = ["./arm", "test", "-x", "-q", *sorted(folders)]
    return subprocess.run(command, cwd=ROOT, timeout=TIMEOUT, check=False).returncode


def tests_of(path: Path) -> Path:
    """Of ``src/PACKAGE/PACKAGE/A/B/file``: ``test/PACKAGE/A/B``, or the nearest above."""
    folder = Path("test", path.parts[1], *path.parts[3:-1])
    while not (ROOT / folder).is_dir():
        folder = folder.parent
    return folder


def in_c(count: str, seed: str) -> int:
    """Make mistakes in C, one by one; whether tests missed one."""
    files = sorted(path for path in (ROOT / "src").rglob("*") if path.suffix in SUFFIXES)
    places = [
        (path, number, match.start(), match.end(), pattern)
        for path in files
        for number, line in enumerate(path.read_text().splitlines())
        if not NOT_CODE.match(line)
        for pattern in IN_C
        for match in re.finditer(pattern, line)
    ]
    rng, survivors = random.Random(int(seed)), 0
    for path, number, start, end, pattern in rng.sample(places, int(count)):
        before, after = path.read_text(), rng.choice(IN_C[pattern])
        lines = before.splitlines(keepends=True)
        lines[number] = lines[number][:start] + after + lines[number][end:]
        path.write_text("".join(lines))
        try:
            caught = test() not in NOT_CAUGHT
        except subprocess.TimeoutExpired:
            caught = True
        finally:
            path.write_text(before)
        survivors += not caught
        place = f"{path.relative_to(ROOT)}:{number + 1}"
        print("caught  " if caught else "SURVIVED", place, lines[number].strip(), flush=True)
    return bool(survivors)


if __name__ == "__main__":
    sys.exit({"draw": draw, "test": test, "c": in_c}[sys.argv[1]](*sys.argv[2:]))
