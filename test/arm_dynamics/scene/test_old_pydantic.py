# SPDX-License-Identifier: Apache-2.0
"""An older pydantic, such as that of Ubuntu 24.04, is refused by name."""

import os
import subprocess
import sys
from pathlib import Path

import pytest


@pytest.mark.parametrize(
    ("version", "line"), [("2.5.3", "describe pendulum"), ("1.10.14", "sweep x.yaml")]
)
def test_an_older_pydantic_is_named_with_its_place_and_the_remedy(
    version: str, line: str, tmp_path: Path
) -> None:
    (tmp_path / "pydantic.py").write_text(f"VERSION = {version!r}\n")
    done = subprocess.run(
        [sys.executable, "-P", "-m", "arm_studies.cli", *line.split()],
        env={**os.environ, "PYTHONPATH": os.pathsep.join([str(tmp_path), *sys.path])},
        capture_output=True, text=True, timeout=60,
    )  # fmt: skip
    assert (done.returncode, done.stdout) == (1, "")
    assert done.stderr == (
        f"error: pydantic {version} of '{tmp_path}/pydantic.py' is too old; 2.6 or newer is "
        "expected: pip install 'pydantic>=2.6' (in a workspace on Ubuntu 24.04 with --target "
        "install/arm_dynamics/lib/python3.12/site-packages)\n"
    )
