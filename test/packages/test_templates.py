# SPDX-License-Identifier: Apache-2.0
"""What the workflow types is what the pages say."""

from installed import ROOT, steps
from packaging.requirements import Requirement


def test_the_workspace_is_made_as_its_page_says() -> None:
    """What needs root and network is the same in the workflow and in the document."""
    (line,) = (step for step in steps("workspace") if step.startswith("pip install"))
    assert f"\ncolcon build\n{line}\n" in (ROOT / "docs/how-to/install.md").read_text()
    wanted = {Requirement(word.strip('"')).name for word in line.split()[4:]}
    assert wanted == {"casadi", "example-robot-data", "mcap", "pydantic", "numpy"}
