# SPDX-License-Identifier: Apache-2.0
"""Every example runs in a process of its own; what it claims it asserts itself.

The processes are made by ``forge.py``, so that none of them imports the suite again.
"""

import re
import subprocess
from pathlib import Path

import pytest
from forging import asking
from harness import surroundings

ROOT = Path(__file__).parents[2]
EXAMPLES = sorted((ROOT / "examples").glob("[0-9]*.py"))
# Numbers that a page quotes from what an example prints: where they are on the page, and there.
QUOTED = {
    "30_identify_a_panda": (
        "tutorials/identify.md",
        r"tracking error falls from (\d+) mrad to (\d+) to (\d+)",
        r"tracking error (\S+) mrad rms",
    )
}


@pytest.mark.parametrize("example", EXAMPLES, ids=lambda path: path.stem)
def test_example_runs(example: Path, tmp_path: Path, forge: Path) -> None:
    done = subprocess.run(
        [*asking(forge), "script", example], cwd=tmp_path, env=surroundings(MPLBACKEND="Agg"),
        capture_output=True, text=True, timeout=600,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr[-2000:]
    assert done.stdout
    if example.stem in QUOTED:
        page, quoted, printed = QUOTED[example.stem]
        (numbers,) = re.findall(quoted, (ROOT / "docs" / page).read_text())
        nominal, least, most = (float(x) for x in numbers)
        before, after = (float(x) for x in re.findall(printed, done.stdout))
        assert nominal == pytest.approx(before, rel=0.1)
        assert 0.9 * least < after < 1.1 * most
