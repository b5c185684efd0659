# SPDX-License-Identifier: Apache-2.0
"""The tests that the table of errata names exist, and its rows are whole."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "docs/concepts/errata.md").read_text()


def test_tests_exist_and_rows_have_four_cells() -> None:
    for shown in re.findall(r"`(test_\w+\.py[\w:]*)`", TEXT):
        file, _, name = shown.partition("::")
        (found,) = (ROOT / "test").rglob(file)
        assert f"def {name}(" in found.read_text(), shown
    rows = [line for line in TEXT.splitlines() if line.startswith("|")]
    assert {len(re.split(r"(?<!\\)\|", row)) for row in rows} == {6}
