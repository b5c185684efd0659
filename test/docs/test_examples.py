# SPDX-License-Identifier: Apache-2.0
"""Every example runs in a process of its own; what it claims it asserts itself.

The processes are made by ``forge.py``, so that none of them imports the suite again.
"""

import subprocess
from pathlib import Path

import pytest
from forging import asking
from harness import surroundings

ROOT = Path(__file__).parents[2]
EXAMPLES = sorted((ROOT / "examples").glob("[0-9]*.py"))


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_example_runs(example: Path, tmp_path: Path, forge: Path) -> None:
    done = subprocess.run(
        [*asking(forge), "script", example], cwd=tmp_path, env=surroundings(MPLBACKEND="Agg"),
        capture_output=True, text=True, timeout=600,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]
    assert done.stdout
