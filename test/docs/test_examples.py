# SPDX-License-Identifier: Apache-2.0
"""Every example runs in a process of its own; what it claims it asserts itself.

The processes are made by ``forge.py``, so that none of them imports the suite again.
"""

from __future__ import annotations

import subprocess
from pathlib import Path

import pytest
from forging import asking
from harness import surroundings

EXAMPLES = sorted((Path(__file__).parents[2] / "examples").glob("[0-9]*.py"))


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_example_runs(example: Path, tmp_path: Path, forge: Path) -> None:
    done = subprocess.run(
        [*asking(forge), "script", example], cwd=tmp_path, env=surroundings(MPLBACKEND="Agg"),
        capture_output=True, text=True, timeout=120,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]
    assert done.stdout


def test_there_are_examples() -> None:
    assert len(EXAMPLES) >= 6
