# SPDX-License-Identifier: Apache-2.0
"""An older pydantic, such as that of Ubuntu 24.04, is refused by name."""

import os
import subprocess
import sys
from pathlib import Path


def test_an_older_pydantic_is_named_with_its_place_and_the_remedy(tmp_path: Path) -> None:
    (tmp_path / "pydantic.py").write_text("VERSION = '2.5.3'\n")
    done = subprocess.run(
        [sys.executable, "-P", "-m", "arm_studies.cli", "sweep", "x.yaml"],
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), *sys.path])},
        capture_output=True, text=True, timeout=60,
    )  # fmt: skip
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr == (
        f"error: pydantic 2.5.3 of '{tmp_path}/pydantic.py' is too old; 2.6 or newer is "
        "expected: pip install 'pydantic>=2.6' (in a workspace on Ubuntu 24.04 with --target "
        "install/arm_dynamics/lib/python3.12/site-packages)\n"
    )
